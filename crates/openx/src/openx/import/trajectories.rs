//! Trajectories of scenario files, as paths.

use super::places::{PositionContext, is_along};
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::{CorneredWay, OnWay, Spiral, WINDS, course, line_through};
use crate::road::{Bend, Course};
use crate::sim::{Pose, wrapped};

/// Greatest angle in radians between the heading at a place and the line to the next.
const FACES_RAD: f64 = 0.1;
/// Length in metres up to which a line may differ more.
const SHORT_M: f64 = 1.0;
/// Lengths in metres of a piece of a trajectory, and greatest length of the whole.
const LENGTHS_M: core::ops::RangeInclusive<f64> = 1e-6..=MOST_WAY_M;
const MOST_WAY_M: f64 = 100_000.0;

/// Place of a trajectory with times: its time in seconds and its station in metres.
pub(super) type TimedPlace = (f64, f64);

impl PositionContext<'_> {
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
            None => {
                let help = "give it a `Trajectory` or a `CatalogReference`";
                Err(reference.refused("there is no trajectory in it", help))
            }
        }
    }

    /// Returns the path of a trajectory, and the position of its start on the path.
    pub(super) fn way(
        &self,
        trajectory: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<OnWay, ImportError> {
        let on = self.whole_way(trajectory, scope)?;
        if on.ends_m <= MOST_WAY_M {
            return Ok(on);
        }
        let what = format!("a way of {:.0} m", on.ends_m);
        let help = format!("keep it below {MOST_WAY_M} m");
        Err(trajectory.refused(what, &help))
    }

    fn whole_way(
        &self,
        trajectory: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<OnWay, ImportError> {
        let shape = trajectory.inner("Shape")?.only()?;
        match shape.name.as_str() {
            "Polyline" => {
                let vertices = shape
                    .all("Vertex")
                    .map(|vertex| {
                        let placed = self.place(vertex.inner("Position")?, scope)?;
                        Ok(placed.spot)
                    })
                    .collect::<Result<Vec<Pose>, ImportError>>()?;
                // A straight way goes on at its end, and one with corners ends there.
                if let Ok(begins) = line_through(shape, &vertices) {
                    let last = vertices.last().unwrap_or(&begins);
                    let way = Course::straight_from(begins);
                    return Ok(OnWay::start(way, begins.sees(last).x_m));
                }
                faces_ahead(shape, &vertices)?;
                let CorneredWay { way, stations_m } = CorneredWay::through(shape, &vertices)?;
                let ends_m = stations_m.last().copied().unwrap_or(0.0);
                Ok(OnWay::start(way, ends_m))
            }
            "Clothoid" => self.clothoid(shape, scope),
            "ClothoidSpline" => self.spline(shape, scope),
            other => {
                let help = "write a Polyline, a Clothoid or a ClothoidSpline";
                Err(shape.refused(format!("a way along a `{other}` is not read"), help))
            }
        }
    }

    /// Returns a path along one clothoid.
    fn clothoid(&self, shape: &XmlNode, scope: &ParameterScope) -> Result<OnWay, ImportError> {
        let begins = self.place(shape.inner("Position")?, scope)?.spot;
        // The attribute has had both names.
        let name = match shape.raw("curvaturePrime") {
            Some(_) => "curvaturePrime",
            None => "curvatureDot",
        };
        let (length_m, from_per_m) = (
            scope.number_in(shape, "length", LENGTHS_M)?,
            scope.number(shape, "curvature")?,
        );
        let spiral = Spiral {
            length_m,
            from_per_m,
            to_per_m: from_per_m + scope.number_or_zero(shape, name)? * length_m,
        };
        let arcs = spiral.arcs(0.0);
        let pieces = arcs.map_err(|what| shape.refused(what, WINDS))?;
        Ok(OnWay::start(course(shape, begins, &pieces)?, length_m))
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
                length_m: scope.number_in(segment, "length", LENGTHS_M)?,
                from_per_m: scope.number(segment, "curvatureStart")?,
                to_per_m: scope.number(segment, "curvatureEnd")?,
            };
            // A path of its own has no lanes beside it, so its arcs need no
            // margin.
            let arcs = spiral.arcs(0.0);
            pieces.extend(arcs.map_err(|what| segment.refused(what, WINDS))?);
        }
        let begins = begins.ok_or_else(|| {
            shape.refused("a way without pieces", "give it a `ClothoidSplineSegment`")
        })?;
        let lengths = pieces.iter().map(|piece: &Bend| piece.length_m);
        let mut ends_m: f64 = lengths.sum();
        let (mut start, mut along_m) = (begins.spot, 0.0);
        // A path that starts on a straight road is extended back to the start
        // of the road. Points that start elsewhere on the road then share a
        // world.
        let lane = begins.lane.as_ref().filter(|at| at.s_m > 0.0);
        if let Some((line, at)) = lane.and_then(|at| Some((self.roads.get(&at.road)?, at))) {
            let first = line.at(0.0, at.t_m);
            let is_on = line.is_straight() && is_along(first.sees(&start).heading_rad, 0.0);
            if let Some(piece) = pieces.first_mut().filter(|it| is_on && it.per_m == 0.0) {
                // The position and the end keep their places, so their stations
                // grow.
                along_m = first.sees(&start).x_m;
                piece.length_m += along_m;
                ends_m += along_m;
                start = first;
            }
        }
        // A path continues straight after its last piece, so a final line adds
        // nothing.
        while pieces.pop_if(|last| last.per_m == 0.0).is_some() {}
        Ok(OnWay {
            along_m,
            ..OnWay::start(course(shape, start, &pieces)?, ends_m)
        })
    }

    /// Returns the path of an action, and its places with times if it states them.
    ///
    /// Times are those from the begin of the action on, which is at `begins_s` of the run
    /// if that is known.
    pub(super) fn followed(
        &self,
        it: &XmlNode,
        scope: &ParameterScope,
        begins_s: Option<f64>,
    ) -> Result<(OnWay, Option<Vec<TimedPlace>>), ImportError> {
        let (trajectory, own) = self.trajectory(it.child("TrajectoryRef").unwrap_or(it), scope)?;
        let mut on = self.way(&trajectory, &own)?;
        let closed = own.is_true(&trajectory, "closed")?;
        // The run ends with the path if that has corners, before it begins again.
        if closed && !on.has_corners() {
            let help = "write closed=\"false\"";
            return Err(trajectory.refused("a trajectory that begins again is not read", help));
        }
        let offset_m = scope.number_or_zero(it, "initialDistanceOffset")?;
        on.move_on(it, offset_m)?;
        let timing = it.child("TimeReference").and_then(|it| it.child("Timing"));
        let Some(timing) = timing else {
            return Ok((on, None));
        };
        let shape = trajectory.inner("Shape")?.only()?;
        if shape.name != "Polyline" {
            let help = "write a polyline, or leave out the times";
            return Err(shape.refused("times along this shape are not read", help));
        }
        let mut places = Vec::new();
        for vertex in shape.all("Vertex") {
            let spot = self.place(vertex.inner("Position")?, &own)?.spot;
            places.push((own.number(vertex, "time")?, spot));
        }
        let spots: Vec<Pose> = places.iter().map(|(_, spot)| *spot).collect();
        let stations_m = CorneredWay::through(shape, &spots)?.stations_m;
        let times = places.iter().map(|(at_s, _)| *at_s);
        let timed: Vec<TimedPlace> = times.zip(stations_m).collect();
        if timed.windows(2).any(|pair| pair[1].0 <= pair[0].0) {
            let help = "let each place have a later time than the one before it";
            return Err(shape.refused("times that do not rise", help));
        }
        let scale = scope.number(timing, "scale")?;
        if scale <= 0.0 {
            return Err(timing.refused(format!("a scale of {scale}"), "write a scale above 0"));
        }
        let offset_s = scope.number_or_zero(timing, "offset")?;
        let is_relative = timing.raw("domainAbsoluteRelative") == Some("relative");
        let since_s = if is_relative {
            0.0
        } else {
            begins_s.ok_or_else(|| {
                let help = "write domainAbsoluteRelative=\"relative\"";
                let what = "times of the run, of a trajectory that waits for something";
                timing.refused(what, help)
            })?
        };
        // A distance cuts off the first part and its time, but no wait at the start.
        let first_s = timed.first().map_or(0.0, |it| it.0);
        let cut_at_s = if offset_m > 0.0 {
            at(&timed, offset_m, |it| (it.1, it.0))
        } else {
            first_s
        };
        // Times are scaled and then shifted, as those of trajectories in a story are.
        let played_s = |time_s: f64| scale * (time_s - (cut_at_s - first_s)) + offset_s - since_s;
        let from = (played_s(cut_at_s), offset_m);
        let played = timed.iter().map(|it| (played_s(it.0), it.1));
        let places: Vec<TimedPlace> = std::iter::once(from)
            .chain(played.filter(|it| it.0 > from.0))
            .collect();
        let begins_m = at(&places, 0.0, |it| it);
        let later = places.into_iter().filter(|it| it.0 > 0.0);
        let timed = std::iter::once((0.0, begins_m)).chain(later).collect();
        on.along_m = begins_m;
        Ok((on, Some(timed)))
    }
}

/// Value between places at a value of their other coordinate.
fn at(timed: &[TimedPlace], x: f64, of: impl Fn(TimedPlace) -> (f64, f64)) -> f64 {
    let mut pairs = timed
        .windows(2)
        .map(|pair| (of(pair[0]), of(pair[1])))
        // Half open, so that a value at a place belongs to one pair.
        .filter(|(from, to)| from.0 <= x && x < to.0);
    let ends = timed.first().zip(timed.last());
    match (pairs.next(), ends) {
        (Some((from, to)), _) => from.1 + (to.1 - from.1) * (x - from.0) / (to.0 - from.0),
        (None, Some((first, _))) if x < of(*first).0 => of(*first).1,
        (None, Some((_, last))) => of(*last).1,
        (None, None) => 0.0,
    }
}

/// Returns whether a vertex states the heading of its place.
pub(super) fn states_heading(vertex: &XmlNode) -> bool {
    let is_world = vertex.name == "WorldPosition" && vertex.raw("h").is_some();
    let is_turned = vertex.name == "Orientation" && vertex.raw("h").is_some();
    is_world || is_turned || vertex.children.iter().any(states_heading)
}

/// Refuses places at which an entity faces elsewhere than along the lines between them.
///
/// Between two places the heading of a file turns evenly, so short lines may differ.
fn faces_ahead(shape: &XmlNode, vertices: &[Pose]) -> Result<(), ImportError> {
    let stated: Vec<bool> = shape.all("Vertex").map(states_heading).collect();
    for (i, pair) in vertices.windows(2).enumerate() {
        let (dx, dy) = (pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
        let along_rad = libm::atan2(dy, dx);
        let ends = pair.iter().zip(&stated[i..]);
        let mut off = ends.filter(|(_, stated)| **stated);
        let is_off = off.any(|(at, _)| wrapped(at.heading_rad - along_rad).abs() > FACES_RAD);
        if is_off && libm::hypot(dx, dy) > SHORT_M {
            let help = "leave the headings of its places out, or let them face along the way";
            return Err(shape.refused("a way whose places face elsewhere is not read", help));
        }
    }
    Ok(())
}
