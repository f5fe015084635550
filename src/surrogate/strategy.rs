//! Strategies of an ado from a start on, and the effort of planning them.
//!
//! A start can be planned again with the motion recorded in its earlier runs.
//! The ego is assumed to be deterministic: equal inputs give equal answers.
//! While the ado repeats the actions of an earlier run, the ego's motion is known.
//! The surrogate predicts only the part after the actions differ.
//! A later departure leaves less to predict.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::model::Surrogate;
use super::surrogate_sim::{ModelBench, NoisyStart, RunPrefix, VARIATIONS};
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::world::DriveScenario;

/// Behaviour of the ado from a start on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Strategy {
    /// Follows the trained policy.
    AsTrained,
    /// Follows the policy trained inside the surrogate.
    FineTuned,
    /// Plays these actions from the start on, the last action held.
    Plan(Vec<usize>),
}

/// Policies of the ado.
#[derive(Clone, Copy)]
pub(super) struct Policies<'a> {
    pub as_trained: &'a dyn Policy,
    /// Policy trained inside the surrogate, if any.
    pub fine_tuned: Option<&'a dyn Policy>,
}

impl<'a> Policies<'a> {
    /// Returns the available policies as strategies.
    pub(super) fn strategies(self) -> impl Iterator<Item = Strategy> {
        let fine_tuned = self.fine_tuned.map(|_| Strategy::FineTuned);
        std::iter::once(Strategy::AsTrained).chain(fine_tuned)
    }

    /// Returns the policy of a strategy, or `None` for a plan.
    pub(super) fn of(self, strategy: &Strategy) -> Option<&'a dyn Policy> {
        match strategy {
            Strategy::AsTrained => Some(self.as_trained),
            Strategy::FineTuned => self.fine_tuned,
            Strategy::Plan(_) => None,
        }
    }
}

/// Continues from `so_far` with a strategy.
pub(super) fn play_strategy(
    judge: &mut ModelBench,
    so_far: &RunPrefix,
    (strategy, policies): (&Strategy, Policies<'_>),
) {
    if let Strategy::Plan(actions) = strategy {
        // The last action is held, so at least one action remains to be played.
        let from = so_far.actions.len().min(actions.len().saturating_sub(1));
        judge.play_actions(&actions[from..]);
    } else if let Some(policy) = policies.of(strategy) {
        judge.follow(policy);
    }
}

/// Trial of strategies on all variations.
pub(super) struct RobustScore<'a> {
    pub judge: &'a mut ModelBench,
    pub surrogate: &'a Arc<Surrogate>,
    pub from: NoisyStart<'a>,
    pub so_far: &'a RunPrefix,
    pub policies: Policies<'a>,
    pub earlier: &'a Earlier,
    pub lead: usize,
}

impl RobustScore<'_> {
    /// Returns the number of variations on which a strategy succeeds.
    ///
    /// A failure on the leading variation gives 0. Counting ends at `wanted.end`, or as soon
    /// as `wanted.start` cannot be exceeded.
    pub(super) fn score(&mut self, strategy: &Strategy, wanted: Range<usize>) -> usize {
        let samples = self.judge.bench.clock().samples_per_decision();
        // The real ego has already survived this strategy from this start.
        if self.so_far.actions.is_empty() && self.earlier.has_followed(strategy) {
            return 0;
        }
        let known = self.earlier.known_under(self.so_far, strategy, samples);
        let others = (0..VARIATIONS.len()).filter(|&other| other != self.lead);
        let mut score = 0;
        for (tried, variation) in std::iter::once(self.lead).chain(others).enumerate() {
            if score == wanted.end || score + (VARIATIONS.len() - tried) <= wanted.start {
                break;
            }
            let variation = VARIATIONS[variation];
            self.judge
                .begin(self.from, &known, Some(self.surrogate), variation);
            play_strategy(self.judge, &known, (strategy, self.policies));
            match (self.judge.is_success(), tried) {
                (true, _) => score += 1,
                (false, 0) => return 0,
                (false, _) => {}
            }
        }
        score
    }
}

/// Distance in decisions between two points at which an earlier run can be left.
const EVERY: usize = 2;

/// Earlier runs from a start, none of them successful.
#[derive(Clone, Debug, Default)]
pub(super) struct Earlier {
    runs: Vec<RunPrefix>,
    /// Strategies that the ado followed from beginning to end.
    followed: Vec<Strategy>,
}

impl Earlier {
    /// Adds an unsuccessful run and the strategy followed throughout it.
    pub(super) fn add(&mut self, run: RunPrefix, followed: Option<Strategy>) {
        self.followed.extend(followed);
        self.runs.push(run);
    }

    /// Returns the number of earlier runs.
    pub(super) fn count(&self) -> usize {
        self.runs.len()
    }

    /// Returns whether a strategy was already followed from the start without success.
    pub(super) fn has_followed(&self, strategy: &Strategy) -> bool {
        match strategy {
            Strategy::Plan(actions) => self.has_played(actions),
            policy => self.followed.contains(policy),
        }
    }

    /// Returns whether these actions, the last action held, were played to the end.
    fn has_played(&self, actions: &[usize]) -> bool {
        let mut runs = self.runs.iter();
        runs.any(|run| common(run, actions) == run.actions.len())
    }

    /// Returns the known run for these actions, the last action held.
    ///
    /// It is `so_far`, or a longer part of an earlier run that began with the actions.
    fn known<'a>(
        &self,
        so_far: &'a RunPrefix,
        actions: &[usize],
        samples: usize,
    ) -> Cow<'a, RunPrefix> {
        let runs = self.runs.iter().map(|run| (common(run, actions), run));
        // A replay of an earlier run is worth it only where it is longer than this run.
        match runs.max_by_key(|(same, _)| *same) {
            Some((same, run)) if so_far.actions.len() < same => {
                Cow::Owned(run.up_to(same, samples))
            }
            _ => Cow::Borrowed(so_far),
        }
    }

    /// Returns the known run under a strategy. The actions of a policy are not known.
    pub(super) fn known_under<'a>(
        &self,
        so_far: &'a RunPrefix,
        strategy: &Strategy,
        samples: usize,
    ) -> Cow<'a, RunPrefix> {
        match strategy {
            Strategy::Plan(actions) => self.known(so_far, actions, samples),
            _ => Cow::Borrowed(so_far),
        }
    }

    /// Returns the points at which earlier runs can be left.
    ///
    /// `samples` is the number of samples per decision.
    pub(super) fn beginnings(&self, samples: usize) -> Vec<RunPrefix> {
        let of_run = |run: &RunPrefix| {
            let lengths = (EVERY..run.actions.len()).step_by(EVERY);
            let beginnings = lengths.map(|length| run.up_to(length, samples));
            beginnings.collect::<Vec<_>>()
        };
        self.runs.iter().flat_map(of_run).collect()
    }
}

/// Returns how many leading actions of a run equal these actions, the last action held.
fn common(run: &RunPrefix, actions: &[usize]) -> usize {
    // The last action is held, so a short plan is compared with the whole run.
    let wanted = actions.iter().chain(std::iter::repeat_n(
        actions.last().unwrap_or(&0),
        run.actions.len(),
    ));
    let pairs = run.actions.iter().zip(wanted);
    pairs.take_while(|(run, wanted)| run == wanted).count()
}

/// Spacing of the decisions at which a sequence may switch actions.
#[derive(Clone, Copy, Debug)]
struct SwitchSpacing {
    /// Spacing with one switch, decisions.
    one: usize,
    /// Smallest spacing with two switches, decisions.
    two: usize,
    /// Largest number of sequences with two switches.
    ///
    /// Many actions or decisions widen the spacing until this limit holds.
    most: usize,
}

/// Spacing that suits three actions and 30 decisions.
const FINE: SwitchSpacing = SwitchSpacing {
    one: 1,
    two: 2,
    most: 6_000,
};
/// Largest number of sequences if nothing else was found, about five times as slow.
const FINEST: usize = 30_000;
/// Spacing for searches that are repeated often.
const QUICK: SwitchSpacing = SwitchSpacing {
    one: 1,
    two: 4,
    most: 2_000,
};

/// Planning effort of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanningBudget {
    /// Number of leading variations to plan for.
    ///
    /// They are tried if the surrogate itself has no plan.
    pub leads: usize,
    /// Spacing before the first action, for the surrogate itself.
    first: SwitchSpacing,
    /// Spacing for its variations and during the run.
    later: SwitchSpacing,
    /// Whether a last, finer search follows if nothing else was found.
    is_finest: bool,
    /// Decisions without a search after the first search in vain.
    ///
    /// Every further search in vain doubles them.
    rest: usize,
}

impl PlanningBudget {
    /// Effort for a run that counts.
    pub(super) const FULL: PlanningBudget = PlanningBudget {
        leads: 4,
        first: FINE,
        later: QUICK,
        is_finest: true,
        rest: 0,
    };
    /// Effort for a run that is recorded for learning.
    ///
    /// Such a run need not succeed, and there are many of them.
    pub(super) const BRIEF: PlanningBudget = PlanningBudget {
        leads: 2,
        first: QUICK,
        later: SwitchSpacing { one: 2, ..QUICK },
        is_finest: false,
        rest: 4,
    };

    /// Returns the spacing of the switches of a sequence.
    ///
    /// `size` holds the number of actions and of decisions.
    pub(super) fn stride(&self, size: (usize, usize), switches: usize, is_first: bool) -> usize {
        let grid = if is_first { self.first } else { self.later };
        match switches {
            0 | 1 => grid.one,
            _ => stride(size, grid.two, grid.most),
        }
    }

    /// Returns the spacing of the last search, if it is finer than the first search.
    pub(super) fn finest(&self, size: (usize, usize)) -> Option<usize> {
        let finest = stride(size, 1, FINEST);
        (self.is_finest && finest < self.stride(size, 2, true)).then_some(finest)
    }

    /// Returns the number of decisions without a search after `in_vain` failures.
    pub(super) fn rest(&self, in_vain: u32) -> usize {
        match in_vain {
            0 => 0,
            // The shift is bounded, so the pause cannot overflow.
            _ => self.rest << (in_vain - 1).min(8),
        }
    }
}

/// Returns the smallest spacing, at least `least`, with at most `most` sequences.
fn stride((actions, decisions): (usize, usize), least: usize, most: usize) -> usize {
    let others = actions.saturating_sub(1);
    let sequences = |stride: usize| {
        let places = decisions / stride;
        // Three actions in a row, neighbours different, and two ordered places.
        actions * others * others * places * places.saturating_sub(1) / 2
    };
    (least..decisions)
        // A run too short for any switch gets a spacing of its whole length.
        .find(|&stride| sequences(stride) <= most)
        .unwrap_or(decisions.max(1))
}

/// Times of the switch to the second action, as shares of the horizon.
const SWITCH_AT: [f64; 3] = [0.125, 0.25, 0.5];
/// Number of actions above which only the best constants are tried second.
const MANY: usize = 6;
/// Number of constants tried second in that case.
const SECOND: usize = 3;
/// Starts in the surrogate on which the candidates are compared.
const STARTS: usize = 40;

/// Actions tried on an ego, the same from every start.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriedActions {
    /// Actions in order, the last action held.
    pub actions: Vec<usize>,
    /// Runs of the ego under them.
    pub runs: u64,
    /// Runs in which the ego failed and the ado kept every rule.
    pub successes: u64,
}

/// Result of actions on the surrogate.
#[derive(Clone, Copy, Debug, Default)]
struct ActionScore {
    successes: usize,
    /// Starts with a broken rule or without a counted verdict.
    violations: usize,
    /// Sum of the margins over all other starts.
    margins: f64,
}

/// Returns the best constant action or pair of actions on the surrogate.
///
/// Candidates are ordered by successes, then by broken rules, then by margin.
/// `None`: the ado has no actions.
pub(super) fn best_fixed(
    world: DriveScenario<'_>,
    surrogate: &Arc<Surrogate>,
    starts: &[(Start, u64)],
) -> Option<Vec<usize>> {
    let mut model = ModelBench::quick(world);
    let actions = model.bench.spaces().actions;
    let decisions = model.bench.clock().decisions();
    // All candidates play the same starts, so their counts are comparable.
    let starts = &starts[..starts.len().min(STARTS)];
    let mut score = |actions: &[usize]| {
        let mut score = ActionScore::default();
        for (start, noise) in starts {
            let from = (start, *noise);
            model.begin(from, &RunPrefix::default(), Some(surrogate), VARIATIONS[0]);
            model.play_actions(actions);
            match model.bench.verdict() {
                Some(Verdict::Counterexample { .. }) => score.successes += 1,
                Some(Verdict::Held { margin }) => score.margins += margin,
                _ => score.violations += 1,
            }
        }
        score
    };
    let mut tried: Vec<(Vec<usize>, ActionScore)> = (0..actions)
        .map(|action| (vec![action], score(&[action])))
        .collect();
    // The constants must be ranked before the best of them are taken as second actions.
    sort(&mut tried);
    let second = if MANY < actions { SECOND } else { actions };
    let last: Vec<usize> = tried.iter().take(second).map(|one| one.0[0]).collect();
    for first in 0..actions {
        for &then in last.iter().filter(|&&then| then != first) {
            for share in SWITCH_AT {
                // At least one decision, so that the first action is played at all.
                let held = ((share * decisions as f64).round() as usize).max(1);
                let mut sequence = vec![first; held];
                sequence.push(then);
                let score = score(&sequence);
                tried.push((sequence, score));
            }
        }
    }
    sort(&mut tried);
    tried.into_iter().next().map(|(actions, _)| actions)
}

/// Sorts the candidates, the best first, and keeps the order of equals.
fn sort(tried: &mut [(Vec<usize>, ActionScore)]) {
    tried.sort_by(|(_, a), (_, b)| {
        let by_successes = b.successes.cmp(&a.successes);
        let by_violations = a.violations.cmp(&b.violations);
        by_successes
            .then(by_violations)
            // A smaller margin means that the ego came closer to a failure.
            .then(a.margins.total_cmp(&b.margins))
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::nn::Mlp;
    use crate::surrogate::model::OUTPUTS;
    use crate::surrogate::surrogate_sim::MotionSample;
    use crate::world::Scenario;

    /// Run with two samples per decision. The sample number is the position.
    fn run(actions: &[usize]) -> RunPrefix {
        let moment = |sample: usize| MotionSample {
            s_m: sample as f64,
            ..MotionSample::default()
        };
        RunPrefix {
            actions: actions.to_vec(),
            motion: (0..=2 * actions.len()).map(moment).collect(),
        }
    }

    fn earlier(runs: &[&[usize]]) -> Earlier {
        Earlier {
            runs: runs.iter().map(|actions| run(actions)).collect(),
            followed: vec![Strategy::AsTrained],
        }
    }

    #[test]
    fn an_earlier_run_tells_how_the_ego_moves_until_the_actions_differ() {
        let earlier = earlier(&[&[0, 1, 1, 2], &[0, 1, 2, 2, 2]]);
        let nothing = run(&[]);
        let known = |actions: &[usize]| {
            let known = earlier.known(&nothing, actions, 2);
            (known.actions.len(), known.motion.len())
        };
        assert_eq!(known(&[1]), (0, 1));
        assert_eq!(known(&[0]), (1, 3));
        assert_eq!(known(&[0, 1]), (3, 7), "the last action is held");
        assert_eq!(known(&[0, 1, 2, 0]), (3, 7));
        assert_eq!(known(&[0, 1, 2]), (5, 11), "to its end");
        // The motion of this run is longer than any known beginning of an earlier run.
        let seen = run(&[0, 1, 1, 0]);
        assert_eq!(*earlier.known(&seen, &[0, 1, 1, 0, 2], 2), seen);
    }

    #[test]
    fn what_was_played_to_its_end_is_not_played_again() {
        let earlier = earlier(&[&[0, 1, 1, 2]]);
        assert!(earlier.has_played(&[0, 1, 1, 2]));
        assert!(!earlier.has_played(&[0, 1, 1]));
        assert!(!earlier.has_played(&[0, 1]));
        assert!(earlier.has_followed(&Strategy::Plan(vec![0, 1, 1, 2])));
        assert!(earlier.has_followed(&Strategy::AsTrained));
        assert!(!earlier.has_followed(&Strategy::FineTuned));
        assert!(super::Earlier::default().beginnings(2).is_empty());
        let from: Vec<_> = earlier.beginnings(2);
        assert_eq!(from.len(), 1);
        assert_eq!((from[0].actions.len(), from[0].motion.len()), (2, 5));
    }

    #[test]
    fn with_many_actions_switches_are_further_apart() {
        // `acc` is searched completely. `cut_in` is searched at every fifth or seventh
        // decision, and at every second decision in the last search.
        assert_eq!(PlanningBudget::FULL.finest((3, 30)), Some(1));
        assert_eq!(PlanningBudget::FULL.stride((3, 30), 2, true), 2);
        assert_eq!(PlanningBudget::FULL.stride((3, 30), 2, false), 4);
        assert_eq!(PlanningBudget::FULL.finest((6, 40)), Some(2));
        assert_eq!(PlanningBudget::FULL.finest((10, 100)), Some(11));
        assert_eq!(PlanningBudget::FULL.stride((6, 40), 2, true), 5);
        assert_eq!(PlanningBudget::FULL.stride((6, 40), 2, false), 7);
        // A single action has no switches, and too many actions leave no place for them.
        assert_eq!(stride((1, 40), 1, 6_000), 1);
        assert_eq!(stride((1000, 40), 1, 6_000), 21);
        assert_eq!(stride((3, 1), 1, 6_000), 1);
    }

    #[test]
    fn a_recorded_run_is_thought_over_less_and_less_often() {
        assert_eq!([0, 1, 2, 3].map(|n| PlanningBudget::FULL.rest(n)), [0; 4]);
        assert_eq!(
            [0, 1, 2, 3].map(|n| PlanningBudget::BRIEF.rest(n)),
            [0, 4, 8, 16]
        );
        assert_eq!(PlanningBudget::BRIEF.finest((3, 30)), None);
    }

    #[test]
    fn of_actions_that_are_the_same_everywhere_those_with_most_successes_are_found() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = world.drive().expect("driven");
        let width = super::super::surrogate_sim::width_of(world);
        // Surrogate that keeps its acceleration whatever it sees.
        let net = Mlp::orthogonal(
            &[width, 4, OUTPUTS],
            0.1,
            &mut crate::rl::LearnerRng::new(1),
        );
        let idle = Arc::new(Surrogate::of_members(vec![net], [0.0, 0.0], [-9.0, 9.0]));
        let from = super::super::dataset::starts(&world, 20, 3);
        let found = best_fixed(world, &idle, &from).expect("actions");
        // A coasting follower is hit most surely by braking at once. A stop breaks a rule.
        let (last, before) = found.split_last().expect("an action");
        assert!(
            !before.is_empty() && before.iter().all(|&action| action == 0),
            "{found:?}"
        );
        assert_ne!(*last, 0);
    }
}
