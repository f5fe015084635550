//! The page of a merged campaign: rates, gates, maps.

use maud::{DOCTYPE, Markup, html};

use super::page::head;
use super::start_map::{StartMap, legend, start_map};
use crate::visible::visible_markup;

/// Maps of a page, at most: what is more is in the rows.
const MAX_MAPS: usize = 120;

/// Everything the page of a campaign shows.
pub struct CampaignPage {
    /// The campaign's name.
    pub name: String,
    /// What it consists of, in a sentence.
    pub about: String,
    /// What the columns of the table are.
    pub columns: Vec<String>,
    /// The rates: who meets whom, then numbers.
    pub rows: Vec<Vec<String>>,
    /// A sentence per gate, and whether it is held up.
    pub gates: Vec<(String, bool)>,
    /// Maps of a grid of starts.
    pub maps: Vec<StartMap>,
    /// What the boundary in the maps is.
    pub boundary: Option<String>,
    /// Commands that make it again, and hashes.
    pub again: Vec<String>,
}

impl CampaignPage {
    /// The page as HTML; it needs no network and no script.
    pub fn html(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (head(&format!("brakecheck campaign: {}", self.name), ""))
                body { main {
                    p class="dim" { "brakecheck campaign" }
                    h1 { (self.name) }
                    p { (self.about) }
                    @for (gate, held_up) in &self.gates {
                        p class=(if *held_up { "note" } else { "dim" }) { (gate) }
                    }
                    @if !self.maps.is_empty() { (self.drawn()) }
                    h2 { "Rates" }
                    (self.table())
                    h2 { "How to make it again" }
                    pre { @for line in &self.again { (line) "\n" } }
                } }
            }
        };
        visible_markup(&page.into_string()).into_owned()
    }

    fn drawn(&self) -> Markup {
        let drawn = &self.maps[..self.maps.len().min(MAX_MAPS)];
        let left_out = self.maps.len() - drawn.len();
        html! {
            h2 { "Where it is unsafe" }
            (legend(self.boundary.as_deref()))
            @for group in drawn.chunk_by(|a, b| a.group == b.group) {
                h3 { (group[0].group) }
                div class="cards" {
                    @for map in group { div class="card" { (start_map(map)) } }
                }
            }
            @if 0 < left_out { p { (left_out) " more maps are not drawn: their starts are in the merged file." } }
        }
    }

    fn table(&self) -> Markup {
        html! {
            div class="wide" { table class="rows" {
                thead { tr { @for column in &self.columns { th { (column) } } } }
                tbody {
                    @for row in &self.rows {
                        tr { @for (column, cell) in self.columns.iter().zip(row) { td data-l=(column) { (cell) } } }
                    }
                }
            } }
        }
    }
}
