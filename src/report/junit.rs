//! The rows as JUnit XML, for continuous integration.

use maud::{Markup, PreEscaped, html};

use super::{Report, Tested};
use crate::run::Row;
use crate::testbench::FaultCount;

pub(super) fn xml(report: &Report<'_>) -> String {
    let rows = report.tested.iter().map(|tested| &tested.row);
    let skipped = rows.clone().filter(|row| row.starts + row.invalid == 0);
    let skipped = skipped.count();
    // A row with a failure and faults is one test case: it counts as an error.
    let errors = rows.clone().filter(|row| 0 < row.invalid).count();
    let errors = errors + usize::from(!report.faults.is_empty());
    let failures = rows.filter(|row| 0 < row.successes && row.invalid == 0);
    let failures = failures.count();
    let seconds: f64 = report.tested.iter().map(|tested| tested.row.cpu_s).sum();
    let tests = report.tested.len() + usize::from(!report.faults.is_empty());
    let time = format!("{seconds:.3}");
    let name = legible(&report.scenario.name);
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failures) errors=(errors) time=(time) {
            testsuite name=(name) tests=(tests) failures=(failures) errors=(errors) skipped=(skipped) time=(time) {
                @if !report.faults.is_empty() { (not_run(report)) }
                @for tested in &report.tested { (case(report, tested)) }
            }
        }
    };
    page.into_string()
}

fn case(report: &Report<'_>, tested: &Tested) -> Markup {
    let row = &tested.row;
    let class = legible(&format!("{}.{:?}", row.world, row.plant));
    let name = legible(&format!("ego {} against ado {}", row.ego, row.ado));
    let says = format!(
        "{} of {} starts make the ego fail with every rule kept",
        row.successes, row.starts
    );
    let why = tested.why.as_deref().unwrap_or("no episode was explained");
    let text = format!(
        "{}\nego_spec: {}\nmethod: {}\nstarts of seed {}, {} left out because the ego fails by itself\n{why}",
        report.scenario.question, report.scenario.ego_spec, row.method, row.start_seed, row.trivial
    );
    html! {
        testcase classname=(class) name=(name) time=(format!("{:.3}", row.cpu_s)) {
            @if 0 < row.invalid {
                error type=(row.faults.first().map_or("fault", |fault| fault.kind.word()))
                    message=(legible(&format!(
                        "the ego or the physics failed on {} of {} starts",
                        row.invalid,
                        row.starts + row.invalid
                    ))) { (legible(&faults(row))) }
            } @else if row.starts == 0 {
                skipped message="no start was evaluated" {}
            } @else if 0 < row.successes {
                failure type="counterexample" message=(says) { (legible(&text)) }
            }
        }
    }
}

/// An ego that failed to run, whatever else was found.
fn not_run(report: &Report<'_>) -> Markup {
    let class = legible(&report.scenario.name);
    let first = report.faults.first();
    let text: Vec<String> = report.faults.iter().map(in_full).collect();
    html! {
        testcase classname=(class) name="the ego runs" {
            error type=(first.map_or("fault", |fault| fault.kind.word()))
                message=(legible(&first.map(ToString::to_string).unwrap_or_default())) {
                (legible(&text.join("\n")))
            }
        }
    }
}

/// Every fault of a row, with what the program wrote to stderr.
fn faults(row: &Row) -> String {
    let lines: Vec<String> = row.faults.iter().map(in_full).collect();
    lines.join("\n")
}

fn in_full(fault: &FaultCount) -> String {
    format!("{fault}\n{}", fault.stderr)
}

/// XML has no control characters: they become U+FFFD.
fn legible(text: &str) -> String {
    let legible = |c: char| match c {
        '\n' | '\t' => c,
        c if c.is_control() || c == '\u{fffe}' || c == '\u{ffff}' => '\u{fffd}',
        c => c,
    };
    text.chars().map(legible).collect()
}
