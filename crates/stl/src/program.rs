//! A bound formula: operators over leaves, in an order that has operands first.

use std::sync::Arc;

use crate::kernel::{Extremum, Max, Min, Window, opposite};
use crate::leaf::Leaf;
use crate::syntax::Node;
use crate::trace::Schema;

/// Where an operator stands in a [`Program`].
pub(crate) type Id = usize;

/// Minimum or maximum, as data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Min,
    Max,
}

/// Operators that look at one sample of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gate {
    And,
    Or,
    Implies,
    Iff,
    Xor,
}

impl Gate {
    /// The lower bound from lower bounds `a`, `b` and upper bounds `a_up`,
    /// `b_up`; with all bounds exchanged, the upper one.
    #[inline(always)]
    pub(crate) fn at(self, a: f64, a_up: f64, b: f64, b_up: f64) -> f64 {
        match self {
            Gate::And => Min::pick(a, b),
            Gate::Or => Max::pick(a, b),
            Gate::Implies => Max::pick(opposite(a_up), b),
            Gate::Iff => Min::pick(Max::pick(opposite(a_up), b), Max::pick(a, opposite(b_up))),
            Gate::Xor => Min::pick(Max::pick(a, b), Max::pick(opposite(a_up), opposite(b_up))),
        }
    }
}

/// What makes an until weak or strong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strength {
    /// The right side must come.
    Strong,
    /// Or the left side holds throughout.
    Weak,
}

#[derive(Clone, Debug)]
pub(crate) enum Op {
    /// `true` or `false`.
    Constant(bool),
    Leaf(Leaf),
    Not(Id),
    Gate(Gate, Id, Id),
    /// `Min`: always, next; `Max`: eventually, strong next.
    Ahead(Side, Window, Id),
    /// `Min`: historically, prev; `Max`: once, strong prev.
    Behind(Side, Window, Id),
    /// `Max`: until, unless; `Min`: release.
    Until(Side, Strength, Window, Id, Id),
    Since(Window, Id, Id),
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

    /// The samples that a temporal operator looks at.
    pub(crate) fn window(&self) -> Option<Window> {
        match *self {
            Op::Ahead(_, window, _)
            | Op::Behind(_, window, _)
            | Op::Until(_, _, window, ..)
            | Op::Since(window, ..) => Some(window),
            Op::Constant(_) | Op::Leaf(_) | Op::Not(_) | Op::Gate(..) | Op::Edge(..) => None,
        }
    }

    /// The same operator over other operands.
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

/// An operator and what is known about it from its shape.
#[derive(Clone, Debug)]
pub(crate) struct Instruction {
    pub(crate) op: Op,
    /// The sub-formula it stands for.
    pub(crate) source: Arc<Node>,
    /// How many samples ahead it looks; `None`: to the end of the trace.
    pub(crate) horizon: Option<usize>,
    /// How many samples after its signals have settled it still changes.
    pub(crate) memory: usize,
    /// Whether it has no temporal operator inside.
    pub(crate) pointwise: bool,
    /// How many operators it is an operand of.
    pub(crate) uses: usize,
}

/// A bound formula; the last instruction is the whole.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    pub(crate) instructions: Vec<Instruction>,
    /// What it is bound to.
    pub(crate) schema: Schema,
}

impl Program {
    pub(crate) fn new(schema: &Schema) -> Program {
        Program {
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

    /// Whether the value of a sample is known as soon as the sample is.
    pub(crate) fn is_instant(&self, id: Id) -> bool {
        self.get(id).horizon == Some(0)
    }

    /// Adds an operator; `None` when it looks further than `limit` samples.
    pub(crate) fn push(&mut self, op: Op, source: Arc<Node>, limit: usize) -> Option<Id> {
        let new = self.instruction(op, source);
        if limit < new.memory || new.horizon.is_some_and(|horizon| limit < horizon) {
            return None;
        }
        Some(self.add(new))
    }

    /// Adds an operator whose operands are there already.
    pub(crate) fn add(&mut self, instruction: Instruction) -> Id {
        for operand in instruction.op.operands() {
            self.instructions[operand].uses += 1;
        }
        self.instructions.push(instruction);
        self.instructions.len() - 1
    }

    /// An operator over what is there, with what follows from its shape.
    pub(crate) fn instruction(&self, op: Op, source: Arc<Node>) -> Instruction {
        let (mut horizon, mut memory, mut pointwise) = (Some(0usize), 0usize, true);
        for operand in op.operands() {
            let operand = self.get(operand);
            horizon = horizon.zip(operand.horizon).map(|(a, b)| a.max(b));
            memory = memory.max(operand.memory);
            pointwise &= operand.pointwise;
        }
        match &op {
            Op::Ahead(_, window, _) | Op::Until(_, _, window, _, _) => {
                horizon = horizon.zip(window.to).map(|(a, b)| a.saturating_add(b));
                pointwise = false;
            }
            Op::Behind(_, window, _) | Op::Since(window, _, _) => {
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

    /// Whether it is a tree: no operator is an operand of two.
    pub(crate) fn is_tree(&self) -> bool {
        self.instructions.iter().all(|i| i.uses <= 1)
    }

    /// Positions of the signals that are read, ascending.
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
