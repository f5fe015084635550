//! Page of a merged campaign: rates, gates and maps.

use maud::{DOCTYPE, Markup, html};

use super::page::head;
use super::start_map::{StartMap, legend, start_map};
use super::table::TextTable;
use crate::visible::visible_markup;

/// Greatest number of maps on a page. The merged file contains all of them.
const MAX_MAPS: usize = 120;

/// Content of a campaign's page.
pub struct CampaignPage {
    /// Name of the campaign.
    pub name: String,
    /// Content of the campaign, in one sentence.
    pub about: String,
    /// Rates of every world, ego and ado.
    pub rates: TextTable,
    /// One sentence per gate, and true if the gate is closed.
    pub gates: Vec<(String, bool)>,
    /// Maps of a grid of starts.
    pub maps: Vec<StartMap>,
    /// Meaning of the boundary in the maps.
    pub boundary: Option<String>,
    /// Commands that reproduce the campaign, and hashes.
    pub again: Vec<String>,
}

impl CampaignPage {
    /// Returns the page as HTML, without network access or scripts.
    pub fn html(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                (head(&format!("brakecheck campaign: {}", self.name), ""))
                body { main {
                    p class="dim" { "brakecheck campaign" }
                    h1 { (self.name) }
                    p { (self.about) }
                    @for (gate, is_closed) in &self.gates {
                        p class=(if *is_closed { "note" } else { "dim" }) { (gate) }
                    }
                    @if !self.maps.is_empty() { (self.drawn()) }
                    h2 { "Rates" }
                    (self.rates.to_html())
                    h2 { "How to make it again" }
                    pre { @for line in &self.again { (line) "\n" } }
                } }
            }
        };
        visible_markup(&page.into_string()).into_owned()
    }

    fn drawn(&self) -> Markup {
        let drawn = &self.maps[..self.maps.len().min(MAX_MAPS)];
        // Counted, so that the page drops nothing silently.
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
            @if left_out > 0 { p { (left_out) " more maps are not drawn: their starts are in the merged file." } }
        }
    }
}
