//! Outcomes of the starts of a row.

use std::fmt;
use std::ops::Deref;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr};

use super::interval::mcnemar;

/// Outcome of one start.
///
/// Rows of a campaign have it as a word, other rows as a mark.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    EnumString,
    IntoStaticStr,
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

    /// Returns whether the ego fails, with an adversary or without one.
    ///
    /// A trivial start of one ego alone is a failure of that ego.
    fn is_failure(self) -> bool {
        matches!(self, StartOutcome::Solved | StartOutcome::Trivial)
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
    /// Number of starts that are valid for both, and trivial for at most one.
    pub compared: usize,
    /// Starts from which the new ego fails and the old one does not.
    pub newly_failing: Vec<usize>,
    /// Starts from which the old ego fails and the new one does not.
    ///
    /// An ado that breaks its rule gives no answer, so its starts are in `no_answer`.
    pub newly_fixed: Vec<usize>,
    /// Starts from which both fail.
    pub both_fail: Vec<usize>,
    /// Starts on which an ado breaks its rule against the new ego only.
    pub no_answer: Vec<usize>,
    /// Number of starts on which both egos have an answer.
    ///
    /// No ado breaks its rule on them.
    pub answered: usize,
    /// Newly failing starts on which an ado breaks its rule against the old ego.
    pub unanswered_before: usize,
    /// Starts without a result for the new ego.
    pub new_not_run: usize,
    /// Starts without a result for the old ego.
    pub old_not_run: usize,
}

impl Flips {
    /// Compares two egos, start by start.
    pub fn of(new: &[StartOutcome], old: &[StartOutcome]) -> Flips {
        use StartOutcome::{Invalid, NotReached, RuleViolation, Trivial};
        let mut flips = Flips::default();
        for (start, (new, old)) in new.iter().copied().zip(old.iter().copied()).enumerate() {
            let has_no_result = |outcome| matches!(outcome, Invalid | NotReached);
            flips.new_not_run += usize::from(has_no_result(new));
            flips.old_not_run += usize::from(has_no_result(old));
            // A start that is trivial for both shows no difference between the egos.
            if has_no_result(new) || has_no_result(old) || (new, old) == (Trivial, Trivial) {
                continue;
            }
            flips.compared += 1;
            let foul = (new == RuleViolation, old == RuleViolation);
            flips.answered += usize::from(foul == (false, false));
            match (new.is_failure(), old.is_failure()) {
                (true, true) => flips.both_fail.push(start),
                (true, false) => {
                    flips.newly_failing.push(start);
                    flips.unanswered_before += usize::from(foul.1);
                }
                (false, _) if foul == (true, false) => flips.no_answer.push(start),
                (false, true) => flips.newly_fixed.push(start),
                (false, false) => {}
            }
        }
        flips
    }

    /// Returns the exact p-value of McNemar's test on the flipped starts.
    ///
    /// It uses the starts on which both egos have an answer.
    pub fn p_value(&self) -> f64 {
        let worse = self.newly_failing.len() - self.unanswered_before;
        mcnemar(worse, self.newly_fixed.len())
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

    /// Flips of starts with the outcomes of a new and an old ego.
    fn flips(pairs: &[(StartOutcome, StartOutcome)]) -> Flips {
        let (new, old): (Vec<_>, Vec<_>) = pairs.iter().copied().unzip();
        Flips::of(&new, &old)
    }

    #[test]
    fn a_rule_broken_against_the_new_ego_is_no_fix() {
        use StartOutcome::{Held, RuleViolation, Solved, Uncounted};
        let found = flips(&[
            (RuleViolation, Solved),
            (RuleViolation, Held),
            (RuleViolation, RuleViolation),
            (Held, Solved),
            (Uncounted, Solved),
            (Solved, RuleViolation),
            (Solved, Uncounted),
            (Solved, Solved),
            (Held, Held),
        ]);
        assert_eq!(found.no_answer, [0, 1]);
        assert_eq!(found.newly_fixed, [3, 4]);
        assert_eq!(found.newly_failing, [5, 6]);
        assert_eq!(found.both_fail, [7]);
        assert_eq!((found.compared, found.answered), (9, 5));
        // A start without an answer of the old ego is no pair of McNemar's test.
        assert_eq!(found.unanswered_before, 1);
        assert_eq!(found.p_value(), mcnemar(1, 2));
    }

    #[test]
    fn starts_that_an_ego_did_not_run_are_counted_and_not_compared() {
        use StartOutcome::{Held, Invalid, NotReached, Solved};
        let found = flips(&[
            (Invalid, Held),
            (NotReached, Solved),
            (Invalid, Invalid),
            (Solved, Invalid),
            (Held, Solved),
        ]);
        assert_eq!((found.new_not_run, found.old_not_run), (3, 2));
        assert_eq!((found.compared, found.newly_fixed), (1, vec![4]));
        assert!(found.newly_failing.is_empty());
    }

    #[test]
    fn a_start_that_only_the_new_ego_fails_by_itself_is_a_new_failure() {
        use StartOutcome::{Held, Solved, Trivial};
        let found = flips(&[
            (Trivial, Held),
            (Trivial, Solved),
            (Trivial, Trivial),
            (Held, Trivial),
        ]);
        assert_eq!(found.newly_failing, [0]);
        assert_eq!(found.both_fail, [1]);
        assert_eq!(found.newly_fixed, [3]);
        assert_eq!(found.compared, 3);
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
