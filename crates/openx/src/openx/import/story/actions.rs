//! Actions of events, as those of a world's storyboard.

use super::numbers::StatedIn;
use super::speeds::{keeps_speed, speed};
use super::survey::{TakenAction, content};
use super::triggers::signal_state;
use super::{StoryWriter, relevant};
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::lights::{light_name, shown};
use crate::openx::import::motion::friction_of;
use crate::openx::import::seen::EntityInFrame;
use crate::openx::import::still::is_still;
use crate::story::values::{Action, Effect};

/// Effect of an action without an effect on motion.
const NONE: Effect = Effect::ActivateController {
    longitudinal: None,
    lateral: None,
};

impl StoryWriter<'_> {
    /// Returns whether an action moves anybody, or may be found not to be read.
    pub(super) fn moves(&self, number: usize) -> bool {
        let part = &self.parts.0[number];
        let begin = self.survey.begins[number];
        let is_start = matches!(
            self.survey.taken.get(&number),
            Some(TakenAction::Start | TakenAction::Approach)
        );
        // An action that never begins moves nobody.
        if is_start || begin.at_s == f64::INFINITY {
            return false;
        }
        let (kind, node) = match content(part.node) {
            Ok(Some(content)) => content,
            Ok(None) => return false,
            // The problem is reported when the action is written.
            Err(_) => return true,
        };
        match kind.name.as_str() {
            "PrivateAction" => {
                let is_free = !part.actors.iter().any(|it| self.ground.is_steered(it));
                // A problem counts as motion, so that the action is written and its
                // problem named.
                let is_still = is_still(node, &part.scope, is_free).unwrap_or(false);
                // What the ego does is left to the user, or refused.
                let ego = &self.ground.ego.name;
                let is_absent = |it: &String| it == ego || self.ground.absent.contains(it);
                let has_no_actor = !self.is_triggering(number) && part.actors.iter().all(is_absent);
                !is_still && !has_no_actor
            }
            "GlobalAction" => match node.name.as_str() {
                "EnvironmentAction" => {
                    let scale = friction_of(node, &part.scope, self.ground);
                    // The same factor as in the Init changes nothing.
                    scale.map_or(true, |it| it.is_some_and(|it| it != self.friction_scale))
                }
                "InfrastructureAction" => self.signal(number, node).is_some(),
                _ => relevant::changed(part.node).is_none(),
            },
            _ => true,
        }
    }

    /// Returns the written actions of an event.
    pub(super) fn actions(&mut self, event: usize) -> Vec<(usize, Action)> {
        let parts = self.parts;
        let mut written = Vec::new();
        for number in parts.0[event].parts.clone() {
            let effect = self.effect(number);
            // A refused action is named, and its place in the event is kept.
            let does = self.blockers.keep(effect).unwrap_or(NONE);
            let name = parts.0[number].name.clone();
            written.push((number, Action { name, does }));
        }
        // A world has no event without an action.
        if written.is_empty() {
            let name = "nothing".to_owned();
            written.push((event, Action { name, does: NONE }));
        }
        written
    }

    fn effect(&mut self, number: usize) -> Result<Effect, ImportError> {
        let part = &self.parts.0[number];
        let Some((kind, node)) = content(part.node)? else {
            return Ok(NONE);
        };
        let at = StatedIn {
            node,
            scope: &part.scope,
            owner: &part.name,
        };
        match kind.name.as_str() {
            "PrivateAction" => self.private(number, at),
            "GlobalAction" => self.global(number, at),
            _ => {
                let help = "leave it out: what moves anybody is a `PrivateAction`";
                Err(kind.refused("an action of this kind is not read", help))
            }
        }
    }

    fn private(&mut self, number: usize, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let part = &self.parts.0[number];
        let is_free = !part.actors.iter().any(|it| self.ground.is_steered(it));
        if is_still(at.node, at.scope, is_free)? {
            return Ok(NONE);
        }
        let actors = self.present_actors(number);
        let acts = !actors.is_empty() || self.is_triggering(number);
        match self.survey.taken.get(&number) {
            Some(TakenAction::Start | TakenAction::Approach) => return Ok(NONE),
            // The path is the road of the entity, along which only speeds are left.
            Some(TakenAction::Timed { legs, stops }) => return Ok(self.legs(at, legs, *stops)),
            None => {}
        }
        let is_across = matches!(
            at.node.name.as_str(),
            "LaneChangeAction" | "LaneOffsetAction"
        );
        if is_across && self.is_triggering(number) {
            let help = "name the actors by EntityRef, with selectTriggeringEntities=\"false\"";
            let what = "a lane of actors that trigger their event is not read";
            return Err(at.node.refused(what, help));
        }
        let is_several = actors.len() > 1 || self.is_triggering(number);
        if at.node.name == "SpeedAction" && is_several && keeps_speed(at)? {
            let help = "leave it out, or give each actor a `ManeuverGroup` of its own";
            let what = "a speed at a rate of 0 of several actors is not read";
            return Err(at.node.refused(what, help));
        }
        let effect = self.private_effect(at, &actors)?;
        // Without a frame no actor is known, and the action is read for its problems.
        Ok(if acts || self.frame.is_none() {
            effect
        } else {
            NONE
        })
    }

    fn private_effect(
        &mut self,
        at: StatedIn<'_>,
        actors: &[&EntityInFrame<'_>],
    ) -> Result<Effect, ImportError> {
        let it = at.node;
        let single = match actors {
            [one] => Some(*one),
            _ => None,
        };
        match it.name.as_str() {
            "SpeedAction" => {
                let own = single.map(|it| it.name.as_str());
                self.compare_speeds(at, own)?;
                speed(at, self.numbers, own, &|node, name| self.entity(node, name))
            }
            "SpeedProfileAction" => self.profile(at),
            "LongitudinalDistanceAction" => self.distance_along(at),
            "SynchronizeAction" => self.synchronize(at),
            "LaneChangeAction" => self.lane_change(at, actors),
            "LaneOffsetAction" => self.lane_offset(at, actors),
            "LateralDistanceAction" => self.distance_across(at),
            "FollowTrajectoryAction" => self.trajectory(at),
            "TeleportAction" => Ok(Effect::Teleport {
                position: self.turned_position(at.at(it.inner("Position")?), true)?,
            }),
            "AssignRouteAction" | "AcquirePositionAction" => {
                let help = "give the entity one route, alone in its `ManeuverGroup`";
                Err(it.refused("a second route of an entity is not read", help))
            }
            _ => {
                let help = "a speed, a lane, an offset, a distance, a meeting, a trajectory, a \
                            route or a place";
                Err(it.refused("an action of this kind is not read here", help))
            }
        }
    }

    fn global(&mut self, number: usize, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        match it.name.as_str() {
            "EntityAction" => {
                if self.survey.taken.contains_key(&number) {
                    return Ok(NONE);
                }
                let name = at.scope.text(it, "entityRef")?;
                let entity = self.entity(it, &name)?;
                match it.child("AddEntityAction") {
                    Some(added) => Ok(Effect::Add {
                        entity,
                        position: self.turned_position(at.at(added.inner("Position")?), true)?,
                    }),
                    None => Ok(Effect::Delete { entity }),
                }
            }
            "EnvironmentAction" => {
                let stated = friction_of(it, at.scope, self.ground)?;
                let scale = stated.filter(|scale| *scale != self.friction_scale);
                // The world's friction has the factor of the Init already.
                let base = self
                    .frame
                    .as_ref()
                    .map_or(1.0, |frame| frame.concrete.friction / self.friction_scale);
                Ok(scale.map_or(NONE, |scale| Effect::Friction {
                    value: self.numbers.stated(at, &[], base * scale),
                }))
            }
            "InfrastructureAction" => Ok(self.signal(number, it).unwrap_or(NONE)),
            _ => match relevant::changed(self.parts.0[number].node) {
                Some(name) => self.changed_variable(at, name),
                None => {
                    let help = "leave it out, or let an entity act instead";
                    Err(it.refused("an action of this kind is not read", help))
                }
            },
        }
    }

    /// Returns the change of a light of the ego's way.
    fn signal(&self, number: usize, node: &XmlNode) -> Option<Effect> {
        let scope = &self.parts.0[number].scope;
        let action = node.child("TrafficSignalAction").unwrap_or(node);
        let state = action.child("TrafficSignalStateAction")?;
        let signal = scope.text(state, "name").ok()?;
        // States without a colour change nothing that an ego sees.
        let phase = shown(&scope.text(state, "state").ok()?)?;
        let frame = self.frame.as_ref()?;
        let mut lights = frame.concrete.lights.iter();
        lights
            .any(|light| light.signal == signal)
            .then(|| Effect::TrafficSignal {
                name: light_name(&signal),
                state: signal_state(phase),
            })
    }

    fn changed_variable(&mut self, at: StatedIn<'_>, name: &str) -> Result<Effect, ImportError> {
        let it = at.node;
        let variable = self.variable(at, name)?;
        let change = it.only()?;
        // Both kinds of actions have had names of their own.
        if change.name.ends_with("SetAction") {
            let value = self.variable_value(at.at(change))?;
            return Ok(Effect::VariableSet {
                name: variable,
                value,
            });
        }
        let rule = change.child("Rule").unwrap_or(change).only()?;
        let value = self.numbers.of(at.at(rule), "value", |value| value)?;
        match rule.name.as_str() {
            "AddValue" => Ok(Effect::VariableAdd {
                name: variable,
                value,
            }),
            "MultiplyByValue" => Ok(Effect::VariableMultiply {
                name: variable,
                value,
            }),
            _ => {
                let help = "set it, add to it or multiply it";
                Err(rule.refused("a change of this kind is not read", help))
            }
        }
    }
}
