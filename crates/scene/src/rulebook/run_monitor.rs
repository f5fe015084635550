//! Monitor of one formula in a run: running numbers where they decide it.

use std::sync::Arc;

use crate::stl::{Interval, Monitor, OnlineMonitor, RunningMonitor, Scratch};
use crate::trace::Trace;

/// State of one formula in a run.
#[derive(Clone)]
pub(super) enum RunMonitor {
    /// A formula that running numbers decide, as most are.
    Running {
        monitor: Arc<RunningMonitor>,
        numbers: Vec<f64>,
        samples: usize,
        /// Greatest number of samples.
        most: usize,
        interval: Interval,
    },
    /// Any other formula.
    General(Box<OnlineMonitor>),
}

impl RunMonitor {
    /// Creates a monitor for runs of at most `samples` samples.
    pub(super) fn new(formula: &Monitor, samples: usize) -> RunMonitor {
        let Some(monitor) = formula.running(samples) else {
            return RunMonitor::General(Box::new(formula.online_for(samples)));
        };
        let mut numbers = vec![0.0; monitor.numbers()];
        monitor.begin(&mut numbers);
        RunMonitor::Running {
            interval: monitor.interval(&numbers, 0),
            monitor: Arc::new(monitor),
            numbers,
            samples: 0,
            most: samples,
        }
    }

    /// Discards all samples and keeps the memory.
    pub(super) fn reset(&mut self) {
        match self {
            RunMonitor::General(general) => general.reset(),
            RunMonitor::Running {
                monitor,
                numbers,
                samples,
                interval,
                ..
            } => {
                monitor.begin(numbers);
                *samples = 0;
                *interval = monitor.interval(numbers, 0);
            }
        }
    }

    /// Reads the next sample, a checked row, and returns the possible values.
    #[inline]
    pub(super) fn push(&mut self, row: &[f64]) -> Interval {
        match self {
            RunMonitor::General(general) => general.push_checked(row),
            RunMonitor::Running {
                monitor,
                numbers,
                samples,
                most,
                interval,
            } => {
                // A scene may be advanced past its horizon, where no number may be fed.
                if *samples < *most {
                    *interval = monitor.push(numbers, *samples, row);
                    *samples += 1;
                }
                *interval
            }
        }
    }

    /// Returns the robustness of `formula` if the run ends here.
    ///
    /// `trace` holds the samples that were pushed.
    pub(super) fn ended(&self, formula: &Monitor, trace: &Trace, scratch: &mut Scratch) -> f64 {
        match self {
            RunMonitor::Running {
                monitor,
                numbers,
                samples,
                ..
            } => monitor.ended(numbers, *samples),
            // A final value is that of the run that ends here, too.
            RunMonitor::General(general) if general.interval().is_final() => general.interval().lo,
            // The end of the trace still changes the value, so all of it is read.
            RunMonitor::General(_) => formula.robustness(trace, scratch),
        }
    }
}
