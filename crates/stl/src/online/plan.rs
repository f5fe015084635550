//! Which operators an online monitor keeps, for how long, and how far back.
//!
//! Two passes. The first goes down from the root as long as only the value at
//! sample 0 counts: those operators are points, which fold what has settled
//! into one number and keep no history. The second goes from the root to the
//! leaves and tells each operand how long and how far back it is read, the
//! most demanding reader deciding. `None` stands for "without an end" in all of
//! it, so a bound that is missing anywhere makes the sum or maximum `None`.

use super::point::{Point, Watch};
use crate::program::{Id, Op, Program};

/// What an operator is needed for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Need {
    /// The last sample at which it is brought up to date; `None`: always.
    pub(super) stop: Option<usize>,
    /// How many of its latest values are read again; `None`: all.
    pub(super) keep: Option<usize>,
    /// Whether more than the latest value is read.
    pub(super) stored: bool,
}

/// Watches the formula at sample 0.
pub(super) fn plan(program: &Program) -> (Point, Vec<(Id, Need)>) {
    let mut needs: Vec<Option<Need>> = vec![None; program.instructions.len()];
    let point = watch(program, program.root(), &mut needs);
    // Invariant: operands have lower numbers, so when an operator passes its
    // need on, all who read it have been asked.
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

fn watch(program: &Program, id: Id, needs: &mut [Option<Need>]) -> Point {
    let horizon = |id: Id| program.get(id).horizon;
    // The value at sample 0 is final when `horizon` more samples are known, so
    // nothing is needed after that. Until then the last `horizon` + 1 values
    // have not settled and are read again at each sample.
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
        // What is shared is tracked once; ways down to it double from level to
        // level.
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
        Op::Ahead(side, window, a) => {
            require(
                needs,
                a,
                Need {
                    stop: plus(window.to, horizon(a)),
                    ..open(a)
                },
            );
            Point::Window(Watch::new(window, horizon(a)), side, a)
        }
        Op::Until(side, strength, window, a, b) => {
            let both = horizon(a).zip(horizon(b)).map(|(a, b)| a.max(b));
            for id in [a, b] {
                let need = Need {
                    stop: plus(window.to, both),
                    keep: both.map(|h| h + 1),
                    stored: true,
                };
                require(needs, id, need);
            }
            Point::Until(Watch::new(window, both), side, strength, a, b)
        }
        // Past operators over future ones, at the start of the trace.
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
            stop: old.stop.zip(new.stop).map(|(a, b)| a.max(b)),
            keep: old.keep.zip(new.keep).map(|(a, b)| a.max(b)),
            stored: old.stored || new.stored,
        },
    };
    needs[id] = Some(merged);
}

/// What an operator that is needed needs of its operands.
fn pass_on(program: &Program, id: Id, need: Need, needs: &mut [Option<Need>]) {
    let instruction = program.get(id);
    let instant = program.is_instant(id);
    let plus = |a: Option<usize>, b: Option<usize>| a.zip(b).map(|(a, b)| a.saturating_add(b));
    // How far before the latest sample the first one lies that is redone.
    let redone = instruction.horizon;
    let (back, stored) = match instruction.op {
        Op::Constant(_) | Op::Leaf(_) => return,
        Op::Not(_) | Op::Gate(..) | Op::Edge(..) if instant => (redone, false),
        Op::Not(_) | Op::Gate(..) | Op::Ahead(..) | Op::Until(..) => (redone, true),
        Op::Behind(_, window, _) if instant => (Some(window.from), true),
        Op::Since(window, ..) if instant && window.to.is_none() && window.from == 0 => {
            (redone, false)
        }
        Op::Behind(_, window, _) | Op::Since(window, ..) => (plus(redone, window.to), true),
        Op::Edge(..) => (plus(redone, Some(1)), true),
    };
    for operand in instruction.op.operands() {
        // An operand is read as far back as its reader redoes, and its own
        // unsettled values must be there to be redone.
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
