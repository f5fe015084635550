//! Risks as test cases and as a page.

use super::report::{EgoRisk, RiskReport};
use crate::report::{
    ResultPage, ResultTable, TestCase, TestMessage, TestOutcome, TestSuite, TextTable,
};

impl RiskReport {
    /// Returns whether the ratio is above a limit, or unknown.
    ///
    /// The upper end decides, so that neither chance nor a fault of the ego passes the limit.
    pub fn is_above(&self, limit: f64) -> bool {
        self.greatest_ratio().is_none_or(|ratio| limit < ratio)
    }

    /// Returns a suite with a case per ego, and one for a limit on the ratio.
    ///
    /// A refused estimate is an error in both, because nothing is known then.
    pub fn suite(&self) -> TestSuite {
        let case = |name: String, outcome| TestCase {
            class: format!("risk.{}", self.world),
            name,
            time_s: None,
            requirement: None,
            outcome,
        };
        let estimates = self.egos.iter().map(|ego| {
            let outcome = match reason(ego) {
                Some(reason) => refused(reason),
                None => TestOutcome::Passed,
            };
            case(format!("estimate of {}", ego.ego), outcome)
        });
        let limit = self.at_most.map(|limit| {
            let egos: Vec<&str> = self.egos.iter().map(|it| it.ego.as_str()).collect();
            let name = format!("ratio of {} at most {limit}", egos.join(" to "));
            // Without an estimate there is an error and no failure, as nothing is
            // known.
            let outcome = match self.egos.iter().find_map(reason) {
                Some(reason) => refused(reason),
                None if self.is_above(limit) => TestOutcome::Failed(TestMessage {
                    kind: "risk",
                    message: match self.greatest_ratio() {
                        Some(ratio) => format!("the ratio may be {ratio:.2} at 95 %"),
                        None => "the ratio is unknown".to_owned(),
                    },
                    words: self.to_string(),
                }),
                None => TestOutcome::Passed,
            };
            case(name, outcome)
        });
        TestSuite {
            name: "risk".to_owned(),
            time_s: None,
            cases: estimates.chain(limit).collect(),
        }
    }

    /// Returns the page of the risk.
    pub fn page(&self) -> ResultPage<'static> {
        // The first line is the headline, the others are notes.
        let mut verdict = self.verdict().into_iter();
        let tables = self.egos.iter().flat_map(|ego| {
            let kinds = ego.modes.iter().map(|kind| {
                [
                    format!("{:.1} %", 100.0 * kind.share),
                    format!("{:.1e}", kind.risk.probability),
                    kind.mode.clone(),
                ]
            });
            let kinds = ResultTable {
                heading: format!("Failures of {}", ego.ego),
                table: TextTable::new(["share", "probability", "kind"], kinds),
            };
            let readings = ResultTable {
                heading: format!("Risk of {}", ego.ego),
                table: ego.table(),
            };
            [readings, kinds]
        });
        ResultPage {
            kind: format!("risk, {}", self.world),
            verdict: verdict.next().unwrap_or_default(),
            is_bad: !self.is_result() || self.at_most.is_some_and(|limit| self.is_above(limit)),
            notes: verdict
                .chain(self.details().lines().map(str::to_owned))
                .collect(),
            tables: tables.collect(),
            ..ResultPage::default()
        }
    }
}

/// Returns the reason why an ego has no result, if there is one.
fn reason(ego: &EgoRisk) -> Option<String> {
    let refusal = ego.refusals().first().map(|it| it.reason.clone());
    refusal.or_else(|| ego.unrepeatable.as_ref().map(ToString::to_string))
}

fn refused(reason: String) -> TestOutcome {
    TestOutcome::Error(TestMessage {
        kind: "no result",
        message: reason,
        words: String::new(),
    })
}
