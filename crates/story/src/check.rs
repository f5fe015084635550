//! Check of a storyboard: names, bounds and the tree of its elements.

use crate::ron_file::{Problems, ValuePath};
use crate::tree::{
    AgentExpression, AgentQuantity, CheckedCondition, CheckedEffect, CheckedExpression,
    ElementKind, MeasuredAxis, StoryElement, TargetPlace, ValueComparison, VariableChange,
};
use crate::values::{
    Act, Action, ComparisonRule, Condition, Dimension, DynamicsShape, Effect, EntityCondition,
    EventPriority, Expression, LaneTarget, ManeuverGroup, SpeedTarget, Story, StoryEvent,
    StoryManeuver, StoryPosition, Storyboard, TransitionDynamics, Trigger,
};
use crate::view::{ActorAction, ActorLane, ActorSpeed, MotionDomain};

/// Greatest number of elements, and of conditions, so that a file allocates little.
const MOST_PARTS: usize = 10_000;
/// Greatest number of executions.
const MOST_EXECUTIONS: u32 = 10_000;
/// Greatest time, speed and distance.
const MOST: f64 = 1e6;

/// Names that a storyboard may use.
#[derive(Clone, Copy, Debug)]
pub struct StoryNames<'a> {
    /// Agents, in the order of their numbers.
    pub agents: &'a [&'a str],
    /// Agents that may be actors.
    pub actors: &'a [&'a str],
    /// Agents on foot, which have no lane.
    pub on_foot: &'a [&'a str],
    /// Number of lanes of the road of each agent.
    pub lanes: &'a [usize],
    /// Traffic lights.
    pub lights: &'a [&'a str],
    /// Parameters of the start.
    pub parameters: &'a [&'a str],
}

/// Storyboard without mistakes, ready to run.
#[derive(Clone, Debug)]
pub struct CheckedStoryboard {
    pub(crate) elements: Vec<StoryElement>,
    pub(crate) conditions: Vec<CheckedCondition>,
    pub(crate) variables: Vec<f64>,
    /// Number of agents.
    pub(crate) agents: usize,
}

/// Checks a storyboard and resolves its names.
///
/// Each mistake is added to `problems` with its place below `path`. `None` if there is one.
pub fn check(
    problems: &mut Problems<'_>,
    path: &ValuePath,
    board: &Storyboard,
    names: StoryNames<'_>,
) -> Option<CheckedStoryboard> {
    let before = problems.len();
    let mut check = Check {
        problems,
        names,
        variables: board.variables.iter().map(|it| it.name.clone()).collect(),
        elements: Vec::new(),
        conditions: Vec::new(),
    };
    check.variables(path, board);
    check.storyboard(path, board);
    // Conditions may name elements that follow them, so they come last.
    check.triggers(path, board);
    let Check {
        problems,
        elements,
        conditions,
        ..
    } = check;
    (problems.len() == before).then(|| CheckedStoryboard {
        elements,
        conditions,
        variables: board.variables.iter().map(|it| it.value).collect(),
        agents: names.agents.len(),
    })
}

impl CheckedStoryboard {
    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.elements.len()
    }

    /// Returns whether it has no story.
    pub fn is_empty(&self) -> bool {
        self.elements.len() <= 1
    }

    /// Returns kind and names of an element, from its story on.
    pub fn element(&self, number: usize) -> (ElementKind, String) {
        let element = &self.elements[number];
        (element.kind, element.path.join("::"))
    }

    /// Returns the agents that perform actions.
    pub fn actors(&self) -> impl Iterator<Item = usize> {
        let effects = self.elements.iter().filter_map(|it| it.effect.as_ref());
        effects
            .flat_map(|effect| match effect {
                CheckedEffect::Of { actors, .. } => actors.as_slice(),
                CheckedEffect::Variable { .. } => &[],
            })
            .copied()
    }
}

struct Check<'a, 'b> {
    problems: &'a mut Problems<'b>,
    names: StoryNames<'a>,
    variables: Vec<String>,
    elements: Vec<StoryElement>,
    conditions: Vec<CheckedCondition>,
}

impl Check<'_, '_> {
    fn wrong(&mut self, path: &ValuePath, what: String, help: &str) {
        self.problems.add(path, what, "here", Some(help.to_owned()));
    }

    fn number(&mut self, path: &ValuePath, number: f64, least: f64) {
        if !(least..=MOST).contains(&number) {
            let help = format!("write a number from {least} to {MOST}");
            self.wrong(path, format!("{number} is out of bounds"), &help);
        }
    }

    fn index(&mut self, path: &ValuePath, what: &str, name: &str, known: &[&str]) -> usize {
        let found = known.iter().position(|it| *it == name);
        if found.is_none() {
            self.problems.unknown(path, what, name, known);
        }
        // A wrong name is reported, and the storyboard then never runs.
        found.unwrap_or(0)
    }

    fn agent(&mut self, path: &ValuePath, name: &str) -> usize {
        self.index(path, "agent", name, self.names.agents)
    }

    fn variables(&mut self, path: &ValuePath, board: &Storyboard) {
        for (i, variable) in board.variables.iter().enumerate() {
            let at = path.to("variables").at(i);
            self.number(&at.to("value"), variable.value, -MOST);
            if self.variables[..i].contains(&variable.name) {
                let what = format!("a second variable `{}`", variable.name);
                self.wrong(&at.to("name"), what, "give it another name");
            }
        }
    }

    /// Adds an element below `parent`, with a name that its siblings do not have.
    fn add(&mut self, path: &ValuePath, kind: ElementKind, parent: usize, name: &str) -> usize {
        let number = self.elements.len();
        let mut names = match self.elements.get(parent) {
            Some(parent) => parent.path.clone(),
            None => Vec::new(),
        };
        if kind != ElementKind::Storyboard {
            names.push(name.to_owned());
            let siblings = self.elements[parent].children.iter();
            let is_second = siblings.clone().any(|it| self.elements[*it].path == names);
            if name.is_empty() || name.contains("::") {
                let what = format!("`{name}` cannot be a name");
                self.wrong(&path.to("name"), what, "write letters without `::`");
            } else if is_second {
                let what = format!("a second `{name}` in the same element");
                self.wrong(&path.to("name"), what, "give it another name");
            }
            self.elements[parent].children.push(number);
        }
        if number == MOST_PARTS {
            let what = format!("more than {MOST_PARTS} elements");
            self.wrong(path, what, "split the world");
        }
        self.elements.push(StoryElement {
            kind,
            path: names,
            parent,
            children: Vec::new(),
            start: Vec::new(),
            stop: Vec::new(),
            priority: EventPriority::Parallel,
            most_executions: 1,
            effect: None,
        });
        number
    }

    fn executions(&mut self, path: &ValuePath, element: usize, count: u32) {
        if !(1..=MOST_EXECUTIONS).contains(&count) {
            let help = format!("write a number from 1 to {MOST_EXECUTIONS}");
            let what = format!("{count} executions");
            self.wrong(&path.to("maximum_execution_count"), what, &help);
        }
        self.elements[element].most_executions = count;
    }

    fn storyboard(&mut self, path: &ValuePath, board: &Storyboard) {
        let root = self.add(path, ElementKind::Storyboard, 0, "");
        for (i, story) in board.stories.iter().enumerate() {
            self.story(&path.to("stories").at(i), root, story);
        }
    }

    fn story(&mut self, path: &ValuePath, parent: usize, story: &Story) {
        let number = self.add(path, ElementKind::Story, parent, &story.name);
        self.not_empty(&path.to("acts"), story.acts.len(), "act");
        for (i, act) in story.acts.iter().enumerate() {
            let at = path.to("acts").at(i);
            let act_number = self.add(&at, ElementKind::Act, number, &act.name);
            let groups = at.to("maneuver_groups");
            self.not_empty(&groups, act.maneuver_groups.len(), "maneuver group");
            for (j, group) in act.maneuver_groups.iter().enumerate() {
                self.group(&groups.at(j), act_number, group);
            }
        }
    }

    /// An empty element would be complete when it starts, which nobody means.
    fn not_empty(&mut self, path: &ValuePath, count: usize, what: &str) {
        if count == 0 {
            let help = format!("write at least one {what}");
            self.wrong(path, format!("no {what}"), &help);
        }
    }

    fn group(&mut self, path: &ValuePath, parent: usize, group: &ManeuverGroup) {
        let number = self.add(path, ElementKind::ManeuverGroup, parent, &group.name);
        self.executions(path, number, group.maximum_execution_count);
        let named = group.actors.iter().enumerate();
        let actors: Vec<usize> = named
            .map(|(i, name)| self.actor(&path.to("actors").at(i), name))
            .collect();
        let maneuvers = path.to("maneuvers");
        self.not_empty(&maneuvers, group.maneuvers.len(), "maneuver");
        for (i, maneuver) in group.maneuvers.iter().enumerate() {
            self.maneuver(&maneuvers.at(i), number, maneuver, &actors);
        }
    }

    fn actor(&mut self, path: &ValuePath, name: &str) -> usize {
        let agent = self.agent(path, name);
        let is_known = self.names.agents.contains(&name);
        if is_known && !self.names.actors.contains(&name) {
            let what = format!("`{name}` cannot act in a story");
            let help = "give it `Script([])` as its drive, or as the `base` of its `Ado(…)`";
            self.wrong(path, what, help);
        }
        agent
    }

    fn maneuver(
        &mut self,
        path: &ValuePath,
        parent: usize,
        maneuver: &StoryManeuver,
        actors: &[usize],
    ) {
        let number = self.add(path, ElementKind::Maneuver, parent, &maneuver.name);
        let events = path.to("events");
        self.not_empty(&events, maneuver.events.len(), "event");
        for (i, event) in maneuver.events.iter().enumerate() {
            let at = events.at(i);
            let event_number = self.add(&at, ElementKind::Event, number, &event.name);
            self.executions(&at, event_number, event.maximum_execution_count);
            self.elements[event_number].priority = event.priority;
            let actions = at.to("actions");
            self.not_empty(&actions, event.actions.len(), "action");
            for (j, action) in event.actions.iter().enumerate() {
                self.action(&actions.at(j), event_number, action, actors);
            }
            self.conflicts(&actions, event_number);
        }
    }

    /// Reports two actions of one event that control the same motion of an agent.
    fn conflicts(&mut self, path: &ValuePath, event: usize) {
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

    fn action(&mut self, path: &ValuePath, event: usize, action: &Action, actors: &[usize]) {
        let number = self.add(path, ElementKind::Action, event, &action.name);
        let effect = self.effect(&path.to("does"), &action.does, actors);
        if matches!(&effect, CheckedEffect::Of { actors, .. } if actors.is_empty()) {
            let what = format!("`{}` has no actor", action.name);
            self.wrong(path, what, "write `actors` in its maneuver group");
        }
        self.lanes(&path.to("does"), &effect);
        self.elements[number].effect = Some(effect);
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

    fn variable(&mut self, path: &ValuePath, name: &str) -> usize {
        let variables = self.variables.clone();
        let known: Vec<&str> = variables.iter().map(String::as_str).collect();
        self.index(path, "variable", name, &known)
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

    fn triggers(&mut self, path: &ValuePath, board: &Storyboard) {
        self.elements[0].stop = self.trigger(&path.to("stop_trigger"), &board.stop_trigger);
        // The elements were added in this order.
        let mut number = 1;
        for (i, story) in board.stories.iter().enumerate() {
            let stories = path.to("stories").at(i);
            number += 1;
            for (j, act) in story.acts.iter().enumerate() {
                number = self.triggers_of_act(&stories.to("acts").at(j), act, number);
            }
        }
    }

    fn triggers_of_act(&mut self, path: &ValuePath, act: &Act, first: usize) -> usize {
        self.elements[first].start = self.trigger(&path.to("start_trigger"), &act.start_trigger);
        self.elements[first].stop = self.trigger(&path.to("stop_trigger"), &act.stop_trigger);
        let mut number = first + 1;
        for (i, group) in act.maneuver_groups.iter().enumerate() {
            let groups = path.to("maneuver_groups").at(i);
            number += 1;
            for (j, maneuver) in group.maneuvers.iter().enumerate() {
                let maneuvers = groups.to("maneuvers").at(j);
                number += 1;
                for (k, event) in maneuver.events.iter().enumerate() {
                    self.trigger_of_event(&maneuvers.to("events").at(k), event, number);
                    number += 1 + event.actions.len();
                }
            }
        }
        number
    }

    fn trigger_of_event(&mut self, path: &ValuePath, event: &StoryEvent, number: usize) {
        let start = self.trigger(&path.to("start_trigger"), &event.start_trigger);
        if event.start_trigger.is_empty() && event.maximum_execution_count > 1 {
            let what = "an event without a trigger executes more than once".to_owned();
            let help = "write its `start_trigger`";
            self.wrong(&path.to("maximum_execution_count"), what, help);
        }
        self.elements[number].start = start;
    }

    fn trigger(&mut self, path: &ValuePath, trigger: &Trigger) -> Vec<Vec<usize>> {
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
