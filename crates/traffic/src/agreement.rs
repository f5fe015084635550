//! Quantities that a recording states twice: speeds and headings against positions.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::median::median;
use crate::problem::FileProblem;
use crate::raw::{RawRow, RawVector, wrapped};

/// Share by which the speeds of all road users may differ from their positions.
const SPEED_SHARE: f64 = 0.1;
/// Share by which those of a single road user may.
const OWN_SPEED_SHARE: f64 = 0.25;
/// Difference up to which a heading is the direction of motion, 20°.
const SAME_WAY_RAD: f64 = PI / 9.0;
/// Speed below which positions are too noisy to be compared, in m/s.
const MOVING_MPS: f64 = 2.0;
/// Time on either side of a place below which noise of the positions matters, in seconds.
const LEAST_REACH_S: f64 = 0.2;
/// Speed that no road user has, in m/s.
pub(crate) const FAST_MPS: f64 = 130.0;
/// Compared places of a road user.
const MOST_PLACES: usize = 200;

/// Units that a ratio of speeds suggests: ratio, and the unit in words.
const RATIOS: [(f64, &str); 8] = [
    (3.6, "km/h"),
    (2.236_94, "mph"),
    (3.280_84, "ft/s"),
    (1.943_84, "knots"),
    (1000.0, "times in milliseconds"),
    (0.3048, "positions in feet"),
    (1.0e9, "times in nanoseconds"),
    (1.0e6, "times in microseconds"),
];

/// Reading of angles of a file whose y points to the right.
const CLOCKWISE: &str = "clockwise angles, those of a y to the right";
/// Angle from which a reading of it differs from another, 2°.
const DISTINCT_RAD: f64 = PI / 90.0;
/// Places at which readings differ, below which they show nothing.
const LEAST_PLACES: usize = 15;

/// Share of directions that are not those of the motion, and a reading that fits.
type DirectionProblem = (f64, Option<&'static str>);

/// Comparison of the columns of all road users with their positions.
#[derive(Default)]
pub(crate) struct Agreement {
    /// Recorded speed over that of the positions.
    ratios: Vec<f64>,
    /// Recorded heading, and direction of motion.
    headings: Vec<(f64, f64)>,
    /// Direction of the recorded velocity, and that of the motion.
    courses: Vec<(f64, f64)>,
    /// Speeds of the positions in m/s.
    speeds_mps: Vec<f64>,
    /// Road users whose speeds differ from their positions.
    pub(crate) speeds_off: usize,
    /// Road users whose headings differ from their motion.
    pub(crate) headings_off: usize,
}

impl Agreement {
    /// Compares the samples of a road user, which are `dt_s` apart.
    pub(crate) fn add(&mut self, samples: &[RawRow], dt_s: f64) {
        // Half a second on either side, so that noise of positions does not matter.
        // Of a track of less than a second, half of it.
        let half = samples.len().saturating_sub(1) / 2;
        let reach = ((0.5 / dt_s).round() as usize).clamp(1, half.max(1));
        let places = samples.len().saturating_sub(2 * reach);
        if places == 0 || (reach as f64 * dt_s) < LEAST_REACH_S {
            return;
        }
        let first = (self.ratios.len(), self.headings.len());
        for i in (reach..samples.len() - reach).step_by(places.div_ceil(MOST_PLACES).max(1)) {
            let (a, b) = (&samples[i - reach], &samples[i + reach]);
            let (x, y) = (b.x_m - a.x_m, b.y_m - a.y_m);
            let speed_mps = libm::hypot(x, y) / (2.0 * reach as f64 * dt_s);
            let recorded = speed_of(&samples[i - reach..=i + reach]);
            // The greater of both, since a recorded speed of 0 on a moving
            // vehicle is a contradiction.
            if speed_mps.max(recorded.unwrap_or(0.0)) < MOVING_MPS {
                continue;
            }
            self.speeds_mps.push(speed_mps);
            if let Some(recorded) = recorded {
                self.ratios.push(recorded / speed_mps.max(1e-9));
            }
            if let RawVector::Components(vx, vy) = samples[i].velocity
                && speed_mps >= MOVING_MPS
            {
                self.courses.push((libm::atan2(vy, vx), libm::atan2(y, x)));
            }
            if let Some(heading_rad) = samples[i].heading_rad
                && speed_mps >= MOVING_MPS
            {
                // A vehicle that says it reverses heads away from its motion.
                let is_back = matches!(samples[i].velocity, RawVector::Along(along) if along < 0.0);
                let way = if is_back { -1.0 } else { 1.0 };
                self.headings
                    .push((heading_rad, libm::atan2(way * y, way * x)));
            }
        }
        // Only the entries of this road user, which this call has appended.
        let own = &mut self.ratios[first.0..];
        let off = median(own).is_some_and(|it| (it - 1.0).abs() > OWN_SPEED_SHARE);
        self.speeds_off += usize::from(off);
        let own = &self.headings[first.1..];
        let turned = own.iter().filter(|it| !is_same_way(it.0, it.1)).count();
        self.headings_off += usize::from(2 * turned > own.len());
    }

    /// Returns the contradiction that makes the recording useless, if there is one.
    ///
    /// `rate_hz` is that of a column of frames.
    pub(crate) fn problem(&mut self, rate_hz: Option<f64>) -> Option<FileProblem> {
        // First, because impossible speeds make every other comparison
        // useless.
        if let Some(speed_mps) = median(&mut self.speeds_mps).filter(|it| *it > FAST_MPS) {
            return Some(FileProblem::Fast { speed_mps });
        }
        // The median, so that single ghosts of a tracker do not condemn a
        // recording.
        let ratio = median(&mut self.ratios).unwrap_or(1.0);
        if (ratio - 1.0).abs() > SPEED_SHARE {
            return Some(FileProblem::SpeedsDiffer {
                ratio,
                fits: fits(ratio, rate_hz),
            });
        }
        let known = || self.heading_problem().or_else(|| mirrored(&self.headings));
        let heading = known().map(|(share, fits)| FileProblem::HeadingsDiffer { share, fits });
        heading.or_else(|| {
            let (_, fits) = mirrored(&self.courses)?;
            Some(FileProblem::VelocitiesDiffer { fits })
        })
    }

    /// Returns the share of headings that are not the course, and a reading that fits.
    fn heading_problem(&self) -> Option<DirectionProblem> {
        // Share of the headings that are the course, and the mean difference to it.
        let fit_of = |read: &dyn Fn(f64) -> f64| {
            let (mut same, mut off_rad) = (0, 0.0);
            for (heading, course) in &self.headings {
                same += usize::from(is_same_way(read(*heading), *course));
                off_rad += wrapped(read(*heading) - course).abs();
            }
            let count = self.headings.len() as f64;
            (same as f64 / count, off_rad / count)
        };
        // Fewer places fit some reading by chance.
        if self.headings.len() < 5 {
            return None;
        }
        let (share, _) = fit_of(&|it| it);
        let readings: [(&'static str, &dyn Fn(f64) -> f64); 6] = [
            ("degrees", &f64::to_radians),
            ("degrees of a compass, clockwise from north", &|it| {
                FRAC_PI_2 - it.to_radians()
            }),
            ("radians of a compass, clockwise from north", &|it| {
                FRAC_PI_2 - it
            }),
            (CLOCKWISE, &|it| -it),
            ("the direction of the rear", &|it| it + PI),
            // For radians that the map takes for degrees, so that they are
            // converted already.
            ("radians", &f64::to_degrees),
        ];
        let off: Vec<f64> = self
            .headings
            .iter()
            .filter(|it| !is_same_way(it.0, it.1))
            .map(|it| it.0.abs())
            .collect();
        // Read as degrees, any small error of a heading vanishes.
        let are_large = 2 * off.iter().filter(|it| **it > 1.0).count() > off.len();
        let best = readings
            .iter()
            .filter(|(name, _)| *name != "degrees" || are_large)
            .map(|(name, read)| (*name, fit_of(read)))
            // Of readings that fit alike, by chance some headings do: the nearer one.
            .max_by(|a, b| {
                let by_share = a.1.0.total_cmp(&b.1.0);
                by_share.then(b.1.1.total_cmp(&a.1.1))
            })
            .map(|(name, (share, _))| (name, share))?;
        let is_better = off.len() >= 5 && 1.0 - best.1 <= 0.3 * (1.0 - share) && best.1 > 0.9;
        (is_better || share < 0.6).then_some((1.0 - share, is_better.then_some(best.0)))
    }
}

/// Returns a reading by which small angles are those of the motion, unlike as they are.
///
/// On a road along x all angles are small, so that no reading is far off. A lane change to
/// the other side than that of the motion still shows an axis that is mirrored.
fn mirrored(pairs: &[(f64, f64)]) -> Option<DirectionProblem> {
    let readings: [(&'static str, &dyn Fn(f64) -> f64); 2] =
        [(CLOCKWISE, &|it| -it), ("degrees", &f64::to_radians)];
    readings.into_iter().find_map(|(name, read)| {
        // Places at which both readings nearly agree show nothing.
        let is_distinct = |it: &&(f64, f64)| wrapped(read(it.0) - it.0).abs() > DISTINCT_RAD;
        let distinct: Vec<&(f64, f64)> = pairs.iter().filter(is_distinct).collect();
        let (mut as_is, mut as_read, mut product, mut square) = (0.0, 0.0, 0.0, 0.0);
        for (angle, course) in &distinct {
            let (is, read) = (wrapped(angle - course), wrapped(read(*angle) - course));
            as_is += is * is;
            as_read += read * read;
            product += (read + course) * course;
            square += course * course;
        }
        // Noise of angles vanishes in degrees, but does not follow the motion.
        let follows = product > 0.7 * square && product < 1.4 * square && square > 0.0;
        let is_better = as_read < 0.25 * as_is && (name == CLOCKWISE || follows);
        let is_seen = distinct.len() >= LEAST_PLACES;
        (is_seen && is_better).then(|| {
            let share = distinct.len() as f64 / pairs.len() as f64;
            (share, Some(name))
        })
    })
}

fn is_same_way(heading_rad: f64, course_rad: f64) -> bool {
    wrapped(heading_rad - course_rad).abs() <= SAME_WAY_RAD
}

/// Returns the mean of the recorded speeds, `None` without them.
fn speed_of(samples: &[RawRow]) -> Option<f64> {
    let mut sum = 0.0;
    for row in samples {
        sum += match row.velocity {
            RawVector::Unknown => return None,
            RawVector::Along(value) => value.abs(),
            RawVector::Components(x, y) => libm::hypot(x, y),
        };
    }
    Some(sum / samples.len() as f64)
}

/// Returns the units or the rate that explain a ratio of speeds.
fn fits(ratio: f64, rate_hz: Option<f64>) -> Option<String> {
    // Twice the speed is another frame rate, and knots are 1.94 times.
    let is_near = |it: &&(f64, &str)| (ratio / it.0 - 1.0).abs() < 0.02;
    // A unit is the likelier mistake, so it comes before a frame rate.
    if let Some((_, unit)) = RATIOS.iter().find(is_near) {
        return Some((*unit).to_owned());
    }
    let rate_hz = rate_hz.map(|it| it * ratio)?;
    Some(format!("a frame rate of {rate_hz:.2} Hz"))
}
