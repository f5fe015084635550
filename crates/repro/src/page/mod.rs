//! Pages that are made from the recorded rows.
//!
//! `results.md` in this folder is the text of docs/background/results.md. A name in double
//! braces stands for a table of the study of that name. README has a smaller table between
//! two comments.

mod tables;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

use crate::record::{RecordError, ResultRow, Results};

pub use tables::case_studies_markdown;

/// Page with all tables, below the root of the repository.
pub(crate) const RESULTS: &str = "docs/background/results.md";
/// Page with the main worlds.
pub(crate) const README: &str = "README.md";
/// Text of [`RESULTS`].
const TEXT: &str = include_str!("results.md");
/// Comments around the table of [`README`].
const BORDERS: [&str; 2] = ["<!-- results:begin -->", "<!-- results:end -->"];
/// Text in place of a table without rows.
const NOTHING: &str = "No row of this table was measured yet. The command above measures it.";
/// Mark of a row that is not of this version.
const OLD: &str = "†";

/// Pages as the recorded rows give them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ResultPages {
    results: String,
    readme: String,
    /// Rows with changed digests, with the reason.
    pub(crate) outdated: Vec<String>,
}

impl ResultPages {
    /// Makes the pages, with the digests of this version.
    ///
    /// # Errors
    /// README cannot be read or lacks a comment around its table, or the numbers of a row do
    /// not have the form of their table.
    pub(crate) fn of(
        root: &Path,
        results: &Results,
        digests: &BTreeMap<String, String>,
    ) -> Result<ResultPages, RecordError> {
        let rows = RecordedRows { results, digests };
        let path = root.join(README);
        let read = std::fs::read_to_string(&path);
        let readme = read.map_err(|error| RecordError::Read { path, error })?;
        // Rows that were measured by hand are shown as such, and cannot be measured here.
        let outdated = results
            .rows()
            .filter(|(_, row)| !row.changed(digests).is_empty());
        Ok(ResultPages {
            results: filled(&rows)?,
            readme: between(&readme, &tables::readme(&rows)?)?,
            outdated: outdated
                .map(|(study, row)| format!("{study}, {}: {}", row.name, rows.reason(row)))
                .collect(),
        })
    }

    /// Files with their texts.
    pub(crate) fn files(&self) -> [(&'static str, &str); 2] {
        [(RESULTS, &self.results), (README, &self.readme)]
    }
}

/// Recorded rows beside the digests of this version.
pub(crate) struct RecordedRows<'a> {
    results: &'a Results,
    digests: &'a BTreeMap<String, String>,
}

impl RecordedRows<'_> {
    /// Returns the rows of a study.
    fn of(&self, study: &str) -> &[ResultRow] {
        self.results.of(study)
    }

    fn is_fresh(&self, row: &ResultRow) -> bool {
        row.is_fresh(self.digests)
    }

    /// Returns the reason why a row is not of this version.
    fn reason(&self, row: &ResultRow) -> String {
        let changed = row.changed(self.digests);
        let origin = &row.origin;
        // A row of which no probe vouches has no digest that could have changed.
        if changed.is_empty() {
            format!(
                "of an earlier version, measured on {} by `{}`",
                origin.date,
                without_world(&row.command)
            )
        } else {
            format!(
                "of an earlier version, changed since: {}",
                changed.join(", ")
            )
        }
    }

    /// Lines below the tables of a study: commands, days and rows that are not of this version.
    fn notes(&self, study: &str) -> String {
        let rows = self.of(study);
        // Rows that were measured by hand come from other commands.
        let by_command = rows.iter().filter(|row| !row.depends.is_empty());
        let mut commands: Vec<(String, Vec<&ResultRow>)> = Vec::new();
        for row in by_command {
            let command = format!("`repro {}`", without_world(&row.command));
            match commands.iter_mut().find(|(known, _)| *known == command) {
                Some((_, rows)) => rows.push(row),
                None => commands.push((command, vec![row])),
            }
        }
        let several = commands.len() > 1;
        let mut text = String::new();
        for (command, rows) in commands {
            let cpu_s: f64 = rows.iter().filter_map(|row| row.cpu_s).sum();
            let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
            // A single command has measured all rows, so no list of names follows it.
            let of = if several {
                format!(" ({})", names.join(", "))
            } else {
                String::new()
            };
            text.push_str(&format!(
                "Measured by {command}, in {:.0} CPU min{of}.\n",
                cpu_s / 60.0
            ));
        }
        let is_old = |row: &&ResultRow| !self.is_fresh(row);
        let mut old: Vec<(String, Vec<&str>)> = Vec::new();
        for row in rows.iter().filter(is_old) {
            let reason = self.reason(row);
            match old.iter_mut().find(|(known, _)| *known == reason) {
                Some((_, rows)) => rows.push(&row.name),
                None => old.push((reason, vec![&row.name])),
            }
        }
        if !old.is_empty() && !text.is_empty() {
            text.push('\n');
        }
        for (reason, names) in old {
            // A list of all names would only repeat the first column of the table.
            let names = if names.len() == rows.len() {
                "all rows".to_owned()
            } else {
                names.join(", ")
            };
            text.push_str(&format!("- {OLD} {names}: {reason}\n"));
        }
        text
    }
}

/// Returns a command without the option that selects a world.
fn without_world(command: &str) -> String {
    // Rows of a study differ in the world, and the page shows one command for all.
    let Some((before, after)) = command.split_once(" --world ") else {
        return command.to_owned();
    };
    // The selected world is a single word, so the next blank ends it.
    let rest = after.split_once(' ').map_or("", |(_, rest)| rest);
    format!("{before} {rest}").trim_end().to_owned()
}

/// Returns the text of the page with its tables.
fn filled(rows: &RecordedRows<'_>) -> Result<String, RecordError> {
    let mut text = TEXT.to_owned();
    for (name, table) in tables::all(rows)? {
        // A test requires that the text has one place for each table.
        text = text.replace(&format!("{{{{{name}}}}}"), shown(&table));
    }
    Ok(text)
}

/// Returns a table, or the text in place of one without rows.
fn shown(table: &str) -> &str {
    let lines = table.lines().filter(|line| line.starts_with('|')).count();
    // A head and a rule alone are no table. Lists have no such line.
    if (1..=2).contains(&lines) || table.trim().is_empty() {
        NOTHING
    } else {
        table.trim_end()
    }
}

/// Returns README with another table between its borders.
fn between(page: &str, table: &str) -> Result<String, RecordError> {
    let [begin, end] = BORDERS;
    // A page that is left as it is would keep an old table for good.
    let lacking = |comment| RecordError::NoBorder {
        path: README.into(),
        comment,
    };
    // Only the text between the borders is made here, and the rest of the page is kept.
    let (before, rest) = page.split_once(begin).ok_or_else(|| lacking(begin))?;
    let (_, after) = rest.split_once(end).ok_or_else(|| lacking(end))?;
    let inner = table.trim_end();
    Ok(format!("{before}{begin}\n{inner}\n{end}{after}"))
}
