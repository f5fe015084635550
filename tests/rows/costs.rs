//! What a row says beside a search, and from when on a training has paid.

use brakecheck::evaluation::break_even;
use brakecheck::experiment::Cost;
use brakecheck::run_dir::Row;
use brakecheck::search::{SearchResult, Searched};
use serde_json::json;

use super::near;

/// A row of which only these counts matter.
pub fn row(ado: &str, solved: &str) -> Row {
    let count = |mark: u8| solved.bytes().filter(|b| *b == mark).count();
    let (successes, starts) = (count(b'1'), count(b'1') + count(b'0'));
    let row = json!({
        "world": "w", "plant": "Rigid", "judge": "UntilViolation", "ego": "e", "ado": ado,
        "method": "m", "start_seed": 0, "starts": starts, "trivial": count(b't'),
        "successes": successes, "success_rate": successes as f64 / starts.max(1) as f64,
        "ci95": [0.0, 1.0], "foul_rate": 0.0, "contact_rate": 0.0, "invalid": count(b'x'),
        "sims_per_start": 1.0, "physics_steps": 0, "cpu_s": 0.0, "solved": solved,
    });
    serde_json::from_value(row).expect("a row")
}

/// Of what search solves, how much does the ado; and what does it solve besides.
#[test]
fn recall_and_what_is_beyond_search_are_counted_start_by_start() {
    let cases = [
        // Search solves four, the ado two of them and two others.
        ("11001100", "10101010", Some(0.5), 2),
        ("1111", "1111", Some(1.0), 0),
        ("0000", "1111", Some(0.0), 0),
        ("1111", "0000", None, 4),
        ("0101", "1010", Some(0.0), 2),
        // What search was not judged on is not beyond it, and what the ado was not
        // judged on it does not solve.
        ("1t11x", "0t1x1", Some(0.5), 1),
        ("t1xx", "t111", Some(1.0 / 3.0), 0),
        ("", "", None, 0),
    ];
    let compared = |mine, search: &str| {
        let mut row = row("trained", mine);
        row.compare_with_search(&search.parse().expect("marks"));
        (row.recall, row.beyond_search)
    };
    for (mine, search, recall, beyond) in cases {
        let found = compared(mine, search);
        assert_eq!(found, (recall, Some(beyond)), "{mine} {search}");
    }
    // Starts that succeed are decided sooner, so an interrupted row has neither.
    assert_eq!(compared("1t11-", "0t1x1"), (None, None));
}

#[test]
fn the_invalid_share_is_of_all_starts_that_were_asked_for() {
    near(row("trained", "tt10x-x1").invalid_share(), 2.0 / 5.0);
    assert_eq!(row("trained", "tt10").invalid_share(), 0.0);
    assert_eq!(row("trained", "xx").invalid_share(), 1.0);
    assert_eq!(row("trained", "t-").invalid_share(), 0.0);
}

/// Five starts, solved after 3, 5, 8 and 8 simulations and one not within 20.
#[test]
fn a_training_has_paid_when_the_search_has_cost_as_much() {
    let found = |simulations: u64, solved: bool, physics_steps: u64| {
        Some(SearchResult {
            actions: solved.then(|| vec![0]),
            simulations,
            physics_steps,
            cpu_s: 2.0 * simulations as f64,
            ..SearchResult::default()
        })
    };
    let searched = Searched {
        row: row("search", "11110t"),
        found: vec![
            found(3, true, 300),
            found(5, true, 1000),
            found(8, true, 800),
            found(8, true, 1600),
            found(20, false, 4000),
            None,
        ],
    };
    let once = Cost {
        simulations: 1000,
        physics_steps: 90_000,
        cpu_s: 500.0,
    };
    let mut trained = row("trained", "11000t");
    (trained.physics_steps, trained.cpu_s) = (500, 5.0);
    // Two of five: within 5 simulations, (3 + 5 + 5 + 5 + 5)/5 = 4.6 each.
    let even = break_even(&searched, 20, &trained, once).expect("it solves something");
    assert_eq!((even.budget, even.matched), (5, true));
    near(even.search.simulations, 4.6);
    near(even.search.success_rate, 0.4);
    // In proportion: 300, 1000, 5/8 of 800 and of 1600, a quarter of 4000.
    near(
        even.search.physics_steps,
        (300.0 + 1000.0 + 500.0 + 1000.0 + 1000.0) / 5.0,
    );
    near(even.search.cpu_s, 2.0 * 4.6);
    near(even.ado.physics_steps, 100.0);
    near(even.ado.cpu_s, 1.0);
    near(even.starts.expect("it pays"), 1000.0 / (4.6 - 1.0));
    near(
        even.starts_by_physics_steps.expect("it pays"),
        90_000.0 / (760.0 - 100.0),
    );
    near(even.starts_by_cpu_s.expect("it pays"), 500.0 / (9.2 - 1.0));
    // Three of five need 8, and bring a fourth; one needs 3.
    for (solved, budget) in [("11100t", 8), ("11110t", 8), ("10000t", 3)] {
        let even = break_even(&searched, 20, &row("trained", solved), once).expect("it solves");
        assert_eq!((even.budget, even.matched), (budget, true), "{solved}");
    }
    // All five are out of reach: the whole budget, and that is said.
    let even = break_even(&searched, 20, &row("trained", "11111t"), once).expect("it solves");
    assert_eq!((even.budget, even.matched), (20, false));
    near(
        even.search.simulations,
        (3.0 + 5.0 + 8.0 + 8.0 + 20.0) / 5.0,
    );
    near(even.starts.expect("it pays"), 1000.0 / (8.8 - 1.0));
    // An ado that solves nothing is not compared.
    assert_eq!(
        break_even(&searched, 20, &row("trained", "00000t"), once),
        None
    );
    let reached: Vec<(u64, usize)> = even
        .curve
        .iter()
        .map(|at| (at.budget, at.successes))
        .collect();
    for at in [(3, 1), (5, 2), (20, 4)] {
        assert!(reached.contains(&at), "{reached:?}");
    }
}

/// Twenty starts, solved after 1, 2, … 20 simulations: m of them need a budget of m.
#[test]
fn the_least_budget_is_the_least() {
    let found = |simulations: u64| {
        Some(SearchResult {
            actions: Some(vec![0]),
            simulations,
            ..SearchResult::default()
        })
    };
    let searched = Searched {
        row: row("search", &"1".repeat(20)),
        found: (1..=20).map(found).collect(),
    };
    for solved in 1..=20 {
        let marks = "1".repeat(solved) + &"0".repeat(20 - solved);
        let once = Cost::default();
        let even =
            break_even(&searched, 20, &row("trained", &marks), once).expect("it solves something");
        assert_eq!((even.budget, even.matched), (solved as u64, true));
    }
}
