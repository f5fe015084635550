//! Explanation of a robustness by the leaf value that decides it.
//!
//! Logic applies only minimum, maximum and sign to numbers. A finite robustness
//! *is* therefore the value of a comparison at a sample, up to its sign. The path
//! down to it is the explanation.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use serde::{Serialize, Serializer};

use crate::apply::Bound;
use crate::leaf::{Columns, Semantics};
use crate::monitor::Monitor;
use crate::offline::{Scratch, TraceEvaluation};
use crate::program::{BooleanOp, Edge, Id, MinMax, Op};
use crate::samples::Samples;
use crate::settings::Until;
use crate::trace::Trace;
use crate::trace_operators::{SampleWindow, WindowTail};

/// Kind of the last step of an explanation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The last step is a comparison or a Boolean signal.
    Leaf,
    /// The last step is a comparison with an undefined value, such as 0/0.
    Undefined,
    /// The last step is `true` or `false`.
    Constant,
    /// The window of the last step contains no sample.
    EmptyWindow,
    /// The window of the last step reaches beyond the end of a strict trace.
    BeyondTheEnd,
    /// The trace is empty.
    EmptyTrace,
}

/// Formula on the path from the whole formula to the deciding leaf.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExplanationStep {
    /// Canonical text of the sub-formula.
    pub formula: String,
    /// Sample at which its value decides.
    pub sample: usize,
    /// Time of that sample.
    pub time_s: f64,
    /// Robustness of the sub-formula at that sample.
    #[serde(serialize_with = "serialize_number")]
    pub value: f64,
}

/// Leaf, time and value that decide a robustness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// Robustness of the whole formula at sample 0.
    #[serde(serialize_with = "serialize_number")]
    pub robustness: f64,
    /// Kind of the last step of the path.
    pub reason: Reason,
    /// Steps from the whole formula to the leaf, with the same |value| throughout.
    pub path: Vec<ExplanationStep>,
    /// Signals that the deciding leaf reads, with their values.
    pub signals: Vec<(String, f64)>,
}

impl Explanation {
    /// Returns the deciding sub-formula, `None` for an empty trace.
    pub fn leaf(&self) -> Option<&ExplanationStep> {
        self.path.last()
    }
}

/// Writes infinities as `"inf"` and `"-inf"`, since JSON has none.
fn serialize_number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_infinite() {
        serializer.serialize_str(if *value > 0.0 { "inf" } else { "-inf" })
    } else {
        // JSON has NaN as `null`, which is unknown.
        serializer.serialize_f64(*value)
    }
}

impl Display for Explanation {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "ρ = {}", Short(self.robustness))?;
        let Some(leaf) = self.leaf() else {
            return f.write_str(": the trace is empty");
        };
        let why = match self.reason {
            Reason::Leaf | Reason::Constant | Reason::EmptyTrace => "",
            Reason::Undefined => ", by a comparison whose value is no number",
            Reason::EmptyWindow => ", by a window without a sample",
            Reason::BeyondTheEnd => ", by a window that reaches beyond the trace",
        };
        write!(
            f,
            ", decided at {} s (sample {}){why}",
            Short(leaf.time_s),
            leaf.sample
        )?;
        for (depth, step) in self.path.iter().enumerate() {
            let (time, value) = (Short(step.time_s), Short(step.value));
            write!(
                f,
                "\n{:indent$}{}   at {time} s: {value}",
                "",
                step.formula,
                indent = 2 * depth + 2
            )?;
        }
        for (i, (name, value)) in self.signals.iter().enumerate() {
            write!(
                f,
                "{}{name} = {}",
                if i == 0 { "   with " } else { ", " },
                Short(*value)
            )?;
        }
        Ok(())
    }
}

/// Number with at most six decimal places, without trailing zeros.
struct Short(f64);

impl Display for Short {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let rounded = (self.0 * 1e6).round() / 1e6;
        // A small number must not print as 0.
        if rounded.is_finite() && (rounded != 0.0 || self.0 == 0.0) {
            // Adding 0 turns −0 into 0.
            write!(f, "{}", rounded + 0.0)
        } else if self.0.is_finite() {
            write!(f, "{:.0e}", self.0)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

impl Monitor {
    /// Explains the robustness by the leaf, the sample and the value that decide.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn explain(&self, trace: &Trace) -> Explanation {
        self.check(trace.schema());
        explain(self, trace, trace.len())
    }

    /// Explains like [`Monitor::explain`], for borrowed samples.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn explain_of(&self, samples: &Samples<'_>) -> Explanation {
        self.check(samples.schema());
        explain(self, samples, samples.len())
    }
}

/// Explains `len` samples of the signals to which the monitor is bound.
fn explain(monitor: &Monitor, columns: &impl Columns, len: usize) -> Explanation {
    let mut scratch = Scratch::new();
    let value = monitor.value(columns, len, Semantics::Margin, &mut scratch);
    let robustness = monitor.clamp(value);
    let mut explanation = Explanation {
        robustness,
        reason: Reason::EmptyTrace,
        path: Vec::new(),
        signals: Vec::new(),
    };
    if len == 0 {
        return explanation;
    }
    let program = &monitor.program;
    let reading = monitor.reading(len);
    let mut search = ExplanationSearch {
        closed: reading.until == Until::Closed,
        evaluation: monitor.evaluation(columns, len, reading, Semantics::Margin, &mut scratch),
    };
    let mut place = DecidingNode {
        id: program.root(),
        sample: 0,
        // A strict reading leaves an interval, whose lower end is the robustness.
        bound: Bound::Lower,
    };
    let mut shown = None;
    loop {
        let instruction = program.get(place.id);
        let value = search.value(place);
        // A conjunction of many is a single step, however it is evaluated.
        let step = (Arc::as_ptr(&instruction.source), place.sample);
        if shown != Some(step) {
            explanation.path.push(ExplanationStep {
                formula: instruction.source.to_string(),
                sample: place.sample,
                time_s: place.sample as f64 * program.schema.dt_s(),
                value: monitor.clamp(value),
            });
        }
        shown = Some(step);
        match search.next(place, value) {
            SearchMove::Down(next) => place = next,
            SearchMove::Stop(reason) => {
                explanation.reason = reason;
                break;
            }
        }
    }
    if let Op::Leaf(leaf) = &program.get(place.id).op {
        // A held sample beyond the end shows the last recorded sample.
        let row = place.sample.min(len - 1);
        if leaf.is_undefined(columns, row) {
            explanation.reason = Reason::Undefined;
        }
        leaf.signals(&mut |signal| {
            let name = &program.schema.signals()[signal].name;
            // A signal may occur on both sides of a comparison.
            if explanation.signals.iter().all(|(known, _)| known != name) {
                explanation
                    .signals
                    .push((name.clone(), columns.column(signal)[row]));
            }
        });
    }
    explanation
}

/// Sub-formula at a sample, with the bound that decides.
#[derive(Clone, Copy)]
struct DecidingNode {
    id: Id,
    sample: usize,
    bound: Bound,
}

enum SearchMove {
    Down(DecidingNode),
    Stop(Reason),
}

struct ExplanationSearch<'a, C> {
    closed: bool,
    evaluation: TraceEvaluation<'a, C>,
}

impl<C: Columns> ExplanationSearch<'_, C> {
    fn value(&mut self, place: DecidingNode) -> f64 {
        self.values(place, place.sample, place.sample)[0]
    }

    /// Returns the bound in question at the samples `from ..= to`.
    fn values(&mut self, place: DecidingNode, from: usize, to: usize) -> Vec<f64> {
        // Without an upper vector both bounds are equal.
        let stretch = self.evaluation.run(place.id, from, to + 1);
        match (place.bound, stretch.upper) {
            (Bound::Upper, Some(upper)) => upper,
            _ => stretch.lower,
        }
    }

    fn next(&mut self, place: DecidingNode, value: f64) -> SearchMove {
        let program = self.evaluation.program;
        let at = |id, sample| DecidingNode {
            id,
            sample,
            ..place
        };
        // A negation exchanges the bounds, so the other end decides below it.
        let against = |id, sample| DecidingNode {
            id,
            sample,
            bound: place.bound.opposite(),
        };
        let now = place.sample;
        match program.get(place.id).op {
            Op::Leaf(_) => SearchMove::Stop(Reason::Leaf),
            Op::Constant(_) => SearchMove::Stop(Reason::Constant),
            Op::Not(a) => SearchMove::Down(against(a, now)),
            Op::Gate(BooleanOp::And | BooleanOp::Or, a, b) => {
                self.first_of(value, &[(at(a, now), 1.0), (at(b, now), 1.0)])
            }
            Op::Gate(BooleanOp::Implies, a, b) => {
                self.first_of(value, &[(against(a, now), -1.0), (at(b, now), 1.0)])
            }
            Op::Gate(BooleanOp::Iff | BooleanOp::Xor, a, b) => {
                // Each operand enters both as it is and negated, so either may decide.
                let same = [(at(a, now), 1.0), (at(b, now), 1.0)];
                let opposite = [(against(a, now), -1.0), (against(b, now), -1.0)];
                self.first_of(value, &[same, opposite].concat())
            }
            Op::Edge(edge, a) => {
                let rise = edge == Edge::Rise;
                let current = if rise {
                    (at(a, now), 1.0)
                } else {
                    (against(a, now), -1.0)
                };
                let before = now.checked_sub(1).map(|t| {
                    if rise {
                        (against(a, t), -1.0)
                    } else {
                        (at(a, t), 1.0)
                    }
                });
                let both: Vec<_> = std::iter::once(current).chain(before).collect();
                self.first_of(value, &both)
            }
            Op::Ahead(_, window, a) => {
                let (from, to) = self.ahead(window, now);
                self.within(value, at(a, now), from, to)
            }
            Op::Behind(_, window, a) => {
                let from = window.to.map_or(0, |to| now.saturating_sub(to));
                match now.checked_sub(window.from) {
                    Some(to) => self.within(value, at(a, now), from, to),
                    None => SearchMove::Stop(Reason::EmptyWindow),
                }
            }
            Op::Until(side, _, window, a, b) => {
                // From the present on, as the left side must hold before the window
                // too.
                let (_, to) = self.ahead(SampleWindow { from: 0, ..window }, now);
                let mut guards = self.values(at(a, now), now, to);
                let mut goals = self.values(at(b, now), now, to);
                // A held trace has no empty window: samples beyond the end equal the last.
                let held = self.evaluation.reading.tail == WindowTail::Held;
                let from = if held {
                    window.from.min(guards.len())
                } else {
                    window.from
                };
                if held && from == guards.len() {
                    // The window lies in the held part, where a single sample represents all.
                    guards.extend(guards.last().copied());
                    goals.extend(goals.last().copied());
                }
                // A release is the until of both sides negated.
                let sign = if side == MinMax::Max { 1.0 } else { -1.0 };
                match self.until(sign, value, &guards, &goals, from) {
                    // An index in the held part is that of the last sample.
                    Some(DecidingOperand::Guard(i)) => SearchMove::Down(at(a, (now + i).min(to))),
                    Some(DecidingOperand::Goal(i)) => SearchMove::Down(at(b, (now + i).min(to))),
                    None => self.nothing(window, now),
                }
            }
            Op::Since(window, a, b) => {
                // Since is until backwards in time, so both sides are reversed.
                let from = window.to.map_or(0, |to| now.saturating_sub(to));
                let mut guards = self.values(at(a, now), from, now);
                let mut goals = self.values(at(b, now), from, now);
                guards.reverse();
                goals.reverse();
                match self.until(1.0, value, &guards, &goals, window.from) {
                    Some(DecidingOperand::Guard(i)) => SearchMove::Down(at(a, now - i)),
                    Some(DecidingOperand::Goal(i)) => SearchMove::Down(at(b, now - i)),
                    None => SearchMove::Stop(Reason::EmptyWindow),
                }
            }
        }
    }

    /// Returns the samples of a window, empty when the first exceeds the second.
    fn ahead(&self, window: SampleWindow, now: usize) -> (usize, usize) {
        let last = self.evaluation.reading.known - 1;
        let mut from = now.saturating_add(window.from);
        if self.evaluation.reading.tail == WindowTail::Held {
            from = from.min(last);
        }
        (
            from,
            window
                .to
                .map_or(last, |to| now.saturating_add(to).min(last)),
        )
    }

    fn nothing(&self, window: SampleWindow, now: usize) -> SearchMove {
        let reading = &self.evaluation.reading;
        let len = reading.len(window);
        let open = reading.known < len
            && window
                .to
                .is_none_or(|to| reading.known <= now.saturating_add(to));
        SearchMove::Stop(if open {
            Reason::BeyondTheEnd
        } else {
            Reason::EmptyWindow
        })
    }

    fn first_of(&mut self, value: f64, places: &[(DecidingNode, f64)]) -> SearchMove {
        for (place, sign) in places {
            // Exact comparison is safe: logic copies values and changes only their sign.
            if sign * self.value(*place) == value {
                return SearchMove::Down(*place);
            }
        }
        SearchMove::Stop(Reason::EmptyWindow)
    }

    /// Finds the first sample of `from ..= to` with the value.
    fn within(&mut self, value: f64, place: DecidingNode, from: usize, to: usize) -> SearchMove {
        if to < from {
            return SearchMove::Stop(Reason::EmptyWindow);
        }
        let values = self.values(place, from, to);
        match values.iter().position(|v| *v == value) {
            Some(i) => SearchMove::Down(DecidingNode {
                sample: from + i,
                ..place
            }),
            // No known sample has the value, so one beyond the end decides.
            None => SearchMove::Stop(Reason::BeyondTheEnd),
        }
    }

    /// Finds the deciding sample of an until (`sign` 1) or a release (−1).
    fn until(
        &self,
        sign: f64,
        value: f64,
        guards: &[f64],
        goals: &[f64],
        from: usize,
    ) -> Option<DecidingOperand> {
        let mut held = f64::INFINITY;
        for (i, (guard, goal)) in guards.iter().zip(goals).enumerate() {
            let (guard, goal) = (sign * guard, sign * goal);
            let before = if self.closed { held.min(guard) } else { held };
            // If goal and guard have equal values, the goal is reported.
            if from <= i && goal.min(before) == sign * value {
                if goal == sign * value {
                    return Some(DecidingOperand::Goal(i));
                }
                return guards
                    .iter()
                    .position(|g| *g == value)
                    .map(DecidingOperand::Guard);
            }
            held = held.min(guard);
        }
        // No goal occurred, but the left side held (unless), or still could.
        guards
            .iter()
            .position(|g| *g == value && sign * g == held)
            .map(DecidingOperand::Guard)
    }
}

enum DecidingOperand {
    Guard(usize),
    Goal(usize),
}
