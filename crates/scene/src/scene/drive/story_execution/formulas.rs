//! Formulas of a storyboard's conditions, rated at every sample.

use crate::scene::drive::motion_profile::SAME_S;
use crate::stl::{Monitor, StreamMonitor};
use crate::story::robustness::{RobustnessAt, SampledRobustness};

/// Formulas with their robustness over the past sample.
#[derive(Clone, Debug)]
pub(super) struct StoryFormulas {
    watched: Vec<WatchedFormula>,
    /// Signals at the beginning of the sample. Empty before the first sample.
    before: Vec<f64>,
    before_s: f64,
    /// Signals at its end.
    now: Vec<f64>,
    now_s: f64,
}

#[derive(Clone, Debug)]
struct WatchedFormula {
    /// Monitor of all rows to which the formula looks back.
    stream: StreamMonitor,
    before: Option<RobustnessAt>,
    now: RobustnessAt,
}

impl StoryFormulas {
    pub(super) fn new(monitors: &[Monitor]) -> StoryFormulas {
        StoryFormulas {
            watched: monitors.iter().map(WatchedFormula::new).collect(),
            before: Vec::new(),
            before_s: 0.0,
            now: Vec::new(),
            now_s: 0.0,
        }
    }

    /// Rates all formulas at a sample.
    pub(super) fn rate(&mut self, row: &[f64], at_s: f64) {
        core::mem::swap(&mut self.before, &mut self.now);
        self.before_s = self.now_s;
        self.now.clear();
        self.now.extend_from_slice(row);
        self.now_s = at_s;
        for formula in &mut self.watched {
            formula.rate(row, at_s);
        }
    }

    /// Lets a formula look back no further than the sample at or before an instant.
    pub(super) fn restart(&mut self, number: usize, monitor: &Monitor, at_s: f64) {
        let mut formula = WatchedFormula::new(monitor);
        // Within the sample its beginning belongs to the past that the formula
        // may see.
        if !self.before.is_empty() && at_s < self.now_s - SAME_S {
            formula.rate(&self.before, self.before_s);
        }
        formula.rate(&self.now, self.now_s);
        self.watched[number] = formula;
    }

    pub(super) fn robustness(&self, number: usize) -> SampledRobustness {
        let WatchedFormula { before, now, .. } = self.watched[number];
        SampledRobustness { before, now }
    }
}

impl WatchedFormula {
    fn new(monitor: &Monitor) -> WatchedFormula {
        WatchedFormula {
            stream: monitor.stream(),
            before: None,
            // Nothing holds before the first row.
            now: RobustnessAt {
                at_s: 0.0,
                rho: f64::NEG_INFINITY,
            },
        }
    }

    fn rate(&mut self, row: &[f64], at_s: f64) {
        self.before = (!self.stream.is_empty()).then_some(self.now);
        // A row that is not finite ends the episode elsewhere.
        if let Ok(Some(rho)) = self.stream.push(row) {
            self.now = RobustnessAt { at_s, rho };
        }
    }
}
