//! Non-uniform rational B-splines in the plane.

use crate::opendrive::curve::PlaneCurve;
use crate::pose::Pose;
use crate::road::CourseError;

/// Greatest order, so that a point costs little.
const MOST_ORDER: usize = 20;
/// Parts into which the curve between two knots is cut to measure it.
const PARTS: u32 = 64;
/// Derivative, as a share of the chord's, below which a direction is that of a chord.
const STILL: f64 = 1e-6;

/// Control points (w·x, w·y, w) with their knots.
pub(super) struct Nurbs {
    order: usize,
    knots: Vec<f64>,
    points: Vec<[f64; 3]>,
    /// Parameters and lengths up to them, in order.
    lengths_m: Vec<[f64; 2]>,
}

impl Nurbs {
    /// Returns the curve of control points (x, y, weight).
    pub(super) fn new(
        order: usize,
        knots: &[f64],
        points: &[[f64; 3]],
    ) -> Result<Nurbs, CourseError> {
        let wrong = |what: String, help: &str, index| CourseError {
            what,
            help: help.to_owned(),
            index,
        };
        if !(2..=MOST_ORDER).contains(&order) || points.len() < order {
            let what = format!("an order of {order} with {} points", points.len());
            let help = format!("orders are 2 to {MOST_ORDER}, with at least as many points");
            return Err(wrong(what, &help, None));
        }
        if knots.len() != points.len() + order {
            let what = format!("{} knots", knots.len());
            let help = format!("write {} knots", points.len() + order);
            return Err(wrong(what, &help, None));
        }
        if knots.windows(2).any(|pair| pair[1] < pair[0]) || knots[points.len()] <= knots[order - 1]
        {
            let what = "knots that fall, or that are all equal".to_owned();
            return Err(wrong(what, "let knots rise", None));
        }
        if let Some(i) = points.iter().position(|it| it[2] <= 0.0) {
            let what = format!("a weight of {}", points[i][2]);
            return Err(wrong(what, "write weights above 0", Some(i)));
        }
        let mut curve = Nurbs {
            order,
            knots: knots.to_vec(),
            points: points.iter().map(|[x, y, w]| [w * x, w * y, *w]).collect(),
            lengths_m: Vec::new(),
        };
        curve.measure();
        Ok(curve)
    }

    fn measure(&mut self) {
        let degree = self.order - 1;
        let mut sum_m = 0.0;
        let mut lengths_m = vec![[self.knots[degree], 0.0]];
        for span in degree..self.points.len() {
            let (from, to) = (self.knots[span], self.knots[span + 1]);
            let part = (to - from) / f64::from(PARTS);
            let speed = |at: f64| {
                let (_, [x, y]) = self.at_parameter(at);
                libm::hypot(x, y)
            };
            for i in 0..PARTS {
                let start = from + f64::from(i) * part;
                let ends = speed(start) + speed((start + part).min(to));
                // Simpson's rule.
                sum_m += part / 6.0 * (ends + 4.0 * speed(start + 0.5 * part));
                if part > 0.0 {
                    lengths_m.push([start + part, sum_m]);
                }
            }
        }
        self.lengths_m = lengths_m;
    }

    pub(super) fn length_m(&self) -> f64 {
        self.lengths_m.last().map_or(0.0, |last| last[1])
    }

    /// Returns the station at which a control point has its greatest influence.
    pub(super) fn station_m(&self, point: usize) -> f64 {
        // Greville's abscissa, which is exact at both ends of a clamped curve.
        let knots = &self.knots[point + 1..point + self.order];
        let at = knots.iter().sum::<f64>() / knots.len() as f64;
        self.interpolated(at, 0, 1)
    }

    fn interpolated(&self, at: f64, from: usize, to: usize) -> f64 {
        let all = &self.lengths_m;
        let begun = all.partition_point(|it| it[from] <= at);
        let after = begun.clamp(1, all.len() - 1);
        let (a, b) = (all[after - 1], all[after]);
        let share = if b[from] > a[from] {
            ((at - a[from]) / (b[from] - a[from])).clamp(0.0, 1.0)
        } else {
            0.0
        };
        a[to] + share * (b[to] - a[to])
    }

    /// Returns the place at a distance along the curve, and its direction.
    pub(super) fn at(&self, s_m: f64) -> Pose {
        let at = self.interpolated(s_m, 1, 0);
        let ([x_m, y_m], slope) = self.at_parameter(at);
        let (first, last) = (self.knots[self.order - 1], self.knots[self.points.len()]);
        let mean = self.length_m() / (last - first);
        let [along, left] = if libm::hypot(slope[0], slope[1]) > STILL * mean {
            slope
        } else {
            // Control points in one place have a derivative of 0 between them.
            let step = 1e-3 * (last - first);
            let near = [at - step, at + step].map(|it| self.at_parameter(it.clamp(first, last)).0);
            [near[1][0] - near[0][0], near[1][1] - near[0][1]]
        };
        Pose {
            x_m,
            y_m,
            heading_rad: libm::atan2(left, along),
        }
    }

    pub(super) fn as_plane_curve<'a>(&self, at: &'a dyn Fn(f64) -> Pose) -> PlaneCurve<'a> {
        PlaneCurve {
            at,
            length_m: self.length_m(),
        }
    }

    /// Returns the point at a parameter and its derivative, by de Boor's algorithm.
    fn at_parameter(&self, at: f64) -> ([f64; 2], [f64; 2]) {
        let degree = self.order - 1;
        let begun = self.knots.partition_point(|knot| *knot <= at);
        let last = begun.saturating_sub(1).clamp(degree, self.points.len() - 1);
        // The last parameter belongs to the last span that has a length.
        let span = (degree..=last)
            .rev()
            .find(|it| self.knots[it + 1] > self.knots[*it])
            .unwrap_or(last);
        let mut d = [[0.0; 3]; MOST_ORDER];
        d[..self.order].copy_from_slice(&self.points[span - degree..=span]);
        let mut slope = [0.0; 3];
        for level in 1..self.order {
            if level == degree {
                // The last two points are those of the tangent.
                let per = degree as f64 / (self.knots[span + 1] - self.knots[span]);
                slope = core::array::from_fn(|i| per * (d[degree][i] - d[degree - 1][i]));
            }
            for j in (level..=degree).rev() {
                let i = span - degree + j;
                let (from, to) = (self.knots[i], self.knots[i + self.order - level]);
                let share = if to > from {
                    (at - from) / (to - from)
                } else {
                    0.0
                };
                let mixed = |axis: usize| (1.0 - share) * d[j - 1][axis] + share * d[j][axis];
                d[j] = core::array::from_fn(mixed);
            }
        }
        let [x, y, w] = d[degree];
        // Quotient rule, as the curve is a projection.
        let derived = |value: f64, by: f64| (by * w - value * slope[2]) / (w * w);
        ([x / w, y / w], [derived(x, slope[0]), derived(y, slope[1])])
    }
}
