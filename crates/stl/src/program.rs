//! Bound formula: operators over leaves, in an order with operands first.

use std::sync::Arc;

use crate::leaf::Leaf;
use crate::syntax::Node;
use crate::trace::Schema;
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, opposite};

/// Position of an operator in a [`BoundProgram`].
pub(crate) type Id = usize;

/// Minimum or maximum, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MinMax {
    Min,
    Max,
}

/// Operators on a single sample of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BooleanOp {
    And,
    Or,
    Implies,
    Iff,
    Xor,
}

impl BooleanOp {
    /// Returns the lower bound of the gate.
    ///
    /// `a` and `b` are lower bounds, `a_up` and `b_up` upper bounds. Exchange them to
    /// get the upper bound.
    #[inline(always)]
    pub(crate) fn at(self, a: f64, a_up: f64, b: f64, b_up: f64) -> f64 {
        match self {
            BooleanOp::And => Min::pick(a, b),
            BooleanOp::Or => Max::pick(a, b),
            BooleanOp::Implies => Max::pick(opposite(a_up), b),
            // These use each operand both as it is and negated, hence all four bounds.
            BooleanOp::Iff => Min::pick(Max::pick(opposite(a_up), b), Max::pick(a, opposite(b_up))),
            BooleanOp::Xor => Min::pick(Max::pick(a, b), Max::pick(opposite(a_up), opposite(b_up))),
        }
    }
}

/// Strength of an until.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strength {
    /// The right side must occur.
    Strong,
    /// The right side must occur, or the left side holds throughout.
    Weak,
}

#[derive(Clone, Debug)]
pub(crate) enum Op {
    /// `true` or `false`.
    Constant(bool),
    Leaf(Leaf),
    Not(Id),
    Gate(BooleanOp, Id, Id),
    /// `Min`: always, next. `Max`: eventually, strong next.
    Ahead(MinMax, SampleWindow, Id),
    /// `Min`: historically, prev. `Max`: once, strong prev.
    Behind(MinMax, SampleWindow, Id),
    /// `Max`: until, unless. `Min`: release.
    Until(MinMax, Strength, SampleWindow, Id, Id),
    Since(SampleWindow, Id, Id),
    Edge(Edge, Id),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Edge {
    Rise,
    Fall,
}

impl Op {
    pub(crate) fn operands(&self) -> impl Iterator<Item = Id> + use<> {
        let (a, b) = match *self {
            Op::Constant(_) | Op::Leaf(_) => (None, None),
            Op::Not(a) | Op::Ahead(_, _, a) | Op::Behind(_, _, a) | Op::Edge(_, a) => {
                (Some(a), None)
            }
            Op::Gate(_, a, b) | Op::Until(_, _, _, a, b) | Op::Since(_, a, b) => (Some(a), Some(b)),
        };
        a.into_iter().chain(b)
    }

    /// Returns the window of a temporal operator.
    pub(crate) fn window(&self) -> Option<SampleWindow> {
        match *self {
            Op::Ahead(_, window, _)
            | Op::Behind(_, window, _)
            | Op::Until(_, _, window, ..)
            | Op::Since(window, ..) => Some(window),
            Op::Constant(_) | Op::Leaf(_) | Op::Not(_) | Op::Gate(..) | Op::Edge(..) => None,
        }
    }

    /// Returns the same operator over other operands.
    pub(crate) fn over(&self, place: impl Fn(Id) -> Id) -> Op {
        match *self {
            Op::Constant(value) => Op::Constant(value),
            Op::Leaf(ref leaf) => Op::Leaf(leaf.clone()),
            Op::Not(a) => Op::Not(place(a)),
            Op::Gate(gate, a, b) => Op::Gate(gate, place(a), place(b)),
            Op::Ahead(side, window, a) => Op::Ahead(side, window, place(a)),
            Op::Behind(side, window, a) => Op::Behind(side, window, place(a)),
            Op::Until(side, strength, window, a, b) => {
                Op::Until(side, strength, window, place(a), place(b))
            }
            Op::Since(window, a, b) => Op::Since(window, place(a), place(b)),
            Op::Edge(edge, a) => Op::Edge(edge, place(a)),
        }
    }
}

/// Operator with properties that follow from its shape.
#[derive(Clone, Debug)]
pub(crate) struct Instruction {
    pub(crate) op: Op,
    /// Sub-formula that the operator represents.
    pub(crate) source: Arc<Node>,
    /// Number of samples it looks ahead, `None` for the rest of the trace.
    pub(crate) horizon: Option<usize>,
    /// Number of samples for which it still changes after its signals have settled.
    pub(crate) memory: usize,
    /// True if it contains no temporal operator.
    pub(crate) pointwise: bool,
    /// Number of operators that it is an operand of.
    pub(crate) uses: usize,
}

/// Bound formula, whose last instruction is the root.
#[derive(Clone, Debug)]
pub(crate) struct BoundProgram {
    pub(crate) instructions: Vec<Instruction>,
    /// Schema to which the formula is bound.
    pub(crate) schema: Schema,
}

impl BoundProgram {
    pub(crate) fn new(schema: &Schema) -> BoundProgram {
        BoundProgram {
            instructions: Vec::new(),
            schema: schema.clone(),
        }
    }

    pub(crate) fn root(&self) -> Id {
        self.instructions.len() - 1
    }

    pub(crate) fn get(&self, id: Id) -> &Instruction {
        &self.instructions[id]
    }

    /// Returns true if the value of a sample is known as soon as the sample is.
    pub(crate) fn is_instant(&self, id: Id) -> bool {
        self.get(id).horizon == Some(0)
    }

    /// Adds an operator, `None` if it looks further than `limit` samples.
    pub(crate) fn push(&mut self, op: Op, source: Arc<Node>, limit: usize) -> Option<Id> {
        let new = self.instruction(op, source);
        // The past counts too: a held trace is extended by that many samples.
        if limit < new.memory || new.horizon.is_some_and(|horizon| limit < horizon) {
            return None;
        }
        Some(self.add(new))
    }

    /// Adds an operator whose operands are already present.
    pub(crate) fn add(&mut self, instruction: Instruction) -> Id {
        for operand in instruction.op.operands() {
            self.instructions[operand].uses += 1;
        }
        self.instructions.push(instruction);
        self.instructions.len() - 1
    }

    /// Creates an operator over present operands, with its derived properties.
    pub(crate) fn instruction(&self, op: Op, source: Arc<Node>) -> Instruction {
        let (mut horizon, mut memory, mut pointwise) = (Some(0usize), 0usize, true);
        for operand in op.operands() {
            let operand = self.get(operand);
            // An operand that sees the whole rest makes its user do so too.
            horizon = horizon.zip(operand.horizon).map(|(a, b)| a.max(b));
            memory = memory.max(operand.memory);
            pointwise &= operand.pointwise;
        }
        match &op {
            Op::Ahead(_, window, _) | Op::Until(_, _, window, _, _) => {
                // Windows add up along a path, since an operand looks ahead from each sample.
                horizon = horizon.zip(window.to).map(|(a, b)| a.saturating_add(b));
                pointwise = false;
            }
            Op::Behind(_, window, _) | Op::Since(window, _, _) => {
                // An endless window settles once the last new sample has entered it.
                memory = memory.saturating_add(window.to.unwrap_or(window.from));
                pointwise = false;
            }
            Op::Edge(..) => {
                memory = memory.saturating_add(1);
                pointwise = false;
            }
            Op::Constant(_) | Op::Leaf(_) | Op::Not(_) | Op::Gate(..) => {}
        }
        Instruction {
            op,
            source,
            horizon,
            memory,
            pointwise,
            uses: 0,
        }
    }

    /// Returns true if no operator is an operand of two others.
    pub(crate) fn is_tree(&self) -> bool {
        self.instructions.iter().all(|i| i.uses <= 1)
    }

    /// Returns the positions of the signals read, ascending.
    pub(crate) fn signals(&self) -> Vec<usize> {
        let mut all = Vec::new();
        for instruction in &self.instructions {
            if let Op::Leaf(leaf) = &instruction.op {
                leaf.signals(&mut |signal| all.push(signal));
            }
        }
        all.sort_unstable();
        all.dedup();
        all
    }
}
