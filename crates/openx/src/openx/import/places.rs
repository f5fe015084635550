//! Positions of scenario files, as places in the plane and on paths.

use core::f64::consts::{FRAC_PI_2, PI};
use std::collections::BTreeMap;

use super::catalog::Catalogs;
use super::ego_events::EgoRequest;
use crate::opendrive::error::ImportError;
use crate::opendrive::files::Files;
use crate::opendrive::lane_drive::LaneRoute;
use crate::opendrive::roads::{OnLane, RoadMap};
use crate::opendrive::scope::{ParameterScope, number};
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::{OnWay, line_through};
use crate::road::Course;
use crate::sim::{Pose, wrapped};

/// Greatest angle in radians between two directions that count as equal.
const SAME_RAD: f64 = 1e-6;
/// Distance in metres beyond an end that still counts as the end.
const SAME_M: f64 = 1e-6;
/// Greatest distance in metres of a place from the origin.
const MOST_PLACE_M: f64 = 1e8;
/// Greatest number of routes and trajectories whose places are on one another.
const MOST_DEPTH: usize = 4;
/// Sine of the least turn of a route that is not straight.
const TURNED_SINE: f64 = 0.1;
/// Angle in radians between a lane and a straight route from which on the road bends.
const BENDS_RAD: f64 = 0.001;
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

impl Placed {
    /// Returns true for a place on a path that turns at its places.
    pub(super) fn turns(&self) -> bool {
        self.way.as_ref().is_some_and(OnWay::has_corners)
    }
}

/// Place beside the middle of a lane, with the direction of an entity there.
struct BesideLane<'a> {
    road: &'a str,
    lane: i32,
    forward: bool,
    /// Station on the reference line.
    s_m: f64,
    /// Offset to the left of the middle of the lane.
    offset_m: f64,
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
    /// Entities whose place another message refuses.
    pub unplaced: &'a [String],
    /// Entities that a controller may move.
    pub steered: &'a [String],
    /// Entities that the Init deletes.
    pub absent: &'a [String],
    /// True if an `Orientation` without a type is relative, as from OpenSCENARIO 1.3 on.
    pub turns_relative: bool,
    /// Number of places that refer to each other so far.
    pub depth: usize,
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
        if self.depth > MOST_DEPTH {
            let what = "its places refer to each other in a circle";
            let help = "place what it follows in the world or on lanes";
            return Err(position.refused(what, help));
        }
        let within = PositionContext {
            depth: self.depth + 1,
            ..*self
        };
        let placed = within.read_place(position, scope)?;
        let far_m = placed.spot.x_m.abs().max(placed.spot.y_m.abs());
        // Also rejects NaN.
        if far_m <= MOST_PLACE_M {
            return Ok(placed);
        }
        let what = format!("it is {far_m:e} m from the origin");
        let help = format!("keep all places within {MOST_PLACE_M:e} m of it");
        Err(position.refused(what, &help))
    }

    /// Lists a place by a road whose lane leads against it, along which players turn it.
    pub(super) fn note_turned(&self, position: &XmlNode, placed: &Placed) {
        let by_road = position.child("RoadPosition");
        let is_absolute = |it: &XmlNode| {
            it.child("Orientation").and_then(|it| it.raw("type")) == Some("absolute")
        };
        let on = placed.lane.as_ref().filter(|at| at.lane != 0);
        let road = on.and_then(|at| self.roads.get(&at.road).map(|road| (road, at.lane)));
        if let Some(it) = by_road.filter(|it| !is_absolute(it))
            && road.is_some_and(|(road, lane)| !road.leads_forward(lane))
        {
            let kind = "players that turn places by a road along their lane";
            self.catalogs.note(kind, it);
        }
    }

    fn read_place(
        &self,
        position: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<Placed, ImportError> {
        let it = position.only()?;
        match it.name.as_str() {
            "WorldPosition" => self.in_world(it, scope),
            "LanePosition" => {
                let road = self.road_id(it, scope)?;
                let lane = scope.lane(it, "laneId")?;
                let offset_m = scope.number_or_zero(it, "offset")?;
                let s_m = scope.number(it, "s")?;
                let forward = self.roads.road(it, &road)?.leads_forward(lane);
                let place = BesideLane {
                    road: &road,
                    lane,
                    forward,
                    s_m,
                    offset_m,
                };
                self.on_lane(it, scope, place)
            }
            "RoadPosition" => {
                let road = self.road_id(it, scope)?;
                let (s_m, t_m) = (scope.number(it, "s")?, scope.number_or_zero(it, "t")?);
                self.on_road(it, scope, &road, s_m, t_m)
            }
            "RelativeLanePosition" => {
                let other = self.other(it, scope)?;
                let at = other.lane.as_ref().filter(|at| at.lane != 0).ok_or_else(|| {
                    let help = "place that by a `LanePosition`";
                    let error = it.refused("what it is relative to is on no lane", help);
                    error.following(self.roads.is_unread())
                })?;
                let by_lane = it.raw("dsLane").is_some();
                let along_m = scope.number(it, if by_lane { "dsLane" } else { "ds" })?;
                let line = self.roads.road(it, &at.road)?;
                // Along a lane means in the direction of its traffic.
                let against = by_lane && !line.leads_forward(at.lane);
                let s_m = at.s_m + if against { -along_m } else { along_m };
                // `ds` counts along the reference line and `dsLane` along the
                // lane. The two agree on straight roads only.
                if by_lane && !line.is_straight_between(at.s_m, s_m) {
                    let help = "use `ds`, which counts along the reference line of the road";
                    return Err(it.refused("`dsLane` on a bend is not read", help));
                }
                // With `dsLane` the left is that of the entity, and with `ds` that of
                // the road, along which the new place faces, too.
                let side = if by_lane && !at.forward { -1 } else { 1 };
                let lane = beside(at.lane, scope.lane(it, "dLane")? * side);
                let forward = !by_lane || line.leads_forward(lane);
                let offset_m = scope.number_or_zero(it, "offset")? * f64::from(side);
                let place = BesideLane {
                    road: &at.road,
                    lane,
                    forward,
                    s_m,
                    offset_m,
                };
                self.on_lane(it, scope, place)
            }
            "RelativeRoadPosition" => {
                let other = self.other(it, scope)?;
                let at = other.lane.as_ref().ok_or_else(|| {
                    let help = "place that by a `LanePosition` or a `RoadPosition`";
                    let error = it.refused("what it is relative to is on no road", help);
                    error.following(self.roads.is_unread())
                })?;
                let s_m = at.s_m + scope.number(it, "ds")?;
                let flat = self.roads.road(it, &at.road)?.lanes.flat(at.s_m).0;
                // Back onto the banked surface, along which `dt` is measured.
                let t_m = at.t_m / flat + scope.number(it, "dt")?;
                self.on_road(it, scope, &at.road, s_m, t_m)
            }
            "RelativeObjectPosition" => {
                let other = self.other(it, scope)?.spot;
                let ahead_m = scope.number_or_zero(it, "dx")?;
                let moved = other.moved(ahead_m, scope.number_or_zero(it, "dy")?);
                let spot = self.turned(it, scope, moved)?;
                Ok(Placed {
                    spot,
                    lane: None,
                    way: None,
                })
            }
            "RelativeWorldPosition" => {
                let other = self.other(it, scope)?.spot;
                let spot = Pose {
                    x_m: other.x_m + scope.number(it, "dx")?,
                    y_m: other.y_m + scope.number(it, "dy")?,
                    ..other
                };
                let spot = self.turned(it, scope, spot)?;
                let found = self.roads.nearest_lane(&spot, true);
                Ok(Placed {
                    spot,
                    lane: found.map(|(lane, _)| lane),
                    way: None,
                })
            }
            "TrajectoryPosition" => {
                let (trajectory, own) = self.trajectory(it.inner("TrajectoryRef")?, scope)?;
                let mut on = self.way(&trajectory, &own)?;
                on.move_on(it, scope.number(it, "s")?)?;
                let spot = on.spot().moved(0.0, scope.number_or_zero(it, "t")?);
                Ok(Placed {
                    spot: self.turned(it, scope, spot)?,
                    lane: None,
                    way: Some(on),
                })
            }
            "RoutePosition" => self.on_route(it, scope),
            _ => Err(it.refused("a position of this kind is not read", "place it in the world, on a lane, a road, a trajectory or a route, or relative to these")),
        }
    }

    /// Returns the road of a place.
    ///
    /// Older files count their roads from 0, whatever name a single road has.
    fn road_id(&self, it: &XmlNode, scope: &ParameterScope) -> Result<String, ImportError> {
        let road = scope.text(it, "roadId")?;
        let mut all = self.roads.all().map(|(id, _)| id);
        match (all.next(), all.next()) {
            (Some(single), None) if road == "0" && number(single).is_none() => {
                self.catalogs.note("names of single roads", it);
                Ok(single.clone())
            }
            _ => Ok(road),
        }
    }

    fn other(&self, it: &XmlNode, scope: &ParameterScope) -> Result<&Placed, ImportError> {
        let name = scope.text(it, "entityRef")?;
        let other = self.placed.get(&name);
        other.ok_or_else(|| {
            let help = "place it in Init, relative to none that is relative to it";
            let error = it.refused(format!("`{name}` is not placed before"), help);
            // Another message says why it is not.
            error.following(self.unplaced.contains(&name))
        })
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
        // Without a heading, an entity faces along its road.
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
        place: BesideLane<'_>,
    ) -> Result<Placed, ImportError> {
        let BesideLane {
            road, lane, s_m, ..
        } = place;
        let line = self.roads.road(it, road)?;
        within(it, s_m, line.length_m, &format!("road `{road}`"))?;
        let (middle_m, slope) = line.middle_at(it, s_m, lane)?;
        let t_m = middle_m + place.offset_m * line.lanes.flat(s_m).0;
        let mut on = line.at(s_m, t_m);
        // Along a lane whose width changes, its middle leads off the road's direction.
        if slope != 0.0 {
            let slant_rad = libm::atan2(slope, 1.0 - line.per_m(s_m) * t_m);
            on.heading_rad = wrapped(on.heading_rad + slant_rad);
        }
        let driven = if place.forward {
            on
        } else {
            Pose {
                heading_rad: wrapped(on.heading_rad + PI),
                ..on
            }
        };
        let at = OnLane {
            road: road.to_owned(),
            lane,
            s_m,
            t_m,
            forward: place.forward,
        };
        self.faced(it, scope, driven, at)
    }

    /// Returns a place on a road, turned by its `Orientation`.
    fn faced(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        unturned: Pose,
        at: OnLane,
    ) -> Result<Placed, ImportError> {
        let spot = self.turned(it, scope, unturned)?;
        let line = self.roads.road(it, &at.road)?;
        // An entity goes on in the direction that it faces.
        let turned_rad = wrapped(spot.heading_rad - line.at(at.s_m, 0.0).heading_rad);
        Ok(Placed {
            spot,
            lane: Some(OnLane {
                forward: turned_rad.abs() < FRAC_PI_2,
                ..at
            }),
            way: None,
        })
    }

    /// Turns a place by its `Orientation`.
    fn turned(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        spot: Pose,
    ) -> Result<Pose, ImportError> {
        let Some(orientation) = it.child("Orientation") else {
            return Ok(spot);
        };
        let h_rad = scope.number_or_zero(orientation, "h")?;
        let is_relative = match orientation.raw("type") {
            Some(kind) => kind == "relative",
            None => self.turns_relative,
        };
        let base_rad = if is_relative { spot.heading_rad } else { 0.0 };
        Ok(Pose {
            heading_rad: wrapped(base_rad + h_rad),
            ..spot
        })
    }

    fn on_road(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        road: &str,
        s_m: f64,
        stated_t_m: f64,
    ) -> Result<Placed, ImportError> {
        let line = self.roads.road(it, road)?;
        within(it, s_m, line.length_m, &format!("road `{road}`"))?;
        // Files measure `t` along the banked surface, and places are in the plane.
        let t_m = stated_t_m * line.lanes.flat(s_m).0;
        let at = OnLane {
            road: road.to_owned(),
            lane: line.lanes.lane_at(s_m, t_m).unwrap_or(0),
            s_m,
            t_m,
            forward: true,
        };
        self.faced(it, scope, line.at(s_m, t_m), at)
    }

    fn on_route(&self, it: &XmlNode, scope: &ParameterScope) -> Result<Placed, ImportError> {
        let reference = it.inner("RouteRef")?.only()?;
        let (route, stops) = self.route(reference, scope)?;
        let spots: Vec<Pose> = stops.iter().map(|stop| stop.spot).collect();
        let lanes: Option<Vec<&OnLane>> = stops.iter().map(|stop| stop.lane.as_ref()).collect();
        let is_over_roads = |lanes: &&Vec<&OnLane>| lanes.iter().any(|at| at.road != lanes[0].road);
        // Two places are always on one line, but a route that turns faces elsewhere.
        let turns = |spot: &Pose| {
            let sine = libm::sin(spot.heading_rad - spots[0].heading_rad);
            sine.abs() > TURNED_SINE
        };
        let over_roads = lanes.as_ref().filter(is_over_roads);
        if let Some(lanes) = over_roads.filter(|_| spots.iter().any(turns)) {
            return self.on_roads(it, scope, lanes);
        }
        let on = it.inner("InRoutePosition")?.only()?;
        let along_m = scope.number(on, "pathS")?;
        // Only the direction of the route matters here: it must be straight, with
        // the lanes along it.
        let begins = line_through(&route, &spots)?;
        let mut bends = stops
            .iter()
            .filter(|stop| stop.lane.is_some())
            .map(|stop| begins.sees(&stop.spot).heading_rad.abs());
        if bends.any(|off_rad| off_rad > BENDS_RAD) {
            let is_later = along_m > 0.0 && on.name == "FromLaneCoordinates";
            let placed = lanes
                .filter(|_| is_later)
                .map(|lanes| self.on_roads(it, scope, &lanes))
                .transpose()?;
            let stated = on.raw("laneId").map(|_| scope.lane(on, "laneId"));
            let stated = stated.transpose()?;
            // Players have their own way to a lane that the route does not drive.
            let is_driven = |placed: &Placed| {
                let lane = placed.lane.as_ref().map(|at| at.lane);
                stated.is_none() || stated == lane
            };
            return match placed.filter(is_driven) {
                Some(placed) => Ok(placed),
                None => self.on_lane_of(on, scope, &stops[0], along_m),
            };
        }
        let last = spots.last().unwrap_or(&begins);
        let ends_m = begins.sees(last).x_m;
        within(on, along_m, ends_m, "the route")?;
        let aside_m = match on.name.as_str() {
            // It is one of the lane, whose left side is that of the road.
            "FromLaneCoordinates" => {
                let faces = |at: &OnLane| if at.forward { 1.0 } else { -1.0 };
                let turned_rad = begins.heading_rad - spots[0].heading_rad;
                let along = libm::cos(turned_rad) * stops[0].lane.as_ref().map_or(1.0, faces);
                scope.number_or_zero(on, "laneOffset")? * 1f64.copysign(along)
            }
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
                along_m,
                ..OnWay::start(Course::straight_from(begins), ends_m)
            }),
        })
    }

    /// Returns a place along a route over several roads.
    fn on_roads(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        stops: &[&OnLane],
    ) -> Result<Placed, ImportError> {
        let on = it.inner("InRoutePosition")?.only()?;
        let mut left_m = scope.number(on, "pathS")?;
        let visited: Vec<String> = stops.iter().map(|stop| stop.road.clone()).collect();
        let drive = self.roads.lane_drive(
            it,
            stops[0],
            LaneRoute {
                via: &visited,
                reach_m: left_m,
            },
        )?;
        let found = drive.iter().find(|stretch| {
            let is_here = left_m <= stretch.length_m();
            left_m -= if is_here { 0.0 } else { stretch.length_m() };
            is_here
        });
        let stretch = found.ok_or_else(|| {
            on.refused("it lies beyond the route", "let its `pathS` be less")
                .of_point()
        })?;
        let lane = match on.raw("laneId") {
            // A place of a route has its number of the lane from the file.
            Some(_) if stretch.road == stops[0].road => scope.lane(on, "laneId")?,
            _ => stretch.lane,
        };
        let place = BesideLane {
            road: &stretch.road,
            lane,
            forward: stretch.is_forward(),
            s_m: stretch.station_m(left_m),
            offset_m: scope.number_or_zero(on, "laneOffset")?,
        };
        self.on_lane(it, scope, place)
    }

    /// Place at the start of a route that bends.
    fn on_lane_of(
        &self,
        on: &XmlNode,
        scope: &ParameterScope,
        first: &Placed,
        along_m: f64,
    ) -> Result<Placed, ImportError> {
        let lane = first
            .lane
            .as_ref()
            .filter(|_| along_m == 0.0)
            .ok_or_else(|| {
                let help = "place it by a `LanePosition`";
                on.refused("a place along a route that bends is not read", help)
            })?;
        let place = BesideLane {
            road: &lane.road,
            lane: lane.lane,
            forward: lane.forward,
            s_m: lane.s_m,
            offset_m: scope.number_or_zero(on, "laneOffset")?,
        };
        self.on_lane(on, scope, place)
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
            .map(|stop| self.place(stop.inner("Position")?, &own))
            .collect::<Result<Vec<Placed>, ImportError>>()?;
        Ok((route, stops))
    }

    /// Returns the roads of a route that leaves the line ahead of a place and its road.
    ///
    /// Any other route changes nothing.
    ///
    /// # Errors
    ///
    /// Returns an error for a route of places that are on no road.
    pub(super) fn turns_to(
        &self,
        assigned: &XmlNode,
        scope: &ParameterScope,
        at: &Placed,
    ) -> Result<Vec<String>, ImportError> {
        let stops = match assigned.name.as_str() {
            "AcquirePositionAction" => vec![self.place(assigned.inner("Position")?, scope)?],
            _ => self.route(assigned.only()?, scope)?.1,
        };
        let from = at.way.as_ref().map_or(at.spot, |on| on.way.start());
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
                let error = assigned.refused("a route that turns off to no road is not read", help);
                error.following(self.roads.is_unread())
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

/// Lane that lies `by` lanes to the left.
///
/// The number 0 is skipped, because no driving lane has it.
pub(super) fn beside(lane: i32, by: i32) -> i32 {
    let there = lane + by;
    match (lane < 0 && there >= 0, lane > 0 && there <= 0) {
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
