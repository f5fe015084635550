//! One ego at the points of a world: a page, and JUnit XML with a case per point.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::examples::example;
use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};
use super::page::{head, world};
use super::{Example, animation};
use crate::visible::visible_markup;
use crate::world::Scenario;

/// Page of one ego at the points of a world.
pub struct PointsPage<'a> {
    /// World with the ego.
    pub scenario: &'a Scenario,
    /// Name of the ego.
    pub ego: String,
    /// Number of passed points, in one sentence.
    pub summary: String,
    /// Names of the start's axes.
    pub axes: Vec<String>,
    /// Points of the world.
    pub points: Vec<PointCase>,
    /// Failures, the worst first.
    pub examples: Vec<Example>,
    /// Commands that reproduce the page.
    pub commands: Vec<String>,
}

/// Point on the page and in the JUnit file.
#[derive(Clone, Debug)]
pub struct PointCase {
    /// Number of the point.
    pub point: usize,
    /// Start, axis by axis.
    pub start: Vec<String>,
    /// Outcome in words.
    pub outcome: String,
    /// Failure of the ego, if any.
    pub failure: Option<String>,
    /// Reason why the point is no result: the ego or the physics failed to run, or the
    /// ego is not deterministic.
    pub invalid: Option<String>,
    /// Reason why the point has no answer, if any.
    pub skipped: Option<String>,
    /// Result of the search of lawful variations. `None` without a search.
    pub varied: Option<VariedCase>,
}

/// Result of the search of lawful variations of a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum VariedCase {
    /// No variation makes the ego fail.
    Passed,
    /// A variation makes the ego fail, with its description.
    Failed(String),
    /// The ego or the physics failed to run.
    Invalid,
}

impl VariedCase {
    /// Returns the words of the page, which are empty without a failure.
    fn words(&self) -> &str {
        match self {
            VariedCase::Passed => "",
            VariedCase::Failed(words) => words,
            VariedCase::Invalid => "did not run",
        }
    }
}

impl PointsPage<'_> {
    /// Returns the page as HTML, without network access.
    pub fn html(&self) -> String {
        let scenario = self.scenario;
        let all = self.examples.len();
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (head(&format!("brakecheck: {}", scenario.name), animation::STYLE))
                body { main {
                    p class="dim" { "brakecheck report: " (scenario.name) ", ego " (self.ego) }
                    h1 { (scenario.question) }
                    @if !scenario.source.is_empty() { p class="dim" { (scenario.source) } }
                    p class="note" { (self.summary) }
                    h2 { "Points" }
                    (self.table())
                    @if all > 0 { h2 { "Failures, the worst first" } }
                    @for (nth, chosen) in self.examples.iter().enumerate() { (example(scenario, chosen, nth, all)) }
                    (world(scenario))
                    h2 { "How to make it again" }
                    pre { @for command in &self.commands { (command) "\n" } }
                }
                @if all > 0 { script { (PreEscaped(animation::SCRIPT)) } } }
            }
        };
        visible_markup(&page.into_string()).into_owned()
    }

    fn table(&self) -> Markup {
        html! {
            div class="wide" { table class="rows" {
                thead { tr { th { "point" } @for axis in &self.axes { th class="n" { (axis) } } th { "outcome" } th { "failure" } } }
                tbody {
                    @for point in &self.points {
                        tr {
                            td data-l="point" { (point.point) }
                            @for (axis, value) in self.axes.iter().zip(&point.start) { td class="n" data-l=(axis) { (value) } }
                            td data-l="outcome" { (point.outcome) }
                            td class="w" data-l="failure" {
                                @if let Some(failure) = &point.failure { (failure) }
                                @if let Some(varied) = point.varied.as_ref().map(VariedCase::words).filter(|it| !it.is_empty()) { "varied: " (varied) }
                            }
                        }
                    }
                }
            } }
        }
    }

    /// Returns the points as JUnit XML: a case each, and one per searched variation.
    pub fn junit(&self) -> String {
        let cases = self.points.iter().flat_map(|it| self.cases(it)).collect();
        junit(&[TestSuite {
            name: self.scenario.name.clone(),
            time_s: None,
            cases,
        }])
    }

    fn cases(&self, point: &PointCase) -> Vec<TestCase> {
        let case = |name: String, outcome| TestCase {
            // CI servers group cases by their class, and the same point may run on both plants.
            class: format!("{}.{}", self.scenario.name, self.scenario.plant()),
            name,
            time_s: None,
            requirement: None,
            outcome,
        };
        let failed = |message: &str, words: &str| {
            TestOutcome::Failed(TestMessage {
                kind: "counterexample",
                message: message.to_owned(),
                words: words.to_owned(),
            })
        };
        let did_not_run = |why: &str| {
            TestOutcome::Error(TestMessage {
                kind: "fault",
                message: why.to_owned(),
                words: String::new(),
            })
        };
        let name = self.case_name(point);
        // A variation is a case of its own, since the point itself may pass.
        let varied = point.varied.as_ref().map(|varied| {
            let outcome = match varied {
                VariedCase::Passed => TestOutcome::Passed,
                VariedCase::Failed(words) => failed("a lawful variation makes the ego fail", words),
                VariedCase::Invalid => did_not_run("the ego or the physics failed to run"),
            };
            case(format!("{name}, varied"), outcome)
        });
        let outcome = match (&point.failure, &point.invalid, &point.skipped) {
            (Some(failure), _, _) => failed("the ego fails at this point", failure),
            // Before the skipped ones: a fault is an error, whatever else is
            // known.
            (None, Some(why), _) => did_not_run(why),
            (None, None, Some(why)) => TestOutcome::Skipped(why.clone()),
            (None, None, None) => TestOutcome::Passed,
        };
        [case(name.clone(), outcome)]
            .into_iter()
            .chain(varied)
            .collect()
    }

    fn case_name(&self, point: &PointCase) -> String {
        let values: Vec<String> = self
            .axes
            .iter()
            .zip(&point.start)
            .map(|(axis, value)| format!("{axis} {value}"))
            .collect();
        format!(
            // Padded, because servers sort cases by their names.
            "ego {}, point {:04}: {}",
            self.ego,
            point.point,
            values.join(", ")
        )
    }
}
