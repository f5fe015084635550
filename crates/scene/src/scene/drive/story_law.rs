//! Laws that the actions of a story give to a plan.

use core::f64::consts::PI;

use super::along_law::{AlongLaw, SpeedLimits};
use super::beside_law::BesideLaw;
use super::motion_profile::SwingWay;
use super::plan_way::TrajectoryLaw;
use crate::road::ChangeShape;
use crate::sim::Pose;
use crate::story::values::{Dimension, SpeedPoint};

/// Distance in metres from its target at which a change across the road has nothing to do.
const THERE_M: f64 = 1e-6;

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
    /// Returns the way of a motion that goes on as its body drives, `None` for others.
    pub(super) fn way(self, shape: ChangeShape, by_m: f64) -> Option<SwingWay> {
        const PARTS: u32 = 100;
        let LateralTiming::Size(Dimension::Distance(road_m)) = self else {
            return None;
        };
        if by_m.abs() < THERE_M {
            return None;
        }
        // The line that moves aside on this length of road is longer than that.
        let step = 1.0 / f64::from(PARTS);
        let lengths_m = (0..PARTS).map(|part| {
            let share = f64::from(part) * step;
            let aside_m = by_m * (shape.changed(share + step) - shape.changed(share));
            libm::hypot(road_m * step, aside_m)
        });
        Some(SwingWay {
            whole_m: lengths_m.sum(),
            done_m: 0.0,
        })
    }

    /// Returns the duration of a motion.
    pub(super) fn lasts_s(self, shape: ChangeShape, by_m: f64) -> f64 {
        let way_m = by_m.abs();
        match self {
            LateralTiming::Size(Dimension::Rate(rate)) => shape.peak() * way_m / rate,
            LateralTiming::Size(Dimension::Time(_)) if way_m < THERE_M => 0.0,
            LateralTiming::Size(Dimension::Time(time_s)) => time_s,
            // The way decides, and the speed on it when it is driven.
            LateralTiming::Size(Dimension::Distance(_)) => 0.0,
            // Greatest acceleration of each shape over its duration. A line has none.
            LateralTiming::Acceleration(most_mps2) => match shape {
                ChangeShape::Linear => 0.0,
                ChangeShape::Cosine => PI * (way_m / (2.0 * most_mps2)).sqrt(),
                ChangeShape::Cubic => (6.0 * way_m / most_mps2).sqrt(),
            },
        }
    }
}
