//! Definition 4: from prioritised rules and ψ_ego to a verdict and a reward.
//!
//! Nothing else in the workspace rewards an ado.
//!
//! The paper prints "ρ_min = −ρ_max > 0" and a penalty of −M ρ_min. Only a
//! penalty makes its Lemma 2 true, so this module follows the readings of
//! `docs/background/paper.md`. "Kept" is strict (ρ > 0), and so is a violated ego
//! specification (ρ(¬ψ) > 0). Lawful rewards stay inside an open interval above
//! every penalty.
//!
//! Architecture Invariant: pure functions of traces, without scene or learner.

mod counts;
mod reward;
mod run_monitor;
mod runs;
mod state_judge;
mod verdict;

pub use counts::Counts;
pub use reward::Reward;
pub use runs::{NewSamples, RunsJudge};
pub use state_judge::{NoState, StateJudge};
pub use verdict::{RulesUntilContact, Verdict};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::Display;

use crate::stl::{Monitor, Scratch};
use crate::trace::Trace;
use run_monitor::RunMonitor;

/// End of an episode, and the part of it that is judged.
#[derive(
    Clone, Copy, Debug, Default, Display, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema,
)]
pub enum JudgeKind {
    /// Judges the prefix up to the first decided sample, where the episode ends.
    #[default]
    #[strum(to_string = "until a violation")]
    UntilViolation,
    /// Judges the whole run to the horizon, with the contact sample held.
    #[strum(to_string = "over the whole run")]
    WholeRun,
    /// Judges everything up to a contact or the horizon.
    ///
    /// A rule that no further sample can satisfy ends the episode earlier.
    #[strum(to_string = "until a contact")]
    UntilContact,
}

/// One rule of an ado, bound to the scene's signals.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Name in the world file.
    pub name: String,
    /// Name of the ado that must keep the rule.
    pub ado: String,
    /// Rank, 0 for the most important. Equal ranks count together in M.
    pub priority: usize,
    /// The formula, kept when its robustness is above 0.
    pub monitor: Monitor,
}

/// ψ_ego, the ordered rules of all ados, and the way they are judged.
#[derive(Clone, Debug)]
pub struct Rulebook {
    /// ψ_ego.
    pub spec: Monitor,
    /// The rules, most important first.
    pub rules: Vec<Rule>,
    /// Part of the run that is judged.
    pub judge: JudgeKind,
    /// Violations of ψ_ego that count as counterexamples.
    pub counts: Counts,
    /// Map from the verdict to a number.
    pub reward: Reward,
}

impl Rulebook {
    /// Returns M of Definition 4 for `rule`.
    ///
    /// M counts the rules whose priority is no higher than that of `rule`,
    /// and includes `rule`.
    pub fn forfeited(&self, rule: usize) -> usize {
        let priority = self.rules[rule].priority;
        self.rules.iter().filter(|r| priority <= r.priority).count()
    }

    /// Returns the reward of a verdict, `None` for an invalid episode.
    pub fn reward_of(&self, verdict: &Verdict) -> Option<f64> {
        self.reward.of(verdict, self.rules.len())
    }

    /// Returns the reward of one ado for a verdict, `None` for an invalid episode.
    ///
    /// It is Definition 4 with ψ_ego and the ado's own rules. `broken` are the rules that
    /// the run broke. An ado without a rule among them has the reward of a run that barely
    /// held, since the violation of another ado proves nothing about the ego.
    pub fn reward_of_ado(&self, ado: &str, verdict: &Verdict, broken: &[usize]) -> Option<f64> {
        if !verdict.is_foul() {
            return self.reward_of(verdict);
        }
        let of_ado = |rule: &&Rule| rule.ado == ado;
        let own = broken.iter().map(|&i| &self.rules[i]).filter(of_ado);
        // By priority and not by position, since equal ranks count together.
        let Some(priority) = own.map(|rule| rule.priority).min() else {
            return Some(self.reward.lawful(0.0));
        };
        // Only the ado's own rules count, so that it pays for no other ado.
        let rules = self.rules.iter().filter(of_ado);
        let forfeited = rules.clone().filter(|rule| priority <= rule.priority);
        Some(self.reward.foul(forfeited.count(), rules.count()))
    }

    /// Judges a finished trace as a whole, as the paper does.
    pub fn judge_whole(&self, trace: &Trace, scratch: &mut Scratch) -> Verdict {
        match self.first_broken(trace, scratch) {
            Some(rule) => self.foul(rule),
            None => lawful(self.spec.robustness(trace, scratch)),
        }
    }

    /// Returns the most important rule that `trace` does not strictly keep.
    fn first_broken(&self, trace: &Trace, scratch: &mut Scratch) -> Option<usize> {
        (0..self.rules.len())
            .filter(|&i| self.rules[i].monitor.robustness(trace, scratch) <= 0.0)
            .min_by_key(|&i| self.rules[i].priority)
    }

    /// Returns the verdict of [`JudgeKind::UntilViolation`] after a sample, if it is final.
    ///
    /// `broken` is a rule that no further sample can satisfy. `spec_lost` is true from the
    /// sample on at which no further sample can satisfy ψ_ego. `ended` gives the robustness
    /// of a rule, or of ψ_ego for `None`, in a run that ends here.
    fn until_violation(
        &self,
        broken: Option<usize>,
        spec_lost: bool,
        mut ended: impl FnMut(Option<usize>) -> f64,
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        // Before the success check: a rule lost on the same sample outweighs it.
        if let Some(rule) = broken {
            return Some(self.foul(rule));
        }
        // `spec_lost` persists, because the rules may be kept on the prefix only at a
        // later sample.
        if spec_lost && self.first_not_kept(&mut ended).is_none() {
            let by = -ended(None);
            // Strict, as in `lawful`: a robustness of 0 is no success.
            if by > 0.0 {
                return Some(Verdict::Counterexample { by });
            }
        }
        match stop? {
            Stop::Horizon => Some(match self.first_not_kept(&mut ended) {
                Some(rule) => self.foul(rule),
                None => lawful(ended(None)),
            }),
            // A contact came before a verdict: the ado has proven nothing. A rule that
            // further samples could have satisfied is not broken either.
            Stop::Contact => Some(Verdict::Held {
                margin: ended(None).max(0.0),
            }),
        }
    }

    /// Returns the most important rule that is not strictly kept if the run ends here.
    fn first_not_kept(&self, ended: &mut impl FnMut(Option<usize>) -> f64) -> Option<usize> {
        (0..self.rules.len())
            .filter(|&i| ended(Some(i)) <= 0.0)
            .min_by_key(|&i| self.rules[i].priority)
    }

    /// Returns the more important of a lost rule and rule `i`, which is lost as well.
    fn more_important(&self, broken: Option<usize>, i: usize) -> Option<usize> {
        // Strict, so that the first of equal ranks stays, as `min_by_key` has
        // it.
        let outranks = |b: usize| self.rules[i].priority < self.rules[b].priority;
        if broken.is_none_or(outranks) {
            Some(i)
        } else {
            broken
        }
    }

    fn foul(&self, rule: usize) -> Verdict {
        Verdict::Foul {
            rule,
            forfeited: self.forfeited(rule),
        }
    }
}

fn lawful(rho_spec: f64) -> Verdict {
    // Strict: ρ(ψ) = 0 counts as held, so a run exactly on the bound is no success.
    if rho_spec < 0.0 {
        Verdict::Counterexample { by: -rho_spec }
    } else {
        Verdict::Held { margin: rho_spec }
    }
}

/// Reason for the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The last sample of the horizon has been pushed.
    Horizon,
    /// Two agents touched, which ends the motion.
    Contact,
}

/// Online judge of one run at a time.
///
/// Push every sample. [`Judge::push`] returns the verdict as soon as no further
/// sample can change it ([`JudgeKind::UntilViolation`]) or when the run stops.
#[derive(Clone)]
pub struct Judge {
    spec: RunMonitor,
    rules: Vec<RunMonitor>,
    /// Rules that no further sample can satisfy.
    lost: Vec<bool>,
    spec_lost: bool,
    scratch: Scratch,
}

impl Judge {
    /// Creates a judge for runs of at most `samples` samples.
    pub fn new(rulebook: &Rulebook, samples: usize) -> Judge {
        Judge {
            spec: RunMonitor::new(&rulebook.spec, samples),
            rules: rulebook
                .rules
                .iter()
                .map(|rule| RunMonitor::new(&rule.monitor, samples))
                .collect(),
            lost: vec![false; rulebook.rules.len()],
            spec_lost: false,
            scratch: Scratch::default(),
        }
    }

    /// Starts a new run and keeps the allocated memory.
    pub fn reset(&mut self) {
        self.spec.reset();
        self.rules.iter_mut().for_each(RunMonitor::reset);
        self.lost.fill(false);
        self.spec_lost = false;
    }

    /// Reads the newest sample `row`, which is the last row of `trace`.
    ///
    /// With `stop` set no further sample follows, and the result is always `Some`.
    /// When the judge reads sample by sample, a row that is not a sample (a NaN, a
    /// wrong length) makes the episode invalid.
    pub fn push(
        &mut self,
        rulebook: &Rulebook,
        trace: &Trace,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        // A row that is not a sample was never driven, so it cannot prove a success.
        let reads = rulebook.judge != JudgeKind::WholeRun;
        if reads && trace.schema().check_row(row, trace.len()).is_err() {
            return Some(Verdict::Invalid);
        }
        self.push_checked(rulebook, trace, row, stop)
    }

    /// Reads the newest sample like [`Judge::push`]: a row that the trace accepted.
    pub(crate) fn push_checked(
        &mut self,
        rulebook: &Rulebook,
        trace: &Trace,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        match rulebook.judge {
            JudgeKind::UntilViolation => self.until_violation(rulebook, trace, row, stop),
            JudgeKind::WholeRun => stop.map(|_| rulebook.judge_whole(trace, &mut self.scratch)),
            JudgeKind::UntilContact => match self.broken_at(rulebook, row) {
                Some(rule) => Some(rulebook.foul(rule)),
                // The played part is judged as it is: a rule that is not strictly kept on
                // it is broken, whatever ended the run.
                None => stop.map(|_| rulebook.judge_whole(trace, &mut self.scratch)),
            },
        }
    }

    /// Reads a sample after a success and returns a rule that is lost by then.
    ///
    /// The row is one that the trace accepted. The verdict does not change. Under the
    /// other judges an episode has no sample after its verdict, and the result is `None`.
    pub fn push_after(&mut self, rulebook: &Rulebook, row: &[f64]) -> Option<usize> {
        match rulebook.judge {
            JudgeKind::UntilViolation => self.broken_at(rulebook, row),
            JudgeKind::WholeRun | JudgeKind::UntilContact => None,
        }
    }

    /// Returns all rules that a judged run broke, in the order of the rulebook.
    ///
    /// They are those that no further sample could satisfy, or else, in a run that ended,
    /// those that are not strictly kept.
    pub fn broken(&mut self, rulebook: &Rulebook, judged: &Trace) -> Vec<usize> {
        let flags = self.lost.iter().enumerate();
        let lost: Vec<usize> = flags.filter_map(|(i, lost)| lost.then_some(i)).collect();
        if !lost.is_empty() {
            return lost;
        }
        let rules = rulebook.rules.iter().enumerate();
        let broken = rules.filter(|(_, rule)| {
            let robustness = rule.monitor.robustness(judged, &mut self.scratch);
            robustness <= 0.0
        });
        broken.map(|(i, _)| i).collect()
    }

    /// Returns the most important rule that no further sample can satisfy.
    fn broken_at(&mut self, rulebook: &Rulebook, row: &[f64]) -> Option<usize> {
        let mut broken: Option<usize> = None;
        for (i, rule) in self.rules.iter_mut().enumerate() {
            // An upper bound of 0 is enough, since "kept" is strict.
            if rule.push(row).hi <= 0.0 {
                self.lost[i] = true;
                broken = rulebook.more_important(broken, i);
            }
        }
        broken
    }

    fn until_violation(
        &mut self,
        rulebook: &Rulebook,
        trace: &Trace,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        let broken = self.broken_at(rulebook, row);
        // Strict, unlike the rules: ρ(¬ψ) = 0 is not a violation of ψ_ego.
        self.spec_lost |= self.spec.push(row).hi < 0.0;
        let Judge {
            spec,
            rules,
            scratch,
            ..
        } = self;
        let ended = |which: Option<usize>| match which {
            Some(i) => rules[i].ended(&rulebook.rules[i].monitor, trace, scratch),
            None => spec.ended(&rulebook.spec, trace, scratch),
        };
        rulebook.until_violation(broken, self.spec_lost, ended, stop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stl::{Constants, Formula};
    use crate::trace::{Schema, Signal};

    /// A row that is not a sample yields an invalid episode, never a success.
    ///
    /// The trace refuses such rows first. This test covers the judge on its own, for
    /// runs whose specification was lost or kept.
    #[test]
    fn a_row_that_is_no_sample_is_nobodys_success() {
        let signal = Signal::real("x", "m", "where");
        let schema = Schema::new(1.0, [signal]).expect("a schema");
        let bind = |text: &str| {
            let formula: Formula = text.parse().expect("a formula");
            formula.bind(&schema, &Constants::new()).expect("bound")
        };
        let rule = Rule {
            name: "stays".to_owned(),
            ado: "ado".to_owned(),
            priority: 0,
            monitor: bind("always (x < 9)"),
        };
        let book = |rules: Vec<Rule>| Rulebook {
            spec: bind("always[0, 3] (x >= 0)"),
            rules,
            judge: JudgeKind::UntilViolation,
            counts: Counts::Violation,
            reward: Reward::default(),
        };
        for rulebook in [book(vec![rule]), book(Vec::new())] {
            for row in [&[f64::NAN][..], &[f64::INFINITY], &[], &[-5.0, 1.0]] {
                let mut trace = Trace::new(schema.clone().into());
                let mut judge = Judge::new(&rulebook, 4);
                trace.push(&[-5.0]).expect("finite");
                for stop in [None, Some(Stop::Horizon), Some(Stop::Contact)] {
                    judge.reset();
                    let verdict = judge.push(&rulebook, &trace, row, stop);
                    assert_eq!(verdict, Some(Verdict::Invalid), "{row:?}");
                }
                judge.reset();
                let verdict = judge.push(&rulebook, &trace, &[-5.0], None);
                assert_eq!(verdict, Some(Verdict::Counterexample { by: 5.0 }));
            }
        }
    }
}
