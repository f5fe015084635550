//! Curves in the plane, and arcs within a millimetre of them.
//!
//! Lines, arcs, spirals, polynomials and the middles of lanes are all read as a
//! place at each distance. Pairs of arcs then meet such a curve in place and
//! direction, so no error adds up along a chain of them.

use core::f64::consts::PI;
use core::ops::Range;
use std::collections::HashMap;

use super::ways::MOST_ARCS;
use crate::pose::{Pose, wrapped};
use crate::road::Bend;

/// Greatest distance in metres of the arcs from their curve.
const NEAR_M: f64 = 0.001;
/// Least length in metres of a part of a curve that is split once more.
const LEAST_M: f64 = 0.05;
/// Shares of a part at which it is compared with its arcs.
const SHARES: [f64; 5] = [0.125, 0.3, 0.5, 0.7, 0.875];

/// A carriageway without lanes is about as wide as a car.
const LEAST_WIDTH_M: f64 = 2.0;
/// Places of a curve that are looked at for whether it meets itself.
const MOST_SAMPLES: f64 = 20_000.0;

/// Curve as a place at each distance, whose heading is the tangent.
#[derive(Clone, Copy)]
pub(crate) struct PlaneCurve<'a> {
    pub at: &'a dyn Fn(f64) -> Pose,
    pub length_m: f64,
}

/// Distance along a curve at which it comes near an earlier part of itself.
///
/// `turn_rad` is the sum of its turns in either direction.
pub(crate) fn self_overlap_m(curve: PlaneCurve<'_>, turn_rad: f64, width_m: f64) -> Option<f64> {
    // Nothing comes back that has not turned round.
    if turn_rad <= PI {
        return None;
    }
    // Narrower cells would only cost time.
    let near_m = width_m.max(LEAST_WIDTH_M);
    let length_m = curve.length_m;
    // A file can state a curve of any length, so the number of samples is
    // bounded.
    let apart_m = (length_m / MOST_SAMPLES).max(0.25 * near_m);
    // Beyond this all places share the last cell, whose neighbours are still numbers.
    let cell = |at_m: f64| (at_m / near_m).floor().clamp(-1e15, 1e15) as i64;
    let mut seen: HashMap<(i64, i64), Vec<(f64, Pose)>> = HashMap::new();
    let samples = (length_m / apart_m).min(MOST_SAMPLES) as usize;
    for s_m in (0..=samples).map(|nth| nth as f64 * apart_m) {
        let here = (curve.at)(s_m);
        let (column, row) = (cell(here.x_m), cell(here.y_m));
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy)));
        for (dx, dy) in around {
            let there = seen.get(&(column + dx, row + dy)).into_iter().flatten();
            // A bend is near itself for a while: half a turn at its tightest.
            let mut others = there.filter(|(other_m, _)| other_m + 4.0 * near_m < s_m);
            let touches =
                |spot: &Pose| libm::hypot(spot.x_m - here.x_m, spot.y_m - here.y_m) < 0.9 * near_m;
            if others.any(|(_, spot)| touches(spot)) {
                return Some(s_m);
            }
        }
        // Behind the test, so that a place does not meet itself.
        seen.entry((column, row)).or_default().push((s_m, here));
    }
    None
}

/// Arc with its place on the curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurveArc {
    /// Distance along the curve at its start, and the part of the curve that it covers.
    pub from_m: f64,
    pub covers_m: f64,
    pub start: Pose,
    pub bend: Bend,
}

/// Arcs within [`NEAR_M`] of a curve, also on parallels up to `beside_m` beside it.
///
/// # Errors
///
/// Returns a message for a curve that would need too many arcs.
pub(crate) fn arcs_of(curve: PlaneCurve<'_>, beside_m: f64) -> Result<Vec<CurveArc>, String> {
    let mut arcs = Vec::new();
    split(curve.at, 0.0..curve.length_m, beside_m, &mut arcs);
    if arcs.len() as f64 <= MOST_ARCS {
        Ok(arcs)
    } else {
        Err(format!("a curve of more than {MOST_ARCS} arcs within 1 mm"))
    }
}

fn split(at: &dyn Fn(f64) -> Pose, part_m: Range<f64>, beside_m: f64, arcs: &mut Vec<CurveArc>) {
    let (from_m, to_m) = (part_m.start, part_m.end);
    // What is already too much is not split any further.
    if arcs.len() as f64 > MOST_ARCS {
        return;
    }
    let (start, end) = (at(from_m), at(to_m));
    let pair = pair_of(start, end);
    let pair_m: f64 = pair.iter().map(|(_, bend)| bend.length_m).sum();
    // A straight part has no length to share out.
    let scale = if pair_m > 0.0 {
        (to_m - from_m) / pair_m
    } else {
        0.0
    };
    let is_near = SHARES.iter().all(|share| {
        let here = on_pair(&pair, share * pair_m);
        let off = at(from_m + share * (to_m - from_m)).sees(&here);
        libm::hypot(off.x_m, off.y_m) + beside_m * off.heading_rad.abs() <= NEAR_M
    });
    // Shorter parts are taken as they are: a kink is near no pair of arcs.
    if !is_near && to_m - from_m > LEAST_M {
        let middle_m = 0.5 * (from_m + to_m);
        split(at, from_m..middle_m, beside_m, arcs);
        split(at, middle_m..to_m, beside_m, arcs);
        return;
    }
    let mut along_m = from_m;
    for (start, bend) in pair {
        let covers_m = bend.length_m * scale;
        // An arc without a length has no direction to turn in.
        if covers_m > 0.0 {
            arcs.push(CurveArc {
                from_m: along_m,
                covers_m,
                start,
                bend,
            });
        }
        along_m += covers_m;
    }
}

fn on_pair(pair: &[(Pose, Bend); 2], along_m: f64) -> Pose {
    let [(start, first), (middle, second)] = pair;
    match along_m - first.length_m {
        left_m if left_m <= 0.0 => start.bent(along_m, first.per_m),
        left_m => middle.bent(left_m, second.per_m),
    }
}

/// Two arcs from a place to a place, in the directions of both.
///
/// The tangents at both ends reach equally far, to the points between which the
/// arcs meet.
pub(crate) fn pair_of(start: Pose, end: Pose) -> [(Pose, Bend); 2] {
    let seen = start.sees(&end);
    let (sin, cos) = libm::sincos(seen.heading_rad);
    let square = seen.x_m * seen.x_m + seen.y_m * seen.y_m;
    // Of v·(t0 + t1), with t0 = (1, 0) and t1 = (cos, sin).
    let along = seen.x_m + seen.x_m * cos + seen.y_m * sin;
    let bent = 2.0 * (1.0 - cos);
    let root = (along * along + bent * square).sqrt();
    // This form of the root has no difference that could cancel.
    let reach_m = if along + root > 0.0 {
        square / (along + root)
    } else {
        0.0
    };
    let first = arc_to(
        0.5 * (seen.x_m + reach_m * (1.0 - cos)),
        0.5 * (seen.y_m - reach_m * sin),
    );
    let middle = start.bent(first.length_m, first.per_m);
    let left = middle.sees(&end);
    [(start, first), (middle, arc_to(left.x_m, left.y_m))]
}

/// Arc that begins ahead and ends at a place.
fn arc_to(ahead_m: f64, left_m: f64) -> Bend {
    let square = ahead_m * ahead_m + left_m * left_m;
    let half_rad = libm::atan2(left_m, ahead_m);
    if square == 0.0 {
        return Bend {
            length_m: 0.0,
            per_m: 0.0,
        };
    }
    // Circle that begins along x and meets the place: κ = 2 y / (x² + y²).
    let per_m = 2.0 * left_m / square;
    Bend {
        // Below this the quotient only has the error of both numbers.
        length_m: if half_rad.abs() < 1e-6 {
            square.sqrt()
        } else {
            2.0 * half_rad / per_m
        },
        per_m,
    }
}

/// Polynomial of the third degree from a distance on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cubic {
    pub from_m: f64,
    pub terms: [f64; 4],
}

impl Cubic {
    pub fn at(&self, s_m: f64) -> f64 {
        let [a, b, c, d] = self.terms;
        let x = s_m - self.from_m;
        // Horner's scheme, with the fewest roundings.
        a + x * (b + x * (c + x * d))
    }

    pub fn slope(&self, s_m: f64) -> f64 {
        let [_, b, c, d] = self.terms;
        let x = s_m - self.from_m;
        b + x * (2.0 * c + x * 3.0 * d)
    }

    pub(crate) fn is_constant(&self) -> bool {
        self.terms[1..].iter().all(|term| *term == 0.0)
    }
}

/// Returns the last polynomial that has begun at a distance.
pub fn begun(all: &[Cubic], s_m: f64) -> Cubic {
    let begun = all.iter().rev().find(|it| it.from_m <= s_m);
    // Before its distance the first one holds.
    begun.or(all.first()).copied().unwrap_or_default()
}

/// Polynomials ahead and to the left, of a parameter from 0 to `most`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CubicPair {
    pub ahead: Cubic,
    pub left: Cubic,
    pub most: f64,
}

/// Curve along two polynomials of one parameter, by its length.
pub(crate) struct ParametricCurve {
    start: Pose,
    pair: CubicPair,
    /// Lengths at even parameters, scaled to the length that the file states.
    lengths_m: Vec<f64>,
}

impl CubicPair {
    /// Parts into which a curve is cut to measure it, as in esmini.
    const PARTS: u32 = 200;

    /// Lengths along it at even parameters.
    fn lengths_m(&self) -> Vec<f64> {
        let step = self.most / f64::from(Self::PARTS);
        let mut lengths_m = vec![0.0];
        let mut sum_m = 0.0;
        for part in 0..Self::PARTS {
            // The midpoint rule needs no slope at the ends, where files have kinks.
            let middle = (f64::from(part) + 0.5) * step;
            sum_m += step * libm::hypot(self.ahead.slope(middle), self.left.slope(middle));
            lengths_m.push(sum_m);
        }
        lengths_m
    }
}

impl ParametricCurve {
    /// Halvings after which a parameter is as precise as its bits.
    const HALVINGS: u32 = 60;

    /// Returns a curve up to a parameter, stretched to the length that the file states.
    ///
    /// # Errors
    ///
    /// Returns a message for a curve without a length.
    pub fn new(start: Pose, pair: CubicPair, length_m: f64) -> Result<ParametricCurve, String> {
        let mut lengths_m = pair.lengths_m();
        let sum_m = lengths_m.last().copied().unwrap_or(0.0);
        if sum_m == 0.0 || !sum_m.is_finite() {
            return Err("its polynomials lead nowhere".to_owned());
        }
        for it in &mut lengths_m {
            // The length of the file counts, because all of its stations refer to it.
            *it *= length_m / sum_m;
        }
        Ok(ParametricCurve {
            start,
            pair,
            lengths_m,
        })
    }

    /// Returns the curve of a function of the distance ahead, as long as the file states.
    ///
    /// Its length is that along the curve, so it ends before the same distance ahead.
    ///
    /// # Errors
    ///
    /// Returns a message for a curve without a length.
    pub fn of_function(start: Pose, left: Cubic, length_m: f64) -> Result<ParametricCurve, String> {
        let ahead = Cubic {
            from_m: 0.0,
            terms: [0.0, 1.0, 0.0, 0.0],
        };
        let up_to = |most: f64| CubicPair { ahead, left, most };
        let (mut least, mut most) = (0.0, length_m);
        // The length grows with the parameter, so halving finds it.
        for _ in 0..Self::HALVINGS {
            let middle = 0.5 * (least + most);
            let lengths_m = up_to(middle).lengths_m();
            if lengths_m.last().is_some_and(|sum_m| *sum_m < length_m) {
                least = middle;
            } else {
                most = middle;
            }
        }
        ParametricCurve::new(start, up_to(most), length_m)
    }

    pub fn at(&self, s_m: f64) -> Pose {
        let after = self.lengths_m.partition_point(|it| *it <= s_m);
        let part = after.clamp(1, CubicPair::PARTS as usize);
        let (from_m, to_m) = (self.lengths_m[part - 1], self.lengths_m[part]);
        // A part without a length has a single point.
        let within = if to_m > from_m {
            (s_m - from_m) / (to_m - from_m)
        } else {
            0.0
        };
        let share = part as f64 - 1.0 + within;
        let parameter = share * self.pair.most / f64::from(CubicPair::PARTS);
        let (ahead, left) = (
            self.pair.ahead.slope(parameter),
            self.pair.left.slope(parameter),
        );
        let on = self
            .start
            .moved(self.pair.ahead.at(parameter), self.pair.left.at(parameter));
        Pose {
            heading_rad: wrapped(self.start.heading_rad + libm::atan2(left, ahead)),
            ..on
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cubic(terms: [f64; 4]) -> Cubic {
        Cubic { from_m: 0.0, terms }
    }

    fn apart_m(a: Pose, b: Pose) -> f64 {
        libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    }

    #[test]
    fn chained_arcs_stay_within_a_millimetre_and_end_where_the_curve_does() {
        let start = Pose {
            x_m: 3.0,
            y_m: -2.0,
            heading_rad: 2.5,
        };
        // An S of 60 m, a bend of a junction, and one parametrized from 0 to 1.
        let cases = [
            (
                cubic([0.0, 1.0, 0.0, 0.0]),
                cubic([0.0, 0.0, 0.01, -2e-4]),
                50.0,
                52.0,
            ),
            (
                cubic([0.0, 1.0, 0.0, -2e-3]),
                cubic([0.0, 0.0, 0.04, 0.0]),
                12.0,
                13.3,
            ),
            (
                cubic([0.0, 20.0, -4.0, 0.0]),
                cubic([0.0, 0.0, 8.0, 3.0]),
                1.0,
                20.5,
            ),
        ];
        for (ahead, left, most, length_m) in cases {
            let pair = CubicPair { ahead, left, most };
            let curve = ParametricCurve::new(start, pair, length_m).expect("a curve");
            let at = |s_m: f64| curve.at(s_m);
            let arcs = arcs_of(PlaneCurve { at: &at, length_m }, 4.0).expect("few arcs");
            // Chained from the start on: errors of the arcs would add up.
            let mut spot = start;
            let mut covered_m = 0.0;
            for arc in &arcs {
                assert!(
                    apart_m(spot, curve.at(arc.from_m)) < 2.0 * NEAR_M,
                    "{arc:?}"
                );
                let middle = spot.bent(0.5 * arc.bend.length_m, arc.bend.per_m);
                let there = curve.at(arc.from_m + 0.5 * arc.covers_m);
                assert!(apart_m(middle, there) < 2.0 * NEAR_M, "{arc:?}");
                spot = spot.bent(arc.bend.length_m, arc.bend.per_m);
                covered_m += arc.covers_m;
            }
            assert!((covered_m - length_m).abs() < 1e-9);
            let end = curve.at(length_m);
            assert!(apart_m(spot, end) < 1e-6, "{}", apart_m(spot, end));
            assert!(wrapped(spot.heading_rad - end.heading_rad).abs() < 1e-6);
        }
    }

    #[test]
    fn a_polynomial_has_the_length_that_its_file_states() {
        // y = x²/100 over x = 0 to 10, whose length is 10.0663 m, as 20 m.
        let curve = ParametricCurve::new(
            Pose::default(),
            CubicPair {
                ahead: cubic([0.0, 10.0, 0.0, 0.0]),
                left: cubic([0.0, 0.0, 1.0, 0.0]),
                most: 1.0,
            },
            20.0,
        )
        .expect("a curve");
        let end = curve.at(20.0);
        assert!((end.x_m - 10.0).abs() < 1e-9 && (end.y_m - 1.0).abs() < 1e-9);
        assert!((end.heading_rad - libm::atan(0.2)).abs() < 1e-9);
        // Half of the length, and not half of the parameter, is in the middle.
        let middle = curve.at(10.0);
        assert!((middle.x_m - 5.0247).abs() < 1e-3, "{middle:?}");
    }

    #[test]
    fn a_function_is_as_long_along_itself_as_its_file_states() {
        // y = x²/2000, whose length up to x is known in closed form.
        let along_m = |x: f64| {
            let slope = 0.001 * x;
            0.5 * x * (1.0 + slope * slope).sqrt() + 500.0 * libm::asinh(slope)
        };
        let left = cubic([0.0, 0.0, 0.0005, 0.0]);
        let curve = ParametricCurve::of_function(Pose::default(), left, 300.0).expect("a curve");
        for s_m in [50.0, 200.0, 300.0] {
            let at = curve.at(s_m);
            assert!((along_m(at.x_m) - s_m).abs() < 1e-3, "{s_m}: {at:?}");
            assert!((at.y_m - 0.0005 * at.x_m * at.x_m).abs() < 1e-9);
        }
    }

    #[test]
    fn a_curve_without_end_or_length_is_refused() {
        let flat = CubicPair {
            ahead: Cubic::default(),
            left: Cubic::default(),
            most: 1.0,
        };
        assert!(ParametricCurve::new(Pose::default(), flat, 5.0).is_err());
        let wild = cubic([0.0, 0.0, 0.001, 1e-6]);
        let curve = ParametricCurve::of_function(Pose::default(), wild, 1e5).expect("a curve");
        let zigzag = |s_m: f64| Pose {
            heading_rad: 1e4 * libm::sin(s_m),
            ..curve.at(s_m)
        };
        let zigzag = PlaneCurve {
            at: &zigzag,
            length_m: 1e5,
        };
        assert!(arcs_of(zigzag, 12.0).is_err());
    }
}
