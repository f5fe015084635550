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
use super::model::{MEMBERS, Surrogate, fit};
use super::model_fit::{FittedModel, fit_models, kinds_except};
use super::plan::Planner;
use super::strategy::{PlanningBudget, Policies, TriedActions, best_fixed};
use super::surrogate_sim::{
    ModelBench, ModelDriverConfig, ModelDriverSlot, MotionSample, RunPrefix, VARIATIONS,
};
use crate::experiment::Watch;
use crate::rl::{Control, Env, Policy, Spaces, Step, TensorFile, fine_tuner, load_policy};
use crate::scene::Start;
use crate::seed::Purpose;
use crate::sim::PlantKind;
use crate::stats::{predicted, wilson};
use crate::testbench::Gym;
use crate::world::{DriveScenario, Scenario};

/// Number of runs from which three rounds are recorded instead of two.
const THREE_ROUNDS: u64 = 90;
/// Updates of each network after every round except the last round.
const UPDATES: u64 = 40_000;
/// Updates after the last round.
const LAST_UPDATES: u64 = 120_000;
/// Error below which a surrogate predicts well, m.
///
/// It applies even if an ego that keeps its acceleration is predicted as well.
const CLOSE_M: f64 = 0.1;
/// Prediction horizon of the error, s.
const AHEAD_S: f64 = 2.0;

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
    /// Runs of the ego that may be recorded, at least 10.
    pub runs: u64,
    /// Kinds of stock controllers that are not compared with the ego.
    ///
    /// They are treated as unpublished.
    pub unknown: &'a [&'a str],
    /// Seed of the starts and of the fit.
    pub seed: u64,
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
}

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

/// Way in which an ado acts against a learned ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Acts {
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
    pub planned_successes: u64,
    /// Runs of the first round in which the ado followed its trained policy.
    pub as_trained: u64,
    /// Such runs in which the ego failed and the ado kept every rule.
    pub as_trained_successes: u64,
    /// Actions that are the same from every start, with their results.
    ///
    /// They are tried in the last round, in turn with the plans, if the surrogate does not
    /// predict the ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed: Option<TriedActions>,
    /// Plant on which plans are judged.
    ///
    /// It is the kinematic plant where all vehicles move on it as on the world's own plant,
    /// which is slower.
    pub judged_on: PlantKind,
    /// Emergency brake fitted to the ego.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brake: Option<EmergencyBrake>,
    /// Most similar stock controllers, the nearest first.
    #[serde(rename = "alike")]
    pub nearest: Vec<FittedModel>,
}

impl LearnedFrom {
    /// Returns the expected share of solved starts and its 95 % interval.
    ///
    /// The interval predicts the share among `starts` further starts.
    pub fn expected(&self, starts: usize) -> (f64, [f64; 2]) {
        let (successes, runs) = match self.acts() {
            Acts::Planned => self.by_plans(),
            Acts::AsTrained => (self.as_trained_successes, self.as_trained),
            Acts::OpenLoop => self.by_open_loop(),
        };
        let rate = successes as f64 / runs.max(1) as f64;
        (rate, predicted(successes as usize, runs as usize, starts))
    }

    /// Returns the way in which the ado acts.
    ///
    /// It plans, unless a simpler way did clearly better in the runs of the ego.
    /// Later plans are made with more runs than the counted ones. Fixed actions must
    /// therefore exceed the upper bound of the plans' interval.
    /// The trained policy has few runs, so the lower bound of its interval must exceed the
    /// upper bound of the best alternative.
    pub fn acts(&self) -> Acts {
        let rate = |(successes, runs): (u64, u64)| successes as f64 / runs.max(1) as f64;
        let interval = |(successes, runs): (u64, u64)| wilson(successes as usize, runs as usize);
        let (planned, open_loop) = (self.by_plans(), self.by_open_loop());
        let [_, most] = interval(planned);
        let (best, acts) = if most < rate(open_loop) {
            (open_loop, Acts::OpenLoop)
        } else {
            (planned, Acts::Planned)
        };
        let ([as_trained, _], [_, most]) = (
            interval((self.as_trained_successes, self.as_trained)),
            interval(best),
        );
        if most < as_trained {
            Acts::AsTrained
        } else {
            acts
        }
    }

    fn by_plans(&self) -> (u64, u64) {
        (self.planned_successes, self.planned)
    }

    fn by_open_loop(&self) -> (u64, u64) {
        let tried = self.fixed.as_ref();
        tried.map_or((0, 0), |tried| (tried.successes, tried.runs))
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
    let LearnEgoRequest {
        nominal,
        ego,
        policy,
        bundle,
        runs,
        unknown,
        seed,
    } = *request;
    let mut kinds = kinds_except(unknown);
    let mut learned = |runs: &[RecordedRun], (brake, updates): (Option<EmergencyBrake>, u64)| {
        let labelled = labelled(ego, runs);
        let found = fit_models(&labelled, &kinds, seed, watch);
        // Later rounds fit only the kinds that came close in the round before.
        let nearest: Arc<[FittedModel]> = found.nearest.into();
        kinds = found.kinds;
        let settings = (brake, updates, seed);
        fit(&samples(&labelled, &nearest), &nearest, settings, watch)
    };
    let all = starts(nominal, runs, seed);
    let rounds = if THREE_ROUNDS <= runs { 3 } else { 2 };
    let mut rounds = all.chunks(all.len().div_ceil(rounds).max(1));
    let mut recorded = mixed(ego, policy, rounds.next()?, watch);
    let as_trained = recorded.iter().filter(|run| run.as_trained);
    let mut from = LearnedFrom {
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
    let mut surrogate = learned(&recorded, (None, UPDATES))?;
    let rounds: Vec<_> = rounds.collect();
    let mut inside = None;
    for (round, starts) in rounds.iter().enumerate() {
        let is_last = round + 1 == rounds.len();
        // The runs of the last round are played like the test starts.
        if is_last {
            // A second policy is therefore available from this round on.
            inside = fine_tuned(ego, bundle, (&surrogate, seed), watch);
        }
        let followed = inside.as_ref().and_then(|inside| load_policy(inside).ok());
        let policies = Policies {
            as_trained: policy,
            fine_tuned: followed.as_deref(),
        };
        let model = (&surrogate, from.judged_on);
        let planner = || Planner::new(ego, model, (policies, PlanningBudget::BRIEF), watch);
        // Half of the last round tests fixed actions if the surrogate does not predict the ego.
        let is_unsure = is_last && from.error.is_some_and(|error| !error.predicts_well());
        let [to_plan, to_compare] = if is_unsure {
            interleaved(starts)
        } else {
            [starts.to_vec(), Vec::new()]
        };
        let found = planned(ego, planner, &to_plan, watch);
        if is_unsure && let Some(actions) = best_fixed(ego, &surrogate, &all) {
            let tried = open_loop_runs(ego, &actions, &to_compare, watch);
            let successes = tried.iter().filter(|run| run.is_success).count() as u64;
            from.fixed = Some(TriedActions {
                actions,
                runs: tried.len() as u64,
                successes,
            });
            recorded.extend(tried);
        }
        if watch.stopped() {
            return None;
        }
        // The error is measured before the refit, so these runs are new to the surrogate.
        from.error = error_of(ego, &surrogate, &found).or(from.error);
        from.planned = found.len() as u64;
        from.planned_successes = found.iter().filter(|run| run.is_success).count() as u64;
        recorded.extend(found);
        let updates = if is_last { LAST_UPDATES } else { UPDATES };
        surrogate = learned(&recorded, (surrogate.brake, updates))?;
    }
    from.nearest = surrogate.nearest.to_vec();
    from.brake = surrogate.brake;
    // The training continues from the policy of the last round.
    let inside = fine_tuned(ego, inside.as_ref().or(bundle), (&surrogate, seed), watch);
    if watch.stopped() {
        return None;
    }
    Some(LearnedEgo {
        surrogate,
        fine_tuned: inside.map(Arc::new),
        from,
    })
}

/// Splits the starts into two interleaved halves.
fn interleaved(starts: &[(Start, u64)]) -> [Vec<(Start, u64)>; 2] {
    [0, 1].map(|from| starts.iter().skip(from).step_by(2).cloned().collect())
}

/// Returns the error of a surrogate in runs outside its fit.
fn error_of(
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
    (0 < count).then(|| SurrogateError {
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
        let mut predicted_motion = |surrogate| {
            model.begin(run.from(), &so_far, surrogate, VARIATIONS[0]);
            model.play_actions(&actions[decision..]);
            model.motion()
        };
        // Both predictions start from the same recorded motion.
        let predicted_motion = [predicted_motion(Some(surrogate)), predicted_motion(None)];
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

/// Decisions per training.
const DECISIONS: u64 = 30_000;

/// Training starts against the surrogate, with another member in every episode.
///
/// The ado then relies only on behaviour that all members share.
struct Inside {
    gym: Gym,
    driver_slot: ModelDriverSlot,
    surrogate: Arc<Surrogate>,
}

impl Env for Inside {
    fn spaces(&self) -> &Spaces {
        self.gym.spaces()
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.driver_slot.set(ModelDriverConfig {
            surrogate: Some(Arc::clone(&self.surrogate)),
            // The episode index selects the member, so equal requests repeat the training.
            member: Some(index as usize % MEMBERS),
            ..ModelDriverConfig::default()
        });
        self.gym.reset(index, obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.gym.step(action, obs)
    }
}

/// Trains the ado inside the surrogate in the place of the ego of `world`.
///
/// Returns `None` if stopped, or if the policy cannot be trained further because it is
/// conditional or not from deep Q-learning. Equal requests give equal policies.
pub(super) fn fine_tuned(
    world: DriveScenario<'_>,
    policy: Option<&TensorFile>,
    (surrogate, seed): (&Arc<Surrogate>, u64),
    watch: &Watch<'_>,
) -> Option<TensorFile> {
    let ModelBench {
        bench, driver_slot, ..
    } = ModelBench::quick(world);
    let mut learner = fine_tuner(bench.spaces(), (DECISIONS, seed), policy?)?;
    let mut inside = Inside {
        gym: Gym::new(bench, Purpose::Train, seed),
        driver_slot,
        surrogate: Arc::clone(surrogate),
    };
    learner.train(&mut inside, &mut |_| {
        if watch.stopped() {
            Control::Stop
        } else {
            Control::Continue
        }
    });
    // A policy from a stopped training would depend on the time of the stop.
    learner.finished().then(|| learner.policy_bundle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::nn::Mlp;
    use crate::rl::{DqnSettings, LearnerConfig, Policy, PpoSettings, load_policy};
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::width_of;
    use crate::testbench::{Aftermath, PolicyActor, play};

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

    /// Surrogate that always answers `change_mps2`.
    fn surrogate_of(world: DriveScenario<'_>, change_mps2: f64) -> Arc<Surrogate> {
        let width = width_of(world);
        // In a single layer the biases precede the weights.
        let mut net = Mlp::zeros(&[width, OUTPUTS]);
        net.parameters_mut()[0] = 1.0;
        Arc::new(Surrogate::of_members(
            vec![net.clone(), net],
            [change_mps2, 0.0],
            [-8.0, 2.0],
        ))
    }

    /// Counts the starts, of 20, on which a policy makes the surrogate fail.
    fn solved(world: DriveScenario<'_>, surrogate: &Arc<Surrogate>, policy: &dyn Policy) -> usize {
        let ModelBench {
            bench, driver_slot, ..
        } = ModelBench::quick(world);
        let mut gym = Gym::new(bench, Purpose::Calibration, 2);
        let is_success = |index: &u64| {
            let key = gym.key(*index);
            let bench = gym.bench();
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            driver_slot.set(ModelDriverConfig {
                surrogate: Some(Arc::clone(surrogate)),
                ..ModelDriverConfig::default()
            });
            let mut actor = PolicyActor(policy);
            let episode = play(bench, &start, noise, &mut actor, Aftermath::Skip);
            episode.verdict.is_success()
        };
        (0..20).filter(is_success).count()
    }

    fn unlearned(world: &Scenario, learner: LearnerConfig) -> TensorFile {
        learner.build(&world.spaces(), 3).policy_bundle()
    }

    #[test]
    fn an_ado_learns_what_the_ego_in_the_surrogate_does() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = world.drive().expect("driven");
        let watch = Watch::unwatched();
        let before = unlearned(
            &world,
            LearnerConfig::new(DqnSettings::default()).expect("sound"),
        );
        // The first keeps its acceleration and runs into a braking vehicle. The second
        // always brakes hard and fails from the nearest starts only.
        let keeps = surrogate_of(world, 0.0);
        let brakes = surrogate_of(world, -1.0);
        let learn = |policy: &TensorFile, ego: &Arc<Surrogate>| {
            fine_tuned(world, Some(policy), (ego, 5), &watch)
        };
        let solves = |kept: &TensorFile, ego| {
            let policy = load_policy(kept).expect("a policy");
            solved(world, ego, &*policy)
        };
        let kept = learn(&before, &keeps).expect("deep Q-learning");
        let [first, after, braking] = [(&before, &keeps), (&kept, &keeps), (&kept, &brakes)]
            .map(|(policy, ego)| solves(policy, ego));
        assert!(first < 10 && 16 <= after, "{first}, then {after}");
        assert!(braking < 8, "{braking}");
        assert_eq!(learn(&before, &keeps).as_ref(), Some(&kept));
        assert_ne!(learn(&before, &brakes), Some(kept));

        let other = unlearned(
            &world,
            LearnerConfig::new(PpoSettings::default()).expect("sound"),
        );
        assert!(learn(&other, &keeps).is_none(), "of another learner");
        assert!(fine_tuned(world, None, (&keeps, 5), &watch).is_none());
        let lane = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let stranger = unlearned(
            &lane,
            LearnerConfig::new(DqnSettings::default()).expect("sound"),
        );
        assert!(learn(&stranger, &keeps).is_none(), "of other observations");
    }
}
