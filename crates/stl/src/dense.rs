//! Robustness in dense time, of samples at irregular times.

use std::sync::Arc;

use crate::leaf::{BoundExpression, ComparisonKind};
use crate::monitor::Monitor;
use crate::program::{BooleanOp, Id, MinMax, Op, Strength};
use crate::settings::{TraceEnd, Until};
use crate::syntax::{Arithmetic, NodeKind, Unary};
use crate::trace::{RowError, Schema};
use crate::trace_operators::{Max, Min, SampleWindow};

mod piecewise;

use piecewise::{LinearPiece, Piecewise};

/// Signals between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier sample, up to the later.
    Constant,
    /// The straight line between both. Boolean signals keep the earlier sample.
    Linear,
}

/// Run with samples at irregular times, which defines its signals at every time between.
///
/// The sampling period of the schema is the unit of the bounds of formulas: every
/// bound is a multiple of it. The samples need not be.
///
/// ```
/// use std::sync::Arc;
/// use brakecheck_stl::trace::{Schema, Signal};
/// use brakecheck_stl::{Constants, DenseTrace, Formula, Interpolation};
///
/// let schema = Arc::new(Schema::new(0.1, [Signal::real("x", "m", "position")])?);
/// let mut trace = DenseTrace::new(Arc::clone(&schema), Interpolation::Linear);
/// trace.push(0.0, &[0.0])?;
/// trace.push(0.8, &[4.0])?;
/// trace.push(1.3, &[2.0])?;
/// let formula: Formula = "always[0.4, 0.6] (x >= 1)".parse()?;
/// let monitor = formula.bind(&schema, &Constants::new())?;
/// assert_eq!(monitor.robustness_dense(&trace)?, 1.0); // x = 2 at 0.4 s.
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DenseTrace {
    schema: Arc<Schema>,
    interpolation: Interpolation,
    times_s: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

/// Sample that cannot follow in a [`DenseTrace`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DenseRowError {
    /// A time that is not finite, or not later than the time before.
    #[error("time {time_s} s at sample {sample} is not later than the time before")]
    Time {
        /// Refused time.
        time_s: f64,
        /// Sample index that the row would have had.
        sample: usize,
    },
    /// A value is NaN or infinite, or the row has another length.
    #[error(transparent)]
    Row(#[from] RowError),
}

/// Formula or setting without a meaning in dense time.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DenseError {
    /// `next`, `prev`, `rise` and the like refer to neighbouring samples.
    #[error("`{formula}` refers to neighbouring samples")]
    Step {
        /// Refused part of the formula.
        formula: String,
    },
    /// A comparison is not linear in the signals, so it is not linear between samples.
    #[error("`{formula}` is not linear in the signals")]
    NotLinear {
        /// Refused comparison.
        formula: String,
    },
    /// The monitor reads windows beyond the end by [`TraceEnd::Hold`] or
    /// [`TraceEnd::Strict`].
    #[error("dense time requires windows that are cut at the end")]
    End,
}

impl DenseTrace {
    /// Creates an empty run.
    pub fn new(schema: Arc<Schema>, interpolation: Interpolation) -> DenseTrace {
        DenseTrace {
            schema,
            interpolation,
            times_s: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Appends a sample of every signal, in schema order.
    ///
    /// # Errors
    /// A time that is not later than the last, a value that is not finite or a wrong
    /// length. The run is then unchanged.
    pub fn push(&mut self, time_s: f64, row: &[f64]) -> Result<(), DenseRowError> {
        let sample = self.times_s.len();
        let is_later = self.times_s.last().is_none_or(|last| *last < time_s);
        if !(time_s.is_finite() && is_later) {
            return Err(DenseRowError::Time { time_s, sample });
        }
        // Before either vector grows, so that an error leaves the run as it was.
        self.schema.check_row(row, sample)?;
        self.times_s.push(time_s);
        self.rows.push(row.to_vec());
        Ok(())
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.times_s.len()
    }

    /// Returns true if there is no sample.
    pub fn is_empty(&self) -> bool {
        self.times_s.is_empty()
    }

    /// Returns a function of the rows, linear between samples if `linear`.
    fn function(&self, linear: bool, value: impl Fn(&[f64]) -> f64) -> Piecewise {
        let points: Vec<f64> = self.rows.iter().map(|row| value(row)).collect();
        let pieces = points.windows(2).map(|pair| LinearPiece {
            start: pair[0],
            // The limit from the left: a held value jumps at the next sample only.
            end: if linear { pair[1] } else { pair[0] },
        });
        Piecewise {
            times: self.times_s.clone(),
            pieces: pieces.collect(),
            points,
        }
    }
}

impl Monitor {
    /// Returns the robustness at the first sample, over all times between samples.
    ///
    /// Always and eventually take the infimum and the supremum over their window, which
    /// ends with the last sample at the latest. These are exact, up to rounding: a
    /// piecewise linear function takes them at breakpoints, at the ends of the window
    /// or as a limit at a jump. Where two branches of a minimum cross, a breakpoint is
    /// added. The robustness of an empty run is −inf.
    ///
    /// The cost is O(n log n) in the samples for each operator. A window or a crossing
    /// adds breakpoints, so the cost grows with the depth of the formula.
    ///
    /// # Errors
    /// - An operator on neighbouring samples, such as `next` or `rise`.
    /// - With [`Interpolation::Linear`], a comparison that is not linear.
    /// - Another setting than [`TraceEnd::Truncate`].
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_dense(&self, trace: &DenseTrace) -> Result<f64, DenseError> {
        self.check(&trace.schema);
        if self.settings.end != TraceEnd::Truncate {
            return Err(DenseError::End);
        }
        let evaluation = DenseEvaluation {
            monitor: self,
            trace,
        };
        let mut values: Vec<Piecewise> = Vec::new();
        for id in 0..self.program.instructions.len() {
            // On an empty run too, so that a refusal depends on the formula alone.
            evaluation.check(id)?;
            if !trace.is_empty() {
                values.push(evaluation.operator(id, &values));
            }
        }
        // Operands precede their operators, so the whole formula comes last.
        let root = values.last().and_then(|root| root.points.first());
        // Adding 0 turns −0 into 0, as a sampled leaf does.
        Ok(self.clamp(root.copied().unwrap_or(f64::NEG_INFINITY) + 0.0))
    }
}

struct DenseEvaluation<'a> {
    monitor: &'a Monitor,
    trace: &'a DenseTrace,
}

impl DenseEvaluation<'_> {
    fn check(&self, id: Id) -> Result<(), DenseError> {
        let instruction = self.monitor.program.get(id);
        let formula = || instruction.source.to_string();
        if let Op::Leaf(leaf) = &instruction.op {
            // Held signals are constant between samples, and so is any function of
            // them.
            return if self.trace.interpolation == Interpolation::Linear
                && !is_linear(leaf.difference())
            {
                Err(DenseError::NotLinear { formula: formula() })
            } else {
                Ok(())
            };
        }
        // The text decides, since a compiled `next` looks like `always[1, 1]` in
        // samples.
        let step = matches!(
            instruction.source.kind,
            NodeKind::Unary(
                Unary::Next
                    | Unary::Prev
                    | Unary::StrongNext
                    | Unary::StrongPrev
                    | Unary::Rise
                    | Unary::Fall,
                ..
            )
        );
        if step {
            return Err(DenseError::Step { formula: formula() });
        }
        Ok(())
    }

    /// Evaluates an operator whose operands are evaluated.
    fn operator(&self, id: Id, values: &[Piecewise]) -> Piecewise {
        let of = |id: Id| &values[id];
        let times = &self.trace.times_s;
        match self.monitor.program.get(id).op {
            Op::Constant(true) => Piecewise::constant(times, f64::INFINITY),
            // Invariant: rises and falls are refused before.
            Op::Constant(false) | Op::Edge(..) => Piecewise::constant(times, f64::NEG_INFINITY),
            Op::Leaf(ref leaf) => {
                let linear = self.trace.interpolation == Interpolation::Linear;
                let difference = |row: &[f64]| leaf.difference().at(row);
                match leaf.shape() {
                    // The absolute value of a line has a kink where it is 0.
                    ComparisonKind::Equal if linear => {
                        absolute(&self.trace.function(true, difference)).negated()
                    }
                    ComparisonKind::NotEqual if linear => {
                        absolute(&self.trace.function(true, difference))
                    }
                    // A Boolean signal never has a value between true and false.
                    ComparisonKind::Boolean => self.trace.function(false, |row| leaf.at(row)),
                    _ => self.trace.function(linear, |row| leaf.at(row)),
                }
            }
            Op::Not(a) => of(a).clone().negated(),
            Op::Gate(gate, a, b) => apply(gate, of(a), of(b)),
            Op::Ahead(side, window, a) => self.ahead(side, window, of(a)),
            Op::Behind(side, window, a) => {
                // The past is the future in negated time.
                let reversed = of(a).clone().reversed();
                self.ahead(side, window, &reversed).reversed()
            }
            Op::Until(MinMax::Max, strength, window, a, b) => {
                self.until(strength, window, of(a), of(b))
            }
            // Release is the dual of until.
            Op::Until(MinMax::Min, strength, window, a, b) => {
                let (a, b) = (of(a).clone().negated(), of(b).clone().negated());
                self.until(strength, window, &a, &b).negated()
            }
            Op::Since(window, a, b) => {
                let (a, b) = (of(a).clone().reversed(), of(b).clone().reversed());
                self.until(Strength::Strong, window, &a, &b).reversed()
            }
        }
    }

    /// Returns the bounds of a window in seconds.
    fn seconds(&self, window: SampleWindow) -> (f64, Option<f64>) {
        let dt_s = self.trace.schema.dt_s();
        let seconds = |samples: usize| samples as f64 * dt_s;
        (seconds(window.from), window.to.map(seconds))
    }

    fn ahead(&self, side: MinMax, window: SampleWindow, a: &Piecewise) -> Piecewise {
        let (from, to) = self.seconds(window);
        match side {
            MinMax::Min => a.ahead::<Min>(from, to, false),
            MinMax::Max => a.ahead::<Max>(from, to, false),
        }
    }

    /// Until by the identity of the kernel, which holds in dense time as well.
    fn until(
        &self,
        strength: Strength,
        window: SampleWindow,
        guard: &Piecewise,
        goal: &Piecewise,
    ) -> Piecewise {
        let closed = self.monitor.settings.until == Until::Closed;
        let (from, to) = self.seconds(window);
        let mut value = guard.until(goal, closed);
        if window.to.is_some() {
            // A window of n samples is n − 1 periods long.
            let width = SampleWindow {
                from: 0,
                to: window.width().map(|width| width - 1),
            };
            // In the closed reading both sides must hold at the same instant.
            let within = if closed {
                self.ahead(MinMax::Max, width, &guard.combine::<Min>(goal))
            } else {
                self.ahead(MinMax::Max, width, goal)
            };
            value = value.combine::<Min>(&within);
        }
        if window.from != 0 {
            // A window of a single instant only shifts the function.
            let shifted = value.ahead::<Max>(from, Some(from), false);
            // The guard must also hold until the window begins.
            let before = guard.ahead::<Min>(0.0, Some(from), true);
            value = shifted.combine::<Min>(&before);
        }
        // A weak until needs no goal if its guard holds to the end of the window.
        if strength == Strength::Weak {
            value = value.combine::<Max>(&guard.ahead::<Min>(0.0, to, false));
        }
        value
    }
}

/// Returns true for a linear function of the signals, plus a constant.
fn is_linear(value: &BoundExpression) -> bool {
    let number = |side: &BoundExpression| matches!(side, BoundExpression::Number(_));
    match value {
        BoundExpression::Number(_) | BoundExpression::Signal(_) => true,
        BoundExpression::Negative(a) => is_linear(a),
        BoundExpression::Calculated(op, sides) => {
            let fits = match op {
                Arithmetic::Add | Arithmetic::Subtract => true,
                // A product of two signals would curve between samples.
                Arithmetic::Multiply => number(&sides.0) || number(&sides.1),
                Arithmetic::Divide => number(&sides.1),
            };
            fits && is_linear(&sides.0) && is_linear(&sides.1)
        }
        // Minima of lines are piecewise linear as well, but their kinks would need
        // breakpoints of their own.
        BoundExpression::Call(..) => false,
    }
}

fn absolute(function: &Piecewise) -> Piecewise {
    function.combine::<Max>(&function.clone().negated())
}

fn apply(gate: BooleanOp, a: &Piecewise, b: &Piecewise) -> Piecewise {
    let (not_a, not_b) = (a.clone().negated(), b.clone().negated());
    match gate {
        BooleanOp::And => a.combine::<Min>(b),
        BooleanOp::Or => a.combine::<Max>(b),
        BooleanOp::Implies => not_a.combine::<Max>(b),
        BooleanOp::Iff => {
            let there = not_a.combine::<Max>(b);
            there.combine::<Min>(&a.combine::<Max>(&not_b))
        }
        BooleanOp::Xor => {
            let either = a.combine::<Max>(b);
            either.combine::<Min>(&not_a.combine::<Max>(&not_b))
        }
    }
}
