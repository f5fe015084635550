//! Check of triggers and their conditions.

use super::{Check, MOST, MOST_PARTS};
use crate::ron_file::ValuePath;
use crate::tree::{
    AgentExpression, AgentQuantity, CheckedCondition, CheckedExpression, MeasuredAxis, TargetPlace,
    ValueComparison,
};
use crate::values::{
    ComparisonRule, Condition, EntityCondition, Expression, StoryPosition, Trigger,
};

impl Check<'_, '_> {
    pub(super) fn trigger(&mut self, path: &ValuePath, trigger: &Trigger) -> Vec<Vec<usize>> {
        let groups = trigger.iter().enumerate();
        groups
            .map(|(i, group)| self.condition_group(&path.at(i), group))
            .collect()
    }

    fn condition_group(&mut self, path: &ValuePath, group: &[Condition]) -> Vec<usize> {
        // All conditions of an empty group hold, so it would trigger at once.
        self.not_empty(path, group.len(), "condition");
        let conditions = group.iter().enumerate();
        conditions
            .map(|(i, it)| self.condition(&path.at(i), it))
            .collect()
    }

    fn condition(&mut self, path: &ValuePath, condition: &Condition) -> usize {
        self.number(&path.to("delay_s"), condition.delay_s, 0.0);
        let (is, held_s) = self.expression(&path.to("is"), &condition.is);
        if self.conditions.len() == MOST_PARTS {
            let what = format!("more than {MOST_PARTS} conditions");
            self.wrong(path, what, "split the world");
        }
        self.conditions.push(CheckedCondition {
            edge: condition.edge,
            delay_s: condition.delay_s,
            held_s,
            is,
        });
        self.conditions.len() - 1
    }

    fn compared(&mut self, path: &ValuePath, rule: ComparisonRule, value: f64) -> ValueComparison {
        self.number(path, value, -MOST);
        ValueComparison { rule, value }
    }

    /// Returns an expression and the time for which it must hold.
    fn expression(&mut self, path: &ValuePath, is: &Expression) -> (CheckedExpression, f64) {
        let checked = match is {
            Expression::SimulationTime { rule, value_s } => CheckedExpression::SimulationTime(
                self.compared(&path.to("value_s"), *rule, *value_s),
            ),
            Expression::StoryboardElementState { element, state } => CheckedExpression::Element {
                element: self.element_named(&path.to("element"), element),
                state: *state,
            },
            Expression::Variable { name, rule, value } => CheckedExpression::Variable {
                number: self.variable(&path.to("name"), name),
                compared: self.compared(&path.to("value"), *rule, *value),
            },
            Expression::Parameter { name, rule, value } => CheckedExpression::Parameter {
                number: self.index(&path.to("name"), "parameter", name, self.names.parameters),
                compared: self.compared(&path.to("value"), *rule, *value),
            },
            Expression::TrafficSignal { name, state } => CheckedExpression::Signal {
                light: self.index(&path.to("name"), "light", name, self.names.lights),
                state: *state,
            },
            Expression::ByEntity {
                entities,
                rule,
                condition,
            } => {
                self.not_empty(&path.to("entities"), entities.len(), "agent");
                let named = entities.iter().enumerate();
                let agents = named
                    .map(|(i, name)| self.agent(&path.to("entities").at(i), name))
                    .collect();
                let (is, held_s) = self.of_agent(&path.to("condition"), condition);
                let checked = CheckedExpression::Agents {
                    agents,
                    rule: *rule,
                    is,
                };
                return (checked, held_s);
            }
        };
        (checked, 0.0)
    }

    fn of_agent(&mut self, path: &ValuePath, is: &EntityCondition) -> (AgentExpression, f64) {
        let held = |is: AgentExpression, for_s: f64| (is, for_s);
        let (quantity, rule, value, field) = match is {
            EntityCondition::Speed { rule, value_mps } => {
                (AgentQuantity::Speed, *rule, *value_mps, "value_mps")
            }
            EntityCondition::RelativeSpeed {
                entity,
                rule,
                value_mps,
            } => {
                let other = self.agent(&path.to("entity"), entity);
                (
                    AgentQuantity::SpeedLess { other },
                    *rule,
                    *value_mps,
                    "value_mps",
                )
            }
            EntityCondition::Acceleration { rule, value_mps2 } => (
                AgentQuantity::Acceleration,
                *rule,
                *value_mps2,
                "value_mps2",
            ),
            EntityCondition::StandStill { duration_s } => {
                /// Speed below which a body rests.
                const REST_MPS: f64 = 1e-3;
                self.number(&path.to("duration_s"), *duration_s, 0.0);
                let rests = ValueComparison {
                    rule: ComparisonRule::LessThan,
                    value: REST_MPS,
                };
                return held(
                    AgentExpression::Number(AgentQuantity::Rest, rests),
                    *duration_s,
                );
            }
            EntityCondition::TraveledDistance { value_m } => {
                let rule = ComparisonRule::GreaterOrEqual;
                (AgentQuantity::Way, rule, *value_m, "value_m")
            }
            EntityCondition::RelativeDistance {
                entity,
                distance_type,
                coordinate_system,
                freespace,
                rule,
                value_m,
            } => {
                let quantity = AgentQuantity::DistanceTo {
                    other: self.agent(&path.to("entity"), entity),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                    freespace: *freespace,
                };
                (quantity, *rule, *value_m, "value_m")
            }
            EntityCondition::Distance {
                position,
                distance_type,
                coordinate_system,
                rule,
                value_m,
            } => {
                let quantity = AgentQuantity::DistanceToPlace {
                    place: self.place(&path.to("position"), position),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                };
                (quantity, *rule, *value_m, "value_m")
            }
            EntityCondition::ReachPosition {
                position,
                tolerance_m,
            } => {
                let quantity = AgentQuantity::DistanceToPlace {
                    place: self.place(&path.to("position"), position),
                    measured: MeasuredAxis {
                        along: Default::default(),
                        system: Default::default(),
                    },
                };
                let rule = ComparisonRule::LessOrEqual;
                (quantity, rule, *tolerance_m, "tolerance_m")
            }
            EntityCondition::TimeHeadway {
                entity,
                coordinate_system,
                freespace,
                rule,
                value_s,
            } => {
                let quantity = AgentQuantity::Headway {
                    other: self.agent(&path.to("entity"), entity),
                    system: *coordinate_system,
                    freespace: *freespace,
                };
                (quantity, *rule, *value_s, "value_s")
            }
            EntityCondition::TimeToCollision {
                entity,
                coordinate_system,
                freespace,
                rule,
                value_s,
            } => {
                let quantity = AgentQuantity::Collision {
                    other: self.agent(&path.to("entity"), entity),
                    system: *coordinate_system,
                    freespace: *freespace,
                };
                (quantity, *rule, *value_s, "value_s")
            }
            EntityCondition::Collision { entity } => {
                let other = self.agent(&path.to("entity"), entity);
                return held(AgentExpression::Touches(other), 0.0);
            }
            EntityCondition::Offroad { duration_s } => {
                self.number(&path.to("duration_s"), *duration_s, 0.0);
                return held(AgentExpression::Offroad, *duration_s);
            }
            EntityCondition::EndOfRoad { duration_s } => {
                self.number(&path.to("duration_s"), *duration_s, 0.0);
                return held(AgentExpression::AtRoadEnd, *duration_s);
            }
        };
        let compared = self.compared(&path.to(field), rule, value);
        held(AgentExpression::Number(quantity, compared), 0.0)
    }

    fn place(&mut self, path: &ValuePath, position: &StoryPosition) -> TargetPlace {
        let (first, second) = match position {
            StoryPosition::World { x_m, y_m } => (("x_m", *x_m), ("y_m", *y_m)),
            StoryPosition::Road { s_m, t_m } => (("s_m", *s_m), ("t_m", *t_m)),
        };
        for (field, number) in [first, second] {
            self.number(&path.to(field), number, -MOST);
        }
        match *position {
            StoryPosition::World { x_m, y_m } => TargetPlace::World { x_m, y_m },
            StoryPosition::Road { s_m, t_m } => TargetPlace::Road { s_m, t_m },
        }
    }

    /// Finds an element by the end of its path, which must be unique.
    fn element_named(&mut self, path: &ValuePath, name: &str) -> usize {
        let wanted: Vec<&str> = name.split("::").collect();
        let found: Vec<usize> = (1..self.elements.len())
            .filter(|it| {
                let names = &self.elements[*it].path;
                names
                    .iter()
                    .rev()
                    .map(String::as_str)
                    .take(wanted.len())
                    .eq(wanted.iter().rev().copied())
            })
            .collect();
        match found.as_slice() {
            [one] => return *one,
            [] => {
                let all: Vec<String> = self.elements[1..]
                    .iter()
                    .map(|it| it.path.join("::"))
                    .collect();
                let known: Vec<&str> = all.iter().map(String::as_str).collect();
                self.problems.unknown(path, "element", name, &known);
            }
            [first, ..] => {
                let help = format!("write `{}`", self.elements[*first].path.join("::"));
                let what = format!("{} elements are named `{name}`", found.len());
                self.wrong(path, what, &help);
            }
        }
        0
    }
}
