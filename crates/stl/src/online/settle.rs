//! Update of all operators in use by a sample.

use super::plan::PlannedOperator;
use super::step::{Decided, step_edge, step_since};
use super::track::Track;
use crate::apply::{Bound, EvalWindow, KernelBuffers, Operands, apply};
use crate::program::{BoundProgram, Id, Op};
use crate::trace_operators::{Max, opposite};

/// Updates every operator in use.
///
/// Without a row, it updates only those that the end of the trace changes. With
/// `everything`, undecided samples are computed for every operator. Otherwise only
/// for those whose undecided samples are read.
#[inline]
pub(super) fn settle(
    program: &BoundProgram,
    needs: &[PlannedOperator],
    tracks: &mut [Track],
    reading: &EvalWindow,
    row: Option<&[f64]>,
    everything: bool,
    work: &mut KernelBuffers,
) {
    let now = reading.known - 1;
    for PlannedOperator { id, instant, need } in needs {
        // No reader needs it any more.
        if need.stop.is_some_and(|stop| stop < now) {
            continue;
        }
        // Invariant: operands have lower numbers than their operators. They are
        // therefore up to date, and the split keeps them readable.
        let (before, rest) = tracks.split_at_mut(*id);
        let Some(track) = rest.first_mut() else {
            continue;
        };
        let operands = Decided {
            program,
            tracks: before,
            until: reading.until,
            now,
        };
        if !instant {
            let open = everything || need.opens.is_some_and(|at| at <= reading.known);
            delayed(*id, track, operands, open.then_some(reading), work);
        } else if let Some(row) = row {
            track.now = present(*id, track, operands, row);
            if need.stored {
                track.store(now, track.now);
            }
        }
        if let Some(keep) = need.keep {
            track.trim(keep);
        }
    }
}

/// Updates an operator that needs later samples, with an open reading also undecided samples.
///
/// Not inlined, so that formulas of the present and the past stay fast.
#[inline(never)]
fn delayed(
    id: Id,
    track: &mut Track,
    operands: Decided<'_>,
    open: Option<&EvalWindow>,
    work: &mut KernelBuffers,
) {
    if let Some(reading) = open {
        redo(operands.program, id, track, operands.tracks, reading, work);
    } else if let Some((sample, value)) = operands.next(id, track) {
        track.store(sample, value);
    }
}

/// Returns the operands of an operator, equal for a unary operator.
fn operands<'a>(op: &Op, tracks: &'a [Track]) -> Option<Operands<'a>> {
    let mut ids = op.operands();
    let a = ids.next()?;
    let b = ids.next().unwrap_or(a);
    Some(Operands {
        a: tracks[a].operand(),
        b: tracks[b].operand(),
    })
}

/// Returns the latest value of an operator that needs no later sample.
#[inline(always)]
fn present(id: Id, track: &mut Track, operands: Decided<'_>, row: &[f64]) -> f64 {
    let tracks = operands.tracks;
    match operands.program.get(id).op {
        Op::Constant(true) => f64::INFINITY,
        Op::Constant(false) => f64::NEG_INFINITY,
        Op::Leaf(ref leaf) => leaf.at(row),
        // The operands of these need not be stored.
        Op::Not(a) => opposite(tracks[a].now),
        Op::Gate(gate, a, b) => {
            let (a, b) = (tracks[a].now, tracks[b].now);
            gate.at(a, a, b, b)
        }
        Op::Since(window, a, b) if window.to.is_none() && window.from == 0 => {
            let (guard, goal) = (tracks[a].now, tracks[b].now);
            step_since(guard, operands.goal::<Max>(guard, goal), track)
        }
        Op::Edge(edge, a) => step_edge(edge, tracks[a].now, track),
        Op::Behind(side, window, a) => operands.behind(side, window, a, operands.now, track),
        // Invariant: operands that are not read as the latest value are stored.
        _ => operands
            .next(id, track)
            .map_or(f64::NEG_INFINITY, |(_, value)| value),
    }
}

/// Recomputes the samples that have not settled.
///
/// A value at sample t is final once `horizon` later samples are known. One sample
/// ago that was true up to t = known − 2 − horizon, so the recomputation begins at
/// the next sample. Earlier values are never changed again.
fn redo(
    program: &BoundProgram,
    id: Id,
    track: &mut Track,
    tracks: &[Track],
    reading: &EvalWindow,
    work: &mut KernelBuffers,
) {
    let instruction = program.get(id);
    let from = instruction
        .horizon
        .map_or(0, |horizon| reading.known.saturating_sub(horizon + 1))
        .max(track.first);
    track.open(from, reading.known);
    let Some(operands) = operands(&instruction.op, tracks) else {
        return;
    };
    let skip = from - track.first;
    apply(
        &instruction.op,
        reading,
        operands,
        Bound::Lower,
        from,
        &mut track.lower[skip..],
        work,
    );
    apply(
        &instruction.op,
        reading,
        operands,
        Bound::Upper,
        from,
        &mut track.upper[skip..],
        work,
    );
}
