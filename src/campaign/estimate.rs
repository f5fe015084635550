//! What a start costs, guessed from the world alone: for plans without a pilot.
//!
//! The numbers are of one machine and right within a factor of three or so:
//! pieces come out a little longer or shorter, no result changes.

use super::plan::{PlannedAdo, PlannedTraining};
use crate::experiment::EgoUnderTest;
use crate::scene::Dynamics;

/// Processor time of a physics step.
const KINEMATIC_STEP_S: f64 = 0.3e-6;
const RIGID_STEP_S: f64 = 5e-6;
const CELLS_STEP_S: f64 = 1e-6;
/// What an episode takes besides its steps.
const EPISODE_S: f64 = 0.1e-3;
/// A decision of a training, its share of the learner's updates included.
const DECISION_S: f64 = 0.25e-3;
/// Episodes of a search with no switch; one more takes so many times as many.
const FIRST_SEQUENCES: f64 = 15.0;
const PER_SWITCH: f64 = 12.0;

/// Processor time of one start.
pub(super) fn start_s(ego: &EgoUnderTest, ado: &PlannedAdo) -> f64 {
    let scenario = ego.scenario();
    let clock = scenario.world().clock();
    let samples = (clock.horizon_s / clock.sample_s).ceil();
    let steps = samples * f64::from(clock.substeps.max(1));
    let (step_s, searched_step_s) = match scenario.plant() {
        Dynamics::Rigid => (RIGID_STEP_S, KINEMATIC_STEP_S),
        Dynamics::Kinematic => (KINEMATIC_STEP_S, KINEMATIC_STEP_S),
        Dynamics::Cells => (CELLS_STEP_S, CELLS_STEP_S),
    };
    let episode_s = EPISODE_S + steps * step_s;
    match ado {
        PlannedAdo::Search {
            method,
            switches,
            budget,
        } => match method.as_str() {
            "switches" => {
                let sequences = FIRST_SEQUENCES * libm::pow(PER_SWITCH, *switches as f64);
                episode_s + sequences * steps * searched_step_s
            }
            _ => *budget as f64 * episode_s,
        },
        // Its own and the nominal ego's, by which it is told what is trivial.
        _ => 2.0 * episode_s,
    }
}

/// Processor time of a training.
pub(super) fn training_s(training: &PlannedTraining, decisions: u64) -> f64 {
    training.decisions.unwrap_or(decisions) as f64 * DECISION_S
}
