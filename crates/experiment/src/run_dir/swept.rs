//! Result of a sweep: failures of an ego over the values of one parameter.

use serde::{Deserialize, Serialize};

use super::{Partial, Row};
use crate::stats::StartOutcome;

/// One value of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepPoint {
    /// Value of the parameter, in its own unit.
    pub value: f64,
    /// Starts with a result for this ego.
    pub starts: usize,
    /// Starts from which any ado or search makes it fail.
    pub failing: usize,
    /// Progress of an interrupted value, whose `failing` is a lower bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partial: Option<Partial>,
}

impl SweepPoint {
    /// Returns the failures of an ego from all of its rows.
    pub fn of(value: f64, rows: &[Row]) -> SweepPoint {
        let starts = rows.iter().map(|row| row.solved.len()).max().unwrap_or(0);
        let outcomes = |start: usize| rows.iter().filter_map(move |row| row.solved.get(start));
        let (mut valid, mut failing, mut open, mut of) = (0, 0, 0, 0);
        for start in 0..starts {
            let is_any = |wanted| outcomes(start).any(|outcome| *outcome == wanted);
            let fails = is_any(StartOutcome::Solved);
            valid += usize::from(outcomes(start).any(|outcome| outcome.score().is_some()));
            failing += usize::from(fails);
            // One success decides a start, whatever the other rows have left open.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Returns the result of a sweep, with its safe values.
    pub fn of(parameter: &str, points: Vec<SweepPoint>) -> Swept {
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

    /// Returns the first value whose counts contradict each other. A file may hold any.
    pub fn contradiction(&self) -> Option<f64> {
        let mut points = self.points.iter();
        let wrong = points.find(|point| point.failing > point.starts);
        wrong.map(|point| point.value)
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
    fn counts_that_contradict_each_other_are_found() {
        assert_eq!(swept(&[3, 10]).contradiction(), None);
        assert_eq!(swept(&[3, 11]).contradiction(), Some(1.0));
    }
}
