//! Mistakes in a grid file read like a compiler's messages.

use brakecheck::cli::{Failure, plain_theme};
use brakecheck::world::Scenario;

const GRID: &str = include_str!("../../worlds/grid_hard.ron");

fn mistakes() -> Vec<(&'static str, String)> {
    let with = |from: &str, to: &str| {
        assert!(
            GRID.contains(from),
            "grid_hard.ron no longer contains {from}"
        );
        GRID.replacen(from, to, 1)
    };
    vec![
        ("a kind of world that is none", with("\nGrid(", "\nGird(")),
        ("an unknown field", with("horizon: ", "horizont: ")),
        (
            "a map of one cell",
            with("size: 4, refine", "size: 1, refine"),
        ),
        ("too fine a map", with("refine: 1", "refine: 99")),
        (
            "an unknown wall rule",
            with("at_wall: FirstInMap", "at_wall: First"),
        ),
        ("an episode of no steps", with("PerSize(2)", "Steps(0)")),
        (
            "a neutral move that is none",
            with("neutral: 4", "neutral: 5"),
        ),
        (
            "a move given twice",
            with("(1, 0), (0, 0)", "(0, 1), (0, 0)"),
        ),
        (
            "a start outside",
            with("starts: AllPairs", "starts: Pairs([((0, 0), (4, 0))])"),
        ),
        (
            "a captured start",
            with("starts: AllPairs", "starts: Pairs([((1, 1), (1, 1))])"),
        ),
        ("an unknown signal", with("(d_man >= 1)", "(d_mann >= 1)")),
        (
            "an unknown observed signal",
            with("[\"near.x\"", "[\"far.x\""),
        ),
        (
            "a rule broken at the start",
            with("(speed_inf <= 1.5)", "(speed_inf >= 1)"),
        ),
        (
            "a specification lost at the start",
            with("(d_man >= 1)", "(d_man >= 2)"),
        ),
        (
            "a change that does not fit",
            with("Change(size: 2)", "Change(size: 0)"),
        ),
        (
            "a change of a driving world",
            with("Change(size: 2)", "Change(friction: 0.4)"),
        ),
        (
            "a learner out of range",
            with(
                "low: -1.1667, high: 1.1667, count: 7",
                "low: -1.0, high: -1.0, count: 7",
            ),
        ),
    ]
}

#[test]
fn every_mistake_has_a_place_a_reason_and_a_cure() {
    let mut shown = String::new();
    for (name, text) in mistakes() {
        let error = match Scenario::parse("mine.ron", &text) {
            Ok(_) => panic!("{name} was accepted"),
            Err(error) => error,
        };
        for problem in &error.problems {
            assert!(problem.span.end <= text.len(), "{name}");
            assert!(!text[problem.span.clone()].is_empty(), "{name}");
        }
        let rendered = Failure::from(error).render(plain_theme(), 100);
        shown.push_str(&format!("--- {name}\n{rendered}\n"));
    }
    insta::assert_snapshot!("grid_mistakes", shown);
}
