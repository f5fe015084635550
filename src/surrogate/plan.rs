//! Planning a start inside the surrogate, and acting on it in the real world.

use std::borrow::Cow;
use std::sync::Arc;

use super::earlier_attempts::Earlier;
use super::model::Surrogate;
use super::motion::{Moment, MotionReader};
use super::planning_budget::Care;
use super::robust_score::{Trial, go_on};
use super::strategy::{Policies, Strategy};
use super::surrogate_sim::{ModelBench, Origin, SoFar, VARIATIONS};
use crate::experiment::Watch;
use crate::rulebook::Verdict;
use crate::search::{Next, Tree};
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Testbench};
use crate::world::Scenario;

/// Most switches of action in a plan.
const SWITCHES: usize = 2;
/// Sequences that are tried on all variations, per number of switches.
const TRIED: usize = 64;
/// Beyond the first of them only every so many-th that is found is tried, so
/// that they are not all alike.
const FIRST: usize = 16;
const EVERY: usize = 8;
/// Variations on which a plan must succeed to be taken without looking at
/// sequences with more switches, or to be kept when the ego strays from it.
const ENOUGH: usize = 7;
/// Decisions after which one who has no sure plan looks for one again.
const PATIENCE: usize = 4;
/// The variations that plans are made for, as positions in [`VARIATIONS`]: where
/// nothing succeeds on the surrogate, what would if the ego were a little less
/// careful, this way or that. Such a plan may succeed, and if it does not it has
/// led to where the surrogate should have known better.
const LEADS: [usize; 4] = [0, 4, 5, 10];

/// A strategy, and what it is worth.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub strategy: Strategy,
    /// Which of the leading variations it was made for, the first one being that
    /// of the attempt; their number: it succeeds on none.
    lead: usize,
    /// On how many variations it succeeds.
    score: usize,
}

impl Choice {
    /// Whether it succeeds on the variation of the attempt, at first the surrogate
    /// itself.
    fn is_sure(&self) -> bool {
        self.lead == 0 && 0 < self.score
    }

    fn is_better_than(&self, other: &Choice) -> bool {
        self.lead < other.lead || (self.lead == other.lead && other.score < self.score)
    }
}

/// A run of the real ego under a choice.
#[derive(Clone, Debug)]
pub(super) struct PlannedRun {
    /// What was chosen at the start.
    pub first: Choice,
    /// What the ado did and how the ego moved.
    pub so_far: SoFar,
    /// How often another choice was made on the way.
    pub replans: u32,
}

impl PlannedRun {
    /// What the ado kept to from beginning to end.
    pub fn kept(&self) -> Option<&Strategy> {
        (self.replans == 0).then_some(&self.first.strategy)
    }
}

/// Plans and acts; one per thread.
pub(super) struct Planner<'a> {
    /// Explores the tree of sequences, on the kinematic plant.
    tree: ModelBench,
    /// Plays one sequence after the other, on the world's own plant where somebody moves
    /// otherwise on the kinematic one: where a rule is kept by centimetres, what succeeds
    /// on that mostly breaks it.
    judge: ModelBench,
    reader: MotionReader,
    surrogate: Arc<Surrogate>,
    policies: Policies<'a>,
    care: Care,
    /// Searches on the way of the run at hand that found nothing.
    in_vain: u32,
    /// Earlier runs from the start at hand.
    earlier: Earlier,
    /// By how many the leading variations are moved on.
    attempt: usize,
    watch: &'a Watch<'a>,
}

impl<'a> Planner<'a> {
    /// For `world`, plans being judged on a plant; `None`: nobody drives in it.
    pub fn new(
        world: &Scenario,
        (surrogate, plant): (&Arc<Surrogate>, PlantKind),
        (policies, care): (Policies<'a>, Care),
        watch: &'a Watch<'a>,
    ) -> Option<Planner<'a>> {
        Some(Planner {
            tree: ModelBench::quick(world)?,
            judge: ModelBench::on(world, plant)?,
            reader: MotionReader::of(world)?,
            surrogate: Arc::clone(surrogate),
            policies,
            care,
            in_vain: 0,
            earlier: Earlier::default(),
            attempt: 0,
            watch,
        })
    }

    /// The strategy that succeeds on most variations, from what is so far on; on
    /// the first of so many leading ones on which anything does.
    fn choose(&mut self, from: Origin<'_>, so_far: &SoFar, leads: usize) -> Choice {
        let bench = &self.judge.bench;
        let size = (bench.spaces().actions, bench.clock().decisions());
        for lead in 0..leads {
            let is_first = lead == 0 && so_far.actions.is_empty();
            let mut best = Choice {
                strategy: Strategy::AsTrained,
                lead,
                score: 0,
            };
            for strategy in self.policies.strategies() {
                if ENOUGH <= best.score {
                    break;
                }
                let score = self.score(from, so_far, (&strategy, lead), VARIATIONS.len());
                if best.score < score {
                    best = Choice {
                        strategy,
                        score,
                        ..best
                    };
                }
            }
            for switches in 0..=SWITCHES {
                if ENOUGH <= best.score || self.watch.stopped() {
                    break;
                }
                let stride = self.care.stride(size, switches, is_first);
                self.search(from, so_far, (switches, stride), &mut best);
            }
            if best.score == 0
                && is_first
                && self.earlier.count() == 0
                && let Some(finest) = self.care.finest(size)
            {
                self.search(from, so_far, (SWITCHES, finest), &mut best);
            }
            if 0 < best.score {
                return best;
            }
        }
        Choice {
            strategy: Strategy::AsTrained,
            lead: LEADS.len(),
            score: 0,
        }
    }

    /// The strategy for a start that was played before: of all places where an
    /// earlier run can be left, the one from which a plan succeeds on most
    /// variations. Where none does, one for another variation of the surrogate.
    fn choose_again(&mut self, from: Origin<'_>, so_far: &SoFar) -> Choice {
        let samples = self.judge.bench.clock().samples_per_decision();
        let mut best = self.choose(from, so_far, 1);
        for beginning in self.earlier.beginnings(samples) {
            if best.score == VARIATIONS.len() || self.watch.stopped() {
                return best;
            }
            let other = self.choose(from, &beginning, 1);
            // By itself no policy would come by there.
            if matches!(other.strategy, Strategy::Plan(_)) && best.score < other.score {
                best = other;
            }
        }
        if best.score == 0 {
            self.attempt = self.earlier.count();
            best = self.choose(from, so_far, self.care.leads);
        }
        best
    }

    /// Looks through all sequences with so many switches for a better one.
    fn search(
        &mut self,
        from: Origin<'_>,
        so_far: &SoFar,
        (switches, stride): (usize, usize),
        best: &mut Choice,
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
        tree.cast(so_far, Some(surrogate), VARIATIONS[lead]);
        let (mut found, mut tried) = (0, 0);
        let mut accept = |actions: &[usize], _: &Testbench| {
            found += 1;
            if FIRST < found && !found.is_multiple_of(EVERY) {
                return Next::Continue;
            }
            tried += 1;
            let strategy = Strategy::Plan(actions.to_vec());
            let mut trial = Trial {
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
                *best = Choice {
                    strategy,
                    score,
                    lead: rank,
                };
            }
            match best.score == VARIATIONS.len() || TRIED <= tried {
                true => Next::Stop,
                false => Next::Continue,
            }
        };
        let root = &mut tree.bench;
        let actions = root.spaces().actions;
        let mut walk = Tree::new(root, (from, 0), Aftermath::Skip, &mut accept, &quiet);
        walk.after = so_far.actions.clone();
        walk.stride = stride;
        for action in 0..actions {
            if walk.begin(root, action, switches) == Next::Stop {
                break;
            }
        }
    }

    /// Position in [`VARIATIONS`] of a leading one.
    fn variation(&self, lead: usize) -> usize {
        LEADS[(lead + self.attempt) % LEADS.len()]
    }

    /// On how many variations a strategy succeeds that was made for a leading one;
    /// no more than `enough` are counted.
    fn score(
        &mut self,
        from: Origin<'_>,
        so_far: &SoFar,
        (strategy, lead): (&Strategy, usize),
        enough: usize,
    ) -> usize {
        let lead = self.variation(lead);
        let mut trial = Trial {
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

    /// Where nothing succeeds: what comes nearest to it, of the policies and the
    /// constants.
    fn nearest(&mut self, from: Origin<'_>, so_far: &SoFar) -> Strategy {
        let actions = self.judge.bench.spaces().actions;
        let constants = (0..actions).map(|action| {
            let mut whole = so_far.actions.clone();
            whole.push(action);
            Strategy::Plan(whole)
        });
        let mut best = (f64::INFINITY, Strategy::AsTrained);
        for strategy in self.policies.strategies().chain(constants) {
            if self.earlier.has_followed(&strategy) {
                continue;
            }
            self.judge
                .begin(from, so_far, Some(&self.surrogate), VARIATIONS[0]);
            go_on(&mut self.judge, so_far, (&strategy, self.policies));
            let margin = match self.judge.bench.verdict() {
                Some(Verdict::Held { margin }) => margin,
                Some(Verdict::Uncounted { .. } | Verdict::Counterexample { .. }) => 0.0,
                _ => f64::INFINITY,
            };
            if margin < best.0 {
                best = (margin, strategy);
            }
        }
        best.1
    }

    /// How the ego would move.
    fn predict(&mut self, from: Origin<'_>, so_far: &SoFar, strategy: &Strategy) -> Vec<Moment> {
        let samples = self.judge.bench.clock().samples_per_decision();
        let known = match strategy {
            Strategy::Plan(actions) => self.earlier.known(so_far, actions, samples),
            _ => Cow::Borrowed(so_far),
        };
        self.judge
            .begin(from, &known, Some(&self.surrogate), VARIATIONS[0]);
        go_on(&mut self.judge, &known, (strategy, self.policies));
        self.judge.motion()
    }

    /// A better choice than the present one, whose worth is found anew.
    fn rethink(&mut self, from: Origin<'_>, so_far: &SoFar, now: &mut Choice) -> Option<Choice> {
        now.score = self.score(from, so_far, (&now.strategy, now.lead), ENOUGH);
        if now.is_sure() && ENOUGH <= now.score {
            return None;
        }
        let other = self.choose(from, so_far, 1);
        self.in_vain += u32::from(other.score == 0);
        other.is_better_than(now).then_some(other)
    }

    /// Plays a start of the real world, and chooses anew when the ego strays
    /// from what was predicted.
    ///
    /// Every further attempt at a start knows what came of the earlier ones: it
    /// leaves one of them where a plan succeeds from there.
    pub fn run(
        &mut self,
        real: &mut Testbench,
        from: Origin<'_>,
        aftermath: Aftermath,
        earlier: &Earlier,
    ) -> PlannedRun {
        real.begin(from.0, from.1, aftermath);
        let mut so_far = SoFar::default();
        self.reader.follow(real, &mut so_far.motion);
        self.earlier = earlier.clone();
        self.attempt = 0;
        self.in_vain = 0;
        let mut first = match earlier.count() {
            0 => self.choose(from, &so_far, self.care.leads),
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
                // Invariant: a plan holds an action at least.
                (Strategy::Plan(plan), _) => *plan.get(decision).or(plan.last()).unwrap_or(&0),
                // Invariant: nobody chooses a policy that there is not.
                _ => 0,
            };
            real.decide(action);
            so_far.actions.push(action);
            self.reader.follow(real, &mut so_far.motion);
            if real.is_decided() || self.watch.stopped() {
                continue;
            }
            let here = so_far.motion.len() - 1;
            let strays = predicted
                .get(here)
                .is_none_or(|expected| so_far.motion[here].strays_from(expected));
            let late = !now.is_sure() && PATIENCE <= decision + 1 - chosen_at;
            let rests = decision + 1 - chosen_at < self.care.rest(self.in_vain);
            if rests || (!strays && !late) {
                continue;
            }
            chosen_at = decision + 1;
            if let Some(other) = self.rethink(from, &so_far, &mut now) {
                replans += u32::from(now.strategy != other.strategy);
                now = other;
            }
            predicted = self.predict(from, &so_far, &now.strategy);
        }
        PlannedRun {
            first,
            so_far,
            replans,
        }
    }
}
