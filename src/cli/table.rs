//! Rows as a table for people.

use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};

use crate::run::Row;

/// All rows as one table, opened by what happens without an adversary.
pub(super) fn rows(rows: &[Row]) -> String {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header([
            "ego",
            "ado",
            "method",
            "success",
            "95 % interval",
            "recall",
            "fouls",
            "contact",
            "closing m/s",
            "sims/start",
            "cpu s",
        ]);
    for row in rows {
        let recall = row.recall.map_or("–".to_owned(), |r| format!("{r:.3}"));
        let closing = row.closing_speed_mps.map_or("–".to_owned(), |c| {
            format!("{:.1} / {:.1}", c.median, c.p90)
        });
        let numbers = [
            format!(
                "{:.1} % ({}/{})",
                100.0 * row.success_rate,
                row.successes,
                row.starts
            ),
            format!("{:.1} – {:.1}", 100.0 * row.ci95[0], 100.0 * row.ci95[1]),
            recall,
            format!("{:.1} %", 100.0 * row.foul_rate),
            format!("{:.1} %", 100.0 * row.contact_rate),
            closing,
            format!("{:.1}", row.sims_per_start),
            format!("{:.1}", row.cpu_s),
        ];
        let mut cells = vec![
            Cell::new(&row.ego),
            Cell::new(&row.ado),
            Cell::new(&row.method),
        ];
        let right = |text: &String| Cell::new(text).set_alignment(CellAlignment::Right);
        cells.extend(numbers.iter().map(right));
        table.add_row(cells);
    }
    format!("{}\n{table}", opening(rows))
}

fn opening(rows: &[Row]) -> String {
    let Some(row) = rows.first() else {
        return String::new();
    };
    let all = row.starts + row.trivial;
    let share = 100.0 * row.trivial as f64 / all.max(1) as f64;
    let mut text = format!(
        "{} on the {:?} plant, {} starts of seed {}; fails without an adversary: {share:.1} % ({}), left out below",
        row.world, row.plant, all, row.start_seed, row.trivial
    );
    let invalid: usize = rows.iter().map(|row| row.invalid).sum();
    if 0 < invalid {
        text.push_str(&format!("; {invalid} invalid episodes"));
    }
    text
}
