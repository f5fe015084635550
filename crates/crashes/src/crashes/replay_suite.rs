//! Replays of kept counterexamples as test cases.

use std::path::Path;

use super::regressions::Regressions;
use super::replay::{ReplayOutcome, Replayed, SavedCounterexample};
use crate::report::{TestCase, TestMessage, TestOutcome, TestSuite};

/// Question that a replay answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplayQuestion {
    /// Whether the ego still fails.
    StillFails,
    /// Whether every sample is as recorded.
    AsRecorded,
}

/// Returns the name of the test case of a kept counterexample: its file without ending.
pub fn case_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}

impl Regressions {
    /// Returns replays as a suite with a case per kept counterexample.
    ///
    /// The names depend on the files only, so a fixed crash passes and does not vanish. A
    /// replay without an answer is skipped. A replay that did not run, is missing, or does
    /// not repeat its record on this build is an error.
    pub fn suite(&self, replayed: &[Replayed], question: ReplayQuestion) -> TestSuite {
        let case = |kept: &SavedCounterexample| {
            let one = replayed.iter().find(|one| one.path == kept.path);
            TestCase {
                class: format!("replay.{}", kept.counterexample.world),
                name: case_name(&kept.path),
                time_s: None,
                requirement: one.and_then(|one| one.scenario.requirement.clone()),
                outcome: match one {
                    Some(one) => self.outcome(one, question),
                    None => error("missing", "not replayed: the ego was given up before it"),
                },
            }
        };
        TestSuite {
            name: "replay".to_owned(),
            time_s: None,
            cases: self.kept().iter().map(case).collect(),
        }
    }

    fn outcome(&self, one: &Replayed, question: ReplayQuestion) -> TestOutcome {
        if let Some(fault) = one.fault() {
            return error(fault.kind.word(), &fault.message);
        }
        let differs = || {
            let departure = one.departure();
            departure.unwrap_or_else(|| "different from the recorded run".to_owned())
        };
        if question == ReplayQuestion::AsRecorded {
            if one.identical {
                return TestOutcome::Passed;
            }
            return TestOutcome::Failed(TestMessage {
                kind: "difference",
                message: differs(),
                words: String::new(),
            });
        }
        // A build that computes otherwise says nothing about the ego.
        if self.is_recorded_ego() && !one.is_reproduced() {
            return error("difference", &differs());
        }
        match one.outcome() {
            ReplayOutcome::Fixed => TestOutcome::Passed,
            ReplayOutcome::StillFails => TestOutcome::Failed(TestMessage {
                kind: "counterexample",
                message: "the ego still fails, every rule kept".to_owned(),
                words: format!("{}\n{}", one.in_words(), one.known()),
            }),
            ReplayOutcome::NoAnswer => {
                let why = one.no_answer().map(|why| why.to_string());
                TestOutcome::Skipped(format!("no answer: {}", why.unwrap_or_default()))
            }
            ReplayOutcome::Invalid => error("fault", "the ego or the physics did not run"),
        }
    }
}

fn error(kind: &'static str, message: &str) -> TestOutcome {
    TestOutcome::Error(TestMessage {
        kind,
        message: message.to_owned(),
        words: String::new(),
    })
}
