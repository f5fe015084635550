//! Replays of kept counterexamples as JUnit XML.

use maud::{PreEscaped, html};

use crate::visible::visible_markup;

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
    let count = |of: fn(&ReplayResult) -> bool| cases.iter().filter(|it| of(&it.result)).count();
    let failures = count(|it| matches!(it, ReplayResult::StillFails(_)));
    let errors = count(|it| matches!(it, ReplayResult::Invalid { .. }));
    let skipped = count(|it| matches!(it, ReplayResult::NoAnswer(_)));
    let tests = cases.len();
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failures) errors=(errors) {
            testsuite name="replay" tests=(tests) failures=(failures) errors=(errors) skipped=(skipped) {
                @for case in cases {
                    testcase classname=(case.world) name=(case.file) {
                        @match &case.result {
                            ReplayResult::Fixed => {},
                            ReplayResult::StillFails(words) => {
                                failure type="counterexample" message="the ego still fails, every rule kept" { (words) }
                            },
                            ReplayResult::NoAnswer(why) => { skipped message=(why) {} },
                            ReplayResult::Invalid { kind, message } => { error type=(kind) message=(message) {} },
                        }
                    }
                }
            }
        }
    };
    visible_markup(&page.into_string()).into_owned()
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
        assert!(xml.contains(r#"name="b.ron"></testcase>"#), "{xml}");
        assert!(
            xml.contains(r#"name="c.ron"><skipped message="ado broke `r` at 1.20 s">"#),
            "{xml}"
        );
        assert!(
            xml.contains(r#"<error type="timeout" message="late">"#),
            "{xml}"
        );
    }
}
