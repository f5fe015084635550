//! Estimated cost of a start without a pilot.
//!
//! The numbers come from a single machine and are right within a factor of about three.
//! They change the length of pieces but no result.

use super::plan::PlannedTraining;
use crate::experiment::EgoUnderTest;
use crate::run_dir::{AdversaryId, SearchSettings};
use crate::scene::Dynamics;
use crate::world::Scenario;

/// Processor time of a physics step, s.
const KINEMATIC_STEP_S: f64 = 0.3e-6;
const RIGID_STEP_S: f64 = 5e-6;
const CELLS_STEP_S: f64 = 1e-6;
/// Processor time of an episode besides its steps, s.
const EPISODE_S: f64 = 0.1e-3;
/// Processor time of a training decision, including updates of the learner, s.
const DECISION_S: f64 = 0.25e-3;
/// Episodes of a search without switches, and their factor per additional switch.
const FIRST_SEQUENCES: f64 = 15.0;
const PER_SWITCH: f64 = 12.0;

/// Estimates the processor time of a start, s, without the episode of [`alone_s`].
pub(super) fn start_s(ego: &EgoUnderTest, ado: &AdversaryId) -> f64 {
    let scenario = ego.scenario();
    match ado {
        AdversaryId::Search {
            settings:
                Some(SearchSettings {
                    method,
                    switches,
                    budget,
                }),
        } => match method.as_str() {
            "switches" => {
                // A branch continues from a copy, so it costs steps and no beginning of
                // an episode.
                let sequences = FIRST_SEQUENCES * libm::pow(PER_SWITCH, *switches as f64);
                let searched_step_s = match scenario.screening() {
                    Some(screening) => step_s(screening.plant()),
                    None => step_s(scenario.plant()),
                };
                episode_s(scenario) + sequences * steps(scenario) * searched_step_s
            }
            // Other methods play whole episodes, up to their budget.
            _ => *budget as f64 * episode_s(scenario),
        },
        _ => episode_s(scenario),
    }
}

/// Estimates the processor time of the episode that detects a trivial start, s.
///
/// `world` is on the plant of its file. Every start of a world has one such episode.
pub(super) fn alone_s(world: &Scenario) -> f64 {
    if world.judges_each_ego() {
        0.0
    } else {
        episode_s(world)
    }
}

fn episode_s(scenario: &Scenario) -> f64 {
    EPISODE_S + steps(scenario) * step_s(scenario.plant())
}

fn steps(scenario: &Scenario) -> f64 {
    let clock = scenario.world().clock();
    let samples = (clock.horizon_s / clock.sample_s).ceil();
    samples * f64::from(clock.substeps.max(1))
}

fn step_s(dynamics: Dynamics) -> f64 {
    match dynamics {
        Dynamics::Rigid => RIGID_STEP_S,
        Dynamics::Kinematic => KINEMATIC_STEP_S,
        Dynamics::Cells => CELLS_STEP_S,
    }
}

/// Estimates the processor time of a training, s.
pub(super) fn training_s(training: &PlannedTraining, decisions: u64) -> f64 {
    training.decisions.unwrap_or(decisions) as f64 * DECISION_S
}
