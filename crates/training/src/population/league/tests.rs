//! A tiny league: what it records, and that no interruption and no thread changes it.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::*;
use crate::experiment::{Remark, TrainingIntervals};
use crate::sim::PlantKind;
use crate::world::Scenario;

fn world() -> Scenario {
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    world.on(PlantKind::Kinematic)
}

fn request(rounds: usize) -> LeagueRequest<'static> {
    let training = TrainRequest {
        seed: Some(5),
        decisions: Some(1500),
        ..TrainRequest::default()
    };
    LeagueRequest {
        payoff_starts: 20,
        response_starts: 10,
        ..LeagueRequest::new(training, rounds)
    }
}

/// A watch under which a short training has several lines and checkpoints.
fn frequent(watch: Watch<'_>) -> Watch<'_> {
    Watch {
        intervals: TrainingIntervals {
            report_episodes: 7,
            checkpoint_decisions: 400,
        },
        ..watch
    }
}

/// Files of a league except those with processor times, by name.
fn files(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let members = (0..3).map(|n| format!("members/{n:03}/policy.safetensors"));
    for name in members.chain(["league.jsonl".to_owned(), "population.json".to_owned()]) {
        let bytes = std::fs::read(path.join(&name)).expect("a file");
        found.insert(name, bytes);
    }
    found
}

#[test]
fn a_league_records_populations_and_responses_that_agree() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("league");
    let watch = frequent(Watch::unwatched());
    let rounds = train_league(&world(), &path, &request(2), false, &watch).expect("trained");
    let open = PopulationDir::open(&path).expect("sound");
    assert_eq!(LeagueRound::all(&open).expect("sound"), rounds);
    assert_eq!((rounds.len(), open.manifest().members.len()), (3, 3));
    assert!(open.manifest().finished);
    for (number, round) in rounds.iter().enumerate() {
        assert_eq!(round.payoffs.len(), number + 1);
        for row in &round.payoffs {
            assert_eq!(row.len(), round.egos.len());
            assert!(row.iter().all(|recall| (0.0..=1.0).contains(recall)));
        }
        for mixture in [&round.ado_mixture, &round.ego_mixture] {
            assert!((mixture.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        }
        let gains = row_gains(&round.payoffs, &round.ego_mixture);
        let pairs = gains.iter().zip(&round.ado_mixture);
        let value: f64 = pairs.map(|(gain, share)| gain * share).sum();
        assert!((value - round.value).abs() < 1e-9);
    }
    for pair in rounds.windows(2) {
        let (before, now) = (&pair[0], &pair[1]);
        let ego = now.ego_response.expect("a response");
        assert_eq!(ego.mixture, before.value);
        // The response is the last column, against the mixture before it.
        let last = now.payoffs.iter().map(|row| row[row.len() - 1]);
        let expected: f64 = before
            .ado_mixture
            .iter()
            .zip(last)
            .map(|(share, recall)| share * recall)
            .sum();
        assert!((ego.response - expected).abs() < 1e-9);
        let ado = now.ado_response.expect("a response");
        // A further ego can only lower the value that the same ados reach.
        assert!(ado.mixture <= before.value + 1e-3);
        let sum = (ego.mixture - ego.response).max(0.0) + (ado.response - ado.mixture).max(0.0);
        assert!((now.exploitability.expect("responses") - sum).abs() < 1e-9);
    }
}

#[test]
fn an_interrupted_league_and_other_threads_end_in_the_same_bytes() {
    let dir = tempfile::tempdir().expect("a directory");
    let (whole, parts) = (dir.path().join("whole"), dir.path().join("parts"));
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let alone = threads.expect("a pool");
    let watch = frequent(Watch::unwatched());
    alone.install(|| {
        train_league(&world(), &whole, &request(2), false, &watch).expect("trained");
    });
    // Stopped in the training of the second member, after its first checkpoint.
    let (stop, trainings) = (AtomicBool::new(false), AtomicUsize::new(0));
    let phase = Mutex::new(String::new());
    let remarks = |remark: Remark<'_>| {
        if let Remark::Phase { what, .. } = remark {
            *phase.lock().expect("unpoisoned") = what.to_owned();
        }
    };
    let progress = |done: u64, _: u64| {
        let training = phase.lock().expect("unpoisoned").starts_with("training");
        if training && done == 0 {
            trainings.fetch_add(1, Ordering::SeqCst);
        }
        if training && done > 700 && trainings.load(Ordering::SeqCst) == 2 {
            stop.store(true, Ordering::SeqCst);
        }
    };
    let watch = Watch {
        remarks: &remarks,
        ..frequent(Watch::new(&progress, &stop))
    };
    let rounds = train_league(&world(), &parts, &request(2), false, &watch).expect("stopped");
    assert_eq!(rounds.len(), 1, "stopped in round 1");
    let watch = frequent(Watch::unwatched());
    let other = train_league(&world(), &parts, &request(3), true, &watch);
    assert!(other.is_err(), "another number of rounds");
    let other = LeagueRequest {
        payoff_starts: 21,
        ..request(2)
    };
    let other = train_league(&world(), &parts, &other, true, &watch);
    assert!(other.is_err(), "another number of starts");
    train_league(&world(), &parts, &request(2), true, &watch).expect("trained");
    assert_eq!(files(&whole), files(&parts));
}

/// Ado that brakes whenever it may.
struct Braking;

impl Policy for Braking {
    fn act(&self, obs: &[f32]) -> usize {
        // The observation is scaled from 0 to 30 m/s, with the speed of the ado in third
        // place: it brakes down to 3 m/s.
        usize::from(obs[2] < -0.8)
    }

    fn value(&self, _: &[f32]) -> f32 {
        0.0
    }
}

#[test]
fn a_response_of_the_ego_is_better_and_useless_egos_are_refused() {
    let world = world();
    let family = world.family().expect("a family");
    let watch = frequent(Watch::unwatched());
    let starts = PayoffStarts::new(&world, family, 9, 40, &watch).expect("not stopped");
    let nominal = family.nominal(PlantKind::Kinematic);
    let ego = starts.ego(&nominal).expect("fits");
    let drive = starts.drive_alone(&ego, &watch).expect("not stopped");
    assert_eq!(drive.failures, 0.0, "trivial starts are left out");
    let braking: &dyn Policy = &Braking;
    let response = EgoResponse {
        starts: &starts,
        ados: vec![(1.0, braking)],
        nominal: drive,
    };
    let with = |name: &str, value: f64| {
        let mut member = nominal.clone();
        let mut varied = family.quantities.iter().map(|q| q.varied.name());
        let at = varied.position(|varied| varied == name).expect("varied");
        member.values[at] = value;
        response.recall(&member, &watch)
    };
    let before = response.recall(&nominal, &watch).expect("useful");
    assert!(before > 0.1, "{before}");
    let found = response.search([1, 1], &watch).expect("a response");
    let after = response.recall(&found, &watch).expect("useful");
    assert!(after < before - 0.05, "{before} {after}");
    // It runs into a slower car by itself.
    assert!(with("max_brake_mps2", 0.1).is_err_and(|by| (2.0..=3.0).contains(&by)));
    // It keeps back so far that it hardly drives.
    assert!(with("time_gap_s", 8.0).is_err_and(|by| (1.0..2.0).contains(&by)));
    // Search solves no start.
    assert!(with("time_gap_s", 1.5).is_err());
}
