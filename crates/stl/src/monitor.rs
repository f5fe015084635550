//! Monitors, which map a trace to its robustness.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use crate::apply::EvalWindow;
use crate::interval::Interval;
use crate::leaf::{Columns, Semantics};
use crate::offline::{Scratch, TraceEvaluation};
use crate::program::BoundProgram;
use crate::settings::{Settings, TraceEnd};
use crate::trace::{Schema, Trace};
use crate::trace_operators::WindowTail;

/// Formula bound to a schema, whose evaluation cannot fail.
///
/// Cheap to clone, and safe to share between threads.
#[derive(Clone, Debug)]
pub struct Monitor {
    pub(crate) program: Arc<BoundProgram>,
    pub(crate) settings: Settings,
}

impl Monitor {
    pub(crate) fn new(program: BoundProgram, settings: &Settings) -> Monitor {
        Monitor {
            program: Arc::new(program),
            settings: settings.clone(),
        }
    }

    /// Returns the robustness ρ(φ, s, 0).
    ///
    /// ρ > 0 implies that the formula holds, ρ < 0 that it does not. Nothing is
    /// allocated once `scratch` has grown. The robustness of an empty trace is −inf,
    /// or −ρ_max if clamped.
    ///
    /// # Panics
    /// The trace has other signals than the bound schema, by name or by order, or
    /// another sampling period. Units and kinds are not compared.
    pub fn robustness(&self, trace: &Trace, scratch: &mut Scratch) -> f64 {
        self.check(trace.schema());
        self.clamp(self.value(trace, trace.len(), Semantics::Margin, scratch))
    }

    /// Returns true if the formula holds at sample 0, with ties decided.
    ///
    /// ρ > 0 gives true and ρ < 0 gives false. At ρ = 0 the comparisons decide:
    /// `x >= 2` holds at x = 2 and `x > 2` does not. An empty trace satisfies nothing.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn satisfied(&self, trace: &Trace, scratch: &mut Scratch) -> bool {
        self.check(trace.schema());
        self.value(trace, trace.len(), Semantics::Truth, scratch) > 0.0
    }

    /// Returns the robustness at every sample.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_all(&self, trace: &Trace) -> Vec<f64> {
        let mut all = Vec::new();
        self.robustness_into(trace, &mut Scratch::new(), &mut all);
        all
    }

    /// Computes [`Monitor::robustness_all`] into a reused vector.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_into(&self, trace: &Trace, scratch: &mut Scratch, all: &mut Vec<f64>) {
        self.check(trace.schema());
        self.all_values(trace, trace.len(), scratch, all);
    }

    /// Computes the robustness at each of `len` samples.
    pub(crate) fn all_values(
        &self,
        columns: &impl Columns,
        len: usize,
        scratch: &mut Scratch,
        all: &mut Vec<f64>,
    ) {
        if len == 0 {
            return all.clear();
        }
        let reading = self.reading(len);
        let mut evaluation = self.evaluation(columns, len, reading, Semantics::Margin, scratch);
        let mut stretch = evaluation.run(self.program.root(), 0, len);
        // Swapped instead of copied: the caller's old memory becomes scratch.
        std::mem::swap(all, &mut stretch.lower);
        evaluation.give_back(stretch);
        if self.settings.rho_max.is_some() {
            all.iter_mut().for_each(|value| *value = self.clamp(*value));
        }
    }

    /// Returns the possible robustness at sample 0 of a trace that goes on.
    ///
    /// `trace` is the beginning, and nothing is known of the rest.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn interval(&self, trace: &Trace, scratch: &mut Scratch) -> Interval {
        self.check(trace.schema());
        self.still_possible(trace, trace.len(), scratch)
    }

    /// Returns the possible robustness at sample 0 after the first `len` samples.
    pub(crate) fn still_possible(
        &self,
        columns: &impl Columns,
        len: usize,
        scratch: &mut Scratch,
    ) -> Interval {
        if len == 0 {
            return Interval::ANY.map(|value| self.clamp(value));
        }
        // Any length is possible, so every window that reaches further stays open.
        let reading = EvalWindow {
            known: len,
            bounded_len: usize::MAX,
            unbounded_len: usize::MAX,
            tail: WindowTail::Cut,
            until: self.settings.until,
        };
        let mut evaluation = self.evaluation(columns, len, reading, Semantics::Margin, scratch);
        let stretch = evaluation.run(self.program.root(), 0, 1);
        let lo = stretch.lower[0];
        let hi = stretch.upper.as_ref().map_or(lo, |upper| upper[0]);
        evaluation.give_back(stretch);
        Interval { lo, hi }.map(|value| self.clamp(value))
    }

    /// Returns the number of later samples that matter, `None` for all of them.
    pub fn horizon_samples(&self) -> Option<usize> {
        self.program.get(self.program.root()).horizon
    }

    /// Returns the longest reach of a single operator's bounds, in samples.
    ///
    /// Bounds without an end count with their beginning.
    pub fn longest_window_samples(&self) -> usize {
        let instructions = self.program.instructions.iter();
        let windows = instructions.filter_map(|instruction| instruction.op.window());
        let reaches = windows.map(|window| window.to.unwrap_or(window.from));
        reaches.max().unwrap_or(0)
    }

    /// Returns the positions in a row of the signals read, ascending.
    pub fn signals(&self) -> Vec<usize> {
        self.program.signals()
    }

    /// Returns the settings with which the formula was bound.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(crate) fn clamp(&self, value: f64) -> f64 {
        match self.settings.rho_max {
            Some(rho_max) => value.clamp(-rho_max, rho_max),
            None => value,
        }
    }

    pub(crate) fn value(
        &self,
        columns: &impl Columns,
        len: usize,
        question: Semantics,
        scratch: &mut Scratch,
    ) -> f64 {
        if len == 0 {
            // No sample, no evidence: an empty trace must never count as a success.
            return f64::NEG_INFINITY;
        }
        let mut evaluation = self.evaluation(columns, len, self.reading(len), question, scratch);
        let stretch = evaluation.run(self.program.root(), 0, 1);
        let value = stretch.lower[0];
        evaluation.give_back(stretch);
        value
    }

    /// Returns the reading of a complete trace of `len` samples.
    pub(crate) fn reading(&self, len: usize) -> EvalWindow {
        let until = self.settings.until;
        match self.settings.end {
            TraceEnd::Truncate => EvalWindow {
                until,
                known: len,
                bounded_len: len,
                unbounded_len: len,
                tail: WindowTail::Cut,
            },
            TraceEnd::Strict => EvalWindow {
                until,
                known: len,
                // Bounded windows may reach unknown samples. Unbounded windows end with the
                // trace by definition.
                bounded_len: usize::MAX,
                unbounded_len: len,
                tail: WindowTail::Cut,
            },
            TraceEnd::Hold => {
                // From here on every operator repeats its last value.
                let memory = self
                    .program
                    .instructions
                    .iter()
                    .map(|i| i.memory)
                    .max()
                    .unwrap_or(0);
                let len = len + memory;
                EvalWindow {
                    until,
                    known: len,
                    bounded_len: len,
                    unbounded_len: len,
                    tail: WindowTail::Held,
                }
            }
        }
    }

    pub(crate) fn evaluation<'a, C: Columns>(
        &'a self,
        columns: &'a C,
        recorded: usize,
        reading: EvalWindow,
        question: Semantics,
        scratch: &'a mut Scratch,
    ) -> TraceEvaluation<'a, C> {
        TraceEvaluation {
            program: &self.program,
            columns,
            recorded,
            reading,
            question,
            scratch,
        }
    }

    pub(crate) fn check(&self, schema: &Schema) {
        // Checked once per evaluation, so that no kernel needs to check columns.
        let bound = &self.program.schema;
        assert!(
            bound.has_rows_of(schema),
            "a monitor for {} met a trace of {}",
            Rows(bound),
            Rows(schema),
        );
    }
}

/// Signals in order and sampling period, which identify the rows of a monitor.
struct Rows<'a>(&'a Schema);

impl Display for Rows<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.names().collect();
        write!(f, "[{}] every {} s", names.join(", "), self.0.dt_s())
    }
}
