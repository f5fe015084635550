//! Positions with two arc lengths, where a road comes back onto itself.

use core::f64::consts::PI;

use super::course::{Course, RUN_OUT_M};
use super::surface::SurfaceExtent;

/// Greatest number of stations at which a road is examined.
const MAX_STATIONS: f64 = 50_000.0;
/// Greatest error in metres of a station that was found again.
const SAME_M: f64 = 1e-3;

/// Two stretches of a road that cover the same ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfOverlap {
    /// Stations of the first such stretch.
    pub here_m: (f64, f64),
    /// Stations at which the same positions are found instead.
    pub there_m: (f64, f64),
}

impl Course {
    /// Returns the first stretch whose positions belong to another stretch.
    ///
    /// A position belongs to the stretch whose middle of lane 0 is nearest.
    pub fn self_overlap(&self, extent: &SurfaceExtent) -> Option<SelfOverlap> {
        // A road whose headings differ by less than half a circle always
        // advances in one direction, so it cannot come back.
        if self.turning_rad() < PI {
            return None;
        }
        // Beyond its straight ends the road has no positions.
        let from_m = extent.stations_m.start.max(-RUN_OUT_M);
        let to_m = extent.stations_m.end.min(self.end_s_m() + RUN_OUT_M);
        let (right_m, left_m) = (extent.borders_m.start, extent.borders_m.end);
        // Lanes may overlap where the course does not, so four offsets are
        // examined.
        let across_m = [right_m, 0.0, 0.5 * (right_m + left_m), left_m];
        // Narrower than any crossing of two such roads.
        let step_m = (0.5 * (left_m - right_m))
            .min(1.0)
            .max((to_m - from_m) / MAX_STATIONS);
        let mut found: Option<SelfOverlap> = None;
        for i in 0..=((to_m - from_m) / step_m).ceil() as usize {
            let s_m = (from_m + i as f64 * step_m).min(to_m);
            match (self.other_station_m(s_m, across_m), &mut found) {
                (Some((least_m, most_m)), Some(known)) => {
                    known.here_m.1 = s_m;
                    known.there_m.0 = known.there_m.0.min(least_m);
                    known.there_m.1 = known.there_m.1.max(most_m);
                }
                (Some(there_m), None) => {
                    found = Some(SelfOverlap {
                        here_m: (s_m, s_m),
                        there_m,
                    });
                }
                // The first stretch has ended, and one is enough to report.
                (None, Some(_)) => break,
                (None, None) => {}
            }
        }
        found
    }

    /// Returns the least and greatest station that a cross section has elsewhere.
    ///
    /// `None` if all its positions are found at its own station.
    fn other_station_m(&self, s_m: f64, across_m: [f64; 4]) -> Option<(f64, f64)> {
        let found = across_m.map(|lateral_m| self.locate(&self.pose(s_m, lateral_m)).s_m);
        let elsewhere = found.into_iter().filter(|at_m| (at_m - s_m).abs() > SAME_M);
        elsewhere.fold(None, |known, at_m| match known {
            None => Some((at_m, at_m)),
            Some((least_m, most_m)) => Some((at_m.min(least_m), at_m.max(most_m))),
        })
    }

    /// Returns the difference between its greatest and least heading.
    fn turning_rad(&self) -> f64 {
        let (mut heading_rad, mut least_rad, mut most_rad) = (0.0_f64, 0.0_f64, 0.0_f64);
        for piece in self.pieces() {
            heading_rad += piece.length_m * piece.curvature_per_m;
            least_rad = least_rad.min(heading_rad);
            most_rad = most_rad.max(heading_rad);
        }
        most_rad - least_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Piece;

    fn overlap(pieces: &[Piece], beyond_m: f64) -> Option<SelfOverlap> {
        let course = Course::of_pieces(pieces, 7.0).expect("a course");
        course.self_overlap(&SurfaceExtent {
            stations_m: 0.0..course.end_s_m() + beyond_m,
            borders_m: -1.75..5.25,
        })
    }

    fn line(length_m: f64) -> Piece {
        Piece::Line { length_m }
    }

    fn arc(turn_rad: f64, radius_m: f64) -> Piece {
        Piece::Arc {
            length_m: turn_rad * radius_m.abs(),
            radius_m,
        }
    }

    #[test]
    fn a_full_circle_meets_itself_at_both_ends() {
        let found =
            overlap(&[arc(PI, 17.4), arc(PI, 17.4)], 0.0).expect("it comes back to its beginning");
        assert!(found.here_m.0 < 10.0, "{found:?}");
        assert!(
            (found.there_m.0 - 2.0 * PI * 17.4).abs() < 10.0,
            "{found:?}"
        );
    }

    #[test]
    fn a_loop_overlaps_only_as_far_as_it_is_driven() {
        // Three quarters of a circle, which leads down to the first line.
        let pieces = [line(50.0), arc(PI, 30.0), arc(0.5 * PI, 30.0)];
        let found = overlap(&[&pieces[..], &[line(60.0)]].concat(), 0.0).expect("it crosses");
        assert!((found.here_m.0 - 20.0).abs() < 8.0, "{found:?}");
        // The loop ends before it, but its straight end crosses it all the
        // same: a position at s = 20 m lies on both.
        assert!(overlap(&pieces, 0.0).is_some());
    }

    #[test]
    fn turns_and_spirals_beside_themselves_pass() {
        // A hairpin and a spiral that opens, each beyond half a circle.
        let hairpin = [line(50.0), arc(PI, 12.0), line(40.0), arc(PI, -20.0)];
        assert_eq!(overlap(&hairpin, 50.0), None);
        let spiral = [arc(0.5 * PI, 20.0), arc(0.5 * PI, 35.0), arc(1.4, 50.0)];
        assert_eq!(overlap(&spiral, 0.0), None);
        // Farther on, it crosses the straight part before the first piece.
        assert!(overlap(&spiral, 100.0).is_some());
        // Turns so narrow that the second lies on the first.
        let narrow: Vec<Piece> = (0..5).map(|i| arc(0.5 * PI, 20.0 + f64::from(i))).collect();
        assert!(overlap(&narrow, 0.0).is_some());
    }
}
