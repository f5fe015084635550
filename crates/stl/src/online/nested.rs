//! Windows over logic with one future operator, in amortised O(1).
//!
//! Such as `always (p implies always[0, 2] q)` or `always (p implies q until r)`. Each
//! new sample can change every undecided value of the operand. All of them change
//! in the same way, so their extremum is kept as a function of the samples to come.

use super::progress::{WindowProgress, opened};
use super::track::Track;
use crate::apply::EvalWindow;
use crate::interval::Interval;
use crate::program::{BooleanOp, BoundProgram, Id, MinMax, Op, Strength};
use crate::settings::Until;
use crate::sliding::{OpenPart, SlidingJoin, at};
use crate::trace_operators::{Extremum, Max, Min, SampleWindow};

/// Window over an operand that contains a single future operator.
#[derive(Clone, Debug)]
pub(super) struct NestedProgress {
    watch: WindowProgress,
    /// Operand of the window, whose decided values are folded.
    operand: Id,
    form: NestedForm,
    /// Undecided samples.
    open: SlidingJoin<OpenPart>,
    /// Number of samples read.
    seen: usize,
}

/// Operand of a window, from its future operator outwards.
#[derive(Clone, Debug)]
pub(super) struct NestedForm {
    future: Future,
    /// Logic around the future operator, innermost first.
    path: Vec<PathStep>,
    /// True if a larger future value makes the operand smaller.
    negated: bool,
}

/// Future operator whose window begins now, over operands of the present and the past.
#[derive(Clone, Copy, Debug)]
struct Future {
    side: MinMax,
    strength: Strength,
    window: SampleWindow,
    /// Left side of an until.
    guard: Option<Id>,
    goal: Id,
}

#[derive(Clone, Copy, Debug)]
enum PathStep {
    Not,
    /// The future operator is on the left side, and another operand on the right.
    Left(BooleanOp, Id),
    Right(Id, BooleanOp),
}

impl NestedForm {
    /// Returns the form of an operand, `None` if it has another form.
    pub(super) fn new(program: &BoundProgram, operand: Id) -> Option<NestedForm> {
        let (mut id, mut path, mut negated) = (operand, Vec::new(), false);
        let future = loop {
            match program.get(id).op {
                Op::Not(a) => {
                    path.push(PathStep::Not);
                    negated = !negated;
                    id = a;
                }
                // These use the future operator twice.
                Op::Gate(BooleanOp::Iff | BooleanOp::Xor, ..) => return None,
                Op::Gate(gate, a, b) if program.is_instant(b) => {
                    path.push(PathStep::Left(gate, b));
                    negated ^= gate == BooleanOp::Implies;
                    id = a;
                }
                Op::Gate(gate, a, b) if program.is_instant(a) => {
                    path.push(PathStep::Right(a, gate));
                    id = b;
                }
                ref op => break Future::new(program, op)?,
            }
        };
        // The walk went inwards, and values are computed outwards.
        path.reverse();
        Some(NestedForm {
            future,
            path,
            negated,
        })
    }

    /// Returns the operators whose latest value is read.
    pub(super) fn reads(&self) -> impl Iterator<Item = Id> {
        let logic = self.path.iter().filter_map(|step| match step {
            PathStep::Not => None,
            PathStep::Left(_, id) | PathStep::Right(id, _) => Some(*id),
        });
        logic.chain(self.future.guard).chain([self.future.goal])
    }

    /// Returns the operand and its future operator at a sample, the rest unknown.
    fn latest(&self, tracks: &[Track], until: Until) -> OpenPart {
        let future = self.future.latest(tracks, until);
        let mut value = future;
        for step in &self.path {
            value = match *step {
                PathStep::Not => value.negated(),
                PathStep::Left(gate, id) => gated(gate, value, Interval::exactly(tracks[id].now)),
                PathStep::Right(id, gate) => gated(gate, Interval::exactly(tracks[id].now), value),
            };
        }
        OpenPart {
            value,
            future: self.signed(future),
        }
    }

    /// Negates the future operator, so that the operand grows with it.
    fn signed(&self, future: Interval) -> Interval {
        if self.negated {
            future.negated()
        } else {
            future
        }
    }
}

impl Future {
    fn new(program: &BoundProgram, op: &Op) -> Option<Future> {
        let (side, strength, window, guard, goal) = match *op {
            Op::Ahead(side, window, a) => (side, Strength::Strong, window, None, a),
            Op::Until(side, strength, window, a, b) => (side, strength, window, Some(a), b),
            _ => return None,
        };
        // A window that begins later does not read the sample itself.
        let fits = window.from == 0
            && program.is_instant(goal)
            && guard.is_none_or(|guard| program.is_instant(guard));
        fits.then_some(Future {
            side,
            strength,
            window,
            guard,
            goal,
        })
    }

    /// Returns the bounds at the latest sample, from that sample alone.
    fn latest(self, tracks: &[Track], until: Until) -> Interval {
        match self.side {
            MinMax::Min => self.bounds::<Min>(tracks, until),
            MinMax::Max => self.bounds::<Max>(tracks, until),
        }
    }

    fn bounds<E: Extremum>(self, tracks: &[Track], until: Until) -> Interval {
        // Without a left side, samples to come always count.
        let guard = match self.guard {
            Some(guard) => tracks[guard].now,
            None => <E::Dual as Extremum>::NEUTRAL,
        };
        let mut goal = tracks[self.goal].now;
        if until == Until::Closed {
            goal = E::Dual::pick(guard, goal);
        }
        // u(t) = ψ(t) ⊕ (φ(t) ⊗ u(t + 1)), for the worst and the best u(t + 1).
        let with = |next: f64| E::pick(goal, E::Dual::pick(guard, next));
        Interval {
            lo: with(f64::NEG_INFINITY),
            hi: with(f64::INFINITY),
        }
    }

    /// Returns the values that the operator can have after the latest sample.
    fn after(self, reading: &EvalWindow) -> Interval {
        // While the trace may go on, any value can follow.
        if reading.known < reading.len(self.window) {
            return Interval::ANY;
        }
        // Nothing follows: an eventually fails, and an always or an unless holds.
        let holds = self.side == MinMax::Min || self.strength == Strength::Weak;
        Interval::exactly(if holds {
            f64::INFINITY
        } else {
            f64::NEG_INFINITY
        })
    }
}

impl NestedProgress {
    pub(super) fn new(watch: WindowProgress, operand: Id, form: NestedForm) -> NestedProgress {
        NestedProgress {
            watch,
            operand,
            form,
            open: SlidingJoin::default(),
            seen: 0,
        }
    }

    pub(super) fn reset(&mut self) {
        self.watch = WindowProgress::new(self.watch.window, self.watch.horizon);
        self.open.clear();
        self.seen = 0;
    }

    /// Not inlined, so that windows over the present and the past stay fast.
    #[inline(never)]
    pub(super) fn update<E: Extremum>(
        &mut self,
        reading: &EvalWindow,
        tracks: &[Track],
    ) -> Interval {
        let now = reading.known - 1;
        let (window, horizon) = (self.watch.window, self.watch.horizon);
        // The last sample of the window, and how many of the samples are decided.
        let last = window.to.map_or(now, |to| to.min(now));
        // Never more than the window contains, or later samples would be folded in.
        let decided = horizon
            .map_or(0, |horizon| reading.known.saturating_sub(horizon))
            .min(last + 1);
        let folded = self
            .watch
            .settle::<E>(decided, tracks[self.operand].operand().lower);
        let mut interval = Interval::exactly(folded);
        if decided <= last {
            // The end of the trace has no row.
            if self.seen < reading.known {
                self.read::<E>(now, reading.until, tracks);
            }
            let open = self.open.join::<E>();
            let next = self.form.signed(self.form.future.after(reading));
            if let Some(open) = open {
                // Each end may be mapped on its own, because the operand grows with its
                // future.
                interval = next.map(|z| E::pick(folded, at(open.value, z)));
            }
        }
        if self.watch.is_open(reading) {
            opened::<E>(interval)
        } else {
            interval
        }
    }

    fn read<E: Extremum>(&mut self, now: usize, until: Until, tracks: &[Track]) {
        let mut new = self.form.latest(tracks, until);
        let window = self.watch.window;
        if now < window.from || window.to.is_some_and(|to| to < now) {
            // Outside of the window a sample only changes the future of earlier samples.
            new.value = Interval::exactly(E::NEUTRAL);
        }
        self.open.push::<E>(self.watch.horizon, new);
        self.seen = now + 1;
    }
}

/// Applies a gate to bounds.
fn gated(gate: BooleanOp, a: Interval, b: Interval) -> Interval {
    Interval {
        lo: gate.at(a.lo, a.hi, b.lo, b.hi),
        hi: gate.at(a.hi, a.lo, b.hi, b.lo),
    }
}
