//! Check of the actions of an event.

use super::{Check, MOST};
use crate::ron_file::ValuePath;
use crate::tree::{CheckedEffect, ElementKind, VariableChange};
use crate::values::{
    Action, Dimension, DynamicsShape, Effect, LaneTarget, SpeedTarget, TransitionDynamics,
};
use crate::view::{ActorAction, ActorLane, ActorSpeed, MotionDomain};

impl Check<'_, '_> {
    pub(super) fn action(
        &mut self,
        path: &ValuePath,
        event: usize,
        action: &Action,
        actors: &[usize],
    ) {
        let number = self.add(path, ElementKind::Action, event, &action.name);
        let effect = self.effect(&path.to("does"), &action.does, actors);
        if matches!(&effect, CheckedEffect::Of { actors, .. } if actors.is_empty()) {
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
            Some(CheckedEffect::Of { action, .. }) => Some(action.domain()),
            _ => None,
        });
        let domains: Vec<_> = controlled.collect();
        for (i, domain) in domains.iter().enumerate() {
            if domain.is_some() && domains[..i].contains(domain) {
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
        if action.domain() != MotionDomain::Lateral {
            return;
        }
        for actor in actors.iter().filter(|it| **it < self.names.agents.len()) {
            let name = self.names.agents[*actor];
            let lanes = self.names.lanes[*actor];
            if self.names.on_foot.contains(&name) {
                let what = format!("`{name}` walks and has no lane");
                self.wrong(path, what, "let a vehicle do it");
            }
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

    fn effect(&mut self, path: &ValuePath, effect: &Effect, actors: &[usize]) -> CheckedEffect {
        let action = match effect {
            Effect::Speed { target, dynamics } => ActorAction::Speed {
                target: self.speed(&path.to("target"), target),
                dynamics: self.dynamics(&path.to("dynamics"), *dynamics),
            },
            Effect::LaneChange {
                target,
                target_lane_offset_m,
                dynamics,
            } => {
                self.number(
                    &path.to("target_lane_offset_m"),
                    *target_lane_offset_m,
                    -MOST,
                );
                ActorAction::LaneChange {
                    target: match target {
                        LaneTarget::Absolute { lane } => ActorLane::Absolute(*lane),
                        LaneTarget::Relative { entity, lanes } => {
                            let at = path.to("target").to("entity");
                            ActorLane::Relative(self.agent(&at, entity), *lanes)
                        }
                    },
                    offset_m: *target_lane_offset_m,
                    dynamics: self.dynamics(&path.to("dynamics"), *dynamics),
                }
            }
            Effect::LaneOffset {
                target_m,
                shape,
                max_lateral_acc_mps2,
            } => {
                self.number(&path.to("target_m"), *target_m, -MOST);
                self.lane_offset_acceleration(path, *shape, *max_lateral_acc_mps2);
                ActorAction::LaneOffset {
                    to_m: *target_m,
                    shape: *shape,
                    most_lateral_mps2: max_lateral_acc_mps2.unwrap_or(f64::INFINITY),
                }
            }
            Effect::VariableSet { name, value } => {
                return self.change(path, name, *value, VariableChange::Set);
            }
            Effect::VariableAdd { name, value } => {
                return self.change(path, name, *value, VariableChange::Add);
            }
            Effect::VariableMultiply { name, value } => {
                return self.change(path, name, *value, VariableChange::Multiply);
            }
        };
        CheckedEffect::Of {
            actors: actors.to_vec(),
            action,
        }
    }

    fn lane_offset_acceleration(
        &mut self,
        path: &ValuePath,
        shape: DynamicsShape,
        most: Option<f64>,
    ) {
        let at = path.to("max_lateral_acc_mps2");
        if let Some(most_mps2) = most {
            self.number(&at, most_mps2, 1e-3);
            // A line has a corner, whose acceleration is infinite.
            if shape == DynamicsShape::Linear {
                let help = "write `Sinusoidal` or `Cubic`";
                self.wrong(
                    &at,
                    "a linear change has no lateral acceleration".to_owned(),
                    help,
                );
            }
        }
    }

    fn change(
        &mut self,
        path: &ValuePath,
        name: &str,
        value: f64,
        change: fn(f64) -> VariableChange,
    ) -> CheckedEffect {
        self.number(&path.to("value"), value, -MOST);
        CheckedEffect::Variable {
            number: self.variable(&path.to("name"), name),
            change: change(value),
        }
    }

    fn speed(&mut self, path: &ValuePath, target: &SpeedTarget) -> ActorSpeed {
        match target {
            SpeedTarget::Absolute { value_mps } => {
                self.number(&path.to("value_mps"), *value_mps, 0.0);
                ActorSpeed::Absolute(*value_mps)
            }
            SpeedTarget::Delta { entity, value_mps } => {
                self.number(&path.to("value_mps"), *value_mps, -MOST);
                ActorSpeed::Delta(self.agent(&path.to("entity"), entity), *value_mps)
            }
            SpeedTarget::Factor { entity, value } => {
                self.number(&path.to("value"), *value, 0.0);
                ActorSpeed::Factor(self.agent(&path.to("entity"), entity), *value)
            }
        }
    }

    fn dynamics(&mut self, path: &ValuePath, dynamics: TransitionDynamics) -> TransitionDynamics {
        let at = path.to("dimension");
        if dynamics.shape != DynamicsShape::Step {
            match dynamics.dimension {
                // A rate of 0 would never end, and one that is almost 0 hardly.
                Dimension::Rate(rate) => self.number(&at.at(0), rate, 1e-3),
                Dimension::Time(time_s) => self.number(&at.at(0), time_s, 0.0),
                Dimension::Distance(way_m) => self.number(&at.at(0), way_m, 0.0),
            }
        }
        dynamics
    }
}
