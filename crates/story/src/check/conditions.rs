//! Check of triggers and their conditions.

use super::{Check, MOST, MOST_PARTS, StoryFormula};
use crate::ron_file::ValuePath;
use crate::tree::{
    AgentExpression, AgentQuantity, CheckedCondition, CheckedExpression, MeasuredAxis,
    ValueComparison,
};
use crate::values::{
    ComparisonRule, Condition, EntityCondition, Expression, StoryNumber, StoryPosition, Trigger,
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
        let delay_s = self.number(&path.to("delay_s"), &condition.delay_s, 0.0);
        let (is, held_s) = self.expression(&path.to("is"), &condition.is);
        // Equality reports the excess once, not with each further condition.
        if self.conditions.len() == MOST_PARTS {
            let what = format!("more than {MOST_PARTS} conditions");
            self.wrong(path, what, "split the world");
        }
        self.conditions.push(CheckedCondition {
            edge: condition.edge,
            delay_s,
            held_s,
            is,
        });
        self.conditions.len() - 1
    }

    fn compared(
        &mut self,
        path: &ValuePath,
        rule: ComparisonRule,
        value: &StoryNumber,
    ) -> ValueComparison {
        // Compared values may be negative, as accelerations and relative speeds are.
        let value = self.number(path, value, -MOST);
        ValueComparison { rule, value }
    }

    /// Returns an expression and the time for which it must hold.
    fn expression(&mut self, path: &ValuePath, is: &Expression) -> (CheckedExpression, f64) {
        let checked = match is {
            Expression::SimulationTime { rule, value_s } => CheckedExpression::SimulationTime(
                self.compared(&path.to("value_s"), *rule, value_s),
            ),
            Expression::StoryboardElementState { element, state } => CheckedExpression::Element {
                element: self.element_named(&path.to("element"), element),
                state: *state,
            },
            Expression::Variable { name, rule, value } => CheckedExpression::Variable {
                number: self.variable(&path.to("name"), name),
                compared: self.compared(&path.to("value"), *rule, value),
            },
            Expression::Parameter { name, rule, value } => CheckedExpression::Parameter {
                number: self.index(&path.to("name"), "parameter", name, &self.names.parameters),
                compared: self.compared(&path.to("value"), *rule, value),
            },
            Expression::Formula(text) => {
                // The world parses the text later, when its signals are known.
                self.formulas.push(StoryFormula {
                    path: path.at(0),
                    text: text.clone(),
                });
                CheckedExpression::Formula(self.formulas.len() - 1)
            }
            Expression::TrafficSignal { name, state } => CheckedExpression::Signal {
                light: self.index(&path.to("name"), "light", name, &self.names.lights),
                state: *state,
            },
            Expression::ByEntity {
                entities,
                rule,
                condition,
            } => {
                // Of no agents, `All` would hold at once and `Any` would never hold.
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
        use EntityCondition as Is;
        let expression = match is {
            Is::Speed { rule, value_mps } => {
                self.number_of(path, AgentQuantity::Speed, *rule, ("value_mps", value_mps))
            }
            Is::RelativeSpeed {
                entity,
                rule,
                value_mps,
            } => {
                let other = self.entity(path, entity);
                let quantity = AgentQuantity::SpeedLess { other };
                self.number_of(path, quantity, *rule, ("value_mps", value_mps))
            }
            Is::Acceleration { rule, value_mps2 } => self.number_of(
                path,
                AgentQuantity::Acceleration,
                *rule,
                ("value_mps2", value_mps2),
            ),
            Is::TraveledDistance { value_m } => {
                // A way only grows, so its condition has no rule in the file.
                let rule = ComparisonRule::GreaterOrEqual;
                self.number_of(path, AgentQuantity::Way, rule, ("value_m", value_m))
            }
            Is::RelativeDistance {
                entity,
                distance_type,
                coordinate_system,
                freespace,
                rule,
                value_m,
            } => {
                let quantity = AgentQuantity::DistanceTo {
                    other: self.entity(path, entity),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                    freespace: *freespace,
                };
                self.number_of(path, quantity, *rule, ("value_m", value_m))
            }
            Is::Distance {
                position,
                freespace,
                distance_type,
                coordinate_system,
                rule,
                value_m,
            } => {
                let measured = MeasuredAxis {
                    along: *distance_type,
                    system: *coordinate_system,
                };
                let quantity = self.distance_to_place(path, position, measured, *freespace);
                self.number_of(path, quantity, *rule, ("value_m", value_m))
            }
            Is::ReachPosition {
                position,
                tolerance_m,
            } => {
                let measured = MeasuredAxis::default();
                // Arrival is that of the reference point, so the box has no part in it.
                let quantity = self.distance_to_place(path, position, measured, false);
                let rule = ComparisonRule::LessOrEqual;
                self.number_of(path, quantity, rule, ("tolerance_m", tolerance_m))
            }
            Is::TimeHeadway {
                entity,
                distance_type,
                coordinate_system,
                freespace,
                rule,
                value_s,
            } => {
                let quantity = AgentQuantity::Headway {
                    other: self.entity(path, entity),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                    freespace: *freespace,
                };
                self.number_of(path, quantity, *rule, ("value_s", value_s))
            }
            Is::TimeToCollision {
                entity,
                distance_type,
                coordinate_system,
                freespace,
                rule,
                value_s,
            } => {
                let quantity = AgentQuantity::Collision {
                    other: self.entity(path, entity),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                    freespace: *freespace,
                };
                self.number_of(path, quantity, *rule, ("value_s", value_s))
            }
            Is::TimeToPlace {
                position,
                distance_type,
                coordinate_system,
                freespace,
                rule,
                value_s,
            } => {
                let quantity = AgentQuantity::TimeToPlace {
                    place: self.place(&path.to("position"), position),
                    measured: MeasuredAxis {
                        along: *distance_type,
                        system: *coordinate_system,
                    },
                    freespace: *freespace,
                };
                self.number_of(path, quantity, *rule, ("value_s", value_s))
            }
            Is::Collision { entity } => AgentExpression::Touches(self.entity(path, entity)),
            Is::StandStill { .. } => {
                /// Speed below which a body rests.
                const REST_MPS: f64 = 1e-3;
                let rests = ValueComparison {
                    rule: ComparisonRule::LessThan,
                    value: REST_MPS,
                };
                AgentExpression::Number(AgentQuantity::Rest, rests)
            }
            Is::Offroad { .. } => AgentExpression::Offroad,
            Is::EndOfRoad { .. } => AgentExpression::AtRoadEnd,
        };
        // Only these conditions have a duration. It is part of the expression, so that a
        // rising edge is at its end.
        let held_s = match is {
            Is::StandStill { duration_s }
            | Is::Offroad { duration_s }
            | Is::EndOfRoad { duration_s } => self.number(&path.to("duration_s"), duration_s, 0.0),
            _ => 0.0,
        };
        (expression, held_s)
    }

    fn entity(&mut self, path: &ValuePath, name: &str) -> usize {
        self.agent(&path.to("entity"), name)
    }

    fn number_of(
        &mut self,
        path: &ValuePath,
        quantity: AgentQuantity,
        rule: ComparisonRule,
        named: (&str, &StoryNumber),
    ) -> AgentExpression {
        AgentExpression::Number(quantity, self.compared(&path.to(named.0), rule, named.1))
    }

    fn distance_to_place(
        &mut self,
        path: &ValuePath,
        position: &StoryPosition,
        measured: MeasuredAxis,
        freespace: bool,
    ) -> AgentQuantity {
        AgentQuantity::DistanceToPlace {
            place: self.place(&path.to("position"), position),
            measured,
            freespace,
        }
    }

    /// Finds an element by the end of its path, which must be unique.
    fn element_named(&mut self, path: &ValuePath, name: &str) -> usize {
        let wanted: Vec<&str> = name.split("::").collect();
        // The root has number 0 and no name.
        let found: Vec<usize> = (1..self.elements.len())
            .filter(|it| {
                let names = &self.elements[*it].path;
                // From the end, so that the last name suffices if no
                // other element has it.
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
        // A stand-in, because the reported storyboard never runs.
        0
    }
}
