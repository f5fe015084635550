//! Numbers that a start draws.

/// A fixed number, or a range from which starts are drawn uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value.
    pub lo: f64,
    /// Greatest value, equal to `lo` for a fixed number.
    pub hi: f64,
}

impl Range {
    /// Returns a range of a single number.
    pub fn fixed(value: f64) -> Range {
        Range {
            lo: value,
            hi: value,
        }
    }

    /// Returns whether the range has a single value.
    pub fn is_fixed(&self) -> bool {
        self.lo == self.hi
    }
}

impl From<f64> for Range {
    fn from(value: f64) -> Range {
        Range::fixed(value)
    }
}
