#![cfg(test)]
//! Tests of data derived from the list: listing, values, bounds, names, table.

use super::*;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Constant, play};
use crate::world::Scenario;

const WORLD: &str = include_str!("../../../../worlds/acc.ron");
const GUIDE: &str = include_str!("../../../../docs/reference/signals.md");
/// The row that exists in tests only.
const DUMMY: &str = "doubled_speed";

#[test]
fn one_row_is_all_it_takes_to_publish_a_signal() {
    let rule = "(ado.speed <= v_lim)";
    assert!(WORLD.contains(rule));
    let text = WORLD.replacen(rule, "(ado.doubled_speed <= 60)", 1);
    let world = Scenario::parse("acc.ron", &text).expect("a world");
    let listed = world.signals();
    let (signal, _) = listed
        .iter()
        .find(|(signal, _)| signal.name == "ego.doubled_speed")
        .expect("listed");
    assert_eq!(signal.unit, "m/s");
    assert!(signal.about.starts_with("twice the speed of ego"));
    let mut bench = world.bench();
    let start = bench.draw(StartKey {
        purpose: Purpose::Train,
        seed: 1,
        index: 0,
    });
    let trace = play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Skip).trace;
    let column = |name| trace.signal(name).expect("published");
    let pairs = column("ado.speed").iter().zip(column("ado.doubled_speed"));
    assert!(trace.signal("ego.doubled_speed").is_none(), "not mentioned");
    assert!(pairs.clone().all(|(once, twice)| 2.0 * once == *twice));
    let position = trace.schema().position("ado.doubled_speed").expect("there");
    let bounds = world.drive().expect("a road").spec().bounds()[position];
    assert_eq!(bounds.range, Interval { lo: 0.0, hi: 400.0 });
    assert!(!bounds.untouched);
}

#[test]
fn the_table_of_the_guide_is_the_list() {
    let rows = SIGNALS.iter().filter(|row| row.name != DUMMY).map(|row| {
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
