//! Learning of an ego from recorded runs, and of the ado inside its surrogate.
//!
//! A policy acts on observations, so it follows an ego that strays from the prediction.
//! A plan would have to be made again but fits its start better.
//! The better of both is chosen per start.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::dataset::{
    RecordedRun, judged_on, labelled, mixed, open_loop_runs, planned, samples, starts,
};
use super::emergency_brake::EmergencyBrake;
use super::fine_tune::fine_tuned;
use super::fitted_model::FittedModel;
use super::model::Surrogate;
use super::model_fit::fit_models;
use super::model_kind::kinds_except;
use super::open_loop_actions::{TriedActions, best_fixed};
use super::plan::Planner;
use super::planning_budget::PlanningBudget;
use super::strategy::Policies;
use super::surrogate_error::{SurrogateError, error_of};
use super::surrogate_fit::fit;
use crate::experiment::Watch;
use crate::rl::{Policy, TensorFile, load_policy};
use crate::scene::Start;
use crate::sim::PlantKind;
use crate::stats::{predicted, wilson};
use crate::world::{DriveScenario, Scenario};

/// Smallest number of runs of an ego that learning requires.
pub const LEAST_RUNS: u64 = 10;
/// Number of runs from which three rounds are recorded instead of two.
const THREE_ROUNDS: u64 = 90;
/// Updates of each network after every round except the last round.
// 16,000 updates per round and 60,000 at the end solved 34 of 80 starts of a safety filter,
// 60,000 and 200,000 solved 39.
const UPDATES: u64 = 40_000;
/// Updates after the last round.
const LAST_UPDATES: u64 = 120_000;

/// Request to learn an ego.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct LearnEgoRequest<'a> {
    /// World with its own ego, which determines the trivial starts.
    pub nominal: &'a Scenario,
    /// World with the ego under test, which is only run.
    pub ego: DriveScenario<'a>,
    /// Policy of the trained ado.
    pub policy: &'a dyn Policy,
    /// Bundle to continue training from inside the surrogate, if any.
    pub bundle: Option<&'a TensorFile>,
    /// Runs of the ego that may be recorded, at least [`LEAST_RUNS`].
    pub runs: u64,
    /// Kinds of stock controllers that are not compared with the ego.
    ///
    /// They are treated as unpublished.
    pub unknown: &'a [&'a str],
    /// Seed of the starts and of the fit.
    pub seed: u64,
    /// Updates of each network after every round, and after the last round.
    pub updates: [u64; 2],
}

impl<'a> LearnEgoRequest<'a> {
    /// Returns a request with seed 0 that compares the ego with every stock controller.
    pub fn new(
        nominal: &'a Scenario,
        ego: DriveScenario<'a>,
        policy: &'a dyn Policy,
        runs: u64,
    ) -> LearnEgoRequest<'a> {
        LearnEgoRequest {
            nominal,
            ego,
            policy,
            bundle: None,
            runs,
            unknown: &[],
            seed: 0,
            updates: [UPDATES, LAST_UPDATES],
        }
    }

    /// Sets the bundle to continue training from inside the surrogate.
    pub fn bundle(self, bundle: &'a TensorFile) -> LearnEgoRequest<'a> {
        LearnEgoRequest {
            bundle: Some(bundle),
            ..self
        }
    }

    /// Sets the kinds of stock controllers that are not compared with the ego.
    pub fn unknown(self, unknown: &'a [&'a str]) -> LearnEgoRequest<'a> {
        LearnEgoRequest { unknown, ..self }
    }

    /// Sets the seed of the starts and of the fit.
    pub fn seed(self, seed: u64) -> LearnEgoRequest<'a> {
        LearnEgoRequest { seed, ..self }
    }

    /// Sets the updates of each network after every round, and after the last round.
    ///
    /// Only [`learn_ego`] takes others than the default, because stored egos have it.
    pub fn updates(self, updates: [u64; 2]) -> LearnEgoRequest<'a> {
        LearnEgoRequest { updates, ..self }
    }
}

/// Way in which an ado acts against a learned ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Acts {
    /// Every start is planned in the surrogate.
    Planned,
    /// Every start is played by the trained policy.
    #[serde(rename = "as trained")]
    AsTrained,
    /// The same actions are played from every start.
    #[serde(rename = "alike")]
    OpenLoop,
}

/// Facts recorded while an ego was learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LearnedFrom {
    /// Runs of the ego that were recorded.
    pub runs: u64,
    /// Prediction error of the surrogate. `None`: no run was long enough.
    pub error: Option<SurrogateError>,
    /// Runs of the last round, planned like the test starts.
    pub planned: u64,
    /// Planned runs in which the ego failed and the ado kept every rule.
    pub(crate) planned_successes: u64,
    /// Runs of the first round in which the ado followed its trained policy.
    pub(crate) as_trained: u64,
    /// Such runs in which the ego failed and the ado kept every rule.
    pub(crate) as_trained_successes: u64,
    /// Actions that are the same from every start, with their results.
    ///
    /// They are tried in the last round, in turn with the plans, if the surrogate does not
    /// predict the ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) fixed: Option<TriedActions>,
    /// Plant on which plans are judged.
    ///
    /// It is the kinematic plant where all vehicles move on it as on the world's own plant,
    /// which is slower.
    pub(crate) judged_on: PlantKind,
    /// Emergency brake fitted to the ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) brake: Option<EmergencyBrake>,
    /// Most similar stock controllers, the nearest first.
    #[serde(rename = "alike")]
    pub nearest: Vec<FittedModel>,
}

impl LearnedFrom {
    /// Returns the expected share of solved starts and its 95 % interval.
    ///
    /// The interval predicts the share among `starts` further starts.
    pub fn expected(&self, starts: usize) -> (f64, [f64; 2]) {
        let counted = match self.acts() {
            Acts::Planned => self.by_plans(),
            Acts::AsTrained => self.by_training(),
            Acts::OpenLoop => self.by_open_loop(),
        };
        let [successes, runs] = [counted.successes, counted.runs].map(|count| count as usize);
        (counted.rate(), predicted(successes, runs, starts))
    }

    /// Returns the way in which the ado acts.
    ///
    /// It plans, unless a simpler way did clearly better in the runs of the ego.
    /// Later plans are made with more runs than the counted ones. Fixed actions must
    /// therefore exceed the upper bound of the plans' interval.
    /// The trained policy has few runs, so the lower bound of its interval must exceed the
    /// upper bound of the best alternative.
    pub(crate) fn acts(&self) -> Acts {
        let (planned, open_loop) = (self.by_plans(), self.by_open_loop());
        let [_, most_planned] = planned.interval();
        let (best, acts) = if most_planned < open_loop.rate() {
            (open_loop, Acts::OpenLoop)
        } else {
            (planned, Acts::Planned)
        };
        let ([least, _], [_, most]) = (self.by_training().interval(), best.interval());
        if most < least { Acts::AsTrained } else { acts }
    }

    fn by_plans(&self) -> LearningRuns {
        LearningRuns {
            successes: self.planned_successes,
            runs: self.planned,
        }
    }

    fn by_training(&self) -> LearningRuns {
        LearningRuns {
            successes: self.as_trained_successes,
            runs: self.as_trained,
        }
    }

    fn by_open_loop(&self) -> LearningRuns {
        let tried = self.fixed.as_ref();
        tried.map_or(LearningRuns::default(), |tried| LearningRuns {
            successes: tried.successes,
            runs: tried.runs,
        })
    }
}

/// Runs of an ego, and how many of them were successes.
#[derive(Clone, Copy, Default)]
struct LearningRuns {
    successes: u64,
    runs: u64,
}

impl LearningRuns {
    fn rate(self) -> f64 {
        self.successes as f64 / self.runs.max(1) as f64
    }

    /// Returns the 95 % interval of the rate.
    fn interval(self) -> [f64; 2] {
        wilson(self.successes as usize, self.runs as usize)
    }
}

/// Learned ego: its surrogate, and the expected success of plans in it.
#[derive(Clone, Debug)]
pub struct LearnedEgo {
    pub(super) surrogate: Arc<Surrogate>,
    /// Policy that the ado learned inside the surrogate.
    pub(super) fine_tuned: Option<Arc<TensorFile>>,
    /// Facts recorded while the ego was learned.
    pub from: LearnedFrom,
}

/// Records an ego and fits a surrogate to it.
///
/// Returns `None` if stopped, or if the ego never ran.
///
/// Equal requests give equal results on any number of threads, if the ego is
/// deterministic.
pub fn learn_ego(request: &LearnEgoRequest<'_>, watch: &Watch<'_>) -> Option<LearnedEgo> {
    let all = starts(request.nominal, request.runs, request.seed);
    let count = if request.runs >= THREE_ROUNDS { 3 } else { 2 };
    // No starts at all would make chunks of length 0, which panics.
    let mut rounds = all.chunks(all.len().div_ceil(count).max(1));
    let mut learning = EgoLearning::begin(request, &all, rounds.next()?, watch)?;
    let further: Vec<_> = rounds.collect();
    for (round, starts) in further.iter().enumerate() {
        let is_last = round + 1 == further.len();
        learning.play_round(starts, is_last)?;
    }
    learning.end()
}

/// Learning of an ego in rounds, each of which is played with the fit of the one before.
struct EgoLearning<'a> {
    request: &'a LearnEgoRequest<'a>,
    /// Starts of all rounds.
    all: &'a [(Start, u64)],
    watch: &'a Watch<'a>,
    /// Kinds of stock controllers that the next round fits.
    kinds: Vec<&'static str>,
    recorded: Vec<RecordedRun>,
    surrogate: Arc<Surrogate>,
    /// Policy that the ado learned inside the surrogate, from the last round on.
    fine_tuned: Option<TensorFile>,
    from: LearnedFrom,
}

impl<'a> EgoLearning<'a> {
    /// Records the first round and fits the surrogate to it.
    fn begin(
        request: &'a LearnEgoRequest<'a>,
        all: &'a [(Start, u64)],
        first: &[(Start, u64)],
        watch: &'a Watch<'a>,
    ) -> Option<EgoLearning<'a>> {
        let ego = request.ego;
        let recorded = mixed(ego, request.policy, first, watch);
        let as_trained = recorded.iter().filter(|run| run.as_trained);
        let from = LearnedFrom {
            runs: all.len() as u64,
            error: None,
            planned: 0,
            planned_successes: 0,
            as_trained: as_trained.clone().count() as u64,
            as_trained_successes: as_trained.filter(|run| run.is_success).count() as u64,
            fixed: None,
            judged_on: judged_on(ego, &recorded),
            brake: None,
            nearest: Vec::new(),
        };
        let mut kinds = kinds_except(request.unknown);
        let surrogate = refitted(
            request,
            &recorded,
            &mut kinds,
            None,
            request.updates[0],
            watch,
        )?;
        Some(EgoLearning {
            request,
            all,
            watch,
            kinds,
            recorded,
            surrogate,
            fine_tuned: None,
            from,
        })
    }

    /// Records a further round and fits the surrogate to all runs. `None`: stopped.
    fn play_round(&mut self, starts: &[(Start, u64)], is_last: bool) -> Option<()> {
        let ego = self.request.ego;
        // The runs of the last round are played like the test starts, where a policy from
        // inside the surrogate is available.
        if is_last {
            self.fine_tune();
        }
        // Half of the last round tests fixed actions if the surrogate does not predict the ego.
        let is_unsure = is_last && self.from.error.is_some_and(|error| !error.predicts_well());
        let [to_plan, to_compare] = if is_unsure {
            interleaved(starts)
        } else {
            [starts.to_vec(), Vec::new()]
        };
        let planned = self.planned(&to_plan);
        if is_unsure {
            self.try_fixed_actions(&to_compare);
        }
        if self.watch.stopped() {
            return None;
        }
        // The error is measured before the refit, so these runs are new to the surrogate.
        self.from.error = error_of(ego, &self.surrogate, &planned).or(self.from.error);
        self.from.planned = planned.len() as u64;
        self.from.planned_successes = planned.iter().filter(|run| run.is_success).count() as u64;
        self.recorded.extend(planned);
        self.surrogate = refitted(
            self.request,
            &self.recorded,
            &mut self.kinds,
            self.surrogate.brake,
            self.request.updates[usize::from(is_last)],
            self.watch,
        )?;
        Some(())
    }

    /// Continues the ado's training inside the surrogate, from its last policy there.
    fn fine_tune(&mut self) {
        let LearnEgoRequest {
            ego, bundle, seed, ..
        } = *self.request;
        // The policy of an earlier round knows the ego already.
        let before = self.fine_tuned.as_ref().or(bundle);
        self.fine_tuned = fine_tuned(ego, before, &self.surrogate, seed, self.watch);
    }

    /// Records runs of plans in the surrogate.
    fn planned(&self, starts: &[(Start, u64)]) -> Vec<RecordedRun> {
        let ego = self.request.ego;
        let followed = self
            .fine_tuned
            .as_ref()
            // Without a policy that loads, plans are still possible.
            .and_then(|inside| load_policy(inside).ok());
        let policies = Policies {
            as_trained: self.request.policy,
            fine_tuned: followed.as_deref(),
        };
        let (plant, budget) = (self.from.judged_on, PlanningBudget::BRIEF);
        let planner = || Planner::new(ego, &self.surrogate, plant, policies, budget, self.watch);
        planned(ego, planner, starts, self.watch)
    }

    /// Records runs of the actions that succeed most often in the surrogate, if any do.
    fn try_fixed_actions(&mut self, starts: &[(Start, u64)]) {
        let ego = self.request.ego;
        let Some(actions) = best_fixed(ego, &self.surrogate, self.all) else {
            return;
        };
        let tried = open_loop_runs(ego, &actions, starts, self.watch);
        let successes = tried.iter().filter(|run| run.is_success).count() as u64;
        self.from.fixed = Some(TriedActions {
            actions,
            runs: tried.len() as u64,
            successes,
        });
        self.recorded.extend(tried);
    }

    /// Returns the learned ego. `None`: stopped.
    fn end(mut self) -> Option<LearnedEgo> {
        self.from.nearest = self.surrogate.nearest.to_vec();
        self.from.brake = self.surrogate.brake;
        // The surrogate is fitted to more runs than the last policy was trained in.
        self.fine_tune();
        (!self.watch.stopped()).then(|| LearnedEgo {
            surrogate: self.surrogate,
            fine_tuned: self.fine_tuned.map(Arc::new),
            from: self.from,
        })
    }
}

/// Fits a surrogate to all runs. `None`: stopped, or the ego never ran.
///
/// `kinds` are the kinds of stock controllers to compare, and then those that came close.
fn refitted(
    request: &LearnEgoRequest<'_>,
    runs: &[RecordedRun],
    kinds: &mut Vec<&'static str>,
    brake: Option<EmergencyBrake>,
    updates: u64,
    watch: &Watch<'_>,
) -> Option<Arc<Surrogate>> {
    let labelled = labelled(request.ego, runs);
    let found = fit_models(&labelled, kinds, request.seed, watch);
    let nearest: Arc<[FittedModel]> = found.nearest.into();
    // Later rounds fit only the kinds that came close, because the fits take most of the time.
    *kinds = found.kinds;
    let samples = samples(&labelled, &nearest);
    fit(&samples, &nearest, brake, updates, request.seed, watch)
}

/// Splits the starts into two interleaved halves.
fn interleaved(starts: &[(Start, u64)]) -> [Vec<(Start, u64)>; 2] {
    [0, 1].map(|from| starts.iter().skip(from).step_by(2).cloned().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(
        planned: (u64, u64),
        as_trained: (u64, u64),
        open_loop: Option<(u64, u64)>,
    ) -> LearnedFrom {
        LearnedFrom {
            runs: 100,
            error: None,
            planned: planned.1,
            planned_successes: planned.0,
            as_trained: as_trained.1,
            as_trained_successes: as_trained.0,
            fixed: open_loop.map(|(successes, runs)| TriedActions {
                actions: vec![0],
                runs,
                successes,
            }),
            judged_on: PlantKind::Kinematic,
            brake: None,
            nearest: Vec::new(),
        }
    }

    #[test]
    fn an_ado_plans_unless_something_simpler_did_better() {
        assert_eq!(seen((20, 32), (4, 8), None).acts(), Acts::Planned);
        assert_eq!(seen((2, 32), (8, 8), None).acts(), Acts::AsTrained);
        assert_eq!(seen((5, 16), (2, 8), Some((5, 16))).acts(), Acts::Planned);
        // The true rate of 5 of 16 may be 56 % as well.
        assert_eq!(seen((5, 16), (2, 8), Some((8, 16))).acts(), Acts::Planned);
        assert_eq!(seen((0, 16), (0, 8), Some((1, 16))).acts(), Acts::Planned);
        let open_loop = seen((5, 16), (2, 8), Some((10, 16)));
        assert_eq!(open_loop.acts(), Acts::OpenLoop);
        assert_eq!(open_loop.expected(40).0, 10.0 / 16.0);
        assert_eq!(seen((0, 16), (8, 8), Some((4, 16))).acts(), Acts::AsTrained);
    }
}
