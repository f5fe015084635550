//! Elements that esmini plays otherwise than OpenSCENARIO 1.3 says, listed with the import.
//!
//! The world follows the standard. Its sentences are in `docs/reference/protocols.md`.
//! Whether a run meets a difference depends on the run, so all that may do so are listed.

use super::StoryWriter;
use super::parts::{PartKind, StoryPart};
use super::quantities::is_along_route;
use super::survey::content;
use crate::opendrive::scope::{ParameterScope, number};
use crate::opendrive::tree::XmlNode;

const REPEATED: &str = "executions left of an event that another overrides";
const SKIPPED: &str = "skips that count as executions";
const STOPPED: &str = "stops by other actions or events, which are no ends";
const PAST: &str = "transitions before their condition was asked";
const WAITING: &str = "stop triggers of acts that have not begun";
const REACHED: &str = "changes of speed that may begin at their target";
/// A choice of brakecheck, for which no sentence of the standard is quoted.
const FOLLOWED: &str = "relative speeds that change until they are reached";
const ALONG: &str = "distances along the route";
const STANDING: &str = "lateral motion of agents that may stand";
const SCALED: &str = "scaled or shifted times of trajectories";

impl StoryWriter<'_> {
    /// Lists all that matters and may differ.
    pub(super) fn note_differences(&self) {
        for kind in [PartKind::Act, PartKind::Event, PartKind::Action] {
            for number in self.parts.all(kind).filter(|it| self.is_relevant[*it]) {
                match kind {
                    PartKind::Act => self.note_act(number),
                    PartKind::Event => self.note_event(number),
                    _ => self.note_action(number),
                }
                self.note_conditions(number);
            }
        }
    }

    fn note(&self, kind: &'static str, node: &XmlNode) {
        self.ground.catalogs.note(kind, node);
    }

    fn note_act(&self, number: usize) {
        let node = self.parts.0[number].node;
        let begins = self.survey.begins[number];
        // An act that surely begins at once never waits.
        let waits = begins.at_s > 0.0 || !begins.is_known;
        let stop = node.child("StopTrigger");
        if let Some(stop) = stop.filter(|it| waits && !it.children.is_empty()) {
            self.note(WAITING, stop);
        }
    }

    fn note_event(&self, number: usize) {
        let part = &self.parts.0[number];
        if self.is_overridden(number) && repeats(part) {
            self.note(REPEATED, part.node);
        }
        let is_skip = part.node.raw("priority") == Some("skip");
        // Only another event of the maneuver can run and cause a skip.
        if is_skip && self.beside(number).next().is_some() {
            self.note(SKIPPED, part.node);
        }
    }

    /// Returns the events that matter in the maneuver of an event, without itself.
    fn beside(&self, event: usize) -> impl Iterator<Item = usize> {
        let parent = self.parts.0[event].parent;
        let all = self.parts.all(PartKind::Event);
        all.filter(move |it| {
            *it != event && self.is_relevant[*it] && self.parts.0[*it].parent == parent
        })
    }

    fn is_overridden(&self, event: usize) -> bool {
        self.beside(event).any(|it| {
            let priority = self.parts.0[it].node.raw("priority");
            matches!(priority, Some("override" | "overwrite"))
        })
    }

    fn note_action(&self, number: usize) {
        let part = &self.parts.0[number];
        let Ok(Some((_, node))) = content(part.node) else {
            return;
        };
        match node.name.as_str() {
            "LaneOffsetAction" | "LaneChangeAction" if is_zero_somewhere(self.root) => {
                self.note(STANDING, node);
            }
            "SpeedAction" => {
                let event = part.parent.map(|event| &self.parts.0[event]);
                let dynamics = node.child("SpeedActionDynamics");
                let takes_time = dynamics.is_some_and(|it| {
                    it.raw("dynamicsDimension") == Some("time")
                        && it.raw("dynamicsShape") != Some("step")
                });
                if takes_time && (event.is_some_and(repeats) || self.is_target_twice(node)) {
                    self.note(REACHED, node);
                }
                let is_step = dynamics.and_then(|it| it.raw("dynamicsShape")) == Some("step");
                if !is_step && is_read_once(node, part) {
                    self.note(FOLLOWED, node);
                }
            }
            "FollowTrajectoryAction" if changes_times(node, &part.scope) => {
                self.note(SCALED, node);
            }
            _ => {}
        }
    }

    /// Returns whether another speed of the file is the target of an action.
    fn is_target_twice(&self, node: &XmlNode) -> bool {
        let target = node.child("SpeedActionTarget");
        let own = target.and_then(|it| it.child("AbsoluteTargetSpeed"));
        let value = own.and_then(|it| it.raw("value"));
        // The list contains the target itself, so only a second entry counts.
        value.is_some_and(|value| speeds(self.root).filter(|it| *it == value).count() > 1)
    }

    fn note_conditions(&self, number: usize) {
        let triggers = ["StartTrigger", "StopTrigger"];
        let part = &self.parts.0[number];
        // A wrong word is a problem of its condition, which names it.
        let is_along = |it: &XmlNode| is_along_route(it, &part.scope).unwrap_or(false);
        let node = part.node;
        for trigger in triggers.iter().filter_map(|name| node.child(name)) {
            for condition in inside(trigger, &|it| it.name == "StoryboardElementStateCondition") {
                self.note_transition(number, condition);
            }
            for condition in inside(trigger, &is_along) {
                self.note(ALONG, condition);
            }
        }
    }

    /// Lists a condition of an element that waits for a transition of another.
    fn note_transition(&self, number: usize, condition: &XmlNode) {
        let named = condition
            .raw("storyboardElementType")
            .and_then(PartKind::called)
            .zip(condition.raw("storyboardElementRef"))
            .map(|(kind, name)| self.parts.named(kind, name));
        let state = condition.raw("state").unwrap_or_default();
        let Some([of, ..]) = named.as_deref() else {
            return;
        };
        let is_end = matches!(state, "endTransition" | "stopTransition");
        if is_end && self.may_be_stopped(*of, number) {
            self.note(STOPPED, condition);
        }
        let is_event = self.parts.0[number].kind == PartKind::Event;
        if is_event && state.ends_with("Transition") && self.act_of(*of) != self.act_of(number) {
            self.note(PAST, condition);
        }
    }

    /// Returns whether another action or event than the one that waits may stop an element.
    fn may_be_stopped(&self, of: usize, waiting: usize) -> bool {
        match self.parts.0[of].kind {
            // Any later action may take its agent over.
            PartKind::Action => true,
            PartKind::Event => {
                // The event that waits overrides nothing before its condition is true.
                let others = self.beside(of).filter(|it| *it != waiting);
                let mut priorities = others.map(|it| self.parts.0[it].node.raw("priority"));
                priorities.any(|it| matches!(it, Some("override" | "overwrite")))
            }
            _ => false,
        }
    }

    fn act_of(&self, number: usize) -> Option<usize> {
        let mut around = self.parts.around(number);
        around.find(|it| self.parts.0[*it].kind == PartKind::Act)
    }
}

fn repeats(part: &StoryPart<'_>) -> bool {
    let often = part.scope.number(part.node, "maximumExecutionCount");
    // A wrong count is reported where the event is written.
    often.is_ok_and(|it| it > 1.0)
}

/// Returns whether an action scales the times of its trajectory, or shifts them.
fn changes_times(action: &XmlNode, scope: &ParameterScope) -> bool {
    let reference = action.child("TimeReference");
    let timing = reference.and_then(|it| it.child("Timing"));
    timing.is_some_and(|it| {
        let scales = scope.number(it, "scale").is_ok_and(|scale| scale != 1.0);
        scales || scope.number(it, "offset").is_ok_and(|offset| offset != 0.0)
    })
}

/// Returns whether the target of a speed is relative to another entity, and does not last.
fn is_read_once(node: &XmlNode, part: &StoryPart<'_>) -> bool {
    let target = node.child("SpeedActionTarget");
    let relative = target.and_then(|it| it.child("RelativeTargetSpeed"));
    relative.is_some_and(|it| {
        let of = part.scope.text(it, "entityRef").unwrap_or_default();
        !part.scope.is_true(it, "continuous").unwrap_or(false) && !part.actors.contains(&of)
    })
}

/// Returns the elements inside a node that a test finds.
fn inside<'a>(node: &'a XmlNode, is_it: &dyn Fn(&XmlNode) -> bool) -> Vec<&'a XmlNode> {
    let mut found = Vec::new();
    for child in &node.children {
        if is_it(child) {
            found.push(child);
        }
        found.extend(inside(child, is_it));
    }
    found
}

/// Returns the absolute target speeds of a file, as it writes them.
fn speeds(root: &XmlNode) -> impl Iterator<Item = &str> {
    let all = inside(root, &|it| it.name == "AbsoluteTargetSpeed");
    all.into_iter().filter_map(|it| it.raw("value"))
}

fn is_zero_somewhere(root: &XmlNode) -> bool {
    speeds(root).any(|it| number(it) == Some(0.0))
}
