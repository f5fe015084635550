//! Steps of one entity, and what its events allow.

use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::entity::{
    Approached, ImportedEntity, ImportedLaw, ImportedStep, LateralState, WatchedCondition,
};
use crate::openx::import::journey::to_mps;
use crate::openx::import::laws::Speeds;
use crate::openx::import::places::Placed;
use crate::openx::import::story_element::StoryElement;
use crate::road::ChangeShape;

/// Event with its surrounding elements.
pub(super) struct EventContext<'a> {
    pub act: &'a XmlNode,
    pub begins_s: f64,
    /// Condition of the act with its delay, if the act waits for one.
    pub waits: Option<&'a (WatchedCondition, f64)>,
    pub group: &'a XmlNode,
    pub maneuver: &'a XmlNode,
    pub event: &'a XmlNode,
    pub scope: &'a ParameterScope,
    pub actors: &'a [String],
}

/// Whether an event acts along the path and across it.
#[derive(Clone, Copy)]
pub(super) struct Directions {
    pub along: bool,
    pub across: bool,
}

impl Directions {
    pub(super) fn of(actions: &[&XmlNode]) -> Directions {
        let has = |name: &str| actions.iter().any(|action| action.name == name);
        Directions {
            along: has("LongitudinalAction"),
            across: has("LateralAction"),
        }
    }

    fn is_along_only(self) -> bool {
        self.along && !self.across
    }
}

/// Steps of one entity, as far as they have been read.
pub(super) struct EntityScript {
    pub name: String,
    pub placed: Placed,
    pub speeds: Speeds,
    pub lane: Option<i32>,
    pub lateral: LateralState,
    pub steps: Vec<ImportedStep>,
    pub approach: Option<Approached>,
    pub gap_m: Option<f64>,
    /// True once an event of the entity has been read.
    pub has_begun: bool,
    /// Elements that end together with the previous step.
    pub ended: Vec<StoryElement>,
    /// Places of the act and of the maneuver of the previous step.
    pub act: usize,
    pub maneuver: usize,
    /// Time and speed at which the previous step begins, as far as known before the run.
    pub last: Option<(f64, Option<f64>)>,
    /// Time in seconds at which the previous step ends, if it is known before the run.
    pub ends_s: Option<f64>,
    /// Time in seconds until which a law across the path goes on beside later steps.
    pub aside_s: f64,
    /// True if a change across the path may have been cut anywhere.
    pub is_cut: bool,
    /// True for an entity on foot.
    pub on_foot: bool,
    /// True once it follows a trajectory of an event.
    pub follows: bool,
    /// True once an event of the entity is refused, so that its steps are not known.
    pub is_broken: bool,
    /// Greatest lateral speed in m/s of the last change across the path.
    pub across_mps: f64,
    /// True if the last change across the path is one by distance.
    pub is_by_distance: bool,
    /// Steps of the same event after the first.
    pub later: Vec<ImportedStep>,
}

impl EntityScript {
    pub(super) fn of(entity: &ImportedEntity) -> EntityScript {
        EntityScript {
            name: entity.name.clone(),
            placed: entity.placed.clone(),
            speeds: Speeds {
                name: entity.name.clone(),
                now_mps: Some(final_mps(entity)),
                most_mps: entity.body.most_mps,
                most: entity.body.most,
            },
            lane: entity.placed.lane.as_ref().map(|at| at.lane),
            lateral: LateralState::at_start(&entity.placed),
            // The Init may already contain a step.
            has_begun: !entity.steps.is_empty(),
            steps: entity.steps.clone(),
            approach: None,
            gap_m: entity.gap_m,
            ended: Vec::new(),
            act: 0,
            maneuver: 0,
            ends_s: first_s(entity),
            aside_s: 0.0,
            is_cut: false,
            on_foot: entity.body.on_foot,
            follows: false,
            is_broken: false,
            across_mps: 0.0,
            is_by_distance: false,
            later: Vec::new(),
            last: (!entity.steps.is_empty()).then_some((0.0, Some(entity.speed_mps))),
        }
    }

    /// Time in seconds until which a change across the path goes on, as far as known.
    pub(super) fn aside_until_s(&self) -> f64 {
        self.ends_s.unwrap_or(f64::INFINITY).max(self.aside_s)
    }

    /// Lets a step that waits begin beside a change across the path that waits too.
    ///
    /// Returns false if it might begin first, or if both cannot overlap.
    pub(super) fn overlaps_with(&mut self, watch: &WatchedCondition, acts: Directions) -> bool {
        let Some(last) = self.steps.last_mut() else {
            return false;
        };
        let is_across = matches!(
            last.laws[..],
            [ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. }]
        );
        let before = last.when.as_ref().filter(|_| last.after_s == 0.0);
        let follows = before.is_some_and(|before| watch.follows(before));
        last.overlaps = is_across && follows && acts.is_along_only();
        last.overlaps
    }

    /// Makes room for a step at a time before the end of the previous step.
    ///
    /// A change of speed is cut in two, and its rest is returned unless the new
    /// step changes the speed, too. A change of lane goes on beside a change of
    /// speed. Returns the delay of the step, or `None` if both cannot overlap.
    pub(super) fn overlap(
        &mut self,
        at_s: f64,
        acts: Directions,
        replaces: bool,
    ) -> Option<(f64, Option<ImportedLaw>)> {
        let (begins_s, from_mps) = self.last?;
        // A change of the Init is none of an event: only another of the same kind stops it.
        let stops = replaces && self.act != 0;
        let last = self.steps.last_mut().filter(|_| begins_s <= at_s)?;
        let is_across = matches!(
            last.laws[..],
            [ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. }]
        );
        // Two changes that the step would stop are not read.
        if stops && !is_across && at_s < self.aside_s {
            return None;
        }
        match &mut last.laws[..] {
            [ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. }]
                if acts.is_along_only() =>
            {
                last.overlaps = true;
                // The next step counts from the begin of this one, and ends beside it.
                self.aside_s = if stops {
                    at_s
                } else {
                    self.aside_s.max(self.ends_s?)
                };
                self.ends_s = Some(begins_s);
                self.is_cut |= stops;
                Some((at_s - begins_s, stops.then(stop_aside)))
            }
            [
                ImportedLaw::Speed {
                    to_mps,
                    relative_to: None,
                    rate_mps2: Some(rate_mps2),
                    shape: ChangeShape::Linear,
                },
            ] => {
                // Whether one of two changes of speed wins is said by the priority only.
                if acts.along && !replaces {
                    return None;
                }
                let from_mps = from_mps?;
                let rest = ImportedLaw::Speed {
                    to_mps: *to_mps,
                    relative_to: None,
                    rate_mps2: Some(*rate_mps2),
                    shape: ChangeShape::Linear,
                };
                let sign = (*to_mps - from_mps).signum();
                *to_mps = from_mps + sign * *rate_mps2 * (at_s - begins_s);
                self.speeds.now_mps = Some(*to_mps);
                self.ends_s = Some(at_s);
                Some((0.0, (!acts.along && !stops).then_some(rest)))
            }
            _ => None,
        }
    }
}

/// Law that stops a change across the path, wherever that is by then.
pub(super) fn stop_aside() -> ImportedLaw {
    ImportedLaw::LaneChange {
        by_m: 0.0,
        rate_mps: 1.0,
        shape: ChangeShape::Cosine,
    }
}

/// Speed in m/s after the step of the Init, if there is one.
fn final_mps(entity: &ImportedEntity) -> f64 {
    let laws = entity.steps.iter().flat_map(|step| &step.laws);
    let mut speeds = laws.filter_map(|law| to_mps(law, 0.0));
    speeds.next_back().unwrap_or(entity.speed_mps)
}

/// Duration in seconds of the step of the Init.
fn first_s(entity: &ImportedEntity) -> Option<f64> {
    let laws = entity.steps.iter().flat_map(|step| &step.laws);
    let mut lasts = laws.map(|law| law.lasts_s(Some(entity.speed_mps), LateralState::default()));
    lasts.try_fold(0.0, |sum, lasts_s| Some(sum + lasts_s?))
}

/// Refuses repeated events, and actors that are selected during the scenario.
pub(super) fn happens_once(context: &EventContext<'_>) -> Result<(), ImportError> {
    let mut actions = context.event.all("Action");
    let is_alone = context.maneuver.all("Event").count() == 1;
    // Once it has happened, it changes nothing when it happens again.
    let is_settled =
        (is_alone && actions.all(|action| !is_relative(action))) || comes_once(context.event);
    let mut blockers = Blockers::default();
    for node in [context.event, context.group] {
        let often = context.scope.number_or_zero(node, "maximumExecutionCount");
        let Some(often) = blockers.keep(often) else {
            continue;
        };
        let is_read = often == 1.0 || is_settled && often > 1.0 && often.fract() == 0.0;
        if node.raw("maximumExecutionCount").is_some() && !is_read {
            let what = format!("it is carried out {often} times: only 1 is read");
            let help = "write an event for each time, each after the end of the one before";
            blockers.add(node.refused(what, help));
        }
    }
    let actors = context.group.child("Actors");
    let selected = actors.and_then(|it| it.raw("selectTriggeringEntities"));
    if let (Some(actors), Some("true")) = (actors, selected) {
        let what = "actors who are those that trigger it are not read";
        let help = "name them by EntityRef, with selectTriggeringEntities=\"false\"";
        blockers.add(actors.refused(what, help));
    }
    blockers.none()
}

/// Returns whether what an event waits for comes once, whatever its count.
fn comes_once(event: &XmlNode) -> bool {
    let comes_once = |condition: &XmlNode| {
        let Some(by) = condition.child("ByValueCondition") else {
            return false;
        };
        let is_edge = matches!(
            condition.raw("conditionEdge"),
            Some("rising" | "risingOrFalling")
        );
        let is_transition = by
            .child("StoryboardElementStateCondition")
            .and_then(|it| it.raw("state"))
            .is_some_and(|state| state.ends_with("Transition"));
        is_transition || (is_edge && by.child("SimulationTimeCondition").is_some())
    };
    let mut groups = event
        .child("StartTrigger")
        .into_iter()
        .flat_map(|it| &it.children)
        .peekable();
    groups.peek().is_some() && groups.all(|group| group.children.iter().any(comes_once))
}

/// Returns whether an action has another effect the second time.
fn is_relative(action: &XmlNode) -> bool {
    let absolute = [
        "AbsoluteTargetSpeed",
        "AbsoluteTargetLane",
        "AbsoluteTargetLaneOffset",
    ];
    fn leaves<'a>(node: &'a XmlNode, all: &mut Vec<&'a str>) {
        if node.name.contains("Target") && !node.name.ends_with("Target") {
            all.push(&node.name);
        }
        node.children.iter().for_each(|child| leaves(child, all));
    }
    let mut all = Vec::new();
    leaves(action, &mut all);
    all.is_empty() || all.iter().any(|name| !absolute.contains(name))
}

impl EventContext<'_> {
    /// Returns true for an event that stops the previous one of an entity, if that goes on.
    ///
    /// Its priority only counts within its maneuver.
    pub(super) fn replaces(&self, script: &EntityScript) -> bool {
        let priority = self.event.raw("priority");
        // A change of the Init has no maneuver, and ends with any.
        let is_same = (script.act, script.maneuver) == (self.act.place, self.maneuver.place)
            || script.act == 0;
        is_same && matches!(priority, Some("override" | "overwrite"))
    }
}

/// Elements that end with the event: those without other activity.
pub(super) fn ended(context: &EventContext<'_>, moving: usize) -> Vec<StoryElement> {
    let mut ended = Vec::new();
    // With several actors, the element ends with the slowest of them.
    if context.actors.len() != 1 {
        return ended;
    }
    ended.extend(StoryElement::of("event", context.event));
    let actions: Vec<&XmlNode> = context.event.all("Action").collect();
    if let ([action], 1) = (&actions[..], moving) {
        ended.extend(StoryElement::of("action", action));
    }
    // A maneuver with several events ends with the last of them.
    if context.maneuver.all("Event").count() == 1 {
        ended.extend(StoryElement::of("maneuver", context.maneuver));
    }
    ended
}
