//! Theorem 3 for a pair of runs: τ of the first, ε between both.

use crate::rulebook::{JudgeKind, Rulebook};
use crate::stl::{Monitor, Scratch};
use crate::testbench::Episode;
use crate::trace::Trace;

/// Counterexample with its margins.
#[derive(Clone, Debug)]
pub struct Witness {
    /// τ on the judged samples: min(ρ(¬ψ_ego), min over rules ρ(c)).
    pub tau_at_verdict: f64,
    /// Largest τ of any longer prefix, at most to the end of the motion.
    pub tau: f64,
    /// Number of samples in that prefix.
    pub samples: usize,
    spec: Vec<Vec<f64>>,
    rules: Vec<RuleKept>,
    deepest: Option<Deepest>,
}

/// Margin ρ(c) of a rule, and its secondary signals.
#[derive(Clone, Debug)]
struct RuleKept {
    margin: f64,
    secondary: Vec<Vec<f64>>,
}

/// Sample that determines the robustness of an invariant ψ_ego.
#[derive(Clone, Copy, Debug)]
struct Deepest {
    sample: usize,
    value: f64,
}

/// Distance of another run from a [`Witness`], on the witness's samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Distance {
    /// ε: the largest distance of a secondary signal of ψ_ego or of a rule.
    ///
    /// Infinite if the other run ended earlier and cannot be compared.
    pub epsilon: f64,
    /// Signed increase of ψ_ego's margin at the deepest sample.
    ///
    /// `None` unless ψ_ego is an invariant.
    pub rise: Option<f64>,
    /// Distance of each rule's own secondary signals.
    pub rules: Vec<f64>,
}

impl Witness {
    /// Reads a counterexample. `None`: the episode is not a counterexample.
    ///
    /// After the verdict the violation may deepen while rules lose margin. The prefix with
    /// the largest τ is kept, because the theorem holds for any prefix.
    pub fn of(rulebook: &Rulebook, episode: &Episode, horizon_samples: usize) -> Option<Witness> {
        if !episode.verdict.is_success() {
            return None;
        }
        let mut scratch = Scratch::new();
        // Built sample by sample, because every prefix has a value of its own.
        let mut prefix = Trace::new(episode.trace.schema().clone());
        let mut row = vec![0.0; episode.trace.schema().len()];
        let mut best: Option<(usize, f64)> = None;
        let mut tau_at_verdict = 0.0;
        for sample in 0..episode.trace.len() {
            episode.trace.read_row(sample, &mut row);
            // A row with a NaN ends the usable prefix.
            if prefix.push(&row).is_err() {
                break;
            }
            // Shorter prefixes were not decided yet.
            if prefix.len() < episode.judged {
                continue;
            }
            let tau = slack(rulebook, &prefix, horizon_samples, &mut scratch);
            if prefix.len() == episode.judged {
                tau_at_verdict = tau;
            }
            // Strictly larger, so the shortest of equal prefixes is kept.
            if best.is_none_or(|(_, most)| most < tau) {
                best = Some((prefix.len(), tau));
            }
        }
        let (samples, tau) = best?;
        prefix.truncate(samples);
        let rules = rulebook.rules.iter().map(|rule| RuleKept {
            margin: rule.monitor.robustness(&prefix, &mut scratch),
            secondary: rule.monitor.secondary(&prefix),
        });
        Some(Witness {
            tau_at_verdict,
            tau,
            samples,
            rules: rules.collect(),
            deepest: deepest(&rulebook.spec, &prefix),
            spec: rulebook.spec.secondary(&prefix),
        })
    }

    /// Compares a run of a changed ego from the same start.
    pub fn distance(&self, rulebook: &Rulebook, other: &Episode, horizon: usize) -> Distance {
        let Some(other) = self.comparable(rulebook, other, horizon) else {
            // An incomparable run must not be covered by any margin.
            return Distance {
                epsilon: f64::INFINITY,
                rise: self.deepest.map(|_| f64::INFINITY),
                rules: vec![f64::INFINITY; self.rules.len()],
            };
        };
        let spec = apart(&self.spec, &rulebook.spec.secondary(&other));
        let rules: Vec<f64> = self
            .rules
            .iter()
            .zip(&rulebook.rules)
            .map(|(mine, rule)| apart(&mine.secondary, &rule.monitor.secondary(&other)))
            .collect();
        let rise = self.deepest.and_then(|deepest| {
            // Only the sample that decided the witness matters, since a violation anywhere suffices.
            let values = rulebook.spec.invariant(&other)?;
            Some(difference(values[deepest.sample], deepest.value))
        });
        Distance {
            epsilon: rules.iter().copied().fold(spec, f64::max),
            rise,
            rules,
        }
    }

    /// Returns whether ε < τ, so that the other run is a counterexample by Theorem 3.
    pub fn covers(&self, distance: &Distance) -> bool {
        distance.epsilon < self.tau
    }

    /// Applies the sharper and equally sound test for an invariant ψ_ego.
    ///
    /// Only an increase at the deepest sample matters, and each rule is compared with its
    /// own margin. `None` unless ψ_ego is an invariant.
    pub fn covers_sharply(&self, distance: &Distance) -> Option<bool> {
        let moved = std::iter::once(distance.rise?).chain(distance.rules.iter().copied());
        let margins = self.sharp_margins()?;
        Some(
            margins
                .iter()
                .zip(moved)
                .all(|(spare, moved)| moved < *spare),
        )
    }

    /// Returns the margins of the sharper test: depth, then each rule's margin.
    pub fn sharp_margins(&self) -> Option<Vec<f64>> {
        let depth = -self.deepest?.value;
        let rules = self.rules.iter().map(|rule| rule.margin);
        Some(std::iter::once(depth).chain(rules).collect())
    }

    /// Returns the other run on the witness's samples.
    ///
    /// A run that ended by contact is extended by its last sample, as `WholeRun` does. The
    /// extension must not change any robustness value.
    fn comparable(&self, rulebook: &Rulebook, other: &Episode, horizon: usize) -> Option<Trace> {
        let mut trace = other.trace.clone();
        // A longer run is cut, since both must have equally many samples.
        if self.samples <= trace.len() {
            trace.truncate(self.samples);
            return Some(trace);
        }
        // Without contact the motion would have continued, so it cannot be held.
        other.contact.as_ref()?;
        let mut row = vec![0.0; trace.schema().len()];
        trace.read_row(trace.len().checked_sub(1)?, &mut row);
        while trace.len() < self.samples {
            trace.push(&row).ok()?;
        }
        let mut scratch = Scratch::new();
        // The extension must leave every margin as it is, or it would invent evidence.
        let mut values = |trace: &Trace, horizon: usize| -> Vec<f64> {
            let rules: Vec<f64> = rulebook
                .rules
                .iter()
                .map(|rule| rule.monitor.robustness(trace, &mut scratch))
                .collect();
            let spec = lost_by(&rulebook.spec, trace, horizon, &mut scratch);
            rules.into_iter().chain([spec]).collect()
        };
        // The run ended by contact and not at the horizon, so no bound is open.
        (values(&trace, horizon) == values(&other.trace, usize::MAX)).then_some(trace)
    }
}

/// Returns τ of a prefix, at most 0 if it is not a counterexample.
fn slack(rulebook: &Rulebook, prefix: &Trace, horizon: usize, scratch: &mut Scratch) -> f64 {
    if rulebook.judge == JudgeKind::WholeRun && prefix.len() < horizon {
        // `WholeRun` judges complete runs only, so a shorter prefix is no counterexample.
        return f64::NEG_INFINITY;
    }
    let violated = -lost_by(&rulebook.spec, prefix, horizon, scratch);
    let rules = rulebook.rules.iter();
    // A counterexample needs both the violation and every rule, so the smallest margin counts.
    rules.fold(violated, |tau, rule| {
        tau.min(rule.monitor.robustness(prefix, scratch))
    })
}

/// Returns the largest ρ(ψ) that is still possible. At the horizon it is ρ(ψ).
///
/// The judge reports a violation only when no later sample can repair it.
fn lost_by(spec: &Monitor, prefix: &Trace, horizon: usize, scratch: &mut Scratch) -> f64 {
    let rho = spec.robustness(prefix, scratch);
    if horizon <= prefix.len() {
        rho
    } else {
        // The upper bound covers all continuations of the prefix.
        rho.max(spec.interval(prefix, scratch).hi)
    }
}

fn deepest(spec: &Monitor, prefix: &Trace) -> Option<Deepest> {
    let values = spec.invariant(prefix)?;
    let all = values.into_iter().enumerate();
    let least = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Deepest {
        sample: least.0,
        value: least.1,
    })
}

/// Returns the sup-norm distance of two families of signals over the same samples.
fn apart(ours: &[Vec<f64>], others: &[Vec<f64>]) -> f64 {
    // Both families come from one rulebook and equally many samples, so none
    // is cut by the pairs.
    let pairs = ours.iter().flatten().zip(others.iter().flatten());
    let each = pairs.map(|(a, b)| difference(*a, *b).abs());
    each.fold(0.0, f64::max)
}

/// Subtracts values, where equal infinities of Boolean signals are at distance 0.
fn difference(a: f64, b: f64) -> f64 {
    // ∞ − ∞ would be NaN.
    if a == b { 0.0 } else { a - b }
}
