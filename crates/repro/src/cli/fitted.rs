//! Markdown for terminals: its tables are fitted to the usual width.
//!
//! A table is cut into several if its words would be broken otherwise. The rest of the
//! text is unchanged.

use comfy_table::{ColumnConstraint, Width};

use brakecheck_report::report::table::{WIDTH, terminal_table};

/// The text with every table of it drawn.
pub(super) fn fitted(markdown: &str) -> String {
    let mut shown: Vec<String> = Vec::new();
    let mut rows: Vec<Vec<&str>> = Vec::new();
    for line in markdown.lines().chain([""]) {
        if let Some(cells) = cells(line) {
            rows.push(cells);
            continue;
        }
        shown.extend(drawn(&std::mem::take(&mut rows)));
        shown.push(line.to_owned());
    }
    shown.join("\n").trim_end().to_owned()
}

/// The cells of a line of a table.
fn cells(line: &str) -> Option<Vec<&str>> {
    let inside = line.strip_prefix('|')?.strip_suffix('|')?;
    Some(inside.split('|').map(str::trim).collect())
}

/// Draws a table, or several tables with some of its columns.
///
/// Each part has the columns that identify its rows.
fn drawn(lines: &[Vec<&str>]) -> Option<String> {
    let [header, _, rows @ ..] = lines else {
        return None;
    };
    let keys = keys(rows);
    let least = |column: usize| least_width(lines, column);
    // Every part repeats the key columns, so their width is taken first.
    let room = usize::from(WIDTH) - 1 - keys.iter().map(|key| least(*key)).sum::<usize>();
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    for column in (0..header.len()).filter(|column| !keys.contains(column)) {
        let width = least(column);
        match groups.last_mut() {
            Some((taken, group)) if *taken + width <= room => {
                *taken += width;
                group.push(column);
            }
            _ => groups.push((width, vec![column])),
        }
    }
    let part = |group: &[usize]| {
        let mut columns = [&keys, group].concat();
        // Key columns keep their place among the others.
        columns.sort_unstable();
        let of = |row: &[&str]| -> Vec<String> {
            let cell = |column: &usize| row.get(*column).copied().unwrap_or_default();
            columns.iter().map(|it| cell(it).to_owned()).collect()
        };
        let names = of(header);
        let mut table = terminal_table(&names.iter().map(String::as_str).collect::<Vec<_>>());
        for row in rows {
            table.add_row(of(row));
        }
        // Each column has room for its longest word. The remaining width goes to long
        // texts.
        for (at, column) in columns.iter().enumerate() {
            let width = u16::try_from(least(*column) - 1).unwrap_or(WIDTH);
            if let Some(column) = table.column_mut(at) {
                column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(width)));
            }
        }
        table.to_string()
    };
    let parts: Vec<String> = groups.iter().map(|(_, group)| part(group)).collect();
    Some(parts.join("\n"))
}

/// Returns the first column, and a second column if its values repeat.
///
/// Together they identify the rows.
fn keys(rows: &[Vec<&str>]) -> Vec<usize> {
    let are_unique = |columns: &[usize]| {
        let mut values: Vec<Vec<Option<&&str>>> = Vec::new();
        for row in rows {
            values.push(columns.iter().map(|it| row.get(*it)).collect());
        }
        // Equal keys become neighbours.
        values.sort_unstable();
        values.windows(2).all(|pair| pair[0] != pair[1])
    };
    let count = rows.first().map_or(0, Vec::len);
    match (1..count).find(|other| are_unique(&[0, *other])) {
        Some(other) if !are_unique(&[0]) => vec![0, other],
        _ => vec![0],
    }
}

/// Returns the least width of a column without broken words.
///
/// It is the longest word, two blanks and a line.
fn least_width(lines: &[Vec<&str>], column: usize) -> usize {
    // Line 1 is the rule below the header.
    let cells = lines
        .iter()
        .enumerate()
        .filter(|(nth, _)| *nth != 1)
        .filter_map(|(_, row)| row.get(column));
    let words = cells.flat_map(|cell| cell.split_whitespace());
    words.map(|word| word.chars().count()).max().unwrap_or(0) + 3
}

#[cfg(test)]
mod tests {
    use super::*;
    use brakecheck_report::report::table::TextTable;

    #[test]
    fn a_wide_table_is_cut_between_columns_and_no_word_is() {
        let names: Vec<String> = (0..14).map(|nth| format!("quantity{nth}")).collect();
        let row = |key: &str| {
            let cells = std::iter::repeat_n("[−0.123,".to_owned(), 14);
            std::iter::once(key.to_owned()).chain(cells)
        };
        let columns = std::iter::once("ego".to_owned()).chain(names.clone());
        let table = TextTable::new(columns, [row("softer brakes"), row("unrecognisably")]);
        let text = format!("Of two.\n\n{}\nIt ends.\n", table.to_markdown());
        let shown = fitted(&text);
        assert!(shown.starts_with("Of two.\n\n┌") && shown.ends_with("\n\nIt ends."));
        assert!(
            shown.lines().all(|line| line.chars().count() <= 100),
            "{shown}"
        );
        for name in &names {
            assert!(shown.contains(&format!(" {name} ")), "{name}: {shown}");
        }
        assert_eq!(shown.matches("[−0.123,").count(), 28, "{shown}");
        // Each of the three tables identifies its rows.
        assert_eq!(shown.matches("unrecognisably").count(), 3, "{shown}");
        assert_eq!(shown.matches("┌").count(), 3, "{shown}");
    }

    #[test]
    fn rows_are_identified_by_one_column_or_two() {
        let rows = |pairs: &[[&'static str; 3]]| -> Vec<Vec<&str>> {
            pairs.iter().map(|row| row.to_vec()).collect()
        };
        assert_eq!(keys(&rows(&[["a", "1", "x"], ["b", "1", "x"]])), [0]);
        assert_eq!(keys(&rows(&[["a", "1", "x"], ["a", "1", "y"]])), [0, 2]);
        assert_eq!(keys(&rows(&[["a", "1", "x"], ["a", "1", "x"]])), [0]);
    }
}
