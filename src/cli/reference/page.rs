//! Page of tables, as Markdown or as data.

use serde_json::{Map, Value, json};

/// Page about a topic.
pub(super) struct ReferencePage {
    pub(super) title: &'static str,
    /// Paragraphs above the tables.
    pub(super) about: String,
    pub(super) tables: Vec<ReferenceTable>,
}

/// Table with cells of Markdown.
pub(super) struct ReferenceTable {
    /// Heading above it, empty for the table of a whole page.
    title: String,
    /// Paragraph below the heading, empty for none.
    about: String,
    columns: &'static [&'static str],
    rows: Vec<Vec<String>>,
}

impl ReferenceTable {
    pub(super) fn new(
        title: impl Into<String>,
        columns: &'static [&'static str],
        rows: impl IntoIterator<Item = Vec<String>>,
    ) -> ReferenceTable {
        ReferenceTable {
            title: title.into(),
            about: String::new(),
            columns,
            rows: rows.into_iter().collect(),
        }
    }

    pub(super) fn with_about(self, about: String) -> ReferenceTable {
        ReferenceTable { about, ..self }
    }

    fn to_markdown(&self) -> String {
        let mut text = String::new();
        if !self.title.is_empty() {
            text += &format!("## {}\n\n", self.title);
        }
        if !self.about.is_empty() {
            text += &format!("{}\n\n", self.about);
        }
        text += &line(self.columns.iter().copied());
        text += &line(self.columns.iter().map(|_| "---"));
        for row in &self.rows {
            text += &line(row.iter().map(String::as_str));
        }
        text
    }

    fn to_json(&self) -> Value {
        // The columns are the keys, so a script needs no list of them.
        let object = |row: &Vec<String>| -> Map<String, Value> {
            let cells = self.columns.iter().zip(row);
            cells
                .map(|(column, cell)| ((*column).to_owned(), json!(cell)))
                .collect()
        };
        let rows: Vec<_> = self.rows.iter().map(object).collect();
        json!({ "title": self.title, "about": self.about, "rows": rows })
    }
}

impl ReferencePage {
    pub(super) fn to_markdown(&self) -> String {
        let tables = self.tables.iter().map(ReferenceTable::to_markdown);
        let parts = [format!("# {}\n", self.title), format!("{}\n", self.about)];
        parts
            .into_iter()
            .chain(tables)
            .collect::<Vec<_>>()
            .join("\n")
    }

    pub(super) fn to_json(&self) -> Value {
        let tables: Vec<Value> = self.tables.iter().map(ReferenceTable::to_json).collect();
        json!({ "title": self.title, "about": self.about, "tables": tables })
    }
}

/// Returns a line of a table.
fn line<'a>(cells: impl Iterator<Item = &'a str>) -> String {
    // A bar would end its cell, also inside code.
    let cells = cells.map(|cell| format!(" {} |", cell.replace('|', "\\|")));
    format!("|{}\n", cells.collect::<String>())
}
