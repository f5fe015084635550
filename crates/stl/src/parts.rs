//! Parts of a formula that can decide it: leaves, and operands of Boolean operators.

use std::sync::Arc;

use crate::monitor::Monitor;
use crate::program::{BoundProgram, Id, MinMax, Op};

/// Part of a formula, as the steps of explanations write it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormulaPart {
    /// Canonical text of the part.
    pub formula: String,
    /// Position of the smallest larger part that contains it. `None`: there is none.
    pub within: Option<usize>,
    /// True for a comparison or a Boolean signal.
    pub is_leaf: bool,
}

impl Monitor {
    /// Returns the leaves, and the operands of Boolean operators with several leaves.
    ///
    /// A part is behind the parts that contain it. An operand with a single leaf is left
    /// out, because it decides if and only if its leaf does. A part that occurs several
    /// times is returned once.
    pub fn parts(&self) -> Vec<FormulaPart> {
        let mut listing = PartListing {
            program: &self.program,
            leaves: leaf_counts(&self.program),
            visited: vec![false; self.program.instructions.len()],
            parts: Vec::new(),
        };
        listing.visit(self.program.root(), false, None);
        listing.parts
    }

    /// Returns the longest reach of an operator's bounds inside of a leading `always`.
    ///
    /// A violation of a formula with a reach of n samples may show n samples late. Bounds
    /// without an end count with their beginning, as in [`Monitor::longest_window_samples`].
    pub fn inner_window_samples(&self) -> usize {
        let mut inner = self.program.root();
        // A sample that violates an invariant shows it at once.
        while let Op::Ahead(MinMax::Min, _, operand) = self.program.get(inner).op {
            inner = operand;
        }
        let (mut open, mut longest) = (vec![inner], 0);
        let mut visited = vec![false; self.program.instructions.len()];
        while let Some(id) = open.pop() {
            if std::mem::replace(&mut visited[id], true) {
                continue;
            }
            let op = &self.program.get(id).op;
            let reach = op.window().map(|window| window.to.unwrap_or(window.from));
            longest = longest.max(reach.unwrap_or(0));
            open.extend(op.operands());
        }
        longest
    }
}

/// Number of leaves below each instruction, repeated ones counted again.
fn leaf_counts(program: &BoundProgram) -> Vec<usize> {
    let mut counts: Vec<usize> = Vec::with_capacity(program.instructions.len());
    for instruction in &program.instructions {
        // Operands come first, so their counts are known.
        let count = match instruction.op {
            Op::Leaf(_) => 1,
            ref op => op
                .operands()
                .fold(0, |sum: usize, id| sum.saturating_add(counts[id])),
        };
        counts.push(count);
    }
    counts
}

struct PartListing<'a> {
    program: &'a BoundProgram,
    leaves: Vec<usize>,
    /// Sharing could otherwise make the walk exponential.
    visited: Vec<bool>,
    parts: Vec<FormulaPart>,
}

impl PartListing<'_> {
    fn visit(&mut self, id: Id, is_operand: bool, within: Option<usize>) {
        if std::mem::replace(&mut self.visited[id], true) {
            return;
        }
        let instruction = self.program.get(id);
        let is_leaf = matches!(instruction.op, Op::Leaf(_));
        let mut inside = within;
        if is_leaf || (is_operand && self.leaves[id] > 1) {
            inside = Some(self.position(instruction.source.to_string(), within, is_leaf));
        }
        let is_gate = matches!(instruction.op, Op::Gate(..));
        for operand in instruction.op.operands() {
            // A conjunction of many is a chain of gates with one source.
            let continues = Arc::ptr_eq(&instruction.source, &self.program.get(operand).source);
            self.visit(operand, is_gate && !continues, inside);
        }
    }

    /// Returns the position of a part, which is added unless it is there.
    fn position(&mut self, formula: String, within: Option<usize>, is_leaf: bool) -> usize {
        // Equal texts decide alike, so one part stands for all of them.
        let known = self.parts.iter().position(|part| part.formula == formula);
        known.unwrap_or_else(|| {
            self.parts.push(FormulaPart {
                formula,
                within,
                is_leaf,
            });
            self.parts.len() - 1
        })
    }
}
