//! Outcomes of the starts of a row.

use std::fmt;
use std::ops::Deref;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::rulebook::Verdict;

/// Outcome of one start of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StartOutcome {
    /// The ego failed and every rule was kept: `1`.
    Solved,
    /// The ego held, or a rule was broken first: `0`.
    Unsolved,
    /// Left out, since the nominal ego fails without an adversary: `t`.
    Trivial,
    /// The ego or the physics failed to run: `x`.
    Invalid,
    /// Interrupted before its turn: `-`.
    NotReached,
}

impl StartOutcome {
    /// All outcomes with their marks in files.
    const MARKS: [(StartOutcome, char); 5] = [
        (StartOutcome::Solved, '1'),
        (StartOutcome::Unsolved, '0'),
        (StartOutcome::Trivial, 't'),
        (StartOutcome::Invalid, 'x'),
        (StartOutcome::NotReached, '-'),
    ];

    /// Returns the outcome of a verdict.
    pub fn of(verdict: &Verdict) -> StartOutcome {
        match verdict {
            Verdict::Counterexample { .. } => StartOutcome::Solved,
            Verdict::Uncounted { .. } | Verdict::Held { .. } | Verdict::Foul { .. } => {
                StartOutcome::Unsolved
            }
            Verdict::Invalid => StartOutcome::Invalid,
        }
    }

    /// Returns 1 if solved and 0 if not. `None` if the start is in no rate.
    pub fn score(self) -> Option<f64> {
        match self {
            StartOutcome::Solved => Some(1.0),
            StartOutcome::Unsolved => Some(0.0),
            StartOutcome::Trivial | StartOutcome::Invalid | StartOutcome::NotReached => None,
        }
    }
}

impl fmt::Display for StartOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut marks = Self::MARKS.iter();
        let mark = marks.find(|(outcome, _)| outcome == self);
        mark.map_or(Ok(()), |(_, mark)| write!(f, "{mark}"))
    }
}

/// Outcomes of the starts of a row in order. Files contain them as marks.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Outcomes(Vec<StartOutcome>);

impl Outcomes {
    /// Returns the number of starts with an outcome.
    pub fn count(&self, outcome: StartOutcome) -> usize {
        self.iter().filter(|other| **other == outcome).count()
    }
}

impl Deref for Outcomes {
    type Target = [StartOutcome];

    fn deref(&self) -> &[StartOutcome] {
        &self.0
    }
}

impl FromIterator<StartOutcome> for Outcomes {
    fn from_iter<I: IntoIterator<Item = StartOutcome>>(outcomes: I) -> Outcomes {
        Outcomes(outcomes.into_iter().collect())
    }
}

impl fmt::Display for Outcomes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.iter().try_for_each(|outcome| outcome.fmt(f))
    }
}

impl From<Outcomes> for String {
    fn from(outcomes: Outcomes) -> String {
        outcomes.to_string()
    }
}

/// Unknown mark of an outcome.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{mark}` is no outcome of a start: 1 solved, 0 not, t trivial, x invalid, - not reached")]
pub struct UnknownMark {
    /// Character that is none of `1 0 t x -`.
    pub mark: char,
}

impl FromStr for Outcomes {
    type Err = UnknownMark;

    fn from_str(marks: &str) -> Result<Outcomes, UnknownMark> {
        let of = |mark: char| {
            let mut known = StartOutcome::MARKS.iter();
            let found = known.find(|(_, other)| *other == mark);
            found
                .map(|(outcome, _)| *outcome)
                .ok_or(UnknownMark { mark })
        };
        marks.chars().map(of).collect()
    }
}

impl TryFrom<String> for Outcomes {
    type Error = UnknownMark;

    fn try_from(marks: String) -> Result<Outcomes, UnknownMark> {
        marks.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_outcomes_and_nothing_else_is() {
        let outcomes: Outcomes = serde_json::from_str("\"10tx-\"").expect("marks");
        assert_eq!(outcomes.len(), StartOutcome::MARKS.len());
        assert_eq!(serde_json::to_string(&outcomes).expect("text"), "\"10tx-\"");
        assert!(
            StartOutcome::MARKS
                .iter()
                .all(|(outcome, _)| outcomes.count(*outcome) == 1)
        );
        let refused = serde_json::from_str::<Outcomes>("\"1?\"").expect_err("no mark");
        assert!(
            refused.to_string().starts_with("`?` is no outcome"),
            "{refused}"
        );
    }
}
