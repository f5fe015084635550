//! Kind of world that the first word of a file names.

use std::ops::Range;

use crate::ron_file::{Problem, did_you_mean, first_word, known_names};

/// Kind of world that a file describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WorldKind {
    /// `Scenario(…)`: driving.
    Scenario,
    /// `Grid(…)`: cells.
    Grid,
}

/// Returns the kind of world that the first word of a file names.
///
/// Other mistakes are left to the reader.
pub(super) fn kind(text: &str) -> Result<WorldKind, Problem> {
    // It begins with a bracket, so its first word is that of a field.
    if let Some(span) = kept(text) {
        return Err(Problem {
            what: "this is a kept counterexample, and no world".to_owned(),
            span,
            label: "begins a kept counterexample".to_owned(),
            help: Some("replay it: `brakecheck replay FILE`".to_owned()),
        });
    }
    if let Some((what, help)) = other_file(text) {
        let begin = text.len() - text.trim_start().len();
        return Err(Problem {
            what: format!("this is {what}, and no world"),
            span: begin..begin + 1,
            label: "begins it".to_owned(),
            help: Some(help.to_owned()),
        });
    }
    // The reader of scenarios reports a text without any word.
    let Some(span) = first_word(text) else {
        return Ok(WorldKind::Scenario);
    };
    let known = ["Scenario", "Grid"];
    match &text[span.clone()] {
        "Scenario" => Ok(WorldKind::Scenario),
        "Grid" => Ok(WorldKind::Grid),
        other => {
            let list = known_names("one of", known);
            Err(Problem {
                what: format!("`{other}` is no kind of world"),
                span,
                label: "not known".to_owned(),
                help: Some(match did_you_mean(other, known) {
                    Some(guess) => format!("{guess} — {list}"),
                    None => list,
                }),
            })
        }
    }
}

/// Returns the kind of a file for another verb, with that verb.
fn other_file(text: &str) -> Option<(&'static str, &'static str)> {
    let campaign = "plan it: `brakecheck campaign plan FILE -o DIR`";
    let scenario = "import a scenario: `brakecheck new NAME --from FILE`";
    if text.trim_start().starts_with('<') {
        return Some(("an XML file", scenario));
    }
    let first = first_word(text).map(|span| &text[span]);
    (first == Some("Campaign")).then_some(("a campaign", campaign))
}

/// Returns the place of the first field of a kept counterexample, if a text is one.
fn kept(text: &str) -> Option<Range<usize>> {
    let inside = text.trim_start().strip_prefix('(')?.trim_start();
    let after = inside.strip_prefix("format")?;
    let start = text.len() - inside.len();
    let end = text.len() - after.len();
    after.trim_start().starts_with(':').then_some(start..end)
}
