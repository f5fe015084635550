//! Learning an ego from some runs of it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::dataset::{Run, alike, answered, mixed, planned, samples, starts};
use super::emergency_brake::EmergencyBrake;
use super::fine_tune::trained_on;
use super::fit::fit;
use super::fitted_model::Likeness;
use super::model::Surrogate;
use super::model_fit::likenesses;
use super::model_library::kinds_but;
use super::motion::Moment;
use super::open_loop_policy::{TriedActions, best_fixed};
use super::plan::Planner;
use super::planning_budget::Care;
use super::plant::judged_on;
use super::strategy::Policies;
use super::surrogate_sim::{ModelBench, SoFar, VARIATIONS};
use crate::experiment::Watch;
use crate::rl::{Bundle, Policy, load_policy};
use crate::scene::Start;
use crate::sim::PlantKind;
use crate::stats::predicted;
use crate::stats::wilson;
use crate::world::Scenario;

/// From so many runs on they are recorded in three rounds, else in two.
const THREE_ROUNDS: u64 = 90;
/// Updates of each network after every round but the last one.
const UPDATES: u64 = 40_000;
/// Updates after the last round.
const LAST_UPDATES: u64 = 120_000;
/// A surrogate that is no further off foresees its ego, however little that does.
const CLOSE_M: f64 = 0.1;
/// How far ahead a surrogate is asked to see.
const AHEAD_S: f64 = 2.0;

/// Whose ego is to be learned.
#[derive(Clone, Copy)]
pub struct LearnEgoRequest<'a> {
    /// The world with its own ego, which says which starts are trivial.
    pub nominal: &'a Scenario,
    /// The world with the ego, which is only run.
    pub ego: &'a Scenario,
    /// The trained ado.
    pub policy: &'a dyn Policy,
    /// What it goes on learning from inside the surrogate, if it is to.
    pub kept: Option<&'a Bundle>,
    /// Runs of the ego that may be recorded, [`LEAST_RUNS`] at least.
    pub runs: u64,
    /// Kinds of stock controllers that it may not be likened to, as if nobody had
    /// published them.
    pub unknown: &'a [&'a str],
    /// Seed of the starts and of the fit.
    pub seed: u64,
}

/// How far a surrogate is off, two seconds ahead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurrogateError {
    /// Root mean square of its distance to the ego, in runs it was not fitted to.
    pub rms_m: f64,
    /// The same for an ego that keeps its acceleration.
    pub keeps_acceleration_m: f64,
}

impl SurrogateError {
    /// Whether it foresees the ego at all.
    pub fn is_telling(&self) -> bool {
        self.rms_m < f64::max(CLOSE_M, 0.5 * self.keeps_acceleration_m)
    }
}

/// How an ado acts against an ego that it learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Acts {
    /// Every start is planned in the surrogate.
    Planned,
    /// As it was trained.
    #[serde(rename = "as trained")]
    AsTrained,
    /// The same actions from every start.
    Alike,
}

/// What was seen of an ego while it was learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnedFrom {
    /// Runs of the ego that were recorded.
    pub runs: u64,
    /// How well the surrogate foresees it; `None`: no run was long enough.
    pub error: Option<SurrogateError>,
    /// Runs of the last round, which were planned like those to come.
    pub planned: u64,
    /// Those among them in which the ego failed, every rule kept.
    pub planned_successes: u64,
    /// Runs of the first round in which the ado acted as it was trained.
    pub as_trained: u64,
    /// Those among them in which the ego failed, every rule kept.
    pub as_trained_successes: u64,
    /// Where the surrogate did not foresee the ego: actions that are the same from
    /// every start, tried in turn with the plans of the last round.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fixed: Option<TriedActions>,
    /// The plant on which plans are judged: the kinematic one where everybody moves on
    /// it as on the world's own, which is slower.
    pub judged_on: PlantKind,
    /// The emergency brake it was found to have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brake: Option<EmergencyBrake>,
    /// The stock controllers that it is most like, the nearest first.
    pub alike: Vec<Likeness>,
}

impl LearnedFrom {
    /// The share of so many starts to expect, and the 95 % interval in which it will
    /// lie.
    pub fn expected(&self, starts: usize) -> (f64, [f64; 2]) {
        let (successes, runs) = match self.acts() {
            Acts::Planned => self.by_plans(),
            Acts::AsTrained => (self.as_trained_successes, self.as_trained),
            Acts::Alike => self.alike_everywhere(),
        };
        let rate = successes as f64 / runs.max(1) as f64;
        (rate, predicted(successes as usize, runs as usize, starts))
    }

    /// How the ado acts: by plans, unless something simpler did clearly better in the
    /// runs of the ego. The plans to come are made with more runs than those that are
    /// counted, so actions that are the same everywhere must have done better than can
    /// be said of plans; of the ado as it was trained there are few runs, so all that
    /// can be said of it must be better.
    pub fn acts(&self) -> Acts {
        let rate = |(successes, runs): (u64, u64)| successes as f64 / runs.max(1) as f64;
        let interval = |(successes, runs): (u64, u64)| wilson(successes as usize, runs as usize);
        let (planned, alike) = (self.by_plans(), self.alike_everywhere());
        let [_, most] = interval(planned);
        let (best, acts) = match most < rate(alike) {
            true => (alike, Acts::Alike),
            false => (planned, Acts::Planned),
        };
        let ([as_trained, _], [_, most]) = (
            interval((self.as_trained_successes, self.as_trained)),
            interval(best),
        );
        match most < as_trained {
            true => Acts::AsTrained,
            false => acts,
        }
    }

    fn by_plans(&self) -> (u64, u64) {
        (self.planned_successes, self.planned)
    }

    fn alike_everywhere(&self) -> (u64, u64) {
        let tried = self.fixed.as_ref();
        tried.map_or((0, 0), |tried| (tried.successes, tried.runs))
    }
}

/// An ego, learned: a surrogate of it, and what to expect of plans in that.
#[derive(Clone, Debug)]
pub struct LearnedEgo {
    pub(super) surrogate: Arc<Surrogate>,
    /// What the ado learned inside it.
    pub(super) trained_on: Option<Arc<Bundle>>,
    /// What was seen of the ego.
    pub from: LearnedFrom,
}

/// Records an ego and learns a surrogate of it. `None`: stopped, nobody drives
/// in the world, or the ego never ran.
///
/// Equal requests give equal answers, on any number of threads, if the ego
/// answers twice alike.
pub fn learn_ego(request: &LearnEgoRequest<'_>, watch: &Watch<'_>) -> Option<LearnedEgo> {
    let LearnEgoRequest {
        nominal,
        ego,
        policy,
        kept,
        runs,
        unknown,
        seed,
    } = *request;
    let mut kinds = kinds_but(unknown);
    let mut learned = |runs: &[Run], (brake, updates): (Option<EmergencyBrake>, u64)| {
        let answered = answered(ego, runs)?;
        let found = likenesses(&answered, &kinds, seed, watch);
        let alike: Arc<[Likeness]> = found.nearest.into();
        kinds = found.kinds;
        let asked = (brake, updates, seed);
        fit(&samples(&answered, &alike), &alike, asked, watch)
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
        judged_on: judged_on(ego, &recorded)?,
        brake: None,
        alike: Vec::new(),
    };
    let mut surrogate = learned(&recorded, (None, UPDATES))?;
    let rounds: Vec<_> = rounds.collect();
    let mut inside = None;
    for (round, starts) in rounds.iter().enumerate() {
        let is_last = round + 1 == rounds.len();
        // The runs of the last round are played as those to come.
        if is_last {
            inside = trained_on(ego, kept, (&surrogate, seed), watch);
        }
        let followed = inside.as_ref().and_then(|inside| load_policy(inside).ok());
        let policies = Policies {
            as_trained: policy,
            trained_on: followed.as_deref(),
        };
        let model = (&surrogate, from.judged_on);
        let planner = || Planner::new(ego, model, (policies, Care::BRIEF), watch);
        let doubts = is_last && from.error.is_some_and(|error| !error.is_telling());
        let [to_plan, to_compare] = match doubts {
            true => in_turn(starts),
            false => [starts.to_vec(), Vec::new()],
        };
        let found = planned(ego, planner, &to_plan, watch);
        if doubts && let Some(actions) = best_fixed(ego, &surrogate, &all) {
            let tried = alike(ego, &actions, &to_compare, watch);
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
        from.error = error_of(ego, &surrogate, &found).or(from.error);
        from.planned = found.len() as u64;
        from.planned_successes = found.iter().filter(|run| run.is_success).count() as u64;
        recorded.extend(found);
        let updates = if is_last { LAST_UPDATES } else { UPDATES };
        surrogate = learned(&recorded, (surrogate.brake, updates))?;
    }
    from.alike = surrogate.alike.to_vec();
    from.brake = surrogate.brake;
    let inside = trained_on(ego, inside.as_ref().or(kept), (&surrogate, seed), watch);
    if watch.stopped() {
        return None;
    }
    Some(LearnedEgo {
        surrogate,
        trained_on: inside.map(Arc::new),
        from,
    })
}

/// Every other start, and those between.
fn in_turn(starts: &[(Start, u64)]) -> [Vec<(Start, u64)>; 2] {
    [0, 1].map(|from| starts.iter().skip(from).step_by(2).cloned().collect())
}

/// How far a surrogate is off in runs it was not fitted to.
fn error_of(world: &Scenario, surrogate: &Arc<Surrogate>, runs: &[Run]) -> Option<SurrogateError> {
    let mut model = ModelBench::quick(world)?;
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

/// How far the surrogate, and an ego that keeps its acceleration, are from the
/// ego, [`AHEAD_S`] after every so many seconds of a run, or where the first of them
/// ends.
fn errors_m(model: &mut ModelBench, surrogate: &Arc<Surrogate>, run: &Run) -> Vec<[f64; 2]> {
    let clock = *model.bench.clock();
    let ahead = (AHEAD_S / clock.sample_s).round() as usize;
    let step = (AHEAD_S / clock.decision_s).round().max(1.0) as usize;
    let SoFar { actions, motion } = &run.so_far;
    let mut errors = Vec::new();
    for decision in (0..actions.len()).step_by(step) {
        let now = decision * clock.samples_per_decision();
        if motion.len() <= now + ahead {
            break;
        }
        let so_far = SoFar {
            actions: actions[..decision].to_vec(),
            motion: motion[..=now].to_vec(),
        };
        let mut foreseen = |surrogate| {
            model.begin(run.from(), &so_far, surrogate, VARIATIONS[0]);
            model.go_on(&actions[decision..]);
            model.motion()
        };
        let foreseen = [foreseen(Some(surrogate)), foreseen(None)];
        // A model's run may end where the ego's goes on: nothing is foreseen of later.
        let ends = foreseen.iter().map(|motion| motion.len().saturating_sub(1));
        let at = ends.fold(now + ahead, usize::min);
        let off_m = |moments: Vec<Moment>| Some(moments.get(at)?.distance_m(&motion[at]));
        errors.push(foreseen.map(|moments| off_m(moments).unwrap_or(0.0)));
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::nn::Mlp;
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::width_of;

    fn seen(planned: (u64, u64), as_trained: (u64, u64), alike: Option<(u64, u64)>) -> LearnedFrom {
        LearnedFrom {
            runs: 100,
            error: None,
            planned: planned.1,
            planned_successes: planned.0,
            as_trained: as_trained.1,
            as_trained_successes: as_trained.0,
            fixed: alike.map(|(successes, runs)| TriedActions {
                actions: vec![0],
                runs,
                successes,
            }),
            judged_on: PlantKind::Kinematic,
            brake: None,
            alike: Vec::new(),
        }
    }

    #[test]
    fn an_ado_plans_unless_something_simpler_did_better() {
        assert_eq!(seen((20, 32), (4, 8), None).acts(), Acts::Planned);
        assert_eq!(seen((2, 32), (8, 8), None).acts(), Acts::AsTrained);
        assert_eq!(seen((5, 16), (2, 8), Some((5, 16))).acts(), Acts::Planned);
        // 5 of 16 may be 56 % as well.
        assert_eq!(seen((5, 16), (2, 8), Some((8, 16))).acts(), Acts::Planned);
        assert_eq!(seen((0, 16), (0, 8), Some((1, 16))).acts(), Acts::Planned);
        let alike = seen((5, 16), (2, 8), Some((10, 16)));
        assert_eq!(alike.acts(), Acts::Alike);
        assert_eq!(alike.expected(40).0, 10.0 / 16.0);
        assert_eq!(seen((0, 16), (8, 8), Some((4, 16))).acts(), Acts::AsTrained);
    }

    #[test]
    fn where_a_models_run_ends_nothing_is_held_against_it_any_more() {
        let shipped = |name| Scenario::shipped(name).expect("shipped").expect("sound");
        let (structures, world) = (shipped("acc_structures"), shipped("merge_fair"));
        let ego = world.with(&structures.reuse()["rss"]).expect("an ego");
        // It is cut in upon and brakes; one that keeps its acceleration is hit at once,
        // and was exact so far.
        let from = starts(&world, 24, 8);
        let mut actions = vec![2; 6];
        actions.push(4);
        let runs = alike(&ego, &actions, &from, &Watch::unwatched());
        let width = width_of(&world);
        let keeps = Arc::new(Surrogate {
            mean: vec![0.0; width],
            inverse_sd: vec![1.0; width],
            unit: [0.0, 0.0],
            range_mps2: [-8.0, 2.0],
            alike: Arc::default(),
            members: vec![Mlp::zeros(&[width, OUTPUTS])],
            brake: None,
        });
        let error = error_of(&ego, &keeps, &runs).expect("long enough");
        // With what the ego did afterwards it would be 3 m.
        assert!(error.rms_m < 0.5, "{error:?}");
        assert_eq!(error.rms_m, error.keeps_acceleration_m);
        assert!(error.is_telling(), "nothing is left to foresee");
    }
}
