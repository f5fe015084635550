//! Sliding windows over values that arrive one by one, in amortised O(1).

use std::collections::VecDeque;

use crate::interval::Interval;
use crate::trace_operators::{Extremum, Max, Min};

/// Extremum of a window that only moves forwards.
#[derive(Clone, Debug, Default)]
pub(crate) struct SlidingExtremum {
    /// Samples that can still be the extremum.
    queue: VecDeque<(usize, f64)>,
}

impl SlidingExtremum {
    pub(crate) fn clear(&mut self) {
        self.queue.clear();
    }

    /// Returns the extremum from sample `first` (`None`: of all) to the new value.
    ///
    /// A value beaten by a newer value never matters again, so each sample enters and
    /// leaves the queue once. Without an end only the best value stays.
    pub(crate) fn slide<E: Extremum>(
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
}

/// Associative join of consecutive samples.
pub(crate) trait Join: Copy {
    /// Joins the samples after `self`.
    fn then<E: Extremum>(self, later: Self) -> Self;
}

/// Join over a window of samples that grows at its end and shrinks at its start.
///
/// A join cannot be undone. The older samples therefore carry the join of themselves
/// with all later older samples, and the newer samples a single join. Each sample
/// changes from newer to older once.
#[derive(Clone, Debug)]
pub(crate) struct SlidingJoin<T> {
    older: Vec<T>,
    newer: Vec<T>,
    joined: Option<T>,
}

impl<T> Default for SlidingJoin<T> {
    fn default() -> SlidingJoin<T> {
        SlidingJoin {
            older: Vec::new(),
            newer: Vec::new(),
            joined: None,
        }
    }
}

impl<T: Join> SlidingJoin<T> {
    pub(crate) fn clear(&mut self) {
        self.older.clear();
        self.newer.clear();
        self.joined = None;
    }

    /// Adds a sample and keeps the last `width`, without a width all.
    pub(crate) fn push<E: Extremum>(&mut self, width: Option<usize>, new: T) {
        self.joined = Some(match self.joined {
            Some(joined) => joined.then::<E>(new),
            None => new,
        });
        // Samples that never leave need not be stored.
        if let Some(width) = width {
            self.newer.push(new);
            if width < self.older.len() + self.newer.len() {
                self.drop_oldest::<E>();
            }
        }
    }

    /// Returns the join of all samples in the window, `None` for no sample.
    pub(crate) fn join<E: Extremum>(&self) -> Option<T> {
        match (self.older.last(), self.joined) {
            (Some(older), Some(newer)) => Some(older.then::<E>(newer)),
            (older, newer) => newer.or(older.copied()),
        }
    }

    fn drop_oldest<E: Extremum>(&mut self) {
        if self.older.is_empty() {
            // Last first, so that each older sample knows the join of all behind it.
            let mut joined: Option<T> = None;
            for part in self.newer.drain(..).rev() {
                let part = joined.map_or(part, |later| part.then::<E>(later));
                self.older.push(part);
                joined = Some(part);
            }
            self.joined = None;
        }
        self.older.pop();
    }
}

/// Until over consecutive samples: its best goal, and the guard of all samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UntilPart {
    pub(crate) best: f64,
    pub(crate) guard: f64,
}

impl Join for UntilPart {
    fn then<E: Extremum>(self, later: UntilPart) -> UntilPart {
        UntilPart {
            // Later goals need the guard of all earlier samples.
            best: E::pick(self.best, E::Dual::pick(self.guard, later.best)),
            guard: E::Dual::pick(self.guard, later.guard),
        }
    }
}

/// Undecided operands of a window, as functions of the samples to come.
///
/// Let z be the value that the future operator will have after these samples. Logic
/// of known values and of z, in a single place, is always max(lo, min(hi, z)): its
/// bounds determine the function. The extremum of such functions and their
/// composition have this form again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenPart {
    /// Extremum of the operands at these samples.
    pub(crate) value: Interval,
    /// Future operator at the first of these samples.
    pub(crate) future: Interval,
}

impl Join for OpenPart {
    fn then<E: Extremum>(self, later: OpenPart) -> OpenPart {
        let value = after(self.value, later.future);
        OpenPart {
            value: Interval {
                lo: E::pick(value.lo, later.value.lo),
                hi: E::pick(value.hi, later.value.hi),
            },
            future: after(self.future, later.future),
        }
    }
}

/// Composes two functions, `later` applied first.
fn after(function: Interval, later: Interval) -> Interval {
    later.map(|z| at(function, z))
}

/// Returns max(lo, min(hi, z)).
pub(crate) fn at(function: Interval, z: f64) -> f64 {
    Max::pick(function.lo, Min::pick(function.hi, z))
}
