//! Prediction error of a surrogate in runs outside its fit.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::dataset::RecordedRun;
use super::ego_motion::MotionSample;
use super::model::Surrogate;
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::world::DriveScenario;

/// Error below which a surrogate predicts well, m.
///
/// It applies even if an ego that keeps its acceleration is predicted as well.
// Plans that must hit gaps of some centimetres miss them where a surrogate is off by 0.1 m.
const CLOSE_M: f64 = 0.1;
/// Prediction horizon of the error, s.
const AHEAD_S: f64 = 2.0;

/// Error of a surrogate, two seconds ahead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurrogateError {
    /// Root mean square distance to the ego, in runs outside the fit, m.
    pub rms_m: f64,
    /// The same error for an ego that keeps its acceleration, m.
    pub keeps_acceleration_m: f64,
}

impl SurrogateError {
    /// Returns whether the surrogate predicts the ego usefully.
    ///
    /// Its error must be below 0.1 m or below half the error of constant acceleration.
    pub fn predicts_well(&self) -> bool {
        self.rms_m < f64::max(CLOSE_M, 0.5 * self.keeps_acceleration_m)
    }
}

/// Returns the error of a surrogate in runs outside its fit.
pub(super) fn error_of(
    world: DriveScenario<'_>,
    surrogate: &Arc<Surrogate>,
    runs: &[RecordedRun],
) -> Option<SurrogateError> {
    let mut model = ModelBench::quick(world);
    let (mut squares, mut count) = ([0.0; 2], 0u32);
    for run in runs {
        for [learned_m, keeping_m] in errors_m(&mut model, surrogate, run) {
            squares[0] += learned_m * learned_m;
            squares[1] += keeping_m * keeping_m;
            count += 1;
        }
    }
    let rms = |sum: f64| (sum / f64::from(count)).sqrt();
    (count > 0).then(|| SurrogateError {
        rms_m: rms(squares[0]),
        keeps_acceleration_m: rms(squares[1]),
    })
}

/// Returns the errors of the surrogate and of constant acceleration along a run.
///
/// They are taken [`AHEAD_S`] after every start of a window, or at the earlier end of
/// the first of the motions.
fn errors_m(
    model: &mut ModelBench,
    surrogate: &Arc<Surrogate>,
    run: &RecordedRun,
) -> Vec<[f64; 2]> {
    let clock = *model.bench.clock();
    let ahead = (AHEAD_S / clock.sample_s).round() as usize;
    // At least 1, because a decision may last longer than the horizon
    // and a step of 0 panics.
    let step = (AHEAD_S / clock.decision_s).round().max(1.0) as usize;
    let RunPrefix { actions, motion } = &run.so_far;
    let mut errors = Vec::new();
    for decision in (0..actions.len()).step_by(step) {
        let now = decision * clock.samples_per_decision();
        // A window that exceeds the recorded run has no true position to compare with.
        if motion.len() <= now + ahead {
            break;
        }
        let so_far = RunPrefix {
            actions: actions[..decision].to_vec(),
            motion: motion[..=now].to_vec(),
        };
        let mut predict = |surrogate| {
            model.begin(run.from(), &so_far, surrogate, VARIATIONS[0]);
            model.play_actions(&actions[decision..]);
            model.motion()
        };
        // Both predictions start from the same recorded motion.
        let predicted_motion = [predict(Some(surrogate)), predict(None)];
        // A predicted run may end before the ego's run, and nothing is predicted after it.
        let ends = predicted_motion
            .iter()
            .map(|motion| motion.len().saturating_sub(1));
        let at = ends.fold(now + ahead, usize::min);
        let off_m = |moments: Vec<MotionSample>| Some(moments.get(at)?.distance_m(&motion[at]));
        errors.push(predicted_motion.map(|moments| off_m(moments).unwrap_or(0.0)));
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Watch;
    use crate::rl::nn::Mlp;
    use crate::surrogate::dataset::{open_loop_runs, starts};
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::width_of;
    use crate::world::Scenario;

    #[test]
    fn where_a_models_run_ends_nothing_is_held_against_it_any_more() {
        let shipped = |name| Scenario::shipped(name).expect("shipped").expect("sound");
        let (structures, world) = (shipped("acc_structures"), shipped("merge_fair"));
        let ego = world.with(&structures.reuse()["rss"]).expect("an ego");
        // The ego is cut off and brakes. Constant acceleration is hit at once and was exact
        // until then.
        let from = starts(&world, 24, 8);
        let mut actions = vec![2; 6];
        actions.push(4);
        let ego = ego.drive().expect("driven");
        let runs = open_loop_runs(ego, &actions, &from, &Watch::unwatched());
        let width = width_of(ego);
        let keeps = Arc::new(Surrogate::of_members(
            vec![Mlp::zeros(&[width, OUTPUTS])],
            [0.0, 0.0],
            [-8.0, 2.0],
        ));
        let error = error_of(ego, &keeps, &runs).expect("long enough");
        // With the motion of the ego afterwards the error would be 3 m.
        assert!(error.rms_m < 0.5, "{error:?}");
        assert_eq!(error.rms_m, error.keeps_acceleration_m);
        assert!(error.predicts_well(), "nothing is left to foresee");
    }
}
