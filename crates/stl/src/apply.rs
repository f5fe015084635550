//! Single operators over stretches of their operands' values.
//!
//! Robustness is known only up to an interval while samples are missing. Every
//! operand therefore has a lower and an upper bound at every sample. If all
//! samples are known, both are the same slice. Offline and online monitors share
//! this file.

use crate::program::{BooleanOp, Edge, MinMax, Op, Strength};
use crate::settings::Until;
use crate::trace_operators::{
    self, Extremum, Max, Min, SampleWindow, View, WindowTail, merge, opposite,
};

/// End of the interval of possible values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bound {
    Lower,
    Upper,
}

impl Bound {
    pub(crate) fn opposite(self) -> Bound {
        match self {
            Bound::Lower => Bound::Upper,
            Bound::Upper => Bound::Lower,
        }
    }
}

/// Known part of the trace, and its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EvalWindow {
    pub(crate) until: Until,
    /// Number of samples known so far.
    pub(crate) known: usize,
    /// Trace length for bounded windows, `usize::MAX` if unknown.
    pub(crate) bounded_len: usize,
    /// Trace length for unbounded windows, `usize::MAX` if unknown.
    pub(crate) unbounded_len: usize,
    pub(crate) tail: WindowTail,
}

impl EvalWindow {
    /// Returns true if lower and upper bounds are the same everywhere.
    pub(crate) fn is_exact(&self) -> bool {
        self.bounded_len <= self.known && self.unbounded_len <= self.known
    }

    /// Returns the number of samples that a window can reach.
    pub(crate) fn len(&self, window: SampleWindow) -> usize {
        match window.to {
            Some(_) => self.bounded_len,
            None => self.unbounded_len,
        }
    }

    /// Returns the range of samples whose window includes unknown samples.
    fn open(&self, window: SampleWindow) -> Option<(usize, usize)> {
        let len = self.len(window);
        if len <= self.known {
            return None;
        }
        // A bounded window reaches an unknown sample from `known − to` on. An unbounded
        // window does so everywhere.
        let first = window.to.map_or(0, |to| self.known.saturating_sub(to));
        // A window that begins behind the end of the trace is empty for certain.
        let last = (len - 1).checked_sub(window.from)?;
        Some((first, last))
    }

    /// Returns the open part of `out`, whose first value is of sample `from`.
    fn open_part<'a>(
        &self,
        window: SampleWindow,
        from: usize,
        out: &'a mut [f64],
    ) -> (usize, &'a mut [f64]) {
        let Some((first, last)) = self.open(window) else {
            return (from, &mut []);
        };
        let begin = first.max(from);
        // Saturating, since an unknown length is `usize::MAX`.
        let end = last.saturating_add(1).min(from + out.len());
        (
            begin,
            if begin < end {
                &mut out[begin - from..end - from]
            } else {
                &mut []
            },
        )
    }
}

/// Operand with its bounds at consecutive samples.
#[derive(Clone, Copy)]
pub(crate) struct OperandBounds<'a> {
    pub(crate) lower: View<'a>,
    pub(crate) upper: View<'a>,
}

impl<'a> OperandBounds<'a> {
    pub(crate) fn bound(self, bound: Bound) -> View<'a> {
        match bound {
            Bound::Lower => self.lower,
            Bound::Upper => self.upper,
        }
    }
}

/// Both operands of an operator, equal for a unary operator.
#[derive(Clone, Copy)]
pub(crate) struct Operands<'a> {
    pub(crate) a: OperandBounds<'a>,
    pub(crate) b: OperandBounds<'a>,
}

/// A bound of both sides of an until.
#[derive(Clone, Copy)]
struct UntilSides<'a> {
    left: View<'a>,
    right: View<'a>,
}

/// Buffers for intermediate results of kernels.
#[derive(Clone, Debug, Default)]
pub(crate) struct KernelBuffers {
    window: Vec<f64>,
    goal: Vec<f64>,
    weak: Vec<f64>,
}

/// Computes a bound of `op` at the samples `from .. from + out.len()`.
///
/// Its operands cover the samples that the operator reads, as far as these are known.
pub(crate) fn apply(
    op: &Op,
    reading: &EvalWindow,
    operands: Operands<'_>,
    bound: Bound,
    from: usize,
    out: &mut [f64],
    work: &mut KernelBuffers,
) {
    let Operands { a, b } = operands;
    let (a_here, a_there) = (a.bound(bound), a.bound(bound.opposite()));
    let (b_here, b_there) = (b.bound(bound), b.bound(bound.opposite()));
    match *op {
        // Leaves are filled from the signals.
        Op::Constant(_) | Op::Leaf(_) => {}
        // Negation exchanges the bounds: the lower bound comes from the upper operand.
        Op::Not(_) => {
            for (out, value) in out.iter_mut().zip(a_there.from(from)) {
                *out = opposite(*value);
            }
        }
        Op::Gate(gate, ..) => {
            let a = (a_here.from(from), a_there.from(from));
            let b = (b_here.from(from), b_there.from(from));
            combine(gate, a, b, out);
        }
        Op::Ahead(MinMax::Min, window, _) => {
            ahead::<Min>(a_here, window, reading, bound, from, out)
        }
        Op::Ahead(MinMax::Max, window, _) => {
            ahead::<Max>(a_here, window, reading, bound, from, out)
        }
        Op::Behind(MinMax::Min, window, _) => {
            trace_operators::behind::<Min>(a_here, window, from, out)
        }
        Op::Behind(MinMax::Max, window, _) => {
            trace_operators::behind::<Max>(a_here, window, from, out)
        }
        Op::Until(side, strength, window, ..) => {
            let sides = UntilSides {
                left: a_here,
                right: b_here,
            };
            match side {
                MinMax::Max => until::<Max>(sides, window, reading, bound, from, out, work),
                MinMax::Min => until::<Min>(sides, window, reading, bound, from, out, work),
            }
            match (strength, side) {
                (Strength::Strong, _) => {}
                (Strength::Weak, MinMax::Max) => {
                    hold::<Max>(a_here, window, reading, bound, from, out, work)
                }
                (Strength::Weak, MinMax::Min) => {
                    hold::<Min>(a_here, window, reading, bound, from, out, work)
                }
            }
        }
        Op::Since(window, ..) => {
            let goal = goal::<Max>(a_here, b_here, reading.until, &mut work.goal);
            trace_operators::since(a_here, goal, window, from, out, &mut work.window);
        }
        Op::Edge(edge, _) => {
            // At a rise the operand holds now and failed before. At a fall its opposite
            // does.
            let (now, before) = match edge {
                Edge::Rise => (a_here, a_there),
                Edge::Fall => (a_there, a_here),
            };
            let flip = |value: f64, at: Edge| if edge == at { opposite(value) } else { value };
            for (t, out) in (from..).zip(out) {
                let previous = t.checked_sub(1).and_then(|t| before.at(t));
                // `prev` is weak, so before the first sample it holds.
                let earlier = previous.map_or(f64::INFINITY, |v| flip(v, Edge::Rise));
                let current = now.at(t).map_or(f64::NEG_INFINITY, |v| flip(v, Edge::Fall));
                *out = Min::pick(earlier, current);
            }
        }
    }
}

/// Applies a gate to slices: `(same bound, opposite bound)` of both operands.
pub(crate) fn combine(gate: BooleanOp, a: (&[f64], &[f64]), b: (&[f64], &[f64]), out: &mut [f64]) {
    let each = |out: &mut [f64], at: fn(f64, f64) -> f64| {
        for ((out, a), b) in out.iter_mut().zip(a.0).zip(b.0) {
            *out = at(*a, *b);
        }
    };
    match gate {
        BooleanOp::And => each(out, Min::pick),
        BooleanOp::Or => each(out, Max::pick),
        // These gates negate an operand, so they need its opposite bound as well.
        BooleanOp::Implies | BooleanOp::Iff | BooleanOp::Xor => {
            let sides = a.0.iter().zip(a.1).zip(b.0.iter().zip(b.1));
            for (out, ((a, a_up), (b, b_up))) in out.iter_mut().zip(sides) {
                *out = gate.at(*a, *a_up, *b, *b_up);
            }
        }
    }
}

/// Returns true if later samples can only move this bound of an extremum out.
fn is_moved<E: Extremum>(bound: Bound) -> bool {
    match bound {
        Bound::Lower => E::NEUTRAL == f64::INFINITY,
        Bound::Upper => E::NEUTRAL == f64::NEG_INFINITY,
    }
}

fn ahead<E: Extremum>(
    operand: View<'_>,
    window: SampleWindow,
    reading: &EvalWindow,
    bound: Bound,
    from: usize,
    out: &mut [f64],
) {
    trace_operators::ahead::<E>(operand, window, reading.tail, from, out);
    if is_moved::<E>(bound) {
        // Samples to come can move this bound as far as possible. They cannot move the
        // other bound outwards.
        reading
            .open_part(window, from, out)
            .1
            .fill(E::Dual::NEUTRAL);
    }
}

fn until<E: Extremum>(
    sides: UntilSides<'_>,
    window: SampleWindow,
    reading: &EvalWindow,
    bound: Bound,
    from: usize,
    out: &mut [f64],
    work: &mut KernelBuffers,
) {
    let UntilSides { left, right } = sides;
    let goal = goal::<E>(left, right, reading.until, &mut work.goal);
    trace_operators::until::<E>(
        left,
        goal,
        window,
        reading.tail,
        from,
        out,
        &mut work.window,
    );
    if is_moved::<E>(bound) {
        // The goal may still occur, as long as the left side has held so far.
        let (begin, open) = reading.open_part(window, from, out);
        if !open.is_empty() {
            work.weak.resize(open.len(), 0.0);
            trace_operators::suffix::<E::Dual>(left.from(begin), &mut work.weak);
            merge::<E>(open, &work.weak);
        }
    }
}

/// Joins an until with its left side throughout, which makes it weak.
fn hold<E: Extremum>(
    left: View<'_>,
    window: SampleWindow,
    reading: &EvalWindow,
    bound: Bound,
    from: usize,
    out: &mut [f64],
    work: &mut KernelBuffers,
) {
    // From the present on: the left side must hold before the window too.
    let throughout = SampleWindow {
        from: 0,
        to: window.to,
    };
    work.weak.resize(out.len(), 0.0);
    ahead::<E::Dual>(left, throughout, reading, bound, from, &mut work.weak);
    merge::<E>(out, &work.weak);
}

/// Returns the goal: the right side, joined by the left side in the closed reading.
fn goal<'a, E: Extremum>(
    left: View<'_>,
    right: View<'a>,
    until: Until,
    buffer: &'a mut Vec<f64>,
) -> View<'a> {
    if until == Until::HalfOpen {
        return right;
    }
    let first = left.first.max(right.first);
    buffer.clear();
    buffer.extend_from_slice(right.from(first));
    merge::<E::Dual>(buffer, left.from(first));
    View {
        first,
        values: buffer,
    }
}
