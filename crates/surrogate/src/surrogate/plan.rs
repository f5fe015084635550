//! Planning of a start inside the surrogate, and execution in the real world.

use std::sync::Arc;

use super::ego_motion::{MotionReader, MotionSample};
use super::model::Surrogate;
use super::planning_budget::PlanningBudget;
use super::strategy::{Earlier, Policies, RobustScore, Strategy, play_strategy};
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::experiment::Watch;
use crate::rulebook::Verdict;
use crate::search::{Tree, WalkControl};
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, NoisyStart, Testbench};
use crate::world::DriveScenario;

/// Largest number of action switches in a plan.
const SWITCHES: usize = 2;
/// Largest number of sequences per number of switches that are tried on all variations.
const TRIED: usize = 64;
/// Number of found sequences after which only every `EVERY`-th is tried.
///
/// This keeps the tried sequences diverse.
const FIRST: usize = 16;
const EVERY: usize = 8;
/// Number of variations on which a plan must succeed to end the search.
///
/// Such a plan is also kept when the ego strays from the prediction.
const ENOUGH: usize = 7;
/// Decisions after which an unsure plan is searched again.
const PATIENCE: usize = 4;
/// Positions in [`VARIATIONS`] that plans are made for, in order.
///
/// If no plan succeeds on the surrogate, a plan for a slightly different ego may.
/// If it fails too, its run shows where the surrogate was wrong.
const LEADS: [usize; 4] = [0, 4, 5, 10];

/// Strategy with its score.
#[derive(Clone, Debug)]
pub(super) struct ScoredStrategy {
    pub strategy: Strategy,
    /// Rank of the leading variation that it was made for.
    ///
    /// 0 is the variation of the attempt. `LEADS.len()`: it succeeds on none.
    lead: usize,
    /// Number of variations on which it succeeds.
    score: usize,
}

impl ScoredStrategy {
    /// Returns whether it succeeds on the variation of the attempt.
    ///
    /// In the first attempt this is the surrogate itself.
    fn is_sure(&self) -> bool {
        self.lead == 0 && self.score > 0
    }

    fn is_better_than(&self, other: &ScoredStrategy) -> bool {
        // The rank counts first: a plan for the ego as it was fitted is the likeliest to work.
        self.lead < other.lead || (self.lead == other.lead && other.score < self.score)
    }
}

/// Run of the real ego under a choice.
#[derive(Clone, Debug)]
pub(super) struct PartialRun {
    /// Choice at the start.
    pub first: ScoredStrategy,
    /// Actions of the ado and motion of the ego.
    pub so_far: RunPrefix,
    /// Number of later changes of strategy.
    pub replans: u32,
}

impl PartialRun {
    /// Returns the strategy that the ado followed from beginning to end.
    pub(super) fn followed_throughout(&self) -> Option<&Strategy> {
        (self.replans == 0).then_some(&self.first.strategy)
    }
}

/// Planner of one thread, which also executes its plans.
pub(super) struct Planner<'a> {
    /// Model on the kinematic plant that explores the tree of sequences.
    tree: ModelBench,
    /// Model that plays sequences in turn.
    ///
    /// It uses the world's own plant where vehicles move differently on the kinematic plant.
    /// A rule kept by centimetres there is mostly broken on the own plant.
    judge: ModelBench,
    reader: MotionReader,
    surrogate: Arc<Surrogate>,
    policies: Policies<'a>,
    budget: PlanningBudget,
    /// Number of searches in vain during the present run.
    in_vain: u32,
    /// Earlier runs from the present start.
    earlier: Earlier,
    /// Rotation of the leading variations.
    attempt: usize,
    watch: &'a Watch<'a>,
}

impl<'a> Planner<'a> {
    /// Returns a planner for `world`, which judges plans on `plant`.
    pub(super) fn new(
        world: DriveScenario<'_>,
        surrogate: &Arc<Surrogate>,
        plant: PlantKind,
        policies: Policies<'a>,
        budget: PlanningBudget,
        watch: &'a Watch<'a>,
    ) -> Planner<'a> {
        Planner {
            tree: ModelBench::quick(world),
            judge: ModelBench::on(world, plant),
            reader: MotionReader::of(world),
            surrogate: Arc::clone(surrogate),
            policies,
            budget,
            in_vain: 0,
            earlier: Earlier::default(),
            attempt: 0,
            watch,
        }
    }

    /// Returns the strategy that succeeds on most variations, from `so_far` on.
    ///
    /// The leading variations are tried in order until a strategy succeeds on one of them.
    fn choose(&mut self, from: NoisyStart<'_>, so_far: &RunPrefix, leads: usize) -> ScoredStrategy {
        let bench = &self.judge.bench;
        let (actions, decisions) = (bench.spaces().actions, bench.clock().decisions());
        for lead in 0..leads {
            let is_first = lead == 0 && so_far.actions.is_empty();
            let mut best = ScoredStrategy {
                strategy: Strategy::AsTrained,
                lead,
                score: 0,
            };
            // Policies are judged before sequences, because they cost one episode each.
            for strategy in self.policies.strategies() {
                if best.score >= ENOUGH {
                    break;
                }
                let score = self.score(from, so_far, &strategy, lead, VARIATIONS.len());
                if best.score < score {
                    best = ScoredStrategy {
                        strategy,
                        score,
                        ..best
                    };
                }
            }
            // Few switches first: they are few sequences, and robust ones.
            for switches in 0..=SWITCHES {
                if best.score >= ENOUGH || self.watch.stopped() {
                    break;
                }
                let stride = self.budget.stride(actions, decisions, switches, is_first);
                self.search(from, so_far, switches, stride, &mut best);
            }
            // The finest search is slow, so it runs once per start and only if all else failed.
            if best.score == 0
                && is_first
                && self.earlier.count() == 0
                && let Some(finest) = self.budget.finest(actions, decisions)
            {
                self.search(from, so_far, SWITCHES, finest, &mut best);
            }
            if best.score > 0 {
                return best;
            }
        }
        // Worse than every find, and the ado still has something to play.
        ScoredStrategy {
            strategy: Strategy::AsTrained,
            lead: LEADS.len(),
            score: 0,
        }
    }

    /// Returns the strategy for a start that was played before.
    ///
    /// Plans may leave an earlier run at any of its beginnings, and the plan with the most
    /// variations is taken. Without any, another variation of the surrogate leads.
    fn choose_again(&mut self, from: NoisyStart<'_>, so_far: &RunPrefix) -> ScoredStrategy {
        let samples = self.judge.bench.clock().samples_per_decision();
        // A plan from the start needs no known beginning, so it is tried first.
        let mut best = self.choose(from, so_far, 1);
        for beginning in self.earlier.beginnings(samples) {
            if best.score == VARIATIONS.len() || self.watch.stopped() {
                return best;
            }
            let other = self.choose(from, &beginning, 1);
            // A policy would not reach this beginning by itself, so only plans count here.
            if matches!(other.strategy, Strategy::Plan(_)) && best.score < other.score {
                best = other;
            }
        }
        if best.score == 0 {
            self.attempt = self.earlier.count();
            best = self.choose(from, so_far, self.budget.leads);
        }
        best
    }

    /// Searches all sequences with this number of switches for a better strategy.
    fn search(
        &mut self,
        from: NoisyStart<'_>,
        so_far: &RunPrefix,
        switches: usize,
        stride: usize,
        best: &mut ScoredStrategy,
    ) {
        let quiet = self.watch.quiet();
        let rank = best.lead;
        let lead = self.variation(rank);
        let Planner {
            tree,
            judge,
            surrogate,
            earlier,
            policies,
            ..
        } = self;
        tree.set_ego(so_far, Some(surrogate), VARIATIONS[lead]);
        let (mut found, mut tried) = (0, 0);
        let mut accept = |actions: &[usize], _: &Testbench| {
            found += 1;
            // Neighbours in the tree are similar, so later finds are thinned out.
            if found > FIRST && !found.is_multiple_of(EVERY) {
                return WalkControl::Continue;
            }
            tried += 1;
            let strategy = Strategy::Plan(actions.to_vec());
            let mut trial = RobustScore {
                judge,
                surrogate,
                from,
                so_far,
                policies: *policies,
                earlier,
                lead,
            };
            let score = trial.score(&strategy, best.score..VARIATIONS.len());
            if best.score < score {
                *best = ScoredStrategy {
                    strategy,
                    score,
                    lead: rank,
                };
            }
            if best.score == VARIATIONS.len() || tried >= TRIED {
                WalkControl::Stop
            } else {
                WalkControl::Continue
            }
        };
        let root = &mut tree.bench;
        let actions = root.spaces().actions;
        let mut walk = Tree::new(root, from, 0, &mut accept, &quiet);
        walk.after = so_far.actions.clone();
        walk.stride = stride;
        for action in 0..actions {
            if walk.begin(root, action, switches) == WalkControl::Stop {
                break;
            }
        }
    }

    /// Returns the position in [`VARIATIONS`] of a leading variation.
    fn variation(&self, lead: usize) -> usize {
        LEADS[(lead + self.attempt) % LEADS.len()]
    }

    /// Returns the number of variations on which a strategy succeeds, at most `enough`.
    ///
    /// `lead` is the leading variation that it was made for.
    fn score(
        &mut self,
        from: NoisyStart<'_>,
        so_far: &RunPrefix,
        strategy: &Strategy,
        lead: usize,
        enough: usize,
    ) -> usize {
        let lead = self.variation(lead);
        let mut trial = RobustScore {
            judge: &mut self.judge,
            surrogate: &self.surrogate,
            from,
            so_far,
            policies: self.policies,
            earlier: &self.earlier,
            lead,
        };
        trial.score(strategy, 0..enough)
    }

    /// Returns the policy or constant that comes nearest to a success.
    fn nearest(&mut self, from: NoisyStart<'_>, so_far: &RunPrefix) -> Strategy {
        let actions = self.judge.bench.spaces().actions;
        let constants = (0..actions).map(|action| {
            let mut whole = so_far.actions.clone();
            whole.push(action);
            Strategy::Plan(whole)
        });
        let mut best = (f64::INFINITY, Strategy::AsTrained);
        for strategy in self.policies.strategies().chain(constants) {
            // The outcome of an earlier run is known, and it was no success.
            if self.earlier.has_followed(&strategy) {
                continue;
            }
            self.judge
                .begin(from, so_far, Some(&self.surrogate), VARIATIONS[0]);
            play_strategy(&mut self.judge, so_far, &strategy, self.policies);
            let margin = match self.judge.bench.verdict() {
                Some(Verdict::Held { margin }) => margin,
                // The ego failed here, counted or not, so no strategy comes nearer.
                Some(Verdict::Uncounted { .. } | Verdict::Counterexample { .. }) => 0.0,
                _ => f64::INFINITY,
            };
            if margin < best.0 {
                best = (margin, strategy);
            }
        }
        best.1
    }

    /// Predicts the motion of the ego under a strategy.
    fn predict(
        &mut self,
        from: NoisyStart<'_>,
        so_far: &RunPrefix,
        strategy: &Strategy,
    ) -> Vec<MotionSample> {
        let samples = self.judge.bench.clock().samples_per_decision();
        let known = self.earlier.known_under(so_far, strategy, samples);
        self.judge
            .begin(from, &known, Some(&self.surrogate), VARIATIONS[0]);
        play_strategy(&mut self.judge, &known, strategy, self.policies);
        self.judge.motion()
    }

    /// Returns a better choice than the present choice, after updating its score.
    fn rethink(
        &mut self,
        from: NoisyStart<'_>,
        so_far: &RunPrefix,
        now: &mut ScoredStrategy,
    ) -> Option<ScoredStrategy> {
        now.score = self.score(from, so_far, &now.strategy, now.lead, ENOUGH);
        // A robust plan is kept, because a search costs more than its likely gain.
        if now.is_sure() && now.score >= ENOUGH {
            return None;
        }
        let other = self.choose(from, so_far, 1);
        self.in_vain += u32::from(other.score == 0);
        other.is_better_than(now).then_some(other)
    }

    /// Plays a start of the real world and replans when the ego strays.
    ///
    /// The ego strays if it leaves the predicted motion.
    /// Further attempts use the motions of the earlier ones and leave one of them where a
    /// plan succeeds from there.
    pub(super) fn run(
        &mut self,
        real: &mut Testbench,
        from: NoisyStart<'_>,
        aftermath: Aftermath,
        earlier: &Earlier,
    ) -> PartialRun {
        real.begin(from.start, from.noise, aftermath);
        let mut so_far = RunPrefix::default();
        // The motion holds the sample at the start before any decision.
        self.reader.follow(real, &mut so_far.motion);
        self.earlier = earlier.clone();
        self.attempt = 0;
        self.in_vain = 0;
        let mut first = match earlier.count() {
            0 => self.choose(from, &so_far, self.budget.leads),
            _ => self.choose_again(from, &so_far),
        };
        if first.score == 0 {
            first.strategy = self.nearest(from, &so_far);
        }
        let mut now = first.clone();
        let mut predicted = self.predict(from, &so_far, &now.strategy);
        let mut chosen_at = 0;
        let mut replans = 0;
        let mut obs = vec![0.0; real.spaces().observation];
        while !real.is_done() {
            let decision = so_far.actions.len();
            let action = match (&now.strategy, self.policies.of(&now.strategy)) {
                (_, Some(policy)) => {
                    real.observe(&mut obs);
                    policy.act(&obs)
                }
                // Invariant: a plan holds at least one action.
                (Strategy::Plan(plan), _) => *plan.get(decision).or(plan.last()).unwrap_or(&0),
                // Invariant: `Policies::strategies` lists present policies only.
                _ => 0,
            };
            real.decide(action);
            so_far.actions.push(action);
            self.reader.follow(real, &mut so_far.motion);
            // After the verdict a new plan could change nothing.
            if real.is_decided() || self.watch.stopped() {
                continue;
            }
            let here = so_far.motion.len() - 1;
            // A predicted run that ended earlier than the real run counts as straying.
            let strays = predicted
                .get(here)
                .is_none_or(|expected| so_far.motion[here].strays_from(expected));
            let late = !now.is_sure() && decision + 1 - chosen_at >= PATIENCE;
            // Pauses grow with searches in vain, since another search would rarely find a plan.
            let rests = decision + 1 - chosen_at < self.budget.rest(self.in_vain);
            if rests || (!strays && !late) {
                continue;
            }
            chosen_at = decision + 1;
            if let Some(other) = self.rethink(from, &so_far, &mut now) {
                // A better rank of the same strategy is no change, so the run still
                // follows it throughout.
                replans += u32::from(now.strategy != other.strategy);
                now = other;
            }
            predicted = self.predict(from, &so_far, &now.strategy);
        }
        PartialRun {
            first,
            so_far,
            replans,
        }
    }
}
