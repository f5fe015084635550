//! Outcomes of the starts of a row.

use std::fmt;
use std::ops::Deref;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::interval::mcnemar;

/// Outcome of one start.
///
/// Rows of a campaign have it as a word, other rows as a mark.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum StartOutcome {
    /// The ego failed and every rule was kept: `1`.
    #[serde(rename = "fails")]
    #[strum(serialize = "fails")]
    Solved,
    /// Union of the next three, which share a mark: `0`.
    #[serde(skip)]
    Unsolved,
    /// The ego kept its specification: `0`.
    Held,
    /// A rule was broken first: `0`.
    #[serde(rename = "foul")]
    #[strum(serialize = "foul")]
    RuleViolation,
    /// The ego violated its specification, but not in a way that counts: `0`.
    Uncounted,
    /// Left out, since the nominal ego fails without an adversary: `t`.
    Trivial,
    /// The ego or the physics failed to run: `x`.
    Invalid,
    /// Interrupted before its turn: `-`.
    #[serde(skip)]
    NotReached,
}

impl StartOutcome {
    /// Outcomes with marks of their own.
    const MARKS: [(StartOutcome, char); 5] = [
        (StartOutcome::Solved, '1'),
        (StartOutcome::Unsolved, '0'),
        (StartOutcome::Trivial, 't'),
        (StartOutcome::Invalid, 'x'),
        (StartOutcome::NotReached, '-'),
    ];

    /// Returns 1 if solved and 0 if not. `None` if the start is in no rate.
    pub fn score(self) -> Option<f64> {
        match self.marked() {
            StartOutcome::Solved => Some(1.0),
            StartOutcome::Unsolved => Some(0.0),
            _ => None,
        }
    }

    /// Returns the outcome of its mark.
    fn marked(self) -> StartOutcome {
        use StartOutcome::{Held, RuleViolation, Uncounted, Unsolved};
        match self {
            Held | RuleViolation | Uncounted => Unsolved,
            other => other,
        }
    }
}

impl fmt::Display for StartOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut marks = Self::MARKS.iter();
        let mark = marks.find(|(outcome, _)| *outcome == self.marked());
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
        Outcomes(outcomes.into_iter().map(StartOutcome::marked).collect())
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

/// Comparison of the outcomes of two egos over the same starts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Flips {
    /// Number of starts that are valid and not trivial for both.
    pub compared: usize,
    /// Starts from which the new ego fails and the old one does not.
    pub newly_failing: Vec<usize>,
    /// Starts from which the old ego fails and the new one does not.
    pub newly_fixed: Vec<usize>,
    /// Starts from which both fail.
    pub both_fail: Vec<usize>,
}

impl Flips {
    /// Compares two egos, start by start.
    pub fn of(new: &[StartOutcome], old: &[StartOutcome]) -> Flips {
        use StartOutcome::{Solved, Unsolved};
        let mut flips = Flips::default();
        for (start, (new, old)) in new.iter().zip(old).enumerate() {
            match (new.marked(), old.marked()) {
                (Solved, Unsolved) => flips.newly_failing.push(start),
                (Unsolved, Solved) => flips.newly_fixed.push(start),
                (Solved, Solved) => flips.both_fail.push(start),
                (Unsolved, Unsolved) => {}
                // Other starts show no difference between the egos.
                _ => continue,
            }
            flips.compared += 1;
        }
        flips
    }

    /// Returns the exact p-value of McNemar's test on the flipped starts.
    pub fn p_value(&self) -> f64 {
        mcnemar(self.newly_failing.len(), self.newly_fixed.len())
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
    fn campaigns_have_words_for_what_marks_join() {
        use StartOutcome::{Held, Invalid, RuleViolation, Solved, Trivial, Uncounted};
        let all = [Solved, Held, RuleViolation, Uncounted, Trivial, Invalid];
        let words = serde_json::to_string(&all).expect("text");
        assert_eq!(
            words,
            r#"["fails","held","foul","uncounted","trivial","invalid"]"#
        );
        assert_eq!(
            words,
            format!("{:?}", all.map(<&str>::from)).replace(' ', "")
        );
        let read: [StartOutcome; 6] = serde_json::from_str(&words).expect("outcomes");
        assert_eq!(read, all);
        let marks: Outcomes = all.into_iter().collect();
        assert_eq!(marks.to_string(), "1000tx");
        assert_eq!(marks, "1000tx".parse().expect("marks"));
        // A row of a campaign says why a start is not solved.
        for vague in ["\"unsolved\"", "\"not_reached\""] {
            assert!(
                serde_json::from_str::<StartOutcome>(vague).is_err(),
                "{vague}"
            );
        }
    }

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
