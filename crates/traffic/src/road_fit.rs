//! Roads of lines and arcs, fitted to points.

use std::fmt::Write;

use crate::path::Path;
use crate::plan::{rounded, solved};
use crate::raw::wrapped;

/// Least distance of the points that are fitted.
const POINT_M: f64 = 0.5;
/// Curvature below which a piece is a line.
const LINE_PER_M: f64 = 2.0e-6;
/// Steps of the Gauss-Newton method.
const STEPS: usize = 12;
/// Weight against differences of neighbouring curvatures, which damps noise.
const SMOOTH_M2: f64 = 0.05;

/// Accuracy and size of a fitted road.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoadFit {
    /// Distance from the points with which a road of fewer pieces is enough.
    pub(crate) tolerance_m: f64,
    /// Least length of a piece.
    pub(crate) piece_m: f64,
    /// Greatest number of pieces.
    pub(crate) most_pieces: usize,
    /// Curvature that no piece may have.
    pub(crate) most_per_m: f64,
}

/// Piece of a fitted road.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FittedPiece {
    /// Length in metres.
    pub length_m: f64,
    /// Curvature in 1/m, positive to the left and 0 on a line.
    pub curvature_per_m: f64,
}

/// Road without kinks through recorded points: a start and pieces of constant curvature.
///
/// It is straight before its start and after its last piece.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FittedRoad {
    /// Start in metres of the recording's frame.
    pub start_m: [f64; 2],
    /// Direction at the start.
    pub heading_rad: f64,
    /// Pieces in order, empty for a straight road.
    pub pieces: Vec<FittedPiece>,
    /// Greatest distance of a point from the road in metres.
    pub worst_m: f64,
}

/// Place on a road, with the direction there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoadPose {
    pub(crate) point_m: [f64; 2],
    pub(crate) heading_rad: f64,
}

impl RoadPose {
    fn after(self, way_m: f64, curvature_per_m: f64) -> RoadPose {
        let turn_rad = way_m * curvature_per_m;
        // Chord of the arc, at half of its turn.
        let half_rad = 0.5 * turn_rad;
        // The quotient is undefined at 0, where its limit is 1.
        let chord_m = if half_rad.abs() < 1e-6 {
            way_m
        } else {
            way_m * libm::sin(half_rad) / half_rad
        };
        let (sin, cos) = libm::sincos(self.heading_rad + half_rad);
        let [x, y] = self.point_m;
        RoadPose {
            point_m: [x + chord_m * cos, y + chord_m * sin],
            heading_rad: self.heading_rad + turn_rad,
        }
    }

    /// Returns how far a point is ahead and to the left.
    pub(crate) fn relative_m(&self, point_m: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.heading_rad);
        let [dx, dy] = [0, 1].map(|axis| point_m[axis] - self.point_m[axis]);
        [cos * dx + sin * dy, cos * dy - sin * dx]
    }
}

impl FittedRoad {
    /// Fits the fewest pieces that are near enough, or the most that are allowed.
    ///
    /// Returns `None` for fewer than two points that are 0.5 m apart, and if the road
    /// would turn too sharply.
    pub(crate) fn fit(points_m: &[[f64; 2]], how: RoadFit) -> Option<FittedRoad> {
        let path = Path::through(points_m.iter().copied(), POINT_M)?;
        let most = ((path.length_m() / how.piece_m) as usize).clamp(1, how.most_pieces);
        let mut pieces = 0;
        loop {
            let road = FittedRoad::of_pieces(&path, pieces);
            if road.worst_m <= how.tolerance_m || most <= pieces {
                let sharpest = |it: &FittedPiece| it.curvature_per_m.abs();
                let is_sharp = |it: &FittedPiece| how.most_per_m <= sharpest(it);
                return (!road.pieces.iter().any(is_sharp)).then_some(road);
            }
            pieces = (2 * pieces).max(1).min(most);
        }
    }

    /// Returns a straight road.
    pub(crate) fn straight(start_m: [f64; 2], heading_rad: f64) -> FittedRoad {
        FittedRoad {
            start_m,
            heading_rad,
            pieces: Vec::new(),
            worst_m: 0.0,
        }
    }

    fn of_pieces(path: &Path, pieces: usize) -> FittedRoad {
        let mut road = FittedRoad::first_guess(path, pieces);
        let points: Vec<[f64; 2]> = path.points().map(|(point, _)| point).collect();
        for _ in 0..STEPS {
            let stations = road.places(&points);
            let Some(change) = road.change(&points, &stations) else {
                break;
            };
            road.add(&change);
            if change.iter().all(|it| it.abs() < 1e-9) {
                break;
            }
        }
        // Rounded first, so that the distance is that of the written road.
        road.round();
        let off = |point: &[f64; 2]| road.place(*point).1.abs();
        road.worst_m = points.iter().map(off).fold(0.0, f64::max);
        road
    }

    /// Returns a road with the courses of the path between its pieces.
    fn first_guess(path: &Path, pieces: usize) -> FittedRoad {
        let count = pieces.max(1);
        let length_m = path.length_m() / count as f64;
        let mut points = path.points().peekable();
        let mut stations = Vec::new();
        for k in 0..=count {
            // The tolerance finds the last point, whose station is a sum.
            let want_m = k as f64 * length_m - 1e-6;
            while points.peek().is_some_and(|(_, s)| *s < want_m) {
                points.next();
            }
            stations.extend(points.peek().map(|(point, _)| *point));
        }
        let chord = |a: [f64; 2], b: [f64; 2]| libm::atan2(b[1] - a[1], b[0] - a[0]);
        let courses: Vec<f64> = stations
            .windows(2)
            .map(|pair| chord(pair[0], pair[1]))
            .collect();
        let turns = |k: usize| match (courses.get(k.saturating_sub(1)), courses.get(k + 1)) {
            (Some(before), Some(after)) => {
                let pieces = if k == 0 { 1.0 } else { 2.0 };
                wrapped(after - before) / (pieces * length_m)
            }
            _ => 0.0,
        };
        FittedRoad {
            start_m: stations.first().copied().unwrap_or_default(),
            heading_rad: courses.first().copied().unwrap_or_default(),
            pieces: (0..pieces)
                .map(|k| FittedPiece {
                    length_m,
                    curvature_per_m: turns(k),
                })
                .collect(),
            worst_m: 0.0,
        }
    }

    /// Returns the poses at the starts of the pieces and at the end.
    fn joints(&self) -> Vec<RoadPose> {
        let mut pose = RoadPose {
            point_m: self.start_m,
            heading_rad: self.heading_rad,
        };
        let mut all = vec![pose];
        for piece in &self.pieces {
            pose = pose.after(piece.length_m, piece.curvature_per_m);
            all.push(pose);
        }
        all
    }

    /// Returns the pose at a station.
    pub(crate) fn pose(&self, s_m: f64) -> RoadPose {
        self.pose_from(&self.joints(), s_m)
    }

    fn pose_from(&self, joints: &[RoadPose], s_m: f64) -> RoadPose {
        let mut left_m = s_m;
        for (k, piece) in self.pieces.iter().enumerate() {
            if left_m < piece.length_m {
                // The road is straight before its start.
                let curvature = if s_m < 0.0 {
                    0.0
                } else {
                    piece.curvature_per_m
                };
                return joints[k].after(left_m, curvature);
            }
            left_m -= piece.length_m;
        }
        joints[joints.len() - 1].after(left_m, 0.0)
    }

    /// Returns the station of a point and its offset to the left.
    pub(crate) fn place(&self, point_m: [f64; 2]) -> (f64, f64) {
        let joints = self.joints();
        let far = |pose: &RoadPose| {
            let [x, y] = pose.relative_m(point_m);
            x * x + y * y
        };
        // The search finds a near place only, so it begins at the nearest joint.
        let nearest =
            (0..joints.len()).min_by(|a, b| far(&joints[*a]).total_cmp(&far(&joints[*b])));
        let length_m = self.pieces.first().map_or(0.0, |it| it.length_m);
        let s_m = nearest.unwrap_or(0) as f64 * length_m;
        self.place_near(&joints, point_m, s_m)
    }

    /// Returns the place of a point, searched from a station.
    fn place_near(&self, joints: &[RoadPose], point_m: [f64; 2], from_m: f64) -> (f64, f64) {
        let mut s_m = from_m;
        let mut left_m = 0.0;
        // Each step is exact on a line, and nearly so on an arc.
        for _ in 0..20 {
            let [ahead_m, beside_m] = self.pose_from(joints, s_m).relative_m(point_m);
            s_m += ahead_m;
            left_m = beside_m;
            if ahead_m.abs() < 1e-9 {
                break;
            }
        }
        (s_m, left_m)
    }

    /// Returns the places of points along the road, each searched from the last one.
    pub(crate) fn places(&self, points: &[[f64; 2]]) -> Vec<(f64, f64)> {
        let joints = self.joints();
        let mut s_m = points.first().map_or(0.0, |point| self.place(*point).0);
        let place = points.iter().map(|point| {
            let place = self.place_near(&joints, *point, s_m);
            s_m = place.0;
            place
        });
        place.collect()
    }

    /// Returns a step of Gauss-Newton: to the left at the start, turn, curvatures.
    fn change(&self, points: &[[f64; 2]], stations: &[(f64, f64)]) -> Option<Vec<f64>> {
        let n = self.pieces.len() + 2;
        let joints = self.joints();
        let length_m = self.pieces.first().map_or(0.0, |it| it.length_m);
        let (mut matrix, mut right) = (vec![vec![0.0; n]; n], vec![0.0; n]);
        let normal = RoadPose {
            point_m: [0.0; 2],
            heading_rad: self.heading_rad,
        };
        for (_, (s_m, left_m)) in points.iter().zip(stations) {
            let at = self.pose_from(&joints, *s_m);
            let along = |from_m: [f64; 2]| -at.relative_m(from_m)[0];
            let mut row = vec![0.0; n];
            let turned_rad = at.heading_rad - normal.heading_rad;
            row[0] = libm::cos(turned_rad);
            row[1] = along(self.start_m);
            for k in 0..self.pieces.len() {
                // The part of the piece before the point turns all that follows it.
                let from_m = k as f64 * length_m;
                let way_m = (s_m - from_m).min(length_m);
                if way_m <= 0.0 {
                    break;
                }
                let middle = joints[k].after(0.5 * way_m, self.pieces[k].curvature_per_m);
                row[k + 2] = way_m * along(middle.point_m);
            }
            for i in 0..n {
                right[i] += row[i] * left_m;
                for j in 0..n {
                    matrix[i][j] += row[i] * row[j];
                }
            }
        }
        // Curvatures count as the offsets that they cause along a piece.
        let weight = SMOOTH_M2 * length_m * length_m * length_m * length_m;
        for k in 1..self.pieces.len() {
            let (a, b) = (k + 1, k + 2);
            let rises = self.pieces[k].curvature_per_m - self.pieces[k - 1].curvature_per_m;
            for (i, sign) in [(a, 1.0), (b, -1.0)] {
                right[i] += weight * sign * rises;
                matrix[i][i] += weight;
            }
            matrix[a][b] -= weight;
            matrix[b][a] -= weight;
        }
        // A tiny weight makes the matrix regular where no point follows a piece.
        for (i, row) in matrix.iter_mut().enumerate().skip(2) {
            row[i] += 1e-9;
        }
        solved(matrix, right)
    }

    fn add(&mut self, change: &[f64]) {
        let (sin, cos) = libm::sincos(self.heading_rad);
        self.start_m[0] -= sin * change[0];
        self.start_m[1] += cos * change[0];
        self.heading_rad += change[1];
        for (piece, more) in self.pieces.iter_mut().zip(&change[2..]) {
            piece.curvature_per_m += more;
        }
    }

    /// Rounds to the digits of a world file.
    fn round(&mut self) {
        for piece in &mut self.pieces {
            piece.length_m = rounded(piece.length_m);
            // World files state radii, so the radius is rounded and not the curvature.
            let radius_m = rounded(1.0 / piece.curvature_per_m);
            let is_line = piece.curvature_per_m.abs() < LINE_PER_M;
            piece.curvature_per_m = if is_line { 0.0 } else { 1.0 / radius_m };
        }
    }

    /// Returns the list of pieces of a world file, a line each.
    pub(crate) fn to_ron(&self) -> String {
        let mut text = String::new();
        for piece in &self.pieces {
            let length_m = piece.length_m;
            // Invariant: writing into a string does not fail.
            let _ = if piece.curvature_per_m == 0.0 {
                writeln!(text, "            Line(length_m: {length_m:?}),")
            } else {
                let radius_m = rounded(1.0 / piece.curvature_per_m);
                writeln!(
                    text,
                    "            Arc(length_m: {length_m:?}, radius_m: {radius_m:?}),"
                )
            };
        }
        if text.is_empty() {
            return "[]".to_owned();
        }
        format!("[\n{text}        ]")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOW: RoadFit = RoadFit {
        tolerance_m: 0.05,
        piece_m: 3.0,
        most_pieces: 64,
        most_per_m: 0.25,
    };

    /// Points on a line of 20 m, an arc of 90° with a radius of 8 m, and a line.
    fn turn(noise_m: f64) -> Vec<[f64; 2]> {
        let quarter_m = 8.0 * std::f64::consts::FRAC_PI_2;
        (0..96)
            .map(|i| {
                let s = 0.5 * f64::from(i);
                let off = noise_m * f64::from(i * 37 % 11 - 5) / 5.0;
                if s < 20.0 {
                    [s, off]
                } else if s < 20.0 + quarter_m {
                    let (sin, cos) = libm::sincos((s - 20.0) / 8.0);
                    [20.0 + (8.0 - off) * sin, 8.0 - (8.0 - off) * cos]
                } else {
                    [28.0 - off, 8.0 + s - 20.0 - quarter_m]
                }
            })
            .collect()
    }

    #[test]
    fn a_turn_is_repeated_within_a_decimetre() {
        for noise_m in [0.0, 0.03] {
            let road = FittedRoad::fit(&turn(noise_m), HOW).expect("a road");
            assert!(road.worst_m < 0.12, "{noise_m}: {}", road.worst_m);
            // It ends as it should: up, 8 m behind the turn.
            let end = road.pose(20.0 + 8.0 * std::f64::consts::FRAC_PI_2 + 10.0);
            let off_m = libm::hypot(end.point_m[0] - 28.0, end.point_m[1] - 18.0);
            assert!(off_m < 0.3, "{noise_m}: {end:?}");
            assert!((end.heading_rad - std::f64::consts::FRAC_PI_2).abs() < 0.03);
        }
    }

    #[test]
    fn a_straight_line_needs_no_pieces_and_a_circle_one() {
        let line: Vec<[f64; 2]> = (0..50)
            .map(|i| [f64::from(i), 0.3 * f64::from(i)])
            .collect();
        let road = FittedRoad::fit(&line, HOW).expect("a road");
        assert!(road.pieces.is_empty() && road.worst_m < 1e-9, "{road:?}");
        let circle: Vec<[f64; 2]> = (0..50)
            .map(|i| {
                let (sin, cos) = libm::sincos(0.01 * f64::from(i));
                [100.0 * sin, 100.0 * cos - 100.0]
            })
            .collect();
        let road = FittedRoad::fit(&circle, HOW).expect("a road");
        let [piece] = &road.pieces[..] else {
            panic!("{road:?}");
        };
        assert!((piece.curvature_per_m + 0.01).abs() < 1e-5, "{road:?}");
        // A point 2 m to the left of the middle of the arc.
        let (sin, cos) = libm::sincos(0.2);
        let (s_m, left_m) = road.place([102.0 * sin, 102.0 * cos - 100.0]);
        assert!(
            (s_m - 20.0).abs() < 1e-2 && (left_m - 2.0).abs() < 1e-2,
            "{s_m} {left_m}"
        );
    }

    #[test]
    fn a_road_that_is_too_sharp_is_none() {
        let sharp = RoadFit {
            most_per_m: 0.1,
            ..HOW
        };
        assert_eq!(FittedRoad::fit(&turn(0.0), sharp), None);
    }
}
