//! Memory of an online monitor for one operator.

use crate::apply::OperandBounds;
use crate::sliding::{SlidingExtremum, SlidingJoin, UntilPart};
use crate::trace_operators::View;

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
    pub(super) pairs: SlidingJoin<UntilPart>,
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
