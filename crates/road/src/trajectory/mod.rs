//! Curves in the plane that agents follow: polylines, clothoids and NURBS.
//!
//! Each becomes a [`Course`] of lines and arcs, with stations for the headings and times
//! of its points. Polylines have corners, and other curves are within a millimetre of
//! their arcs.

mod nurbs;

use self::nurbs::Nurbs;
use crate::opendrive::curve::arcs_of;
pub use crate::opendrive::ways::Spiral;
use crate::opendrive::ways::WINDS;
use crate::pose::Pose;
use crate::road::{Bend, Course, CourseError, wrapped};

/// Greatest number of points, pieces or control points.
const MOST_POINTS: usize = 10_000;
/// Distance up to which two points are one place.
const SAME_M: f64 = 1e-6;
/// Distance from a corner within which a body turns, as in esmini.
const CORNER_M: f64 = 2.0;
/// Greatest angle to the curve that is no heading of its own.
const SAME_RAD: f64 = 1e-9;

/// Curve with a length, and what its points state.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryPath {
    /// The curve. It goes on straight before its start and behind its end.
    pub course: Course,
    /// Length of the curve, whose start has s = 0.
    pub length_m: f64,
    /// Headings of the body in the world, by station. Empty: along the curve.
    pub headings_rad: Vec<AtStation>,
    /// Times, by station. Empty without times. Stations never fall, and times rise.
    pub times_s: Vec<AtStation>,
}

/// Value at a station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtStation {
    /// Station.
    pub s_m: f64,
    /// Value.
    pub value: f64,
}

/// Point of a polyline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// Place in the world.
    pub at_m: [f64; 2],
    /// Heading of the body in the world. `None`: along the line.
    pub heading_rad: Option<f64>,
    /// Time.
    pub time_s: Option<f64>,
}

/// Headings of a body on a polyline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolylineTurn {
    /// Turns within 2 m of a corner.
    AtCorners,
    /// Turns evenly between two points.
    AlongLines,
}

/// Piece of a clothoid spline, and the time at its end.
#[derive(Clone, Copy, Debug)]
pub struct TimedSpiral {
    /// The piece.
    pub spiral: Spiral,
    /// Time at its end.
    pub ends_s: Option<f64>,
}

/// Point that controls a NURBS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NurbsPoint {
    /// Place in the world.
    pub at_m: [f64; 2],
    /// Weight, above 0.
    pub weight: f64,
    /// Time at which its influence is greatest.
    pub time_s: Option<f64>,
}

impl TrajectoryPath {
    /// Returns the straight lines through points.
    ///
    /// # Errors
    ///
    /// Returns an error for points in one place, and for times that do not rise.
    pub fn polyline(
        points: &[PathPoint],
        turn: PolylineTurn,
    ) -> Result<TrajectoryPath, CourseError> {
        bounded(points.len())?;
        // Points in one place share a station: there the body stands.
        let mut places_m: Vec<[f64; 2]> = Vec::new();
        let mut stations_m = Vec::new();
        for point in points {
            let last = places_m.last().copied();
            let away_m = last.map_or(f64::INFINITY, |last| apart_m(last, point.at_m));
            if away_m > SAME_M {
                places_m.push(point.at_m);
            }
            let before_m = stations_m.last().copied().unwrap_or(0.0);
            let step_m = if last.is_some() && away_m > SAME_M {
                away_m
            } else {
                0.0
            };
            stations_m.push(before_m + step_m);
        }
        let course = Course::of_lines(&places_m)?;
        let times = points.iter().map(|point| point.time_s);
        Ok(TrajectoryPath {
            length_m: course.end_s_m(),
            times_s: times_of(&stations_m, times)?,
            headings_rad: polyline_headings(&course, points, &stations_m, turn),
            course,
        })
    }

    /// Returns pieces whose curvature changes evenly, each from the end of the last.
    ///
    /// # Errors
    ///
    /// Returns an error for no pieces, for one without a length or that winds up, and
    /// for times that do not rise.
    pub fn clothoids(
        begins: Pose,
        begins_s: Option<f64>,
        pieces: &[TimedSpiral],
    ) -> Result<TrajectoryPath, CourseError> {
        bounded(pieces.len() + 1)?;
        let mut bends: Vec<Bend> = Vec::new();
        let mut stations_m = vec![0.0];
        for (i, piece) in pieces.iter().enumerate() {
            let arcs = piece.spiral.arcs(0.0);
            bends.extend(arcs.map_err(|what| CourseError {
                what,
                help: WINDS.to_owned(),
                index: Some(i),
            })?);
            stations_m.push(stations_m[i] + piece.spiral.length_m);
        }
        bounded(bends.len() + 1)?;
        let ends = pieces.iter().map(|piece| piece.ends_s);
        let times = core::iter::once(begins_s).chain(ends);
        Ok(TrajectoryPath {
            length_m: stations_m[pieces.len()],
            times_s: times_of(&stations_m, times)?,
            headings_rad: Vec::new(),
            course: Course::of_bends(begins, &bends)?,
        })
    }

    /// Returns a non-uniform rational B-spline.
    ///
    /// # Errors
    ///
    /// Returns an error for knots, weights or an order that define no curve, for a curve
    /// without a length, and for times that do not rise.
    pub fn nurbs(
        order: usize,
        knots: &[f64],
        points: &[NurbsPoint],
    ) -> Result<TrajectoryPath, CourseError> {
        bounded(points.len())?;
        let weighed: Vec<[f64; 3]> = points
            .iter()
            .map(|point| [point.at_m[0], point.at_m[1], point.weight])
            .collect();
        let curve = Nurbs::new(order, knots, &weighed)?;
        let at = |s_m: f64| curve.at(s_m);
        let arcs = arcs_of(curve.as_plane_curve(&at), 0.0).map_err(|what| CourseError {
            what,
            help: WINDS.to_owned(),
            index: None,
        })?;
        let bends: Vec<Bend> = arcs.iter().map(|arc| arc.bend).collect();
        let Some(first) = arcs.first() else {
            return Err(no_length());
        };
        let stations_m: Vec<f64> = (0..points.len()).map(|i| curve.station_m(i)).collect();
        let times = points.iter().map(|point| point.time_s);
        let course = Course::of_bends(first.start, &bends)?;
        Ok(TrajectoryPath {
            length_m: course.end_s_m(),
            times_s: times_of(&stations_m, times)?,
            headings_rad: Vec::new(),
            course,
        })
    }

    /// Returns the heading of the body at a station, relative to the curve.
    pub fn turned_rad(&self, s_m: f64) -> f64 {
        if self.headings_rad.is_empty() {
            return 0.0;
        }
        let heading_rad = interpolated(&self.headings_rad, s_m);
        wrapped(heading_rad - self.course.pose(s_m, 0.0).heading_rad)
    }
}

/// Returns the value between two stations, or that of the nearest end.
///
/// At a station with several values it is the last of them. 0 without any.
fn interpolated(all: &[AtStation], s_m: f64) -> f64 {
    let after = all.partition_point(|it| it.s_m <= s_m);
    match (after.checked_sub(1).map(|i| all[i]), all.get(after)) {
        (Some(a), Some(b)) => a.value + (b.value - a.value) * (s_m - a.s_m) / (b.s_m - a.s_m),
        (Some(end), None) => end.value,
        (None, end) => end.map_or(0.0, |end| end.value),
    }
}

fn apart_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

fn no_length() -> CourseError {
    CourseError {
        what: "a curve that leads nowhere".to_owned(),
        help: "set its points apart".to_owned(),
        index: None,
    }
}

fn bounded(points: usize) -> Result<(), CourseError> {
    match points {
        0 | 1 => Err(no_length()),
        2..=MOST_POINTS => Ok(()),
        _ => Err(CourseError {
            what: format!("a curve of {points} points"),
            help: format!("write at most {MOST_POINTS}"),
            index: None,
        }),
    }
}

/// Returns the times that are stated, of which the first and the last point need one.
fn times_of(
    stations_m: &[f64],
    times: impl Iterator<Item = Option<f64>>,
) -> Result<Vec<AtStation>, CourseError> {
    let all = stations_m.iter().zip(times).enumerate();
    let mut stated: Vec<(usize, AtStation)> = all
        .filter_map(|(i, (s_m, time_s))| {
            let value = time_s?;
            Some((i, AtStation { s_m: *s_m, value }))
        })
        .collect();
    let ends = [Some(0), stations_m.len().checked_sub(1)];
    let found = [stated.first(), stated.last()].map(|it| it.map(|(i, _)| *i));
    let wrong = |what: String, help: &str, index: usize| CourseError {
        what,
        help: help.to_owned(),
        index: Some(index),
    };
    if !stated.is_empty() && found != ends {
        let missing = if found[0] == ends[0] {
            ends[1]
        } else {
            ends[0]
        };
        let what = "a curve with times that does not begin and end with one".to_owned();
        let help = "give its first and its last point a time";
        return Err(wrong(what, help, missing.unwrap_or(0)));
    }
    // A point that is written twice is one.
    stated.dedup_by(|after, before| after.1 == before.1);
    if let Some(pair) = stated.windows(2).find(|it| it[1].1.value <= it[0].1.value) {
        let [(_, before), (i, after)] = [pair[0], pair[1]];
        let what = format!(
            "a time of {} s after one of {} s",
            after.value, before.value
        );
        return Err(wrong(what, "let times rise from point to point", i));
    }
    Ok(stated.into_iter().map(|(_, it)| it).collect())
}

/// Returns the headings on a polyline, or none if they are those of its lines.
fn polyline_headings(
    course: &Course,
    points: &[PathPoint],
    stations_m: &[f64],
    turn: PolylineTurn,
) -> Vec<AtStation> {
    let last = course.end_s_m();
    let mut all: Vec<AtStation> = Vec::new();
    let mut add = |s_m: f64, heading_rad: f64| {
        let before_rad = all.last().map_or(heading_rad, |it| it.value);
        let value = before_rad + wrapped(heading_rad - before_rad);
        all.push(AtStation { s_m, value });
    };
    // Of several points in one place the last is that of the line ahead.
    let numbers = (0..points.len()).filter(|i| stations_m.get(i + 1) != Some(&stations_m[*i]));
    let vertices: Vec<AtStation> = numbers
        .map(|i| {
            let s_m = stations_m[i];
            // The last one lies at the end of a line, behind which the course goes on.
            let along_rad = course.pose(s_m, 0.0).heading_rad;
            AtStation {
                s_m,
                value: points[i].heading_rad.unwrap_or(along_rad),
            }
        })
        .collect();
    for (i, vertex) in vertices.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| vertices[i]);
        match (turn, before) {
            (PolylineTurn::AtCorners, Some(before)) => {
                add(
                    vertex.s_m - CORNER_M.min(0.5 * (vertex.s_m - before.s_m)),
                    before.value,
                );
                if let Some(after) = vertices.get(i + 1) {
                    let turn_rad = wrapped(vertex.value - before.value);
                    add(vertex.s_m, before.value + 0.5 * turn_rad);
                    add(
                        vertex.s_m + CORNER_M.min(0.5 * (after.s_m - vertex.s_m)),
                        vertex.value,
                    );
                } else {
                    add(last, vertex.value);
                }
            }
            _ => add(vertex.s_m, vertex.value),
        }
    }
    let is_along =
        |it: &AtStation| wrapped(it.value - course.pose(it.s_m, 0.0).heading_rad).abs() <= SAME_RAD;
    let is_straight = all.windows(2).all(|pair| pair[0].value == pair[1].value);
    if is_straight && all.iter().all(is_along) {
        all.clear();
    }
    all
}

#[cfg(test)]
mod tests;
