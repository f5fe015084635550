//! Piecewise linear functions of time, with values of their own at breakpoints.
//!
//! A function jumps at a breakpoint if the value there differs from a limit. Windows
//! include both of their ends, so an extremum over a window sees all three.

use std::cmp::Ordering;

use crate::sliding::SlidingExtremum;
use crate::trace_operators::{Extremum, Max, Min, opposite};

/// Linear function on an open interval, by its limits at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinearPiece {
    pub(super) start: f64,
    pub(super) end: f64,
}

impl LinearPiece {
    pub(super) fn constant(value: f64) -> LinearPiece {
        LinearPiece {
            start: value,
            end: value,
        }
    }

    /// Returns the value at `t` of the piece on the interval `ends`.
    fn at(self, ends: (f64, f64), t: f64) -> f64 {
        // Also keeps infinite pieces, which are constant.
        if self.start == self.end || t <= ends.0 {
            return self.start;
        }
        // Clamped, since a shifted time may round past an end.
        if ends.1 <= t {
            return self.end;
        }
        self.start + (self.end - self.start) * ((t - ends.0) / (ends.1 - ends.0))
    }
}

/// Function on the closed interval from the first to the last breakpoint.
#[derive(Clone, Debug, Default)]
pub(super) struct Piecewise {
    /// Breakpoints, ascending.
    pub(super) times: Vec<f64>,
    /// Values at the breakpoints.
    pub(super) points: Vec<f64>,
    /// Pieces between the breakpoints, one less.
    pub(super) pieces: Vec<LinearPiece>,
}

impl Piecewise {
    pub(super) fn constant(times: &[f64], value: f64) -> Piecewise {
        let ends = [times.first(), times.last()].into_iter().flatten().copied();
        let mut times: Vec<f64> = ends.collect();
        // A run of a single sample has one breakpoint and no piece.
        times.dedup();
        Piecewise {
            points: vec![value; times.len()],
            pieces: vec![LinearPiece::constant(value); times.len() - 1],
            times,
        }
    }

    fn ends(&self, piece: usize) -> (f64, f64) {
        (self.times[piece], self.times[piece + 1])
    }

    /// Returns the value at `t`, within piece `piece`.
    fn at(&self, piece: usize, t: f64) -> f64 {
        self.pieces[piece].at(self.ends(piece), t)
    }

    /// Appends a piece and the breakpoint after it, and merges constant pieces.
    fn push(&mut self, piece: LinearPiece, time: f64, point: f64) {
        let flat = |before: Option<&LinearPiece>, at: Option<&f64>| {
            before.zip(at).is_some_and(|(before, at)| {
                // The value between counts as well: a jump of one instant must survive.
                let all = [before.start, before.end, *at, piece.start, piece.end];
                all.iter().all(|value| *value == piece.start)
            })
        };
        if flat(self.pieces.last(), self.points.last()) {
            self.pieces.pop();
            self.points.pop();
            self.times.pop();
        }
        self.pieces.push(piece);
        self.times.push(time);
        self.points.push(point);
    }

    fn begin(time: f64, point: f64) -> Piecewise {
        Piecewise {
            times: vec![time],
            points: vec![point],
            pieces: Vec::new(),
        }
    }

    pub(super) fn negated(mut self) -> Piecewise {
        self.points.iter_mut().for_each(|v| *v = opposite(*v));
        for piece in &mut self.pieces {
            piece.start = opposite(piece.start);
            piece.end = opposite(piece.end);
        }
        self
    }

    /// Returns the function of the negated time.
    pub(super) fn reversed(mut self) -> Piecewise {
        self.times.reverse();
        self.times.iter_mut().for_each(|t| *t = -*t);
        self.points.reverse();
        self.pieces.reverse();
        for piece in &mut self.pieces {
            std::mem::swap(&mut piece.start, &mut piece.end);
        }
        self
    }

    /// Returns the same function with a breakpoint at each of `times`.
    ///
    /// `times` contains all breakpoints of the function.
    fn refined(&self, times: &[f64]) -> Piecewise {
        let mut i = 0;
        let mut out = Piecewise::default();
        for (k, t) in times.iter().enumerate() {
            // `times` has the breakpoints bit for bit, so the comparison is exact.
            let is_breakpoint = self.times.get(i + 1) == Some(t);
            if k != 0 {
                let from = times[k - 1];
                let start = self.at(i, from);
                let end = self.at(i, *t);
                out.pieces.push(LinearPiece { start, end });
            }
            i += usize::from(is_breakpoint);
            let point = if self.times[i] == *t {
                self.points[i]
            } else {
                self.at(i, *t)
            };
            out.points.push(point);
            out.times.push(*t);
        }
        out
    }

    /// Returns both functions with common breakpoints.
    fn aligned(&self, other: &Piecewise) -> (Piecewise, Piecewise) {
        let mut times = [&self.times[..], &other.times[..]].concat();
        sort(&mut times);
        (self.refined(&times), other.refined(&times))
    }

    /// Returns the extremum of both functions at each time.
    pub(super) fn combine<E: Extremum>(&self, other: &Piecewise) -> Piecewise {
        let (a, b) = self.aligned(other);
        let mut out = Piecewise::begin(a.times[0], E::pick(a.points[0], b.points[0]));
        for i in 0..a.pieces.len() {
            let point = E::pick(a.points[i + 1], b.points[i + 1]);
            out.envelope::<E>(&[a.pieces[i], b.pieces[i]], a.ends(i), point);
        }
        out
    }

    /// Appends the extremum of linear functions, with breakpoints where they cross.
    fn envelope<E: Extremum>(&mut self, lines: &[LinearPiece], ends: (f64, f64), point: f64) {
        let mut times = crossings(lines, ends);
        times.push(ends.1);
        let all = |t: f64| {
            let values = lines.iter().map(|line| line.at(ends, t));
            values.fold(E::NEUTRAL, E::pick)
        };
        let mut from = ends.0;
        for t in times {
            let piece = LinearPiece {
                start: all(from),
                end: all(t),
            };
            // Crossings lie between breakpoints, where the extremum has no jump.
            let at = if t == ends.1 { point } else { piece.end };
            self.push(piece, t, at);
            from = t;
        }
    }

    /// Returns the extremum over the window `t + [from, to]`, cut at the last breakpoint.
    ///
    /// Without `to`, the window reaches to the last breakpoint. With `open`, it does not
    /// include its end.
    pub(super) fn ahead<E: Extremum>(&self, from: f64, to: Option<f64>, open: bool) -> Piecewise {
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        // The extremum changes its form only where an end of the window meets a
        // breakpoint.
        let shifts = std::iter::once(from).chain(to);
        let shifted = shifts.flat_map(|shift| self.times.iter().map(move |t| t - shift));
        // The domain stays that of the recorded run.
        let inside = shifted.filter(|t| first < *t && *t < last);
        let mut times: Vec<f64> = inside.chain([first, last]).collect();
        sort(&mut times);
        let mut window = DenseWindow {
            function: self,
            from,
            to,
            open,
            low: 0,
            high: 0,
            pushed: 0,
            within: SlidingExtremum::default(),
        };
        let mut out = Piecewise::begin(times[0], window.point::<E>(times[0]));
        for pair in times.windows(2) {
            let ends = (pair[0], pair[1]);
            // The interval before its right end, because the window only moves forward.
            let lines = window.lines::<E>(ends);
            let point = window.point::<E>(ends.1);
            out.envelope::<E>(&lines, ends, point);
        }
        out
    }

    /// Returns `self until goal` to the last breakpoint.
    ///
    /// `self` holds on [t, t'), and `goal` at t'. With `closed`, `self` holds at t' as
    /// well.
    pub(super) fn until(&self, goal: &Piecewise, closed: bool) -> Piecewise {
        let (guard, goal) = self.aligned(goal);
        // Neither side is above the other in one part and below in another.
        let mut times = guard.times.clone();
        for i in 0..guard.pieces.len() {
            times.extend(crossings(&[guard.pieces[i], goal.pieces[i]], guard.ends(i)));
        }
        sort(&mut times);
        let (guard, goal) = (guard.refined(&times), goal.refined(&times));
        let joined = |guard: f64, goal: f64| if closed { guard.min(goal) } else { goal };
        let last = times.len() - 1;
        // Backwards: the value at a breakpoint, and the piece before it.
        let mut next = joined(guard.points[last], goal.points[last]);
        let mut parts = vec![(times[last], next, None)];
        for i in (0..last).rev() {
            let (g, q) = (guard.pieces[i], goal.pieces[i]);
            // A later goal in this piece, or behind it, needs the guard until then.
            let later = g.end.min(q.end.max(next));
            let start = g.start.min(q.start).max(g.start.min(later));
            // A piece belongs to the entry of its right end, the last so far.
            if let Some(part) = parts.last_mut() {
                part.2 = Some(UntilLines {
                    guard: g,
                    goal: q,
                    later,
                });
            }
            let now = joined(guard.points[i], goal.points[i]);
            next = now.max(guard.points[i].min(start));
            parts.push((times[i], next, None));
        }
        parts.reverse();
        let mut out = Piecewise::begin(times[0], next);
        for pair in parts.windows(2) {
            let ends = (pair[0].0, pair[1].0);
            if let Some(lines) = pair[1].2 {
                out.until_piece(lines, ends, closed, pair[1].1);
            }
        }
        out
    }

    /// Appends max(goal, min(guard, later)) on a piece.
    fn until_piece(&mut self, lines: UntilLines, ends: (f64, f64), closed: bool, point: f64) {
        let UntilLines { guard, goal, later } = lines;
        // Values at breakpoints are placeholders here, as only the pieces are read.
        let mut held = Piecewise::begin(ends.0, 0.0);
        held.envelope::<Min>(&[guard, LinearPiece::constant(later)], ends, 0.0);
        let mut now = Piecewise::begin(ends.0, 0.0);
        let lines = if closed {
            vec![guard, goal]
        } else {
            vec![goal]
        };
        now.envelope::<Min>(&lines, ends, 0.0);
        let part = held.combine::<Max>(&now);
        for i in 0..part.pieces.len() {
            let end = part.times[i + 1];
            // Inside of the piece the function is continuous.
            let at = if end == ends.1 {
                point
            } else {
                part.pieces[i].end
            };
            self.push(part.pieces[i], end, at);
        }
    }
}

/// Both sides of an until on a piece, and its value at a goal in or behind the piece.
#[derive(Clone, Copy)]
struct UntilLines {
    guard: LinearPiece,
    goal: LinearPiece,
    later: f64,
}

/// Returns the times at which linear functions cross, ascending.
fn crossings(lines: &[LinearPiece], ends: (f64, f64)) -> Vec<f64> {
    let mut times = Vec::new();
    for (i, a) in lines.iter().enumerate() {
        for b in &lines[i + 1..] {
            let (start, end) = (a.start - b.start, a.end - b.end);
            // Two infinities of one sign give NaN, which counts as no crossing.
            if (start < 0.0 && end > 0.0) || (end < 0.0 && start > 0.0) {
                let t = ends.0 + (ends.1 - ends.0) * (start / (start - end));
                // Rounding may move a crossing to an end, where it changes nothing.
                times.extend((ends.0 < t && t < ends.1).then_some(t));
            }
        }
    }
    sort(&mut times);
    times
}

/// Sorts finite numbers and removes repetitions.
fn sort(times: &mut Vec<f64>) {
    times.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    times.dedup();
}

/// Window that moves over a function.
struct DenseWindow<'a> {
    function: &'a Piecewise,
    from: f64,
    to: Option<f64>,
    open: bool,
    /// First breakpoint at or behind the start of the window.
    low: usize,
    /// Number of breakpoints before or at the end of the window.
    high: usize,
    /// Number of breakpoints in the sliding extremum.
    pushed: usize,
    within: SlidingExtremum,
}

impl DenseWindow<'_> {
    /// Moves so that `low` is at `start` or later, and `high` at `end` or earlier.
    fn shift(&mut self, start: f64, end: f64) {
        let times = &self.function.times;
        while self.low < times.len() && times[self.low] - self.from < start {
            self.low += 1;
        }
        self.high = match self.to {
            None => times.len(),
            Some(to) => {
                let mut high = self.high;
                while high < times.len() && times[high] - to <= end {
                    high += 1;
                }
                high
            }
        };
    }

    /// Returns the extremum at the breakpoints `first .. end` and on both of their sides.
    fn within<E: Extremum>(&mut self, first: usize, end: usize) -> f64 {
        let function = self.function;
        while self.pushed < end {
            let i = self.pushed;
            let before = i.checked_sub(1).and_then(|i| function.pieces.get(i));
            let sides = [
                before.map(|piece| piece.end),
                function.pieces.get(i).map(|piece| piece.start),
            ];
            let all = sides.into_iter().flatten();
            let value = all.fold(function.points[i], E::pick);
            self.within.slide::<E>(Some(first), Some((i, value)));
            self.pushed += 1;
        }
        self.within.slide::<E>(Some(first), None)
    }

    /// Returns the extremum over the window at `t`.
    fn point<E: Extremum>(&mut self, t: f64) -> f64 {
        self.shift(t, t);
        let function = self.function;
        let Some(low) = function.times.get(self.low).map(|time| time - self.from) else {
            // The window begins behind the last breakpoint and is empty.
            return E::NEUTRAL;
        };
        let at_breakpoint = low == t;
        let start = if at_breakpoint {
            function.points[self.low]
        } else {
            function.at(self.low - 1, t + self.from)
        };
        // A window of one instant sees no limit at either side.
        if self.to == Some(self.from) {
            return start;
        }
        let mut value = start;
        // The limit to the right of its start is inside of the window, the left one is
        // not.
        if at_breakpoint && let Some(piece) = function.pieces.get(self.low) {
            value = E::pick(value, piece.start);
        }
        let first = self.low + usize::from(at_breakpoint);
        let mut end = self.high;
        // The end of the window: at a breakpoint, in a piece, or behind the function.
        if let Some(to) = self.to {
            // At times so large that `to` is lost in rounding, the end is the first breakpoint.
            if end > 1 && function.times[end - 1] - to == t {
                end -= 1;
                value = E::pick(value, function.pieces[end - 1].end);
                // An open window leaves out the end itself, but not the limit before
                // it.
                if !self.open {
                    value = E::pick(value, function.points[end]);
                }
            } else if end < function.times.len() {
                value = E::pick(value, function.at(end - 1, t + to));
            }
        }
        E::pick(value, self.within::<E>(first, end))
    }

    /// Returns linear functions whose extremum is that over the window, on an open interval
    /// in which no end of the window passes a breakpoint.
    fn lines<E: Extremum>(&mut self, ends: (f64, f64)) -> Vec<LinearPiece> {
        // Exchanged, so that only breakpoints count that are inside during the whole
        // interval.
        self.shift(ends.1, ends.0);
        if self.low == self.function.times.len() {
            return vec![LinearPiece::constant(E::NEUTRAL)];
        }
        let line = |piece: usize, shift: f64| {
            let (start, end) = self.function.ends(piece);
            let whole = self.function.pieces[piece];
            // At a breakpoint the limit is copied, since a sum of times may round
            // beside it.
            LinearPiece {
                start: if start - shift == ends.0 {
                    whole.start
                } else {
                    self.function.at(piece, ends.0 + shift)
                },
                end: if end - shift == ends.1 {
                    whole.end
                } else {
                    self.function.at(piece, ends.1 + shift)
                },
            }
        };
        let mut lines = vec![line(self.low - 1, self.from)];
        if self.to == Some(self.from) {
            return lines;
        }
        // A window that reaches behind the last breakpoint sees it as an inner one
        // below.
        if let Some(to) = self.to.filter(|_| self.high < self.function.times.len()) {
            lines.push(line(self.high - 1, to));
        }
        if self.low < self.high {
            lines.push(LinearPiece::constant(self.within::<E>(self.low, self.high)));
        }
        lines
    }
}
