//! Texts of worlds with holes for numbers, and points that share a text.
//!
//! Points whose texts are equal but for the holes are one world: a number that is
//! the same at all of them stands in it, others become ranges, and `points` has a
//! column for each.

use std::fmt::Write as _;

/// A world that was imported.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedWorld {
    /// Its name.
    pub name: String,
    /// Its text.
    pub text: String,
    /// Which points of the variation file it has, in the order of its table.
    pub points: Vec<usize>,
}

/// A part of a draft.
#[derive(Clone, Debug, PartialEq)]
enum Part {
    Text(String),
    /// A number that may differ from point to point: the axis that its range is,
    /// and by how much more the axis is than what is written.
    Hole {
        axis: String,
        value: f64,
        more: f64,
    },
    /// The greatest, or the least, of all points.
    Most(f64),
    Least(f64),
}

/// A text with holes.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    parts: Vec<Part>,
    /// What the run lasts at least, and when somebody leaves its road at the earliest.
    until_s: f64,
    leaves_s: f64,
    /// Whether that is before the file ends the run.
    pub is_cut: bool,
}

impl Draft {
    /// Of a run that lasts at least so long, and in which nobody leaves its road before.
    pub fn of(until_s: f64, leaves_s: f64) -> Draft {
        Draft {
            parts: Vec::new(),
            until_s,
            leaves_s,
            is_cut: false,
        }
    }

    pub fn text(&mut self, text: &str) {
        match self.parts.last_mut() {
            Some(Part::Text(before)) => before.push_str(text),
            _ => self.parts.push(Part::Text(text.to_owned())),
        }
    }

    pub fn hole(&mut self, axis: &str, value: f64) {
        self.beside(axis, value, 0.0);
    }

    /// A number that is the greatest of all points.
    pub fn most(&mut self, value: f64) {
        self.parts.push(Part::Most(value));
    }

    /// A number that is the least of all points.
    pub fn least(&mut self, value: f64) {
        self.parts.push(Part::Least(value));
    }

    pub fn beside(&mut self, axis: &str, value: f64, more: f64) {
        self.parts.push(Part::Hole {
            axis: axis.to_owned(),
            value: tidy(value),
            more,
        });
    }

    fn is_like(&self, other: &Draft) -> bool {
        let alike = |pair: (&Part, &Part)| match pair {
            (Part::Text(a), Part::Text(b)) => a == b,
            (
                Part::Hole {
                    axis: a, more: m, ..
                },
                Part::Hole {
                    axis: b, more: n, ..
                },
            ) => a == b && m == n,
            (Part::Most(_), Part::Most(_)) | (Part::Least(_), Part::Least(_)) => true,
            _ => false,
        };
        let same_length = self.parts.len() == other.parts.len();
        same_length && self.parts.iter().zip(&other.parts).all(alike)
    }

    /// Whether a run that lasts as long as both ends before anybody leaves a road.
    fn ends_with(&self, other: &Draft) -> bool {
        self.until_s.max(other.until_s) <= self.leaves_s.min(other.leaves_s)
    }
}

/// A number without the dust of sums of measured numbers.
pub(super) fn tidy(value: f64) -> f64 {
    let tidy = (value * 1e9).round() / 1e9;
    tidy + 0.0
}

/// Worlds of drafts, each with the points that share it.
pub(super) fn worlds(name: &str, source: &str, drafts: Vec<(usize, Draft)>) -> Vec<ImportedWorld> {
    let mut groups: Vec<Vec<(usize, Draft)>> = Vec::new();
    for (index, draft) in drafts {
        let fits = |group: &&mut Vec<(usize, Draft)>| {
            group[0].1.is_like(&draft) && group.iter().all(|(_, it)| it.ends_with(&draft))
        };
        let group = groups.iter_mut().find(fits);
        match group {
            Some(group) => group.push((index, draft)),
            None => groups.push(vec![(index, draft)]),
        }
    }
    let several = 1 < groups.len();
    let worlds = groups.iter().zip(1..).map(|(group, number)| {
        let name = match several {
            true => format!("{name}_{number}"),
            false => name.to_owned(),
        };
        ImportedWorld {
            text: written(&name, source, group),
            points: group.iter().map(|(index, _)| *index).collect(),
            name,
        }
    });
    worlds.collect()
}

/// The text of a world; `group` are its points.
fn written(name: &str, source: &str, group: &[(usize, Draft)]) -> String {
    let mut text = format!(
        "// Imported by `brakecheck new --from`.\n\
         // The ego coasts as the protocol assumes: `brakecheck eval` with `--ego` or `-- COMMAND` tests yours.\n\
         Scenario(\n    name: {name:?},\n    question: \"Which points of the protocol does the \
         ego pass?\",\n    source: {source:?},\n"
    );
    let mut axes: Vec<(String, Vec<f64>)> = Vec::new();
    for (i, part) in group[0].1.parts.iter().enumerate() {
        let values = group.iter().filter_map(|(_, draft)| match draft.parts[i] {
            Part::Hole { value, .. } | Part::Most(value) | Part::Least(value) => Some(value),
            Part::Text(_) => None,
        });
        let (least, most) = values.clone().fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(least, most), value| (least.min(value), most.max(value)),
        );
        let _ = match part {
            Part::Text(part) => write!(text, "{part}"),
            Part::Most(_) => write!(text, "{}", decimal(tidy(most))),
            Part::Least(_) => write!(text, "{}", decimal(tidy(least))),
            Part::Hole { .. } if least == most => write!(text, "{}", decimal(least)),
            Part::Hole { axis, more, .. } => {
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
    text
}

/// A number with a point, as RON files here have them.
fn decimal(value: f64) -> String {
    format!("{value:?}")
}
