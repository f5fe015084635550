//! The rows as JUnit XML, for continuous integration.

use maud::{Markup, PreEscaped, html};

use super::{Report, Tested};

pub(super) fn xml(report: &Report<'_>) -> String {
    let failures = report.tested.iter().filter(|t| 0 < t.row.successes).count();
    let skipped = report.tested.iter().filter(|t| t.row.starts == 0).count();
    let seconds: f64 = report.tested.iter().map(|tested| tested.row.cpu_s).sum();
    let (tests, time) = (report.tested.len(), format!("{seconds:.3}"));
    let name = legible(&report.scenario.name);
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failures) errors="0" time=(time) {
            testsuite name=(name) tests=(tests) failures=(failures) errors="0" skipped=(skipped) time=(time) {
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
            @if row.starts == 0 {
                skipped message="no start was evaluated" {}
            } @else if 0 < row.successes {
                failure type="counterexample" message=(says) { (legible(&text)) }
            }
        }
    }
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
