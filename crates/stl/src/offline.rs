//! Robustness of a whole trace, from each sample that matters, once.

use crate::apply::{Bound, EvalWindow, KernelBuffers, OperandBounds, Operands, apply, combine};
use crate::leaf::{CHUNK, Columns, Semantics};
use crate::program::{BoundProgram, Id, MinMax, Op};
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, View, WindowTail, fold, opposite};

/// Reusable memory of evaluations.
///
/// A scratch serves any number of monitors and traces. Once it has grown to the
/// largest of them, nothing is allocated any more.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    free: Vec<Vec<f64>>,
    pub(crate) work: KernelBuffers,
}

impl Scratch {
    /// Creates an empty scratch.
    pub fn new() -> Scratch {
        Scratch::default()
    }

    /// Takes the smallest free buffer that is large enough, else the largest.
    fn take(&mut self, len: usize) -> Vec<f64> {
        let fits = |buffer: &Vec<f64>| match buffer.capacity() {
            capacity if len <= capacity => (0, capacity),
            // The largest of the small ones has to grow least.
            capacity => (1, usize::MAX - capacity),
        };
        let best = (0..self.free.len()).min_by_key(|i| fits(&self.free[*i]));
        let mut buffer = best.map(|i| self.free.swap_remove(i)).unwrap_or_default();
        // Old contents may stay, as every user overwrites all of it.
        buffer.resize(len, 0.0);
        buffer
    }
}

/// Bounds of an operator at the samples `first ..`.
pub(crate) struct BoundsSeries {
    first: usize,
    pub(crate) lower: Vec<f64>,
    /// Upper bounds, `None` if they equal `lower`.
    pub(crate) upper: Option<Vec<f64>>,
}

impl BoundsSeries {
    fn operand(&self) -> OperandBounds<'_> {
        let view = |values| View {
            first: self.first,
            values,
        };
        OperandBounds {
            lower: view(&self.lower),
            upper: view(self.upper.as_ref().unwrap_or(&self.lower)),
        }
    }
}

/// Evaluation of a program over a trace.
pub(crate) struct TraceEvaluation<'a, C> {
    pub(crate) program: &'a BoundProgram,
    pub(crate) columns: &'a C,
    /// Samples in the columns. Beyond them the last sample is held.
    pub(crate) recorded: usize,
    pub(crate) reading: EvalWindow,
    pub(crate) question: Semantics,
    pub(crate) scratch: &'a mut Scratch,
}

impl<C: Columns> TraceEvaluation<'_, C> {
    /// Computes the bounds of `id` at the samples `from .. to`, at least one sample.
    pub(crate) fn run(&mut self, id: Id, from: usize, to: usize) -> BoundsSeries {
        // A tree returns buffers on the way up, so it needs little memory at a time.
        if self.program.is_tree() {
            self.descend(id, from, to)
        } else {
            self.ascend(id, from, to)
        }
    }

    /// Evaluates every operator once, operands first.
    ///
    /// On the way down, a shared operator would be evaluated once per path, and the
    /// number of paths doubles from level to level.
    fn ascend(&mut self, id: Id, from: usize, to: usize) -> BoundsSeries {
        let program = self.program;
        let last = self.reading.known - 1;
        let mut reached: Vec<Option<(usize, usize)>> = vec![None; id];
        reached.push(Some((from, to - 1)));
        // Users before operands, so that each operator knows all its readers.
        for id in (0..=id).rev() {
            let Some((from, to)) = reached[id] else {
                continue;
            };
            let op = &program.get(id).op;
            let (from, to) = self.reach(op, from, to, last);
            for operand in op.operands() {
                // A single range that covers all readers.
                let (first, end) = reached[operand].unwrap_or((from, to));
                reached[operand] = Some((first.min(from), end.max(to)));
            }
        }
        let mut done: Vec<Option<BoundsSeries>> = Vec::with_capacity(id + 1);
        for (id, reached) in reached.into_iter().enumerate() {
            let stretch = reached.map(|(from, to)| {
                let mut operands = program.get(id).op.operands();
                let mut operand = || operands.next().and_then(|id| done[id].as_ref());
                match (operand(), operand()) {
                    (Some(a), b) => self.operator(id, from, to + 1, a, b.unwrap_or(a)),
                    _ => self.pointwise(id, from, to + 1),
                }
            });
            done.push(stretch);
        }
        let whole = done.pop().flatten();
        done.into_iter().flatten().for_each(|s| self.give_back(s));
        // Invariant: the root was requested, so it is present.
        whole.unwrap_or_else(|| self.pointwise(id, from, to))
    }

    fn pointwise(&mut self, id: Id, from: usize, to: usize) -> BoundsSeries {
        let mut lower = self.scratch.take(to - from);
        for (i, out) in lower.chunks_mut(CHUNK).enumerate() {
            self.fill(id, from + i * CHUNK, out);
        }
        BoundsSeries {
            first: from,
            lower,
            upper: None,
        }
    }

    fn descend(&mut self, id: Id, from: usize, to: usize) -> BoundsSeries {
        let program = self.program;
        let instruction = program.get(id);
        if instruction.pointwise {
            return self.pointwise(id, from, to);
        }
        // The common monitor, `always φ` at sample 0, needs no stretch of φ at all.
        if let (Op::Ahead(side, window, child), 1) = (&instruction.op, to - from)
            && program.get(*child).pointwise
        {
            return self.scan(*side, *window, *child, from);
        }
        let mut operands = instruction.op.operands();
        let last = self.reading.known - 1;
        let (start, end) = self.reach(&instruction.op, from, to - 1, last);
        let a = operands.next().map(|a| self.descend(a, start, end + 1));
        let b = operands.next().map(|b| self.descend(b, start, end + 1));
        // Invariant: an operator that is not pointwise has an operand.
        let Some(a) = a else {
            return self.pointwise(id, from, to);
        };
        let stretch = self.operator(id, from, to, &a, b.as_ref().unwrap_or(&a));
        self.give_back(a);
        if let Some(b) = b {
            self.give_back(b);
        }
        stretch
    }

    /// Evaluates an operator from its operands, equal for a unary operator.
    fn operator(
        &mut self,
        id: Id,
        from: usize,
        to: usize,
        a: &BoundsSeries,
        b: &BoundsSeries,
    ) -> BoundsSeries {
        let program = self.program;
        let instruction = program.get(id);
        let operands = Operands {
            a: a.operand(),
            b: b.operand(),
        };
        let mut lower = self.scratch.take(to - from);
        let mut upper = None;
        // Operators of the past are exact as soon as their samples are known.
        if !self.reading.is_exact() && !program.is_instant(id) {
            let mut out = self.scratch.take(to - from);
            apply(
                &instruction.op,
                &self.reading,
                operands,
                Bound::Upper,
                from,
                &mut out,
                &mut self.scratch.work,
            );
            upper = Some(out);
        }
        apply(
            &instruction.op,
            &self.reading,
            operands,
            Bound::Lower,
            from,
            &mut lower,
            &mut self.scratch.work,
        );
        BoundsSeries {
            first: from,
            lower,
            upper,
        }
    }

    pub(crate) fn give_back(&mut self, stretch: BoundsSeries) {
        self.scratch.free.push(stretch.lower);
        self.scratch.free.extend(stretch.upper);
    }

    /// Returns the range of the operands' samples that matter for `from ..= to`.
    fn reach(&self, op: &Op, from: usize, to: usize, last: usize) -> (usize, usize) {
        let ahead =
            |window: SampleWindow| window.to.map_or(last, |b| to.saturating_add(b).min(last));
        let behind = |window: SampleWindow| window.to.map_or(0, |b| from.saturating_sub(b));
        match op {
            // Clamped, since a held tail still needs the last sample.
            Op::Ahead(_, window, _) => (from.saturating_add(window.from).min(last), ahead(*window)),
            // The left side counts from the present on, even before the window.
            Op::Until(_, _, window, ..) => (from, ahead(*window)),
            Op::Behind(_, window, _) => {
                let start = behind(*window);
                // A window before the first sample is empty, yet the range must not be
                // reversed.
                (start, to.saturating_sub(window.from).max(start))
            }
            Op::Since(window, ..) => (behind(*window), to),
            Op::Edge(..) => (from.saturating_sub(1), to),
            Op::Constant(_) | Op::Leaf(_) | Op::Not(_) | Op::Gate(..) => (from, to),
        }
    }

    /// Evaluates a pointwise operator at `from ..`, at most [`CHUNK`] samples.
    fn fill(&mut self, id: Id, from: usize, out: &mut [f64]) {
        let program = self.program;
        match &program.get(id).op {
            Op::Constant(true) => out.fill(self.truth()),
            Op::Constant(false) => out.fill(-self.truth()),
            Op::Leaf(leaf) => {
                let recorded = self.recorded.saturating_sub(from).min(out.len());
                let (known, held) = out.split_at_mut(recorded);
                leaf.fill(self.columns, self.question, from, known);
                if !held.is_empty() {
                    // One evaluation of the last sample serves all held samples.
                    let mut last = [0.0];
                    leaf.fill(self.columns, self.question, self.recorded - 1, &mut last);
                    held.fill(last[0]);
                }
            }
            Op::Not(a) => {
                self.fill(*a, from, out);
                out.iter_mut().for_each(|value| *value = opposite(*value));
            }
            Op::Gate(gate, a, b) => {
                // A whole chunk each time, so that the same two buffers serve every
                // call.
                let mut left = self.scratch.take(CHUNK);
                let mut right = self.scratch.take(CHUNK);
                let len = out.len();
                self.fill(*a, from, &mut left[..len]);
                self.fill(*b, from, &mut right[..len]);
                let (a, b) = (&left[..len], &right[..len]);
                // Pointwise values are exact, so both bounds are the same slice.
                combine(*gate, (a, a), (b, b), out);
                self.scratch.free.extend([left, right]);
            }
            // Invariant: temporal operators are never pointwise.
            _ => out.fill(f64::NEG_INFINITY),
        }
    }

    fn truth(&self) -> f64 {
        match self.question {
            Semantics::Margin => f64::INFINITY,
            Semantics::Truth => 1.0,
        }
    }

    /// Always / eventually at a single sample, in one pass without temporaries.
    fn scan(&mut self, side: MinMax, window: SampleWindow, child: Id, at: usize) -> BoundsSeries {
        let mut lower = self.scratch.take(1);
        let reading = self.reading;
        // A cut window beyond the end is empty, a held one repeats the last sample.
        let start = match reading.tail {
            WindowTail::Cut => at.saturating_add(window.from),
            WindowTail::Held => at.saturating_add(window.from).min(reading.known - 1),
        };
        let end = window.to.map_or(reading.known, |to| {
            at.saturating_add(to).saturating_add(1).min(reading.known)
        });
        let mut chunk = [0.0; CHUNK];
        let neutral = match side {
            MinMax::Min => Min::NEUTRAL,
            MinMax::Max => Max::NEUTRAL,
        };
        let (mut value, mut next) = (neutral, start);
        while next < end {
            let len = (end - next).min(CHUNK);
            let part = &mut chunk[..len];
            self.fill(child, next, part);
            value = match side {
                MinMax::Min => Min::pick(value, fold::<Min>(part)),
                MinMax::Max => Max::pick(value, fold::<Max>(part)),
            };
            next += len;
        }
        let len = reading.len(window);
        // Open: the window exists, and a part of it is not known yet.
        let is_open = reading.known < len
            && at.saturating_add(window.from) < len
            && window
                .to
                .is_none_or(|to| reading.known <= at.saturating_add(to));
        lower[0] = if is_open && side == MinMax::Min {
            f64::NEG_INFINITY
        } else {
            value
        };
        let mut upper = None;
        if !reading.is_exact() {
            let mut out = self.scratch.take(1);
            out[0] = if is_open && side == MinMax::Max {
                f64::INFINITY
            } else {
                value
            };
            upper = Some(out);
        }
        BoundsSeries {
            first: at,
            lower,
            upper,
        }
    }
}
