//! Laws of motion along the path that depend on another agent, and limits of speed.

use super::motion_profile::SpeedRamp;
use crate::road::ChangeShape;
use crate::sim::Pose;
use crate::story::values::{Dimension, DistanceOrTime, DynamicLimits, FinalSpeed};

/// Limits of the speed and of its change. Infinity is no limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpeedLimits {
    pub most_mps: f64,
    pub most_accel_mps2: f64,
    pub most_decel_mps2: f64,
}

impl SpeedLimits {
    /// No limit.
    pub(super) const NONE: SpeedLimits = SpeedLimits {
        most_mps: f64::INFINITY,
        most_accel_mps2: f64::INFINITY,
        most_decel_mps2: f64::INFINITY,
    };

    /// Returns limits of which both apply.
    pub(super) fn with(self, other: &DynamicLimits<f64>) -> SpeedLimits {
        let least = |most: f64, other: Option<f64>| other.map_or(most, |it| most.min(it));
        SpeedLimits {
            most_mps: least(self.most_mps, other.max_speed_mps),
            most_accel_mps2: least(self.most_accel_mps2, other.max_accel_mps2),
            most_decel_mps2: least(self.most_decel_mps2, other.max_decel_mps2),
        }
    }

    /// Returns whether a speed may change in no time.
    pub(super) fn changes_at_once(&self) -> bool {
        // Both must be free, as a change may go either way.
        self.most_accel_mps2.is_infinite() && self.most_decel_mps2.is_infinite()
    }

    /// Returns the greatest rate of a change of speed.
    pub(super) fn most_rate_mps2(&self, from_mps: f64, to_mps: f64) -> f64 {
        if to_mps < from_mps {
            self.most_decel_mps2
        } else {
            self.most_accel_mps2
        }
    }

    /// Returns the speed that is nearest to a wanted one after a time.
    pub(super) fn nearest_mps(&self, from_mps: f64, wanted_mps: f64, for_s: f64) -> f64 {
        // At no time only a change without a limit is possible.
        let most = |rate: f64| if rate.is_finite() { rate * for_s } else { rate };
        // The aim is bounded before its change, so that neither limit is exceeded.
        let change_mps = (wanted_mps.clamp(0.0, self.most_mps) - from_mps)
            .clamp(-most(self.most_decel_mps2), most(self.most_accel_mps2));
        from_mps + change_mps
    }
}

/// Motion along the path that depends on another agent.
#[derive(Clone, Copy, Debug)]
pub(super) struct AlongLaw {
    /// Other agent.
    pub of: usize,
    pub aim: AlongAim,
    pub limits: SpeedLimits,
}

/// Aim of a motion that depends on another agent.
#[derive(Clone, Copy, Debug)]
pub(super) enum AlongAim {
    /// Speed of the other, times a factor, plus a difference.
    Speed {
        factor: f64,
        by_mps: f64,
        /// Course on which the difference to it vanishes. `None` for at once.
        shape: Option<ChangeShape>,
        size: Dimension<f64>,
    },
    /// Distance to the other.
    Distance {
        distance: DistanceOrTime<f64>,
        /// Whether the actor keeps it ahead of the other.
        leads: bool,
        freespace: bool,
        /// Along the road, and not along the own heading.
        on_road: bool,
        continuous: bool,
    },
    /// Arrival at a place along the road when the other arrives at its own.
    Synchronize {
        to: Pose,
        tolerance_m: f64,
        its: Pose,
        its_tolerance_m: f64,
        final_speed: Option<FinalSpeed<f64>>,
        steady: Option<DistanceOrTime<f64>>,
    },
}

/// Law along the path, in motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct AlongRun {
    pub law: AlongLaw,
    /// Speed at the beginning.
    pub from_mps: f64,
    /// Share of that speed that a transition still has.
    pub left: SpeedRamp,
    pub accel_mps2: f64,
    pub next_s: f64,
    /// Whether it has planned a step.
    pub is_begun: bool,
}

impl AlongRun {
    pub(super) fn new(law: AlongLaw, at_s: f64) -> AlongRun {
        AlongRun {
            law,
            from_mps: 0.0,
            left: SpeedRamp::steady(0.0),
            accel_mps2: 0.0,
            next_s: at_s,
            is_begun: false,
        }
    }

    /// Returns the acceleration now.
    pub(super) fn accel_mps2(&self) -> f64 {
        self.accel_mps2
    }

    /// Returns the end of its present step.
    pub(super) fn next_s(&self) -> f64 {
        self.next_s
    }
}
