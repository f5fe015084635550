//! Robustness at every sample of a run that goes on, with a delay.

use super::plan::{self, PlannedOperator};
use super::settle::settle;
use super::track::Track;
use crate::apply::EvalWindow;
use crate::monitor::Monitor;
use crate::offline::Scratch;
use crate::settings::TraceEnd;
use crate::trace::RowError;
use crate::trace_operators::WindowTail;

/// Exact robustness at every sample, as soon as the horizon of the formula is known.
///
/// Created by [`Monitor::stream`]. The values that [`StreamMonitor::push`] and
/// [`StreamMonitor::finish`] return are those of [`Monitor::robustness_all`], in
/// order and bit for bit.
///
/// A sample is decided after a number of later samples that depends on the
/// operator. Delays of nested operators add up, and the two sides of an operator
/// count with the larger delay.
///
/// | operator | sample t is decided at sample |
/// | --- | --- |
/// | comparisons, `not`, `and`, `or`, `implies`, `iff`, `xor` | t |
/// | `historically`, `once`, `since`, `prev`, `s_prev`, `rise`, `fall` | t |
/// | `next`, `s_next` | t + 1 |
/// | `always[a, b]`, `eventually[a, b]`, `until[a, b]`, `unless[a, b]`, `release[a, b]` | t + b |
/// | the same without a bound, or with `end` | the end of the trace |
///
/// [`Monitor::horizon_samples`] is the delay of the whole formula. The delay does
/// not depend on the values, even if an early value decides a window.
///
/// A sample costs amortised O(1) per operator, for any window. Every operator keeps
/// O(its delay + the windows that read it) values. An unbounded future operator, and an
/// unbounded past operator over a future operator, keep a value per sample.
///
/// ```
/// use brakecheck_stl::trace::{Schema, Signal};
/// use brakecheck_stl::{Constants, Formula};
///
/// let schema = Schema::new(1.0, [Signal::real("gap", "m", "clearance")])?;
/// let formula: Formula = "always[0, 1] (gap >= 2)".parse()?;
/// let mut stream = formula.bind(&schema, &Constants::new())?.stream();
/// assert_eq!(stream.push(&[5.0])?, None);
/// assert_eq!(stream.push(&[3.0])?, Some(1.0));
/// assert_eq!(stream.push(&[4.0])?, Some(1.0));
/// assert_eq!(stream.finish(), [2.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct StreamMonitor {
    monitor: Monitor,
    known: usize,
    ended: bool,
    tracks: Vec<Track>,
    /// Operators in use, operands first.
    needs: Vec<PlannedOperator>,
    /// Latest row, if the end of the trace holds it.
    last: Option<Vec<f64>>,
    scratch: Scratch,
}

impl Monitor {
    /// Creates a monitor that returns the robustness at every sample, with a delay.
    pub fn stream(&self) -> StreamMonitor {
        let hold = self.settings.end == TraceEnd::Hold;
        StreamMonitor {
            monitor: self.clone(),
            known: 0,
            ended: false,
            tracks: vec![Track::default(); self.program.instructions.len()],
            needs: plan::plan_all(&self.program),
            last: hold.then(Vec::new),
            scratch: Scratch::new(),
        }
    }
}

impl StreamMonitor {
    /// Reads the next sample and returns the next decided value.
    ///
    /// Sample k decides sample k − `horizon`, so the values are in order and each
    /// sample decides at most one. Samples after [`StreamMonitor::finish`] are ignored
    /// if they are valid.
    ///
    /// # Errors
    /// As [`OnlineMonitor::push`](crate::OnlineMonitor::push), and the monitor is
    /// unchanged as there.
    pub fn push(&mut self, row: &[f64]) -> Result<Option<f64>, RowError> {
        self.monitor.program.schema.check_row(row, self.known)?;
        if self.ended {
            return Ok(None);
        }
        // After the check, so that a refused row is never held.
        if let Some(last) = &mut self.last {
            last.clear();
            last.extend_from_slice(row);
        }
        Ok(self.observe(row))
    }

    /// Ends the trace here and returns the values that are not yet returned.
    ///
    /// A second call returns nothing.
    pub fn finish(&mut self) -> Vec<f64> {
        let mut rest = Vec::new();
        if self.ended || self.known == 0 {
            self.ended = true;
            return rest;
        }
        self.ended = true;
        let len = self.known;
        // Counted before held samples arrive, which decide further samples.
        let decided = self.decided();
        if let Some(last) = self.last.take() {
            // From there on every operator repeats its last value.
            for _ in len..self.monitor.reading(len).known {
                rest.extend(self.observe(&last));
            }
            self.last = Some(last);
        }
        let next = self.decided();
        let reading = self.monitor.reading(len);
        self.settle(&reading, None, true);
        let root = &self.tracks[self.monitor.program.root()];
        rest.extend_from_slice(root.operand().lower.from(next));
        // The held samples are not part of the trace.
        rest.truncate(len - decided);
        let monitor = &self.monitor;
        rest.iter_mut()
            .for_each(|value| *value = monitor.clamp(*value));
        // Held samples do not count as read.
        self.known = len;
        rest
    }

    /// Returns the number of samples read.
    pub fn len(&self) -> usize {
        self.known
    }

    /// Returns true if no sample has been read.
    pub fn is_empty(&self) -> bool {
        self.known == 0
    }

    /// Discards all samples and keeps the memory.
    pub fn reset(&mut self) {
        self.known = 0;
        self.ended = false;
        self.tracks.iter_mut().for_each(Track::clear);
    }

    /// Returns the number of samples decided by the samples so far.
    fn decided(&self) -> usize {
        let horizon = self.monitor.horizon_samples();
        horizon.map_or(0, |horizon| self.known.saturating_sub(horizon))
    }

    fn observe(&mut self, row: &[f64]) -> Option<f64> {
        self.known += 1;
        // Only decided values are computed, so the end of the trace does not matter.
        let reading = EvalWindow {
            until: self.monitor.settings.until,
            known: self.known,
            bounded_len: usize::MAX,
            unbounded_len: usize::MAX,
            tail: WindowTail::Cut,
        };
        self.settle(&reading, Some(row), false);
        let value =
            self.tracks[self.monitor.program.root()].at(self.decided().checked_sub(1)?)?;
        Some(self.monitor.clamp(value))
    }

    fn settle(&mut self, reading: &EvalWindow, row: Option<&[f64]>, everything: bool) {
        let work = &mut self.scratch.work;
        let (program, needs) = (&self.monitor.program, &self.needs);
        settle(
            program,
            needs,
            &mut self.tracks,
            reading,
            row,
            everything,
            work,
        );
    }
}
