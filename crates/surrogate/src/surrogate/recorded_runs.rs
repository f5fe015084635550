//! Recorded runs for unit tests.

use super::dataset::{labelled, mixed, starts};
use super::model_fit::LabelledRun;
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::Policy;
use crate::sim::PlantKind;
use crate::world::Scenario;

/// Returns runs of an ego of `acc_structures` under mixed actions.
pub(super) fn runs_of(name: &str, plant: PlantKind, count: u64) -> Vec<LabelledRun> {
    struct Coasts;

    impl Policy for Coasts {
        fn act(&self, _: &[f32]) -> usize {
            1
        }

        fn value(&self, _: &[f32]) -> f32 {
            0.0
        }
    }

    let world = Scenario::shipped("acc_structures")
        .expect("shipped")
        .expect("sound")
        .on(plant);
    let ego = EgoUnderTest::find(&world, name).expect("an ego");
    let from = starts(&world, count, 8);
    let ego = ego[0].scenario().drive().expect("driven");
    let runs = mixed(ego, &Coasts, &from, &Watch::unwatched());
    labelled(ego, &runs)
}
