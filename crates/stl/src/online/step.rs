//! Decided values of operators, one sample at a time in amortised O(1).
//!
//! The value at sample t is decided once `horizon` later samples are known. With
//! each new sample, every operator therefore decides one value, `horizon` samples
//! back. Its operands have decided at least as much.

use super::track::Track;
use crate::program::{BoundProgram, Edge, Id, MinMax, Op, Strength};
use crate::settings::Until;
use crate::sliding::UntilPart;
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, opposite};

/// Decided values of the operands of an operator, when sample `now` is the latest.
#[derive(Clone, Copy)]
pub(super) struct Decided<'a> {
    pub(super) program: &'a BoundProgram,
    pub(super) tracks: &'a [Track],
    pub(super) until: Until,
    pub(super) now: usize,
}

impl Decided<'_> {
    /// Returns the last sample at which all of `ids` are decided.
    fn last(&self, ids: &[Id]) -> Option<usize> {
        ids.iter().try_fold(self.now, |last, id| {
            let lag = self.program.get(*id).horizon?;
            Some(last.min(self.now.checked_sub(lag)?))
        })
    }

    fn at(&self, id: Id, sample: usize) -> Option<f64> {
        self.tracks[id].at(sample)
    }

    /// Returns the goal: the right side, joined by the left side in the closed reading.
    pub(super) fn goal<E: Extremum>(&self, guard: f64, goal: f64) -> f64 {
        if self.until == Until::Closed {
            E::Dual::pick(guard, goal)
        } else {
            goal
        }
    }

    /// Returns the next decided value of operator `id` and its sample.
    ///
    /// Not inlined, so that formulas of the present and the past stay fast.
    #[inline(never)]
    pub(super) fn next(&self, id: Id, track: &mut Track) -> Option<(usize, f64)> {
        let instruction = self.program.get(id);
        // Operators see every decided value of their operands, also before their first own.
        let value = self.value(&instruction.op, track);
        let sample = self.now.checked_sub(instruction.horizon?)?;
        Some((sample, value?))
    }

    fn value(&self, op: &Op, track: &mut Track) -> Option<f64> {
        match *op {
            // Known as soon as their sample is, so never decided later.
            Op::Constant(_) | Op::Leaf(_) => None,
            Op::Not(a) => Some(opposite(self.at(a, self.last(&[a])?)?)),
            Op::Gate(gate, a, b) => {
                let sample = self.last(&[a, b])?;
                let (a, b) = (self.at(a, sample)?, self.at(b, sample)?);
                Some(gate.at(a, a, b, b))
            }
            Op::Ahead(MinMax::Min, window, a) => self.ahead::<Min>(window, a, track),
            Op::Ahead(MinMax::Max, window, a) => self.ahead::<Max>(window, a, track),
            Op::Behind(side, window, a) => {
                let sample = self.last(&[a])?;
                Some(self.behind(side, window, a, sample, track))
            }
            Op::Until(MinMax::Min, strength, window, a, b) => {
                self.until::<Min>(strength, window, a, b, track)
            }
            Op::Until(MinMax::Max, strength, window, a, b) => {
                self.until::<Max>(strength, window, a, b, track)
            }
            Op::Since(window, a, b) => self.since(window, a, b, track),
            Op::Edge(edge, a) => {
                let value = self.at(a, self.last(&[a])?)?;
                Some(step_edge(edge, value, track))
            }
        }
    }

    fn ahead<E: Extremum>(&self, window: SampleWindow, a: Id, track: &mut Track) -> Option<f64> {
        let last = self.last(&[a])?;
        // The window that ends with the operand's last decided sample.
        let first = (last + window.from).saturating_sub(window.to?);
        let new = (last, self.at(a, last)?);
        Some(track.window.slide::<E>(Some(first), Some(new)))
    }

    /// Historically or once at `sample`, the next one.
    #[inline]
    pub(super) fn behind(
        &self,
        side: MinMax,
        window: SampleWindow,
        a: Id,
        sample: usize,
        track: &mut Track,
    ) -> f64 {
        // The sample that enters the window now lies `from` samples back.
        let enters = sample.checked_sub(window.from);
        let new = enters.and_then(|t| Some((t, self.at(a, t)?)));
        let first = window.to.map(|to| sample.saturating_sub(to));
        match side {
            MinMax::Min => track.window.slide::<Min>(first, new),
            MinMax::Max => track.window.slide::<Max>(first, new),
        }
    }

    /// Until of the window that ends with the last sample of both sides.
    ///
    /// The kernel bounds the window by an identity that needs the unbounded until.
    /// That is decided only by the end, so here the window itself slides.
    fn until<E: Extremum>(
        &self,
        strength: Strength,
        window: SampleWindow,
        a: Id,
        b: Id,
        track: &mut Track,
    ) -> Option<f64> {
        let last = self.last(&[a, b])?;
        let (to, width) = (window.to?, window.width()?);
        let guard = self.at(a, last)?;
        let goal = self.goal::<E>(guard, self.at(b, last)?);
        let new = UntilPart { best: goal, guard };
        track.pairs.push::<E>(Some(width), new);
        let mut value = track.pairs.join::<E>()?.best;
        // The left side must hold before the window as well.
        if window.from != 0
            && let Some(end) = (last + window.from).checked_sub(to + 1)
        {
            let first = last.saturating_sub(to);
            let new = (end, self.at(a, end)?);
            let before = track.guard.slide::<E::Dual>(Some(first), Some(new));
            value = E::Dual::pick(value, before);
        }
        if strength == Strength::Weak {
            let first = last.saturating_sub(to);
            let held = track
                .throughout
                .slide::<E::Dual>(Some(first), Some((last, guard)));
            value = E::pick(value, held);
        }
        Some(value)
    }

    /// Since at the last sample of both sides, by the identity of the kernel.
    fn since(&self, window: SampleWindow, a: Id, b: Id, track: &mut Track) -> Option<f64> {
        let sample = self.last(&[a, b])?;
        // The left side between the window and the present.
        let mut after = f64::INFINITY;
        if window.from != 0 {
            let first = (sample + 1).saturating_sub(window.from);
            let new = (sample, self.at(a, sample)?);
            after = track.guard.slide::<Min>(Some(first), Some(new));
        }
        // A window before the first sample has no goal in it.
        let Some(newest) = sample.checked_sub(window.from) else {
            return Some(f64::NEG_INFINITY);
        };
        let guard = self.at(a, newest)?;
        let goal = self.goal::<Max>(guard, self.at(b, newest)?);
        let mut value = step_since(guard, goal, track);
        if let Some(to) = window.to {
            let first = sample.saturating_sub(to);
            let within = track.window.slide::<Max>(Some(first), Some((newest, goal)));
            value = Min::pick(value, within);
        }
        Some(Min::pick(value, after))
    }
}

/// Advances an unbounded since by a sample.
///
/// φ S ψ at t = max(ψ(t), min(φ(t), φ S ψ at t − 1)): a single number carries the
/// whole past (Havelund, Roşu 2002, for truth values).
pub(super) fn step_since(guard: f64, goal: f64, track: &mut Track) -> f64 {
    let before = track.carried.unwrap_or(f64::NEG_INFINITY);
    let value = Max::pick(goal, Min::pick(guard, before));
    track.carried = Some(value);
    value
}

/// Advances a rise or a fall by a sample.
pub(super) fn step_edge(edge: Edge, value: f64, track: &mut Track) -> f64 {
    let current = match edge {
        Edge::Rise => value,
        Edge::Fall => opposite(value),
    };
    // `prev` of any operand is +inf at the first sample.
    let before = track.carried.replace(current);
    Min::pick(before.map_or(f64::INFINITY, opposite), current)
}
