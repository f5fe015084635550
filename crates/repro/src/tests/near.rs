//! Starts near a failing start, and the search behind the figures.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::extreme::extreme;
use crate::{FigureError, TrainedPolicy, near_starts, near_starts_markdown, start_with};
use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::experiment::{TestStarts, Watch, test_starts};
use brakecheck::rl::Policy;
use brakecheck::testbench::{Aftermath, PolicyActor, Replay, play};
use brakecheck::world::PlantKind;

/// Policy that always brakes and returns the ego's speed as the value of a start.
struct FullBrakes;

impl Policy for FullBrakes {
    fn act(&self, _obs: &[f32]) -> usize {
        0
    }

    fn value(&self, obs: &[f32]) -> f32 {
        obs[1]
    }
}

fn watch() -> Watch<'static> {
    static GO_ON: AtomicBool = AtomicBool::new(false);
    Watch::new(&|_, _| {}, &GO_ON)
}

const CENTRE: [(&str, f64); 3] = [
    ("ego.speed", 12.0),
    ("ado.speed", 12.0),
    ("ado.headway", 15.0),
];

#[test]
fn near_starts_are_counted_as_they_play() {
    let world = super::acc().on(PlantKind::Kinematic);
    let around = start_with(&world, &CENTRE).expect("within the box");
    let starts = test_starts(&world, 7, 200, &watch()).expect("not stopped");
    let alumnus = |episodes| TrainedPolicy {
        policy: &FullBrakes,
        seed: 1,
        episodes,
    };
    let look = |episodes| {
        near_starts(
            &world,
            alumnus(episodes),
            &around,
            &starts,
            &[0.05, 9.0],
            &watch(),
        )
        .expect("not stopped")
    };
    let near = look(50);
    let [narrow, wide] = &near.rows[..] else {
        panic!("a row per δ");
    };
    // Every start is nearer than 9, so the row covers the whole world.
    let mut bench = world.bench();
    let mut failing = Vec::new();
    for ((start, noise), trivial) in starts.starts.iter().zip(&starts.trivial) {
        let mut ado = PolicyActor(&FullBrakes);
        let episode = play(&mut bench, start, *noise, &mut ado, Aftermath::Skip);
        if !trivial && episode.verdict.is_success() {
            failing.push(start.0[0]);
        }
    }
    assert_eq!((wide.near, wide.failing), (near.starts, failing.len()));
    let slower = failing.iter().filter(|speed| **speed < 12.0).count();
    assert_eq!(wide.below_above[0].0, "ego.speed");
    assert_eq!(wide.below_above[0].1, [slower, failing.len() - slower]);
    assert!(wide.failing > 0 && narrow.near < wide.near);
    assert!(wide.never_seen <= wide.failing && look(0).rows[1].never_seen == wide.failing);
    // A dense training contains all of them, within 1 % of each range.
    assert!(look(20_000).rows[1].never_seen < wide.never_seen);
    assert!(near_starts_markdown(&[near]).contains("ego.speed 12.00"));
    let outside = start_with(&world, &[("ego.speed", 99.0)]);
    assert!(matches!(outside, Err(FigureError::NoSuchStart { .. })));
}

/// Ego that does not answer behind a lead car that is far ahead.
struct Lost;

impl Controller for Lost {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        match percept.leader() {
            Some(lead) if lead.headway_m > 25.0 => Err(Fault::error("no answer")),
            _ => Ok(Command::accelerate(0.0)),
        }
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(Lost))
    }
}

#[test]
fn a_fault_is_reported_on_its_start() {
    let acc = super::acc().on(PlantKind::Kinematic);
    let world = acc.with_ego("lost", Arc::new(|| Box::new(Lost)));
    let around = start_with(&world, &CENTRE).expect("within the box");
    let values = [
        ("ego.speed", 12.0),
        ("ado.speed", 12.0),
        ("ado.headway", 40.0),
    ];
    let far = start_with(&world, &values).expect("within the box");
    let starts = TestStarts {
        seed: 0,
        starts: vec![(around.clone(), 0), (far, 0)],
        trivial: vec![true, false],
    };
    let trained = TrainedPolicy {
        policy: &FullBrakes,
        seed: 1,
        episodes: 0,
    };
    let watch = watch();
    near_starts(&world, trained, &around, &starts, &[9.0], &watch).expect("not stopped");
    let complaint = watch.faults.complaint().expect("a fault");
    assert_eq!(complaint.faults[0].first_start, 1);
}

#[test]
fn the_extreme_sequence_is_the_best_of_all() {
    let world = super::acc().on(PlantKind::Kinematic);
    let start = start_with(&world, &CENTRE).expect("within the box");
    let score = |episode: &brakecheck::testbench::Episode| {
        let kept = !matches!(episode.verdict, brakecheck::rulebook::Verdict::Foul { .. });
        kept.then_some(-episode.robustness)
    };
    let found = extreme(&world, &start, 0, 1, score, &watch()).expect("one is lawful");
    let decisions = world.bench().clock().decisions();
    let mut bench = world.bench();
    for first in 0..3 {
        for then in 0..3 {
            for at in 0..decisions {
                let mut actions = vec![first; at];
                actions.resize(decisions, then);
                let mut ado = Replay::holding(&actions);
                let other = play(&mut bench, &start, 0, &mut ado, Aftermath::Play);
                assert!(score(&other).is_none_or(|other| other <= -found.robustness));
            }
        }
    }
    assert!(extreme(&world, &start, 0, 1, |_| None, &watch()).is_none());
}
