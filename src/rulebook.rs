//! Definition 4: prioritised rules and the ego's specification give a verdict,
//! and the verdict gives the reward. Nothing else rewards an ado.
//!
//! The paper prints "ρ_min = −ρ_max > 0" and a penalty of −M ρ_min; only a
//! penalty makes its Lemma 2 true, so the readings here are those of
//! `docs/paper.md`: "kept" is strict (ρ > 0), a violated ego specification is
//! strict too (ρ(¬ψ) > 0), and lawful rewards stay inside an open interval
//! above every penalty.
//!
//! Architecture Invariant: pure functions of traces; no scene, no learner.

mod counts;
mod goal;
mod reward;
mod verdict;

pub use counts::Counts;
pub use goal::TrainingGoal;
pub use reward::Reward;
pub use verdict::{RulesUntilContact, Verdict};

use serde::{Deserialize, Serialize};

use crate::stl::{Monitor, OnlineMonitor, Scratch};
use crate::trace::{RowError, Trace};

/// When an episode ends and what is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum JudgeKind {
    /// The prefix up to the first decided sample is judged, and play ends there.
    #[default]
    UntilViolation,
    /// The whole run to the horizon is judged; the contact sample is held.
    WholeRun,
    /// Play ends at a contact or the horizon, and all of it is judged then; a
    /// rule that no further sample can save ends it before.
    UntilContact,
}

/// One rule of an ado, bound to the scene's signals.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Name in the world file.
    pub name: String,
    /// Name of the ado that must keep it.
    pub ado: String,
    /// 0 is the most important; equal numbers count together in M.
    pub priority: usize,
    /// The formula, kept when its robustness is above 0.
    pub monitor: Monitor,
}

/// ψ_ego, the rules of all ados in one order, and how they are judged.
#[derive(Clone, Debug)]
pub struct Rulebook {
    /// ψ_ego.
    pub spec: Monitor,
    /// The rules, most important first.
    pub rules: Vec<Rule>,
    /// Which part of the run is judged.
    pub judge: JudgeKind,
    /// Which violations are counterexamples.
    pub counts: Counts,
    /// From the verdict to a number.
    pub reward: Reward,
}

impl Rulebook {
    /// M of Definition 4: rules with priority no higher than that of `rule`.
    pub fn forfeited(&self, rule: usize) -> usize {
        let priority = self.rules[rule].priority;
        self.rules.iter().filter(|r| priority <= r.priority).count()
    }

    /// The reward of a verdict; an invalid episode has none.
    pub fn reward_of(&self, verdict: &Verdict) -> Option<f64> {
        self.reward.of(verdict, self.rules.len())
    }

    /// Judges a finished trace as it stands, the way the paper reads it.
    pub fn judge_whole(&self, trace: &Trace, scratch: &mut Scratch) -> Verdict {
        match self.first_broken(trace, scratch) {
            Some(rule) => self.foul(rule),
            None => lawful(self.spec.robustness(trace, scratch)),
        }
    }

    /// The most important rule that `trace` does not strictly keep.
    fn first_broken(&self, trace: &Trace, scratch: &mut Scratch) -> Option<usize> {
        (0..self.rules.len())
            .filter(|&i| self.rules[i].monitor.robustness(trace, scratch) <= 0.0)
            .min_by_key(|&i| self.rules[i].priority)
    }

    fn foul(&self, rule: usize) -> Verdict {
        Verdict::Foul {
            rule,
            forfeited: self.forfeited(rule),
        }
    }
}

fn lawful(rho_spec: f64) -> Verdict {
    if rho_spec < 0.0 {
        Verdict::Counterexample { by: -rho_spec }
    } else {
        Verdict::Held { margin: rho_spec }
    }
}

/// Why no further sample will come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The last sample of the horizon has been pushed.
    Horizon,
    /// Two agents touched: the motion ends.
    Contact,
}

/// Judges a run while it happens.
///
/// Push every sample; a verdict is returned as soon as nothing can change it
/// ([`JudgeKind::UntilViolation`]) or when the run stops.
#[derive(Clone)]
pub struct Judge {
    spec: OnlineMonitor,
    rules: Vec<OnlineMonitor>,
    spec_lost: bool,
    scratch: Scratch,
}

impl Judge {
    /// A judge for runs of at most `samples` samples.
    pub fn new(rulebook: &Rulebook, samples: usize) -> Judge {
        Judge {
            spec: rulebook.spec.online_for(samples),
            rules: rulebook
                .rules
                .iter()
                .map(|rule| rule.monitor.online_for(samples))
                .collect(),
            spec_lost: false,
            scratch: Scratch::default(),
        }
    }

    /// Begins a new run and keeps the memory.
    pub fn reset(&mut self) {
        self.spec.reset();
        self.rules.iter_mut().for_each(OnlineMonitor::reset);
        self.spec_lost = false;
    }

    /// Reads the newest sample, `row`, the last one of `trace`.
    ///
    /// `stop` says that no further sample will come; a verdict is certain then.
    /// Judged sample by sample, a row that is none (a NaN, another length)
    /// makes the episode invalid.
    pub fn push(
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
                Err(_) => Some(Verdict::Invalid),
                Ok(Some(rule)) => Some(rulebook.foul(rule)),
                // What was played is read as it stands: a rule that is not
                // strictly kept on it is broken, however the run ended.
                Ok(None) => stop.map(|_| rulebook.judge_whole(trace, &mut self.scratch)),
            },
        }
    }

    /// Reads a sample after a success: the rule that is lost for good by then.
    ///
    /// The verdict stands. Under the other judges nothing comes after it.
    pub fn push_after(&mut self, rulebook: &Rulebook, row: &[f64]) -> Option<usize> {
        match rulebook.judge {
            // A row that is no sample was refused by the trace: none comes here.
            JudgeKind::UntilViolation => self.broken_at(rulebook, row).ok().flatten(),
            JudgeKind::WholeRun | JudgeKind::UntilContact => None,
        }
    }

    /// The most important rule that no further sample can save.
    ///
    /// # Errors
    /// The row is no sample.
    fn broken_at(&mut self, rulebook: &Rulebook, row: &[f64]) -> Result<Option<usize>, RowError> {
        let mut broken: Option<usize> = None;
        for (i, rule) in self.rules.iter_mut().enumerate() {
            let now = rule.push(row)?;
            let lost = now.hi <= 0.0;
            let outranks = |b: usize| rulebook.rules[i].priority < rulebook.rules[b].priority;
            if lost && broken.is_none_or(outranks) {
                broken = Some(i);
            }
        }
        Ok(broken)
    }

    fn until_violation(
        &mut self,
        rulebook: &Rulebook,
        trace: &Trace,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        // What is no sample was never driven, and is nobody's success.
        let Ok(broken) = self.broken_at(rulebook, row) else {
            return Some(Verdict::Invalid);
        };
        let Ok(now) = self.spec.push(row) else {
            return Some(Verdict::Invalid);
        };
        self.spec_lost |= now.hi < 0.0;
        if let Some(rule) = broken {
            return Some(rulebook.foul(rule));
        }
        if self.spec_lost && rulebook.first_broken(trace, &mut self.scratch).is_none() {
            let by = -rulebook.spec.robustness(trace, &mut self.scratch);
            if 0.0 < by {
                return Some(Verdict::Counterexample { by });
            }
        }
        stop.map(|stop| self.at_stop(rulebook, trace, stop))
    }

    fn at_stop(&mut self, rulebook: &Rulebook, trace: &Trace, stop: Stop) -> Verdict {
        if stop == Stop::Horizon {
            // No rule was lost: what has settled has settled on being kept.
            let mut rules = self.rules.iter();
            let settled = rules.all(|rule| rule.interval().is_final());
            return match settled && self.spec.interval().is_final() {
                true => lawful(self.spec.interval().lo),
                false => rulebook.judge_whole(trace, &mut self.scratch),
            };
        }
        // Contact before a verdict: the ado has proven nothing, and a rule that
        // could still have been satisfied is not broken either.
        let margin = rulebook.spec.robustness(trace, &mut self.scratch);
        Verdict::Held {
            margin: margin.max(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stl::{Constants, Formula};
    use crate::trace::{Schema, Signal};

    /// The trace refuses such a row first; should one come by all the same, a
    /// run that had been lost is not a success, nor one that had been kept.
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
