//! Triggers and conditions of a file, as those of a world's storyboard.

use super::StoryWriter;
use super::numbers::StatedIn;
use super::parts::PartKind;
use crate::ego::Phase;
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::{RULES, compared};
use crate::opendrive::tree::XmlNode;
use crate::openx::import::lights::{light_name, shown};
use crate::story::values::{
    ComparisonRule, Condition, ConditionEdge, ElementState, Expression, SignalState, StoryNumber,
    Trigger, TriggeringRule,
};

/// Kind of a reference to the first of several elements.
const NAMESAKES: &str = "other elements of a name that several have";

impl StoryWriter<'_> {
    /// Returns the trigger of an element, which is empty without conditions.
    ///
    /// All of its conditions are read, so that each problem is named.
    pub(super) fn trigger(&mut self, number: usize, name: &str) -> Trigger {
        let part = &self.parts.0[number];
        // An element without a trigger begins with that around it.
        let trigger = part.node.child(name).into_iter();
        let groups = trigger.flat_map(|it| it.all("ConditionGroup"));
        let mut read = Trigger::new();
        for group in groups {
            let mut conditions = Vec::new();
            for node in group.all("Condition") {
                let at = StatedIn {
                    node,
                    scope: &part.scope,
                    owner: &part.name,
                };
                let condition = self.condition(at);
                conditions.extend(self.blockers.keep(condition));
            }
            read.push(conditions);
        }
        read
    }

    fn condition(&mut self, at: StatedIn<'_>) -> Result<Condition, ImportError> {
        let node = at.node;
        let delay_s = at.scope.number_or_zero(node, "delay")?;
        // A negative delay would start before the condition holds.
        if delay_s < 0.0 {
            let what = format!("a delay of {delay_s} s");
            return Err(node.refused(what, "a delay is at least 0 s"));
        }
        let edge = match node.raw("conditionEdge") {
            None | Some("none") => ConditionEdge::None,
            Some("rising") => ConditionEdge::Rising,
            Some("falling") => ConditionEdge::Falling,
            Some("risingOrFalling") => ConditionEdge::RisingOrFalling,
            Some(edge) => {
                let help = "write none, rising, falling or risingOrFalling";
                return Err(node.refused(format!("there is no edge `{edge}`"), help));
            }
        };
        let kind = node.children.first().ok_or_else(|| {
            let help = "name what it waits for, such as a `SimulationTimeCondition`";
            node.refused("there is nothing in it", help)
        })?;
        let is = match kind.name.as_str() {
            "ByValueCondition" => self.by_value(at.at(kind.only()?))?,
            "ByEntityCondition" => self.by_entity(at.at(kind))?,
            _ => return Err(unread(kind)),
        };
        let is = if edge == ConditionEdge::None {
            from_the_start(is)
        } else {
            is
        };
        Ok(Condition {
            edge,
            delay_s: self.numbers.or(at, "delay", 0.0)?,
            is,
        })
    }

    fn by_value(&mut self, at: StatedIn<'_>) -> Result<Expression, ImportError> {
        let it = at.node;
        Ok(match it.name.as_str() {
            "SimulationTimeCondition" => Expression::SimulationTime {
                rule: rule(it)?,
                value_s: self.numbers.of(at, "value", |value| value)?,
            },
            "ParameterCondition" => {
                let name = it.need("parameterRef")?.trim_start_matches('$');
                if self.ground.changed.iter().any(|changed| changed == name) {
                    return self.variable_condition(at, name);
                }
                // A parameter that no action changes is constant over the run.
                let value = at.scope.get(name).ok_or_else(|| {
                    let help = "declare it in the `ParameterDeclarations`";
                    it.refused(format!("there is no `{name}`"), help)
                })?;
                let stated = it.need("rule")?;
                let found = compared(value, stated, &at.scope.text(it, "value")?);
                let holds = found.ok_or_else(|| {
                    it.refused(format!("the rule `{stated}` is not understood"), RULES)
                })?;
                constant(holds)
            }
            "VariableCondition" => {
                let name = it.need("variableRef")?.trim_start_matches('$');
                self.variable_condition(at, name)?
            }
            "StoryboardElementStateCondition" => self.element_state(at)?,
            "TrafficSignalCondition" => {
                let signal = at.scope.text(it, "name")?;
                let is_known = self.frame.as_ref().is_none_or(|frame| {
                    let mut lights = frame.concrete.lights.iter();
                    lights.any(|light| light.signal == signal)
                });
                let state = at.scope.text(it, "state")?;
                let phase = shown(&state).filter(|_| is_known).ok_or_else(|| {
                    let help = "wait for red, yellow or green of a light on the ego's way";
                    it.refused("a condition of this kind is not read", help)
                })?;
                Expression::TrafficSignal {
                    name: light_name(&signal),
                    state: signal_state(phase),
                }
            }
            _ => return Err(unread(it)),
        })
    }

    fn variable_condition(
        &mut self,
        at: StatedIn<'_>,
        name: &str,
    ) -> Result<Expression, ImportError> {
        let value = self.variable_value(at)?;
        Ok(Expression::Variable {
            name: self.variable(at, name)?,
            rule: rule(at.node)?,
            value,
        })
    }

    /// Returns the value of an attribute, where words of truth are 1 and 0.
    pub(super) fn variable_value(&self, at: StatedIn<'_>) -> Result<StoryNumber, ImportError> {
        match at.scope.text(at.node, "value")?.as_str() {
            "true" => Ok(StoryNumber::Number(1.0)),
            "false" => Ok(StoryNumber::Number(0.0)),
            _ => self.numbers.of(at, "value", |value| value),
        }
    }

    fn element_state(&mut self, at: StatedIn<'_>) -> Result<Expression, ImportError> {
        let it = at.node;
        let word = it.need("storyboardElementType")?;
        let name = at.scope.text(it, "storyboardElementRef")?;
        let state = match it.need("state")? {
            "standbyState" => ElementState::StandbyState,
            "runningState" => ElementState::RunningState,
            "completeState" => ElementState::CompleteState,
            "startTransition" => ElementState::StartTransition,
            "endTransition" => ElementState::EndTransition,
            "stopTransition" => ElementState::StopTransition,
            "skipTransition" => ElementState::SkipTransition,
            other => {
                let help = "write a state or a transition, such as endTransition";
                return Err(it.refused(format!("there is no state `{other}`"), help));
            }
        };
        // The same name may stand for elements of several kinds.
        let kind = PartKind::called(word);
        let found = kind.map(|kind| self.parts.named(kind, &name));
        let element = match found.as_deref() {
            Some([one]) => *one,
            Some([first, ..]) => {
                // esmini takes the first, and so does the world.
                self.ground.catalogs.note(NAMESAKES, it);
                *first
            }
            _ => {
                let what = format!("there is no `{word}` called `{name}`");
                return Err(it.refused(what, "name an element of the storyboard"));
            }
        };
        let is_end = matches!(
            state,
            ElementState::EndTransition
                | ElementState::CompleteState
                | ElementState::StopTransition
        );
        if is_end && self.is_left(element) {
            let what = format!("when `{name}` ends is not known");
            let help = "wait for a time, or for what the others do";
            return Err(it.refused(what, help));
        }
        Ok(Expression::StoryboardElementState {
            element: self.parts.path(element),
            state,
        })
    }

    fn by_entity(&mut self, at: StatedIn<'_>) -> Result<Expression, ImportError> {
        let entities = at.node.inner("TriggeringEntities")?;
        let mut named = Vec::new();
        for it in entities.all("EntityRef") {
            let name = at.scope.text(it, "entityRef")?;
            named.push(self.entity(it, &name)?);
        }
        if named.is_empty() {
            return Err(entities.refused(
                "it has no triggering entity",
                "name an entity: `<EntityRef entityRef=\"Ego\"/>`",
            ));
        }
        let rule = match entities.raw("triggeringEntitiesRule") {
            Some("any") => TriggeringRule::Any,
            Some("all") => TriggeringRule::All,
            // A rule does not matter for one entity.
            _ if named.len() == 1 => TriggeringRule::Any,
            _ => {
                return Err(
                    entities.refused("any of them, or all", "write the rule `any` or `all`")
                );
            }
        };
        let it = at.node.inner("EntityCondition")?.only()?;
        let Some(condition) = self.quantity(at.at(it))? else {
            return Ok(constant(false));
        };
        Ok(Expression::ByEntity {
            entities: named,
            rule,
            condition,
        })
    }
}

/// Returns a wait for a time after 0 as one that holds at 0 itself.
///
/// No time lies in between, and what begins at the start is seen in the first sample.
fn from_the_start(is: Expression) -> Expression {
    match is {
        Expression::SimulationTime {
            rule: ComparisonRule::GreaterThan,
            value_s: StoryNumber::Number(0.0),
        } => constant(true),
        other => other,
    }
}

/// Expression that always holds, or never.
fn constant(holds: bool) -> Expression {
    Expression::SimulationTime {
        rule: if holds {
            ComparisonRule::GreaterOrEqual
        } else {
            ComparisonRule::LessThan
        },
        // Times are at least 0, so the comparison always holds, or never.
        value_s: StoryNumber::Number(0.0),
    }
}

/// Returns the rule of a comparison.
pub(super) fn rule(it: &XmlNode) -> Result<ComparisonRule, ImportError> {
    Ok(match it.need("rule")? {
        "lessThan" => ComparisonRule::LessThan,
        "lessOrEqual" => ComparisonRule::LessOrEqual,
        "equalTo" => ComparisonRule::EqualTo,
        "notEqualTo" => ComparisonRule::NotEqualTo,
        "greaterOrEqual" => ComparisonRule::GreaterOrEqual,
        "greaterThan" => ComparisonRule::GreaterThan,
        other => {
            return Err(it.refused(format!("the rule `{other}` is not understood"), RULES));
        }
    })
}

/// Returns the state of a light in a storyboard.
pub(super) fn signal_state(phase: Phase) -> SignalState {
    match phase {
        Phase::Green => SignalState::Green,
        Phase::Yellow => SignalState::Yellow,
        Phase::Red => SignalState::Red,
    }
}

fn unread(it: &XmlNode) -> ImportError {
    it.refused(
        "a condition of this kind is not read",
        "wait for a time, a variable, the state of an element, or what an entity does",
    )
}
