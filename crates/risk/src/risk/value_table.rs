//! V as a table over a few inputs.

use super::decisions::{ActionValues, Decisions, LEAST, Targets};
use super::record::RiskRun;

/// Most inputs of a table, and most cells.
const COLUMNS: usize = 6;
const CELLS: usize = 30_000;
/// Most bins of an input.
const BINS: usize = 8;
/// Decisions by which bins and inputs are chosen.
const SAMPLE: usize = 20_000;
/// Sweeps of a fit.
const SWEEPS: usize = 30;
/// Weight of the coarser table, as a number of decisions.
const PRIOR: f64 = 2.0;

/// Table of V over bins of inputs, with a head per kind of failure.
#[derive(Clone, Debug)]
pub(super) struct TableOfV {
    heads: usize,
    actions: usize,
    columns: Vec<TableColumn>,
    /// V `[cells, heads, actions]`. The first column is the highest digit of a cell.
    cells: Vec<f64>,
}

/// Input of a table, with the upper ends of its bins but the last.
#[derive(Clone, Debug, PartialEq)]
struct TableColumn {
    input: usize,
    ends: Vec<f32>,
}

/// Cells of a table while it is fitted.
struct TableCells {
    /// Cell of every row.
    cells: Vec<usize>,
    /// Action of every row.
    taken: Vec<usize>,
}

impl TableColumn {
    fn bins(&self) -> usize {
        self.ends.len() + 1
    }

    fn bin(&self, value: f32) -> usize {
        self.ends.partition_point(|end| *end < value)
    }
}

impl TableOfV {
    /// Creates a table that expects hardly any failure.
    pub(super) fn new(heads: usize, actions: usize) -> TableOfV {
        TableOfV {
            heads,
            actions,
            columns: Vec::new(),
            cells: vec![LEAST; heads * actions],
        }
    }

    /// Returns V of every head and action, `[heads, actions]`.
    pub(super) fn values(&self, input: &[f32]) -> &[f64] {
        let width = self.heads * self.actions;
        &self.cells[self.cell(input) * width..][..width]
    }

    fn cell(&self, input: &[f32]) -> usize {
        let digits = self.columns.iter();
        digits.fold(0, |cell, it| cell * it.bins() + it.bin(input[it.input]))
    }

    /// Fits the table to runs, each with whether it is a failure of every head.
    pub(super) fn fit(&mut self, runs: &[(&RiskRun, Vec<bool>)]) {
        let data = Decisions::of(runs);
        if data.rows.is_empty() {
            return;
        }
        // The inputs are chosen anew, because later runs fail in other states.
        self.columns = self.chosen(&data);
        let count: usize = self.columns.iter().map(TableColumn::bins).product();
        self.cells = vec![LEAST; count * self.heads * self.actions];
        let decisions = data.rows.iter().map(|(run, at)| (data.runs[*run].0, *at));
        let rows = TableCells {
            cells: decisions
                .clone()
                .map(|(run, at)| self.cell(run.input(at)))
                .collect(),
            taken: decisions
                .map(|(run, at)| run.actions[at] as usize)
                .collect(),
        };
        let all: Vec<usize> = (0..data.runs.len()).collect();
        // Each sweep moves the values of failures back by further decisions.
        for _ in 0..SWEEPS {
            let targets = data.targets(self, &all);
            self.cells = self.means(&rows, &targets);
        }
    }

    /// Returns the mean target of every cell, from coarse tables to the finest.
    ///
    /// A cell with few decisions is close to the cell of the table without its last input.
    fn means(&self, rows: &TableCells, targets: &Targets) -> Vec<f64> {
        let width = self.heads * self.actions;
        // Without any decision, no failure is expected.
        let mut coarse = vec![LEAST; width];
        for used in 0..=self.columns.len() {
            let count: usize = self.columns[..used].iter().map(TableColumn::bins).product();
            let below: usize = self.columns[used..].iter().map(TableColumn::bins).product();
            let mut sums = vec![0.0; count * width];
            let mut counts = vec![0.0; count * self.actions];
            for (row, (cell, taken)) in rows.cells.iter().zip(&rows.taken).enumerate() {
                let cell = cell / below;
                counts[cell * self.actions + taken] += 1.0;
                for head in 0..self.heads {
                    sums[cell * width + head * self.actions + taken] +=
                        targets.values[row * self.heads + head];
                }
            }
            let bins = used
                .checked_sub(1)
                .map_or(1, |last| self.columns[last].bins());
            let mean = |at: usize| {
                let (cell, inner) = (at / width, at % width);
                let n: f64 = counts[cell * self.actions + inner % self.actions];
                let prior = coarse[cell / bins * width + inner];
                ((sums[at] + PRIOR * prior) / (n + PRIOR)).clamp(LEAST, 1.0)
            };
            coarse = (0..count * width).map(mean).collect();
        }
        coarse
    }

    /// Returns the inputs by which failing runs differ most from others.
    fn chosen(&self, data: &Decisions<'_>) -> Vec<TableColumn> {
        let step = data.rows.len().div_ceil(SAMPLE).max(1);
        let sample: Vec<(&[f32], bool)> = data
            .rows
            .iter()
            .step_by(step)
            .map(|(run, decision)| {
                let (run, fails) = &data.runs[*run];
                (run.input(*decision), fails.contains(&true))
            })
            .collect();
        let width = sample[0].0.len();
        let mut rated: Vec<(f64, TableColumn)> = (0..width)
            .map(|input| {
                let column = column(input, &sample);
                (separation(&column, &sample), column)
            })
            .collect();
        // Stable, so that equal inputs keep their order.
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut cells = 1;
        let fits = |(_, column): &(f64, TableColumn)| {
            // An input that would exceed the cells is passed over, and a smaller one may
            // still fit.
            let more = cells * column.bins();
            let fits = column.bins() > 1 && more <= CELLS;
            cells = if fits { more } else { cells };
            fits
        };
        let chosen = rated.into_iter().filter(fits).take(COLUMNS);
        chosen.map(|(_, column)| column).collect()
    }
}

impl ActionValues for TableOfV {
    fn heads(&self) -> usize {
        self.heads
    }

    fn means_without(&self, input: &[f32], law: &[f32], without: usize) -> Vec<f64> {
        let mean = |own: &[f64]| {
            let pairs = own
                .iter()
                .zip(law)
                .enumerate()
                .filter(|(action, _)| *action != without);
            pairs.map(|(_, (v, p))| v * f64::from(*p)).sum()
        };
        self.values(input).chunks(self.actions).map(mean).collect()
    }
}

/// Returns an input with bins between quantiles of failing and of all decisions.
fn column(input: usize, sample: &[(&[f32], bool)]) -> TableColumn {
    // Failing runs need fine bins where they are, and others where failures begin.
    let mut ends = quantiles(sample.iter().map(|(row, _)| row[input]));
    let failing = sample.iter().filter(|(_, fails)| *fails);
    ends.extend(quantiles(failing.map(|(row, _)| row[input])));
    ends.sort_by(f32::total_cmp);
    ends.dedup();
    // Nothing is above the greatest value.
    let all = sample.iter().map(|(row, _)| row[input]);
    let greatest = all.fold(f32::MIN, f32::max);
    ends.retain(|end| *end < greatest);
    TableColumn { input, ends }
}

/// Returns the least value and the quantiles of half as many bins as an input has.
fn quantiles(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    let parts = 0..BINS / 2;
    let quantile = parts.map(|part| values.get(part * values.len() / (BINS / 2)));
    quantile.flatten().copied().collect()
}

/// Returns half the distance between the shares of bins in failing and in other runs.
fn separation(column: &TableColumn, sample: &[(&[f32], bool)]) -> f64 {
    let mut shares = vec![[0.0; 2]; column.bins()];
    let mut counts = [0.0; 2];
    for (row, fails) in sample {
        let side = usize::from(*fails);
        shares[column.bin(row[column.input])][side] += 1.0;
        counts[side] += 1.0;
    }
    // Without a failing run nothing is separated, and nothing may be divided by 0.
    let [others, failing] = counts.map(|count| f64::max(count, 1.0));
    let distances = shares.iter().map(|[a, b]| (a / others - b / failing).abs());
    0.5 * distances.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::super::record::{EgoFailure, RunEnd};
    use super::*;

    /// Runs of one decision, of which action 1 fails where the second input is high.
    fn runs() -> Vec<RiskRun> {
        let run = |i: u32| {
            let [noise, state] = [i * 7 % 11, i % 4].map(|it| f32::from(it as u8));
            let action = i / 4 % 2;
            let failure = EgoFailure {
                mode: "contact".to_owned(),
                lawful: true,
                preventable: None,
            };
            let fails = action == 1 && state > 2.5;
            RiskRun {
                shares: Vec::new(),
                noise: 0,
                actions: vec![action],
                inputs: vec![noise, state],
                laws: vec![0.9, 0.1],
                component: 0,
                ratios: vec![1.0],
                end: if fails {
                    RunEnd::Failed(failure)
                } else {
                    RunEnd::Held { lawful: None }
                },
            }
        };
        (0..400).map(run).collect()
    }

    fn fitted(mut table: TableOfV) -> TableOfV {
        let runs = runs();
        let with_heads = runs.iter().map(|run| (run, vec![run.failure().is_some()]));
        table.fit(&with_heads.collect::<Vec<_>>());
        table
    }

    #[test]
    fn a_table_finds_the_input_and_the_action_that_fail() {
        let table = fitted(TableOfV::new(1, 2));
        let high = table.values(&[5.0, 3.0]);
        assert!(high[1] > 0.8 && high[0] < 1e-3, "{high:?}");
        let low = table.values(&[5.0, 0.0]);
        assert!(low[1] < 0.2 * high[1], "{low:?}");
    }

    #[test]
    fn bins_include_their_upper_ends() {
        let column = TableColumn {
            input: 0,
            ends: vec![1.0, 2.0],
        };
        assert_eq!(column.bins(), 3);
        let bins = [0.5, 1.0, 1.5, 2.0, 3.0].map(|it| column.bin(it));
        assert_eq!(bins, [0, 0, 1, 1, 2]);
    }

    #[test]
    fn columns_separate_failures_by_half_the_distance_of_their_shares() {
        let rows: Vec<[f32; 1]> = [0.0, 1.0, 2.0, 3.0].map(|it| [it]).to_vec();
        let sample: Vec<(&[f32], bool)> = rows
            .iter()
            .zip([false, false, true, true])
            .map(|(row, fails)| (&row[..], fails))
            .collect();
        let with = |end: f32| TableColumn {
            input: 0,
            ends: vec![end],
        };
        assert_eq!(separation(&with(1.0), &sample), 1.0);
        assert_eq!(separation(&with(0.0), &sample), 0.5);
        assert_eq!(separation(&with(9.0), &sample), 0.0);
        // Quarters of all, and of the failing rows, but nothing is above the greatest.
        assert_eq!(column(0, &sample).ends, [0.0, 1.0, 2.0]);
    }

    #[test]
    fn an_empty_table_expects_hardly_any_failure() {
        let mut table = TableOfV::new(2, 3);
        table.fit(&[]);
        assert_eq!(table.values(&[1.0]), [LEAST; 6]);
        let law = [0.5, 0.25, 0.25];
        let means = table.means_without(&[1.0], &law, 1);
        assert_eq!(means.len(), 2);
        assert!((means[0] - 0.75 * LEAST).abs() < 1e-15, "{means:?}");
    }
}
