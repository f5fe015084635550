//! Compilation of a bound formula to instants and points.

use super::{RunningInstant, RunningMonitor, RunningPoint};
use crate::monitor::Monitor;
use crate::program::{BoundProgram, Id, MinMax, Op};
use crate::settings::TraceEnd;
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, opposite};

impl Monitor {
    /// Compiles the formula for runs of `len` samples, if running numbers decide it.
    ///
    /// Every operator over the future must be at the top of the formula, over
    /// comparisons and operators of the past without bounds. Other formulas, and those
    /// of a [`TraceEnd`] other than `Truncate`, give `None` and need an
    /// [`OnlineMonitor`](crate::OnlineMonitor).
    pub fn running(&self, len: usize) -> Option<RunningMonitor> {
        // Other ends add samples, and a run of known length has none to add.
        if self.settings.end != TraceEnd::Truncate || len == 0 {
            return None;
        }
        let program = &self.program;
        let mut compiler = RunningCompiler {
            program,
            places: vec![None; program.instructions.len()],
            instants: Vec::new(),
            points: Vec::new(),
            carried: Vec::new(),
        };
        let root = compiler.point(program.root())?;
        let RunningCompiler {
            instants,
            mut points,
            carried,
            ..
        } = compiler;
        // The carried numbers come after those of the instants.
        let first = instants.len();
        points.iter_mut().for_each(|point| point.shift(first));
        let instants: Vec<RunningInstant> =
            instants.into_iter().map(|it| it.shifted(first)).collect();
        let mut begin = vec![0.0; first];
        begin.extend(carried);
        // Only then does every sample of the run count, which reading whole blocks
        // needs.
        let extremum = match (&points[root], &instants[..]) {
            (
                RunningPoint::Window {
                    side: MinMax::Min,
                    window,
                    instant,
                    folded,
                },
                [RunningInstant::Leaf(_)],
            ) if window.from == 0 && window.to.is_none_or(|to| len <= to + 1) => {
                Some((*instant, *folded))
            }
            _ => None,
        };
        Some(RunningMonitor {
            extremum,
            monitor: self.clone(),
            len,
            instants,
            points,
            root,
            begin,
        })
    }
}

struct RunningCompiler<'a> {
    program: &'a BoundProgram,
    /// RunningInstant of each operator.
    places: Vec<Option<usize>>,
    instants: Vec<RunningInstant>,
    points: Vec<RunningPoint>,
    /// First values of the numbers that are carried from sample to sample.
    carried: Vec<f64>,
}

impl RunningCompiler<'_> {
    fn carry(&mut self, first: f64) -> usize {
        self.carried.push(first);
        self.carried.len() - 1
    }

    fn instant(&mut self, id: Id) -> Option<usize> {
        if let Some(place) = self.places[id] {
            return Some(place);
        }
        // A value that later samples can change does not fit in one number.
        if !self.program.is_instant(id) {
            return None;
        }
        let instant = match self.program.get(id).op {
            Op::Constant(true) => RunningInstant::Constant(f64::INFINITY),
            Op::Constant(false) => RunningInstant::Constant(f64::NEG_INFINITY),
            Op::Leaf(ref leaf) => RunningInstant::Leaf(leaf.clone()),
            Op::Not(a) => RunningInstant::Not(self.instant(a)?),
            Op::Gate(gate, a, b) => RunningInstant::Gate(gate, self.instant(a)?, self.instant(b)?),
            Op::Edge(edge, a) => {
                let a = self.instant(a)?;
                // `prev` of any operand is +inf at the first sample.
                RunningInstant::Edge(edge, a, self.carry(f64::NEG_INFINITY))
            }
            Op::Since(window, a, b) if is_whole(window) => {
                let (a, b) = (self.instant(a)?, self.instant(b)?);
                RunningInstant::Since(a, b, self.carry(f64::NEG_INFINITY))
            }
            Op::Behind(side, window, a) if is_whole(window) => {
                let a = self.instant(a)?;
                RunningInstant::Past(side, a, self.carry(neutral(side)))
            }
            // A bounded past would have to remember samples instead of a number.
            _ => return None,
        };
        self.instants.push(instant);
        self.places[id] = Some(self.instants.len() - 1);
        self.places[id]
    }

    fn point(&mut self, id: Id) -> Option<usize> {
        let program = self.program;
        let point = if program.is_instant(id) {
            let instant = self.instant(id)?;
            // Nothing reads it before the first sample, and NaN would show a fault.
            let kept = self.carry(f64::NAN);
            RunningPoint::First { instant, kept }
        } else {
            match program.get(id).op {
                // The number of paths to shared operators doubles from level to level.
                _ if program.get(id).uses > 1 => return None,
                Op::Not(a) => RunningPoint::Not(self.point(a)?),
                Op::Gate(gate, a, b) => RunningPoint::Gate(gate, self.point(a)?, self.point(b)?),
                Op::Ahead(side, window, a) => RunningPoint::Window {
                    side,
                    window,
                    instant: self.instant(a)?,
                    folded: self.carry(neutral(side)),
                },
                Op::Until(side, strength, window, a, b) => RunningPoint::Until {
                    side,
                    strength,
                    window,
                    guard: self.instant(a)?,
                    goal: self.instant(b)?,
                    best: {
                        let best = self.carry(neutral(side));
                        // Directly behind the best value, where the until looks for it.
                        self.carry(opposite(neutral(side)));
                        best
                    },
                },
                _ => return None,
            }
        };
        self.points.push(point);
        Some(self.points.len() - 1)
    }
}

fn is_whole(window: SampleWindow) -> bool {
    window.from == 0 && window.to.is_none()
}

fn neutral(side: MinMax) -> f64 {
    match side {
        MinMax::Min => Min::NEUTRAL,
        MinMax::Max => Max::NEUTRAL,
    }
}

impl RunningInstant {
    fn shifted(self, by: usize) -> RunningInstant {
        match self {
            RunningInstant::Edge(edge, a, carried) => RunningInstant::Edge(edge, a, carried + by),
            RunningInstant::Since(a, b, carried) => RunningInstant::Since(a, b, carried + by),
            RunningInstant::Past(side, a, carried) => RunningInstant::Past(side, a, carried + by),
            it => it,
        }
    }
}

impl RunningPoint {
    fn shift(&mut self, by: usize) {
        match self {
            RunningPoint::First { kept: number, .. }
            | RunningPoint::Window { folded: number, .. }
            | RunningPoint::Until { best: number, .. } => *number += by,
            RunningPoint::Not(_) | RunningPoint::Gate(..) => {}
        }
    }
}
