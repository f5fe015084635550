//! Egos of other structures: their selection, and their table.

use crate::structures::SolvedBy;
use crate::{StructureRow, other_structures, structures_markdown};
use brakecheck::world::Scenario;

fn row(ego: &str, searched: usize, recall: f64, successes: usize) -> StructureRow {
    let solved_by = |recall: f64| SolvedBy {
        recall: Some(recall),
        beyond: 1,
        successes,
    };
    StructureRow {
        ego: ego.to_owned(),
        seed: 7,
        starts: 50,
        searched,
        trained: solved_by(0.1),
        held: solved_by(0.2),
        constant: solved_by(0.3),
        switch: solved_by(0.35),
        adapted: solved_by(recall),
        again: solved_by(1.0),
        few: solved_by(0.4),
        known: solved_by(0.95),
        like: Some("Idm".to_owned()),
        off_m: Some([0.25, 2.0]),
        expected: (0.5, [0.4, 0.6]),
    }
}

#[test]
fn ten_structures_play_in_every_world_but_nine_where_one_is_the_own_ego() {
    let names = |world: &str| {
        let world = Scenario::shipped(world).expect("shipped").expect("sound");
        let egos = other_structures(&world).expect("it has changed egos");
        egos.iter()
            .map(|ego| ego.name().to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(names("acc_structures").len(), 10);
    assert_eq!(names("merge_fair"), names("acc_structures"));
    // The ego of this world is itself an ACC with a filter.
    let cut_in = names("cut_in");
    assert_eq!(cut_in.len(), 9);
    assert!(!cut_in.contains(&"filter".to_owned()));
    let grid = Scenario::shipped("grid").expect("shipped").expect("sound");
    assert!(other_structures(&grid).is_err(), "nobody drives");
}

#[test]
fn means_are_of_reachable_egos_and_results_are_compared_with_expectations() {
    let rows = [
        row("idm", 40, 0.9, 25),
        row("rss", 30, 0.5, 40),
        row("hardly", 2, 0.0, 5),
    ];
    let text = structures_markdown("acc_structures", &rows);
    let line = |start: &str| {
        let found = text.lines().find(|line| line.starts_with(start));
        found.unwrap_or_else(|| panic!("{text}")).to_owned()
    };
    assert_eq!(
        line("| idm "),
        "| idm | 7 | 40 of 50 | 0.10 | 0.20 | 0.30 | 0.35 | 0.90 | 1.00 | 0.40 | 0.95 | Idm | 1 | 0.25 / 2.00 | 50 % [40, 60] | 50 % |"
    );
    let mean = line("| mean (worst) of 2 ");
    assert!(
        mean.contains("| 0.10 (0.10) | 0.20 (0.20) | 0.30 (0.30) | 0.35 (0.35) | 0.70 (0.50) |"),
        "{mean}"
    );
    // 25 of 50 was expected, unlike 40 and 5.
    assert!(text.contains("was expected in 1 of 3 rows"), "{text}");
}
