//! Several samples of a run at a time: whole columns, one entry per sample.

use super::{RunningInstant, RunningMonitor, pick};
use crate::BoundExpr;
use crate::leaf::{CHUNK, Columns, Semantics};
use crate::program::MinMax;
use crate::trace_operators::{Min, fold};

/// Consecutive samples of a run: a column per signal, an entry per sample.
#[derive(Clone, Copy, Debug)]
pub struct SampleColumns<'a>(pub &'a [Vec<f64>]);

impl SampleColumns<'_> {
    /// Greatest number of samples.
    pub const MOST: usize = CHUNK;

    /// Copies the row of a sample into `row`.
    pub fn read_row(&self, sample: usize, row: &mut Vec<f64>) {
        row.clear();
        row.extend(self.0.iter().map(|column| column[sample]));
    }
}

impl Columns for SampleColumns<'_> {
    fn column(&self, signal: usize) -> &[f64] {
        &self.0[signal]
    }
}

impl BoundExpr {
    /// Computes the value at the samples `from ..`: [`BoundExpr::eval`], bit for bit.
    ///
    /// # Panics
    /// A column that the expression reads is too short, or `values` is longer than
    /// [`SampleColumns::MOST`].
    pub fn eval_all(&self, columns: SampleColumns<'_>, from: usize, values: &mut [f64]) {
        assert!(values.len() <= SampleColumns::MOST, "too many samples");
        self.value.fill(&columns, from, values);
    }
}

impl RunningMonitor {
    /// Reads `count` samples at once, and returns the least of their greatest values.
    ///
    /// `None` if the formula is more than an `always` over the whole run, and nothing
    /// is read then: [`RunningMonitor::push`] reads such samples one by one. Otherwise
    /// the numbers are as after that, and the result is the least `hi`.
    ///
    /// # Panics
    /// A column or the numbers are too short, or `work` has fewer entries than samples.
    pub fn push_all(
        &self,
        numbers: &mut [f64],
        columns: SampleColumns<'_>,
        count: usize,
        work: &mut [f64],
    ) -> Option<f64> {
        let (instant, folded) = self.extremum?;
        let margins = &mut work[..count];
        match &self.instants[instant] {
            RunningInstant::Leaf(leaf) => leaf.fill(&columns, Semantics::Margin, 0, margins),
            // Invariant: the short cut exists only for a single comparison.
            _ => return None,
        }
        let least = pick(MinMax::Min, numbers[folded], fold::<Min>(margins));
        numbers[folded] = least;
        // The upper end never rises, so its least value is the latest.
        Some(self.monitor.clamp(least))
    }
}
