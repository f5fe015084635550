//! A point as pages and JUnit files have it.

use super::{PointFailure, PointOutcome, PointResult, VOIDED, VariedPoint};
use crate::report::{PointCase, VariedCase};
use crate::testbench::FaultCount;

impl PointResult {
    /// Returns the point as pages and JUnit files have it.
    ///
    /// `voided_by` is the reason why no point of the ego is a result.
    pub(super) fn case(&self, voided_by: Option<&FaultCount>) -> PointCase {
        // JUnit viewers show the first line only, so it has leaf, time and contact.
        let words = |failure: &PointFailure| {
            let contact = failure.contact.as_ref().zip(failure.closing_mps).map_or(
                String::new(),
                |((one, other), closing_mps)| {
                    format!("; {one} and {other} touch at {closing_mps:.1} m/s")
                },
            );
            format!(
                "{} is violated at {:.2} s{contact}",
                failure.leaf, failure.violated_s
            )
        };
        PointCase {
            point: self.point,
            start: self
                .start
                .values()
                .map(|value| format!("{value:.3}"))
                .collect(),
            outcome: match self.outcome {
                PointOutcome::Passed => "passed",
                PointOutcome::Failed => "failed",
                PointOutcome::NoAnswer => "no answer",
                PointOutcome::Invalid if voided_by.is_some() => "no result",
                PointOutcome::Invalid => "did not run",
                PointOutcome::NotReached => "not reached",
            }
            .to_owned(),
            failure: self.failure.as_ref().map(words),
            invalid: (self.outcome == PointOutcome::Invalid).then(|| match voided_by {
                Some(fault) => format!("the ego {VOIDED} ({})", fault.kind.word()),
                None => "the ego or the physics failed to run".to_owned(),
            }),
            skipped: match self.outcome {
                PointOutcome::NoAnswer => Some("no answer: an ado broke its rule first".to_owned()),
                PointOutcome::NotReached => Some("not reached".to_owned()),
                PointOutcome::Passed | PointOutcome::Failed | PointOutcome::Invalid => None,
            },
            varied: self.varied.as_ref().map(VariedPoint::case),
        }
    }
}

impl VariedPoint {
    /// Returns the variation as pages and JUnit files have it.
    fn case(&self) -> VariedCase {
        match self.closing_mps {
            // First, because a search in which the ego did not run shows nothing.
            _ if self.invalid => VariedCase::Invalid,
            _ if !self.fails => VariedCase::Passed,
            Some(closing_mps) => {
                VariedCase::Failed(format!("the ego fails, closing at {closing_mps:.1} m/s"))
            }
            None => VariedCase::Failed("the ego fails without a contact".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use indexmap::IndexMap;

    use super::super::outcome_of;
    use super::*;
    use crate::ego::FaultKind;
    use crate::report::PointsPage;
    use crate::rulebook::Verdict;
    use crate::stats::StartOutcome;
    use crate::world::Scenario;

    fn point(verdict: Verdict, varied: Option<StartOutcome>) -> PointResult {
        PointResult {
            point: 0,
            start: IndexMap::new(),
            outcome: outcome_of(&verdict),
            robustness: None,
            failure: None,
            varied: varied.map(VariedPoint::of),
        }
    }

    /// Returns the numbers of test cases, failures, errors and skipped cases.
    fn counts(points: &[PointResult]) -> [usize; 4] {
        let junit = junit(points, None);
        ["<testcase", "<failure", "<error", "<skipped"].map(|tag| junit.matches(tag).count())
    }

    fn junit(points: &[PointResult], voided_by: Option<&FaultCount>) -> String {
        let text = include_str!("../../../../../worlds/acc.ron");
        let page = PointsPage {
            scenario: &Scenario::parse("acc.ron", text).expect("sound"),
            ego: "nominal".to_owned(),
            summary: String::new(),
            axes: Vec::new(),
            points: points.iter().map(|it| it.case(voided_by)).collect(),
            examples: Vec::new(),
            commands: Vec::new(),
        };
        page.junit()
    }

    #[test]
    fn a_point_of_an_ego_that_is_not_deterministic_says_so() {
        let mut voided = point(Verdict::Held { margin: 1.0 }, None);
        voided.void();
        let fault = FaultCount {
            kind: FaultKind::Random,
            message: String::new(),
            stderr: String::new(),
            first_start: 0,
            count: 1,
        };
        let shown = voided.case(Some(&fault));
        assert_eq!(shown.outcome, "no result");
        let why = "the ego depends on more than the episode (random)";
        assert!(junit(&[voided], Some(&fault)).contains(why));
    }

    #[test]
    fn a_point_at_which_an_ado_breaks_its_rule_is_skipped() {
        let held = point(Verdict::Held { margin: 1.0 }, None);
        assert_eq!(counts(&[held]), [1, 0, 0, 0]);
        let foul = Verdict::Foul {
            rule: 0,
            forfeited: 1,
        };
        assert_eq!(counts(&[point(foul, None)]), [1, 0, 0, 1]);
        assert_eq!(counts(&[point(Verdict::Invalid, None)]), [1, 0, 1, 0]);
    }

    #[test]
    fn a_variation_that_does_not_run_is_an_error() {
        let held = Verdict::Held { margin: 1.0 };
        let cases = [
            (StartOutcome::Held, [2, 0, 0, 0]),
            (StartOutcome::Solved, [2, 1, 0, 0]),
            (StartOutcome::Invalid, [2, 0, 1, 0]),
        ];
        for (outcome, expected) in cases {
            assert_eq!(
                counts(&[point(held, Some(outcome))]),
                expected,
                "{outcome:?}"
            );
        }
    }
}
