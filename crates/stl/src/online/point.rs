//! Formula at sample 0, while samples arrive.

use super::nested::NestedProgress;
use super::progress::{WindowProgress, opened};
use super::track::Track;
use crate::apply::EvalWindow;
use crate::interval::Interval;
use crate::program::{BooleanOp, BoundProgram, Id, MinMax, Strength};
use crate::settings::Until;
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, fold};

/// Sub-formula at sample 0.
#[derive(Clone, Debug)]
pub(super) enum Point {
    /// Operator of the first sample only, known once that sample is.
    Present {
        id: Id,
        value: Option<f64>,
    },
    /// Operator whose value is read from its own track.
    Track {
        id: Id,
    },
    Not(Box<Point>),
    Gate(BooleanOp, Box<Point>, Box<Point>),
    Window(WindowProgress, MinMax, Id),
    Nested(NestedProgress, MinMax),
    Until(WindowProgress, MinMax, Strength, Id, Id),
}

impl Point {
    pub(super) fn reset(&mut self) {
        match self {
            Point::Present { value, .. } => *value = None,
            Point::Track { .. } => {}
            Point::Not(a) => a.reset(),
            Point::Gate(_, a, b) => {
                a.reset();
                b.reset();
            }
            Point::Window(watch, ..) | Point::Until(watch, ..) => {
                *watch = WindowProgress::new(watch.window, watch.horizon)
            }
            Point::Nested(nested, _) => nested.reset(),
        }
    }

    pub(super) fn update(
        &mut self,
        program: &BoundProgram,
        reading: &EvalWindow,
        tracks: &[Track],
    ) -> Interval {
        match self {
            Point::Present { id, value } => {
                // The first value stays, since later samples do not change it.
                let value = *value.get_or_insert(tracks[*id].now);
                Interval::exactly(value)
            }
            Point::Track { id } => {
                let operand = tracks[*id].operand();
                let (lo, hi) = (operand.lower.at(0), operand.upper.at(0));
                Interval {
                    // Before its first sample the track allows any value.
                    lo: lo.unwrap_or(f64::NEG_INFINITY),
                    hi: hi.unwrap_or(f64::INFINITY),
                }
            }
            Point::Not(a) => a.update(program, reading, tracks).negated(),
            Point::Gate(gate, a, b) => {
                let a = a.update(program, reading, tracks);
                let b = b.update(program, reading, tracks);
                Interval {
                    lo: gate.at(a.lo, a.hi, b.lo, b.hi),
                    hi: gate.at(a.hi, a.lo, b.hi, b.lo),
                }
            }
            Point::Window(watch, MinMax::Min, id) => {
                window::<Min>(watch, program, *id, reading, tracks)
            }
            Point::Window(watch, MinMax::Max, id) => {
                window::<Max>(watch, program, *id, reading, tracks)
            }
            Point::Nested(nested, MinMax::Min) => nested.update::<Min>(reading, tracks),
            Point::Nested(nested, MinMax::Max) => nested.update::<Max>(reading, tracks),
            Point::Until(watch, MinMax::Max, strength, a, b) => {
                until::<Max>(watch, *strength, &tracks[*a], &tracks[*b], reading)
            }
            Point::Until(watch, MinMax::Min, strength, a, b) => {
                until::<Min>(watch, *strength, &tracks[*a], &tracks[*b], reading)
            }
        }
    }
}

fn window<E: Extremum>(
    watch: &mut WindowProgress,
    program: &BoundProgram,
    id: Id,
    reading: &EvalWindow,
    tracks: &[Track],
) -> Interval {
    let mut folded = watch.folded.unwrap_or(E::NEUTRAL);
    let now = reading.known - 1;
    let interval = if program.is_instant(id) {
        // Each sample of such an operand is final and enters once.
        // At sample 0 the offsets of a window are sample numbers.
        if watch.window.from <= now && watch.window.to.is_none_or(|to| now <= to) {
            folded = E::pick(folded, tracks[id].now);
        }
        Interval::exactly(folded)
    } else {
        let (last, settled) = watch.last(reading);
        let operand = tracks[id].operand();
        folded = watch.settle::<E>(settled, operand.lower);
        let next = watch.next.max(watch.window.from);
        // Pending samples are read again each time and never folded in.
        let pending = (last + 1).saturating_sub(next);
        let with =
            |values: &[f64]| E::pick(folded, fold::<E>(&values[..pending.min(values.len())]));
        Interval {
            lo: with(operand.lower.from(next)),
            hi: with(operand.upper.from(next)),
        }
    };
    watch.folded = Some(folded);
    if watch.is_open(reading) {
        opened::<E>(interval)
    } else {
        interval
    }
}

fn until<E: Extremum>(
    watch: &mut WindowProgress,
    strength: Strength,
    left: &Track,
    right: &Track,
    reading: &EvalWindow,
) -> Interval {
    let (left, right) = (left.operand(), right.operand());
    let (last, settled) = watch.last(reading);
    let from = watch.window.from;
    let run =
        |state: (f64, f64), samples: std::ops::Range<usize>, guards: &[f64], goals: &[f64]| {
            let mut state = state;
            for ((t, guard), goal) in samples.zip(guards).zip(goals) {
                let (best, held) = state;
                let goal = if reading.until == Until::Closed {
                    E::Dual::pick(*guard, *goal)
                } else {
                    *goal
                };
                let best = if from <= t {
                    E::pick(best, E::Dual::pick(goal, held))
                } else {
                    best
                };
                // Afterwards, since the left side must hold before a goal and not at
                // it.
                state = (best, E::Dual::pick(held, *guard));
            }
            state
        };
    let mut state = (
        watch.folded.unwrap_or(E::NEUTRAL),
        watch.guard.unwrap_or(E::Dual::NEUTRAL),
    );
    // Settled samples advance the state for good.
    if watch.next < settled {
        let at = watch.next;
        state = run(
            state,
            at..settled,
            left.lower.from(at),
            right.lower.from(at),
        );
        watch.next = settled;
        (watch.folded, watch.guard) = (Some(state.0), Some(state.1));
    }
    let at = watch.next;
    // Undecided samples run on a copy, as their bounds still change.
    let lower = run(
        state,
        at..last + 1,
        left.lower.from(at),
        right.lower.from(at),
    );
    let upper = run(
        state,
        at..last + 1,
        left.upper.from(at),
        right.upper.from(at),
    );
    let mut interval = Interval {
        lo: lower.0,
        hi: upper.0,
    };
    if watch.is_open(reading) {
        // The goal may still occur, as long as the left side has held so far.
        if E::NEUTRAL == f64::NEG_INFINITY {
            interval.hi = E::pick(interval.hi, upper.1)
        } else {
            interval.lo = E::pick(interval.lo, lower.1)
        }
    }
    if strength == Strength::Weak {
        // The left side counts from the present on, not from the window's start.
        let throughout = WindowProgress {
            window: SampleWindow {
                from: 0,
                ..watch.window
            },
            ..watch.clone()
        };
        let mut held = Interval {
            lo: lower.1,
            hi: upper.1,
        };
        if throughout.is_open(reading) {
            held = opened::<E::Dual>(held);
        }
        interval = Interval {
            lo: E::pick(interval.lo, held.lo),
            hi: E::pick(interval.hi, held.hi),
        };
    }
    interval
}
