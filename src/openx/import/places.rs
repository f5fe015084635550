//! Positions of scenario files, as places in the plane and on paths.

use std::collections::BTreeMap;

use super::catalog::Catalogs;
use super::ego_events::EgoRequest;
use crate::opendrive::error::ImportError;
use crate::opendrive::files::Files;
use crate::opendrive::roads::{OnLane, RoadMap};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::{Bend, ImportedPath, OnWay, Spiral};
use crate::sim::{Pose, wrapped};

/// Greatest angle in radians between two directions that count as equal.
const SAME_RAD: f64 = 1e-6;
/// Distance in metres beyond an end that still counts as the end.
const SAME_M: f64 = 1e-6;
/// Lateral distance in metres within which a route follows the lane.
const ASIDE_M: f64 = 10.0;

/// Place, with its description in the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placed {
    pub spot: Pose,
    /// Lane, if the file gives the place by a lane.
    pub lane: Option<OnLane>,
    /// Position on a path, if the file gives the place by a path.
    pub way: Option<OnWay>,
}

/// Context to which positions may refer.
#[derive(Clone, Copy)]
pub(super) struct PositionContext<'a> {
    pub roads: &'a RoadMap,
    pub catalogs: &'a Catalogs,
    pub files: Files<'a>,
    /// Entities that have been placed, by name.
    pub placed: &'a BTreeMap<String, Placed>,
    pub ego: &'a EgoRequest,
    /// Parameters that an event changes.
    pub changed: &'a [String],
    /// Entities that a controller may move.
    pub steered: &'a [String],
}

impl PositionContext<'_> {
    /// Returns true for an entity other than the ego with a controller.
    pub(super) fn is_steered(&self, name: &str) -> bool {
        name != self.ego.name && self.steered.iter().any(|it| it == name)
    }

    /// Returns the place of a `Position`.
    pub(super) fn place(
        &self,
        position: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<Placed, ImportError> {
        let it = position.only()?;
        match it.name.as_str() {
            "WorldPosition" => self.in_world(it, scope),
            "LanePosition" => {
                let road = scope.text(it, "roadId")?;
                let lane = scope.number(it, "laneId")? as i32;
                let offset_m = scope.number_or_zero(it, "offset")?;
                let s_m = scope.number(it, "s")?;
                self.on_lane(it, scope, (road, lane), s_m, offset_m)
            }
            "RoadPosition" => {
                let road = scope.text(it, "roadId")?;
                let (s_m, t_m) = (scope.number(it, "s")?, scope.number_or_zero(it, "t")?);
                self.on_road(it, scope, road, (s_m, t_m))
            }
            "RelativeLanePosition" => {
                let other = self.other(it, scope)?;
                let at = other.lane.as_ref().filter(|at| at.lane != 0);
                let at = at.ok_or_else(|| it.refused("what it is relative to is on no lane", "place that by a `LanePosition`"))?;
                let by = scope.number(it, "dLane")? as i32;
                let by_lane = it.raw("dsLane").is_some();
                let s_m = at.s_m + scope.number(it, if by_lane { "dsLane" } else { "ds" })?;
                // `ds` counts along the reference line and `dsLane` along the
                // lane. The two agree on straight roads only.
                if by_lane
                    && !self
                        .roads
                        .road(it, &at.road)?
                        .is_straight_between(at.s_m, s_m)
                {
                    let help = "use `ds`, which counts along the reference line of the road";
                    return Err(it.refused("`dsLane` on a bend is not read", help));
                }
                let lane = (at.road.clone(), beside(at.lane, by));
                let offset_m = scope.number_or_zero(it, "offset")?;
                self.on_lane(it, scope, lane, s_m, offset_m)
            }
            "RelativeRoadPosition" => {
                let other = self.other(it, scope)?;
                let at = other.lane.as_ref();
                let at = at.ok_or_else(|| it.refused("what it is relative to is on no road", "place that by a `LanePosition` or a `RoadPosition`"))?;
                let s_m = at.s_m + scope.number(it, "ds")?;
                let t_m = at.t_m + scope.number(it, "dt")?;
                self.on_road(it, scope, at.road.clone(), (s_m, t_m))
            }
            "RelativeObjectPosition" => {
                let other = self.other(it, scope)?.spot;
                let moved = other.moved(scope.number(it, "dx")?, scope.number(it, "dy")?);
                let spot = turned(it, scope, moved)?;
                Ok(Placed {
                    spot,
                    lane: None,
                    way: None,
                })
            }
            "TrajectoryPosition" => {
                let (trajectory, own) = self.trajectory(it.inner("TrajectoryRef")?, scope)?;
                let mut on = self.way(&trajectory, &own)?;
                on.move_on(it, scope.number(it, "s")?)?;
                let spot = on.spot().moved(0.0, scope.number_or_zero(it, "t")?);
                Ok(Placed {
                    spot: turned(it, scope, spot)?,
                    lane: None,
                    way: Some(on),
                })
            }
            "RoutePosition" => self.on_route(it, scope),
            _ => Err(it.refused("a position of this kind is not read", "place it in the world, on a lane, a road, a trajectory or a route, or relative to these")),
        }
    }

    /// Returns a trajectory, with the parameters that it may use.
    pub(super) fn trajectory(
        &self,
        reference: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<(XmlNode, ParameterScope), ImportError> {
        // Older files have no element around their trajectory.
        let inner = reference.child("CatalogReference");
        match inner.or(reference.child("Trajectory")) {
            Some(it) if it.name == "CatalogReference" => self.catalogs.entry(it, scope, self.files),
            Some(it) => Ok((it.clone(), scope.clone())),
            None => Err(reference.error("there is no trajectory in it")),
        }
    }

    /// Returns the path of a trajectory, and the position of its start on the path.
    pub(super) fn way(
        &self,
        trajectory: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<OnWay, ImportError> {
        let shape = trajectory.inner("Shape")?.only()?;
        match shape.name.as_str() {
            "Polyline" => {
                let vertices = shape.all("Vertex").map(|vertex| {
                    let placed = self.place(vertex.inner("Position")?, scope)?;
                    Ok(placed.spot)
                });
                let vertices = vertices.collect::<Result<Vec<Pose>, ImportError>>()?;
                let way = ImportedPath::through(shape, &vertices)?;
                let last = vertices.last().unwrap_or(&way.begins);
                Ok(OnWay {
                    ends_m: way.begins.sees(last).x_m,
                    way,
                    along_m: 0.0,
                    is_lane: false,
                })
            }
            "ClothoidSpline" => self.spline(shape, scope),
            other => Err(shape.error(format!("a way along a `{other}` is not read"))),
        }
    }

    /// Returns a path of lines, arcs and spirals.
    fn spline(&self, shape: &XmlNode, scope: &ParameterScope) -> Result<OnWay, ImportError> {
        let mut begins = None;
        let mut pieces = Vec::new();
        for segment in shape.all("ClothoidSplineSegment") {
            match (segment.child("PositionStart"), begins.is_none()) {
                (Some(position), true) => begins = Some(self.place(position, scope)?),
                (None, true) => {
                    return Err(segment.refused(
                        "nothing says where it begins",
                        "give its first segment a `PositionStart`",
                    ));
                }
                (Some(_), false) => {
                    return Err(segment.refused(
                        "a way that begins anew is not read",
                        "keep the `PositionStart` of the first segment only",
                    ));
                }
                (None, false) => {}
            }
            // A heading offset between segments would be a corner.
            let turns = scope.number_or_zero(segment, "hOffset")? != 0.0;
            if turns || shape.raw("timeEnd").is_some() {
                return Err(segment.refused(
                    "a way with corners or times is not read",
                    "leave out `hOffset` and `timeEnd`",
                ));
            }
            let spiral = Spiral {
                length_m: scope.number(segment, "length")?,
                from_per_m: scope.number(segment, "curvatureStart")?,
                to_per_m: scope.number(segment, "curvatureEnd")?,
            };
            if spiral.length_m <= 0.0 {
                return Err(segment.error(format!("a piece of {} m", spiral.length_m)));
            }
            // A path of its own has no lanes beside it, so its arcs need no
            // margin.
            pieces.extend(spiral.arcs(0.0));
        }
        let begins = begins.ok_or_else(|| {
            shape.refused("a way without pieces", "give it a `ClothoidSplineSegment`")
        })?;
        let lengths = pieces.iter().map(|piece: &Bend| piece.length_m);
        let mut on = OnWay {
            ends_m: lengths.sum(),
            way: ImportedPath {
                begins: begins.spot,
                pieces,
            },
            along_m: 0.0,
            is_lane: false,
        };
        // A path that starts on a straight road is extended back to the start
        // of the road. Points that start elsewhere on the road then share a
        // world.
        let lane = begins.lane.as_ref().filter(|at| 0.0 < at.s_m);
        if let Some((line, at)) = lane.and_then(|at| Some((self.roads.get(&at.road)?, at))) {
            let first = line.at(0.0, at.t_m);
            let is_on = line.is_straight() && is_along(first.sees(&begins.spot).heading_rad, 0.0);
            if is_on {
                on.begin_at(first);
            }
        }
        // A path continues straight after its last piece, so a final line adds
        // nothing.
        on.way.end_straight();
        Ok(on)
    }

    fn other(&self, it: &XmlNode, scope: &ParameterScope) -> Result<&Placed, ImportError> {
        let name = scope.text(it, "entityRef")?;
        let other = self.placed.get(&name);
        other.ok_or_else(|| it.error(format!("`{name}` is not placed before")))
    }

    /// Returns a place in the plane, with the lane on which it is.
    fn in_world(&self, it: &XmlNode, scope: &ParameterScope) -> Result<Placed, ImportError> {
        let (x_m, y_m) = (scope.number(it, "x")?, scope.number(it, "y")?);
        let heading_rad = it.raw("h").map(|_| scope.number(it, "h")).transpose()?;
        let spot = Pose {
            x_m,
            y_m,
            heading_rad: heading_rad.unwrap_or(0.0),
        };
        let found = self.roads.nearest_lane(&spot, heading_rad.is_some());
        // Without a heading, an entity faces along its lane.
        let spot = match (&found, heading_rad) {
            (Some((_, along_rad)), None) => Pose {
                heading_rad: *along_rad,
                ..spot
            },
            _ => spot,
        };
        Ok(Placed {
            spot,
            lane: found.map(|(lane, _)| lane),
            way: None,
        })
    }

    fn on_lane(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        (road, lane): (String, i32),
        s_m: f64,
        offset_m: f64,
    ) -> Result<Placed, ImportError> {
        let line = self.roads.road(it, &road)?;
        within(it, s_m, line.length_m, &format!("road `{road}`"))?;
        let (middle_m, slope) = line.middle_at(it, s_m, lane)?;
        let t_m = middle_m + offset_m;
        let mut on = line.at(s_m, t_m);
        if slope != 0.0 {
            let slant_rad = libm::atan2(slope, 1.0 - line.per_m(s_m) * t_m);
            on.heading_rad = wrapped(on.heading_rad + slant_rad);
        }
        // Lanes left of the reference line are driven against its direction.
        let driven = if 0 < lane {
            Pose {
                heading_rad: wrapped(on.heading_rad + core::f64::consts::PI),
                ..on
            }
        } else {
            on
        };
        Ok(Placed {
            spot: turned(it, scope, driven)?,
            lane: Some(OnLane {
                road,
                lane,
                s_m,
                t_m,
            }),
            way: None,
        })
    }

    fn on_road(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        road: String,
        (s_m, t_m): (f64, f64),
    ) -> Result<Placed, ImportError> {
        let line = self.roads.road(it, &road)?;
        within(it, s_m, line.length_m, &format!("road `{road}`"))?;
        let on = line.at(s_m, t_m);
        Ok(Placed {
            spot: turned(it, scope, on)?,
            lane: Some(OnLane {
                road,
                lane: 0,
                s_m,
                t_m,
            }),
            way: None,
        })
    }

    fn on_route(&self, it: &XmlNode, scope: &ParameterScope) -> Result<Placed, ImportError> {
        let reference = it.inner("RouteRef")?.only()?;
        let (route, stops) = self.route(reference, scope)?;
        let spots: Vec<Pose> = stops.iter().map(|stop| stop.spot).collect();
        // Only the direction of the route matters here: it must be straight.
        let begins = ImportedPath::through(&route, &spots)?.begins;
        let on = it.inner("InRoutePosition")?.only()?;
        let along_m = scope.number(on, "pathS")?;
        let last = spots.last().unwrap_or(&begins);
        let ends_m = begins.sees(last).x_m;
        within(on, along_m, ends_m, "the route")?;
        let aside_m = match on.name.as_str() {
            "FromLaneCoordinates" => scope.number_or_zero(on, "laneOffset")?,
            // The offset is relative to the reference line of the road, not to
            // the lane.
            "FromRoadCoordinates" => {
                let t_m = stops[0].lane.as_ref().map_or(0.0, |at| at.t_m);
                scope.number_or_zero(on, "t")? - t_m
            }
            _ => {
                return Err(on.refused(
                    "a place on a route of this kind is not read",
                    "write `FromLaneCoordinates` or `FromRoadCoordinates`",
                ));
            }
        };
        let begins = begins.moved(0.0, aside_m);
        Ok(Placed {
            spot: begins.moved(along_m, 0.0),
            lane: None,
            way: Some(OnWay {
                way: ImportedPath::straight(begins),
                along_m,
                ends_m,
                is_lane: false,
            }),
        })
    }

    /// Returns a route and its waypoints.
    fn route(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<(XmlNode, Vec<Placed>), ImportError> {
        let (route, own) = match it.name.as_str() {
            "CatalogReference" => self.catalogs.entry(it, scope, self.files)?,
            _ => (it.clone(), scope.clone()),
        };
        let stops = route
            .all("Waypoint")
            .map(|stop| self.place(stop.inner("Position")?, &own));
        let stops = stops.collect::<Result<Vec<Placed>, ImportError>>()?;
        Ok((route, stops))
    }

    /// Returns the roads of a route that leaves the line ahead of a place and its road.
    ///
    /// Any other route changes nothing.
    ///
    /// # Errors
    ///
    /// Returns an error for a route of places that are on no road.
    pub(super) fn turns_of(
        &self,
        assigned: &XmlNode,
        scope: &ParameterScope,
        at: &Placed,
    ) -> Result<Vec<String>, ImportError> {
        let (_, stops) = self.route(assigned.only()?, scope)?;
        let from = at.way.as_ref().map_or(at.spot, |on| on.way.begins);
        let road = |it: &Placed| it.lane.as_ref().map(|lane| lane.road.clone());
        let same_road = road(at).is_some() && stops.iter().all(|stop| road(stop) == road(at));
        let is_ahead = |stop: &Placed| {
            let seen = from.sees(&stop.spot);
            seen.y_m.abs() < ASIDE_M && is_along(seen.heading_rad, 0.0)
        };
        if same_road || stops.iter().all(is_ahead) {
            self.catalogs.note("routes", assigned);
            return Ok(Vec::new());
        }
        let roads = stops.iter().map(|stop| {
            road(stop).ok_or_else(|| {
                let help = "place its waypoints on lanes";
                assigned.refused("a route that turns off to no road is not read", help)
            })
        });
        roads.collect()
    }
}

/// Refuses a place before the start or after the end of its road or path.
fn within(it: &XmlNode, s_m: f64, length_m: f64, what: &str) -> Result<(), ImportError> {
    if (-SAME_M..=length_m + SAME_M).contains(&s_m) {
        Ok(())
    } else {
        let what = format!("it is {s_m} m along {what}, which has {length_m} m");
        let help = "place it on the road on which it is, or leave the point out with \
                        --skip-broken";
        Err(it.refused(what, help).of_point())
    }
}

/// Turns a place by its `Orientation`.
fn turned(it: &XmlNode, scope: &ParameterScope, spot: Pose) -> Result<Pose, ImportError> {
    let Some(orientation) = it.child("Orientation") else {
        return Ok(spot);
    };
    let h_rad = scope.number_or_zero(orientation, "h")?;
    let base_rad = match orientation.raw("type") {
        Some("relative") => spot.heading_rad,
        // Absolute headings are the default of OpenSCENARIO.
        _ => 0.0,
    };
    Ok(Pose {
        heading_rad: wrapped(base_rad + h_rad),
        ..spot
    })
}

/// Lane that lies `by` lanes to the left.
///
/// The number 0 is skipped, because no driving lane has it.
fn beside(lane: i32, by: i32) -> i32 {
    let there = lane + by;
    match (lane < 0 && 0 <= there, 0 < lane && there <= 0) {
        (true, _) => there + 1,
        (_, true) => there - 1,
        _ => there,
    }
}

/// Returns true if two directions are equal within [`SAME_RAD`].
pub(super) fn is_along(heading_rad: f64, direction_rad: f64) -> bool {
    wrapped(heading_rad - direction_rad).abs() < SAME_RAD
}

/// Lane beside another one, where 0 means the same lane.
pub(super) fn lane_beside(at: &OnLane, by: i32) -> i32 {
    match by {
        // A place by t has lane 0, which `beside` does not expect.
        0 => at.lane,
        by => beside(at.lane, by),
    }
}
