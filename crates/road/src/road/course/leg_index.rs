//! Search for the nearest leg of a course.

use super::{Course, Leg, OnRoad};
use crate::pose::Pose;

/// Up to this number of legs, all are searched: skipping costs more than it saves.
const FEW_LEGS: usize = 8;
/// Number of legs in a box.
const BOXED_LEGS: usize = 8;
/// Tolerance of the search radius, which covers rounding of distances.
///
/// The distance to an arc is rounded by the 16th digit of its radius.
const SAME_M: f64 = 1e-3;

/// Places of the legs of a course.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LegIndex {
    /// A disc around each leg.
    discs: Vec<LegDisc>,
    /// A box around the first leg, and around each [`BOXED_LEGS`] later ones.
    boxes: Vec<LegBox>,
}

/// Disc around a leg: half of its length is the farthest from its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LegDisc {
    middle_m: [f64; 2],
    radius_m: f64,
}

/// Box around consecutive legs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LegBox {
    least_m: [f64; 2],
    most_m: [f64; 2],
}

/// A leg with the distance to it and the coordinates at its nearest point.
struct FoundLeg {
    number: usize,
    away_m: f64,
    at: OnRoad,
}

impl LegIndex {
    /// Returns the index of the first leg.
    pub(super) fn of(first: &Leg) -> LegIndex {
        let mut index = LegIndex::default();
        index.push(first);
        index
    }

    /// Appends a leg.
    pub(super) fn push(&mut self, leg: &Leg) {
        let (around, legs) = (leg.bounds(), self.discs.len());
        match self.boxes.last_mut() {
            // The first leg, which is long, has a box of its own.
            Some(last) if !(legs - 1).is_multiple_of(BOXED_LEGS) => last.include(around),
            _ => self.boxes.push(around),
        }
        self.discs.push(leg.disc());
    }

    /// Returns the numbers of the legs of a box.
    fn boxed(&self, number: usize) -> core::ops::Range<usize> {
        let first = number.checked_sub(1).map_or(0, |nth| 1 + nth * BOXED_LEGS);
        let behind = 1 + number * BOXED_LEGS;
        first..behind.min(self.discs.len())
    }

    /// Returns a leg that is probably the nearest.
    fn guess(&self, pose: &Pose) -> usize {
        let away_m2 = self.boxes.iter().map(|it| it.away_m2(pose));
        let near = away_m2.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
        let legs = self.boxed(near.map_or(0, |(number, _)| number));
        let away_m = legs.map(|leg| (leg, self.discs[leg].away_m(pose)));
        let least = away_m.min_by(|(_, a), (_, b)| a.total_cmp(b));
        least.map_or(0, |(leg, _)| leg)
    }
}

impl Course {
    /// Returns the distance to the course and the coordinates at its nearest point.
    pub(in crate::road) fn nearest(&self, pose: &Pose) -> (f64, OnRoad) {
        let mut nearest: Option<(f64, OnRoad)> = None;
        if self.legs.len() <= FEW_LEGS {
            for leg in &self.legs {
                keep_nearer(&mut nearest, leg.locate(pose));
            }
        } else {
            self.search(pose, &mut nearest);
        }
        // Without legs, the road is world x.
        nearest.unwrap_or_else(|| (pose.y_m.abs(), self.locate(pose)))
    }

    /// Searches the legs that may be nearer than a guess, in their order.
    fn search(&self, pose: &Pose, nearest: &mut Option<(f64, OnRoad)>) {
        let number = self.index.guess(pose);
        let (away_m, at) = self.legs[number].locate(pose);
        let guess = FoundLeg { number, away_m, at };
        // No leg beyond this distance is nearer than the guess.
        let within_m = guess.away_m + SAME_M;
        for (number, around) in self.index.boxes.iter().enumerate() {
            if within_m * within_m < around.away_m2(pose) {
                continue;
            }
            for leg in self.index.boxed(number) {
                if leg == guess.number {
                    keep_nearer(nearest, (guess.away_m, guess.at));
                } else if self.index.discs[leg].away_m(pose) <= within_m {
                    keep_nearer(nearest, self.legs[leg].locate(pose));
                }
            }
        }
    }
}

/// Keeps the nearer of two, and the earlier of two equally near ones.
fn keep_nearer(nearest: &mut Option<(f64, OnRoad)>, found: (f64, OnRoad)) {
    if nearest.as_ref().is_none_or(|(best_m, _)| found.0 < *best_m) {
        *nearest = Some(found);
    }
}

impl LegDisc {
    /// Returns the distance from a pose to the disc, negative inside.
    fn away_m(&self, pose: &Pose) -> f64 {
        let (dx, dy) = (pose.x_m - self.middle_m[0], pose.y_m - self.middle_m[1]);
        (dx * dx + dy * dy).sqrt() - self.radius_m
    }
}

impl LegBox {
    fn include(&mut self, other: LegBox) {
        for axis in 0..2 {
            self.least_m[axis] = self.least_m[axis].min(other.least_m[axis]);
            self.most_m[axis] = self.most_m[axis].max(other.most_m[axis]);
        }
    }

    /// Returns the square of the distance from a pose to the box.
    fn away_m2(&self, pose: &Pose) -> f64 {
        let off_m = |at_m: f64, axis: usize| {
            (self.least_m[axis] - at_m)
                .max(at_m - self.most_m[axis])
                .max(0.0)
        };
        let (dx, dy) = (off_m(pose.x_m, 0), off_m(pose.y_m, 1));
        dx * dx + dy * dy
    }
}

impl Leg {
    /// Returns a disc around the leg.
    fn disc(&self) -> LegDisc {
        let middle = self.pose(0.5 * self.length_m, 0.0);
        LegDisc {
            middle_m: [middle.x_m, middle.y_m],
            radius_m: 0.5 * self.length_m,
        }
    }

    /// Returns a box around the leg.
    fn bounds(&self) -> LegBox {
        if self.curvature_per_m == 0.0 {
            let end = self.pose(self.length_m, 0.0);
            return LegBox {
                least_m: [self.start.x_m.min(end.x_m), self.start.y_m.min(end.y_m)],
                most_m: [self.start.x_m.max(end.x_m), self.start.y_m.max(end.y_m)],
            };
        }
        let LegDisc { middle_m, radius_m } = self.disc();
        LegBox {
            least_m: middle_m.map(|at_m| at_m - radius_m),
            most_m: middle_m.map(|at_m| at_m + radius_m),
        }
    }
}
