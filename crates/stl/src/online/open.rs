//! Operators whose undecided values need not be computed.
//!
//! `always φ` starts at the upper bounds of φ, and `eventually φ` at the lower. An
//! undecided `eventually[0, 2] p` can still be +inf, so it adds nothing to an
//! `always`. The monitor then needs the decided values alone, in O(1) per sample.

use crate::apply::Bound;
use crate::program::{BooleanOp, BoundProgram, Id, MinMax, Op};

/// Properties of the undecided values of every operator.
pub(super) struct OpenBounds {
    all: Vec<OpenBound>,
}

#[derive(Clone, Copy)]
struct OpenBound {
    /// Every undecided value has the lower bound −inf.
    lower: bool,
    /// Every undecided value has the upper bound +inf.
    upper: bool,
    /// Number of samples after which the last window of the operator begins.
    begin: usize,
}

impl OpenBounds {
    pub(super) fn new(program: &BoundProgram) -> OpenBounds {
        let mut all = OpenBounds {
            all: Vec::with_capacity(program.instructions.len()),
        };
        for id in 0..program.instructions.len() {
            let bound = all.operator(program, id);
            all.all.push(bound);
        }
        all
    }

    /// Returns true if the bound is infinite at every undecided sample.
    pub(super) fn is_open(&self, id: Id, bound: Bound) -> bool {
        match bound {
            Bound::Lower => self.all[id].lower,
            Bound::Upper => self.all[id].upper,
        }
    }

    /// Returns the number of samples after which the last window begins.
    ///
    /// In a trace of known length, that many of the last samples have windows that
    /// are empty for certain. They are decided early.
    pub(super) fn begin(&self, id: Id) -> usize {
        self.all[id].begin
    }

    fn operator(&self, program: &BoundProgram, id: Id) -> OpenBound {
        let instruction = program.get(id);
        let of = |id: Id| self.all[id];
        let begins = instruction.op.operands().map(|id| of(id).begin);
        let begin = begins.max().unwrap_or(0);
        let none = OpenBound {
            lower: false,
            upper: false,
            begin,
        };
        if program.is_instant(id) {
            // Never undecided.
            return OpenBound {
                lower: true,
                upper: true,
                begin: 0,
            };
        }
        // While a gate is undecided, so is the operand with the gate's horizon. If it
        // decides the gate, the other operand may have any bounds.
        let longest = |id: Id| program.get(id).horizon == instruction.horizon;
        let any = |a: (Id, bool), b: (Id, bool)| (longest(a.0) && a.1) || (longest(b.0) && b.1);
        match instruction.op {
            Op::Not(a) => OpenBound {
                lower: of(a).upper,
                upper: of(a).lower,
                begin,
            },
            Op::Gate(BooleanOp::And, a, b) => OpenBound {
                lower: any((a, of(a).lower), (b, of(b).lower)),
                ..none
            },
            Op::Gate(BooleanOp::Or, a, b) => OpenBound {
                upper: any((a, of(a).upper), (b, of(b).upper)),
                ..none
            },
            Op::Gate(BooleanOp::Implies, a, b) => OpenBound {
                upper: any((a, of(a).lower), (b, of(b).upper)),
                ..none
            },
            // An undecided window has samples to come, or an undecided operand. Without an
            // end, samples are always to come.
            Op::Ahead(side, window, a) => {
                let endless = window.to.is_none();
                OpenBound {
                    lower: side == MinMax::Min && (endless || of(a).lower),
                    upper: side == MinMax::Max && (endless || of(a).upper),
                    begin: begin.saturating_add(window.from),
                }
            }
            Op::Until(_, _, window, ..) => OpenBound {
                begin: begin.saturating_add(window.from),
                ..none
            },
            _ => none,
        }
    }
}
