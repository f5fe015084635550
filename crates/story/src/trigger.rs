//! State of a condition: its edge and its delay.

use std::collections::VecDeque;

use crate::tree::CheckedCondition;
use crate::values::ConditionEdge;

/// Difference up to which two instants are the same.
///
/// Far below the promised millisecond and above the error of the search for instants.
pub(crate) const SAME_S: f64 = 1e-7;

/// Result of an expression at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expressed {
    pub holds: bool,
    /// Number that changes with every change of the result, also with one that lasts
    /// for an instant only.
    pub key: u64,
}

/// Effect of a condition that is to come.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ConditionOutcome {
    Level(bool),
    /// True at a single instant, as edges are.
    Pulse,
}

/// State of a condition since the first check.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConditionRun {
    seen: Option<Expressed>,
    /// Instant since which the expression holds.
    holds_since_s: f64,
    /// Result of the expression for long enough. `None` before the first check.
    value: Option<bool>,
    /// That result at the end of the last earlier instant, which edges start from.
    ///
    /// OpenSCENARIO compares evaluations of different times, so what elements do at one
    /// instant is no edge among itself.
    earlier: Option<bool>,
    checked_s: f64,
    /// Outcomes that wait for their delay, in the order of time.
    waiting: VecDeque<(f64, ConditionOutcome)>,
    level: bool,
    pulse_s: Option<f64>,
}

impl ConditionRun {
    /// Takes the expression of a condition at an instant, of which an edge counts.
    pub fn check(
        &mut self,
        condition: &CheckedCondition,
        edge: ConditionEdge,
        now: Expressed,
        at_s: f64,
    ) {
        let held_before = self.seen.is_some_and(|seen| seen.holds);
        if now.holds && !held_before {
            // An expression that fails in between begins its hold anew.
            self.holds_since_s = at_s;
        }
        self.seen = Some(now);
        // Several checks of one instant start from the same earlier value.
        if self.checked_s < at_s {
            self.earlier = self.value;
        }
        self.checked_s = at_s;
        let value = now.holds && at_s + SAME_S >= self.holds_since_s + condition.held_s;
        let outcome = match (edge, self.earlier) {
            (ConditionEdge::None, _) => {
                // Only changes wait, so the queue stays short under a long delay.
                (self.value != Some(value)).then_some(ConditionOutcome::Level(value))
            }
            // An edge needs a check before it, so the first instant has none.
            (_, None) => None,
            (edge, Some(before)) => is_edge(edge, before, value).then_some(ConditionOutcome::Pulse),
        };
        self.value = Some(value);
        // An edge is delayed as a level is, because the delay is that of the
        // condition.
        let due_s = at_s + condition.delay_s;
        self.waiting.extend(outcome.map(|outcome| (due_s, outcome)));
        self.pass_on(at_s);
    }

    fn pass_on(&mut self, at_s: f64) {
        // All outcomes have the same delay, so the first of the queue is due first.
        while let Some((due_s, outcome)) = self.waiting.front().copied()
            && due_s <= at_s + SAME_S
        {
            self.waiting.pop_front();
            match outcome {
                ConditionOutcome::Level(level) => self.level = level,
                ConditionOutcome::Pulse => self.pulse_s = Some(due_s),
            }
        }
    }

    /// Returns whether the condition is true at the instant of the last check.
    pub fn is_true(&self, at_s: f64) -> bool {
        let pulses = self.pulse_s.is_some_and(|pulse_s| at_s - pulse_s <= SAME_S);
        self.level || pulses
    }

    /// Returns the key of the expression at the last check.
    pub fn key(&self) -> Option<u64> {
        self.seen.map(|seen| seen.key)
    }

    /// Returns the next instant at which it changes by itself.
    pub fn next_s(&self, condition: &CheckedCondition) -> f64 {
        let waits_s = self.waiting.front().map_or(f64::INFINITY, |it| it.0);
        // Otherwise the end of the hold would fall between two looks unseen.
        let is_held = self.seen.is_some_and(|seen| seen.holds) && self.value == Some(false);
        let held_s = if is_held {
            self.holds_since_s + condition.held_s
        } else {
            f64::INFINITY
        };
        waits_s.min(held_s)
    }
}

fn is_edge(edge: ConditionEdge, before: bool, now: bool) -> bool {
    match edge {
        // Not reached, since conditions without an edge are levels.
        ConditionEdge::None => false,
        ConditionEdge::Rising => !before && now,
        ConditionEdge::Falling => before && !now,
        ConditionEdge::RisingOrFalling => before != now,
    }
}
