//! JUnit XML of all verbs: suites of test cases.
//!
//! A case has the same name in every version of an ego, so that a CI server shows how a
//! crash turns from failed to passed. A result that is no answer is skipped or an error,
//! and never passed.

use std::time::Duration;

use quick_junit::{
    NonSuccessKind, Property, Report, TestCase as XmlCase, TestCaseStatus, TestSuite as XmlSuite,
};

use crate::visible::visible_markup;

/// Suite of test cases.
#[derive(Clone, Debug, PartialEq)]
pub struct TestSuite {
    /// Name, such as the world.
    pub name: String,
    /// Processor time in seconds, if it is known.
    pub time_s: Option<f64>,
    /// Cases of all outcomes.
    pub cases: Vec<TestCase>,
}

/// Test case.
#[derive(Clone, Debug, PartialEq)]
pub struct TestCase {
    /// Class, by which servers group cases.
    pub class: String,
    /// Name, which must not depend on the outcome.
    pub name: String,
    /// Processor time in seconds, if it is known.
    pub time_s: Option<f64>,
    /// Requirement that the case tests.
    pub requirement: Option<String>,
    /// Outcome.
    pub outcome: TestOutcome,
}

/// Outcome of a test case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TestOutcome {
    /// The ego does not fail.
    Passed,
    /// The ego fails.
    Failed(TestMessage),
    /// The test did not run.
    Error(TestMessage),
    /// The test gives no answer, for a reason.
    Skipped(String),
}

/// Reason of a failure or an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TestMessage {
    /// Kind in a word or two.
    pub kind: &'static str,
    /// One line.
    pub message: String,
    /// Details.
    pub words: String,
}

/// Returns suites as JUnit XML.
///
/// If they have no case, the file has a single case that is an error.
pub fn junit(suites: &[TestSuite]) -> String {
    let mut report = Report::new("brakecheck");
    report.time = suites
        .iter()
        .map(|suite| suite.time_s)
        // One unknown duration makes the sum unknown.
        .sum::<Option<f64>>()
        .map(duration);
    report.add_test_suites(suites.iter().map(TestSuite::element));
    // A CI server takes a file without a case for a pass.
    if suites.iter().all(|suite| suite.cases.is_empty()) {
        report.add_test_suite(nothing_tested().element());
    }
    // Invariant: memory takes any document.
    report.to_string().unwrap_or_default()
}

/// Returns the suite of a result without a case.
fn nothing_tested() -> TestSuite {
    let case = TestCase {
        class: "brakecheck".to_owned(),
        name: "a case is tested".to_owned(),
        time_s: None,
        requirement: None,
        outcome: TestOutcome::Error(TestMessage {
            kind: "no test",
            message: "the result has no test case".to_owned(),
            words: String::new(),
        }),
    };
    TestSuite {
        name: "brakecheck".to_owned(),
        time_s: None,
        cases: vec![case],
    }
}

fn duration(time_s: f64) -> Duration {
    // A negative or huge time of a damaged row must not panic.
    Duration::try_from_secs_f64(time_s).unwrap_or_default()
}

impl TestSuite {
    fn element(&self) -> XmlSuite {
        // XML 1.0 has no control characters, and one of them would spoil the
        // whole file.
        let mut suite = XmlSuite::new(&*visible_markup(&self.name));
        suite.time = self.time_s.map(duration);
        suite.add_test_cases(self.cases.iter().map(TestCase::element));
        suite
    }
}

impl TestCase {
    fn element(&self) -> XmlCase {
        let mut case = XmlCase::new(&*visible_markup(&self.name), self.outcome.status());
        case.set_classname(&*visible_markup(&self.class));
        case.time = self.time_s.map(duration);
        let requirement = self.requirement.as_ref().map(|it| visible_markup(it));
        let property = requirement.map(|it| Property::new("requirement", &*it));
        case.add_properties(property);
        case
    }
}

impl TestOutcome {
    fn status(&self) -> TestCaseStatus {
        match self {
            TestOutcome::Passed => TestCaseStatus::success(),
            TestOutcome::Failed(it) => it.status(NonSuccessKind::Failure),
            TestOutcome::Error(it) => it.status(NonSuccessKind::Error),
            TestOutcome::Skipped(why) => {
                let mut status = TestCaseStatus::skipped();
                status.set_message(&*visible_markup(why));
                status
            }
        }
    }
}

impl TestMessage {
    fn status(&self, kind: NonSuccessKind) -> TestCaseStatus {
        let mut status = TestCaseStatus::non_success(kind);
        status
            .set_type(self.kind)
            .set_message(&*visible_markup(&self.message));
        if !self.words.is_empty() {
            status.set_description(&*visible_markup(&self.words));
        }
        status
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(name: &str, outcome: TestOutcome) -> TestCase {
        TestCase {
            class: "replay.acc".to_owned(),
            name: name.to_owned(),
            time_s: None,
            requirement: None,
            outcome,
        }
    }

    fn message(kind: &'static str) -> TestMessage {
        TestMessage {
            kind,
            message: "a < b \u{1b}[2K".to_owned(),
            words: "in full & ]]>".to_owned(),
        }
    }

    #[test]
    fn a_parser_finds_every_outcome_with_its_reason() {
        let cases = vec![
            case("a", TestOutcome::Failed(message("counterexample"))),
            case("b", TestOutcome::Passed),
            case("c", TestOutcome::Skipped("ado broke `r`".to_owned())),
            case("d", TestOutcome::Error(message("timeout"))),
        ];
        let suite = TestSuite {
            name: "acc".to_owned(),
            time_s: Some(1.5),
            cases,
        };
        let report = Report::deserialize_from_str(&junit(&[suite])).expect("JUnit");
        let counts = [report.tests, report.failures, report.errors, report.skipped];
        assert_eq!(counts, [4, 1, 1, 1]);
        let read = &report.test_suites[0];
        assert_eq!(read.time, Some(Duration::from_millis(1500)));
        let names: Vec<&str> = read.test_cases.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "c", "d"]);
        let mut expected = TestCaseStatus::non_success(NonSuccessKind::Error);
        expected
            .set_type("timeout")
            .set_message("a < b \\u{1b}[2K")
            .set_description("in full & ]]>");
        assert_eq!(read.test_cases[3].status, expected);
        assert_eq!(read.test_cases[1].status, TestCaseStatus::success());
        let mut skipped = TestCaseStatus::skipped();
        skipped.set_message("ado broke `r`");
        assert_eq!(read.test_cases[2].status, skipped);
    }

    #[test]
    fn a_file_without_a_case_is_an_error() {
        let empty = TestSuite {
            name: "acc".to_owned(),
            time_s: Some(0.0),
            cases: Vec::new(),
        };
        let none: &[TestSuite] = &[];
        for suites in [none, std::slice::from_ref(&empty)] {
            let report = Report::deserialize_from_str(&junit(suites)).expect("JUnit");
            let counts = [report.tests, report.failures, report.errors, report.skipped];
            assert_eq!(counts, [1, 0, 1, 0]);
        }
    }
}
