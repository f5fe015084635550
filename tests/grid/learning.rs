//! What the shipped learners reach: margins over chaser and random, fixed seeds.

use brakecheck::rl::{Control, LearnerConfig, Policy};
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;
use brakecheck::world::{GridChange, Scenario};

use super::{A, B, captures, changed, world};

fn trained(scenario: &Scenario, learner: &LearnerConfig, seed: u64) -> Box<dyn Policy> {
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
    let mut learner = learner.build(scenario.world().spaces(), seed);
    learner.train(&mut gym, &mut |_| Control::Continue);
    learner.policy()
}

fn learners(scenario: &Scenario) -> Vec<LearnerConfig> {
    let others = scenario.learners().values().cloned();
    [scenario.learner().clone()]
        .into_iter()
        .chain(others)
        .collect()
}

#[test]
fn every_learner_nearly_solves_the_map_it_is_trained_on() {
    for (wall, least) in [(A, 235), (B, 225)] {
        let world = world(wall);
        for learner in learners(&world) {
            let captured = captures(&world, &*trained(&world, &learner, 21));
            assert!(
                least <= captured,
                "{wall:?} {}: {captured} of 240",
                learner.name()
            );
        }
    }
}

#[test]
fn a_trained_ado_is_reused_on_maps_and_egos_it_has_never_met() {
    let world = world(B);
    let policy = trained(&world, world.learner(), 22);
    let at = |size: Option<u32>, ego_step: Option<u32>| {
        let change = GridChange {
            size,
            ego_step,
            ..GridChange::default()
        };
        captures(&changed(&world, change), &*policy)
    };
    // The chaser gets 208 of 600, 112 of 240 and 60 of 240.
    for (size, k, chaser) in [
        (Some(5), None, 208),
        (None, Some(1), 112),
        (None, Some(3), 60),
    ] {
        let captured = at(size, k);
        assert!(chaser + 10 < captured, "{size:?} {k:?}: {captured}");
    }
}

#[test]
fn under_a_the_same_ado_captures_nearly_everything_everywhere() {
    let world = world(A);
    let policy = trained(&world, world.learner(), 23);
    for (size, ego_step) in [(5, 2), (4, 1), (4, 3), (4, 4)] {
        let change = GridChange {
            size: Some(size),
            ego_step: Some(ego_step),
            ..GridChange::default()
        };
        let changed = changed(&world, change);
        let all = changed.starts().expect("a finite world").len();
        let captured = captures(&changed, &*policy);
        assert!(
            95 * all <= 100 * captured,
            "n = {size}, k = {ego_step}: {captured} of {all}"
        );
    }
}
