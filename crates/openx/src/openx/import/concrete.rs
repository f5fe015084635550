//! Scenario at a point, with its places in the frame of the ego.

use std::rc::Rc;

use super::entity::ImportedEntity;
use super::frame::RoadFrame;
use super::lights::ImportedLight;
use super::places::Placed;
use crate::opendrive::error::{At, ImportError};
use crate::opendrive::roads::{OnLane, RoadMap};
use crate::opendrive::ways::MOST_ASIDE_M;
use crate::road::{Bend, Course, Grade, SurfaceExtent};
use crate::sim::Pose;

/// Step in metres in which a road that comes back onto itself is shortened.
const SHORTER_M: f64 = 10.0;
/// Greatest number of such steps.
const MOST_STEPS: f64 = 1000.0;
/// Length in metres behind a reference point and ahead of it that holds its body.
const BODY_M: f64 = 20.0;

/// Scenario at a point.
pub(super) struct Concrete {
    pub frame: RoadFrame,
    /// Lateral position of a straight frame, from its reference line.
    pub straight_zero_m: f64,
    pub roads: Rc<RoadMap>,
    pub lanes: usize,
    pub lane_width_m: f64,
    /// True if all lanes of the world are those of the file.
    pub has_even_lanes: bool,
    /// Friction coefficient μ of the ego's road.
    pub friction: f64,
    pub limit_mps: Option<f64>,
    /// Grades of the ego's road.
    pub grades: Vec<Grade>,
    /// Lights of the ego's road.
    pub lights: Vec<ImportedLight>,
    pub entities: Vec<ImportedEntity>,
    /// Station of the ego's bent road at which the road of the world ends.
    ///
    /// It is infinite for a road that is complete.
    pub road_ends_m: f64,
    /// Time at which the file ends the run, if it states a time alone.
    pub stop_s: Option<f64>,
    /// Places of the end of the run, and of the ego's Init.
    pub ends_at: At,
    pub ego_at: At,
}

impl Concrete {
    /// Names of the entities that stand too far from all ways for a world.
    ///
    /// `is_named` tells whether the storyboard refers to an entity.
    pub(super) fn far_off(
        &self,
        is_named: impl Fn(&str) -> bool,
    ) -> Result<Vec<String>, ImportError> {
        let mut far = Vec::new();
        let others = self
            .entities
            .iter()
            .filter(|it| !it.is_ego && !is_named(&it.name));
        // A gap to the ego replaces the place, which then says nothing.
        for entity in others.filter(|it| !it.moves() && it.gap_m.is_none()) {
            let left_m = self.station(&entity.placed, &entity.at)?.y_m;
            let middle_m = self.lane_at(left_m) * self.lane_width_m;
            let is_far = |left_m: f64| left_m.abs() > MOST_ASIDE_M;
            // It may stand beside the way of somebody who crosses the ego's road.
            let ways = self.entities.iter().filter_map(|it| it.placed.way.as_ref());
            let mut beside = ways.map(|on| on.way.locate(&entity.placed.spot).lateral_m);
            if is_far(left_m - middle_m) && beside.all(is_far) {
                far.push(entity.name.clone());
            }
        }
        Ok(far)
    }

    /// Returns a place in the frame: along the ego's road, to its left, and turned.
    ///
    /// Beside a bent path, a place that is not on the path is a place in the
    /// plane.
    ///
    /// # Errors
    ///
    /// Returns an error for a place on another road than a bent one of the ego. `at` is
    /// the element that states the place.
    pub(super) fn in_frame(&self, placed: &Placed, at: &At) -> Result<Pose, ImportError> {
        let refused = |what: String| at.error(what);
        match &self.frame {
            RoadFrame::Straight(origin) => Ok(origin.sees(&placed.spot)),
            RoadFrame::Along(way) => Ok(match &placed.way {
                Some(on) if on.way == *way => Pose {
                    x_m: on.along_m,
                    ..on.spot().sees(&placed.spot)
                },
                _ => way.start().sees(&placed.spot),
            }),
            RoadFrame::Beside { .. } if placed.lane.is_none() && placed.way.is_some() => {
                Ok(self.in_plane(&placed.spot))
            }
            RoadFrame::Beside { road, t_m } => {
                let OnLane {
                    road: own,
                    s_m,
                    t_m: own_t_m,
                    ..
                } = placed.lane.as_ref().ok_or_else(|| {
                    let help = "place it by a `LanePosition`";
                    refused("a place beside a bend is on no lane".to_owned()).helped(help)
                })?;
                if own != road {
                    let what = format!("a place on road `{own}` beside a bend of `{road}`");
                    let help = "place it on the road of the ego";
                    return Err(refused(what).helped(help));
                }
                let root = self.roads.get(road).ok_or_else(|| {
                    refused(format!("there is no road `{road}`")).helped("place the ego on a road")
                })?;
                // The frame is a parallel of the reference line, and its length
                // differs by 1 − κ·t.
                let pieces = root.pieces.iter();
                let along = pieces.filter(|piece| piece.s_m < *s_m).map(|piece| {
                    let way_m = (s_m - piece.s_m).min(piece.length_m);
                    way_m * (1.0 - piece.per_m * t_m)
                });
                let on = root.at(*s_m, *own_t_m);
                Ok(Pose {
                    x_m: along.sum(),
                    y_m: own_t_m - t_m,
                    heading_rad: on.sees(&placed.spot).heading_rad,
                })
            }
        }
    }

    /// Returns a place in the plane of the world.
    pub(super) fn in_plane(&self, spot: &Pose) -> Pose {
        match &self.frame {
            RoadFrame::Straight(origin) => origin.sees(spot),
            RoadFrame::Along(way) => way.start().sees(spot),
            RoadFrame::Beside { road, t_m } => {
                let line = self.roads.get(road);
                line.map_or(*spot, |line| line.at(0.0, *t_m).sees(spot))
            }
        }
    }

    /// Place along the ego's road and to its left, also beside its bends.
    ///
    /// # Errors
    ///
    /// Returns an error for a place on another road than a bent one of the ego. `at` is
    /// the element that states the place.
    pub(super) fn station(&self, placed: &Placed, at: &At) -> Result<Pose, ImportError> {
        let way = match &self.frame {
            // Places on the ego's own way have their station there.
            RoadFrame::Along(way) if !self.is_on_road(placed) => way,
            _ => return self.in_frame(placed, at),
        };
        let on = way.locate(&placed.spot);
        Ok(Pose {
            x_m: on.s_m,
            y_m: on.lateral_m,
            heading_rad: on.heading_rad,
        })
    }

    /// Place of the ego's road in its file, or of the ego without one.
    pub(super) fn road_at(&self) -> At {
        let ego = self.entities.iter().find(|it| it.is_ego);
        let lane = ego.and_then(|it| it.placed.lane.as_ref());
        let road = lane.and_then(|at| self.roads.get(&at.road));
        road.map_or_else(|| self.ego_at.clone(), |road| road.node.at())
    }

    /// Curvature of the ego's lane 0 at the start of its road, in 1/m.
    pub(super) fn bend_per_m(&self) -> f64 {
        // Any positive length returns the first piece.
        self.pieces(1.0).first().map_or(0.0, |piece| piece.per_m)
    }

    /// Returns true if a place is on the ego's road.
    ///
    /// Every place is, except beside an ego that turns off.
    pub(super) fn is_on_road(&self, placed: &Placed) -> bool {
        match &self.frame {
            RoadFrame::Along(way) => placed.way.as_ref().is_some_and(|on| on.way == *way),
            RoadFrame::Straight(_) | RoadFrame::Beside { .. } => {
                placed.way.as_ref().is_none_or(|on| !on.is_lane)
            }
        }
    }

    /// Returns true if the ego's lane bends anywhere.
    pub(super) fn bends(&self) -> bool {
        !matches!(self.frame, RoadFrame::Straight(_))
    }

    /// Returns true if the curvature of the ego's lane changes.
    pub(super) fn bends_change(&self) -> bool {
        let pieces = self.pieces(f64::INFINITY);
        pieces.windows(2).any(|pair| pair[0].per_m != pair[1].per_m)
    }

    /// Lateral position of lane 0, from the reference line of the ego's road.
    pub(super) fn zero_m(&self) -> f64 {
        match &self.frame {
            RoadFrame::Beside { t_m, .. } => *t_m,
            RoadFrame::Straight(_) | RoadFrame::Along(_) => self.straight_zero_m,
        }
    }

    /// Number of the lane at a lateral distance from the middle of lane 0.
    pub(super) fn lane_at(&self, left_m: f64) -> f64 {
        // Places beside all lanes belong to the nearest lane.
        let lane = (left_m / self.lane_width_m).round().max(0.0);
        lane.min(self.lanes as f64 - 1.0)
    }

    /// Station at which the world's part of a road ends, infinite for a complete road.
    pub(super) fn ends_m(&self, road: &str) -> f64 {
        match &self.frame {
            RoadFrame::Beside { road: own, .. } if own == road => self.road_ends_m,
            _ => f64::INFINITY,
        }
    }

    /// Returns the station at which the ego's road has to end.
    ///
    /// A world's road goes straight on at both ends. On a road of nearly a full
    /// circle these ends cross, so positions would have two stations. Infinite
    /// for a road that may be complete.
    pub(super) fn unlapped_m(&self) -> f64 {
        let RoadFrame::Beside { road, .. } = &self.frame else {
            return f64::INFINITY;
        };
        let length_m = self.roads.get(road).map_or(0.0, |line| line.length_m);
        let lanes = self
            .entities
            .iter()
            .filter_map(|it| it.placed.lane.as_ref());
        let stations = lanes.filter(|at| at.road == *road).map(|at| at.s_m);
        let last_m = stations.fold(0.0, f64::max);
        let borders_m = -0.5 * self.lane_width_m..(self.lanes as f64 - 0.5) * self.lane_width_m;
        let laps = |ends_m: f64| {
            let pieces = self.pieces_between(f64::INFINITY, ends_m);
            let course = Course::of_bends(Pose::default(), &pieces).ok();
            course.is_some_and(|course| {
                let extent = SurfaceExtent {
                    stations_m: -BODY_M..course.end_s_m() + BODY_M,
                    borders_m: borders_m.clone(),
                };
                course.self_overlap(&extent).is_some()
            })
        };
        if !laps(length_m) {
            return f64::INFINITY;
        }
        // Every attempt builds a course, so their number is bounded for long roads.
        let step_m = SHORTER_M.max(length_m / MOST_STEPS);
        let mut shorter = (1..)
            .map(|steps| length_m - f64::from(steps) * step_m)
            .take_while(|ends_m| *ends_m > last_m);
        // A road on which an entity is placed so late is left as it is, and
        // refused.
        shorter
            .find(|ends_m| !laps(*ends_m))
            .unwrap_or(f64::INFINITY)
    }

    /// Pieces of the ego's lane 0 up to a length. A straight lane has none.
    pub(super) fn pieces(&self, until_m: f64) -> Vec<Bend> {
        self.pieces_between(until_m, self.road_ends_m)
    }

    /// Pieces up to a length, and up to a station of the reference line.
    fn pieces_between(&self, until_m: f64, ends_m: f64) -> Vec<Bend> {
        let (road, t_m) = match &self.frame {
            RoadFrame::Straight(_) => return Vec::new(),
            RoadFrame::Along(way) => return way.bends(),
            RoadFrame::Beside { road, t_m } => (road, t_m),
        };
        let Some(line) = self.roads.get(road) else {
            return Vec::new();
        };
        let mut left_m = until_m;
        let mut pieces = Vec::new();
        for piece in line.pieces.iter().filter(|piece| piece.s_m < ends_m) {
            // A parallel at t has the length 1 − κ·t times that of the
            // reference line, and the curvature κ / (1 − κ·t).
            let scale = 1.0 - piece.per_m * t_m;
            let whole_m = piece.length_m.min(ends_m - piece.s_m);
            let length_m = (whole_m * scale).min(left_m);
            left_m -= length_m;
            let per_m = piece.per_m / scale;
            pieces.push(Bend { length_m, per_m });
            if left_m <= 0.0 {
                break;
            }
        }
        pieces
    }
}
