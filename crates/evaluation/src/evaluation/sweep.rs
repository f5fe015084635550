//! One parameter of the ego over a range: from where on it is safe.

use serde::Serialize;

use super::reuse::ReusedOn;
use crate::experiment::{EgoError, EgoUnderTest};
use crate::run_dir::{Partial, Row};
use crate::stats::StartOutcome;
use crate::world::{Change, Scenario};

/// Default number of values in a sweep.
const STEPS: usize = 7;
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
}

impl SweepError {
    /// The fix.
    pub fn help(&self) -> &'static str {
        "write for example `ego.time_gap_s=0.3..1.5:7`"
    }
}

impl Sweep {
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
    /// Another form, an empty range, or not 2 to 1000 values.
    pub fn parse(text: &str) -> Result<Sweep, SweepError> {
        let parts = || {
            let (name, range) = text.split_once('=')?;
            let name = name.trim().strip_prefix(PREFIX)?;
            let (range, steps) = match range.split_once(':') {
                Some((range, steps)) => (range, steps.trim().parse().ok()?),
                None => (range, STEPS),
            };
            let (lo, hi) = range.split_once("..")?;
            let number = |text: &str| text.trim().parse::<f64>().ok();
            Some((name, number(lo)?, number(hi)?, steps))
        };
        let (name, lo, hi, steps): (&str, f64, f64, usize) =
            parts().ok_or_else(|| SweepError::NoSweep {
                text: text.to_owned(),
            })?;
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
        Ok(Sweep {
            parameter: name.to_owned(),
            // Without the dust of binary fractions, since rows are named so.
            values: (0..steps).map(|i| (value(i) * 1e9).round() / 1e9).collect(),
        })
    }

    /// The egos, in the order of the values.
    ///
    /// # Errors
    /// The ego has no such parameter, or not such values.
    pub fn egos(&self, world: &Scenario) -> Result<Vec<EgoUnderTest>, EgoError> {
        let ego = |value: &f64| {
            let mut change = Change::default();
            change.ego.0.insert(self.parameter.clone(), *value);
            let name = format!("{} = {value}", self.parameter);
            EgoUnderTest::changed(world, &name, &change, "choose values that the ego may have")
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

/// One value of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SweepPoint {
    /// Value of the parameter, in its own unit.
    pub value: f64,
    /// Starts with a result for this ego.
    pub starts: usize,
    /// Starts from which any ado or search makes it fail.
    pub failing: usize,
    /// Progress of an interrupted value, whose `failing` is a lower bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partial: Option<Partial>,
}

impl SweepPoint {
    fn of(value: f64, rows: &[Row]) -> SweepPoint {
        let starts = rows.iter().map(|row| row.solved.len()).max().unwrap_or(0);
        let outcomes = |start: usize| rows.iter().filter_map(move |row| row.solved.get(start));
        let (mut valid, mut failing, mut open, mut of) = (0, 0, 0, 0);
        for start in 0..starts {
            let is_any = |wanted| outcomes(start).any(|outcome| *outcome == wanted);
            let fails = is_any(StartOutcome::Solved);
            valid += usize::from(outcomes(start).any(|outcome| outcome.score().is_some()));
            failing += usize::from(fails);
            open += usize::from(!fails && is_any(StartOutcome::NotReached));
            of += usize::from(!is_any(StartOutcome::Trivial));
        }
        SweepPoint {
            value,
            starts: valid,
            failing,
            partial: (open > 0).then_some(Partial {
                decided: of - open,
                of,
            }),
        }
    }
}

/// Safe values of a parameter, as far as these ados and searches show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Swept {
    /// Name of the parameter, without `ego.`.
    pub parameter: String,
    /// Values in rising order, with their failures.
    pub points: Vec<SweepPoint>,
    /// The least value from which on no start failed.
    pub safe_from: Option<f64>,
    /// The greatest value up to which no start failed.
    pub safe_up_to: Option<f64>,
}

impl Swept {
    fn of(parameter: &str, points: Vec<SweepPoint>) -> Swept {
        // A value without all of its results is no evidence of safety.
        let is_safe =
            |point: &&SweepPoint| point.starts > 0 && point.failing == 0 && point.partial.is_none();
        // Safety is reported only from an end of the range, without a failure in between.
        let from = points.iter().rev().take_while(is_safe).last();
        let up_to = points.iter().take_while(is_safe).last();
        Swept {
            parameter: parameter.to_owned(),
            safe_from: from.map(|point| point.value),
            safe_up_to: up_to.map(|point| point.value),
            points,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swept(failing: &[usize]) -> Swept {
        let points = failing.iter().enumerate().map(|(i, &failing)| SweepPoint {
            value: i as f64,
            starts: 10,
            failing,
            partial: None,
        });
        Swept::of("p", points.collect())
    }

    #[test]
    fn safety_begins_after_the_last_failure() {
        let safe = |failing: &[usize]| {
            let swept = swept(failing);
            (swept.safe_from, swept.safe_up_to)
        };
        assert_eq!(safe(&[3, 1, 0, 0]), (Some(2.0), None));
        assert_eq!(safe(&[3, 0, 1, 0]), (Some(3.0), None));
        assert_eq!(safe(&[0, 0, 1, 2]), (None, Some(1.0)));
        assert_eq!(safe(&[0, 0]), (Some(0.0), Some(1.0)));
        assert_eq!(safe(&[1, 1]), (None, None));
    }

    #[test]
    fn an_interrupted_value_is_not_safe() {
        let row = |solved: &str| {
            let row = serde_json::json!({
                "world": "w", "plant": "Kinematic", "judge": "UntilViolation", "ego": "e",
                "ado": "hold", "method": "m", "start_seed": 0, "starts": 1, "trivial": 1,
                "successes": 0, "success_rate": 0.0, "ci95": null, "foul_rate": 0.0,
                "contact_rate": 0.0, "invalid": 0, "sims_per_start": 1.0, "physics_steps": 0,
                "cpu_s": 0.0, "solved": solved,
            });
            serde_json::from_value::<Row>(row).expect("a row")
        };
        let whole = SweepPoint::of(1.0, &[row("t000"), row("t000")]);
        let cut = SweepPoint::of(2.0, &[row("t000"), row("t01-")]);
        assert_eq!((cut.starts, cut.failing), (3, 1));
        assert_eq!(cut.partial, Some(Partial { decided: 2, of: 3 }));
        let unknown = SweepPoint::of(3.0, &[row("t000"), row("t0--")]);
        let swept = Swept::of("p", vec![whole, unknown]);
        assert_eq!((swept.safe_from, swept.safe_up_to), (None, Some(1.0)));
    }

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
