//! Earliest begins of elements, as far as a file says them.

use super::parts::{PartKind, StoryParts};
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::{ParameterScope, compared};
use crate::opendrive::tree::XmlNode;

/// Earliest begin of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EarliestBegin {
    /// Time in seconds, infinite for what never begins.
    pub at_s: f64,
    /// True if it begins then, whatever happens in the run.
    pub is_known: bool,
}

impl EarliestBegin {
    fn known(at_s: f64) -> EarliestBegin {
        EarliestBegin {
            at_s,
            is_known: true,
        }
    }

    /// Returns the begin of what waits for something that the run decides.
    fn later(at_s: f64) -> EarliestBegin {
        EarliestBegin {
            at_s,
            is_known: false,
        }
    }

    /// Returns when both have come.
    fn and(self, other: EarliestBegin) -> EarliestBegin {
        EarliestBegin {
            at_s: self.at_s.max(other.at_s),
            // What never comes hides whatever else is waited for.
            is_known: (self.is_known && other.is_known)
                || [self, other].contains(&EarliestBegin::known(f64::INFINITY)),
        }
    }

    /// Returns when either has come.
    fn or(self, other: EarliestBegin) -> EarliestBegin {
        EarliestBegin {
            at_s: self.at_s.min(other.at_s),
            is_known: self.is_known && other.is_known,
        }
    }
}

/// Returns the earliest begin of each element.
///
/// Values that are not read are problems elsewhere, and begin at once here.
pub(super) fn earliest_begins(parts: &StoryParts<'_>, changed: &[String]) -> Vec<EarliestBegin> {
    let start = EarliestBegin::known(0.0);
    let mut begins = vec![start; parts.0.len()];
    // Elements may wait for those that follow them, so a few rounds settle chains. Times
    // only grow, and one that has not settled is still no later than the true one.
    for _ in 0..4 {
        for (number, part) in parts.0.iter().enumerate() {
            let outer = part.parent.map_or(start, |parent| begins[parent]);
            let trigger = part.node.child("StartTrigger");
            begins[number] = trigger.map_or(outer, |trigger| {
                let reader = TriggerReader {
                    parts,
                    begins: &begins,
                    changed,
                    scope: &part.scope,
                    from: outer,
                };
                reader.trigger(trigger)
            });
        }
    }
    begins
}

struct TriggerReader<'a> {
    parts: &'a StoryParts<'a>,
    begins: &'a [EarliestBegin],
    /// Parameters that change during the run.
    changed: &'a [String],
    scope: &'a ParameterScope,
    /// Begin of the element around it.
    from: EarliestBegin,
}

impl TriggerReader<'_> {
    fn trigger(&self, trigger: &XmlNode) -> EarliestBegin {
        // Any group suffices, and within one all conditions must hold.
        let groups = trigger.all("ConditionGroup").map(|group| {
            let conditions = group.all("Condition").map(|it| self.condition(it));
            // Nothing begins before the element around it.
            conditions.fold(self.from, EarliestBegin::and)
        });
        groups.reduce(EarliestBegin::or).unwrap_or(self.from)
    }

    fn condition(&self, condition: &XmlNode) -> EarliestBegin {
        // A wrong delay is reported when the trigger is written.
        let delay_s = self.scope.number_or_zero(condition, "delay").unwrap_or(0.0);
        let read = condition.child("ByValueCondition").map(|it| self.value(it));
        // What the run decides comes no earlier than the element around it.
        let unknown = EarliestBegin::later(self.from.at_s);
        let held = read.and_then(Result::ok).flatten().unwrap_or(unknown);
        let has_edge = condition
            .raw("conditionEdge")
            .is_some_and(|edge| edge != "none");
        EarliestBegin {
            at_s: held.at_s + delay_s.max(0.0),
            // An edge may have come before the element waits for it.
            is_known: held.is_known && !(has_edge && held.at_s <= self.from.at_s),
        }
    }

    fn value(&self, by: &XmlNode) -> Result<Option<EarliestBegin>, ImportError> {
        let it = by.only()?;
        Ok(match it.name.as_str() {
            "SimulationTimeCondition" => {
                let at_s = self.scope.number(it, "value")?;
                match it.raw("rule") {
                    Some("greaterThan" | "greaterOrEqual") => {
                        Some(EarliestBegin::known(at_s.max(self.from.at_s)))
                    }
                    // The first instant is the only one that is met exactly.
                    Some("equalTo") if at_s == 0.0 && self.from.at_s == 0.0 => {
                        Some(EarliestBegin::known(0.0))
                    }
                    _ => None,
                }
            }
            "ParameterCondition" => {
                let name = it.need("parameterRef")?.trim_start_matches('$');
                let stated = self.scope.get(name);
                // The run may change it before anything asks.
                let value = stated.filter(|_| self.changed.iter().all(|it| it != name));
                let rule = it.raw("rule").unwrap_or_default();
                let to = self.scope.text(it, "value")?;
                let holds = value.and_then(|value| compared(value, rule, &to));
                holds.map(|holds| {
                    EarliestBegin::known(if holds { self.from.at_s } else { f64::INFINITY })
                })
            }
            "StoryboardElementStateCondition" => {
                let kind = it.raw("storyboardElementType").and_then(PartKind::called);
                let name = self.scope.text(it, "storyboardElementRef")?;
                let found = kind.map(|kind| self.parts.named(kind, &name));
                let begun = match found.as_deref() {
                    Some([first, ..]) => self.begins[*first],
                    // An unknown name is a problem of the trigger itself.
                    _ => return Ok(None),
                };
                // An end comes after the begin, by a time that the run decides.
                let is_begin = matches!(it.raw("state"), Some("startTransition" | "runningState"));
                Some(EarliestBegin {
                    is_known: begun.is_known && (is_begin || begun.at_s.is_infinite()),
                    ..begun
                })
            }
            _ => None,
        })
    }
}
