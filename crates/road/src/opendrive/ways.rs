//! Paths in the plane: sequences of lines and arcs.
//!
//! Spirals are replaced by arcs within a millimetre of them.

use core::f64::consts::FRAC_PI_2;

use super::error::ImportError;
use super::tree::XmlNode;
use crate::pose::{Pose, wrapped};
use crate::road::{Bend, Course, MOST_WINDS_RAD};

/// Greatest distance in metres of the arcs from their spiral.
const NEAR_M: f64 = 0.001;
/// Greatest distance in metres of a point from a line that counts as on it.
const STRAIGHT_M: f64 = 1e-3;
/// Distance in metres from a corner within which a path turns.
const CORNER_M: f64 = 1e-3;
/// Greatest turn at a corner in radians: a path does not turn back.
const MOST_CORNER_RAD: f64 = 2.8;
/// Greatest turn in radians that counts as none.
const SAME_RAD: f64 = 1e-9;
/// Radius in metres below which an arc counts as a corner.
const SHARP_M: f64 = 1.0;

/// Greatest number of arcs of a curve.
pub(crate) const MOST_ARCS: f64 = 10_000.0;
/// Fix of a way that a world refuses as its road.
pub const FOLDS: &str = "keep its pieces above 0 m, and its radii above the width of its lanes";
/// Fix of a curve that is too long or winds up.
pub const WINDS: &str = "lessen its curvature or its length";

/// Greatest distance in metres of an entity from its lane of a world.
pub const MOST_ASIDE_M: f64 = 20.0;
/// Tolerances within which a way keeps its distance to another.
pub const SAME_WAY_M: f64 = 0.005;
/// Tolerance of headings, as above.
pub const SAME_WAY_RAD: f64 = 0.002;
/// Distance in metres of the places at which two ways are compared.
const STEP_M: f64 = 2.0;

/// Position on a path.
#[derive(Clone, Debug, PartialEq)]
pub struct OnWay {
    /// Path on which the position is. It is straight before and behind its pieces.
    pub way: Course,
    /// Station of the position.
    pub along_m: f64,
    /// Station at which the file ends the path. The path continues straight after it.
    pub ends_m: f64,
    /// True for a way along lanes, which ends with them.
    pub is_lane: bool,
}

/// Clothoid: a piece whose curvature changes linearly.
#[derive(Clone, Copy, Debug)]
pub struct Spiral {
    /// Length of the clothoid.
    pub length_m: f64,
    /// Curvature at the start in 1/m.
    pub from_per_m: f64,
    /// Curvature at the end in 1/m.
    pub to_per_m: f64,
}

/// Returns the start of the straight path through places.
///
/// # Errors
///
/// Returns an error for places beside the line, and for a path without a
/// length.
pub fn line_through(asks: &XmlNode, spots: &[Pose]) -> Result<Pose, ImportError> {
    let (Some(first), Some(last)) = (spots.first(), spots.last()) else {
        return Err(asks.refused("a way without places", "give the way at least two places"));
    };
    let (dx, dy) = (last.x_m - first.x_m, last.y_m - first.y_m);
    let begins = Pose {
        // The direction is that of the line. The places may face elsewhere.
        heading_rad: libm::atan2(dy, dx),
        ..*first
    };
    let aside = spots
        .iter()
        .find(|spot| begins.sees(spot).y_m.abs() > STRAIGHT_M);
    match aside {
        Some(_) => Err(asks.refused(
            "a way that turns at its places is not read",
            "keep its places on one straight line, or write a clothoid spline",
        )),
        None if dx == 0.0 && dy == 0.0 => {
            Err(asks.refused("a way that leads nowhere", "set its places apart"))
        }
        None => Ok(begins),
    }
}

/// Path through places that turns at them.
#[derive(Clone, Debug)]
pub struct CorneredWay {
    /// Path of lines, with a tight arc at each place.
    pub way: Course,
    /// Stations of the places.
    pub stations_m: Vec<f64>,
}

impl CorneredWay {
    /// Returns the path through places by straight lines, which turns at the places.
    ///
    /// # Errors
    ///
    /// Returns an error for places that are no path, or at which it turns back.
    pub fn through(asks: &XmlNode, spots: &[Pose]) -> Result<CorneredWay, ImportError> {
        let mut corners: Vec<Pose> = Vec::new();
        // Places in one another's place share a station.
        let numbers: Vec<usize> = spots
            .iter()
            .map(|spot| {
                let away = corners.last().map(|last| last.sees(spot));
                // Two corners take their cuts from one side, so a shorter side
                // has no line left.
                if away.is_none_or(|it| 4.0 * CORNER_M < libm::hypot(it.x_m, it.y_m)) {
                    corners.push(*spot);
                }
                corners.len() - 1
            })
            .collect();
        let sides: Vec<(f64, f64)> = corners
            .windows(2)
            .map(|pair| {
                let (dx, dy) = (pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
                (libm::hypot(dx, dy), libm::atan2(dy, dx))
            })
            .collect();
        let Some((_, heading_rad)) = sides.first() else {
            return Err(asks.refused("a way that leads nowhere", "set its places apart"));
        };
        let begins = Pose {
            heading_rad: *heading_rad,
            ..corners[0]
        };
        let (mut pieces, mut stations) = (Vec::new(), vec![0.0]);
        let (mut cut_m, mut at_m) = (0.0, 0.0);
        for (i, (length_m, heading_rad)) in sides.iter().enumerate() {
            let next = sides.get(i + 1);
            let turn_rad = next.map_or(0.0, |(_, next_rad)| wrapped(next_rad - heading_rad));
            if turn_rad.abs() > MOST_CORNER_RAD {
                let help = "end the trajectory there, and begin another";
                return Err(asks.refused("a way that turns back at a place is not read", help));
            }
            let turns = turn_rad.abs() > SAME_RAD;
            // The fillet of this radius begins `CORNER_M` before the place.
            let radius_m = CORNER_M / libm::tan(0.5 * turn_rad.abs());
            let next_cut_m = if turns { CORNER_M } else { 0.0 };
            let line_m = length_m - cut_m - next_cut_m;
            pieces.push(Bend {
                length_m: line_m,
                per_m: 0.0,
            });
            let arc_m = if turns {
                radius_m * turn_rad.abs()
            } else {
                0.0
            };
            if turns {
                let per_m = turn_rad.signum() / radius_m;
                pieces.push(Bend {
                    length_m: arc_m,
                    per_m,
                });
            }
            // The middle of the arc is nearest to the place.
            stations.push(at_m + line_m + 0.5 * arc_m);
            at_m += line_m + arc_m;
            cut_m = next_cut_m;
        }
        Ok(CorneredWay {
            way: course(asks, begins, &pieces)?,
            stations_m: numbers.iter().map(|number| stations[*number]).collect(),
        })
    }
}

/// Returns pieces from a place on as the course of a road.
///
/// # Errors
///
/// Returns an error of the element for pieces that are no road.
pub fn course(asks: &XmlNode, begins: Pose, pieces: &[Bend]) -> Result<Course, ImportError> {
    Course::of_bends(begins, pieces).map_err(|error| asks.refused(error.what, FOLDS))
}

/// Returns the first part of a path.
pub(super) fn cut(mut pieces: Vec<Bend>, length_m: f64) -> Vec<Bend> {
    let mut left_m = length_m;
    for piece in &mut pieces {
        piece.length_m = piece.length_m.min(left_m);
        left_m -= piece.length_m;
    }
    pieces.retain(|piece| piece.length_m > 0.0);
    pieces
}

impl OnWay {
    /// Returns the start of a path with a length.
    pub fn start(way: Course, ends_m: f64) -> OnWay {
        OnWay {
            way,
            ends_m,
            along_m: 0.0,
            is_lane: false,
        }
    }

    /// Returns true for a path that turns at places.
    pub fn has_corners(&self) -> bool {
        self.way.most_curvature_per_m() * SHARP_M > 1.0
    }

    /// Returns the way with the position that is nearest to a place.
    pub fn located(&self, spot: &Pose) -> OnWay {
        OnWay {
            along_m: self.station_m(spot),
            ..self.clone()
        }
    }

    /// Returns the station that is nearest to a place.
    pub fn station_m(&self, spot: &Pose) -> f64 {
        self.way.locate(spot).s_m
    }

    /// Returns the position of another way on this one, if it keeps its distance.
    ///
    /// The other may lead in the opposite direction.
    pub fn shared_by(&self, other: &OnWay) -> Option<OnWay> {
        let first = self.way.locate(&other.way.start());
        if first.lateral_m.abs() > MOST_ASIDE_M {
            return None;
        }
        let against = first.heading_rad.abs() > FRAC_PI_2;
        // Up to the end of both, in the direction of the other.
        let left_m = if against {
            first.s_m
        } else {
            self.ends_m - first.s_m
        };
        let ahead_m = other.ends_m.min(left_m);
        // At least one step, so that both ends are compared.
        let steps = (ahead_m / STEP_M).ceil().max(1.0) as usize;
        let keeps = (0..=steps).all(|step| {
            let along_m = ahead_m * step as f64 / steps as f64;
            let at = self.way.locate(&other.way.pose(along_m, 0.0));
            let turned_rad = (at.heading_rad - first.heading_rad).abs();
            (at.lateral_m - first.lateral_m).abs() < SAME_WAY_M && turned_rad < SAME_WAY_RAD
        });
        keeps.then(|| OnWay {
            along_m: first.s_m,
            ends_m: first.s_m + ahead_m,
            ..self.clone()
        })
    }

    /// Moves along the path. `asks` is the element that states the distance.
    ///
    /// # Errors
    ///
    /// Returns an error of the point if the place is not on the path.
    pub fn move_on(&mut self, asks: &XmlNode, by_m: f64) -> Result<(), ImportError> {
        // A millimetre of tolerance, because distances of a file are rounded.
        let left_m = self.ends_m - self.along_m;
        if !(-STRAIGHT_M..=left_m + STRAIGHT_M).contains(&by_m) {
            let what = format!("it is {by_m} m along a way that has {left_m} m");
            let help = "make the trajectory as long as what is on it";
            return Err(asks.refused(what, help).of_point());
        }
        self.along_m += by_m;
        Ok(())
    }

    /// Returns the place.
    pub fn spot(&self) -> Pose {
        self.way.pose(self.along_m, 0.0)
    }
}

impl Spiral {
    /// Arcs within a millimetre of the spiral.
    ///
    /// The bound also holds for parallels up to `beside_m` beside both.
    ///
    /// The curvature of the spiral is κ₀ + c·s. Each arc of length h has the
    /// curvature of the spiral at its middle. At v from a middle, the heading
    /// is then off by c·v²/2 − δ. The first and the last arc reach h/√12
    /// outward and h/2 inward from their middles, so δ = c·h²/24. This is the
    /// mean of c·v²/2 over an arc. So the heading is exact at both ends, off by
    /// at most c·h²/12, and off by 0 on average. The lateral error is the
    /// integral of the heading error and does not add up from arc to arc. It is
    /// 0 at both ends and at most c·h³/(36·√3).
    ///
    /// # Errors
    ///
    /// Returns a message for a spiral that winds up or would need too many arcs.
    pub fn arcs(&self, beside_m: f64) -> Result<Vec<Bend>, String> {
        let turn_rad = self.length_m * self.from_per_m.abs().max(self.to_per_m.abs());
        if turn_rad.is_nan() || turn_rad > MOST_WINDS_RAD {
            return Err(format!(
                "a curvature from {} to {} 1/m on {} m",
                self.from_per_m, self.to_per_m, self.length_m
            ));
        }
        // Equal curvatures are one arc, and the change by which is divided
        // below is 0.
        if self.from_per_m == self.to_per_m || self.length_m == 0.0 {
            return Ok(vec![Bend {
                length_m: self.length_m,
                per_m: self.from_per_m,
            }]);
        }
        let change_per_m2 = ((self.to_per_m - self.from_per_m) / self.length_m).abs();
        let most = 36.0 * 3f64.sqrt();
        // Solved for h: the lateral error of the spiral itself, then that of a
        // parallel, which is the heading error times its distance.
        let by_place_m = libm::cbrt(most * NEAR_M / change_per_m2);
        let by_heading_m = (12.0 * NEAR_M / (change_per_m2 * beside_m)).sqrt();
        let most_m = by_place_m.min(by_heading_m);
        let outer = 1.0 / 12f64.sqrt();
        // Both ends together reach 2·outer beyond the middles.
        let arcs = (self.length_m / most_m + 1.0 - 2.0 * outer).ceil().max(1.0);
        if arcs > MOST_ARCS {
            return Err(format!(
                "a spiral of {arcs} arcs: at most {MOST_ARCS} are read"
            ));
        }
        // The steps are evened out, so all inner arcs have equal lengths.
        let step_m = self.length_m / (arcs - 1.0 + 2.0 * outer);
        // At most `MOST_ARCS`.
        let last = arcs as usize - 1;
        let arcs = (0..=last).map(|i| {
            let middle_m = step_m * (outer + i as f64);
            let reach = |is_end: bool| if is_end { outer } else { 0.5 };
            Bend {
                length_m: step_m * (reach(i == 0) + reach(i == last)),
                per_m: self.from_per_m
                    + (self.to_per_m - self.from_per_m) * middle_m / self.length_m,
            }
        });
        Ok(arcs.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference solution of the spiral by numerical integration.
    ///
    /// Places and headings are at even distances.
    fn exact(spiral: Spiral, steps: usize) -> Vec<Pose> {
        let step_m = spiral.length_m / steps as f64;
        let change_per_m2 = (spiral.to_per_m - spiral.from_per_m) / spiral.length_m;
        let heading_rad = |s_m: f64| s_m * (spiral.from_per_m + 0.5 * change_per_m2 * s_m);
        let mut spot = Pose::default();
        let mut all = vec![spot];
        for i in 0..steps {
            // Simpson's rule.
            let s_m = i as f64 * step_m;
            let mean = |f: fn(f64) -> f64| {
                let at = |share: f64| f(heading_rad(s_m + share * step_m));
                (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0
            };
            spot = Pose {
                x_m: spot.x_m + step_m * mean(libm::cos),
                y_m: spot.y_m + step_m * mean(libm::sin),
                heading_rad: heading_rad(s_m + step_m),
            };
            all.push(spot);
        }
        all
    }

    #[test]
    fn arcs_lie_within_a_millimetre_of_their_spiral_and_of_lines_beside_it() {
        // Turns at junctions, and the longest and sharpest bends of motorways.
        let cases = [
            (6.439317, 1.0 / 1500.0, 1.0 / 9.0, 0.0),
            (11.109693, 1.0 / 14.75, 1.0 / 1500.0, 0.0),
            (100.0, 0.0, 0.004, 12.0),
            (100.0, -0.004, 0.0, 12.0),
            (300.0, 0.001, -0.001, 12.0),
        ];
        for (length_m, from_per_m, to_per_m, beside_m) in cases {
            let spiral = Spiral {
                length_m,
                from_per_m,
                to_per_m,
            };
            let arcs = spiral.arcs(beside_m).expect("few arcs");
            let way = Course::of_bends(Pose::default(), &arcs).expect("a course");
            let arcs_m = way.end_s_m();
            assert!((arcs_m - length_m).abs() < 1e-9, "{arcs_m}");
            let steps = 2000;
            for (i, there) in exact(spiral, steps).iter().enumerate() {
                let here = way.pose(length_m * i as f64 / steps as f64, 0.0);
                for aside_m in [0.0, -beside_m] {
                    let (a, b) = (here.moved(0.0, aside_m), there.moved(0.0, aside_m));
                    let off_m = (a.x_m - b.x_m).hypot(a.y_m - b.y_m);
                    // The bound is of first order, so a margin of 10 % covers
                    // the rest.
                    assert!(off_m < 1.1 * NEAR_M, "{length_m}: {off_m} m at {i}");
                }
            }
        }
    }
}
