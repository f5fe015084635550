//! Laws of lateral places to another agent, and their motion step by step.

/// Lateral place to another agent, and the limits of the motion to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BesideLaw {
    pub of: usize,
    /// Distance between the reference points, to the left of the other.
    pub by_m: f64,
    /// Distance from the reference point of the other to its front.
    pub front_m: f64,
    /// Whether the distance is across the axis of the other, and not across the road.
    pub in_its_axes: bool,
    /// Whether it goes on once the place is reached.
    pub continuous: bool,
    pub most_mps: f64,
    pub most_accel_mps2: f64,
    pub most_decel_mps2: f64,
}

impl BesideLaw {
    /// Returns whether the place is reached at once.
    pub(super) fn is_unlimited(&self) -> bool {
        let most = [self.most_mps, self.most_accel_mps2, self.most_decel_mps2];
        most.iter().all(|it| it.is_infinite())
    }
}

/// Lateral place to another agent, in motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct BesideRun {
    pub law: BesideLaw,
    lateral_mps: f64,
    /// End of its present step.
    pub next_s: f64,
}

/// Lateral place that is aimed at, and its speed.
pub(super) struct BesideTarget {
    pub lateral_m: f64,
    pub lateral_mps: f64,
}

impl BesideRun {
    pub(super) fn new(law: BesideLaw, at_s: f64) -> BesideRun {
        BesideRun {
            law,
            lateral_mps: 0.0,
            next_s: at_s,
        }
    }

    /// Returns the lateral way of a step towards a place at its end.
    pub(super) fn step_m(
        &mut self,
        from_m: f64,
        target: &BesideTarget,
        speed_mps: f64,
        for_s: f64,
    ) -> f64 {
        let left_m = target.lateral_m - from_m;
        if self.law.is_unlimited() {
            return left_m;
        }
        // As fast as it can still stop beside the target.
        let stopping_mps = (2.0 * self.law.most_decel_mps2 * left_m.abs()).sqrt();
        // No faster than to arrive at the end of the step.
        let closing_mps = stopping_mps.min(left_m.abs() / for_s);
        let sideways_mps = target.lateral_mps + closing_mps.copysign(left_m);
        let most_mps = self.law.most_mps.min(speed_mps);
        let wanted_mps = sideways_mps.clamp(-most_mps, most_mps);
        let rate_mps2 = if wanted_mps.abs() < self.lateral_mps.abs() {
            self.law.most_decel_mps2
        } else {
            self.law.most_accel_mps2
        };
        let most_change_mps = rate_mps2 * for_s;
        let change_mps = wanted_mps - self.lateral_mps;
        self.lateral_mps += change_mps.clamp(-most_change_mps, most_change_mps);
        self.lateral_mps * for_s
    }
}
