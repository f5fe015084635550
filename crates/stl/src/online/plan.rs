//! Selection of the operators that an online monitor keeps.
//!
//! There are two passes. The first goes down from the root while only the value
//! at sample 0 counts. Those operators are points, which fold settled values into
//! a single number and keep no history. The second goes from the root to the
//! leaves and records for how long and how far back each operand is read. The most
//! demanding reader decides. `None` means "without an end" throughout, so a
//! missing bound makes any sum or maximum `None`.

use super::point::{Point, WindowProgress};
use crate::program::{BoundProgram, Id, Op};

/// Requirements on an operator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Need {
    /// Last sample at which it is updated, `None` for always.
    pub(super) stop: Option<usize>,
    /// Number of its latest values that are read again, `None` for all.
    pub(super) keep: Option<usize>,
    /// True if more than the latest value is read.
    pub(super) stored: bool,
}

/// Plans the evaluation of the formula at sample 0.
pub(super) fn plan(program: &BoundProgram) -> (Point, Vec<(Id, Need)>) {
    let mut needs: Vec<Option<Need>> = vec![None; program.instructions.len()];
    let point = watch(program, program.root(), &mut needs);
    // Invariant: operands have lower numbers. All readers of an operator have
    // therefore been visited before it passes its own need on.
    for id in (0..needs.len()).rev() {
        if let Some(need) = needs[id] {
            pass_on(program, id, need, &mut needs);
        }
    }
    let needs = needs
        .into_iter()
        .enumerate()
        .filter_map(|(id, need)| Some((id, need?)))
        .collect();
    (point, needs)
}

fn watch(program: &BoundProgram, id: Id, needs: &mut [Option<Need>]) -> Point {
    let horizon = |id: Id| program.get(id).horizon;
    // The value at sample 0 is final once `horizon` more samples are known, so nothing
    // is needed after that. Until then the last `horizon` + 1 values have not settled
    // and are read again at each sample.
    let plus = |a: Option<usize>, b: Option<usize>| a.zip(b).map(|(a, b)| a.saturating_add(b));
    let open = |id: Id| Need {
        stop: horizon(id),
        keep: horizon(id).map(|h| h + 1),
        stored: horizon(id) != Some(0),
    };
    match program.get(id).op {
        _ if program.is_instant(id) => {
            require(
                needs,
                id,
                Need {
                    stop: Some(0),
                    keep: Some(1),
                    stored: false,
                },
            );
            Point::Present { id, value: None }
        }
        // A shared operator is tracked once, because the number of paths down to it
        // doubles from level to level.
        _ if 1 < program.get(id).uses => {
            require(needs, id, open(id));
            Point::Track { id }
        }
        Op::Not(a) => Point::Not(Box::new(watch(program, a, needs))),
        Op::Gate(gate, a, b) => Point::Gate(
            gate,
            Box::new(watch(program, a, needs)),
            Box::new(watch(program, b, needs)),
        ),
        // The operand is needed for the whole window, and its own horizon longer.
        Op::Ahead(side, window, a) => {
            require(
                needs,
                a,
                Need {
                    stop: plus(window.to, horizon(a)),
                    ..open(a)
                },
            );
            Point::Window(WindowProgress::new(window, horizon(a)), side, a)
        }
        Op::Until(side, strength, window, a, b) => {
            let both = horizon(a).zip(horizon(b)).map(|(a, b)| a.max(b));
            for id in [a, b] {
                // Both sides are folded together, so they settle with the later side.
                let need = Need {
                    stop: plus(window.to, both),
                    keep: both.map(|h| h + 1),
                    stored: true,
                };
                require(needs, id, need);
            }
            Point::Until(WindowProgress::new(window, both), side, strength, a, b)
        }
        // Past operators over future operators, at the start of the trace.
        Op::Behind(..) | Op::Since(..) | Op::Edge(..) | Op::Constant(_) | Op::Leaf(_) => {
            require(needs, id, open(id));
            Point::Track { id }
        }
    }
}

fn require(needs: &mut [Option<Need>], id: Id, new: Need) {
    let merged = match needs[id] {
        None => new,
        Some(old) => Need {
            // `zip` gives `None` if either is endless, which is the larger need.
            stop: old.stop.zip(new.stop).map(|(a, b)| a.max(b)),
            keep: old.keep.zip(new.keep).map(|(a, b)| a.max(b)),
            stored: old.stored || new.stored,
        },
    };
    needs[id] = Some(merged);
}

/// Adds the requirements of an operator on its operands.
fn pass_on(program: &BoundProgram, id: Id, need: Need, needs: &mut [Option<Need>]) {
    let instruction = program.get(id);
    let instant = program.is_instant(id);
    let plus = |a: Option<usize>, b: Option<usize>| a.zip(b).map(|(a, b)| a.saturating_add(b));
    // Distance of the first recomputed sample before the latest sample.
    let redone = instruction.horizon;
    let (back, stored) = match instruction.op {
        Op::Constant(_) | Op::Leaf(_) => return,
        Op::Not(_) | Op::Gate(..) | Op::Edge(..) if instant => (redone, false),
        Op::Not(_) | Op::Gate(..) | Op::Ahead(..) | Op::Until(..) => (redone, true),
        // The window's newest sample is read. Older samples stay in the track's queue.
        Op::Behind(_, window, _) if instant => (Some(window.from), true),
        Op::Since(window, ..) if instant && window.to.is_none() && window.from == 0 => {
            (redone, false)
        }
        Op::Behind(_, window, _) | Op::Since(window, ..) => (plus(redone, window.to), true),
        Op::Edge(..) => (plus(redone, Some(1)), true),
    };
    for operand in instruction.op.operands() {
        // An operand is read as far back as its reader recomputes. Its own unsettled
        // values must be kept as well, since they are recomputed.
        let own = program.get(operand).horizon;
        let keep = back
            .zip(own)
            .map(|(back, own)| back.max(own).saturating_add(2));
        require(
            needs,
            operand,
            Need {
                stop: need.stop,
                keep,
                stored,
            },
        );
    }
}
