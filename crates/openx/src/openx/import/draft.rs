//! Drafts of worlds: texts with holes for numbers that may vary.
//!
//! Points whose texts differ only in the holes share one world. A number that
//! is equal at all points is written as it is. Other numbers become ranges, and
//! `points` has a column for each of them.

use std::fmt::Write as _;

use crate::opendrive::error::{At, ImportError};

/// Greatest number of worlds of an import.
pub(super) const MOST_WORLDS: usize = 1_000;

/// World that an import produced.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedWorld {
    /// Name of the world.
    pub name: String,
    /// RON text of the world.
    pub text: String,
    /// Indices in the variation file of its points, in the order of its table.
    pub points: Vec<usize>,
    /// Elements of the files from which its parts come, by the offsets at which they begin.
    places: Vec<(usize, At)>,
}

impl ImportedWorld {
    /// Returns a problem of the text, from an offset on, as one of the element of the
    /// files that leads to it.
    pub fn refused(&self, offset: usize, what: &str) -> Option<ImportError> {
        let begun = self.places.iter().rev().find(|(from, _)| *from <= offset);
        begun.map(|(_, at)| at.error(what))
    }
}

/// Part of a draft.
#[derive(Clone, Debug, PartialEq)]
enum DraftPart {
    Text(String),
    /// Number that may differ between points.
    ///
    /// `axis` names its axis, and `more` is the difference between the value on
    /// the axis and the written value.
    Hole {
        axis: String,
        value: f64,
        more: f64,
    },
    /// Greatest and least value of all points.
    Most(f64),
    Least(f64),
    /// Element of the files from which what follows comes.
    Mark(At),
}

/// Text with holes.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    parts: Vec<DraftPart>,
    /// Least duration of the run, and earliest time at which an entity leaves its road.
    until_s: f64,
    leaves_s: f64,
    /// True if the run ends before the stop time of the file.
    pub is_cut: bool,
}

impl Draft {
    /// Returns an empty draft of a run with the given least duration.
    ///
    /// No entity leaves its road before `leaves_s`.
    pub(super) fn of(until_s: f64, leaves_s: f64) -> Draft {
        Draft {
            parts: Vec::new(),
            until_s,
            leaves_s,
            is_cut: false,
        }
    }

    pub(super) fn text(&mut self, text: &str) {
        match self.parts.last_mut() {
            Some(DraftPart::Text(before)) => before.push_str(text),
            _ => self.parts.push(DraftPart::Text(text.to_owned())),
        }
    }

    /// States the element of the files from which what follows comes.
    pub(super) fn mark(&mut self, at: &At) {
        self.parts.push(DraftPart::Mark(at.clone()));
    }

    pub(super) fn hole(&mut self, axis: &str, value: f64) {
        self.beside(axis, value, 0.0);
    }

    /// Adds a number of which the greatest of all points is written.
    pub(super) fn most(&mut self, value: f64) {
        self.parts.push(DraftPart::Most(value));
    }

    /// Adds a number of which the least of all points is written.
    pub(super) fn least(&mut self, value: f64) {
        self.parts.push(DraftPart::Least(value));
    }

    pub(super) fn beside(&mut self, axis: &str, value: f64, more: f64) {
        // Values that differ only in rounding must be equal, or they would
        // become an axis.
        self.parts.push(DraftPart::Hole {
            axis: axis.to_owned(),
            value: tidy(value),
            more,
        });
    }

    fn is_like(&self, other: &Draft) -> bool {
        let is_same = |pair: (&DraftPart, &DraftPart)| match pair {
            (DraftPart::Text(a), DraftPart::Text(b)) => a == b,
            (
                DraftPart::Hole {
                    axis: a, more: m, ..
                },
                DraftPart::Hole {
                    axis: b, more: n, ..
                },
            ) => a == b && m == n,
            (DraftPart::Most(_), DraftPart::Most(_))
            | (DraftPart::Least(_), DraftPart::Least(_))
            | (DraftPart::Mark(_), DraftPart::Mark(_)) => true,
            _ => false,
        };
        let same_length = self.parts.len() == other.parts.len();
        same_length && self.parts.iter().zip(&other.parts).all(is_same)
    }
}

/// Rounds to nine decimals, without −0.
///
/// Rounding removes the digits that sums of decimal fractions add.
pub(super) fn tidy(value: f64) -> f64 {
    let tidy = (value * 1e9).round() / 1e9;
    tidy + 0.0
}

/// Drafts that share a world.
struct DraftGroup {
    drafts: Vec<(usize, Draft)>,
    /// Longest run of them, and earliest departure of an entity.
    until_s: f64,
    leaves_s: f64,
}

impl DraftGroup {
    /// Returns true for a draft of the same text whose run, as the longest of the
    /// others, ends before an entity of any of them leaves its road.
    fn fits(&self, draft: &Draft) -> bool {
        let until_s = self.until_s.max(draft.until_s);
        let ends = until_s <= self.leaves_s.min(draft.leaves_s);
        ends && self.drafts[0].1.is_like(draft)
    }
}

/// Groups drafts into worlds, each with the points that share it.
///
/// Several worlds are numbered from 1. Returns `None` for more than [`MOST_WORLDS`].
pub(super) fn worlds(
    name: &str,
    source: &str,
    drafts: Vec<(usize, Draft)>,
) -> Option<Vec<ImportedWorld>> {
    let mut groups: Vec<DraftGroup> = Vec::new();
    for (index, draft) in drafts {
        let is_full = groups.len() == MOST_WORLDS;
        let group = groups.iter_mut().find(|group| group.fits(&draft));
        match group {
            Some(group) => {
                group.until_s = group.until_s.max(draft.until_s);
                group.leaves_s = group.leaves_s.min(draft.leaves_s);
                group.drafts.push((index, draft));
            }
            None if is_full => return None,
            None => groups.push(DraftGroup {
                until_s: draft.until_s,
                leaves_s: draft.leaves_s,
                drafts: vec![(index, draft)],
            }),
        }
    }
    let several = groups.len() > 1;
    let groups = groups.iter().map(|group| &group.drafts);
    let worlds = groups.zip(1..).map(|(group, number)| {
        let name = if several {
            format!("{name}_{number}")
        } else {
            name.to_owned()
        };
        let (text, places) = written(&name, source, group);
        ImportedWorld {
            text,
            places,
            points: group.iter().map(|(index, _)| *index).collect(),
            name,
        }
    });
    Some(worlds.collect())
}

/// RON text of the world of a group of points, with the elements of its parts.
fn written(name: &str, source: &str, group: &[(usize, Draft)]) -> (String, Vec<(usize, At)>) {
    let mut text = format!(
        "// Imported by `brakecheck new --from`.\n\
         // The ego coasts as the protocol assumes: `brakecheck eval` with `--ego` or `-- COMMAND` tests yours.\n\
         Scenario(\n    name: {name:?},\n    question: \"Which points of the protocol does the \
         ego pass?\",\n    source: {source:?},\n"
    );
    let mut axes: Vec<(String, Vec<f64>)> = Vec::new();
    let mut places = Vec::new();
    for (i, part) in group[0].1.parts.iter().enumerate() {
        // All drafts of a group have the same parts, so the index fits all of
        // them.
        let values = group.iter().filter_map(|(_, draft)| match draft.parts[i] {
            DraftPart::Hole { value, .. } | DraftPart::Most(value) | DraftPart::Least(value) => {
                Some(value)
            }
            DraftPart::Text(_) | DraftPart::Mark(_) => None,
        });
        let (least, most) = values.clone().fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(least, most), value| (least.min(value), most.max(value)),
        );
        // Writing to a string cannot fail.
        let _ = match part {
            DraftPart::Text(part) => write!(text, "{part}"),
            DraftPart::Mark(at) => {
                places.push((text.len(), at.clone()));
                Ok(())
            }
            DraftPart::Most(_) => write!(text, "{}", decimal(tidy(most))),
            DraftPart::Least(_) => write!(text, "{}", decimal(tidy(least))),
            DraftPart::Hole { .. } if least == most => write!(text, "{}", decimal(least)),
            DraftPart::Hole { axis, more, .. } => {
                let column = values.map(|value| value + more);
                axes.push((axis.clone(), column.collect()));
                write!(text, "({}, {})", decimal(least), decimal(most))
            }
        };
    }
    if !axes.is_empty() {
        let names: Vec<String> = axes.iter().map(|(name, _)| format!("{name:?}")).collect();
        let _ = write!(
            text,
            "    points: (\n        axes: [{}],\n        rows: [\n",
            names.join(", ")
        );
        for row in 0..group.len() {
            let row: Vec<String> = axes
                .iter()
                .map(|(_, column)| decimal(column[row]))
                .collect();
            let _ = writeln!(text, "            [{}],", row.join(", "));
        }
        text.push_str("        ],\n    ),\n");
    }
    text.push_str(")\n");
    (text, places)
}

/// Number with a decimal point, as in the RON files of the repository.
fn decimal(value: f64) -> String {
    format!("{value:?}")
}
