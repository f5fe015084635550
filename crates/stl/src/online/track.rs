//! Memory of an online monitor for one operator.

use std::collections::VecDeque;

use crate::apply::OperandBounds;
use crate::kernel::{Extremum, View};

/// Bounds of an operator at the known samples `first ..`.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) first: usize,
    pub(super) lower: Vec<f64>,
    /// Upper bounds, empty for operators of the present and the past.
    pub(super) upper: Vec<f64>,
    /// Latest value of an operator of the present and the past.
    pub(super) now: f64,
    /// Value that such an operator carries from sample to sample.
    pub(super) carried: Option<f64>,
    /// Samples that can still be the extremum of a historically or a once.
    queue: VecDeque<(usize, f64)>,
}

impl Track {
    pub(super) fn operand(&self) -> OperandBounds<'_> {
        // Operators of the present and the past are exact, so one vector serves both.
        let upper = if self.upper.is_empty() {
            &self.lower
        } else {
            &self.upper
        };
        let view = |values| View {
            first: self.first,
            values,
        };
        OperandBounds {
            lower: view(&self.lower),
            upper: view(upper),
        }
    }

    pub(super) fn clear(&mut self) {
        self.lower.clear();
        self.upper.clear();
        self.queue.clear();
        (self.first, self.now, self.carried) = (0, 0.0, None);
    }

    /// Returns the extremum from sample `first` (`None`: of all) to the new value.
    ///
    /// A value beaten by a newer value never matters again, so each sample enters and
    /// leaves the queue once. Without an end only the best value stays.
    pub(super) fn slide<E: Extremum>(
        &mut self,
        first: Option<usize>,
        new: Option<(usize, f64)>,
    ) -> f64 {
        if let Some((sample, value)) = new {
            // Equal values go as well: the newer value stays in the window longer.
            while self
                .queue
                .back()
                .is_some_and(|old| E::pick(old.1, value) == value)
            {
                self.queue.pop_back();
            }
            // In an endless window a worse value can never become the extremum.
            if first.is_some() || self.queue.is_empty() {
                self.queue.push_back((sample, value));
            }
        }
        while self
            .queue
            .front()
            .is_some_and(|old| first.is_some_and(|first| old.0 < first))
        {
            self.queue.pop_front();
        }
        self.queue.front().map_or(E::NEUTRAL, |extremum| extremum.1)
    }

    /// Keeps the last `keep` samples, in amortised constant time.
    pub(super) fn trim(&mut self, keep: usize) {
        // Trimmed only at twice the size, so that the copies are rare.
        if 2 * keep + 64 < self.lower.len() {
            let surplus = self.lower.len() - keep;
            self.lower.drain(..surplus);
            if !self.upper.is_empty() {
                self.upper.drain(..surplus);
            }
            self.first += surplus;
        }
    }
}
