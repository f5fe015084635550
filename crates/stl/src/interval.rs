//! Intervals of robustness, with absolute values and negations of them.

use crate::trace_operators::{Extremum, Max, Min, opposite};

/// Values that a robustness can still take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Least possible value.
    pub lo: f64,
    /// Greatest possible value.
    pub hi: f64,
}

impl Interval {
    /// All values.
    pub const ANY: Interval = Interval {
        lo: f64::NEG_INFINITY,
        hi: f64::INFINITY,
    };

    /// Returns true if no further sample can change the value.
    pub fn is_final(self) -> bool {
        self.lo == self.hi
    }

    /// Returns true if the formula can no longer be satisfied (ρ < 0).
    pub fn is_violated(self) -> bool {
        self.hi < 0.0
    }

    /// Returns true if the formula is satisfied in any continuation (ρ > 0).
    pub fn is_kept(self) -> bool {
        self.lo > 0.0
    }

    /// Returns true if `value` is still possible.
    pub fn contains(self, value: f64) -> bool {
        self.lo <= value && value <= self.hi
    }

    pub(crate) fn exactly(value: f64) -> Interval {
        Interval {
            lo: value,
            hi: value,
        }
    }

    pub(crate) fn map(self, f: impl Fn(f64) -> f64) -> Interval {
        Interval {
            lo: f(self.lo),
            hi: f(self.hi),
        }
    }

    pub(crate) fn absolute(self) -> Interval {
        let (lo, hi) = (self.lo.abs(), self.hi.abs());
        // The least absolute value of an interval around 0 is 0, not that of an end.
        Interval {
            lo: if self.contains(0.0) {
                0.0
            } else {
                Min::pick(lo, hi)
            },
            hi: Max::pick(lo, hi),
        }
    }

    pub(crate) fn negated(self) -> Interval {
        Interval {
            lo: opposite(self.hi),
            hi: opposite(self.lo),
        }
    }
}
