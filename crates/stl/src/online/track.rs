//! What an online monitor remembers of one operator.

use std::collections::VecDeque;

use crate::apply::Operand;
use crate::kernel::{Extremum, View};

/// The bounds of an operator at the samples `first ..` known so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) first: usize,
    pub(super) lower: Vec<f64>,
    /// Not used by operators that look at the present and the past only.
    pub(super) upper: Vec<f64>,
    /// The value at the latest sample, of such operators.
    pub(super) now: f64,
    /// What such an operator carries from sample to sample.
    pub(super) carried: Option<f64>,
    /// Of historically and once: the samples that can still be its extremum.
    queue: VecDeque<(usize, f64)>,
}

impl Track {
    pub(super) fn operand(&self) -> Operand<'_> {
        let upper = if self.upper.is_empty() {
            &self.lower
        } else {
            &self.upper
        };
        let view = |values| View {
            first: self.first,
            values,
        };
        Operand {
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

    /// The extremum from sample `first` (`None`: of all) to the new value.
    ///
    /// What a newer value beats never matters again, so that each sample enters
    /// and leaves the queue once; without an end only the best one stays.
    pub(super) fn slide<E: Extremum>(
        &mut self,
        first: Option<usize>,
        new: Option<(usize, f64)>,
    ) -> f64 {
        if let Some((sample, value)) = new {
            while self
                .queue
                .back()
                .is_some_and(|old| E::pick(old.1, value) == value)
            {
                self.queue.pop_back();
            }
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
