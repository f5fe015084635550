//! Do 95 % intervals hold the truth? A small version of `examples/coverage`.

mod simulation;

use std::collections::BTreeMap;

use simulation::{Cell, Coverage, Trainings};

/// Experiments per cell.
const EXPERIMENTS: u64 = 150;
/// Starts of every experiment.
const STARTS: usize = 300;
/// What no cell may be below.
const BAR: f64 = 0.93;
/// The random numbers of this test.
const SEED: u64 = 0;
/// Chance that a family of correct cells fails somewhere, at most.
const CHANCE: f64 = 0.001;

/// Whether so many successes would be rarer than `chance` at this rate.
///
/// The binomial tail, summed exactly; `chance` is divided by the number of
/// looks (Bonferroni), so that many looks raise no false alarm.
fn is_below(coverage: &Coverage, rate: f64, looks: usize) -> bool {
    let n = coverage.experiments;
    let (mut log_term, mut tail) = (n as f64 * libm::log(1.0 - rate), 0.0);
    for k in 0..=coverage.covered {
        tail += libm::exp(log_term);
        log_term += libm::log(rate / (1.0 - rate) * (n - k) as f64 / (k + 1) as f64);
    }
    tail < CHANCE / looks as f64
}

fn together(all: &[&Coverage]) -> Coverage {
    Coverage {
        experiments: all.iter().map(|one| one.experiments).sum(),
        covered: all.iter().map(|one| one.covered).sum(),
        ..Coverage::default()
    }
}

/// Every cell, every group of cells and all of them.
fn must_cover(cells: &[(String, Cell)]) {
    let covered: Vec<(&str, Coverage)> = cells
        .iter()
        .map(|(group, cell)| (group.as_str(), cell.cover(EXPERIMENTS, SEED)))
        .collect();
    for ((_, coverage), (_, cell)) in covered.iter().zip(cells) {
        assert!(
            !is_below(coverage, BAR, cells.len()),
            "{:.3} covered: {cell:?}",
            coverage.share()
        );
    }
    let mut groups: BTreeMap<&str, Vec<&Coverage>> = BTreeMap::new();
    for (group, coverage) in &covered {
        groups.entry(group).or_default().push(coverage);
    }
    for (group, of) in &groups {
        let coverage = together(of);
        assert!(
            !is_below(&coverage, BAR, groups.len()),
            "{:.3} covered: {group}",
            coverage.share()
        );
    }
    // All cells are of 95 % intervals, so together they keep 95 %: single cells
    // may lack two points, but not the most of them.
    let all: Vec<&Coverage> = covered.iter().map(|(_, coverage)| coverage).collect();
    let all = together(&all);
    assert!(
        !is_below(&all, 0.95, 1),
        "{:.4} covered in all",
        all.share()
    );
}

#[test]
fn intervals_of_rates_cover() {
    let mut cells = Vec::new();
    for count in [3, 5, 10] {
        for spread in [0.0, 0.02, 0.05, 0.1] {
            for (rate, shared) in [0.05, 0.25, 0.5, 0.9]
                .into_iter()
                .flat_map(|rate| [(rate, 0.0), (rate, 0.8)])
            {
                let side = Trainings {
                    count,
                    rate,
                    spread,
                };
                let group = format!("{count} trainings, spread {spread}");
                cells.push((group, Cell::of_rate(side, STARTS, shared)));
            }
        }
    }
    must_cover(&cells);
}

#[test]
fn intervals_of_paired_differences_cover() {
    let side = |count: usize, rate: f64, spread: f64| Trainings {
        count,
        rate,
        spread: if count == 1 { 0.0 } else { spread },
    };
    let mut cells = Vec::new();
    for (a, b) in [(3, 3), (5, 5), (10, 10), (3, 1), (5, 1), (1, 1)] {
        for (rates, spread) in [(0.5, 0.5), (0.9, 0.75), (0.1, 0.05)]
            .into_iter()
            .flat_map(|rates| [(rates, 0.02), (rates, 0.1)])
        {
            for shared in [0.0, 0.8] {
                let cell = Cell {
                    b: Some(side(b, rates.1, spread)),
                    ..Cell::of_rate(side(a, rates.0, spread), STARTS, shared)
                };
                cells.push((format!("{a} and {b} trainings"), cell));
            }
        }
    }
    for spread in [0.02, 0.1] {
        let cell = Cell {
            b: Some(side(1, 0.75, spread)),
            egos: vec![-1.0, 0.0, 1.0],
            ..Cell::of_rate(side(3, 0.9, spread), STARTS, 0.8)
        };
        cells.push(("three egos".to_owned(), cell));
    }
    must_cover(&cells);
}
