//! Entities of a scenario and their steps.

use core::f64::consts::PI;

use super::bodies::ImportedBody;
use super::places::Placed;
use crate::opendrive::error::At;
use crate::opendrive::roads::RoadMap;
use crate::road::ChangeShape;
use crate::sim::wrapped;

/// Sine of the least angle between a lane and a pedestrian that walks across it.
const ACROSS_SINE: f64 = 0.1;
/// Lateral speed in m/s of a change of lane at once: it takes about a millisecond.
pub(super) const AT_ONCE_MPS: f64 = 5000.0;

/// Entity of a scenario.
#[derive(Clone, Debug)]
pub(super) struct ImportedEntity {
    pub name: String,
    pub is_ego: bool,
    pub body: ImportedBody,
    pub placed: Placed,
    pub speed_mps: f64,
    pub steps: Vec<ImportedStep>,
    pub approach: Option<Approached>,
    /// Roads that its route visits, if the route turns off.
    pub route: Vec<String>,
    /// Initial bumper-to-bumper gap to the ego in metres, which replaces the place.
    pub gap_m: Option<f64>,
    /// Place of the entity's Init in the file.
    pub at: At,
}

impl ImportedEntity {
    pub(super) fn moves(&self) -> bool {
        self.speed_mps != 0.0 || !self.steps.is_empty() || self.approach.is_some()
    }

    pub(super) fn changes_lane(&self) -> bool {
        let mut laws = self.steps.iter().flat_map(|step| &step.laws);
        laws.any(|law| {
            matches!(
                law,
                ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. }
            )
        })
    }

    /// Returns whether it walks from a place on a lane in another direction than the lane.
    ///
    /// It goes where it faces. Players may lead it along the lane.
    pub(super) fn walks_across(&self, roads: &RoadMap) -> bool {
        let Some(at) = self
            .placed
            .lane
            .as_ref()
            .filter(|_| self.placed.way.is_none())
        else {
            return false;
        };
        let Some(road) = roads.get(&at.road) else {
            return false;
        };
        let off_rad = wrapped(self.placed.spot.heading_rad - road.at(at.s_m, 0.0).heading_rad);
        let is_along = libm::sin(off_rad).abs() < ACROSS_SINE;
        self.body.on_foot && self.moves() && self.approach.is_none() && !is_along
    }

    /// 1 if the left of its way is the left of its road, and −1 otherwise.
    pub(super) fn side(&self, against: bool) -> f64 {
        let on_lanes = self.placed.way.as_ref().is_some_and(|on| on.is_lane);
        let forward = self.placed.lane.as_ref().is_none_or(|at| at.forward);
        let is_left = on_lanes && forward == against;
        if is_left { -1.0 } else { 1.0 }
    }
}

/// Step of an entity's script.
#[derive(Clone, Debug, Default)]
pub(super) struct ImportedStep {
    pub when: Option<WatchedCondition>,
    pub after_s: f64,
    pub laws: Vec<ImportedLaw>,
    /// True if the next step may begin while a law across the path goes on.
    pub overlaps: bool,
    /// Place of its event in the file, unless it is one of the Init.
    pub at: Option<At>,
}

/// ConditionQuantity that a condition compares with a value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Measure {
    /// Clearance along the road to an entity, as a length or a time.
    ///
    /// As a time, it is the clearance divided by the triggering entity's speed.
    Clearance {
        target: String,
        is_time: bool,
    },
    /// Distance along the road between the reference points of two entities.
    Along {
        target: String,
        is_time: bool,
    },
    /// Distance between the boxes of two entities.
    Gap {
        target: String,
    },
    /// Distance between the reference points of two entities.
    Apart {
        target: String,
    },
    /// Time until the clearance along the road to an entity is used up.
    Collision {
        target: String,
    },
    /// Own speed.
    Speed,
    /// Own speed less that of another entity.
    Faster {
        target: String,
    },
    /// Own acceleration, whatever its direction.
    Acceleration,
    /// Own distance since the start.
    Travelled,
    /// Distance of the own reference point to a place, in the plane or along the road.
    Place {
        at: Box<Placed>,
        is_along: bool,
    },
    /// Time of the run.
    Time,
    /// Conditions that must hold together, of which any is enough.
    All(Vec<WatchedCondition>),
    Any(Vec<WatchedCondition>),
}

/// Condition of a step: a quantity of some entities, and a value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WatchedCondition {
    /// Entities of which one, or all, must meet the condition.
    pub who: Vec<String>,
    pub needs_all: bool,
    pub measure: Measure,
    pub is_below: bool,
    pub value: f64,
    /// True if the condition must have been false before.
    pub rises: bool,
    /// True if it is first evaluated after the start.
    pub is_late: bool,
    /// Place of the condition in the file.
    pub at: At,
}

/// Lateral place of an entity, as its laws across the path change it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LateralState {
    /// Offset from the reference line.
    pub t_m: f64,
    /// Sum of the lane changes so far, a share of the offset.
    pub changed_m: f64,
}

impl LateralState {
    pub(super) fn at_start(placed: &Placed) -> LateralState {
        LateralState {
            t_m: placed.lane.as_ref().map_or(0.0, |at| at.t_m),
            changed_m: 0.0,
        }
    }

    /// Adds a lane change.
    pub(super) fn change(&mut self, by_m: f64) {
        self.t_m += by_m;
        self.changed_m += by_m;
    }
}

/// Law of motion of a step.
#[derive(Clone, Debug)]
pub(super) enum ImportedLaw {
    Speed {
        to_mps: f64,
        relative_to: Option<String>,
        rate_mps2: Option<f64>,
        shape: ChangeShape,
    },
    LaneChange {
        by_m: f64,
        rate_mps: f64,
        shape: ChangeShape,
    },
    /// Change to an offset from the reference line, less the earlier lane changes.
    Beside {
        t_m: f64,
        most_lateral_mps2: f64,
    },
    Walk {
        speed_mps: f64,
        way_m: f64,
    },
}

impl ImportedLaw {
    /// Greatest lateral speed in m/s of a change across the path, or 0.
    pub(super) fn across_mps(&self, from: LateralState) -> f64 {
        match self {
            ImportedLaw::LaneChange { by_m: 0.0, .. } => 0.0,
            ImportedLaw::LaneChange { rate_mps, .. } => *rate_mps,
            // Half of π·by/T, with the duration of the cosine.
            ImportedLaw::Beside {
                t_m: to_m,
                most_lateral_mps2,
            } => (0.5 * (to_m + from.changed_m - from.t_m).abs() * most_lateral_mps2).sqrt(),
            ImportedLaw::Speed { .. } | ImportedLaw::Walk { .. } => 0.0,
        }
    }

    /// Duration in seconds, or `None` if it depends on the run.
    ///
    /// It begins at a speed and a lateral place.
    pub(super) fn lasts_s(&self, from_mps: Option<f64>, from: LateralState) -> Option<f64> {
        match self {
            ImportedLaw::Speed {
                rate_mps2: None, ..
            } => Some(0.0),
            ImportedLaw::Speed {
                to_mps,
                relative_to: None,
                rate_mps2: Some(rate_mps2),
                shape,
            } => Some(shape.peak() * (to_mps - from_mps?).abs() / rate_mps2),
            ImportedLaw::Speed { .. } => None,
            // A jump takes no time.
            ImportedLaw::LaneChange { rate_mps, .. } if *rate_mps >= AT_ONCE_MPS => Some(0.0),
            ImportedLaw::LaneChange {
                by_m,
                rate_mps,
                shape,
            } => Some(shape.peak() * by_m.abs() / rate_mps),
            ImportedLaw::Beside {
                t_m: to_m,
                most_lateral_mps2,
            } => {
                // The greatest acceleration of a cosine is π²·by/(2·T²).
                let by_m = to_m + from.changed_m - from.t_m;
                Some(PI * (by_m.abs() / (2.0 * most_lateral_mps2)).sqrt())
            }
            ImportedLaw::Walk { speed_mps, way_m } => Some(way_m / speed_mps),
        }
    }
}

/// Meeting: the entity reaches a place when the ego reaches another.
#[derive(Clone, Debug)]
pub(super) struct Approached {
    pub ego: Placed,
    pub here: Placed,
    pub speed_mps: f64,
    /// Last part of the approach, at constant speed.
    pub steady: Steady,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Steady {
    Metres(f64),
    Seconds(f64),
}
