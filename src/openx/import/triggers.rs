//! When acts and events of a storyboard begin.

use super::entity::Watch;
use super::error::ImportError;
use super::scope::{Scope, compared};
use super::tree::Node;

/// When something begins.
pub(super) enum Starts {
    Never,
    Now,
    At(f64),
    After { element: String, delay_s: f64 },
    When { watch: Watch, delay_s: f64 },
}

/// When an act or an event begins.
pub(super) fn starts(node: &Node, scope: &Scope) -> Result<Starts, ImportError> {
    let Some(trigger) = node.child("StartTrigger") else {
        return Ok(Starts::Now);
    };
    let mut possible: Vec<Starts> = Vec::new();
    let mut groups = 0;
    for group in trigger.all("ConditionGroup") {
        groups += 1;
        let mut all: Vec<Starts> = Vec::new();
        for condition in group.all("Condition") {
            all.push(condition_of(condition, scope)?);
        }
        if all.iter().any(|it| matches!(it, Starts::Never)) {
            continue;
        }
        all.retain(|it| !matches!(it, Starts::Now));
        match (all.pop(), all.is_empty()) {
            (None, _) => return Ok(Starts::Now),
            (Some(one), true) => possible.push(one),
            _ => return Err(group.error("several conditions at a time are not read")),
        }
    }
    match (possible.pop(), possible.is_empty()) {
        (None, _) if groups == 0 => Ok(Starts::Now),
        (None, _) => Ok(Starts::Never),
        (Some(one), true) => Ok(one),
        _ => Err(trigger.error("several ways to begin are not read")),
    }
}

fn condition_of(condition: &Node, scope: &Scope) -> Result<Starts, ImportError> {
    let delay_s = scope.number_or_zero(condition, "delay")?;
    let (kind, by) = condition
        .children
        .iter()
        .find_map(|it| Some((it, it.children.last()?)))
        .ok_or_else(|| condition.error("there is nothing in it"))?;
    if kind.name == "ByValueCondition" {
        return match by.name.as_str() {
            "SimulationTimeCondition" => {
                let at_s = scope.number(by, "value")?;
                match by.raw("rule") {
                    Some("greaterThan" | "greaterOrEqual") => Ok(match at_s + delay_s <= 0.0 {
                        true => Starts::Now,
                        false => Starts::At(at_s + delay_s),
                    }),
                    _ => Err(by.error("only times that have come are read")),
                }
            }
            "ParameterCondition" => {
                let name = by.need("parameterRef")?;
                let value = scope.get(name);
                let value = value.ok_or_else(|| by.error(format!("there is no `{name}`")))?;
                let rule = by.need("rule")?;
                match compared(value, rule, &scope.text(by, "value")?) {
                    Some(true) => Ok(Starts::Now),
                    Some(false) => Ok(Starts::Never),
                    None => Err(by.error(format!("the rule `{rule}` is not understood"))),
                }
            }
            "StoryboardElementStateCondition" => {
                let ended = ["endTransition", "completeState"];
                if !by.raw("state").is_some_and(|state| ended.contains(&state)) {
                    return Err(by.error("only the end of an element is read"));
                }
                Ok(Starts::After {
                    element: by.need("storyboardElementRef")?.to_owned(),
                    delay_s,
                })
            }
            _ => Err(by.error("a condition of this kind is not read")),
        };
    }
    let entities = kind.inner("TriggeringEntities")?;
    let who = scope.text(entities.only()?, "entityRef")?;
    let it = kind.inner("EntityCondition")?.only()?;
    let is_time = match it.name.as_str() {
        "RelativeDistanceCondition" => false,
        "TimeHeadwayCondition" => true,
        _ => return Err(it.error("a condition of this kind is not read")),
    };
    let is_longitudinal = it
        .raw("relativeDistanceType")
        .is_none_or(|it| it == "longitudinal");
    if !is_longitudinal || it.raw("freespace") != Some("true") {
        return Err(it.error("only clear distances along the road are read"));
    }
    let is_below = match it.need("rule")? {
        "lessThan" | "lessOrEqual" => true,
        "greaterThan" | "greaterOrEqual" => false,
        rule => return Err(it.error(format!("the rule `{rule}` is not read here"))),
    };
    Ok(Starts::When {
        watch: Watch {
            who,
            whom: scope.text(it, "entityRef")?,
            is_below,
            value: scope.number(it, "value")?,
            is_time,
        },
        delay_s,
    })
}
