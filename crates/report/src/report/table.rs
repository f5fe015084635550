//! Tables of text, for terminals, Markdown and pages.

use comfy_table::{Cell, CellAlignment, ContentArrangement, presets};
use maud::{Markup, html};

/// Headings, and rows with a cell for each of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextTable {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
    /// First column of numbers. A terminal shows these on the right.
    numbers_from: usize,
}

impl TextTable {
    /// Returns a table of some rows.
    pub fn new<R: IntoIterator<Item = String>>(
        columns: impl IntoIterator<Item = impl Into<String>>,
        rows: impl IntoIterator<Item = R>,
    ) -> TextTable {
        let rows = rows.into_iter().map(|row| row.into_iter().collect());
        TextTable {
            columns: columns.into_iter().map(Into::into).collect(),
            rows: rows.collect(),
            numbers_from: usize::MAX,
        }
    }

    /// Returns the table with numbers in all columns from a position on.
    pub fn numbers_from(self, column: usize) -> TextTable {
        TextTable {
            numbers_from: column,
            ..self
        }
    }

    /// Returns the table without its first column, such as a name that all rows share.
    pub fn without_first_column(self) -> TextTable {
        let rest = |row: Vec<String>| row.into_iter().skip(1).collect();
        TextTable {
            columns: rest(self.columns),
            rows: self.rows.into_iter().map(rest).collect(),
            numbers_from: self.numbers_from.saturating_sub(1),
        }
    }

    /// Returns lines for a terminal of so many columns. Wider cells are wrapped.
    ///
    /// A column in which every cell is a dash or empty is left out.
    pub fn to_terminal(&self, width: usize) -> String {
        let is_shown = |column: &usize| {
            let mut cells = self.rows.iter().filter_map(|row| row.get(*column));
            // A table without rows keeps its headings.
            self.rows.is_empty() || cells.any(|cell| !matches!(cell.as_str(), "–" | ""))
        };
        let shown: Vec<usize> = (0..self.columns.len()).filter(is_shown).collect();
        let columns: Vec<&String> = shown.iter().map(|at| &self.columns[*at]).collect();
        let mut table = terminal_table(&columns, width);
        for row in &self.rows {
            table.add_row(shown.iter().map(|column| {
                let cell = Cell::new(row.get(*column).map_or("", String::as_str));
                if *column < self.numbers_from {
                    cell
                } else {
                    cell.set_alignment(CellAlignment::Right)
                }
            }));
        }
        table.to_string()
    }

    /// Returns lines of Markdown.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = vec!["---".to_owned(); self.columns.len()];
        let rows = self.rows.iter().map(|row| line(row));
        line(&self.columns) + &line(&rule) + &rows.collect::<String>()
    }

    /// Returns the table of a page. Narrow screens show the heading in each cell.
    pub(crate) fn to_html(&self) -> Markup {
        html! {
            div class="wide" { table class="rows" {
                thead { tr { @for column in &self.columns { th { (column) } } } }
                tbody { @for row in &self.rows {
                    tr { @for (column, cell) in self.columns.iter().zip(row) { td data-l=(column) { (cell) } } }
                } }
            } }
        }
    }
}

/// Returns a cell, or a dash if it is not known, such as a share of no starts.
///
/// 0 % of nothing would look safe.
pub fn known_if(is_known: bool, cell: impl FnOnce() -> String) -> String {
    if is_known { cell() } else { "–".to_owned() }
}

/// Returns a table with headings, to be drawn on a terminal of so many columns.
fn terminal_table(headings: &[impl AsRef<str>], columns: usize) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        // A terminal reports any width, and the library counts to 65,535.
        .set_width(u16::try_from(columns).unwrap_or(u16::MAX))
        .set_header(headings.iter().map(AsRef::as_ref));
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_table_has_three_forms() {
        let rows = [["hold", "7"], ["trained", "190"]].map(|row| row.map(str::to_owned));
        let table = TextTable::new(["ado", "starts"], rows).numbers_from(1);
        assert_eq!(
            table.to_markdown(),
            "| ado | starts |\n| --- | --- |\n| hold | 7 |\n| trained | 190 |\n"
        );
        assert_eq!(
            table.to_terminal(100),
            "┌─────────┬────────┐\n\
             │ ado     ┆ starts │\n\
             ╞═════════╪════════╡\n\
             │ hold    ┆      7 │\n\
             │ trained ┆    190 │\n\
             └─────────┴────────┘"
        );
        let dashes = [["hold", "–", "7"], ["trained", "–", "–"]].map(|row| row.map(str::to_owned));
        let with_dashes = TextTable::new(["ado", "recall", "starts"], dashes);
        let text = with_dashes.to_terminal(100);
        assert!(
            !text.contains("recall") && text.contains("│ trained ┆ –"),
            "{text}"
        );
        let text = with_dashes.without_first_column().to_terminal(100);
        assert!(
            !text.contains("ado") && text.contains("│ starts │"),
            "{text}"
        );
        let html = table.to_html().into_string();
        assert!(html.contains("<td data-l=\"starts\">190</td>"), "{html}");
    }
}
