//! Selection of the operators that an online monitor keeps.
//!
//! There are two passes. The first goes down from the root while only the value
//! at sample 0 counts. Those operators are points, which fold settled values into
//! a single number and keep no history. The second goes from the root to the
//! leaves and records for how long and how far back each operand is read. The most
//! demanding reader decides. `None` means "without an end" throughout, so a
//! missing bound makes any sum or maximum `None`.

use super::nested::{NestedForm, NestedProgress};
use super::open::OpenBounds;
use super::point::Point;
use super::progress::WindowProgress;
use crate::apply::Bound;
use crate::program::{BooleanOp, BoundProgram, Id, MinMax, Op};
use crate::trace_operators::SampleWindow;

/// Requirements on an operator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Need {
    /// Last sample at which it is updated, `None` for always.
    pub(super) stop: Option<usize>,
    /// Number of its latest values that are read again, `None` for all.
    pub(super) keep: Option<usize>,
    /// True if more than the latest value is read.
    pub(super) stored: bool,
    /// Number of known samples from which on undecided values are read, `None` for never.
    pub(super) opens: Option<usize>,
}

/// Operator in use.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlannedOperator {
    pub(super) id: Id,
    /// True if the value at a sample is known as soon as the sample is.
    pub(super) instant: bool,
    pub(super) need: Need,
}

/// Plans the evaluation of the formula at sample 0 of a trace of `len` samples.
pub(super) fn plan(program: &BoundProgram, len: Option<usize>) -> (Point, Vec<PlannedOperator>) {
    let mut planner = TrackPlanner {
        program,
        open: OpenBounds::new(program),
        len,
        needs: vec![None; program.instructions.len()],
    };
    let point = planner.watch(program.root());
    (point, finished(program, planner.needs))
}

/// Plans the evaluation of every operator at every sample, as soon as it is decided.
pub(super) fn plan_all(program: &BoundProgram) -> Vec<PlannedOperator> {
    let mut needs = vec![None; program.instructions.len()];
    let root = program.root();
    let need = Need {
        stop: None,
        // All undecided samples, which the end of the trace decides.
        keep: program.get(root).horizon.map(|h| h.saturating_add(1)),
        stored: true,
        opens: None,
    };
    require(&mut needs, root, need);
    finished(program, needs)
}

/// Passes the requirements on to all operands.
fn finished(program: &BoundProgram, mut needs: Vec<Option<Need>>) -> Vec<PlannedOperator> {
    // Invariant: operands have lower numbers. All readers of an operator have
    // therefore been visited before it passes its own need on.
    for id in (0..needs.len()).rev() {
        if let Some(need) = needs[id] {
            pass_on(program, id, need, &mut needs);
        }
    }
    let all = needs.into_iter().enumerate();
    let used = all.filter_map(|(id, need)| {
        Some(PlannedOperator {
            id,
            instant: program.is_instant(id),
            need: need?,
        })
    });
    used.collect()
}

struct TrackPlanner<'a> {
    program: &'a BoundProgram,
    open: OpenBounds,
    /// Number of samples of the whole trace, if known.
    len: Option<usize>,
    needs: Vec<Option<Need>>,
}

impl TrackPlanner<'_> {
    fn watch(&mut self, id: Id) -> Point {
        let program = self.program;
        match program.get(id).op {
            _ if program.is_instant(id) => {
                let first = Need {
                    stop: Some(0),
                    keep: Some(1),
                    stored: false,
                    opens: Some(0),
                };
                require(&mut self.needs, id, first);
                Point::Present { id, value: None }
            }
            // A shared operator is tracked once, because the number of paths down to it
            // doubles from level to level.
            _ if program.get(id).uses > 1 => self.track(id),
            Op::Not(a) => Point::Not(Box::new(self.watch(a))),
            Op::Gate(gate, a, b) => {
                Point::Gate(gate, Box::new(self.watch(a)), Box::new(self.watch(b)))
            }
            Op::Ahead(side, window, a) => self.window(side, window, a),
            Op::Until(side, strength, window, a, b) => {
                let horizon = |id: Id| program.get(id).horizon;
                let both = horizon(a).zip(horizon(b)).map(|(a, b)| a.max(b));
                for id in [a, b] {
                    // Both sides are folded together, so they settle with the later side.
                    let need = Need {
                        stop: plus(window.to, both),
                        keep: both.map(|h| h + 1),
                        stored: true,
                        opens: Some(0),
                    };
                    require(&mut self.needs, id, need);
                }
                Point::Until(WindowProgress::new(window, both), side, strength, a, b)
            }
            // Past operators over future operators, at the start of the trace.
            Op::Behind(..) | Op::Since(..) | Op::Edge(..) | Op::Constant(_) | Op::Leaf(_) => {
                self.track(id)
            }
        }
    }

    /// Plans `always a` or `eventually a`.
    ///
    /// A minimum of minima is split: it may then need the undecided values of one part
    /// only.
    fn window(&mut self, side: MinMax, window: SampleWindow, a: Id) -> Point {
        let program = self.program;
        let other = match side {
            MinMax::Min => MinMax::Max,
            MinMax::Max => MinMax::Min,
        };
        let parts = match (side, &program.get(a).op) {
            // As in `watch`, shared operators are not split.
            _ if program.is_instant(a) || program.get(a).uses > 1 => None,
            (_, Op::Not(inner)) => {
                return Point::Not(Box::new(self.window(other, window, *inner)));
            }
            (MinMax::Min, Op::Gate(gate @ BooleanOp::And, x, y))
            | (MinMax::Max, Op::Gate(gate @ BooleanOp::Or, x, y)) => Some((*gate, side, *x, *y)),
            // eventually (φ implies ψ) = (always φ) implies (eventually ψ)
            (MinMax::Max, Op::Gate(gate @ BooleanOp::Implies, x, y)) => {
                Some((*gate, other, *x, *y))
            }
            _ => None,
        };
        if let Some((gate, left, x, y)) = parts {
            let left = self.window(left, window, x);
            let right = self.window(side, window, y);
            return Point::Gate(gate, Box::new(left), Box::new(right));
        }
        // The operand is needed for the whole window, and its own horizon longer.
        let horizon = program.get(a).horizon;
        let mut need = Need {
            stop: plus(window.to, horizon),
            opens: self.opens(side, window, a),
            ..self.unsettled(a)
        };
        let watch = WindowProgress::new(window, horizon);
        // Decided values alone are cheaper, but without an end there are none. At the end of
        // the trace, one look at the undecided values is cheap.
        let early = |at: usize| self.len.is_none_or(|len| at < len);
        if horizon != Some(0)
            && (need.opens.is_some_and(early) || horizon.is_none())
            && let Some(form) = NestedForm::new(program, a)
        {
            for id in form.reads() {
                let latest = Need {
                    keep: Some(1),
                    stored: false,
                    ..need
                };
                require(&mut self.needs, id, latest);
            }
            if horizon.is_some() {
                need.opens = None;
                require(&mut self.needs, a, need);
            }
            return Point::Nested(NestedProgress::new(watch, a, form), side);
        }
        require(&mut self.needs, a, need);
        Point::Window(watch, side, a)
    }

    /// Returns the number of samples from which on a window reads undecided values.
    fn opens(&self, side: MinMax, window: SampleWindow, a: Id) -> Option<usize> {
        // Samples to come move one bound of an open window as far as possible. The other
        // bound needs the undecided values, unless they leave it alone.
        let bound = match side {
            MinMax::Min => Bound::Upper,
            MinMax::Max => Bound::Lower,
        };
        if !self.open.is_open(a, bound) {
            return Some(0);
        }
        let closed = window.to.map(|to| to.saturating_add(1));
        let empty = self.len.map(|len| len.saturating_sub(self.open.begin(a)));
        earliest(closed, empty)
    }

    fn track(&mut self, id: Id) -> Point {
        let need = self.unsettled(id);
        require(&mut self.needs, id, need);
        Point::Track { id }
    }

    /// Returns the need of an operator whose undecided values are read.
    ///
    /// The value at sample 0 is final once `horizon` more samples are known, so nothing
    /// is needed after that. Until then the last `horizon` + 1 values have not settled
    /// and are read again at each sample.
    fn unsettled(&self, id: Id) -> Need {
        let horizon = self.program.get(id).horizon;
        Need {
            stop: horizon,
            keep: horizon.map(|h| h + 1),
            stored: horizon != Some(0),
            opens: Some(0),
        }
    }
}

fn plus(a: Option<usize>, b: Option<usize>) -> Option<usize> {
    a.zip(b).map(|(a, b)| a.saturating_add(b))
}

/// Returns the smaller number, where `None` means never.
fn earliest(a: Option<usize>, b: Option<usize>) -> Option<usize> {
    a.into_iter().chain(b).min()
}

fn require(needs: &mut [Option<Need>], id: Id, new: Need) {
    let merged = match needs[id] {
        None => new,
        Some(old) => Need {
            // `zip` gives `None` if either is endless, which is the larger need.
            stop: old.stop.zip(new.stop).map(|(a, b)| a.max(b)),
            keep: old.keep.zip(new.keep).map(|(a, b)| a.max(b)),
            stored: old.stored || new.stored,
            opens: earliest(old.opens, new.opens),
        },
    };
    needs[id] = Some(merged);
}

/// Adds the requirements of an operator on its operands.
fn pass_on(program: &BoundProgram, id: Id, need: Need, needs: &mut [Option<Need>]) {
    let instruction = program.get(id);
    let instant = program.is_instant(id);
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
        // The same holds for the newest samples of both sides.
        Op::Since(window, ..) if instant => (Some(window.from), true),
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
                opens: need.opens,
            },
        );
    }
}
