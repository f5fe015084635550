//! Monitors that are fed sample by sample.
//!
//! After every sample they give the interval of robustness values that are
//! still possible (the robust satisfaction interval): unknown samples count
//! for −inf in its lower end and for +inf in its upper end.
//!
//! Operators at the top of the formula are watched at sample 0 only: what has
//! settled is folded into one number, so always and eventually over whatever
//! looks at the present and the past cost O(1) per sample. Operators further
//! down keep the stretch that has not settled yet and redo it at each sample,
//! with the kernels of the offline monitor: O(their horizon) per sample.

use crate::apply::{Bound, Operand, Reading, Work, apply};
use crate::interval::Interval;
use crate::kernel::{Extremum, Max, Min, Tail, opposite};
use crate::leaf::Question;
use crate::monitor::Monitor;
use crate::offline::Scratch;
use crate::program::{Edge, Id, Op, Program, Side};
use crate::settings::{TraceEnd, Until};
use crate::trace::RowError;

mod plan;
mod point;
mod track;

use plan::Need;
use point::Point;
use track::Track;

/// The state of one run of a monitor; make it with [`Monitor::online`].
///
/// The interval contains the final value of every trace that begins with the
/// samples so far, wherever it ends: `hi < 0` means that the formula can no
/// longer be satisfied, `0 < lo` that it is, whatever comes, and `lo == hi`
/// that the value is final. [`OnlineMonitor::finish`] says that the trace ends
/// here and gives the value of [`Monitor::robustness`], bit for bit.
///
/// With [`TraceEnd::Hold`] the samples are kept, because the end of the trace
/// decides what the windows beyond it see; otherwise only as many as the
/// formula's bounds can reach, if they are finite.
#[derive(Clone, Debug)]
pub struct OnlineMonitor {
    monitor: Monitor,
    /// The number of samples to come, where it is known.
    len: Option<usize>,
    known: usize,
    ended: bool,
    /// One per operator; only some are in use.
    tracks: Vec<Track>,
    /// The operators in use, operands first.
    needs: Vec<(Id, Need)>,
    point: Point,
    interval: Interval,
    /// The samples so far, where the end of the trace needs them.
    held: Option<Vec<Vec<f64>>>,
    scratch: Scratch,
}

impl Monitor {
    /// A monitor to be fed sample by sample, for a trace of unknown length.
    pub fn online(&self) -> OnlineMonitor {
        OnlineMonitor::new(self, None)
    }

    /// As [`Monitor::online`], for a trace that will have `len` samples.
    ///
    /// Windows are cut at its known end, so that bounds close earlier, and the
    /// last sample ends with the value of [`Monitor::robustness`].
    pub fn online_for(&self, len: usize) -> OnlineMonitor {
        OnlineMonitor::new(self, Some(len))
    }
}

impl OnlineMonitor {
    fn new(monitor: &Monitor, len: Option<usize>) -> OnlineMonitor {
        let program = &monitor.program;
        let (point, needs) = plan::plan(program);
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

    /// Forgets all samples and keeps the memory.
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

    /// Takes the next sample and returns what is still possible.
    ///
    /// Samples after the known length or after [`OnlineMonitor::finish`] are
    /// ignored, once they have been found to be samples at all.
    ///
    /// # Errors
    /// A NaN, an infinity or a row of another length than the schema's. The
    /// monitor is then as it was before: the row is not counted, and the next
    /// one takes its place. Whoever goes on must mean that; a run with a
    /// missing sample is best given up.
    pub fn push(&mut self, row: &[f64]) -> Result<Interval, RowError> {
        self.monitor.program.schema.check_row(row, self.known)?;
        if self.ended || self.len == Some(0) {
            return Ok(self.interval);
        }
        self.known += 1;
        if !self.interval.is_final() {
            if let Some(held) = &mut self.held {
                for (column, value) in held.iter_mut().zip(row) {
                    column.push(*value);
                }
            }
            self.observe(row);
        }
        if self.len == Some(self.known) {
            self.finish();
        }
        Ok(self.interval)
    }

    /// What is possible now.
    pub fn interval(&self) -> Interval {
        self.interval
    }

    /// How many samples have been taken.
    pub fn len(&self) -> usize {
        self.known
    }

    /// Whether no sample has been taken.
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
            let value = match self.held.take() {
                // The last sample goes on for ever, so every window that is
                // still open changes at once: the offline monitor redoes it all.
                Some(held) => {
                    let value =
                        self.monitor
                            .value(&held, self.known, Question::Margin, &mut self.scratch);
                    self.held = Some(held);
                    value
                }
                None => {
                    let reading = self.reading();
                    self.settle(&reading, None);
                    self.point
                        .update(&self.monitor.program, &reading, &self.tracks)
                        .lo
                }
            };
            let value = self.monitor.clamp(value);
            self.interval = Interval::exactly(value);
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

    fn reading(&self) -> Reading {
        let settings = &self.monitor.settings;
        let len = if self.ended {
            Some(self.known)
        } else {
            self.len
        }
        .unwrap_or(usize::MAX);
        // Where windows are cut. What lies beyond the samples so far and before
        // the cut is unknown: −inf from below, +inf from above. A cut that is
        // known therefore closes the interval earlier.
        let (bounded_len, unbounded_len) = match settings.end {
            TraceEnd::Truncate => (len, len),
            // What a bounded window could still have seen stays unknown.
            TraceEnd::Strict => (usize::MAX, len),
            // No cut: `finish` has the values beyond the end.
            TraceEnd::Hold => (usize::MAX, usize::MAX),
        };
        Reading {
            until: settings.until,
            known: self.known,
            bounded_len,
            unbounded_len,
            tail: Tail::Cut,
        }
    }

    /// Brings every operator in use up to date; without a row, only those
    /// that the end of the trace changes.
    fn settle(&mut self, reading: &Reading, row: Option<&[f64]>) {
        let program = &self.monitor.program;
        let now = reading.known - 1;
        for (id, need) in &self.needs {
            let horizon = program.get(*id).horizon;
            if need.stop.is_some_and(|stop| stop < now) {
                continue;
            }
            let instant = horizon == Some(0);
            // Invariant: operands have lower numbers than their operators, so
            // they are up to date, and the split keeps them readable.
            let (before, rest) = self.tracks.split_at_mut(*id);
            let Some(track) = rest.first_mut() else {
                continue;
            };
            match row {
                Some(row) if instant => {
                    track.now = present(
                        program,
                        *id,
                        track,
                        before,
                        reading,
                        row,
                        &mut self.scratch.work,
                    );
                    if need.stored {
                        if track.lower.is_empty() {
                            track.first = now;
                        }
                        track.lower.push(track.now);
                    }
                }
                _ if instant => {}
                _ => redo(program, *id, track, before, reading, &mut self.scratch.work),
            }
            if let Some(keep) = need.keep {
                track.trim(keep);
            }
        }
    }
}

/// The operands of an operator (both the same where it has one).
fn operands<'a>(op: &Op, tracks: &'a [Track]) -> Option<(Operand<'a>, Operand<'a>)> {
    let mut ids = op.operands();
    let a = ids.next()?;
    let b = ids.next().unwrap_or(a);
    Some((tracks[a].operand(), tracks[b].operand()))
}

/// The value at the latest sample of an operator that needs no later one.
fn present(
    program: &Program,
    id: Id,
    track: &mut Track,
    tracks: &[Track],
    reading: &Reading,
    row: &[f64],
    work: &mut Work,
) -> f64 {
    let now = reading.known - 1;
    let op = &program.get(id).op;
    match *op {
        Op::Constant(true) => f64::INFINITY,
        Op::Constant(false) => f64::NEG_INFINITY,
        Op::Leaf(ref leaf) => leaf.at(row),
        Op::Not(a) => opposite(tracks[a].now),
        Op::Gate(gate, a, b) => {
            let (a, b) = (tracks[a].now, tracks[b].now);
            gate.at(a, a, b, b)
        }
        Op::Behind(side, window, a) => {
            let sample = now.checked_sub(window.from);
            let new = sample.and_then(|t| Some((t, tracks[a].operand().lower.at(t)?)));
            let first = window.to.map(|to| now.saturating_sub(to));
            match side {
                Side::Min => track.slide::<Min>(first, new),
                Side::Max => track.slide::<Max>(first, new),
            }
        }
        // φ S ψ at t = max(ψ(t), min(φ(t), φ S ψ at t − 1)): one number carries
        // the whole past (Havelund, Roşu 2002, of truth values).
        Op::Since(window, a, b) if window.to.is_none() && window.from == 0 => {
            let (guard, goal) = (tracks[a].now, tracks[b].now);
            let goal = if reading.until == Until::Closed {
                Min::pick(guard, goal)
            } else {
                goal
            };
            let before = track.carried.unwrap_or(f64::NEG_INFINITY);
            let value = Max::pick(goal, Min::pick(guard, before));
            track.carried = Some(value);
            value
        }
        Op::Edge(edge, a) => {
            let current = match edge {
                Edge::Rise => tracks[a].now,
                Edge::Fall => opposite(tracks[a].now),
            };
            // `prev` of anything is +inf at the first sample.
            let before = track
                .carried
                .replace(current)
                .map_or(f64::INFINITY, opposite);
            Min::pick(before, current)
        }
        _ => {
            let mut value = [f64::NEG_INFINITY];
            if let Some(pair) = operands(op, tracks) {
                apply(op, reading, pair, Bound::Lower, now, &mut value, work);
            }
            value[0]
        }
    }
}

/// Redoes the samples that have not settled.
///
/// A value at sample t is final once `horizon` samples after it are known. One
/// sample ago that held up to t = known − 2 − horizon, so the work begins at
/// the next one; what lies before it is not touched again.
fn redo(
    program: &Program,
    id: Id,
    track: &mut Track,
    tracks: &[Track],
    reading: &Reading,
    work: &mut Work,
) {
    let instruction = program.get(id);
    let from = instruction
        .horizon
        .map_or(0, |horizon| reading.known.saturating_sub(horizon + 1))
        .max(track.first);
    let len = reading.known - track.first;
    track.lower.resize(len, 0.0);
    track.upper.resize(len, 0.0);
    let Some(pair) = operands(&instruction.op, tracks) else {
        return;
    };
    let skip = from - track.first;
    apply(
        &instruction.op,
        reading,
        pair,
        Bound::Lower,
        from,
        &mut track.lower[skip..],
        work,
    );
    apply(
        &instruction.op,
        reading,
        pair,
        Bound::Upper,
        from,
        &mut track.upper[skip..],
        work,
    );
}
