//! Start times of acts and events.

use super::entity::{Measure, WatchedCondition};
use super::joined::{StartTrigger, all_of, any_of};
use super::places::PositionContext;
use super::story_element::StoryElement;
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::{ParameterScope, RULES, compared};
use crate::opendrive::tree::XmlNode;

/// Places, and the times at which elements begin as far as they are known.
///
/// What never begins has an infinite time.
pub(super) type TriggerContext<'a> = (PositionContext<'a>, &'a [(StoryElement, f64)]);

/// Returns the start of an act or an event.
///
/// Its trigger is first evaluated after `from_s`.
///
/// # Errors
///
/// Returns an error for conditions that a world cannot join.
pub(super) fn starts(
    node: &XmlNode,
    scope: &ParameterScope,
    from_s: f64,
    context: TriggerContext<'_>,
) -> Result<StartTrigger, ImportError> {
    let Some(trigger) = node.child("StartTrigger") else {
        return Ok(StartTrigger::At(from_s));
    };
    let mut possible: Vec<StartTrigger> = Vec::new();
    let mut blockers = Blockers::default();
    let mut groups = 0;
    for group in trigger.all("ConditionGroup") {
        groups += 1;
        let mut all: Vec<StartTrigger> = Vec::new();
        if has_instants(group) {
            context
                .0
                .catalogs
                .note("conditions of different instants", group);
            continue;
        }
        if group.children.len() > 1 && group.children.iter().any(is_instant) {
            if never_together(group, scope)? {
                context.0.catalogs.note("what never begins", node);
                continue;
            }
            let help = "use the rule greaterThan";
            let what = "a condition of one instant beside others is not read";
            blockers.keep::<()>(Err(group.refused(what, help)));
            continue;
        }
        let mut is_read = true;
        for condition in group.all("Condition") {
            match blockers.keep(condition_of(condition, scope, from_s, context)) {
                Some(one) => all.push(one),
                None => is_read = false,
            }
        }
        if !is_read {
            continue;
        }
        // A group of conditions holds only if all of them hold.
        if all.iter().any(|it| matches!(it, StartTrigger::Never)) {
            continue;
        }
        // A condition that holds at once adds nothing to the others.
        let is_now = |it: &StartTrigger| matches!(it, StartTrigger::At(at_s) if *at_s == from_s);
        all.retain(|it| !is_now(it));
        match blockers.keep(all_of(group, all)) {
            None => {}
            Some(None) if blockers.is_empty() => return Ok(StartTrigger::At(from_s)),
            Some(one) => possible.extend(one),
        }
    }
    blockers.none()?;
    match any_of(trigger, possible)? {
        Some(one) => Ok(one),
        // An empty trigger starts at once. Groups that never hold never start
        // it.
        None if groups == 0 => Ok(StartTrigger::At(from_s)),
        None => Ok(StartTrigger::Never),
    }
}

/// Returns whether a group needs a time or the state of an element, and what entities
/// do, at the same instant.
///
/// An edge is true for an instant, and two edges of different causes never are at
/// once.
fn has_instants(group: &XmlNode) -> bool {
    let is_edge = |it: &&XmlNode| it.raw("conditionEdge").is_some_and(|edge| edge != "none");
    let mut edges = group.children.iter().filter(is_edge);
    let has_watch = edges
        .clone()
        .any(|it| it.child("ByEntityCondition").is_some());
    let mut values = edges.by_ref().filter_map(|it| it.child("ByValueCondition"));
    has_watch && values.any(|it| it.child("ParameterCondition").is_none())
}

/// Returns whether a condition holds at one instant of time only.
fn is_instant(condition: &XmlNode) -> bool {
    let by = condition.child("ByValueCondition");
    let time = by.and_then(|it| it.child("SimulationTimeCondition"));
    time.is_some_and(|it| it.raw("rule") == Some("equalTo"))
}

/// Returns true if a group needs the first instant and a distance travelled by then.
fn never_together(group: &XmlNode, scope: &ParameterScope) -> Result<bool, ImportError> {
    let mut is_first = false;
    let mut has_moved = false;
    for condition in group.all("Condition") {
        let by = condition.child("ByValueCondition");
        if let Some(time) = by.and_then(|it| it.child("SimulationTimeCondition")) {
            is_first |= is_instant(condition) && scope.number(time, "value")? == 0.0;
        }
        let way = condition
            .child("ByEntityCondition")
            .and_then(|it| it.child("EntityCondition"));
        if let Some(way) = way.and_then(|it| it.child("TraveledDistanceCondition")) {
            has_moved |= scope.number(way, "value")? > 0.0;
        }
    }
    Ok(is_first && has_moved)
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
    context: TriggerContext<'_>,
) -> Result<StartTrigger, ImportError> {
    let (ground, known) = context;
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
            "ParameterCondition" => {
                let name = by.need("parameterRef")?.trim_start_matches('$');
                if ground.changed.iter().any(|changed| changed == name) {
                    let help = "wait for what changes it";
                    let what = format!("`{name}` is changed by an event");
                    return Err(by.refused(what, help));
                }
                parameter(by, scope, rises, from_s + delay_s)
            }
            "StoryboardElementStateCondition" => {
                let element = StoryElement {
                    kind: by.need("storyboardElementType")?.to_owned(),
                    name: scope.text(by, "storyboardElementRef")?,
                };
                // Players take the first of several elements of a name, or none.
                if ground.ambiguous.contains(&element) {
                    let what = format!("several elements are called `{}`", element.name);
                    return Err(by.refused(what, "give each of them a name of its own"));
                }
                let begins_s = known.iter().find(|(known, _)| *known == element);
                let begins_s = begins_s.map(|(_, begins_s)| begins_s.max(from_s));
                match by.raw("state") {
                    // It waits for what never begins.
                    _ if begins_s == Some(f64::INFINITY) => Ok(StartTrigger::Never),
                    // Both states begin when the element ends.
                    Some("endTransition" | "completeState") => {
                        Ok(StartTrigger::After { element, delay_s })
                    }
                    // Both states begin when the element begins.
                    Some("startTransition" | "runningState") => {
                        let begins_s = begins_s.ok_or_else(|| {
                            let what = format!("nothing says when `{}` begins", element.name);
                            by.refused(what, "wait for a time, or for the end of an element")
                        })?;
                        Ok(StartTrigger::At(begins_s + delay_s))
                    }
                    _ => Err(by.refused(
                        "only the begin or the end of an element is read",
                        "wait for its `startTransition` or its `endTransition`",
                    )),
                }
            }
            _ => Err(by.refused(
                "a condition of this kind is not read",
                "wait for a time, a parameter, or the end of an element",
            )),
        };
    }
    let entity = kind.child("EntityCondition").and_then(|it| it.only().ok());
    if entity.is_some_and(|it| it.name == "CollisionCondition") {
        ground.catalogs.note("what follows a contact", condition);
        return Ok(StartTrigger::Never);
    }
    let watch = watch(kind, scope, rises, ground)?;
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
        // The first instant is the only one that is met exactly.
        Some("equalTo") if at_s == 0.0 && from_s == 0.0 && !rises => false,
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
    let name = by.need("parameterRef")?.trim_start_matches('$');
    let value = scope.get(name).ok_or_else(|| {
        let help = "declare it in the `ParameterDeclarations`";
        by.refused(format!("there is no `{name}`"), help)
    })?;
    let rule = by.need("rule")?;
    let holds = compared(value, rule, &scope.text(by, "value")?)
        .ok_or_else(|| by.refused(format!("the rule `{rule}` is not understood"), RULES))?;
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
    ground: PositionContext<'_>,
) -> Result<WatchedCondition, ImportError> {
    let entities = kind.inner("TriggeringEntities")?;
    let who = entities
        .all("EntityRef")
        .map(|it| scope.text(it, "entityRef"))
        .collect::<Result<Vec<_>, _>>()?;
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
    let measure = measure(it, scope, ground)?;
    let is_below = match it.raw("rule") {
        // Equality has no duration, so both rules of a side are read alike.
        Some("lessThan" | "lessOrEqual") => true,
        Some("greaterThan" | "greaterOrEqual") => false,
        Some(rule) => {
            let help = "write lessThan, lessOrEqual, greaterThan or greaterOrEqual";
            return Err(it.refused(format!("the rule `{rule}` is not read here"), help));
        }
        // A place is reached within its tolerance, and a way is done beyond it.
        None => it.name == "ReachPositionCondition",
    };
    let value = match it.name.as_str() {
        "ReachPositionCondition" => "tolerance",
        _ => "value",
    };
    Ok(WatchedCondition {
        who,
        needs_all,
        measure,
        is_below,
        value: scope.number(it, value)?,
        rises,
        is_late: false,
        at: it.at(),
    })
}

/// Entity at the place of a condition, which goes on with the entity.
fn followed(it: &XmlNode, scope: &ParameterScope) -> Result<Option<String>, ImportError> {
    let position = it.child("Position").and_then(|it| it.children.first());
    let Some(place) = position.filter(|it| it.raw("entityRef").is_some()) else {
        return Ok(None);
    };
    for name in ["dx", "dy", "ds", "dsLane", "dt", "dLane", "offset"] {
        if scope.number_or_zero(place, name)? != 0.0 {
            let help = "wait for a distance to the entity itself";
            let what = "a place that goes on beside an entity is not read";
            return Err(place.refused(what, help));
        }
    }
    scope.text(place, "entityRef").map(Some)
}

/// ConditionQuantity of a condition of entities.
fn measure(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<Measure, ImportError> {
    let is_time = it.name == "TimeHeadwayCondition";
    let clear = it.raw("freespace") == Some("true");
    // Longitudinal is the default of headways, and the older attribute `alongRoute`
    // means the same.
    let kind = it.raw("relativeDistanceType").unwrap_or("longitudinal");
    let euclidian = matches!(kind, "cartesianDistance" | "euclidianDistance");
    let system = it.raw("coordinateSystem").filter(|_| !euclidian);
    if let Some(system @ ("world" | "trajectory")) = system {
        let what = format!("a distance in the coordinate system `{system}` is not read");
        let help = "measure it in the coordinate system of the entity, the lane or the road";
        return Err(it.refused(what, help));
    }
    let refused = |it: &XmlNode| {
        Err(it.refused(
            "a distance of this kind is not read",
            "measure it longitudinally or as euclidianDistance",
        ))
    };
    let target = || scope.text(it, "entityRef");
    if let Some(target) = followed(it, scope)? {
        let kind = it.raw("relativeDistanceType");
        return match kind.unwrap_or("euclidianDistance") {
            "longitudinal" if !clear => Ok(Measure::Along {
                target,
                is_time: false,
            }),
            "cartesianDistance" | "euclidianDistance" if !clear => Ok(Measure::Apart { target }),
            _ => refused(it),
        };
    }
    Ok(match it.name.as_str() {
        "RelativeDistanceCondition" | "TimeHeadwayCondition" => match (kind, clear) {
            ("longitudinal", true) => Measure::Clearance {
                target: target()?,
                is_time,
            },
            ("longitudinal", false) => Measure::Along {
                target: target()?,
                is_time,
            },
            ("cartesianDistance" | "euclidianDistance", _) if is_time => return refused(it),
            ("cartesianDistance" | "euclidianDistance", true) => Measure::Gap { target: target()? },
            ("cartesianDistance" | "euclidianDistance", false) => {
                Measure::Apart { target: target()? }
            }
            _ => return refused(it),
        },
        "TimeToCollisionCondition" => {
            let target = it.inner("TimeToCollisionConditionTarget")?.only()?;
            match (target.raw("entityRef"), kind, clear) {
                (Some(_), "longitudinal", true) => Measure::Collision {
                    target: scope.text(target, "entityRef")?,
                },
                _ => return refused(it),
            }
        }
        "SpeedCondition" if it.raw("direction").is_none() => Measure::Speed,
        "RelativeSpeedCondition" if it.raw("direction").is_none() => {
            Measure::Faster { target: target()? }
        }
        "AccelerationCondition" if it.raw("direction").is_none() => Measure::Acceleration,
        "TraveledDistanceCondition" => Measure::Travelled,
        "ReachPositionCondition" => Measure::Place {
            at: Box::new(ground.place(it.inner("Position")?, scope)?),
            is_along: false,
        },
        "DistanceCondition" if !clear => {
            let kind = it
                .raw("relativeDistanceType")
                .unwrap_or("euclidianDistance");
            Measure::Place {
                at: Box::new(ground.place(it.inner("Position")?, scope)?),
                is_along: match kind {
                    "longitudinal" => true,
                    "cartesianDistance" | "euclidianDistance" => false,
                    _ => return refused(it),
                },
            }
        }
        _ => {
            return Err(it.refused(
                "a condition of this kind is not read",
                "wait for a distance, a headway, a speed, a travelled distance or a place",
            ));
        }
    })
}
