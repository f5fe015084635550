//! Page of a gate, a risk, or replays of kept crashes: the verdict first.

use maud::{DOCTYPE, PreEscaped, html};

use super::examples::example;
use super::page::head;
use super::table::TextTable;
use super::{Example, animation};
use crate::visible::visible_markup;
use crate::world::Scenario;

/// Content of the page.
#[derive(Default)]
pub struct ResultPage<'a> {
    /// Kind of the result in a word or two.
    pub kind: String,
    /// Verdict, as the heading.
    pub verdict: String,
    /// True if the verdict is against the ego, or if there is none.
    pub is_bad: bool,
    /// Sentences that explain the verdict.
    pub notes: Vec<String>,
    /// Tables below their headings.
    pub tables: Vec<ResultTable>,
    /// Episodes to show, with their worlds, the worst first.
    pub examples: Vec<PageEpisode<'a>>,
    /// Commands that reproduce the page.
    pub commands: Vec<String>,
}

/// Table of a page.
pub struct ResultTable {
    /// Heading.
    pub heading: String,
    /// Table below it.
    pub table: TextTable,
}

/// Episode of a page.
pub struct PageEpisode<'a> {
    /// World of the episode.
    pub scenario: &'a Scenario,
    /// Episode with its labels.
    pub example: Example,
}

impl ResultPage<'_> {
    /// Returns the page as HTML, without network access.
    pub fn html(&self) -> String {
        let all = self.examples.len();
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (head(&format!("brakecheck {}: {}", self.kind, self.verdict), animation::STYLE))
                body { main {
                    p class="dim" { "brakecheck report: " (self.kind) }
                    h1 class=[self.is_bad.then_some("note")] { (self.verdict) }
                    @for note in &self.notes { p { (note) } }
                    @for ResultTable { heading, table } in &self.tables {
                        h2 { (heading) }
                        (table.to_html())
                    }
                    @if all > 0 { h2 { "Episodes, the worst first" } }
                    @for (nth, shown) in self.examples.iter().enumerate() {
                        (example(shown.scenario, &shown.example, nth, all))
                    }
                    h2 { "How to make it again" }
                    pre { @for command in &self.commands { (command) "\n" } }
                }
                @if all > 0 { script { (PreEscaped(animation::SCRIPT)) } } }
            }
        };
        visible_markup(&page.into_string()).into_owned()
    }
}
