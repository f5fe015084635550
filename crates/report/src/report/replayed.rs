//! Replays of kept counterexamples as JUnit XML.

use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};

/// Replay as a test case.
pub struct ReplayCase {
    /// Kept file.
    pub file: String,
    /// Name of its world.
    pub world: String,
    /// Result of the replay.
    pub result: ReplayResult,
}

/// Result of a replay.
pub enum ReplayResult {
    /// The ego still fails, with the outcome in words.
    StillFails(String),
    /// The ego does not fail.
    Fixed,
    /// An ado broke its rule first, with the reason.
    NoAnswer(String),
    /// The ego or the physics did not run.
    Invalid {
        /// Kind of the fault, as a word.
        kind: &'static str,
        /// The fault in words.
        message: String,
    },
}

/// Returns JUnit XML with a case per replay.
///
/// A case without an answer is skipped, so that CI neither fails nor counts it as passed.
pub fn replayed_junit(cases: &[ReplayCase]) -> String {
    junit(&[TestSuite {
        name: "replay".to_owned(),
        time_s: None,
        cases: cases.iter().map(ReplayCase::test_case).collect(),
    }])
}

impl ReplayCase {
    fn test_case(&self) -> TestCase {
        let outcome = match &self.result {
            ReplayResult::Fixed => TestOutcome::Passed,
            ReplayResult::StillFails(words) => TestOutcome::Failed(TestMessage {
                kind: "counterexample",
                message: "the ego still fails, every rule kept".to_owned(),
                words: words.clone(),
            }),
            ReplayResult::NoAnswer(why) => TestOutcome::Skipped(why.clone()),
            ReplayResult::Invalid { kind, message } => TestOutcome::Error(TestMessage {
                kind,
                message: message.clone(),
                words: String::new(),
            }),
        };
        TestCase {
            class: self.world.clone(),
            name: self.file.clone(),
            time_s: None,
            requirement: None,
            outcome,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replay_without_an_answer_is_skipped_with_its_reason() {
        let case = |file: &str, result| ReplayCase {
            file: file.to_owned(),
            world: "acc".to_owned(),
            result,
        };
        let xml = replayed_junit(&[
            case("a.ron", ReplayResult::StillFails("failed".to_owned())),
            case("b.ron", ReplayResult::Fixed),
            case(
                "c.ron",
                ReplayResult::NoAnswer("ado broke `r` at 1.20 s".to_owned()),
            ),
            case(
                "d.ron",
                ReplayResult::Invalid {
                    kind: "timeout",
                    message: "late".to_owned(),
                },
            ),
        ]);
        assert!(
            xml.contains(
                r#"<testsuite name="replay" tests="4" failures="1" errors="1" skipped="1">"#
            ),
            "{xml}"
        );
        assert!(xml.contains(r#"name="b.ron"/>"#), "{xml}");
        assert!(
            xml.contains(r#"<skipped message="ado broke `r` at 1.20 s"/>"#),
            "{xml}"
        );
        assert!(
            xml.contains(r#"<error type="timeout" message="late"/>"#),
            "{xml}"
        );
    }
}
