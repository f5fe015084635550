//! Backup of the probability of a failure under a law of actions, on a logarithmic scale.
//!
//! V(s, a) is the probability of a success after the action a, if all later actions follow
//! the law p. It satisfies V(s, a) = Σ p(a' | s') V(s', a'), and the law of actions given
//! a success is p(a | s) V(s, a) / Σ p V (Doob 1957). This is reinforcement learning with
//! a cost for the distance from p: linearly solvable control (Todorov 2009), path
//! consistency (Nachum 2017) and soft Q-learning (Haarnoja 2017).
//!
//! A network estimates v = ln V / F, from −1 for a failure to 0 for a certain success, with
//! the floor F in nats. Squared errors of v are relative errors of V, and an average over
//! similar states is a geometric mean. At an edge behind which no success is left, it keeps
//! the probability of passing the edge small, which an arithmetic mean would not.

use super::traffic_law::log_of;

/// Backup with a floor.
#[derive(Clone, Copy, Debug)]
pub(super) struct SoftBackup {
    /// Floor F of −ln V: a success below e⁻ᶠ per episode is none.
    pub(super) floor: f64,
}

impl SoftBackup {
    /// Returns v of a state from the law's scaled logarithms and v of every action.
    pub(super) fn backup(self, logs: &[f32], values: &[f32]) -> f32 {
        let sum: f64 = self.weights(logs, values, 1.0).sum();
        bounded((libm::log(sum) / self.floor) as f32)
    }

    /// Returns v after an action from v of the state after it: the floor if it is impossible.
    pub(super) fn along(self, log: f32, value: f32) -> f32 {
        log_of(log).map_or(-1.0, |log| bounded((log / self.floor) as f32 + value))
    }

    /// Returns ln V of v.
    pub(super) fn log_value(self, value: f32) -> f64 {
        self.floor * f64::from(bounded(value))
    }

    /// Writes the probabilities of actions: p V at a temperature of 1, and p V^(1 / t) at t.
    ///
    /// Towards 0, it is the possible action of the greatest V. Without a possible action, all
    /// are equally likely.
    pub(super) fn tilted(
        self,
        logs: &[f32],
        values: &[f32],
        temperature: f64,
        into: &mut Vec<f64>,
    ) {
        // Relative to the greatest V, which a small temperature would raise beyond all numbers.
        let pairs = logs.iter().zip(values);
        let possible = pairs.filter(|(log, _)| log_of(**log).is_some());
        let best = possible.map(|(_, v)| bounded(*v)).fold(-1.0, f32::max);
        let relative: Vec<f32> = values.iter().map(|v| bounded(*v) - best).collect();
        into.clear();
        into.extend(self.weights(logs, &relative, temperature));
        let sum: f64 = into.iter().sum();
        let even = 1.0 / into.len() as f64;
        let shared = |it: &mut f64| *it = if sum > 0.0 { *it / sum } else { even };
        into.iter_mut().for_each(shared);
    }

    fn weights(self, logs: &[f32], values: &[f32], temperature: f64) -> impl Iterator<Item = f64> {
        let pairs = logs.iter().zip(values);
        pairs.map(move |(log, value)| {
            let log = log_of(*log);
            log.map_or(0.0, |log| {
                libm::exp(log + self.floor * f64::from(value.min(0.0)) / temperature)
            })
        })
    }
}

/// Returns the action at a share of the probability.
pub(super) fn drawn(probabilities: &[f64], share: f64) -> usize {
    let (mut left, mut last) = (share, 0);
    for (action, p) in probabilities.iter().enumerate() {
        // Rounding must not choose an action of probability 0.
        if *p <= 0.0 {
            continue;
        }
        last = action;
        left -= p;
        if left < 0.0 {
            break;
        }
    }
    last
}

/// Returns the likeliest action, the first of equals.
pub(super) fn likeliest(probabilities: &[f64]) -> usize {
    let greater = |best: usize, at: usize| {
        if probabilities[best] < probabilities[at] {
            at
        } else {
            best
        }
    };
    (1..probabilities.len()).fold(0, greater)
}

fn bounded(value: f32) -> f32 {
    // An undefined value is the floor, which `clamp` alone would keep.
    if value.is_nan() {
        return -1.0;
    }
    value.clamp(-1.0, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const F: SoftBackup = SoftBackup { floor: 30.0 };

    /// Scaled logarithms of probabilities of ½, of a tenth and of an impossible action.
    fn logs() -> [f32; 3] {
        let of = |p: f64| (0.1 * libm::log(p)) as f32;
        [of(0.5), of(0.1), super::super::traffic_law::LEAST_LOG]
    }

    fn v(value: f64) -> f32 {
        (libm::log(value) / F.floor) as f32
    }

    #[test]
    fn a_backup_is_the_mean_under_the_law() {
        let found = F.backup(&logs(), &[v(1e-3), v(1e-2), v(1.0)]);
        let mean = 0.5 * 1e-3 + 0.1 * 1e-2;
        assert!((F.log_value(found) - libm::log(mean)).abs() < 1e-4);
        assert_eq!(F.backup(&logs(), &[-1.0, -5.0, 0.0]), -1.0);
        let after = F.along(logs()[1], v(1e-3));
        assert!((F.log_value(after) - libm::log(1e-4)).abs() < 1e-4);
        assert_eq!(F.along(logs()[2], 0.0), -1.0);
    }

    #[test]
    fn a_tilt_leads_from_the_law_given_a_success_to_the_best_possible_action() {
        let values = [v(1e-3), v(1e-2), v(1.0)];
        let mut found = Vec::new();
        F.tilted(&logs(), &values, 1.0, &mut found);
        assert!(
            (found[0] - 1.0 / 3.0).abs() < 1e-4 && found[2] == 0.0,
            "{found:?}"
        );
        F.tilted(&logs(), &values, 0.01, &mut found);
        assert!(found[1] > 0.999 && likeliest(&found) == 1, "{found:?}");
        F.tilted(&logs(), &values, 1e9, &mut found);
        assert!((found[0] - 5.0 / 6.0).abs() < 1e-4, "{found:?}");
        F.tilted(&[logs()[2]; 2], &[0.0; 2], 1.0, &mut found);
        assert_eq!(found, [0.5, 0.5]);
    }

    #[test]
    fn draws_follow_their_shares_and_take_no_impossible_action() {
        let law = [0.25, 0.0, 0.5, 0.25, 0.0];
        for (share, action) in [(0.0, 0), (0.24, 0), (0.26, 2), (0.76, 3), (1.0, 3)] {
            assert_eq!(drawn(&law, share), action, "{share}");
        }
        assert_eq!(drawn(&[0.0, 1.0], 0.0), 1);
        assert_eq!(likeliest(&[0.2, 0.4, 0.4]), 1);
    }
}
