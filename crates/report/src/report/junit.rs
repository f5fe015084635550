//! Rows as JUnit XML, for continuous integration.

use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};
use super::{Report, Tested};
use crate::run_dir::Row;
use crate::stats::StartOutcome;
use crate::testbench::FaultCount;

/// Test cases: one per start of the tested adversaries.
///
/// Baselines show the difficulty and are no cases.
pub(super) fn xml(report: &Report<'_>) -> String {
    // On a page of another ego, the world's own is only a comparison.
    let of_page = |tested: &&Tested| report.ego.as_ref().is_none_or(|ego| tested.row.ego == *ego);
    let adversaries = report.tested.iter().filter(|it| it.is_adversary());
    let tested: Vec<&Tested> = adversaries.filter(of_page).collect();
    // An ego that failed to run is one more error, so that CI cannot pass.
    let not_run = (!report.faults.is_empty()).then(|| not_ran(report));
    let cases = tested.iter().flat_map(|it| cases_of(report, it));
    junit(&[TestSuite {
        name: report.scenario.name.clone(),
        // `sum` of no values is −0.0.
        time_s: Some(tested.iter().fold(0.0, |sum, it| sum + it.row.cpu_s)),
        cases: not_run.into_iter().chain(cases).collect(),
    }])
}

/// Rows as test cases, one per start.
///
/// The cases depend on the number of the starts only. A start from which an ego no longer
/// fails therefore stays, and passes.
pub struct RowCases<'a> {
    /// Row of an adversary.
    pub row: &'a Row,
    /// Outcome per start, in which a broken rule differs from a kept specification.
    ///
    /// `None` if only the marks of the row are known.
    pub outcomes: Option<&'a [StartOutcome]>,
    /// Class of the cases.
    pub class: String,
    /// Requirement that the ego must meet.
    pub requirement: Option<String>,
}

impl RowCases<'_> {
    /// Returns the cases, with names and details of failures by the number of the start.
    pub fn cases(
        &self,
        name: impl Fn(usize) -> String,
        details: impl Fn(usize) -> String,
    ) -> Vec<TestCase> {
        let marks: Vec<StartOutcome> = self.row.solved.iter().copied().collect();
        let outcomes = self.outcomes.unwrap_or(&marks);
        // Only the time of the whole row is measured.
        let share_s = self.row.cpu_s / outcomes.len().max(1) as f64;
        let numbered = outcomes.iter().enumerate();
        let cases = numbered.map(|(start, outcome)| TestCase {
            class: self.class.clone(),
            name: name(start),
            time_s: Some(share_s),
            requirement: self.requirement.clone(),
            outcome: self.outcome(*outcome, || details(start)),
        });
        cases.collect()
    }

    fn outcome(&self, outcome: StartOutcome, details: impl Fn() -> String) -> TestOutcome {
        let row = self.row;
        let failed = |message: &str| {
            TestOutcome::Failed(TestMessage {
                kind: "counterexample",
                message: message.to_owned(),
                words: details(),
            })
        };
        let skipped = |why: &str| TestOutcome::Skipped(why.to_owned());
        let error = |message: &str| {
            TestOutcome::Error(TestMessage {
                kind: row
                    .faults
                    .first()
                    .map_or("fault", |fault| fault.kind.word()),
                message: message.to_owned(),
                words: faults(row),
            })
        };
        match outcome {
            StartOutcome::NotReached => skipped("interrupted before this start"),
            // Of such an ego no outcome is known, whatever the row counted.
            _ if row.is_unrepeatable() => {
                error("no result: the ego depends on more than the episode")
            }
            StartOutcome::Solved => failed("the ego fails, every rule kept"),
            // A failure that the world's criterion does not count fails no
            // test.
            StartOutcome::Held | StartOutcome::Uncounted => TestOutcome::Passed,
            // A mark does not tell on which of these starts an ado broke its rule.
            StartOutcome::Unsolved if !row.violations.is_empty() => {
                skipped("no answer: an ado broke its rule first from some of these starts")
            }
            StartOutcome::Unsolved => TestOutcome::Passed,
            StartOutcome::RuleViolation => skipped("no answer: an ado broke its rule first"),
            StartOutcome::Trivial if row.fails_alone.is_some_and(|it| it.left_out) => {
                failed("the ego fails without an adversary")
            }
            StartOutcome::Trivial => skipped("left out: fails without an adversary"),
            StartOutcome::Invalid => error("the ego or the physics failed to run"),
        }
    }
}

fn cases_of(report: &Report<'_>, tested: &Tested) -> Vec<TestCase> {
    let row = &tested.row;
    let solved = |outcome: &StartOutcome| *outcome == StartOutcome::Solved;
    // The explanation of the row is that of its first counterexample.
    let first = row.solved.iter().position(solved);
    let name = format!("ego {} against ado {}", row.ego, row.ado);
    let cases = RowCases {
        row,
        outcomes: tested.outcomes.as_deref(),
        // Rows of several seeds have the same names of starts.
        class: format!("{}.{}.seed{}", row.world, row.plant, row.start_seed),
        requirement: report.scenario.requirement.clone(),
    };
    cases.cases(
        |start| format!("{name}, start {start:04}"),
        |start| about(report, tested, Some(start) == first),
    )
}

fn about(report: &Report<'_>, tested: &Tested, is_first: bool) -> String {
    let row = &tested.row;
    // The explanation is of the first counterexample only.
    let why = tested.why.as_deref().filter(|_| is_first);
    format!(
        "{}\nego_spec: {}\nmethod: {}\nstarts of seed {}, {} left out because the ego fails by itself\n{}",
        report.scenario.question,
        report.scenario.ego_spec,
        row.method,
        row.start_seed,
        row.trivial,
        why.unwrap_or("")
    )
}

/// Case of an ego that failed to run, regardless of other results.
fn not_ran(report: &Report<'_>) -> TestCase {
    let first = report.faults.first();
    let text: Vec<String> = report.faults.iter().map(in_full).collect();
    TestCase {
        class: report.scenario.name.clone(),
        name: "the ego runs".to_owned(),
        time_s: None,
        requirement: None,
        outcome: TestOutcome::Error(TestMessage {
            kind: first.map_or("fault", |fault| fault.kind.word()),
            message: first.map(ToString::to_string).unwrap_or_default(),
            words: text.join("\n"),
        }),
    }
}

/// Faults of a row, with the program's stderr.
fn faults(row: &Row) -> String {
    let lines: Vec<String> = row.faults.iter().map(in_full).collect();
    lines.join("\n")
}

fn in_full(fault: &FaultCount) -> String {
    format!("{fault}\n{}", fault.stderr)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(left_out: bool, violations: bool) -> Row {
        let broken = serde_json::json!([{ "rule": "r", "ado": "ado", "starts": 1 }]);
        let row = serde_json::json!({
            "world": "acc", "plant": "Kinematic", "judge": "UntilViolation", "ego": "nominal",
            "ado": "search", "method": "m", "start_seed": 0, "starts": 4, "trivial": 1,
            "fails_alone": { "starts": 1, "left_out": left_out },
            "violations": if violations { broken } else { serde_json::json!([]) },
            "successes": 1, "success_rate": 0.25, "ci95": [0.0, 1.0], "foul_rate": 0.0,
            "contact_rate": 0.0, "invalid": 1, "sims_per_start": 1.0, "physics_steps": 0,
            "cpu_s": 0.0, "solved": "10tx-",
        });
        serde_json::from_value(row).expect("a row")
    }

    fn words(row: &Row, outcomes: Option<&[StartOutcome]>) -> Vec<&'static str> {
        let cases = RowCases {
            row,
            outcomes,
            class: "search.acc".to_owned(),
            requirement: None,
        };
        let cases = cases.cases(|start| start.to_string(), |_| String::new());
        let word = |case: &TestCase| match case.outcome {
            TestOutcome::Passed => "passed",
            TestOutcome::Failed(_) => "failed",
            TestOutcome::Error(_) => "error",
            TestOutcome::Skipped(_) => "skipped",
        };
        cases.iter().map(word).collect()
    }

    #[test]
    fn every_start_is_a_case_and_no_open_question_passes() {
        use StartOutcome::{Held, Invalid, RuleViolation, Solved, Trivial, Uncounted};
        let expected = ["failed", "passed", "skipped", "error", "skipped"];
        assert_eq!(words(&row(false, false), None), expected);
        // Which of the starts have an answer is not in the marks.
        let expected = ["failed", "skipped", "skipped", "error", "skipped"];
        assert_eq!(words(&row(false, true), None), expected);
        let known = [Solved, Held, RuleViolation, Uncounted, Trivial, Invalid];
        let expected = ["failed", "passed", "skipped", "passed", "failed", "error"];
        assert_eq!(words(&row(true, true), Some(&known)), expected);
        // An ego that depends on more than the episode passes no test.
        let mut random = row(true, true);
        random.void(FaultCount {
            kind: crate::ego::FaultKind::Random,
            message: String::new(),
            stderr: String::new(),
            first_start: 0,
            count: 1,
        });
        assert_eq!(words(&random, Some(&known)), ["error"; 6]);
    }
}
