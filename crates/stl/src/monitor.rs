//! Monitors: a trace to its robustness.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use crate::apply::Reading;
use crate::interval::Interval;
use crate::kernel::Tail;
use crate::leaf::{Columns, Question};
use crate::offline::{Evaluation, Scratch};
use crate::program::Program;
use crate::settings::{Settings, TraceEnd};
use crate::trace::{Schema, Trace};

/// A formula bound to a schema: evaluating it cannot fail.
///
/// Cheap to clone, and shared freely between threads.
#[derive(Clone, Debug)]
pub struct Monitor {
    pub(crate) program: Arc<Program>,
    pub(crate) settings: Settings,
}

impl Monitor {
    pub(crate) fn new(program: Program, settings: &Settings) -> Monitor {
        Monitor {
            program: Arc::new(program),
            settings: settings.clone(),
        }
    }

    /// The robustness ρ(φ, s, 0).
    ///
    /// ρ > 0 implies that the formula holds, ρ < 0 that it does not. Nothing
    /// is allocated once `scratch` has grown. An empty trace shows nothing:
    /// its robustness is −inf (−ρ_max where clamped).
    ///
    /// # Panics
    /// When the trace has other signals than the bound schema, by name or by
    /// order, or another sampling period. Units and kinds are not compared.
    pub fn robustness(&self, trace: &Trace, scratch: &mut Scratch) -> f64 {
        self.check(trace.schema());
        self.clamp(self.value(trace, trace.len(), Question::Margin, scratch))
    }

    /// Whether the formula holds at sample 0: the verdict, ties included.
    ///
    /// ρ > 0 is yes and ρ < 0 is no. At ρ = 0 the comparisons decide: `x >= 2`
    /// holds at x = 2 and `x > 2` does not. An empty trace satisfies nothing.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn satisfied(&self, trace: &Trace, scratch: &mut Scratch) -> bool {
        self.check(trace.schema());
        0.0 < self.value(trace, trace.len(), Question::Truth, scratch)
    }

    /// The robustness at every sample.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_all(&self, trace: &Trace) -> Vec<f64> {
        let mut all = Vec::new();
        self.robustness_into(trace, &mut Scratch::new(), &mut all);
        all
    }

    /// As [`Monitor::robustness_all`], into a vector whose memory is reused.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_into(&self, trace: &Trace, scratch: &mut Scratch, all: &mut Vec<f64>) {
        self.check(trace.schema());
        self.all_values(trace, trace.len(), scratch, all);
    }

    /// The robustness at every sample of `len`.
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
        let mut evaluation = self.evaluation(columns, len, reading, Question::Margin, scratch);
        let mut stretch = evaluation.run(self.program.root(), 0, len);
        std::mem::swap(all, &mut stretch.lower);
        evaluation.give_back(stretch);
        if self.settings.rho_max.is_some() {
            all.iter_mut().for_each(|value| *value = self.clamp(*value));
        }
    }

    /// The robustness at sample 0 that is possible when `trace` is only the
    /// beginning and nothing is known of the rest.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn interval(&self, trace: &Trace, scratch: &mut Scratch) -> Interval {
        self.check(trace.schema());
        self.still_possible(trace, trace.len(), scratch)
    }

    /// What is possible at sample 0 after the `len` first samples of a run.
    pub(crate) fn still_possible(
        &self,
        columns: &impl Columns,
        len: usize,
        scratch: &mut Scratch,
    ) -> Interval {
        if len == 0 {
            return Interval::ANY.map(|value| self.clamp(value));
        }
        let reading = Reading {
            known: len,
            bounded_len: usize::MAX,
            unbounded_len: usize::MAX,
            tail: Tail::Cut,
            until: self.settings.until,
        };
        let mut evaluation = self.evaluation(columns, len, reading, Question::Margin, scratch);
        let stretch = evaluation.run(self.program.root(), 0, 1);
        let lo = stretch.lower[0];
        let hi = stretch.upper.as_ref().map_or(lo, |upper| upper[0]);
        evaluation.give_back(stretch);
        Interval { lo, hi }.map(|value| self.clamp(value))
    }

    /// How many samples after the first one can matter; `None`: all of them.
    pub fn horizon_samples(&self) -> Option<usize> {
        self.program.get(self.program.root()).horizon
    }

    /// How many samples away any one operator's bounds reach, at most; bounds
    /// without an end count where they begin.
    pub fn longest_window_samples(&self) -> usize {
        let instructions = self.program.instructions.iter();
        let windows = instructions.filter_map(|instruction| instruction.op.window());
        let reaches = windows.map(|window| window.to.unwrap_or(window.from));
        reaches.max().unwrap_or(0)
    }

    /// The positions in a row of the signals that are read, ascending.
    pub fn signals(&self) -> Vec<usize> {
        self.program.signals()
    }

    /// The reading it was bound with.
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
        question: Question,
        scratch: &mut Scratch,
    ) -> f64 {
        if len == 0 {
            return f64::NEG_INFINITY;
        }
        let mut evaluation = self.evaluation(columns, len, self.reading(len), question, scratch);
        let stretch = evaluation.run(self.program.root(), 0, 1);
        let value = stretch.lower[0];
        evaluation.give_back(stretch);
        value
    }

    /// How a complete trace of `len` samples is read.
    pub(crate) fn reading(&self, len: usize) -> Reading {
        let until = self.settings.until;
        match self.settings.end {
            TraceEnd::Truncate => Reading {
                until,
                known: len,
                bounded_len: len,
                unbounded_len: len,
                tail: Tail::Cut,
            },
            TraceEnd::Strict => Reading {
                until,
                known: len,
                bounded_len: usize::MAX,
                unbounded_len: len,
                tail: Tail::Cut,
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
                Reading {
                    until,
                    known: len,
                    bounded_len: len,
                    unbounded_len: len,
                    tail: Tail::Held,
                }
            }
        }
    }

    pub(crate) fn evaluation<'a, C: Columns>(
        &'a self,
        columns: &'a C,
        recorded: usize,
        reading: Reading,
        question: Question,
        scratch: &'a mut Scratch,
    ) -> Evaluation<'a, C> {
        Evaluation {
            program: &self.program,
            columns,
            recorded,
            reading,
            question,
            scratch,
        }
    }

    pub(crate) fn check(&self, met: &Schema) {
        let bound = &self.program.schema;
        assert!(
            bound.has_rows_of(met),
            "a monitor for {} met a trace of {}",
            Rows(bound),
            Rows(met),
        );
    }
}

/// What a monitor goes by: the signals in order and the sampling period.
struct Rows<'a>(&'a Schema);

impl Display for Rows<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.names().collect();
        write!(f, "[{}] every {} s", names.join(", "), self.0.dt_s())
    }
}
