//! Law of the ados' joint action in declared traffic, read from an observation.
//!
//! A law is a product of [`LawFactor`]s: one per ado, or two for an ado that accelerates
//! and moves sideways by laws of their own. A factor gives the next action by the last
//! ones, interrupted by onsets whose rates are observed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::learner::ConfigError;

/// Scale of the logarithms of probabilities among the features, so that they are about 1.
const LOG_SCALE: f64 = 0.1;
/// Least scaled logarithm, of probabilities below e⁻⁴⁰. Such an action counts as impossible.
pub(super) const LEAST_LOG: f32 = -4.0;

/// Law of the ados' joint action.
///
/// The empty law, which is the default, makes all actions equally likely.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TrafficLaw {
    /// Time between decisions, in seconds.
    pub decision_s: f64,
    /// Factors of the joint law. The first is the lowest digit of a joint action.
    pub factors: Vec<LawFactor>,
}

/// Law of an ado's action, or of one of its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LawFactor {
    /// Number of actions.
    pub actions: usize,
    /// Place value of its digit in the ado's action.
    pub unit: usize,
    /// Position of the ado's last action in the observation.
    pub last: usize,
    /// Position of the action before it, if the law depends on both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<usize>,
    /// Probabilities of the next action, a row per last action.
    ///
    /// With `before`, row b · `actions` + l is for the action b and then l.
    pub transitions: Vec<Vec<f64>>,
    /// Events that interrupt the transitions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub onsets: Vec<LawOnset>,
}

/// Event that begins another action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LawOnset {
    /// Position of its rate per second in the observation.
    pub rate: usize,
    /// Probabilities of the action that it begins.
    pub to: Vec<f64>,
}

impl TrafficLaw {
    /// Returns the number of joint actions, 1 for the empty law.
    pub fn actions(&self) -> usize {
        self.factors.iter().map(|factor| factor.actions).product()
    }

    /// Returns the least length of an observation from which the law can be read.
    pub fn observed(&self) -> usize {
        let last = self.factors.iter().flat_map(|factor| {
            let rates = factor.onsets.iter().map(|onset| onset.rate);
            rates.chain([factor.last]).chain(factor.before)
        });
        last.max().map_or(0, |position| position + 1)
    }

    /// Writes the probability of each of `actions` joint actions at an observation.
    pub fn probabilities(&self, obs: &[f32], actions: usize, into: &mut Vec<f64>) {
        into.clear();
        if self.factors.is_empty() {
            into.resize(actions, 1.0 / actions.max(1) as f64);
            return;
        }
        into.push(1.0);
        for factor in &self.factors {
            let own = factor.probabilities(obs, self.decision_s);
            let lower = std::mem::take(into);
            // The first factor is the lowest digit, so it varies fastest.
            into.extend(own.iter().flat_map(|p| lower.iter().map(move |it| it * p)));
        }
    }

    /// Returns the number of values that [`TrafficLaw::features`] adds for the memory.
    pub(super) fn memory(&self) -> usize {
        let each = self.factors.iter();
        each.map(|it| it.actions * if it.before.is_some() { 2 } else { 1 })
            .sum()
    }

    /// Writes an observation, one-hot codes of the last actions and the logarithms of the law.
    ///
    /// The logarithms come last, one per joint action, as [`scaled_log`] writes them. They are
    /// of the law raised to the power `prior`.
    pub(super) fn features(&self, obs: &[f32], actions: usize, prior: f64, into: &mut Vec<f32>) {
        into.clear();
        into.extend_from_slice(obs);
        for factor in &self.factors {
            for position in factor.before.into_iter().chain([factor.last]) {
                let digit = factor.digit(obs, position);
                into.extend((0..factor.actions).map(|it| f32::from(u8::from(it == digit))));
            }
        }
        let mut law = Vec::new();
        self.probabilities(obs, actions, &mut law);
        weaken(&mut law, prior);
        into.extend(law.iter().map(|p| scaled_log(*p)));
    }

    /// Refuses a law whose numbers do not fit each other.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let fail = |why: String| {
            Err(ConfigError {
                field: "law",
                why,
                help: "train with `--traffic FILE.ron`, which writes the law".to_owned(),
            })
        };
        for (at, factor) in self.factors.iter().enumerate() {
            let n = factor.actions;
            let rows = if factor.before.is_some() { n * n } else { n };
            let tables = factor.onsets.iter().map(|onset| &onset.to);
            let all = factor.transitions.iter().chain(tables);
            let is_row = |row: &Vec<f64>| {
                let sum: f64 = row.iter().sum();
                let inside = row.iter().all(|p| (0.0..=1.0).contains(p));
                row.len() == n && inside && (sum - 1.0).abs() < 1e-6
            };
            if n == 0 || factor.unit == 0 || factor.transitions.len() != rows {
                return fail(format!("has no row per last action in factor {at}"));
            }
            if !all.clone().all(is_row) {
                return fail(format!("has a row in factor {at} that is no distribution"));
            }
        }
        let is_time = self.decision_s > 0.0;
        if !self.factors.is_empty() && !is_time {
            return fail(format!("has decisions of {} s", self.decision_s));
        }
        Ok(())
    }
}

impl LawFactor {
    /// Returns its digit of the action at a position of the observation.
    fn digit(&self, obs: &[f32], position: usize) -> usize {
        // The cast saturates, because an observation may have any number.
        let action = libm::roundf(obs[position]).max(0.0) as usize;
        action / self.unit % self.actions
    }

    fn probabilities(&self, obs: &[f32], decision_s: f64) -> Vec<f64> {
        let last = self.digit(obs, self.last);
        let row = match self.before {
            Some(before) => self.digit(obs, before) * self.actions + last,
            None => last,
        };
        let rate = |onset: &LawOnset| f64::from(obs[onset.rate]);
        let rates: Vec<f64> = self.onsets.iter().map(rate).collect();
        let onsets = self.onsets.iter().map(|onset| &onset.to[..]);
        interrupted(&self.transitions[row], &rates, onsets, decision_s)
    }
}

/// Returns the next action's law: `transitions`, interrupted by onsets with rates per second.
///
/// An undefined rate or one below 0 is 0. Rates are constant during a decision, so the wait
/// for an event is exponential.
pub fn interrupted<'a>(
    transitions: &[f64],
    rates_per_s: &[f64],
    onsets: impl Iterator<Item = &'a [f64]>,
    decision_s: f64,
) -> Vec<f64> {
    let mut next = transitions.to_vec();
    // `max` turns an undefined rate into 0, which `clamp` would keep.
    let bounded = |rate: &f64| f64::min(rate.max(0.0), 1e9);
    let all: f64 = rates_per_s.iter().map(bounded).sum();
    if all <= 0.0 {
        return next;
    }
    let none = libm::exp(-all * decision_s);
    next.iter_mut().for_each(|it| *it *= none);
    for (onset, rate) in onsets.zip(rates_per_s) {
        // `expm1` keeps the digits of small probabilities.
        let share = -libm::expm1(-all * decision_s) * bounded(rate) / all;
        let to = next.iter_mut().zip(onset);
        to.for_each(|(it, weight)| *it += share * weight);
    }
    next
}

/// Raises a law to a power and makes it a law again. Impossible actions stay impossible.
fn weaken(law: &mut [f64], prior: f64) {
    // The bits of an unchanged law stay as they are.
    if prior == 1.0 {
        return;
    }
    let power = |p: f64| {
        if log_of(scaled_log(p)).is_some() {
            libm::pow(p, prior)
        } else {
            0.0
        }
    };
    law.iter_mut().for_each(|p| *p = power(*p));
    let sum: f64 = law.iter().sum();
    if sum > 0.0 {
        law.iter_mut().for_each(|p| *p /= sum);
    }
}

/// Returns the scaled logarithm of a probability, at least `LEAST_LOG`.
fn scaled_log(p: f64) -> f32 {
    ((LOG_SCALE * libm::log(p)) as f32).max(LEAST_LOG)
}

/// Returns the logarithm of a probability from its scaled one. `None`: it is impossible.
pub(super) fn log_of(scaled: f32) -> Option<f64> {
    (scaled > LEAST_LOG).then_some(f64::from(scaled) / LOG_SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two actions, of which the second follows the first with 0.25, and an onset to it.
    fn factor(last: usize) -> LawFactor {
        LawFactor {
            actions: 2,
            unit: 1,
            last,
            before: None,
            transitions: vec![vec![0.75, 0.25], vec![0.5, 0.5]],
            onsets: vec![LawOnset {
                rate: last + 1,
                to: vec![0.0, 1.0],
            }],
        }
    }

    fn law(factors: Vec<LawFactor>) -> TrafficLaw {
        TrafficLaw {
            decision_s: 0.5,
            factors,
        }
    }

    fn read(law: &TrafficLaw, obs: &[f32]) -> Vec<f64> {
        let mut found = Vec::new();
        law.probabilities(obs, law.actions(), &mut found);
        found
    }

    #[test]
    fn a_law_is_read_from_the_last_action_and_the_rates() {
        let one = law(vec![factor(0)]);
        assert_eq!(read(&one, &[0.0, 0.0]), [0.75, 0.25]);
        assert_eq!(read(&one, &[1.0, -3.0]), [0.5, 0.5]);
        assert_eq!(read(&one, &[0.0, f32::NAN]), [0.75, 0.25]);
        let none = libm::exp(-1.0);
        let found = read(&one, &[0.0, 2.0]);
        assert!((found[0] - 0.75 * none).abs() < 1e-12, "{found:?}");
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // Observations far outside are read as some action.
        assert_eq!(read(&one, &[1e30, 0.0]).len(), 2);
    }

    #[test]
    fn a_joint_law_is_a_product_with_the_first_factor_as_the_lowest_digit() {
        let two = law(vec![factor(0), factor(2)]);
        assert_eq!((two.actions(), two.observed()), (4, 4));
        let found = read(&two, &[0.0, 0.0, 1.0, 0.0]);
        assert_eq!(found, [0.375, 0.125, 0.375, 0.125]);
        let mut uniform = Vec::new();
        TrafficLaw::default().probabilities(&[], 4, &mut uniform);
        assert_eq!(uniform, [0.25; 4]);
    }

    #[test]
    fn features_end_with_the_logarithms_of_the_law() {
        let mut own = factor(0);
        own.before = Some(0);
        own.transitions = [vec![vec![1.0, 0.0]; 2], vec![vec![0.5, 0.5]; 2]].concat();
        let (law, mut into) = (law(vec![own]), Vec::new());
        law.features(&[0.0, 0.0], 2, 1.0, &mut into);
        assert_eq!(into, [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, LEAST_LOG]);
        assert_eq!(into.len(), 2 + law.memory() + law.actions());
        assert_eq!([log_of(into[6]), log_of(into[7])], [Some(0.0), None]);
        let small = log_of(scaled_log(1e-9)).expect("possible");
        assert!((small - libm::log(1e-9)).abs() < 1e-4, "{small}");
    }

    #[test]
    fn a_weakened_law_leads_to_equal_shares_of_the_possible_actions() {
        let law = |prior: f64| {
            let mut law = [0.9, 0.1, 0.0, 1e-20];
            weaken(&mut law, prior);
            law
        };
        // The unchanged law has the same bits.
        assert_eq!(law(1.0), [0.9, 0.1, 0.0, 1e-20]);
        let half = law(0.5);
        let ratio = half[0] / half[1];
        assert!((ratio - 3.0).abs() < 1e-9 && half[2] == 0.0, "{half:?}");
        assert!((half.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // An action below e⁻⁴⁰ is as impossible as without a power.
        assert_eq!(law(0.0), [0.5, 0.5, 0.0, 0.0]);
        let mut none = [0.0; 2];
        weaken(&mut none, 0.0);
        assert_eq!(none, [0.0; 2]);
    }

    #[test]
    fn a_law_that_is_no_distribution_is_refused() {
        let sound = law(vec![factor(0)]);
        assert!(sound.check().is_ok() && TrafficLaw::default().check().is_ok());
        let broken = |change: fn(&mut TrafficLaw)| {
            let mut law = sound.clone();
            change(&mut law);
            law.check().is_err()
        };
        assert!(broken(|law| law.decision_s = f64::NAN));
        assert!(broken(|law| law.factors[0].unit = 0));
        assert!(broken(|law| law.factors[0].before = Some(1)));
        assert!(broken(|law| law.factors[0].transitions[1] = vec![0.5]));
        assert!(broken(|law| law.factors[0].transitions[1] = vec![0.9, 0.2]));
        assert!(broken(|law| law.factors[0].onsets[0].to = vec![-1.0, 2.0]));
    }
}
