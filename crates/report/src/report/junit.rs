//! Rows as JUnit XML, for continuous integration.

use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};
use super::{Report, Tested};
use crate::run_dir::Row;
use crate::stats::StartOutcome;
use crate::testbench::FaultCount;

/// Test cases: one per counterexample of the tested adversaries.
///
/// An ego without a counterexample has one case that passes. Baselines show the
/// difficulty and are no cases.
pub(super) fn xml(report: &Report<'_>) -> String {
    let tested: Vec<&Tested> = report.tested.iter().filter(is_adversary).collect();
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

/// Returns true for a trained ado or a search, and false for a baseline.
fn is_adversary(tested: &&Tested) -> bool {
    tested.row.train_seed.is_some() || tested.row.ado.is_search()
}

/// Returns true if the ego or the physics failed on a start.
fn errs(row: &Row) -> bool {
    row.invalid > 0
}

/// Returns the number of starts on which an ado broke its rule first.
///
/// They are not known for a search, which goes on with another sequence.
fn fouls(row: &Row) -> usize {
    if row.violations.is_empty() {
        return 0;
    }
    (row.foul_rate * row.starts as f64).round() as usize
}

fn violations(row: &Row) -> String {
    let broken: Vec<String> = row.violations.iter().map(ToString::to_string).collect();
    broken.join(", ")
}

fn cases_of(report: &Report<'_>, tested: &Tested) -> Vec<TestCase> {
    let row = &tested.row;
    let solved = row
        .solved
        .iter()
        .enumerate()
        .filter(|(_, outcome)| **outcome == StartOutcome::Solved);
    let starts: Vec<usize> = solved.map(|(start, _)| start).collect();
    let name = format!("ego {} against ado {}", row.ego, row.ado);
    let case = |name: String, time_s: f64, outcome| TestCase {
        class: format!("{}.{}", row.world, row.plant),
        name,
        time_s: Some(time_s),
        requirement: None,
        outcome,
    };
    let tests = |case| TestCase {
        requirement: report.scenario.requirement.clone(),
        ..case
    };
    let mut cases = Vec::new();
    // A row with faults has no case that passes, even without counterexamples.
    if errs(row) {
        let played = row.starts + row.invalid;
        let fault = TestMessage {
            kind: row
                .faults
                .first()
                .map_or("fault", |fault| fault.kind.word()),
            message: format!(
                "the ego or the physics failed on {} of {played} starts",
                row.invalid
            ),
            words: faults(row),
        };
        cases.push(case(format!("{name} runs"), 0.0, TestOutcome::Error(fault)));
    } else if starts.is_empty() {
        let outcome = match row.starts {
            0 => TestOutcome::Skipped("no start was evaluated".to_owned()),
            _ => TestOutcome::Passed,
        };
        cases.push(tests(case(name.clone(), row.cpu_s, outcome)));
    }
    if let some @ 1.. = fouls(row) {
        let why = format!(
            "no answer from {some} of {} starts, on which an ado broke its rule first: {}",
            row.starts,
            violations(row)
        );
        let name = format!("{name}, starts without an answer");
        cases.push(case(name, 0.0, TestOutcome::Skipped(why)));
    }
    let share_s = row.cpu_s / starts.len() as f64;
    cases.extend(starts.iter().enumerate().map(|(i, start)| {
        let failure = TestMessage {
            kind: "counterexample",
            message: "the ego fails, every rule kept".to_owned(),
            words: about(report, tested, i == 0),
        };
        let name = format!("{name}, start {start:04}");
        tests(case(name, share_s, TestOutcome::Failed(failure)))
    }));
    cases
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
