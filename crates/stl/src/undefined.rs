//! Comparisons with undefined values, each counted as the worst case.
//!
//! `d / v > 2` is undefined at d = v = 0, and so is `not (d / v > 2)`. A formula
//! holds only if it holds for any value of such a comparison. If a comparison is
//! not negated, its worst value is −inf. Under an odd number of negations it is
//! +inf. `iff`, `xor`, `rise` and `fall` use an operand in both ways. They are
//! therefore expanded here, and the operand is bound twice:
//!
//! ```text
//! φ iff ψ  =  (φ implies ψ) and (ψ implies φ)
//! φ xor ψ  =  (φ or ψ) and (φ implies not ψ)
//! rise φ   =  φ and prev not φ
//! fall φ   =  not φ and prev φ
//! ```
//!
//! These equal the operators bit for bit wherever every comparison has a value.
//! Formulas whose comparisons always have a value are left alone. The evaluation
//! of a program therefore never has to consider NaN.

use std::sync::Arc;

use crate::leaf::Undefined;
use crate::program::{BooleanOp, BoundProgram, Edge, Id, MinMax, Op};
use crate::syntax::{Node, NodeKind, Unary};
use crate::trace_operators::SampleWindow;

/// Gives every comparison that can be undefined its worst value.
pub(crate) fn settle(program: BoundProgram) -> BoundProgram {
    let doubtful = doubtful(&program);
    // No comparison can be undefined, so the program stays as it is.
    if !doubtful.contains(&true) {
        return program;
    }
    let uses = uses(&program);
    let mut settled = DefinedProgram {
        old: &program,
        new: BoundProgram::new(&program.schema),
        places: Vec::with_capacity(uses.len()),
    };
    for (id, (doubtful, uses)) in doubtful.into_iter().zip(uses).enumerate() {
        let places = match (doubtful, uses.fails, uses.holds) {
            // Used both ways, it needs a copy for either worst case.
            (true, true, true) => Places {
                fails: settled.operator(id, Undefined::Fails),
                holds: settled.operator(id, Undefined::Holds),
            },
            // An operator used in a single sense needs a single copy.
            (true, false, true) => Places::both(settled.operator(id, Undefined::Holds)),
            // Also an unused operator, whose value nothing reads.
            (true, ..) => Places::both(settled.operator(id, Undefined::Fails)),
            (false, ..) => Places::both(settled.copy(id)),
        };
        settled.places.push(places);
    }
    settled.new
}

/// Returns the operators with a comparison in them that can be undefined.
fn doubtful(program: &BoundProgram) -> Vec<bool> {
    let mut doubtful = Vec::with_capacity(program.instructions.len());
    for instruction in &program.instructions {
        let own = match &instruction.op {
            Op::Leaf(leaf) => leaf.can_be_undefined(),
            op => op.operands().any(|operand| doubtful[operand]),
        };
        doubtful.push(own);
    }
    doubtful
}

/// Senses in which an operator is used.
#[derive(Clone, Copy, Default)]
struct Uses {
    fails: bool,
    holds: bool,
}

impl Uses {
    fn negated(self) -> Uses {
        Uses {
            fails: self.holds,
            holds: self.fails,
        }
    }

    fn also(&mut self, other: Uses) {
        self.fails |= other.fails;
        self.holds |= other.holds;
    }
}

fn uses(program: &BoundProgram) -> Vec<Uses> {
    const BOTH: Uses = Uses {
        fails: true,
        holds: true,
    };
    let mut uses = vec![Uses::default(); program.instructions.len()];
    // The whole formula is not negated.
    uses[program.root()].fails = true;
    // Operators before their operands, so that senses are passed on completely.
    for (id, instruction) in program.instructions.iter().enumerate().rev() {
        let own = uses[id];
        match instruction.op {
            Op::Not(a) => uses[a].also(own.negated()),
            Op::Gate(BooleanOp::Implies, a, b) => {
                uses[a].also(own.negated());
                uses[b].also(own);
            }
            Op::Gate(BooleanOp::Iff | BooleanOp::Xor, a, b) => {
                uses[a].also(BOTH);
                uses[b].also(BOTH);
            }
            Op::Edge(_, a) => uses[a].also(BOTH),
            // The other operators are monotone, so they pass their sense on.
            ref op => op.operands().for_each(|operand| uses[operand].also(own)),
        }
    }
    uses
}

/// Position of an operator of the old program in the new program, per sense.
#[derive(Clone, Copy)]
struct Places {
    fails: Id,
    holds: Id,
}

impl Places {
    fn both(id: Id) -> Places {
        Places {
            fails: id,
            holds: id,
        }
    }
}

struct DefinedProgram<'a> {
    old: &'a BoundProgram,
    new: BoundProgram,
    places: Vec<Places>,
}

impl DefinedProgram<'_> {
    /// Adds an operator of the old program in one sense, after its operands.
    fn operator(&mut self, id: Id, sense: Undefined) -> Id {
        let instruction = self.old.get(id);
        let source = &instruction.source;
        let same = |id: Id| self.place(id, sense);
        let opposite = |id: Id| self.place(id, sense.opposite());
        let op = match instruction.op {
            Op::Leaf(ref leaf) => Op::Leaf(leaf.counting(sense)),
            Op::Not(a) => Op::Not(opposite(a)),
            Op::Gate(BooleanOp::Implies, a, b) => {
                Op::Gate(BooleanOp::Implies, opposite(a), same(b))
            }
            Op::Gate(BooleanOp::Iff, a, b) => {
                let there = Op::Gate(BooleanOp::Implies, opposite(a), same(b));
                let back = Op::Gate(BooleanOp::Implies, opposite(b), same(a));
                let (there, back) = (self.add(there, source), self.add(back, source));
                Op::Gate(BooleanOp::And, there, back)
            }
            Op::Gate(BooleanOp::Xor, a, b) => {
                let (a_fails, b_fails) = (opposite(a), Op::Not(opposite(b)));
                let one = Op::Gate(BooleanOp::Or, same(a), same(b));
                let (one, b_fails) = (self.add(one, source), self.add(b_fails, source));
                let implied = Op::Gate(BooleanOp::Implies, a_fails, b_fails);
                Op::Gate(BooleanOp::And, one, self.add(implied, source))
            }
            Op::Edge(edge, a) => {
                let (holds, fails) = (same(a), Op::Not(opposite(a)));
                // Sources of the added operators, so that explanations print them.
                let operand = &self.old.get(a).source;
                let negation = node(NodeKind::Not(operand.clone()), source);
                let fails = self.add(fails, &negation);
                let (now, before, was) = match edge {
                    Edge::Rise => (holds, fails, &negation),
                    Edge::Fall => (fails, holds, operand),
                };
                let previous = node(NodeKind::Unary(Unary::Prev, None, was.clone()), source);
                let before = self.add(Op::Behind(MinMax::Min, ONE, before), &previous);
                Op::Gate(BooleanOp::And, now, before)
            }
            ref op => op.over(same),
        };
        self.add(op, source)
    }

    /// Adds an operator in which nothing is ever undefined.
    fn copy(&mut self, id: Id) -> Id {
        let instruction = self.old.get(id);
        // Both places are the same for such operands.
        let op = instruction.op.over(|id| self.places[id].fails);
        self.add(op, &instruction.source)
    }

    fn place(&self, id: Id, sense: Undefined) -> Id {
        match sense {
            Undefined::Fails => self.places[id].fails,
            Undefined::Holds => self.places[id].holds,
        }
    }

    fn add(&mut self, op: Op, source: &Arc<Node>) -> Id {
        // Limits were checked before, and each operator becomes a handful at most.
        let instruction = self.new.instruction(op, source.clone());
        self.new.add(instruction)
    }
}

const ONE: SampleWindow = SampleWindow {
    from: 1,
    to: Some(1),
};

/// Creates a node for a part of `whole` that is not written there.
fn node(kind: NodeKind, whole: &Node) -> Arc<Node> {
    Arc::new(Node::new(kind, whole.span.0.clone()))
}
