//! Monitors that are fed sample by sample.
//!
//! After every sample they return the interval of robustness values that are
//! still possible (the robust satisfaction interval). Unknown samples count as
//! −inf in its lower end and as +inf in its upper end.
//!
//! Operators at the top of the formula are watched at sample 0 only, and settled
//! values are folded into a single number. Each operator below them decides one value
//! per sample, in amortised O(1). Its undecided values are computed only if they are
//! read, by three ways:
//!
//! - They are not read where they are certain to have no effect ([`open`]).
//! - Their extremum is kept, if a single future operator is in them ([`nested`]).
//! - Otherwise they are recomputed at each sample, with the kernels of the offline
//!   monitor: O(their horizon) per sample.

use crate::apply::EvalWindow;
use crate::interval::Interval;
use crate::leaf::Semantics;
use crate::monitor::Monitor;
use crate::offline::Scratch;
use crate::settings::TraceEnd;
use crate::trace::RowError;
use crate::trace_operators::WindowTail;

mod nested;
mod open;
mod plan;
mod point;
mod progress;
mod settle;
mod step;
mod stream;
mod track;

use plan::PlannedOperator;
use point::Point;
use settle::settle;
pub use stream::StreamMonitor;
use track::Track;

/// State of a monitor's run, created by [`Monitor::online`].
///
/// The interval contains the final value of every trace that begins with the
/// samples so far, wherever it ends. `hi < 0` means that the formula can no
/// longer be satisfied, `0 < lo` that it is satisfied in any continuation, and
/// `lo == hi` that the value is final. [`OnlineMonitor::finish`] ends the trace
/// and returns the value of [`Monitor::robustness`], bit for bit.
///
/// With [`TraceEnd::Hold`] all samples are kept, because the end of the trace
/// decides the windows beyond it. Otherwise only as many are kept as the
/// formula's bounds can reach, if they are finite.
#[derive(Clone, Debug)]
pub struct OnlineMonitor {
    monitor: Monitor,
    /// Number of samples of the whole trace, if known.
    len: Option<usize>,
    known: usize,
    ended: bool,
    /// State per operator, of which only some are in use.
    tracks: Vec<Track>,
    /// Operators in use, operands first.
    needs: Vec<PlannedOperator>,
    point: Point,
    interval: Interval,
    /// Samples so far, if the end of the trace needs them.
    held: Option<Vec<Vec<f64>>>,
    scratch: Scratch,
}

impl Monitor {
    /// Creates an online monitor for a trace of unknown length.
    pub fn online(&self) -> OnlineMonitor {
        OnlineMonitor::new(self, None)
    }

    /// Creates an online monitor for a trace of `len` samples.
    ///
    /// Windows are cut at the known end, so that bounds close earlier. The last
    /// sample returns the value of [`Monitor::robustness`].
    pub fn online_for(&self, len: usize) -> OnlineMonitor {
        OnlineMonitor::new(self, Some(len))
    }
}

impl OnlineMonitor {
    fn new(monitor: &Monitor, len: Option<usize>) -> OnlineMonitor {
        let program = &monitor.program;
        let (point, needs) = plan::plan(program, len);
        let held = (monitor.settings.end == TraceEnd::Hold)
            .then(|| vec![Vec::new(); program.schema.len()]);
        OnlineMonitor {
            monitor: monitor.clone(),
            len,
            known: 0,
            ended: false,
            tracks: vec![Track::default(); program.instructions.len()],
            needs,
            point,
            interval: Interval::ANY.map(|value| monitor.clamp(value)),
            held,
            scratch: Scratch::new(),
        }
    }

    /// Discards all samples and keeps the memory.
    pub fn reset(&mut self) {
        self.known = 0;
        self.ended = false;
        self.tracks.iter_mut().for_each(Track::clear);
        self.point.reset();
        self.interval = Interval::ANY.map(|value| self.monitor.clamp(value));
        for column in self.held.iter_mut().flatten() {
            column.clear();
        }
    }

    /// Reads the next sample and returns the possible values.
    ///
    /// Samples after the known length or after [`OnlineMonitor::finish`] are ignored
    /// if they are valid.
    ///
    /// # Errors
    /// A NaN, an infinity or a row of another length than the schema's. The monitor
    /// is then unchanged: the row is not counted, and the next row takes its place.
    /// Continue only if that is intended. Otherwise abandon a run with a missing
    /// sample.
    pub fn push(&mut self, row: &[f64]) -> Result<Interval, RowError> {
        self.monitor.program.schema.check_row(row, self.known)?;
        Ok(self.push_checked(row))
    }

    /// Reads the next sample, a row that [`Trace::push`](crate::trace::Trace::push) accepted.
    ///
    /// Several monitors of one trace thus check it once. A row that was not checked
    /// gives a wrong interval, or a panic if it is too short.
    pub fn push_checked(&mut self, row: &[f64]) -> Interval {
        if self.ended || self.len == Some(0) {
            return self.interval;
        }
        self.known += 1;
        // A final interval cannot change, so the rest of the run costs nothing.
        if !self.interval.is_final() {
            if let Some(held) = &mut self.held {
                for (column, value) in held.iter_mut().zip(row) {
                    column.push(*value);
                }
            }
            self.observe(row);
        }
        // The known end has come, so no caller needs to call `finish`.
        if self.len == Some(self.known) {
            self.finish();
        }
        self.interval
    }

    /// Returns the possible values now.
    pub fn interval(&self) -> Interval {
        self.interval
    }

    /// Returns the number of samples read.
    pub fn len(&self) -> usize {
        self.known
    }

    /// Returns true if no sample has been read.
    pub fn is_empty(&self) -> bool {
        self.known == 0
    }

    /// Ends the trace here and returns the robustness.
    pub fn finish(&mut self) -> f64 {
        if self.ended {
            return self.interval.lo;
        }
        self.ended = true;
        if self.known == 0 {
            let nothing = self.monitor.clamp(f64::NEG_INFINITY);
            self.interval = Interval::exactly(nothing);
        } else if !self.interval.is_final() {
            let robustness = match self.held.take() {
                // The last sample is held for ever, so every window that is still open changes
                // at once: the offline monitor recomputes it all.
                Some(held) => {
                    let value =
                        self.monitor
                            .value(&held, self.known, Semantics::Margin, &mut self.scratch);
                    self.held = Some(held);
                    value
                }
                None => {
                    // Without a row: the end alone closes the windows that are still open.
                    let reading = self.reading();
                    self.settle(&reading, None);
                    self.point
                        .update(&self.monitor.program, &reading, &self.tracks)
                        .lo
                }
            };
            self.interval = Interval::exactly(self.monitor.clamp(robustness));
        }
        self.interval.lo
    }

    fn observe(&mut self, row: &[f64]) {
        let reading = self.reading();
        self.settle(&reading, Some(row));
        let interval = self
            .point
            .update(&self.monitor.program, &reading, &self.tracks);
        self.interval = interval.map(|value| self.monitor.clamp(value));
    }

    fn settle(&mut self, reading: &EvalWindow, row: Option<&[f64]>) {
        // At the end, samples that were undecided so far become known.
        let end = self.ended || self.len.is_some_and(|len| len <= self.known);
        let work = &mut self.scratch.work;
        let program = &self.monitor.program;
        settle(
            program,
            &self.needs,
            &mut self.tracks,
            reading,
            row,
            end,
            work,
        );
    }

    fn reading(&self) -> EvalWindow {
        let settings = &self.monitor.settings;
        let len = if self.ended {
            Some(self.known)
        } else {
            self.len
        }
        .unwrap_or(usize::MAX);
        // Cut of the windows. Samples beyond the known part and before the cut are
        // unknown: −inf from below, +inf from above. A known cut therefore closes the
        // interval earlier.
        let (bounded_len, unbounded_len) = match settings.end {
            TraceEnd::Truncate => (len, len),
            // Samples that a bounded window could still have reached stay unknown.
            TraceEnd::Strict => (usize::MAX, len),
            // No cut, since `finish` has the values beyond the end.
            TraceEnd::Hold => (usize::MAX, usize::MAX),
        };
        EvalWindow {
            until: settings.until,
            known: self.known,
            bounded_len,
            unbounded_len,
            tail: WindowTail::Cut,
        }
    }
}
