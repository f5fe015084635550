#![cfg(test)]
//! The table of the guide is the list.

use super::*;

const GUIDE: &str = include_str!("../../../../../../docs/reference/signals.md");

#[test]
fn the_table_of_the_guide_is_the_list() {
    let rows = SIGNALS.iter().map(|row| {
        assert!(!row.about.is_empty(), "{} says nothing", row.name);
        let owners: &[&str] = match row.of {
            Of::Clock | Of::Scene | Of::Parameter => &[],
            Of::Agent => &["A"],
            Of::Pair => &["A", "B"],
            Of::Light => &["L"],
            Of::AgentAndLight => &["A", "L"],
            Of::Weather => &["W"],
            Of::Road => &["R"],
        };
        let name = match row.of {
            Of::Parameter => "P".to_owned(),
            _ => [owners, &[row.name]].concat().join("."),
        };
        let about = in_words(row.about, owners);
        format!("| `{name}` | {} | {about} |\n", row.unit).replace("|  |", "| |")
    });
    let table: String = rows.collect();
    let table = format!("| signal | unit | meaning |\n| --- | --- | --- |\n{table}\n");
    assert!(
        GUIDE.contains(&table),
        "docs/reference/signals.md needs\n\n{table}"
    );
}
