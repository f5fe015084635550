//! Lemma 1 and Theorem 3: what a counterexample has to spare carries it over.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use brakecheck::crashes::Regressions;
use brakecheck::evaluation::TheoremsError;
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::rl::Policy;
use brakecheck::rulebook::{Rulebook, Verdict};
use brakecheck::stl::Scratch;
use brakecheck::testbench::Episode;
use brakecheck::trace::Trace;
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_evaluation::theorems::{TheoremsRequest, Witness, carry_over};
use proptest::prelude::*;

/// An ado that always does the same.
struct Always(usize);

impl Policy for Always {
    fn act(&self, _obs: &[f32]) -> usize {
        self.0
    }

    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

fn watch() -> Watch<'static> {
    static GO_ON: AtomicBool = AtomicBool::new(false);
    Watch::new(&|_, _| {}, &GO_ON)
}

/// The kept driving counterexamples, replayed.
fn recorded() -> Vec<(PathBuf, Scenario, Episode)> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/regressions");
    let replayed = Regressions::load(dir).expect("kept").replay().expect("ok");
    let driving = replayed.into_iter().filter(|r| r.scenario.grid().is_none());
    driving.map(|r| (r.path, r.scenario, r.episode)).collect()
}

/// The same samples, every real signal moved by at most `by`.
fn moved(trace: &Trace, by: f64, seed: u64) -> Trace {
    let mut dice = brakecheck::seed::generator("moved", &[seed]);
    let mut other = Trace::new(trace.schema().clone());
    let mut row = vec![0.0; trace.schema().len()];
    for sample in 0..trace.len() {
        trace.read_row(sample, &mut row);
        for (value, signal) in row.iter_mut().zip(trace.schema().signals()) {
            let share = f64::from(rand::Rng::next_u32(&mut dice)) / f64::from(u32::MAX);
            if signal.kind == brakecheck::trace::SignalKind::Real {
                *value += by * (2.0 * share - 1.0);
            }
        }
        other.push(&row).expect("finite");
    }
    other
}

fn prefix(trace: &Trace, samples: usize) -> Trace {
    let mut trace = trace.clone();
    trace.truncate(samples);
    trace
}

fn fails(rulebook: &Rulebook, trace: &Trace) -> bool {
    let verdict = rulebook.judge_whole(trace, &mut Scratch::new());
    matches!(verdict, Verdict::Counterexample { .. })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 6, ..ProptestConfig::default() })]

    /// Lemma 1 on real traces: less than τ away, the verdict is the same.
    #[test]
    fn a_trace_less_than_tau_away_is_a_counterexample_too(share in 0.05..0.999f64, seed in any::<u64>()) {
        for (path, world, episode) in recorded() {
            let horizon = world.bench().clock().samples();
            let rulebook = world.rulebook();
            let witness = Witness::of(rulebook, &episode, horizon).expect("a counterexample");
            prop_assert!(0.0 < witness.tau_at_verdict && witness.tau_at_verdict <= witness.tau);
            // Leaves may be steeper than 1 in a signal: go nearer until all are near.
            let mut by = share * witness.tau;
            let near = loop {
                let near = Episode { trace: moved(&episode.trace, by, seed), ..episode.clone() };
                if witness.covers(&witness.distance(rulebook, &near, horizon)) {
                    break near;
                }
                by /= 2.0;
                prop_assert!(1e-9 < by, "{}: nothing is near enough", path.display());
            };
            prop_assert!(fails(rulebook, &prefix(&near.trace, witness.samples)), "{}", path.display());
        }
    }
}

#[test]
fn tau_is_tight_in_the_signal_that_decides() {
    let (_, world, episode) = recorded()
        .into_iter()
        .find(|(path, ..)| path.ends_with("acc-nominal-0001.ron"))
        .expect("a kept crash of `acc`");
    let horizon = world.bench().clock().samples();
    let rulebook = world.rulebook();
    let witness = Witness::of(rulebook, &episode, horizon).expect("a counterexample");
    let headway = episode
        .trace
        .schema()
        .position("headway")
        .expect("a signal");
    for (share, still) in [(0.999, true), (1.001, false)] {
        let mut other = Trace::new(episode.trace.schema().clone());
        let mut row = vec![0.0; episode.trace.schema().len()];
        for sample in 0..episode.trace.len() {
            episode.trace.read_row(sample, &mut row);
            row[headway] += share * witness.tau;
            other.push(&row).expect("finite");
        }
        assert_eq!(fails(rulebook, &prefix(&other, witness.samples)), still);
        let near = Episode {
            trace: other,
            ..episode.clone()
        };
        let distance = witness.distance(rulebook, &near, horizon);
        assert_eq!(witness.covers(&distance), still);
        assert_eq!(witness.covers_sharply(&distance), Some(still));
    }
}

#[test]
fn no_covered_counterexample_is_lost_in_any_shipped_world() {
    let mut covered = 0;
    for (name, world) in super::shipped() {
        // Theorem 3 speaks of worlds in which every violation counts.
        if world.grid().is_some() || !world.rulebook().counts.is_violation() {
            continue;
        }
        let nominal = world.on(PlantKind::Kinematic);
        let changed: Vec<(String, Scenario)> = nominal
            .reuse()
            .iter()
            .map(|(ego, change)| (ego.clone(), nominal.with(change).expect("a change")))
            .collect();
        let starts = test_starts(&nominal, 7, 40, &watch()).expect("not stopped");
        for action in 0..nominal.world().spaces().actions {
            let request = TheoremsRequest {
                nominal: &nominal,
                changed: &changed,
                policy: &Always(action),
                starts: &starts,
                alpha: 0.1,
            };
            match carry_over(&request, &watch()) {
                Ok(carried) => {
                    for row in carried.expect("not stopped").rows {
                        let sharper = row.sharper.as_ref();
                        let misses = row.misses + sharper.map_or(0, |s| s.misses);
                        assert_eq!(misses, 0, "{name}, {}, {}", row.ego, row.ado);
                        covered += row.covered;
                        if let Some(sharper) = sharper {
                            assert!(row.covered <= sharper.covered, "{name}");
                        }
                    }
                }
                Err(
                    TheoremsError::NoCounterexample { .. } | TheoremsError::NothingChanged { .. },
                ) => {}
                Err(error) => panic!("{name}: {error}"),
            }
        }
    }
    assert!(covered > 0, "the theorem is not vacuous");
}

#[test]
fn bounds_on_the_distance_hold_on_starts_they_have_not_seen() {
    let nominal = super::acc().on(PlantKind::Kinematic);
    let change = |text: &str| nominal.with(&ron::from_str(text).expect("a change"));
    let changed = [
        ("nearly", "(ego: (kp_per_s2: 0.30003))"),
        ("longer gap", "(ego: (time_gap_s: 0.6))"),
        ("noisy", "(sensors: Some((position_sd_m: 0.1)))"),
    ]
    .map(|(name, text)| (name.to_owned(), change(text).expect("it fits")));
    let starts = test_starts(&nominal, 7, 1500, &watch()).expect("not stopped");
    let request = TheoremsRequest {
        nominal: &nominal,
        changed: &changed,
        policy: &Always(0),
        starts: &starts,
        alpha: 0.1,
    };
    let carried = carry_over(&request, &watch()).expect("ok").expect("ran");
    assert_eq!(carried.rows.len(), 4);
    assert_eq!(carried.refused.len(), 1);
    assert_eq!(carried.refused[0].ego, "noisy");
    for row in &carried.rows {
        let sharper = row.sharper.as_ref().expect("an invariant");
        assert!(row.pairs > 100 && row.misses + sharper.misses == 0);
        assert!(row.forecast.as_promised && sharper.forecast.as_promised);
        // Both are calibrated on the same starts, one bound for the depth and each rule.
        assert!(row.forecast.calibration > 100, "{row:?}");
        assert_eq!(sharper.forecast.calibration, row.forecast.calibration);
        assert_eq!(row.forecast.quantiles.len(), 1);
        assert_eq!(sharper.forecast.quantiles.len(), 3);
        if row.ego == "nearly" {
            assert!(row.pairs / 2 < row.covered, "{row:?}");
            assert!(row.forecast.precision > Some(0.95));
        }
    }
    let noisy = TheoremsRequest {
        nominal: &changed[2].1,
        ..request
    };
    let error = carry_over(&noisy, &watch()).expect_err("noise");
    assert!(matches!(error, TheoremsError::Stochastic { .. }));
}

/// A judge of whole runs has no counterexample before their end.
#[test]
fn a_witness_of_a_whole_run_has_a_margin_at_its_end_only() {
    let text =
        include_str!("../../worlds/acc.ron").replace("judge: UntilViolation", "judge: WholeRun");
    let world = Scenario::parse("whole.ron", &text)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let (mut bench, horizon) = (world.bench(), world.bench().clock().samples());
    let mut seen = 0;
    for index in 0..400 {
        let key = brakecheck::seed::StartKey {
            purpose: brakecheck::seed::Purpose::Train,
            seed: 5,
            index,
        };
        let start = bench.draw(key);
        let mut ado = brakecheck::testbench::HeldRandom::new(3, 5);
        let skip = brakecheck::testbench::Aftermath::Skip;
        let episode = brakecheck::testbench::play(&mut bench, &start, index, &mut ado, skip);
        let Some(witness) = Witness::of(world.rulebook(), &episode, horizon) else {
            continue;
        };
        if episode.trace.len() == horizon {
            assert_eq!(
                (witness.samples, witness.tau),
                (horizon, witness.tau_at_verdict)
            );
            assert!(witness.tau > 0.0);
            seen += 1;
        }
    }
    assert!(seen > 0, "{seen}");
}

/// Distances of a run that is the witness itself, deeper, or shorter.
#[test]
fn a_distance_is_signed_at_the_deepest_sample_and_infinite_for_a_part() {
    let (_, world, episode) = recorded()
        .into_iter()
        .find(|(path, ..)| path.ends_with("acc-nominal-0001.ron"))
        .expect("a kept crash of `acc`");
    let horizon = world.bench().clock().samples();
    let rulebook = world.rulebook();
    let witness = Witness::of(rulebook, &episode, horizon).expect("a counterexample");
    let headway = episode
        .trace
        .schema()
        .position("headway")
        .expect("a signal");
    let run = |by_m: f64, samples: usize| {
        let mut other = Trace::new(episode.trace.schema().clone());
        let mut row = vec![0.0; episode.trace.schema().len()];
        for sample in 0..samples {
            episode.trace.read_row(sample, &mut row);
            row[headway] += by_m;
            other.push(&row).expect("finite");
        }
        // It ended at its horizon, so that nothing is known of a later sample.
        let run = Episode {
            trace: other,
            contact: None,
            ..episode.clone()
        };
        witness.distance(rulebook, &run, horizon)
    };
    // As many samples as the witness are enough.
    for samples in [episode.trace.len(), witness.samples] {
        let same = run(0.0, samples);
        assert_eq!((same.epsilon, same.rise), (0.0, Some(0.0)), "{samples}");
        assert_eq!(same.rules, [0.0; 2]);
        assert!(witness.covers(&same) && witness.covers_sharply(&same) == Some(true));
    }
    // A deeper violation is far away and needs no margin.
    let by_m = 3.0 * witness.tau;
    let deeper = run(-by_m, witness.samples);
    assert!((deeper.epsilon - by_m).abs() < 1e-9, "{deeper:?}");
    assert!(
        deeper.rise.is_some_and(|it| (it + by_m).abs() < 1e-9),
        "{deeper:?}"
    );
    assert_eq!(deeper.rules, [0.0; 2]);
    assert!(!witness.covers(&deeper) && witness.covers_sharply(&deeper) == Some(true));
    // A run that is shorter without a contact cannot be compared.
    let part = run(0.0, witness.samples - 1);
    assert_eq!(part.epsilon, f64::INFINITY);
    assert_eq!((part.rise, part.rules.len()), (Some(f64::INFINITY), 2));
    assert!(part.rules.iter().all(|it| *it == f64::INFINITY));
    assert!(!witness.covers(&part) && witness.covers_sharply(&part) == Some(false));
    // Its margins are the depth and what each rule has to spare.
    let margins = witness.sharp_margins().expect("an invariant");
    assert_eq!(margins.len(), 3);
    let least = margins.iter().copied().fold(f64::INFINITY, f64::min);
    assert!((least - witness.tau).abs() < 1e-9, "{margins:?}");
    // No success, no witness.
    let held = Episode {
        verdict: Verdict::Held { margin: 1.0 },
        ..episode.clone()
    };
    assert!(Witness::of(rulebook, &held, horizon).is_none());
}

#[test]
fn worlds_in_which_some_violations_do_not_count_are_refused() {
    let text = super::acc().text().replace(
        "judge: UntilViolation,",
        "judge: UntilContact, counts: Contact(closing_mps: 1.0),",
    );
    let nominal = Scenario::parse("counting.ron", &text)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let starts = test_starts(&nominal, 7, 2, &watch()).expect("not stopped");
    let request = TheoremsRequest {
        nominal: &nominal,
        changed: &[],
        policy: &Always(1),
        starts: &starts,
        alpha: 0.1,
    };
    let error = carry_over(&request, &watch()).expect_err("not every violation");
    assert!(
        matches!(error, TheoremsError::NotEveryViolation { .. }),
        "{error}"
    );
    let plain = super::acc().on(PlantKind::Kinematic);
    let request = TheoremsRequest {
        nominal: &plain,
        ..request
    };
    let error = carry_over(&request, &watch()).expect_err("no changed ego");
    assert!(
        matches!(error, TheoremsError::NothingChanged { .. }),
        "{error}"
    );
    let changed = [("same".to_owned(), plain.clone())];
    let request = TheoremsRequest {
        changed: &changed,
        ..request
    };
    // An ado that keeps its speed makes nobody fail.
    let error = carry_over(&request, &watch()).expect_err("no counterexample");
    assert!(
        matches!(error, TheoremsError::NoCounterexample { .. }),
        "{error}"
    );
}
