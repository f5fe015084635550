//! Start times of acts and events.

use super::entity::ClearanceCondition;
use super::error::ImportError;
use super::scope::{ParameterScope, compared};
use super::tree::XmlNode;

/// Start of an act or an event.
pub(super) enum StartTrigger {
    Never,
    /// Simulation time in seconds.
    At(f64),
    After {
        element: StoryElement,
        delay_s: f64,
    },
    When {
        watch: ClearanceCondition,
        delay_s: f64,
    },
}

/// Element of a storyboard, as conditions refer to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct StoryElement {
    /// Kind: `act`, `maneuver`, `event`, `action`, ….
    pub kind: String,
    pub name: String,
}

impl StoryElement {
    /// Returns the element of a node, or `None` without a name.
    pub(super) fn of(kind: &str, node: &XmlNode) -> Option<StoryElement> {
        node.raw("name").map(|name| StoryElement {
            kind: kind.to_owned(),
            name: name.to_owned(),
        })
    }
}

/// Returns the start of an act or an event.
///
/// Its trigger is first evaluated after `from_s`.
///
/// # Errors
///
/// Returns an error for more than one relevant condition.
pub(super) fn starts(
    node: &XmlNode,
    scope: &ParameterScope,
    from_s: f64,
) -> Result<StartTrigger, ImportError> {
    let Some(trigger) = node.child("StartTrigger") else {
        return Ok(StartTrigger::At(from_s));
    };
    let mut possible: Vec<StartTrigger> = Vec::new();
    let mut groups = 0;
    for group in trigger.all("ConditionGroup") {
        groups += 1;
        let mut all: Vec<StartTrigger> = Vec::new();
        for condition in group.all("Condition") {
            all.push(condition_of(condition, scope, from_s)?);
        }
        // A group of conditions holds only if all of them hold.
        if all.iter().any(|it| matches!(it, StartTrigger::Never)) {
            continue;
        }
        // A condition that holds at once adds nothing to the others.
        let is_now = |it: &StartTrigger| matches!(it, StartTrigger::At(at_s) if *at_s == from_s);
        all.retain(|it| !is_now(it));
        match (all.pop(), all.is_empty()) {
            (None, _) => return Ok(StartTrigger::At(from_s)),
            (Some(one), true) => possible.push(one),
            _ => {
                let what = "several conditions at a time are not read";
                let help = "begin the event by one condition, or put what it waits for into \
                            an event before it";
                return Err(group.refused(what, help));
            }
        }
    }
    match (possible.pop(), possible.is_empty()) {
        // An empty trigger starts at once. Groups that never hold never start
        // it.
        (None, _) if groups == 0 => Ok(StartTrigger::At(from_s)),
        (None, _) => Ok(StartTrigger::Never),
        (Some(one), true) => Ok(one),
        _ => {
            let help = "begin the event by one condition group";
            Err(trigger.refused("several ways to begin are not read", help))
        }
    }
}

/// Returns true if a condition must become true while it is evaluated.
fn rises(condition: &XmlNode) -> Result<bool, ImportError> {
    match condition.raw("conditionEdge") {
        None | Some("none") => Ok(false),
        // The conditions that are read become true at most once. A falling edge
        // is refused.
        Some("rising" | "risingOrFalling") => Ok(true),
        Some(edge) => {
            let what = format!("a condition with a {edge} edge is not read");
            let help = "state the opposite rule with a rising edge, such as greaterThan for a \
                        falling lessThan";
            Err(condition.refused(what, help))
        }
    }
}

fn condition_of(
    condition: &XmlNode,
    scope: &ParameterScope,
    from_s: f64,
) -> Result<StartTrigger, ImportError> {
    let delay_s = scope.number_or_zero(condition, "delay")?;
    // A negative delay would start before the condition holds.
    if delay_s < 0.0 {
        let what = format!("a delay of {delay_s} s");
        return Err(condition.refused(what, "a delay is at least 0 s"));
    }
    let rises = rises(condition)?;
    let (kind, by) = condition
        .children
        .iter()
        // The condition itself is the last child: the triggering entities
        // precede it.
        .find_map(|it| Some((it, it.children.last()?)))
        .ok_or_else(|| {
            condition.refused(
                "there is nothing in it",
                "name what it waits for, such as a `SimulationTimeCondition`",
            )
        })?;
    if kind.name == "ByValueCondition" {
        return match by.name.as_str() {
            "SimulationTimeCondition" => {
                let at_s = time_s(by, scope, rises, from_s)?;
                Ok(StartTrigger::At(at_s + delay_s))
            }
            "ParameterCondition" => parameter(by, scope, rises, from_s + delay_s),
            "StoryboardElementStateCondition" => {
                // Both states begin when the element ends.
                let ended = ["endTransition", "completeState"];
                if !by.raw("state").is_some_and(|state| ended.contains(&state)) {
                    let what = "only the end of an element is read";
                    return Err(by.refused(what, "wait for its `endTransition`"));
                }
                let element = StoryElement {
                    kind: by.need("storyboardElementType")?.to_owned(),
                    name: by.need("storyboardElementRef")?.to_owned(),
                };
                Ok(StartTrigger::After { element, delay_s })
            }
            _ => Err(by.refused(
                "a condition of this kind is not read",
                "wait for a time, a parameter, or the end of an element",
            )),
        };
    }
    let watch = watch(kind, scope, rises)?;
    Ok(StartTrigger::When { watch, delay_s })
}

/// Time in seconds at which a time condition holds, evaluated after `from_s`.
fn time_s(
    by: &XmlNode,
    scope: &ParameterScope,
    rises: bool,
    from_s: f64,
) -> Result<f64, ImportError> {
    let at_s = scope.number(by, "value")?;
    let is_past = match by.raw("rule") {
        // At `from_s` itself, `greaterThan` does not hold yet, and
        // `greaterOrEqual` does.
        Some("greaterThan") => at_s < from_s,
        Some("greaterOrEqual") => at_s <= from_s,
        _ => {
            let what = "only times that have come are read";
            return Err(by.refused(what, "use the rule greaterThan or greaterOrEqual"));
        }
    };
    if rises && is_past {
        let what = format!(
            "a rising edge at {at_s} s is never seen: the condition is first looked at when \
             it is true, after {from_s} s"
        );
        let help = "write conditionEdge=\"none\", or a later time";
        return Err(by.refused(what, help));
    }
    Ok(at_s.max(from_s))
}

fn parameter(
    by: &XmlNode,
    scope: &ParameterScope,
    rises: bool,
    at_s: f64,
) -> Result<StartTrigger, ImportError> {
    let name = by.need("parameterRef")?;
    let value = scope.get(name);
    let value = value.ok_or_else(|| by.error(format!("there is no `{name}`")))?;
    let rule = by.need("rule")?;
    let holds = compared(value, rule, &scope.text(by, "value")?);
    let holds = holds.ok_or_else(|| by.error(format!("the rule `{rule}` is not understood")))?;
    if rises {
        let what = format!("an edge of `{name}` never comes: a parameter does not change");
        return Err(by.refused(what, "write conditionEdge=\"none\""));
    }
    Ok(if holds {
        StartTrigger::At(at_s)
    } else {
        StartTrigger::Never
    })
}

fn watch(
    kind: &XmlNode,
    scope: &ParameterScope,
    rises: bool,
) -> Result<ClearanceCondition, ImportError> {
    let entities = kind.inner("TriggeringEntities")?;
    let who = entities
        .all("EntityRef")
        .map(|it| scope.text(it, "entityRef"));
    let who = who.collect::<Result<Vec<_>, _>>()?;
    if who.is_empty() {
        return Err(entities.refused(
            "it has no triggering entity",
            "name an entity: `<EntityRef entityRef=\"Ego\"/>`",
        ));
    }
    let needs_all = match entities.raw("triggeringEntitiesRule") {
        Some("any") => false,
        Some("all") => true,
        // A rule does not matter for one entity.
        _ if who.len() == 1 => false,
        _ => return Err(entities.refused("any of them, or all", "write the rule `any` or `all`")),
    };
    let it = kind.inner("EntityCondition")?.only()?;
    let is_time = match it.name.as_str() {
        "RelativeDistanceCondition" => false,
        "TimeHeadwayCondition" => true,
        _ => {
            return Err(it.refused(
                "a condition of this kind is not read",
                "wait for a `RelativeDistanceCondition` or a `TimeHeadwayCondition`",
            ));
        }
    };
    let is_longitudinal = it
        .raw("relativeDistanceType")
        // Longitudinal is the default type.
        .is_none_or(|it| it == "longitudinal");
    if !is_longitudinal || it.raw("freespace") != Some("true") {
        return Err(it.refused(
            "only clear distances along the road are read",
            "write relativeDistanceType=\"longitudinal\" and freespace=\"true\"",
        ));
    }
    let is_below = match it.need("rule")? {
        // Equality has no duration, so both rules of a side are read alike.
        "lessThan" | "lessOrEqual" => true,
        "greaterThan" | "greaterOrEqual" => false,
        rule => return Err(it.error(format!("the rule `{rule}` is not read here"))),
    };
    Ok(ClearanceCondition {
        who,
        needs_all,
        target: scope.text(it, "entityRef")?,
        is_below,
        value: scope.number(it, "value")?,
        is_time,
        rises,
        at: it.at(),
    })
}
