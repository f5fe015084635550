//! Search for the nearest leg of a course.

use crate::pose::Pose;

/// Number of legs in a box.
const BOXED_LEGS: usize = 8;

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
pub(super) struct LegDisc {
    pub(super) middle_m: [f64; 2],
    pub(super) radius_m: f64,
}

/// Box around consecutive legs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LegBox {
    pub(super) least_m: [f64; 2],
    pub(super) most_m: [f64; 2],
}

impl LegIndex {
    /// Returns the index of the first leg.
    pub(super) fn of(around: LegBox, disc: LegDisc) -> LegIndex {
        let mut index = LegIndex::default();
        index.push(around, disc);
        index
    }

    /// Appends a leg.
    pub(super) fn push(&mut self, around: LegBox, disc: LegDisc) {
        let legs = self.discs.len();
        match self.boxes.last_mut() {
            // The first leg, which is long, has a box of its own.
            Some(last) if !(legs - 1).is_multiple_of(BOXED_LEGS) => last.include(around),
            _ => self.boxes.push(around),
        }
        self.discs.push(disc);
    }

    /// Returns the numbers of the legs of a box.
    fn boxed(&self, number: usize) -> core::ops::Range<usize> {
        let first = number.checked_sub(1).map_or(0, |nth| 1 + nth * BOXED_LEGS);
        // Box 0 has the first leg alone, and each further one the next eight.
        let behind = 1 + number * BOXED_LEGS;
        first..behind.min(self.discs.len())
    }

    /// Returns a leg that is probably the nearest.
    pub(super) fn guess(&self, pose: &Pose) -> usize {
        let away_m2 = self.boxes.iter().map(|it| it.away_m2(pose));
        let near = away_m2.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
        let legs = self.boxed(near.map_or(0, |(number, _)| number));
        // By discs, which are cheaper than the legs and near enough for a guess.
        let away_m = legs.map(|leg| (leg, self.discs[leg].away_m(pose)));
        let least = away_m.min_by(|(_, a), (_, b)| a.total_cmp(b));
        least.map_or(0, |(leg, _)| leg)
    }

    /// Returns the guess and the other legs that may be within a distance, in their order.
    pub(super) fn within(
        &self,
        within_m: f64,
        pose: &Pose,
        guess: usize,
    ) -> impl Iterator<Item = usize> {
        let boxes = self.boxes.iter().enumerate();
        let near = boxes.filter(move |(_, around)| {
            // From a place that is no number nothing is beyond, so that the guess is found.
            let is_beyond = within_m * within_m < around.away_m2(pose);
            !is_beyond
        });
        let legs = near.flat_map(|(number, _)| self.boxed(number));
        legs.filter(move |leg| *leg == guess || self.discs[*leg].away_m(pose) <= within_m)
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
