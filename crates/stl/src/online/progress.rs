//! Part of a window that the monitor of sample 0 has read.

use crate::apply::EvalWindow;
use crate::interval::Interval;
use crate::trace_operators::{Extremum, SampleWindow, View, fold};

/// Part of a window that an operator has read so far.
#[derive(Clone, Debug)]
pub(super) struct WindowProgress {
    pub(super) window: SampleWindow,
    /// Horizon of the operands.
    pub(super) horizon: Option<usize>,
    /// First sample that is not folded in.
    pub(super) next: usize,
    /// Extremum of the folded samples, or the best value of an until so far.
    pub(super) folded: Option<f64>,
    /// Extremum of the left side of an until.
    pub(super) guard: Option<f64>,
}

impl WindowProgress {
    pub(super) fn new(window: SampleWindow, horizon: Option<usize>) -> WindowProgress {
        WindowProgress {
            window,
            horizon,
            next: 0,
            folded: None,
            guard: None,
        }
    }

    /// Returns the last known sample of the window and the settled count.
    pub(super) fn last(&self, reading: &EvalWindow) -> (usize, usize) {
        let now = reading.known - 1;
        let last = self.window.to.map_or(now, |to| to.min(now));
        let settled = match self.horizon {
            // An exact reading knows every sample, so nothing is pending.
            _ if reading.is_exact() => reading.known,
            Some(horizon) => reading.known.saturating_sub(horizon),
            // An unbounded operand is undecided until the trace ends.
            None => 0,
        };
        (last, settled.min(last + 1))
    }

    /// Folds the decided samples before `settled`, and returns the extremum so far.
    pub(super) fn settle<E: Extremum>(&mut self, settled: usize, decided: View<'_>) -> f64 {
        let next = self.next.max(self.window.from);
        let mut folded = self.folded.unwrap_or(E::NEUTRAL);
        if next < settled {
            let new = &decided.from(next)[..settled - next];
            folded = E::pick(folded, fold::<E>(new));
            self.next = settled;
        }
        self.folded = Some(folded);
        folded
    }

    /// Returns true if samples of the window are still to come.
    pub(super) fn is_open(&self, reading: &EvalWindow) -> bool {
        let len = reading.len(self.window);
        reading.known < len
            && self.window.from < len
            && self.window.to.is_none_or(|to| reading.known <= to)
    }
}

/// Opens the end of the interval that samples to come can move.
///
/// That is the lower end of a minimum and the upper end of a maximum.
pub(super) fn opened<E: Extremum>(interval: Interval) -> Interval {
    if E::NEUTRAL == f64::INFINITY {
        Interval {
            lo: f64::NEG_INFINITY,
            ..interval
        }
    } else {
        Interval {
            hi: f64::INFINITY,
            ..interval
        }
    }
}
