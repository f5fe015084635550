//! How often the intervals of `brakecheck::run_dir` hold the truth, as Markdown.
//!
//! `cargo run --release --example coverage` makes the tables whose least and mean
//! coverage docs/background/intervals.md states; a number behind it is experiments per
//! cell (2000), and names after that are the only tables to make: `-- 400 rates-500 egos`.

mod simulation;

use brakecheck::seed::FIRST_SEALED;
use simulation::{Cell, Coverage, Trainings};

/// What every cell must reach.
const BAR: f64 = 0.93;
/// Cells that seem to be near the bar are run again, with fresh random numbers
/// and so many times as often.
const NEAR: f64 = 0.945;
const AGAIN: u64 = 10;

const RATES: [f64; 7] = [0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95];
const SPREADS: [f64; 4] = [0.0, 0.02, 0.05, 0.1];
const COUNTS: [usize; 3] = [3, 5, 10];
/// Every start a coin, or nearly the same starts solved by every training.
const SHARED: [f64; 2] = [0.0, 0.8];
/// Rates of the two sides of a comparison.
const PAIRS: [(f64, f64); 7] = [
    (0.5, 0.5),
    (0.9, 0.9),
    (0.95, 0.95),
    (0.9, 0.75),
    (0.5, 0.25),
    (0.1, 0.05),
    (0.95, 0.05),
];
/// Trainings of the two sides; 1 is a fixed policy.
const SIDES: [(usize, usize); 8] = [
    (3, 3),
    (5, 5),
    (10, 10),
    (3, 10),
    (3, 1),
    (5, 1),
    (10, 1),
    (1, 1),
];

fn main() {
    let mut arguments = std::env::args().skip(1);
    let experiments = arguments.next().and_then(|n| n.parse().ok());
    let only: Vec<String> = arguments.collect();
    let mut report = Report {
        experiments: experiments.unwrap_or(2000),
        cells: Vec::new(),
    };
    let tables: [Table; 5] = [
        ("rates-100", |report| report.rates(100)),
        ("rates-300", |report| report.rates(300)),
        ("rates-500", |report| report.rates(500)),
        ("differences", |report| report.differences(300)),
        ("egos", |report| report.egos(300)),
    ];
    for (name, table) in tables {
        if only.is_empty() || only.iter().any(|asked| asked == name) {
            table(&mut report);
        }
    }
    report.summary();
}

/// A table's name, and what makes it.
type Table = (&'static str, fn(&mut Report));

/// Prints tables and remembers all cells.
struct Report {
    experiments: u64,
    cells: Vec<(String, Coverage)>,
}

impl Report {
    fn cover(&mut self, cell: &Cell) -> Coverage {
        let mut coverage = cell.cover(self.experiments, FIRST_SEALED);
        if coverage.share() < NEAR {
            coverage = cell.cover(AGAIN * self.experiments, FIRST_SEALED + 1);
        }
        self.cells.push((format!("{cell:?}"), coverage));
        coverage
    }

    /// A table row: coverage of both kinds of starts, and width over oracle.
    fn row(&mut self, name: &str, cells: &mut dyn Iterator<Item = [Cell; 2]>) {
        let mut line = format!("| {name} |");
        for both in cells {
            let [coins, shared] = both.map(|cell| self.cover(&cell));
            line.push_str(&format!(
                " {:.1} / {:.1}; {:.1} of {:.1} |",
                100.0 * coins.share(),
                100.0 * shared.share(),
                100.0 * shared.width,
                100.0 * shared.oracle,
            ));
        }
        println!("{line}");
    }

    fn rates(&mut self, starts: usize) {
        println!("\n### Rates, {starts} starts\n");
        header("trainings, spread", RATES.iter().map(|rate| percent(*rate)));
        for count in COUNTS {
            for spread in SPREADS {
                let name = format!("{count}, {:.0}", 100.0 * spread);
                let mut cells = RATES.iter().map(|&rate| {
                    let side = Trainings {
                        count,
                        rate,
                        spread,
                    };
                    SHARED.map(|shared| Cell::of_rate(side, starts, shared))
                });
                self.row(&name, &mut cells);
            }
        }
    }

    fn differences(&mut self, starts: usize) {
        println!("\n### Paired differences, {starts} starts\n");
        let pairs = PAIRS.iter();
        let names = pairs.map(|(a, b)| format!("{} − {}", percent(*a), percent(*b)));
        header("trainings of a and b, spread", names);
        for (a, b) in SIDES {
            for spread in SPREADS {
                if a == 1 && spread > 0.0 {
                    continue;
                }
                let name = format!("{a} and {b}, {:.0}", 100.0 * spread);
                let mut cells = PAIRS
                    .iter()
                    .map(|&rates| pair((a, b), rates, spread, starts));
                self.row(&name, &mut cells);
            }
        }
    }

    /// Means over three egos, of which each is easier than the one before.
    fn egos(&mut self, starts: usize) {
        println!("\n### Mean difference over three egos, {starts} starts\n");
        let pairs = PAIRS.iter().take(4);
        let names = pairs.map(|(a, b)| format!("{} − {}", percent(*a), percent(*b)));
        header("trainings of a and b, spread", names);
        for (a, b) in [(3, 3), (5, 1), (10, 10)] {
            for spread in [0.0, 0.1] {
                let name = format!("{a} and {b}, {:.0}", 100.0 * spread);
                let mut cells = PAIRS.iter().take(4).map(|&rates| {
                    pair((a, b), rates, spread, starts).map(|cell| Cell {
                        egos: vec![-1.0, 0.0, 1.0],
                        ..cell
                    })
                });
                self.row(&name, &mut cells);
            }
        }
    }

    fn summary(&self) {
        let mut cells: Vec<&(String, Coverage)> = self.cells.iter().collect();
        cells.sort_by(|a, b| a.1.share().total_cmp(&b.1.share()));
        let below = cells.iter().filter(|cell| cell.1.share() < BAR).count();
        let mean = cells.iter().map(|cell| cell.1.share()).sum::<f64>() / cells.len() as f64;
        println!(
            "\n{} cells, {:.1} % covered on average; {below} below {:.0} %. The least:\n",
            cells.len(),
            100.0 * mean,
            100.0 * BAR
        );
        for (name, coverage) in cells.iter().take(5) {
            let share = coverage.share();
            let error = (share * (1.0 - share) / coverage.experiments as f64).sqrt();
            println!("- {:.2} ± {:.2} %: {name}", 100.0 * share, 100.0 * error);
        }
    }
}

/// Two ados on the same starts, in both kinds of starts.
fn pair(counts: (usize, usize), rates: (f64, f64), spread: f64, starts: usize) -> [Cell; 2] {
    let side = |count: usize, rate: f64| Trainings {
        count,
        rate,
        spread: if count == 1 { 0.0 } else { spread },
    };
    SHARED.map(|shared| Cell {
        b: Some(side(counts.1, rates.1)),
        ..Cell::of_rate(side(counts.0, rates.0), starts, shared)
    })
}

fn header(first: &str, columns: impl Iterator<Item = String>) {
    let columns: Vec<String> = columns.collect();
    println!("| {first} | {} |", columns.join(" | "));
    println!("|{}", " --- |".repeat(columns.len() + 1));
}

fn percent(rate: f64) -> String {
    format!("{:.0} %", 100.0 * rate)
}
