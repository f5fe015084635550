//! Laws that the actions of a story give to a plan.

use core::f64::consts::PI;

use super::along_law::{AlongLaw, SpeedLimits};
use super::plan_way::TrajectoryLaw;
use crate::road::ChangeShape;
use crate::sim::Pose;
use crate::story::values::{Dimension, SpeedPoint};

/// Law that begins at an instant.
#[derive(Clone, Debug)]
pub(super) struct DueLaw {
    pub at_s: f64,
    pub law: StoryLaw,
}

/// Change of a motion that an action of a story demands.
#[derive(Clone, Debug)]
pub(super) enum StoryLaw {
    /// The speed changes. Without a shape it does so at once.
    Speed {
        to_mps: f64,
        shape: Option<ChangeShape>,
        size: Dimension<f64>,
        limits: SpeedLimits,
    },
    /// The speed follows a list, added to a speed.
    Profile {
        base_mps: f64,
        points: Vec<SpeedPoint<f64>>,
        limits: SpeedLimits,
    },
    /// The speed depends on another agent.
    Along(AlongLaw),
    /// The lateral place changes. Without a shape it does so at once.
    Lateral {
        from: LateralBase,
        offset_m: f64,
        shape: Option<ChangeShape>,
        timing: LateralTiming,
    },
    /// The speed stays.
    KeepSpeed,
    /// The lateral place stays.
    KeepPlace,
    /// The lateral place follows another agent.
    Beside(BesideLaw),
    /// The plan follows a curve.
    Follow(TrajectoryLaw),
    /// The plan follows another road of the world, by its number.
    Route(usize),
    /// The reference point is at a pose at once, on a road if that is known.
    Place { at: Pose, road: Option<usize> },
    /// The body stands out of reach.
    Vanish { to: Pose },
}

/// Place from which a lateral target is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LateralBase {
    /// Middle of a lane.
    Lane(usize),
    /// Middle of the present lane.
    PresentLane,
    /// Course of the road.
    Course,
}

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

/// Duration of a lateral motion.
#[derive(Clone, Copy, Debug)]
pub(super) enum LateralTiming {
    /// By a rate, a time or a way, with progress along the path.
    Size(Dimension<f64>),
    /// By the greatest lateral acceleration, with the speed along the road.
    Acceleration(f64),
}

/// Returns the greatest rate of a change between two speeds.
pub(super) fn greatest_rate(
    shape: ChangeShape,
    size: Dimension<f64>,
    [from_mps, to_mps]: [f64; 2],
) -> f64 {
    let change_mps = (to_mps - from_mps).abs();
    match size {
        Dimension::Rate(rate) => rate,
        Dimension::Time(time_s) => shape.peak() * change_mps / time_s,
        // All shapes have the mean of both speeds.
        Dimension::Distance(way_m) => shape.peak() * change_mps * 0.5 * (from_mps + to_mps) / way_m,
    }
}

impl LateralTiming {
    /// Returns the duration of a motion.
    pub(super) fn lasts_s(self, shape: ChangeShape, by_m: f64, speed_mps: f64) -> f64 {
        let way_m = by_m.abs();
        match self {
            LateralTiming::Size(Dimension::Rate(rate)) => shape.peak() * way_m / rate,
            LateralTiming::Size(Dimension::Time(time_s)) => time_s,
            // A standing body would need forever, and drives no way.
            LateralTiming::Size(Dimension::Distance(drive_m)) => drive_m / speed_mps.max(1e-3),
            // Greatest acceleration of each shape over its duration. A line has none.
            LateralTiming::Acceleration(most_mps2) => match shape {
                ChangeShape::Linear => 0.0,
                ChangeShape::Cosine => PI * (way_m / (2.0 * most_mps2)).sqrt(),
                ChangeShape::Cubic => (6.0 * way_m / most_mps2).sqrt(),
            },
        }
    }
}
