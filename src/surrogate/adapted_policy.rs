//! Test starts, planned in a surrogate and played once or a few times.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::earlier_attempts::Earlier;
use super::learn::{Acts, LearnedEgo, LearnedFrom, SurrogateError};
use super::plan::Planner;
use super::planning_budget::PlanningBudget;
use super::strategy::{Policies, Strategy};
use crate::adversary::{EpisodeResult, EvalRequest, Evaluated, RepeatedEpisode, in_words};
use crate::experiment::{Watch, WorkItem};
use crate::rl::{Policy, load_policy};
use crate::run_dir::AdversaryId;
use crate::scene::Start;
use crate::testbench::{Aftermath, Replay, Testbench, play};
use crate::world::Scenario;

/// Row of planned runs, with the strategies that the ado followed.
#[derive(Clone, Debug)]
pub struct AdaptedRow {
    /// The row.
    pub evaluated: Evaluated,
    /// Starts on which the ado followed its trained policy throughout.
    pub as_trained: usize,
    /// Starts on which it followed the policy trained inside the surrogate throughout.
    /// `None`: no such policy was trained.
    pub trained_on: Option<usize>,
}

/// Record of a learned ego and of the ado's behaviour against it.
#[derive(Clone, Debug, Serialize)]
pub struct AdaptedTo {
    /// Name of the ego, as in the rows.
    pub ego: String,
    /// Facts recorded while the ego was learned.
    #[serde(flatten)]
    pub learned: LearnedFrom,
    /// Runs from which a conditional ado identified the ego's parameters.
    /// 0: the ado is not conditional.
    pub identified_from: u64,
    /// Way in which the ado acts.
    pub acts: Acts,
    /// The same in words, with the reason.
    pub how: String,
    /// Expected share of solved starts.
    pub expected: f64,
    /// 95 % interval of `expected`.
    pub expected_ci95: [f64; 2],
    /// Test starts on which the ado followed its trained policy throughout.
    pub starts_as_trained: usize,
    /// Test starts on which it followed the policy trained inside the surrogate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub starts_trained_on: Option<usize>,
}

impl AdaptedTo {
    /// Builds the record from the learned facts and the row of test starts.
    pub fn of(
        (ego, world): (&str, &Scenario),
        learned: &LearnedFrom,
        identified_from: u64,
        row: &AdaptedRow,
    ) -> AdaptedTo {
        let (expected, expected_ci95) = learned.expected(row.evaluated.row.starts);
        AdaptedTo {
            ego: ego.to_owned(),
            learned: learned.clone(),
            identified_from,
            acts: learned.acts(),
            how: how(world, learned),
            expected,
            expected_ci95,
            starts_as_trained: row.as_trained,
            starts_trained_on: row.trained_on,
        }
    }
}

impl Display for AdaptedTo {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let LearnedFrom { runs, error, .. } = self.learned;
        write!(f, "`{}`: learned from {runs} runs of it", self.ego)?;
        if 0 < self.identified_from {
            write!(f, ", and identified from {}", self.identified_from)?;
        }
        if let Some(like) = self.learned.alike.first() {
            write!(f, "; most like {like}")?;
        }
        if let Some(brake) = &self.learned.brake {
            write!(
                f,
                "; it {brake} (own speed v, the other's w, closing with c)"
            )?;
        }
        if let Some(error) = error {
            let SurrogateError {
                rms_m,
                keeps_acceleration_m,
            } = error;
            write!(
                f,
                "; two seconds ahead its surrogate is {rms_m:.2} m off, an ego that keeps its acceleration {keeps_acceleration_m:.2} m"
            )?;
            if !error.is_telling() {
                f.write_str(": it hardly foresees the ego, so plans miss")?;
            }
        }
        let [low, high] = self.expected_ci95.map(|bound| 100.0 * bound);
        write!(
            f,
            "; the ado acts {}, expected to solve {:.0} % of the starts [{low:.0}, {high:.0}]; on {} it acted as trained throughout",
            self.how,
            100.0 * self.expected,
            self.starts_as_trained
        )?;
        match self.starts_trained_on {
            Some(starts) => write!(f, ", on {starts} as it learned to inside the surrogate"),
            None => Ok(()),
        }
    }
}

/// Describes how the ado acts and why.
fn how(world: &Scenario, learned: &LearnedFrom) -> String {
    let LearnedFrom {
        planned,
        planned_successes,
        ..
    } = learned;
    match (learned.acts(), &learned.fixed) {
        (Acts::Planned, None) => "start by start as it does best in the surrogate".to_owned(),
        (Acts::Planned, Some(tried)) => format!(
            "start by start as it does best in the surrogate, which solved {planned_successes} of {planned} recorded starts ({}: {} of {})",
            in_words(world, &tried.actions),
            tried.successes,
            tried.runs
        ),
        (Acts::AsTrained, _) => {
            "as it was trained, which does clearly better than planning".to_owned()
        }
        (Acts::Alike, tried) => {
            let (actions, runs, successes) = tried.as_ref().map_or((&[][..], 0, 0), |tried| {
                (&tried.actions[..], tried.runs, tried.successes)
            });
            format!(
                "alike everywhere, {}, which solved {successes} of {runs} recorded starts (plans: {planned_successes} of {planned})",
                in_words(world, actions)
            )
        }
    }
}

/// Planner of one thread, with the bench of the real ego.
struct PlanningWorker<'a> {
    planner: Option<Planner<'a>>,
    bench: Testbench,
}

/// One start, played.
struct One {
    played: EpisodeResult,
    /// Strategy that the ado followed from beginning to end.
    kept: Option<Strategy>,
}

impl LearnedEgo {
    /// Plans every start of `request` and plays it until its first success.
    ///
    /// A start gets at most `tries` runs. The ado of `request` must be `policy`.
    pub fn eval(
        &self,
        request: &EvalRequest<'_>,
        policy: &dyn Policy,
        tries: u64,
        watch: &Watch<'_>,
    ) -> AdaptedRow {
        let stored = self.trained_on.as_deref();
        // A stored policy that no longer loads is left out and the plans remain.
        let trained_on = stored.and_then(|stored| load_policy(stored).ok());
        let policies = Policies {
            as_trained: policy,
            trained_on: trained_on.as_deref(),
        };
        // Every thread has its own planner and bench, so starts share no state.
        let worker = || PlanningWorker {
            planner: Planner::new(
                request.scenario,
                (&self.surrogate, self.from.judged_on),
                (policies, PlanningBudget::FULL),
                watch,
            ),
            bench: request.scenario.bench(),
        };
        let one = |worker: &mut PlanningWorker<'_>, from: &(Start, u64), turn: &WorkItem| {
            let planner = worker.planner.as_mut()?;
            let bench = &mut worker.bench;
            self.solve(request, (planner, bench), from, (turn, tries), watch)
        };
        let all = request.starts.each(watch, worker, one);
        let kept_to = |strategy: Strategy| {
            let played = all.iter().flatten();
            played
                .filter(|one| one.kept.as_ref() == Some(&strategy))
                .count()
        };
        let as_trained = kept_to(Strategy::AsTrained);
        // Without such a policy the count is absent, not zero.
        let trained_on = policies.trained_on.map(|_| kept_to(Strategy::TrainedOn));
        let played = all.into_iter().map(|one| Some(one?.played));
        // The row was filled for a plain evaluation, so ado and method are renamed here.
        let mut evaluated = Evaluated::of(request, played.collect(), watch);
        let row = &mut evaluated.row;
        // Rows of the policy itself keep its name, so both can be compared in a table.
        row.ado = AdversaryId::Adapted;
        row.method = match self.from.acts() {
            Acts::Planned => format!("planned in a surrogate of {} runs", self.from.runs),
            Acts::AsTrained => format!("{}, as trained", row.method),
            Acts::Alike => in_words(request.scenario, self.alike()),
        };
        if 1 < tries {
            row.method = format!("{}, at most {tries} tries", row.method);
        }
        AdaptedRow {
            evaluated,
            as_trained,
            trained_on,
        }
    }

    /// Returns the actions that are the same from every start.
    fn alike(&self) -> &[usize] {
        let tried = self.from.fixed.as_ref();
        tried.map_or(&[], |tried| &tried.actions)
    }

    fn solve(
        &self,
        request: &EvalRequest<'_>,
        (planner, bench): (&mut Planner<'_>, &mut Testbench),
        (start, noise): &(Start, u64),
        (turn, tries): (&WorkItem, u64),
        watch: &Watch<'_>,
    ) -> Option<One> {
        let mut first: Option<One> = None;
        let (mut simulations, mut physics_steps) = (0, 0);
        // The trained policy and fixed actions would repeat the same run.
        let acts = self.from.acts();
        let tries = if acts == Acts::Planned {
            tries.max(1)
        } else {
            1
        };
        let mut earlier = Earlier::default();
        for _ in 0..tries {
            // A stopped start keeps its finished runs.
            if watch.stopped() {
                break;
            }
            let from = (start, *noise);
            let (episode, kept) = match acts {
                Acts::Planned => {
                    let run = planner.run(bench, from, Aftermath::Play, &earlier);
                    let kept = run.kept().cloned();
                    let actions = run.so_far.actions.clone();
                    // The next try starts from the ego's motion recorded in this run.
                    earlier.add(run.so_far, kept.clone());
                    (bench.episode(start, *noise, actions), kept)
                }
                Acts::AsTrained => (request.play(bench, turn.index), Some(Strategy::AsTrained)),
                Acts::Alike => {
                    let mut alike = Replay::holding(self.alike());
                    let played = play(bench, start, *noise, &mut alike, Aftermath::Play);
                    (played, None)
                }
            };
            watch.faults.note(turn.index as u64, episode.fault.as_ref());
            simulations += 1;
            physics_steps += episode.physics_steps;
            let attempt = RepeatedEpisode::of(episode, simulations, physics_steps);
            let one = One {
                played: attempt.played(request.scenario, turn.cpu_s()),
                kept,
            };
            // A success ends the tries, and its outcome counts every run up to here.
            if one.played.outcome.verdict.is_success() {
                return Some(one);
            }
            first.get_or_insert(one);
        }
        // An unsolved start keeps the outcome of its first run, with the cost of all runs.
        let mut unsolved = first?;
        unsolved.played.outcome.simulations = simulations;
        unsolved.played.outcome.physics_steps = physics_steps;
        Some(unsolved)
    }
}
