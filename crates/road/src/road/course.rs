//! The course of a road: lines and arcs, and Frenet coordinates along them.
//!
//! On a straight road s and lateral are x and y themselves, bit for bit.

use core::f64::consts::PI;
use core::ops::Range;

use self::leg::Leg;
use self::leg_index::LegIndex;
use super::on_road::{OnRoad, wrapped};
use super::piece::{Bend, Piece, RoadPiece};
use crate::pose::Pose;

/// Error: the course of a road is infeasible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what}")]
pub struct CourseError {
    /// Description of the problem.
    pub what: String,
    /// Advice on how to fix it.
    pub help: String,
    /// Index of the piece or point, or `None` if the error concerns all of them.
    pub index: Option<usize>,
}

/// The course of lane 0. Without legs it is world x itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    legs: Vec<Leg>,
    /// Places of the legs, so that a search skips most of them.
    index: LegIndex,
}

/// Up to this number of legs, all are searched: skipping costs more than it saves.
const FEW_LEGS: usize = 8;

/// Tolerance of the search radius, which covers rounding of distances.
///
/// The distance to an arc is rounded by the 16th digit of its radius.
const SAME_M: f64 = 1e-3;

/// Length of straight road before the first and behind the last piece.
pub(crate) const RUN_OUT_M: f64 = 10_000.0;
const RUN_OUT: Bend = Bend {
    length_m: RUN_OUT_M,
    per_m: 0.0,
};
/// Greatest turn of a piece: 30 full circles.
pub const MOST_WINDS_RAD: f64 = 200.0;
/// Distance between the points with which borders are drawn on arcs.
const DRAWN_M: f64 = 2.0;
/// Length of border drawn before and behind the used part of a road.
const DRAWN_BEYOND_M: f64 = 100.0;

impl Course {
    /// Returns a straight road along world x, without end.
    pub fn straight() -> Course {
        Course::default()
    }

    pub(crate) fn of_pieces(pieces: &[Piece], reach_m: f64) -> Result<Course, CourseError> {
        if pieces.is_empty() {
            return Err(CourseError {
                what: "a curved road without pieces".to_owned(),
                help: "write `Line(length_m: …)` or `Arc(length_m: …, radius_m: …)`".to_owned(),
                index: None,
            });
        }
        Course::begin(Pose::default()).laid(pieces, reach_m)
    }

    /// Returns a road that begins at a given place. Without pieces it is straight.
    pub(crate) fn placed(
        begins: Pose,
        pieces: &[Piece],
        reach_m: f64,
    ) -> Result<Course, CourseError> {
        Course::begin(begins).laid(pieces, reach_m)
    }

    /// Returns a straight road that begins at a place, to the bit.
    pub fn straight_from(begins: Pose) -> Course {
        let mut course = Course::begin(begins);
        course.append_from(begins, RUN_OUT);
        course
    }

    /// Returns a road of pieces of any turn that begins at a place, to the bit.
    ///
    /// # Errors
    ///
    /// Returns an error for a piece without a length, and for one that winds up.
    pub fn of_bends(begins: Pose, bends: &[Bend]) -> Result<Course, CourseError> {
        let mut course = Course::begin(begins);
        let mut start = begins;
        for (i, bend) in bends.iter().enumerate() {
            let (length_m, turn_rad) = (bend.length_m, bend.turn_rad());
            // Also refuses what is no number. The turn bounds the number of parts.
            let is_piece = length_m > 0.0 && turn_rad <= MOST_WINDS_RAD;
            if !is_piece {
                return Err(CourseError {
                    what: format!("a piece of {length_m} m that turns by {turn_rad} rad"),
                    help: format!("lengths are above 0, and turns up to {MOST_WINDS_RAD} rad"),
                    index: Some(i),
                });
            }
            for part in bend.parts() {
                start = course.append_from(start, part);
            }
        }
        course.append_from(start, RUN_OUT);
        Ok(course)
    }

    /// Returns straight lines through points, with corners between them.
    ///
    /// # Errors
    ///
    /// Returns an error for fewer than two points, and for two in one place.
    pub fn of_lines(points_m: &[[f64; 2]]) -> Result<Course, CourseError> {
        let mut course: Option<Course> = None;
        for (i, pair) in points_m.windows(2).enumerate() {
            // Each line begins at its own point, so that no rounding adds up along the curve.
            let [from, to] = [pair[0], pair[1]];
            let (dx_m, dy_m) = (to[0] - from[0], to[1] - from[1]);
            let length_m = libm::hypot(dx_m, dy_m);
            // Also refuses what is no number.
            let is_line = length_m > 0.0;
            if !is_line {
                return Err(CourseError {
                    what: format!("a line of {length_m} m"),
                    help: "set its points apart".to_owned(),
                    index: Some(i),
                });
            }
            let begins = Pose {
                x_m: from[0],
                y_m: from[1],
                heading_rad: libm::atan2(dy_m, dx_m),
            };
            let course = course.get_or_insert_with(|| Course::begin(begins));
            let line = Bend {
                length_m,
                per_m: 0.0,
            };
            // Not behind the last line: its direction turns at the point without an arc.
            course.append_from(begins, line);
        }
        let mut course = course.ok_or_else(|| CourseError {
            what: format!("a curve of {} points", points_m.len()),
            help: "write at least two points".to_owned(),
            index: None,
        })?;
        course.append(RUN_OUT);
        Ok(course)
    }

    /// Appends the pieces and the straight run-out.
    fn laid(self, pieces: &[Piece], reach_m: f64) -> Result<Course, CourseError> {
        let mut course = self;
        for (i, piece) in pieces.iter().enumerate() {
            if let Piece::Arc { radius_m, .. } = piece
                && radius_m.abs() <= reach_m
            {
                return Err(CourseError {
                    what: format!("a radius of {radius_m} m folds the lanes over"),
                    help: format!("it must exceed {reach_m} m, the width of the road"),
                    index: Some(i),
                });
            }
            let bend = Bend::from(*piece);
            // Beyond half a circle, `Leg::locate` (an atan2) would no longer be
            // unique.
            if bend.length_m <= 0.0 || bend.turn_rad() > PI {
                return Err(CourseError {
                    what: format!("a piece of {} m", bend.length_m),
                    help: "lengths are above 0, and an arc turns by half a circle at most"
                        .to_owned(),
                    index: Some(i),
                });
            }
            course.append(bend);
        }
        course.append(RUN_OUT);
        Ok(course)
    }

    pub(crate) fn of_points(
        points_m: &[(f64, f64)],
        radius_m: f64,
        reach_m: f64,
    ) -> Result<Course, CourseError> {
        let fail = |what: String, help: &str, index| CourseError {
            what,
            help: help.to_owned(),
            index,
        };
        if points_m.len() < 2 {
            let what = format!("a polyline of {} points", points_m.len());
            return Err(fail(what, "it takes at least two points", None));
        }
        if radius_m <= reach_m {
            let what = format!("corners of {radius_m} m fold the lanes over");
            let help = format!("the radius must exceed {reach_m} m, the width of the road");
            return Err(fail(what, &help, None));
        }
        let sides: Vec<(f64, f64)> = points_m
            .windows(2)
            .map(|pair| {
                let (dx, dy) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
                ((dx * dx + dy * dy).sqrt(), libm::atan2(dy, dx))
            })
            .collect();
        let mut course = Course::begin(Pose {
            x_m: points_m[0].0,
            y_m: points_m[0].1,
            heading_rad: sides[0].1,
        });
        let mut cut_m = 0.0;
        for (i, &(length_m, heading_rad)) in sides.iter().enumerate() {
            let turn_rad = match sides.get(i + 1) {
                Some((_, next_rad)) => wrapped(next_rad - heading_rad),
                None => 0.0,
            };
            // A fillet takes r·tan(turn/2) from both of its sides.
            let next_cut_m = radius_m * libm::tan(0.5 * turn_rad.abs());
            // Near 180° the tangent diverges. The limit of 0.9 π also rejects
            // points that turn back on themselves.
            if 0.9 * PI < turn_rad.abs() || length_m <= cut_m + next_cut_m {
                let what = format!("the corner after point {i} does not fit");
                let help = "move the points apart, or make the corners' radius smaller";
                return Err(fail(what, help, Some(i)));
            }
            course.append(Bend {
                length_m: length_m - cut_m - next_cut_m,
                per_m: 0.0,
            });
            if turn_rad != 0.0 {
                course.append(Bend {
                    length_m: radius_m * turn_rad.abs(),
                    per_m: turn_rad.signum() / radius_m,
                });
            }
            // The fillet shortens the next side as well.
            cut_m = next_cut_m;
        }
        course.append(RUN_OUT);
        Ok(course)
    }

    /// Begins with the straight run-in, so that s = 0 is at a place.
    fn begin(origin: Pose) -> Course {
        // The run-in, on which agents are that start behind the beginning of the road.
        let first = Leg::new(-RUN_OUT_M, origin.ahead(-RUN_OUT_M), RUN_OUT);
        Course {
            index: LegIndex::of(first.bounds(), first.disc()),
            legs: vec![first],
        }
    }

    /// Appends a piece where the last leg ends.
    ///
    /// The first one so begins behind the run-in, with the rounding of its 10 km, which
    /// recorded episodes contain.
    fn append(&mut self, bend: Bend) {
        if let Some(last) = self.legs.last() {
            self.append_from(last.end(), bend);
        }
    }

    /// Appends a piece that begins at a place, and returns its end.
    fn append_from(&mut self, start: Pose, bend: Bend) -> Pose {
        let ends_s_m = self
            .legs
            .last()
            .map_or(0.0, |last| last.from_s_m + last.length_m);
        let leg = Leg::new(ends_s_m, start, bend);
        self.index.push(leg.bounds(), leg.disc());
        self.legs.push(leg);
        leg.end()
    }

    /// Returns the pose at which s = 0.
    pub fn start(&self) -> Pose {
        // The first leg is the run-in.
        self.legs.get(1).map_or(Pose::default(), |leg| leg.start)
    }

    /// Returns the pieces in order, without the straight ends.
    ///
    /// Empty on a road that is straight throughout.
    pub fn pieces(&self) -> Vec<RoadPiece> {
        // Without the run-in and the run-out, which no file states.
        let last = self.legs.len().saturating_sub(1);
        let between = self.legs.iter().take(last).skip(1);
        let piece = |leg: &Leg| RoadPiece {
            from_s_m: leg.from_s_m,
            length_m: leg.length_m,
            curvature_per_m: leg.curvature_per_m,
        };
        between.map(piece).collect()
    }

    /// Returns the pieces in order, without their stations.
    pub fn bends(&self) -> Vec<Bend> {
        let bend = |piece: RoadPiece| Bend {
            length_m: piece.length_m,
            per_m: piece.curvature_per_m,
        };
        self.pieces().into_iter().map(bend).collect()
    }

    /// Returns the sum of the turns of its pieces, in either direction.
    pub fn turned_rad(&self) -> f64 {
        self.bends().iter().map(Bend::turn_rad).sum()
    }

    /// Returns the road coordinates of a pose, at the nearest point of the course.
    #[inline]
    pub fn locate(&self, pose: &Pose) -> OnRoad {
        // The most common road, and a search takes longer than the answer.
        if self.legs.is_empty() {
            return OnRoad {
                s_m: pose.x_m,
                lateral_m: pose.y_m,
                heading_rad: pose.heading_rad,
                curvature_per_m: 0.0,
            };
        }
        self.locate_on_legs(pose)
    }

    fn locate_on_legs(&self, pose: &Pose) -> OnRoad {
        self.nearest(pose).1
    }

    /// Returns the greatest curvature of its pieces, in either direction.
    pub fn most_curvature_per_m(&self) -> f64 {
        let legs = self.legs.iter();
        legs.fold(0.0, |most, leg| most.max(leg.curvature_per_m.abs()))
    }

    /// Returns the last leg that has begun at a station.
    fn begun(&self, s_m: f64) -> Option<&Leg> {
        // Stations grow along the legs, so bisection finds the last one begun.
        let begun = self.legs.partition_point(|leg| leg.from_s_m <= s_m);
        self.legs.get(begun.checked_sub(1)?)
    }

    /// Returns the curvature at a station, positive to the left.
    pub fn curvature_per_m(&self, s_m: f64) -> f64 {
        self.begun(s_m).map_or(0.0, |leg| leg.curvature_per_m)
    }

    /// Returns the mean curvature over a distance from a station.
    pub fn mean_curvature_per_m(&self, s_m: f64, way_m: f64) -> f64 {
        // Too short a way for a quotient of two rounded angles.
        if way_m.abs() < 1e-6 {
            return self.curvature_per_m(s_m);
        }
        let heading_rad = |s_m| self.pose(s_m, 0.0).heading_rad;
        // Wrapped, because headings jump by a full turn on a circle.
        wrapped(heading_rad(s_m + way_m) - heading_rad(s_m)) / way_m
    }

    /// Returns the curvatures of the last piece and of the piece before it.
    ///
    /// 0 where there is no such piece, because the road is straight there.
    pub fn last_curvatures_per_m(&self) -> [f64; 2] {
        // The last leg is the straight end of the road.
        let mut legs = self.legs.iter().rev().skip(1);
        let mut next = || legs.next().map_or(0.0, |leg| leg.curvature_per_m);
        [next(), next()]
    }

    /// Returns the number of pieces, without the straight ends.
    pub fn piece_count(&self) -> usize {
        self.legs.len().saturating_sub(2)
    }

    /// Returns the station at which the pieces end, 0 without pieces.
    pub fn end_s_m(&self) -> f64 {
        self.legs.last().map_or(0.0, |last| last.from_s_m)
    }

    /// Returns the pose of an agent that drives along the course.
    pub fn pose(&self, s_m: f64, lateral_m: f64) -> Pose {
        match self.begun(s_m).or(self.legs.first()) {
            Some(leg) => leg.pose(s_m - leg.from_s_m, lateral_m),
            None => Pose {
                x_m: s_m,
                y_m: lateral_m,
                heading_rad: 0.0,
            },
        }
    }

    /// Returns a line beside the course, as a polyline on the ground.
    ///
    /// It covers all pieces and the given interval, and 100 m beyond.
    pub fn polyline_m(&self, lateral_m: f64, used_m: Range<f64>) -> Vec<[f64; 3]> {
        let point = |s_m: f64| {
            let pose = self.pose(s_m, lateral_m);
            [pose.x_m, pose.y_m, 0.0]
        };
        let mut stations_m = vec![used_m.start.min(0.0) - DRAWN_BEYOND_M];
        // The run-in has negative s and is covered by the first station.
        for leg in self.legs.iter().filter(|leg| leg.from_s_m >= 0.0) {
            // A line is drawn by its ends alone.
            let points = if leg.curvature_per_m == 0.0 {
                1
            } else {
                (leg.length_m / DRAWN_M).ceil() as usize
            };
            let step_m = leg.length_m / points as f64;
            stations_m.extend((0..points).map(|i| leg.from_s_m + i as f64 * step_m));
        }
        stations_m.push(self.end_s_m().max(used_m.end) + DRAWN_BEYOND_M);
        stations_m.into_iter().map(point).collect()
    }
}

impl Course {
    /// Returns the distance to the course and the coordinates at its nearest point.
    pub(super) fn nearest(&self, pose: &Pose) -> (f64, OnRoad) {
        let mut nearest: Option<(f64, OnRoad)> = None;
        if self.legs.len() <= FEW_LEGS {
            for leg in &self.legs {
                keep_nearer(&mut nearest, leg.locate(pose));
            }
        } else {
            self.search(pose, &mut nearest);
        }
        match (nearest, self.legs.first()) {
            (Some(found), _) => found,
            // A pose that is no number is near no leg, and any of them says so.
            (None, Some(leg)) => leg.locate(pose),
            // Without legs, the road is world x.
            (None, None) => (pose.y_m.abs(), self.locate(pose)),
        }
    }

    /// Searches the legs that may be nearer than a guess, in their order.
    fn search(&self, pose: &Pose, nearest: &mut Option<(f64, OnRoad)>) {
        let number = self.index.guess(pose);
        let (away_m, at) = self.legs[number].locate(pose);
        // No leg beyond this distance is nearer than the guess.
        let within_m = away_m + SAME_M;
        for leg in self.index.within(within_m, pose, number) {
            if leg == number {
                keep_nearer(nearest, (away_m, at));
            } else {
                keep_nearer(nearest, self.legs[leg].locate(pose));
            }
        }
    }
}

/// Keeps the nearer of two, and the earlier of two equally near ones.
fn keep_nearer(nearest: &mut Option<(f64, OnRoad)>, found: (f64, OnRoad)) {
    // Strict, so that of equally near legs the first one answers, in a search as without.
    if nearest.as_ref().is_none_or(|(best_m, _)| found.0 < *best_m) {
        *nearest = Some(found);
    }
}

mod leg;
mod leg_index;
#[cfg(test)]
mod tests;
