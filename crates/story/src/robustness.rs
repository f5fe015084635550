//! Robustness of formulas between two samples.

/// Robustness of a formula over a sample, between whose ends it is linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledRobustness {
    /// Value at the beginning. `None` if the formula was not watched then.
    pub before: Option<RobustnessAt>,
    /// Value at the end.
    pub now: RobustnessAt,
}

/// Robustness of a formula at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustnessAt {
    /// Instant.
    pub at_s: f64,
    /// Robustness, at least 0 if the formula holds.
    pub rho: f64,
}

impl SampledRobustness {
    /// Returns whether the formula holds at an instant of the sample.
    pub fn holds(&self, at_s: f64) -> bool {
        match (self.before, self.change_s()) {
            // At the change itself the new value counts, as in all
            // right-continuous views.
            (Some(before), Some(change_s)) if at_s < change_s => before.holds(),
            _ => self.now.holds(),
        }
    }

    /// Returns the instant at which the formula comes true or false, if it does so.
    pub fn change_s(&self) -> Option<f64> {
        let now = self.now;
        let before = self.before.filter(|it| it.holds() != now.holds())?;
        // An infinite robustness has no zero on its line, so the change is at
        // the sample.
        if !before.rho.is_finite() || !now.rho.is_finite() {
            return Some(now.at_s);
        }
        // The line through both values is 0 at this share.
        // One value is below 0 and the other is not, so they differ.
        let share = -before.rho / (now.rho - before.rho);
        Some(before.at_s + (now.at_s - before.at_s) * share)
    }
}

impl RobustnessAt {
    /// Returns whether the formula holds.
    pub fn holds(&self) -> bool {
        self.rho >= 0.0
    }
}
