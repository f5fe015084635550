//! Rows as JUnit XML, for continuous integration.

use maud::{Markup, PreEscaped, html};

use super::{Report, Tested};
use crate::run_dir::Row;
use crate::stats::StartOutcome;
use crate::testbench::FaultCount;
use crate::visible::visible_markup;

/// Test cases: one per counterexample of the tested adversaries.
///
/// An ego without a counterexample has one case that passes. Baselines show the
/// difficulty and are no cases.
pub(super) fn xml(report: &Report<'_>) -> String {
    let tested: Vec<&Tested> = report.tested.iter().filter(is_adversary).collect();
    // An ego that failed to run is one more error, so that CI cannot pass.
    let not_run = usize::from(!report.faults.is_empty());
    let rows = || tested.iter().map(|tested| &tested.row);
    let errors = rows().filter(|row| errs(row)).count() + not_run;
    let failures: usize = rows().map(|row| row.successes).sum();
    let no_answer = rows().filter(|row| fouls(row) > 0).count();
    let skipped = no_answer + rows().filter(|row| row.starts + row.invalid == 0).count();
    let cases = |row: &Row| {
        row.successes + usize::from(errs(row) || row.successes == 0) + usize::from(fouls(row) > 0)
    };
    let tests = rows().map(cases).sum::<usize>() + not_run;
    // `sum` of no values is −0.0.
    let seconds: f64 = rows().fold(0.0, |sum, row| sum + row.cpu_s);
    let time = format!("{seconds:.3}");
    let name = &report.scenario.name;
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failures) errors=(errors) time=(time) {
            testsuite name=(name) tests=(tests) failures=(failures) errors=(errors) skipped=(skipped) time=(time) {
                @if !report.faults.is_empty() { (not_ran(report)) }
                @for tested in &tested { (cases_of(report, tested)) }
            }
        }
    };
    visible_markup(&page.into_string()).into_owned()
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

fn cases_of(report: &Report<'_>, tested: &Tested) -> Markup {
    let row = &tested.row;
    let solved = row
        .solved
        .iter()
        .enumerate()
        .filter(|(_, outcome)| **outcome == StartOutcome::Solved);
    let starts: Vec<usize> = solved.map(|(start, _)| start).collect();
    let class = format!("{}.{}", row.world, row.plant);
    let name = format!("ego {} against ado {}", row.ego, row.ado);
    // A row with faults has no case that passes, even without counterexamples.
    html! {
        @if errs(row) {
            testcase classname=(class) name=(format!("{name} runs")) time="0.000" {
                error type=(row.faults.first().map_or("fault", |fault| fault.kind.word()))
                    message=(format!("the ego or the physics failed on {} of {} starts", row.invalid, row.starts + row.invalid)) { (faults(row)) }
            }
        } @else if starts.is_empty() {
            testcase classname=(class) name=(name) time=(format!("{:.3}", row.cpu_s)) {
                (requirement(report))
                @if row.starts == 0 { skipped message="no start was evaluated" {} }
            }
        }
        @if let some @ 1.. = fouls(row) {
            testcase classname=(class) name=(format!("{name}, starts without an answer")) time="0.000" {
                skipped message=(format!("no answer from {some} of {} starts, on which an ado broke its rule first: {}", row.starts, violations(row))) {}
            }
        }
        @for (i, start) in starts.iter().enumerate() {
            testcase classname=(class) name=(format!("{name}, start {start:04}")) time=(format!("{:.3}", row.cpu_s / starts.len() as f64)) {
                (requirement(report))
                failure type="counterexample" message="the ego fails, every rule kept" {
                    (about(report, tested, i == 0))
                }
            }
        }
    }
}

/// Requirement that ψ_ego expresses.
fn requirement(report: &Report<'_>) -> Markup {
    html! {
        @if let Some(requirement) = &report.scenario.requirement {
            properties { property name="requirement" value=(requirement) {} }
        }
    }
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
fn not_ran(report: &Report<'_>) -> Markup {
    let class = &report.scenario.name;
    let first = report.faults.first();
    let text: Vec<String> = report.faults.iter().map(in_full).collect();
    html! {
        testcase classname=(class) name="the ego runs" {
            error type=(first.map_or("fault", |fault| fault.kind.word()))
                message=(first.map(ToString::to_string).unwrap_or_default()) {
                (text.join("\n"))
            }
        }
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
