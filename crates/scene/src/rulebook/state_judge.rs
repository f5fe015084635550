//! Judge whose whole state of a run is a list of numbers.

use super::{JudgeKind, Rulebook, Stop, Verdict, lawful};
use crate::stl::RunningMonitor;

/// Judge of runs that keeps no run itself: the caller keeps the numbers of each.
///
/// The verdicts are those of [`super::Judge`], bit for bit. Runs with equal numbers have
/// equal verdicts from then on, so they are one state of a product with the rules.
#[derive(Clone, Debug)]
pub struct StateJudge {
    /// The rules' monitors in the order of the rulebook, and then that of ψ_ego.
    monitors: Vec<RunningMonitor>,
    samples: usize,
    /// Whether the numbers of a run keep the whole robustness of ψ_ego.
    is_exact: bool,
}

/// Formula that needs more than a list of numbers per run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoState {
    /// ψ_ego.
    Spec,
    /// Rule of this name.
    Rule(String),
}

impl StateJudge {
    /// Creates a judge for runs of at most `samples` samples.
    ///
    /// Unless `is_exact`, only the sign of an `always` ψ_ego is kept, which merges many
    /// states. Kinds of verdicts and broken rules are the same then, and margins are not.
    ///
    /// # Errors
    /// Returns the first formula that running numbers do not decide.
    pub fn new(rulebook: &Rulebook, samples: usize, is_exact: bool) -> Result<StateJudge, NoState> {
        let rules = rulebook.rules.iter().map(|rule| {
            let monitor = rule.monitor.running(samples);
            monitor.ok_or_else(|| NoState::Rule(rule.name.clone()))
        });
        let spec = rulebook.spec.running(samples).ok_or(NoState::Spec);
        Ok(StateJudge {
            monitors: rules.chain([spec]).collect::<Result<_, _>>()?,
            samples,
            is_exact,
        })
    }

    /// Returns the numbers of a run without samples.
    pub fn begin(&self) -> Vec<f64> {
        let mut state = Vec::new();
        for monitor in &self.monitors {
            let first = state.len();
            state.resize(first + monitor.numbers(), 0.0);
            monitor.begin(&mut state[first..]);
        }
        // The last number is 1 as soon as no further sample can satisfy ψ_ego.
        state.push(0.0);
        state
    }

    /// Reads sample `sample`, counted from 0, and returns the verdict once it is final.
    ///
    /// With `stop` set no further sample follows, and the result is always `Some`.
    pub fn push(
        &self,
        rulebook: &Rulebook,
        state: &mut [f64],
        sample: usize,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        let last = match (rulebook.judge, stop) {
            // Bodies stop each other, so the sample of a contact is held until T.
            (JudgeKind::WholeRun, Some(Stop::Contact)) => self.samples - 1,
            _ => sample,
        };
        let rules = rulebook.rules.len();
        let mut broken = None;
        let mut spec_lost = false;
        self.each(state, |i, monitor, numbers| {
            let mut hi = f64::INFINITY;
            for sample in sample..=last {
                hi = monitor.push(numbers, sample, row).hi;
            }
            if i == rules {
                // Strict, unlike the rules.
                spec_lost = hi < 0.0;
            } else if hi <= 0.0 {
                broken = rulebook.more_important(broken, i);
            }
        });
        if let Some(lost) = state.last_mut() {
            spec_lost |= *lost > 0.0;
            *lost = f64::from(u8::from(spec_lost));
        }
        let ended = |which: Option<usize>| self.ended(state, which.unwrap_or(rules), last + 1);
        let verdict = match rulebook.judge {
            JudgeKind::UntilViolation => rulebook.until_violation(broken, spec_lost, ended, stop),
            JudgeKind::UntilContact if broken.is_some() => broken.map(|rule| rulebook.foul(rule)),
            JudgeKind::UntilContact | JudgeKind::WholeRun => stop.map(|_| whole(rulebook, ended)),
        };
        // After the verdict, which needs the true margins.
        self.merge(state);
        verdict
    }

    /// Replaces numbers whose difference can change no verdict by one of them.
    fn merge(&self, state: &mut [f64]) {
        let spec = self.monitors.len() - 1;
        let is_exact = self.is_exact;
        self.each(state, |i, monitor, numbers| {
            monitor.normalize(numbers);
            let Some(least) = monitor.least() else {
                return;
            };
            // A rule is kept or broken, whatever its margin.
            let is_lost = match (i == spec, is_exact) {
                (true, true) => return,
                (true, false) => numbers[least] < 0.0,
                (false, _) => numbers[least] <= 0.0,
            };
            numbers[least] = if is_lost {
                f64::NEG_INFINITY
            } else {
                f64::INFINITY
            };
        });
    }

    /// Returns the robustness of a formula in a run that ends after `known` samples.
    fn ended(&self, state: &[f64], which: usize, known: usize) -> f64 {
        let before = self.monitors[..which].iter();
        let first: usize = before.map(RunningMonitor::numbers).sum();
        let monitor = &self.monitors[which];
        monitor.ended(&state[first..][..monitor.numbers()], known)
    }

    /// Calls a function with the position, the monitor and the numbers of each formula.
    fn each(&self, state: &mut [f64], mut act: impl FnMut(usize, &RunningMonitor, &mut [f64])) {
        let mut rest = state;
        for (i, monitor) in self.monitors.iter().enumerate() {
            let (numbers, others) = rest.split_at_mut(monitor.numbers());
            act(i, monitor, numbers);
            rest = others;
        }
    }
}

/// Judges a finished run as a whole.
fn whole(rulebook: &Rulebook, mut ended: impl FnMut(Option<usize>) -> f64) -> Verdict {
    match rulebook.first_not_kept(&mut ended) {
        Some(rule) => rulebook.foul(rule),
        None => lawful(ended(None)),
    }
}
