//! Roads of lines and arcs, fitted to points.

use brakecheck_road::pose::Pose;
use brakecheck_road::road::{Bend, Course, OnRoad};

use crate::path::Path;
use crate::plan::{rounded, solved};
use crate::raw::{FARTHEST_M, wrapped};

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

/// Road without kinks through recorded points.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct FittedRoad {
    /// Its course in metres of the recording's frame.
    pub course: Course,
    /// Greatest distance of a point from the road in metres.
    pub worst_m: f64,
}

/// Road that is being fitted, of pieces of one length.
struct RoadGuess {
    begins: Pose,
    length_m: f64,
    per_m: Vec<f64>,
}

/// Returns a place without a direction.
pub(crate) fn place_at([x_m, y_m]: [f64; 2]) -> Pose {
    Pose {
        x_m,
        y_m,
        heading_rad: 0.0,
    }
}

impl FittedRoad {
    /// Fits the fewest pieces that are near enough, or the most that are allowed.
    ///
    /// Returns `None` for fewer than two points that are 0.5 m apart, and if the road
    /// would turn too sharply.
    pub(crate) fn fit(points_m: &[[f64; 2]], how: RoadFit) -> Option<FittedRoad> {
        let path = Path::through(points_m.iter().copied(), POINT_M)?;
        // At least one piece, so that a short path may still be an arc.
        let most = ((path.length_m() / how.piece_m) as usize).clamp(1, how.most_pieces);
        // A line first: it has the fewest numbers, and worlds of straight
        // roads can be shared.
        let mut pieces = 0;
        loop {
            let road = RoadGuess::fitted(&path, pieces);
            let is_near = |it: &FittedRoad| it.worst_m <= how.tolerance_m;
            if most <= pieces || road.as_ref().is_some_and(is_near) {
                return road.filter(|it| it.course.most_curvature_per_m() < how.most_per_m);
            }
            // Doubled, so that a road costs few fits.
            pieces = (2 * pieces).max(1).min(most);
        }
    }

    /// Returns a straight road.
    pub(crate) fn straight(start_m: [f64; 2], heading_rad: f64) -> FittedRoad {
        let begins = Pose {
            heading_rad,
            ..place_at(start_m)
        };
        FittedRoad {
            course: Course::straight_from(begins),
            worst_m: 0.0,
        }
    }

    /// Returns whether it has no pieces.
    pub fn is_straight(&self) -> bool {
        self.course.piece_count() == 0
    }

    /// Returns the place of a point along the road.
    pub fn place(&self, point_m: [f64; 2]) -> OnRoad {
        self.course.locate(&place_at(point_m))
    }
}

impl RoadGuess {
    /// Fits pieces of one length to a path, `None` if they are no road.
    fn fitted(path: &Path, pieces: usize) -> Option<FittedRoad> {
        let mut guess = RoadGuess::first(path, pieces);
        let points: Vec<Pose> = path.points().map(|(point, _)| place_at(point)).collect();
        for _ in 0..STEPS {
            // A singular system ends the fit with the best road so far.
            let Some(change) = guess.change(&guess.course()?, &points) else {
                break;
            };
            guess.add(&change);
            // Far below the six decimals of a world file.
            if change.iter().all(|it| it.abs() < 1e-9) {
                break;
            }
        }
        // Rounded first, so that the distance is that of the written road.
        guess.round();
        let course = guess.course()?;
        let off = |point: &Pose| course.locate(point).lateral_m.abs();
        Some(FittedRoad {
            worst_m: points.iter().map(off).fold(0.0, f64::max),
            course,
        })
    }

    /// Returns the course, `None` if the steps of the fit have left all sense.
    fn course(&self) -> Option<Course> {
        let Pose {
            x_m,
            y_m,
            heading_rad,
        } = self.begins;
        let is_place = |it: f64| it.abs() <= FARTHEST_M;
        // A diverged fit may be NaN, for which the comparison is false, too.
        if ![x_m, y_m, heading_rad].into_iter().all(is_place) {
            return None;
        }
        let length_m = self.length_m;
        let bends = self.per_m.iter().map(|&per_m| Bend { length_m, per_m });
        Course::of_bends(self.begins, &bends.collect::<Vec<Bend>>()).ok()
    }

    /// Returns a road with the courses of the path between its pieces.
    fn first(path: &Path, pieces: usize) -> RoadGuess {
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
                // The first piece has no piece before it, so its turn is
                // one-sided.
                let pieces = if k == 0 { 1.0 } else { 2.0 };
                wrapped(after - before) / (pieces * length_m)
            }
            _ => 0.0,
        };
        RoadGuess {
            begins: Pose {
                heading_rad: courses.first().copied().unwrap_or_default(),
                ..place_at(stations.first().copied().unwrap_or_default())
            },
            length_m,
            per_m: (0..pieces).map(turns).collect(),
        }
    }

    /// Returns a step of Gauss-Newton: to the left at the start, turn, curvatures.
    fn change(&self, course: &Course, points: &[Pose]) -> Option<Vec<f64>> {
        let n = self.per_m.len() + 2;
        let length_m = self.length_m;
        let (mut matrix, mut right) = (vec![vec![0.0; n]; n], vec![0.0; n]);
        for point in points {
            let OnRoad {
                s_m,
                lateral_m: left_m,
                ..
            } = course.locate(point);
            let at = course.pose(s_m, 0.0);
            let along = |from: &Pose| -at.sees(from).x_m;
            let mut row = vec![0.0; n];
            // A shift of the start to the left moves a later point by its part
            // along that point's left.
            row[0] = libm::cos(at.heading_rad - self.begins.heading_rad);
            // A turn at the start moves a point to the left by its distance
            // ahead.
            row[1] = along(&self.begins);
            for k in 0..self.per_m.len() {
                // The part of the piece before the point turns all that follows it.
                let from_m = k as f64 * length_m;
                let way_m = (s_m - from_m).min(length_m);
                // Pieces behind the point do not move it.
                if way_m <= 0.0 {
                    break;
                }
                row[k + 2] = way_m * along(&course.pose(from_m + 0.5 * way_m, 0.0));
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
        for k in 1..self.per_m.len() {
            let (a, b) = (k + 1, k + 2);
            let rises = self.per_m[k] - self.per_m[k - 1];
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
        let moved = self.begins.moved(0.0, change[0]);
        self.begins = Pose {
            heading_rad: moved.heading_rad + change[1],
            ..moved
        };
        for (per_m, more) in self.per_m.iter_mut().zip(&change[2..]) {
            *per_m += more;
        }
    }

    /// Rounds to the digits of a world file.
    fn round(&mut self) {
        // World files have six decimals, and the stated error is that of the
        // file.
        self.length_m = rounded(self.length_m);
        for per_m in &mut self.per_m {
            // World files state radii, so the radius is rounded and not the curvature.
            let radius_m = rounded(1.0 / *per_m);
            let is_line = per_m.abs() < LINE_PER_M;
            *per_m = if is_line { 0.0 } else { 1.0 / radius_m };
        }
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
            let end_m = 20.0 + 8.0 * std::f64::consts::FRAC_PI_2 + 10.0;
            let end = road.course.pose(end_m, 0.0);
            let off_m = libm::hypot(end.x_m - 28.0, end.y_m - 18.0);
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
        assert!(road.is_straight() && road.worst_m < 1e-9, "{road:?}");
        let circle: Vec<[f64; 2]> = (0..50)
            .map(|i| {
                let (sin, cos) = libm::sincos(0.01 * f64::from(i));
                [100.0 * sin, 100.0 * cos - 100.0]
            })
            .collect();
        let road = FittedRoad::fit(&circle, HOW).expect("a road");
        let [piece] = road.course.bends()[..] else {
            panic!("{road:?}");
        };
        assert!((piece.per_m + 0.01).abs() < 1e-5, "{road:?}");
        // A point 2 m to the left of the middle of the arc.
        let (sin, cos) = libm::sincos(0.2);
        let at = road.place([102.0 * sin, 102.0 * cos - 100.0]);
        assert!(
            (at.s_m - 20.0).abs() < 1e-2 && (at.lateral_m - 2.0).abs() < 1e-2,
            "{at:?}"
        );
    }

    #[test]
    fn a_kink_without_a_bend_is_no_road_and_ends_the_fit() {
        // The steps of the fit once left for infinity, and places there have no station.
        let line = |i: u32, [x, y]: [f64; 2], [dx, dy]: [f64; 2]| {
            let way_m = 0.5 * f64::from(i);
            [x + way_m * dx, y + way_m * dy]
        };
        let first = (0..70).map(|i| line(i, [-8.6, 33.5], [0.56, -0.83]));
        let second = (0..330).map(|i| line(i, [29.4, -28.7], [0.999, 0.03]));
        let points: Vec<[f64; 2]> = first.chain(second).collect();
        for pieces in [1, 4, 16, 64] {
            let how = RoadFit {
                most_pieces: pieces,
                piece_m: 4.0,
                ..HOW
            };
            let road = FittedRoad::fit(&points, how);
            assert!(road.is_none_or(|it| it.worst_m.is_finite()), "{pieces}");
        }
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
