//! Entities of a scenario, at the start of the run.

use core::f64::consts::PI;

use super::bodies::ImportedBody;
use super::later::{LaterMotion, driven_s};
use super::places::Placed;
use crate::opendrive::error::{At, ImportError};
use crate::opendrive::roads::RoadMap;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::SAME_WAY_RAD;
use crate::sim::wrapped;

/// Sine of the least angle between a lane and a pedestrian that walks across it.
const ACROSS_SINE: f64 = 0.1;
/// What is dropped of a vehicle that faces off its lane.
const ASKEW: &str = "headings of vehicles off the lane that they follow";

/// Entity of a scenario.
#[derive(Clone, Debug)]
pub(super) struct ImportedEntity {
    pub name: String,
    pub is_ego: bool,
    pub body: ImportedBody,
    pub placed: Placed,
    pub speed_mps: f64,
    pub later: LaterMotion,
    pub approach: Option<Approached>,
    /// Roads that its route visits, if the route turns off.
    pub route: Vec<String>,
    /// Initial bumper-to-bumper gap to the ego in metres, which replaces the place.
    pub gap_m: Option<f64>,
    /// Kind of what its way drops of its place.
    pub dropped: Option<&'static str>,
    /// Place of the entity's Init in the file.
    pub at: At,
}

impl ImportedEntity {
    pub(super) fn moves(&self) -> bool {
        self.speed_mps != 0.0 || self.is_driven()
    }

    /// Returns whether it moves otherwise than at its first speed.
    pub(super) fn is_driven(&self) -> bool {
        self.later.acts || self.approach.is_some()
    }

    /// Turns a vehicle along its lane, which it follows however it faces.
    ///
    /// # Errors
    ///
    /// Returns an error for a lane of a road that is not read.
    pub(super) fn face_lane(&mut self, asks: &XmlNode, roads: &RoadMap) -> Result<(), ImportError> {
        // Turned, it would keep its distance on another side.
        if self.later.keeps_aside {
            return Ok(());
        }
        if self.placed.lane.is_none() {
            let found = roads.nearest_lane(&self.placed.spot, true);
            self.placed.lane = found.map(|(lane, _)| lane);
        }
        // Lane 0 means a place on no lane, so it has no direction to follow.
        let Some(at) = self.placed.lane.as_ref().filter(|at| at.lane != 0) else {
            return Ok(());
        };
        let line = roads.road(asks, &at.road)?;
        let (_, slope) = line.middle_at(asks, at.s_m, at.lane)?;
        // At t a metre of station is 1 − κ·t long, so in a bend the slant is
        // not the slope itself.
        let slant_rad = libm::atan2(slope, 1.0 - line.per_m(at.s_m) * at.t_m);
        let turn_rad = if at.forward { 0.0 } else { PI };
        let along_rad = wrapped(line.at(at.s_m, at.t_m).heading_rad + slant_rad + turn_rad);
        let spot = &mut self.placed.spot;
        if wrapped(spot.heading_rad - along_rad).abs() > SAME_WAY_RAD {
            spot.heading_rad = along_rad;
            self.dropped = Some(ASKEW);
        }
        Ok(())
    }

    /// Returns whether it walks from a place on a lane in another direction than the lane.
    ///
    /// It goes where it faces. Players may lead it along the lane.
    pub(super) fn walks_across(&self, roads: &RoadMap) -> bool {
        let Some(at) = self
            .placed
            .lane
            .as_ref()
            .filter(|_| self.placed.way.as_ref().is_none_or(|on| !on.is_lane))
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

    /// Earliest time in seconds at which it may have driven `ahead_m`.
    ///
    /// It drives as fast as any action that may have begun by then allows.
    pub(super) fn leaves_s(&self, ahead_m: f64) -> f64 {
        if let Some(path) = self.later.path {
            // Who stops at the end stays on the path.
            if path.last_mps == 0.0 {
                return f64::INFINITY;
            }
            let beyond_m = (ahead_m - path.way_m).max(0.0);
            // A path with an end leads that far and no farther.
            return path.ends_s
                + if beyond_m > 0.0 {
                    beyond_m / path.last_mps
                } else {
                    0.0
                };
        }
        driven_s(&self.later.speeds, self.speed_mps, ahead_m)
    }

    /// Greatest speed in m/s that it may have.
    pub(super) fn most_mps(&self) -> f64 {
        let later = self.later.speeds.iter().map(|it| it.most_mps);
        later.fold(self.speed_mps, f64::max)
    }

    /// Least of its known speeds in m/s.
    pub(super) fn slowest_mps(&self) -> f64 {
        let later = self.later.speeds.iter().map(|it| it.most_mps);
        later.fold(self.speed_mps, f64::min)
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
