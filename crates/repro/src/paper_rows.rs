//! Rows of the paper for its driving scenes (Sec. V-B and the appendix).
//!
//! They compare the Q-table with the DQN on ACC, including the time of both, and the plain
//! reward on the paper's state. Success is measured after the paper's numbers of episodes
//! and after more.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::milestones::{Milestone, milestones};
use brakecheck::experiment::{TestStarts, Watch, test_starts};
use brakecheck::seed::Seeds;
use brakecheck::stats::{Outcomes, seeds_interval};
use brakecheck::world::Scenario;

/// Training to be measured along the way.
pub struct PaperRow<'a> {
    /// Description of the row in the paper, with the paper's result.
    pub paper: &'a str,
    /// World with the learner of the row.
    pub scenario: &'a Scenario,
    /// Numbers of episodes at which to evaluate, in addition to the end.
    pub episodes: &'a [u64],
}

/// Mean results of several trainings at a number of episodes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reached {
    /// Mean episodes of training.
    pub episodes: f64,
    /// Mean decisions of training.
    pub decisions: f64,
    /// Mean processor time of training, s.
    pub cpu_s: f64,
    /// Mean success rate.
    pub success_rate: f64,
    /// Interval of the rate over trainings and starts (docs/background/intervals.md).
    pub ci95: [f64; 2],
}

/// Measured row of the paper.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured {
    /// Description of the row in the paper, with the paper's result.
    pub paper: String,
    /// Name of the world.
    pub world: String,
    /// Name of the learner.
    pub learner: String,
    /// Number of training seeds.
    pub seeds: u64,
    /// Number of evaluated starts, without trivial starts.
    pub starts: usize,
    /// Results by rising number of episodes. The last is the end of training.
    pub reached: Vec<Reached>,
}

/// Trains with every seed in parallel and evaluates on `starts` test starts.
///
/// Returns `None` if stopped from outside.
pub fn measure_paper_row(
    row: &PaperRow<'_>,
    seeds: Seeds,
    starts: usize,
    watch: &Watch<'_>,
) -> Option<Measured> {
    let starts: TestStarts = test_starts(row.scenario, seeds.starts, starts, watch)?;
    let trainings: Vec<Vec<Milestone>> = seeds
        .trainings()
        .collect::<Vec<u64>>()
        .par_iter()
        .map(|&seed| milestones(row.scenario, seed, row.episodes, &starts, watch))
        // One stopped training stops the row, because a mean of the others would look
        // whole.
        .collect::<Option<_>>()?;
    // Trainings of equal length differ by a few episodes. Only milestones that all of
    // them reached are averaged, and the last of each.
    let common = trainings.iter().map(Vec::len).min().unwrap_or(0);
    let mut reached: Vec<Reached> = (0..common.saturating_sub(1))
        .map(|at| together(trainings.iter().filter_map(|training| training.get(at))))
        .collect();
    // Trainings end with different episodes, so their ends are averaged apart.
    reached.push(together(trainings.iter().filter_map(|all| all.last())));
    // The starts are the same for all trainings, so any row gives their number.
    let last = trainings.first().and_then(|all| all.last());
    Some(Measured {
        paper: row.paper.to_owned(),
        world: row.scenario.name().to_owned(),
        learner: row.scenario.learner().name().to_owned(),
        seeds: seeds.count,
        starts: last.map_or(0, |last| last.row.starts),
        reached,
    })
}

/// Returns the mean of milestones of several seeds.
fn together<'a>(seeds: impl Iterator<Item = &'a Milestone>) -> Reached {
    let seeds: Vec<&Milestone> = seeds.collect();
    let n = seeds.len().max(1) as f64;
    let mean = |of: fn(&Milestone) -> f64| seeds.iter().map(|one| of(one)).sum::<f64>() / n;
    let solved: Vec<&Outcomes> = seeds.iter().map(|one| &one.row.solved).collect();
    Reached {
        episodes: mean(|one| one.episodes as f64),
        decisions: mean(|one| one.decisions as f64),
        cpu_s: mean(|one| one.cpu_s),
        success_rate: mean(|one| one.row.success_rate),
        ci95: seeds_interval(&solved),
    }
}

/// Explanation of the columns, below the table.
const EXPLAINED: &str = "
- paper: what the paper says of that row
- seeds, starts: trainings, and test starts of each that are not trivial
- episodes, decisions, CPU s: how long was trained until then, mean over trainings
- success: mean share of starts from which the greedy ado then makes the ego fail
";

/// Formats the rows as a Markdown table.
pub fn paper_rows_markdown(rows: &[Measured]) -> String {
    let lines = rows.iter().flat_map(|row| {
        row.reached.iter().map(move |reached| {
            let [rate, lo, hi] =
                [reached.success_rate, reached.ci95[0], reached.ci95[1]].map(|rate| 100.0 * rate);
            [
                row.paper.to_string(),
                row.world.to_string(),
                row.learner.to_string(),
                row.seeds.to_string(),
                row.starts.to_string(),
                format!("{:.0}", reached.episodes),
                format!("{:.0}", reached.decisions),
                format!("{:.1}", reached.cpu_s),
                format!("{rate:.1} % [{lo:.1}, {hi:.1}]"),
            ]
        })
    });
    let columns = [
        "paper",
        "world",
        "learner",
        "seeds",
        "starts",
        "episodes",
        "decisions",
        "CPU s",
        "success [95 %]",
    ];
    let text = brakecheck_report::report::table::TextTable::new(columns, lines).to_markdown();
    text + EXPLAINED
}
