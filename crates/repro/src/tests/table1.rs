//! Table I in small: the same functions on a smaller map, with short trainings.

use std::sync::atomic::AtomicBool;

use crate::{PaperScale, Table1, table1, table1_markdown};
use brakecheck::experiment::Watch;
use brakecheck::seed::Seeds;
use brakecheck::world::Scenario;

/// Reading B, whose learners decide a few times.
fn short() -> Scenario {
    let mut text = include_str!("../../../../worlds/grid_hard.ron").to_owned();
    for (shipped, short) in [
        ("100_000", "2_000"),
        ("300_000", "4_000"),
        ("40_000", "2_000"),
    ] {
        let [shipped, short] = [shipped, short].map(|count| format!("decisions: {count}"));
        assert!(text.contains(&shipped), "{shipped}");
        text = text.replace(&shipped, &short);
    }
    Scenario::parse("grid_hard.ron", &text).expect("a sound world")
}

#[test]
fn table_1_in_small_has_every_row_and_the_exact_numbers() {
    static GO_ON: AtomicBool = AtomicBool::new(false);
    let request = Table1 {
        seeds: Seeds {
            first: 1,
            count: 2,
            starts: 3,
        },
        scale: PaperScale {
            large: 4,
            refinements: &[(3, 0.89)],
            refined_starts: 60,
        },
    };
    let watch = Watch::new(&|_, _| {}, &GO_ON);
    let study = table1(&short(), &request, &watch)
        .expect("a grid")
        .expect("not stopped");
    assert_eq!(study.learners, ["PPO", "Q", "DQN"]);
    assert_eq!((study.reading, &study.seeds[..]), ('B', &[1, 2][..]));
    assert_eq!(study.decisions, [2_000, 4_000, 2_000]);

    // Exact shares of docs/background/paper.md: random actions and the chaser.
    let known = [
        ("RQ1", "n = 4, k = 2", 240, 77.4, 20.0),
        ("RQ2", "n = 2, k = 2", 12, 4.9, 12.0),
        ("RQ2", "n = 4, k = 2", 240, 77.4, 20.0),
        ("RQ3", "n = 4, k = 4", 240, 52.7, 240.0),
        ("RQ3", "n = 4, k = 3", 240, 76.3, 60.0),
        ("RQ3", "n = 4, k = 2", 240, 77.4, 20.0),
        ("RQ3", "n = 4, k = 1", 240, 30.4, 112.0),
    ];
    assert_eq!(study.cells.len(), known.len());
    for (cell, (question, map, starts, random, chaser)) in study.cells.iter().zip(known) {
        let at = format!("{question}, {map}: {:?}", cell.references);
        assert_eq!(
            (&*cell.question, &*cell.map, cell.starts),
            (question, map, starts)
        );
        let count = |share: f64| share * starts as f64;
        assert_eq!(cell.references.optimum, 1.0, "{at}");
        assert!((count(cell.references.random) - random).abs() < 0.2, "{at}");
        assert!(
            (count(cell.references.chaser) - chaser).abs() < 1e-9,
            "{at}"
        );
        assert!(cell.references.random_tables < 0.6, "{at}");
        assert_eq!(cell.trained.len(), 3, "{at}");
        for trained in &cell.trained {
            let [lo, hi] = trained.ci95;
            assert!(
                trained.min <= trained.mean && trained.mean <= 1.0,
                "{trained:?}"
            );
            assert!(
                lo <= trained.mean && trained.mean <= hi && lo < hi,
                "{trained:?}"
            );
        }
    }
    // A row per map, learner and seed. A mean is that of its rows.
    assert_eq!(study.rows.len(), known.len() * 3 * 2);
    for (cell, rows) in study.cells.iter().zip(study.rows.chunks(6)) {
        for (trained, rows) in cell.trained.iter().zip(rows.chunks(2)) {
            assert_eq!(rows[0].starts, cell.starts);
            let mean = (rows[0].success_rate + rows[1].success_rate) / 2.0;
            assert!((trained.mean - mean).abs() < 1e-12);
        }
    }
    let ados: Vec<usize> = study.random_ados.iter().map(|random| random.ados).collect();
    assert_eq!(ados, [10, 20]);
    for random in &study.random_ados {
        // 77.4 of 240 in expectation, with at least 2400 runs.
        assert!((random.actions.0 - 77.4 / 240.0).abs() < 0.05, "{random:?}");
        assert!(random.tables.0 < random.actions.0, "{random:?}");
    }

    let near = &study.near_starts;
    assert_eq!((near.everywhere.len(), near.alpha.len()), (3, 3));
    let deltas: Vec<f64> = near.deltas.iter().map(|row| row.delta).collect();
    assert_eq!(deltas, [1.0, 0.5, 0.1, 0.01]);
    assert!(
        (near.random * 240.0 - 30.4).abs() < 0.2,
        "k = 1: {}",
        near.random
    );
    assert!(!near.centres.is_empty() && near.centres.len() <= 3 * 2 * 5);
    assert!(
        near.alpha
            .iter()
            .all(|alpha| (0.0..2.0).contains(alpha) && *alpha > 0.0)
    );
    for learner in 0..3 {
        let of = |row: usize| &near.deltas[row].trained[learner];
        let centres = near
            .centres
            .iter()
            .filter(|centre| centre.learner == learner);
        for (row, delta) in deltas.iter().enumerate().take(4) {
            let reach = centres.clone().filter(|centre| *delta < centre.reach);
            assert_eq!(of(row).satisfying, reach.count());
            assert_eq!(of(row).where_satisfied.is_some(), of(row).satisfying > 0);
        }
        assert!(of(3).near <= of(2).near && of(1).near <= of(0).near && of(3).near >= 1.0);
    }

    let [refined] = &study.refined[..] else {
        panic!("one refinement");
    };
    assert_eq!(
        (refined.refine, refined.starts, refined.trained.len()),
        (3, 60, 3)
    );
    assert!(refined.related > 0 && refined.related < refined.candidates);
    assert!(refined.related_starts < 60 && refined.references.optimum > 0.9);
    for share in &refined.trained {
        // Theorem 3: every related counterexample is one by cell.
        assert_eq!(share.related.0, share.related.1);
        assert!(share.unrelated.1 <= share.unrelated.0);
    }
    assert_eq!(study.open_loop.len(), 3);
    for open in &study.open_loop {
        assert_eq!(open.pairs % 239, 0);
        assert!(open.other_starts < 0.6, "{open:?}");
    }

    let text = table1_markdown(&[study]);
    for part in ["Table I, reading B", "RQ1", "RQ4", "RQ5", "n = 2, k = 2"] {
        assert!(text.contains(part), "{part} is missing in {text}");
    }
}
