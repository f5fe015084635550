//! Keys that `--json` prints, from the table beside this file.

use super::page::{ReferencePage, ReferenceTable};

/// Sections with the verbs of their keys. A line has names, unit and meaning.
///
/// `*` stands for keys that depend on the data, and for all keys below them.
const KEYS: &str = include_str!("keys.txt");

pub(super) fn page() -> ReferencePage {
    let about = "\
Every verb prints one JSON object with `--json`, except `serve`, `lsp`, `completions` and `man`. \
A dot joins a key and the keys of the object, or of each object in the list, below it. \
Later versions may add keys.

A name with the suffix `_s`, `_m`, `_mps`, `_mps2` or `_rad` has this SI unit. \
Shares and rates are 0 to 1, and intervals are pairs of a lower and an upper bound. \
Optional keys are absent or `null` if they do not apply. \
Infinite robustness is the text `inf` or `-inf`.";
    // The text begins with a heading, so its first part is empty and has no line.
    let sections = KEYS.split("# ").filter_map(|it| it.split_once('\n'));
    let tables = sections.map(|(verbs, lines)| {
        let verbs: Vec<String> = verbs.split(", ").map(|it| format!("`{it}`")).collect();
        let rows = lines.lines().filter(|it| !it.is_empty()).map(row);
        ReferenceTable::new(verbs.join(", "), &["key", "unit", "meaning"], rows)
    });
    ReferencePage {
        title: "Keys of `--json`",
        about: about.to_owned(),
        tables: tables.collect(),
    }
}

fn row(line: &str) -> Vec<String> {
    let mut cells = line.splitn(3, '|').map(str::trim);
    let plain = cells.next().unwrap_or_default().split(", ");
    let names: Vec<String> = plain.map(|it| format!("`{it}`")).collect();
    let rest = cells.map(str::to_owned);
    [names.join(", ")].into_iter().chain(rest).collect()
}
