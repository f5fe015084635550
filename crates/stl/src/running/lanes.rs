//! Many runs side by side: one number of every run in a column.

use super::{
    RunningInstant, RunningMonitor, RunningPoint, edge_at, is_open, pick, since_at, until_at,
};
use crate::kernel::opposite;
use crate::leaf::{CHUNK, Columns, Semantics};
use crate::program::MinMax;
use crate::{BoundExpr, Interval};

/// Latest value of each signal in every run: a column per signal, an entry per run.
///
/// All columns are equally long, up to [`RunColumns::MOST`].
#[derive(Clone, Copy, Debug)]
pub struct RunColumns<'a>(pub &'a [Vec<f64>]);

impl RunColumns<'_> {
    /// Greatest number of runs.
    pub const MOST: usize = CHUNK;
}

impl Columns for RunColumns<'_> {
    fn column(&self, signal: usize) -> &[f64] {
        &self.0[signal]
    }
}

impl BoundExpr {
    /// Computes the value in every run: [`BoundExpr::eval`], bit for bit.
    ///
    /// # Panics
    /// A column that the expression reads is shorter than `values`, or `values` is
    /// longer than [`RunColumns::MOST`].
    pub fn eval_runs(&self, columns: RunColumns<'_>, values: &mut [f64]) {
        assert!(values.len() <= RunColumns::MOST, "too many runs at once");
        self.value.fill(&columns, 0, values);
    }
}

impl RunningMonitor {
    /// Writes the numbers of a run without samples into its place of the columns.
    ///
    /// # Panics
    /// There are other than [`RunningMonitor::numbers`] columns.
    pub fn begin_run(&self, numbers: &mut [Vec<f64>], run: usize) {
        assert!(numbers.len() == self.numbers(), "a column per number");
        for (column, first) in numbers.iter_mut().zip(&self.begin) {
            column[run] = *first;
        }
    }

    /// Reads a sample of every run, and writes the greatest possible value of each.
    ///
    /// `samples[i]` is the number of the sample of run i, counted from 0. The values
    /// are `hi` of [`RunningMonitor::push`], bit for bit. Runs whose episode is over
    /// may have any finite values.
    ///
    /// # Panics
    /// A column is shorter than `samples`, or there are more runs than
    /// [`RunColumns::MOST`].
    pub fn push_runs(
        &self,
        numbers: &mut [Vec<f64>],
        samples: &[usize],
        columns: RunColumns<'_>,
        greatest: &mut [f64],
    ) {
        let runs = samples.len();
        assert!(runs <= RunColumns::MOST, "too many runs at once");
        for (i, instant) in self.instants.iter().enumerate() {
            let (before, rest) = numbers.split_at_mut(i);
            let Some((value, rest)) = rest.split_first_mut() else {
                continue;
            };
            let carried = |number: usize| number - i - 1;
            let value = &mut value[..runs];
            self.instant_of_runs(instant, value, before, rest, carried, columns);
        }
        for point in &self.points {
            self.point_of_runs(point, numbers, samples);
        }
        self.greatest_of_runs(numbers, samples, &mut greatest[..runs]);
    }

    fn instant_of_runs(
        &self,
        instant: &RunningInstant,
        value: &mut [f64],
        before: &[Vec<f64>],
        rest: &mut [Vec<f64>],
        carried: impl Fn(usize) -> usize,
        columns: RunColumns<'_>,
    ) {
        let until = self.monitor.settings.until;
        match *instant {
            RunningInstant::Constant(constant) => value.fill(constant),
            RunningInstant::Leaf(ref leaf) => leaf.fill(&columns, Semantics::Margin, 0, value),
            RunningInstant::Not(a) => {
                let pairs = value.iter_mut().zip(&before[a]);
                pairs.for_each(|(value, a)| *value = opposite(*a));
            }
            RunningInstant::Gate(gate, a, b) => {
                let operands = before[a].iter().zip(&before[b]);
                let triples = value.iter_mut().zip(operands);
                triples.for_each(|(value, (a, b))| *value = gate.at(*a, *a, *b, *b));
            }
            RunningInstant::Edge(edge, a, number) => {
                let carries = &mut rest[carried(number)];
                for ((value, a), carry) in value.iter_mut().zip(&before[a]).zip(carries) {
                    (*value, *carry) = edge_at(edge, *a, *carry);
                }
            }
            RunningInstant::Since(a, b, number) => {
                let carries = &mut rest[carried(number)];
                let operands = before[a].iter().zip(&before[b]);
                for ((value, (a, b)), carry) in value.iter_mut().zip(operands).zip(carries) {
                    *carry = since_at(until, *a, *b, *carry);
                    *value = *carry;
                }
            }
            RunningInstant::Past(side, a, number) => {
                let carries = &mut rest[carried(number)];
                for ((value, a), carry) in value.iter_mut().zip(&before[a]).zip(carries) {
                    *carry = pick(side, *carry, *a);
                    *value = *carry;
                }
            }
        }
    }

    fn point_of_runs(&self, point: &RunningPoint, numbers: &mut [Vec<f64>], samples: &[usize]) {
        // Instants have the first numbers, so what is carried lies behind them.
        let (instants, carried) = numbers.split_at_mut(self.instants.len());
        let at = |number: usize| number - self.instants.len();
        match *point {
            RunningPoint::Not(_) | RunningPoint::Gate(..) => {}
            RunningPoint::First { instant, kept } => {
                let pairs = carried[at(kept)].iter_mut().zip(&instants[instant]);
                for ((kept, value), sample) in pairs.zip(samples) {
                    *kept = if *sample == 0 { *value } else { *kept };
                }
            }
            RunningPoint::Window {
                side,
                window,
                instant,
                folded,
            } => {
                let pairs = carried[at(folded)].iter_mut().zip(&instants[instant]);
                // Most windows are the whole run, and their loop has no branch.
                if window.from == 0 && window.to.is_none_or(|to| self.len <= to + 1) {
                    return match side {
                        MinMax::Min => pairs.for_each(|(f, v)| *f = pick(MinMax::Min, *f, *v)),
                        MinMax::Max => pairs.for_each(|(f, v)| *f = pick(MinMax::Max, *f, *v)),
                    };
                }
                for ((folded, value), sample) in pairs.zip(samples) {
                    let is_inside =
                        window.from <= *sample && window.to.is_none_or(|to| *sample <= to);
                    if is_inside {
                        *folded = pick(side, *folded, *value);
                    }
                }
            }
            RunningPoint::Until {
                side,
                window,
                guard,
                goal,
                best,
                ..
            } => {
                let until = self.monitor.settings.until;
                let (first, second) = carried.split_at_mut(at(best) + 1);
                let state = first[at(best)].iter_mut().zip(&mut second[0]);
                let sides = instants[guard].iter().zip(&instants[goal]);
                for (((best, held), (guard, goal)), sample) in state.zip(sides).zip(samples) {
                    if window.to.is_none_or(|to| *sample <= to) {
                        (*best, *held) = until_at(
                            (side, until),
                            window.from <= *sample,
                            (*guard, *goal),
                            (*best, *held),
                        );
                    }
                }
            }
        }
    }

    fn greatest_of_runs(&self, numbers: &[Vec<f64>], samples: &[usize], greatest: &mut [f64]) {
        if let RunningPoint::Window {
            side,
            window,
            folded,
            ..
        } = self.points[self.root]
        {
            let all = greatest.iter_mut().zip(&numbers[folded]).zip(samples);
            for ((greatest, folded), sample) in all {
                let is_open = side == MinMax::Max && is_open(window, sample + 1, self.len);
                let value = if is_open { f64::INFINITY } else { *folded };
                *greatest = self.monitor.clamp(value);
            }
            return;
        }
        for (run, (greatest, sample)) in greatest.iter_mut().zip(samples).enumerate() {
            *greatest = self.interval_of_run(numbers, run, sample + 1).hi;
        }
    }

    /// Returns the possible values of a run after its first `known` samples, at least 1.
    pub fn interval_of_run(&self, numbers: &[Vec<f64>], run: usize, known: usize) -> Interval {
        let interval = self.bounds(self.root, &|i| numbers[i][run], known, self.len);
        interval.map(|value| self.monitor.clamp(value))
    }

    /// Returns the robustness of a run that ends after `known` samples.
    pub fn ended_run(&self, numbers: &[Vec<f64>], run: usize, known: usize) -> f64 {
        self.ended_of(&|i| numbers[i][run], known)
    }
}
