//! Check of the actions of an event.

use super::{Check, CheckedStoryboard, MOST};
use crate::ron_file::ValuePath;
use crate::tree::{Actors, CheckedEffect, ElementKind, VariableChange};
use crate::values::{
    Action, DistanceOrTime, DynamicsShape, Effect, LaneTarget, LateralDisplacement,
    LongitudinalDisplacement, OffsetTarget, SpeedTarget, StoryNumber,
};
use crate::view::{
    ActorAction, ActorDistance, ActorLane, ActorOffset, ActorSpeed, DistanceSide, RelativeTarget,
    SceneChange, Synchronization,
};

impl CheckedStoryboard {
    /// Returns whether an action may change the friction of the road.
    pub fn changes_friction(&self) -> bool {
        let mut effects = self.elements.iter().map(|element| &element.effect);
        effects.any(|it| matches!(it, Some(CheckedEffect::Scene(SceneChange::Friction(_)))))
    }
}

impl Check<'_, '_> {
    pub(super) fn action(
        &mut self,
        path: &ValuePath,
        event: usize,
        action: &Action,
        actors: &Actors,
    ) {
        let number = self.add(path, ElementKind::Action, event, &action.name);
        let effect = self.effect(&path.to("does"), &action.does, actors);
        // An action for controllers that nobody has needs no actor.
        let is_idle = matches!(action.does, Effect::ActivateController { .. });
        let has_none =
            matches!(&effect, CheckedEffect::Of { actors, .. } if actors.all().next().is_none());
        if has_none && !is_idle {
            let what = format!("`{}` has no actor", action.name);
            self.wrong(path, what, "write `actors` in its maneuver group");
        }
        self.lanes(&path.to("does"), &effect);
        self.elements[number].effect = Some(effect);
    }

    /// Reports two actions of one event that control the same motion of an agent.
    pub(super) fn conflicts(&mut self, path: &ValuePath, event: usize) {
        let children = self.elements[event].children.iter();
        let effects = children.map(|it| self.elements[*it].effect.as_ref());
        let controlled = effects.map(|effect| match effect {
            Some(CheckedEffect::Of { action, .. }) => action.domains(),
            _ => &[],
        });
        let domains: Vec<_> = controlled.collect();
        for (i, own) in domains.iter().enumerate() {
            // All actions of an event have the same actors, so a shared
            // domain is a conflict.
            let mut before = domains[..i].iter().copied().flatten();
            if before.any(|domain| own.contains(domain)) {
                let what = "two actions of one event control the same motion".to_owned();
                self.wrong(&path.at(i), what, "put them into two events");
            }
        }
    }

    /// Reports actors without a lane, and lanes that their roads do not have.
    fn lanes(&mut self, path: &ValuePath, effect: &CheckedEffect) {
        let CheckedEffect::Of { actors, action } = effect else {
            return;
        };
        if !matches!(
            action,
            ActorAction::LaneChange { .. }
                | ActorAction::LaneOffset { .. }
                | ActorAction::LateralDistance(_)
        ) {
            return;
        }
        // An unknown actor counts as number 0, which may not exist.
        for actor in actors.all().filter(|it| *it < self.names.agents.len()) {
            let name = &self.names.agents[actor];
            let lanes = self.names.lanes[actor];
            if self.names.on_foot.contains(name) {
                let what = format!("`{name}` walks and has no lane");
                self.wrong(path, what, "let a vehicle do it");
            }
            // A relative lane beyond the road is the outermost one, so only a
            // number can be wrong.
            if let ActorAction::LaneChange {
                target: ActorLane::Absolute(lane),
                ..
            } = action
                && *lane >= lanes
            {
                let what = format!("the road of `{name}` has no lane {lane}");
                let help = format!("write a number below {lanes}");
                self.wrong(&path.to("target").to("lane"), what, &help);
            }
        }
    }

    fn effect(&mut self, path: &ValuePath, effect: &Effect, actors: &Actors) -> CheckedEffect {
        let action = match effect {
            Effect::Speed { target, dynamics } => ActorAction::Speed {
                target: self.speed(&path.to("target"), target),
                dynamics: self.dynamics(&path.to("dynamics"), dynamics),
            },
            Effect::SpeedProfile {
                entity,
                points,
                following,
                limits,
            } => {
                self.not_empty(&path.to("points"), points.len(), "speed");
                let of = entity.as_ref();
                // Relative speeds may be negative.
                let least_mps = if of.is_some() { -MOST } else { 0.0 };
                ActorAction::SpeedProfile {
                    relative_to: of.map(|it| self.agent(&path.to("entity"), it)),
                    points: self.speed_points(&path.to("points"), points, least_mps),
                    following: *following,
                    limits: self.limits(&path.to("limits"), limits),
                }
            }
            Effect::LongitudinalDistance {
                entity,
                distance,
                displacement,
                freespace,
                coordinate_system,
                continuous,
                limits,
            } => ActorAction::LongitudinalDistance(ActorDistance {
                of: self.agent(&path.to("entity"), entity),
                distance: self.distance(&path.to("distance"), distance),
                side: match displacement {
                    LongitudinalDisplacement::Any => DistanceSide::Any,
                    LongitudinalDisplacement::Trailing => DistanceSide::Less,
                    LongitudinalDisplacement::Leading => DistanceSide::More,
                },
                freespace: *freespace,
                system: *coordinate_system,
                continuous: *continuous,
                limits: self.limits(&path.to("limits"), limits),
            }),
            Effect::LateralDistance {
                entity,
                distance_m,
                displacement,
                freespace,
                coordinate_system,
                continuous,
                limits,
            } => {
                let distance_m = self.number(&path.to("distance_m"), distance_m, 0.0);
                ActorAction::LateralDistance(ActorDistance {
                    of: self.agent(&path.to("entity"), entity),
                    distance: DistanceOrTime::Metres(distance_m),
                    side: match displacement {
                        LateralDisplacement::Any => DistanceSide::Any,
                        LateralDisplacement::RightTo => DistanceSide::Less,
                        LateralDisplacement::LeftTo => DistanceSide::More,
                    },
                    freespace: *freespace,
                    system: *coordinate_system,
                    continuous: *continuous,
                    limits: self.limits(&path.to("limits"), limits),
                })
            }
            Effect::Synchronize {
                master,
                master_position,
                target_position,
                final_speed,
                steady,
                master_tolerance_m,
                target_tolerance_m,
            } => {
                let (speed_at, steady_at) = (path.to("final_speed"), path.to("steady"));
                let (final_speed, steady) = (final_speed.as_ref(), steady.as_ref());
                ActorAction::Synchronize(Synchronization {
                    master: self.agent(&path.to("master"), master),
                    master_place: self.place(&path.to("master_position"), master_position),
                    target_place: self.place(&path.to("target_position"), target_position),
                    final_speed: final_speed.map(|it| self.final_speed(&speed_at, it)),
                    steady: steady.map(|it| self.distance(&steady_at, it)),
                    master_tolerance_m: self.number(
                        &path.to("master_tolerance_m"),
                        master_tolerance_m,
                        0.0,
                    ),
                    target_tolerance_m: self.number(
                        &path.to("target_tolerance_m"),
                        target_tolerance_m,
                        0.0,
                    ),
                })
            }
            Effect::LaneChange {
                target,
                target_lane_offset_m,
                dynamics,
            } => ActorAction::LaneChange {
                target: match target {
                    LaneTarget::Absolute { lane } => ActorLane::Absolute(*lane),
                    LaneTarget::Relative { entity, lanes } => {
                        let at = path.to("target").to("entity");
                        ActorLane::Relative(self.agent(&at, entity), *lanes)
                    }
                    LaneTarget::Line { lateral_m } => {
                        let at = path.to("target").to("lateral_m");
                        ActorLane::Line(self.number(&at, lateral_m, -MOST))
                    }
                },
                offset_m: self.number(
                    &path.to("target_lane_offset_m"),
                    target_lane_offset_m,
                    -MOST,
                ),
                dynamics: self.dynamics(&path.to("dynamics"), dynamics),
            },
            Effect::LaneOffset {
                target_m,
                target,
                continuous,
                shape,
                max_lateral_acc_mps2,
            } => ActorAction::LaneOffset {
                target: self.offset(path, target_m.as_ref(), target.as_ref()),
                continuous: *continuous,
                shape: *shape,
                most_lateral_mps2: self.lane_offset_acceleration(
                    path,
                    *shape,
                    max_lateral_acc_mps2.as_ref(),
                ),
            },
            Effect::FollowTrajectory {
                trajectory,
                timing,
                following,
                initial_distance_m,
            } => {
                let (at, timed) = (path.to("initial_distance_m"), timing.as_ref());
                let curve_at = path.to("trajectory");
                let checked = self.curve(&curve_at, trajectory, *following, timed.is_some());
                let Some(curve) = checked else {
                    // Reported, and the storyboard then never runs.
                    return CheckedEffect::Of {
                        actors: actors.clone(),
                        action: ActorAction::AssignRoute(0),
                    };
                };
                ActorAction::FollowTrajectory {
                    path: curve,
                    timing: timed.map(|it| self.timing(&path.to("timing"), it)),
                    following: *following,
                    initial_distance_m: self.number(&at, initial_distance_m, 0.0),
                }
            }
            Effect::AssignRoute { road } => {
                ActorAction::AssignRoute(self.road(&path.to("road"), road.as_ref()))
            }
            Effect::Teleport { position } => {
                ActorAction::Teleport(self.place(&path.to("position"), position))
            }
            Effect::ActivateController {
                longitudinal,
                lateral,
            } => ActorAction::ActivateController {
                longitudinal: *longitudinal,
                lateral: *lateral,
            },
            Effect::VariableSet { name, value } => {
                return self.change(path, name, value, VariableChange::Set);
            }
            Effect::VariableAdd { name, value } => {
                return self.change(path, name, value, VariableChange::Add);
            }
            Effect::VariableMultiply { name, value } => {
                return self.change(path, name, value, VariableChange::Multiply);
            }
            Effect::Add { entity, position } => {
                let agent = self.moved(&path.to("entity"), entity);
                let place = self.place(&path.to("position"), position);
                return CheckedEffect::Scene(SceneChange::Add(agent, place));
            }
            Effect::Delete { entity } => {
                let agent = self.moved(&path.to("entity"), entity);
                return CheckedEffect::Scene(SceneChange::Delete(agent));
            }
            Effect::Friction { value } => {
                let friction = self.number(&path.to("value"), value, 1e-3);
                return CheckedEffect::Scene(SceneChange::Friction(friction));
            }
            Effect::TrafficSignal { name, state } => {
                let light = self.index(&path.to("name"), "light", name, &self.names.lights);
                return CheckedEffect::Scene(SceneChange::TrafficSignal(light, *state));
            }
        };
        CheckedEffect::Of {
            actors: actors.clone(),
            action,
        }
    }

    fn offset(
        &mut self,
        path: &ValuePath,
        target_m: Option<&StoryNumber>,
        target: Option<&OffsetTarget>,
    ) -> ActorOffset {
        let at = path.to("target");
        match (target_m, target) {
            (Some(to_m), None) => {
                ActorOffset::Absolute(self.number(&path.to("target_m"), to_m, -MOST))
            }
            (None, Some(OffsetTarget::Absolute { value_m })) => {
                ActorOffset::Absolute(self.number(&at.to("value_m"), value_m, -MOST))
            }
            (None, Some(OffsetTarget::Relative { entity, value_m })) => ActorOffset::Relative(
                self.agent(&at.to("entity"), entity),
                self.number(&at.to("value_m"), value_m, -MOST),
            ),
            (None, Some(OffsetTarget::Line { lateral_m })) => {
                ActorOffset::Line(self.number(&at.to("lateral_m"), lateral_m, -MOST))
            }
            _ => {
                // Two targets would contradict each other, and without
                // one there is no offset.
                let what = "an offset needs one target".to_owned();
                self.wrong(path, what, "write either `target_m` or `target`");
                ActorOffset::Absolute(0.0)
            }
        }
    }

    fn lane_offset_acceleration(
        &mut self,
        path: &ValuePath,
        shape: DynamicsShape,
        most: Option<&StoryNumber>,
    ) -> f64 {
        let Some(most) = most else {
            // Infinite means a change at once.
            return f64::INFINITY;
        };
        let at = path.to("max_lateral_acc_mps2");
        // A line has a corner, whose acceleration is infinite.
        if shape == DynamicsShape::Linear {
            let what = "a linear change has no lateral acceleration".to_owned();
            self.wrong(&at, what, "write `Sinusoidal` or `Cubic`");
        }
        self.number(&at, most, 1e-3)
    }

    fn change(
        &mut self,
        path: &ValuePath,
        name: &str,
        value: &StoryNumber,
        change: fn(f64) -> VariableChange,
    ) -> CheckedEffect {
        let value = self.number(&path.to("value"), value, -MOST);
        CheckedEffect::Variable {
            number: self.variable(&path.to("name"), name),
            change: change(value),
        }
    }

    fn speed(&mut self, path: &ValuePath, target: &SpeedTarget) -> ActorSpeed {
        match target {
            SpeedTarget::Absolute { value_mps } => {
                ActorSpeed::Absolute(self.number(&path.to("value_mps"), value_mps, 0.0))
            }
            SpeedTarget::Delta {
                entity,
                value_mps,
                continuous,
            } => ActorSpeed::Delta(RelativeTarget {
                of: self.agent(&path.to("entity"), entity),
                by: self.number(&path.to("value_mps"), value_mps, -MOST),
                continuous: *continuous,
            }),
            SpeedTarget::Factor {
                entity,
                value,
                continuous,
            } => ActorSpeed::Factor(RelativeTarget {
                of: self.agent(&path.to("entity"), entity),
                by: self.number(&path.to("value"), value, 0.0),
                continuous: *continuous,
            }),
        }
    }
}
