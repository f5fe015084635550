//! One parameter of the ego over a range: from where on it is safe.

use super::changed_ego::with_values;
use super::reuse::ReusedOn;
use crate::experiment::{EgoError, EgoUnderTest};
use crate::run_dir::{SweepPoint, Swept};
use crate::world::Scenario;

/// Most values of a sweep.
const MAX_STEPS: usize = 1000;
/// Prefix of the parameters of the ego's controller.
const PREFIX: &str = "ego.";

/// A parameter of the ego's controller and the values it is given, ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Its name in the world file, without `ego.`.
    pub parameter: String,
    /// Values it is given in turn, ascending, in its own unit.
    pub values: Vec<f64>,
}

/// A text is no sweep.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// It has another form.
    #[error("`{text}` is no sweep over a parameter")]
    NoSweep {
        /// The text.
        text: String,
    },
    /// The range holds nothing.
    #[error("the range {lo}..{hi} of `{text}` is empty")]
    EmptyRange {
        /// Least value.
        lo: f64,
        /// Greatest value.
        hi: f64,
        /// The text.
        text: String,
    },
    /// Too few or too many values.
    #[error("a sweep has 2 to {MAX_STEPS} values, not {steps}")]
    Steps {
        /// Values asked for.
        steps: usize,
    },
    /// Values that are no different numbers.
    #[error("`{text}` has equal or infinite values at nine decimals")]
    Indistinct {
        /// The text.
        text: String,
    },
}

impl SweepError {
    /// The fix.
    pub fn help(&self) -> &'static str {
        "write for example `ego.time_gap_s=0.3..1.5:7`"
    }
}

impl Sweep {
    /// Default number of values.
    pub const STEPS: usize = 7;

    /// Parses `ego.NAME=LO..HI` or `ego.NAME=LO..HI:STEPS`.
    ///
    /// ```
    /// # use brakecheck_evaluation as brakecheck;
    /// use brakecheck::evaluation::Sweep;
    /// let sweep = Sweep::parse("ego.time_gap_s=0.5..1.5:3").unwrap();
    /// assert_eq!(sweep.values, [0.5, 1.0, 1.5]);
    /// ```
    ///
    /// # Errors
    /// Another form, an empty range, not 2 to 1000 values, or values that rounding makes
    /// equal or infinite.
    pub fn parse(text: &str) -> Result<Sweep, SweepError> {
        let parts = || {
            let (name, range) = text.split_once('=')?;
            let name = name.trim().strip_prefix(PREFIX)?;
            let (range, steps) = match range.split_once(':') {
                Some((range, steps)) => (range, steps.trim().parse().ok()?),
                None => (range, Sweep::STEPS),
            };
            let (lo, hi) = range.split_once("..")?;
            let number = |text: &str| text.trim().parse::<f64>().ok();
            Some((name, number(lo)?, number(hi)?, steps))
        };
        let (name, lo, hi, steps): (&str, f64, f64, usize) =
            parts().ok_or_else(|| SweepError::NoSweep {
                text: text.to_owned(),
            })?;
        // The parser of numbers also accepts `nan` and `inf`.
        if !(lo.is_finite() && hi.is_finite() && lo < hi) {
            return Err(SweepError::EmptyRange {
                lo,
                hi,
                text: text.to_owned(),
            });
        }
        // A single value is no range, and each value is a whole evaluation.
        if !(2..=MAX_STEPS).contains(&steps) {
            return Err(SweepError::Steps { steps });
        }
        let last = (steps - 1) as f64;
        // Both ends are values of the sweep.
        let value = |i: usize| lo + (hi - lo) * i as f64 / last;
        // Without the dust of binary fractions, since rows are named so.
        let rounded = |i: usize| (value(i) * 1e9).round() / 1e9;
        let values: Vec<f64> = (0..steps).map(rounded).collect();
        // Equal values would give two rows of one name.
        let ascending = values.is_sorted_by(|a, b| a < b);
        if !(ascending && values.iter().all(|value| value.is_finite())) {
            return Err(SweepError::Indistinct {
                text: text.to_owned(),
            });
        }
        Ok(Sweep {
            parameter: name.to_owned(),
            values,
        })
    }

    /// Returns the least and the greatest value.
    pub fn ends(&self) -> [f64; 2] {
        // Invariant: a sweep has two values at least.
        let [first, .., last] = self.values.as_slice() else {
            return [f64::NAN; 2];
        };
        [*first, *last]
    }

    /// The egos, in the order of the values.
    ///
    /// # Errors
    /// The ego has no such parameter, or not such values.
    pub fn egos(&self, world: &Scenario) -> Result<Vec<EgoUnderTest>, EgoError> {
        let own = EgoUnderTest::nominal(world);
        let ego = |value: &f64| {
            let name = format!("{} = {value}", self.parameter);
            with_values(&own, &name, &[(self.parameter.as_str(), *value)])
        };
        self.values.iter().map(ego).collect()
    }

    /// Returns the failures at each value, with `egos` in the order of the values.
    pub fn swept(&self, egos: &[ReusedOn]) -> Swept {
        let points = self
            .values
            .iter()
            .zip(egos)
            .map(|(value, ego)| SweepPoint::of(*value, &ego.rows));
        Swept::of(&self.parameter, points.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_sweep_is_refused() {
        for (text, says) in [
            ("time_gap_s=0..1", "no sweep"),
            ("ego.time_gap_s", "no sweep"),
            ("ego.time_gap_s=1", "no sweep"),
            ("ego.time_gap_s=1..x", "no sweep"),
            ("ego.time_gap_s=1..0.5", "is empty"),
            ("ego.time_gap_s=0..inf", "is empty"),
            ("ego.time_gap_s=0..1:1", "2 to 1000 values"),
            ("ego.time_gap_s=0..1:0.5", "no sweep"),
            ("ego.time_gap_s=0..1e-10", "equal or infinite"),
            ("ego.time_gap_s=0..1e300", "equal or infinite"),
        ] {
            let error = Sweep::parse(text).expect_err(text).to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
        assert_eq!(
            Sweep::parse("ego.lag_s=0..0.6")
                .expect("a sweep")
                .values
                .len(),
            7
        );
    }
}
