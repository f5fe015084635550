//! Memory of an online monitor for one operator.

use std::collections::VecDeque;

use crate::apply::OperandBounds;
use crate::kernel::{Extremum, View};

/// Bounds of an operator at the known samples `first ..`.
///
/// The part without an upper bound is decided. An operator whose undecided samples
/// nobody reads has only decided samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) first: usize,
    pub(super) lower: Vec<f64>,
    /// Upper bounds, empty while all samples in `lower` are decided.
    pub(super) upper: Vec<f64>,
    /// Latest value of an operator of the present and the past.
    pub(super) now: f64,
    /// Value that an operator of the past carries from sample to sample.
    pub(super) carried: Option<f64>,
    /// Operand of a window, right side of a since.
    pub(super) window: SlidingExtremum,
    /// Left side between the sample and the window of an until or a since.
    pub(super) guard: SlidingExtremum,
    /// Left side from the sample to the end of the window of an unless.
    pub(super) throughout: SlidingExtremum,
    /// Both sides in the window of an until.
    pub(super) pairs: SlidingUntil,
}

impl Track {
    pub(super) fn operand(&self) -> OperandBounds<'_> {
        // Decided samples are exact, so one vector serves both bounds.
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

    /// Returns a decided value, `None` if it is not stored.
    pub(super) fn at(&self, sample: usize) -> Option<f64> {
        let values = &self.lower;
        View {
            first: self.first,
            values,
        }
        .at(sample)
    }

    pub(super) fn clear(&mut self) {
        self.lower.clear();
        self.upper.clear();
        self.window.clear();
        self.guard.clear();
        self.throughout.clear();
        self.pairs.clear();
        (self.first, self.now, self.carried) = (0, 0.0, None);
    }

    /// Appends the value of sample `sample`, the first one or the next one.
    pub(super) fn store(&mut self, sample: usize, value: f64) {
        if self.lower.is_empty() {
            self.first = sample;
        }
        self.lower.push(value);
    }

    /// Makes room for bounds up to sample `known`, of which those before `from` are decided.
    pub(super) fn open(&mut self, from: usize, known: usize) {
        let decided = from - self.first;
        if self.upper.len() < decided {
            // Only decided samples were stored until now, so both bounds agree.
            self.upper.clear();
            self.upper.extend_from_slice(&self.lower[..decided]);
        }
        self.lower.resize(known - self.first, 0.0);
        self.upper.resize(known - self.first, 0.0);
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

/// Extremum of a window that only moves forwards.
#[derive(Clone, Debug, Default)]
pub(super) struct SlidingExtremum {
    /// Samples that can still be the extremum.
    queue: VecDeque<(usize, f64)>,
}

impl SlidingExtremum {
    fn clear(&mut self) {
        self.queue.clear();
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
}

/// Until over the last samples: the best goal, and the guard of all samples.
#[derive(Clone, Copy, Debug)]
struct UntilPart {
    best: f64,
    guard: f64,
}

impl UntilPart {
    fn neutral<E: Extremum>() -> UntilPart {
        UntilPart {
            best: E::NEUTRAL,
            guard: <E::Dual as Extremum>::NEUTRAL,
        }
    }

    /// Joins the samples after `self`: their goals need its guard.
    fn then<E: Extremum>(self, later: UntilPart) -> UntilPart {
        UntilPart {
            best: E::pick(self.best, E::Dual::pick(self.guard, later.best)),
            guard: E::Dual::pick(self.guard, later.guard),
        }
    }
}

/// Until over a window of fixed width that moves by one sample at a time.
///
/// Joining is associative but cannot be undone. The older samples therefore carry
/// the join of themselves with all later older samples, and the newer samples a
/// single join. Each sample changes from newer to older once.
#[derive(Clone, Debug, Default)]
pub(super) struct SlidingUntil {
    older: Vec<UntilPart>,
    newer: Vec<UntilPart>,
    joined: Option<UntilPart>,
}

impl SlidingUntil {
    fn clear(&mut self) {
        self.older.clear();
        self.newer.clear();
        self.joined = None;
    }

    /// Adds a sample, and returns the until over the last `width` samples.
    pub(super) fn slide<E: Extremum>(&mut self, width: usize, guard: f64, goal: f64) -> f64 {
        if self.older.len() + self.newer.len() == width {
            self.drop_oldest::<E>();
        }
        let new = UntilPart { best: goal, guard };
        self.newer.push(new);
        let newer = match self.joined {
            Some(joined) => joined.then::<E>(new),
            None => new,
        };
        self.joined = Some(newer);
        match self.older.last() {
            Some(older) => older.then::<E>(newer).best,
            None => newer.best,
        }
    }

    fn drop_oldest<E: Extremum>(&mut self) {
        if self.older.is_empty() {
            let mut joined = UntilPart::neutral::<E>();
            for part in self.newer.drain(..).rev() {
                joined = part.then::<E>(joined);
                self.older.push(joined);
            }
            self.joined = None;
        }
        self.older.pop();
    }
}
