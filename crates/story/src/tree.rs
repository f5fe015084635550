//! A checked storyboard: elements in a list, names as numbers.

use crate::values::{
    ComparisonRule, ConditionEdge, CoordinateSystem, DistanceType, ElementState, EventPriority,
    SignalState, TriggeringRule,
};
use crate::view::{ActorAction, SceneChange, StoryPlace};

/// Kind of an element of a storyboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum ElementKind {
    Storyboard,
    Story,
    Act,
    ManeuverGroup,
    Maneuver,
    Event,
    Action,
}

/// Element of a checked storyboard.
#[derive(Clone, Debug)]
pub(crate) struct BoardElement {
    pub kind: ElementKind,
    /// Names from the story on.
    pub path: Vec<String>,
    pub parent: usize,
    pub children: Vec<usize>,
    /// Positions of its conditions, group by group.
    pub start: Vec<Vec<usize>>,
    pub stop: Vec<Vec<usize>>,
    pub priority: EventPriority,
    pub most_executions: u32,
    pub effect: Option<CheckedEffect>,
}

/// Condition with resolved names.
#[derive(Clone, Debug)]
pub(crate) struct CheckedCondition {
    pub edge: ConditionEdge,
    pub delay_s: f64,
    /// Time for which the expression must hold before it counts.
    pub held_s: f64,
    pub is: CheckedExpression,
}

#[derive(Clone, Debug)]
pub(crate) struct ValueComparison {
    pub rule: ComparisonRule,
    pub value: f64,
}

#[derive(Clone, Debug)]
pub(crate) enum CheckedExpression {
    SimulationTime(ValueComparison),
    Element {
        element: usize,
        state: ElementState,
    },
    Variable {
        number: usize,
        compared: ValueComparison,
    },
    Parameter {
        number: usize,
        compared: ValueComparison,
    },
    /// Formula by its number.
    Formula(usize),
    Signal {
        light: usize,
        state: SignalState,
    },
    Agents {
        agents: Vec<usize>,
        rule: TriggeringRule,
        is: AgentExpression,
    },
}

/// Expression about one agent.
#[derive(Clone, Debug)]
pub(crate) enum AgentExpression {
    Number(AgentQuantity, ValueComparison),
    Touches(usize),
    Offroad,
    AtRoadEnd,
}

#[derive(Clone, Debug)]
pub(crate) enum AgentQuantity {
    Speed,
    SpeedLess {
        other: usize,
    },
    Acceleration,
    /// Absolute speed, for rest.
    Rest,
    Way,
    DistanceTo {
        other: usize,
        measured: MeasuredAxis,
        freespace: bool,
    },
    DistanceToPlace {
        place: StoryPlace,
        measured: MeasuredAxis,
        freespace: bool,
    },
    Headway {
        other: usize,
        measured: MeasuredAxis,
        freespace: bool,
    },
    Collision {
        other: usize,
        measured: MeasuredAxis,
        freespace: bool,
    },
    TimeToPlace {
        place: StoryPlace,
        measured: MeasuredAxis,
        freespace: bool,
    },
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MeasuredAxis {
    pub along: DistanceType,
    pub system: CoordinateSystem,
}

/// Agents of an action.
#[derive(Clone, Debug, Default)]
pub(crate) struct Actors {
    pub named: Vec<usize>,
    /// Act whose trigger chooses further ones when it starts.
    pub triggering_of: Option<usize>,
    /// Agents that it may choose.
    pub may_trigger: Vec<usize>,
}

#[derive(Clone, Debug)]
pub(crate) enum CheckedEffect {
    Of {
        actors: Actors,
        action: ActorAction,
    },
    Variable {
        number: usize,
        change: VariableChange,
    },
    Scene(SceneChange),
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum VariableChange {
    Set(f64),
    Add(f64),
    Multiply(f64),
}

impl ValueComparison {
    /// Returns whether a number fulfils it.
    pub fn holds(&self, number: f64) -> bool {
        /// Difference up to which two numbers are equal, as a quantity hardly hits a value.
        const EQUAL: f64 = 1e-6;
        // Bisection finds an instant to less than 0.1 ns, in which hardly any quantity
        // changes by this difference.
        let equal = (number - self.value).abs() <= EQUAL;
        match self.rule {
            ComparisonRule::LessThan => number < self.value,
            ComparisonRule::LessOrEqual => number <= self.value,
            ComparisonRule::EqualTo => equal,
            ComparisonRule::NotEqualTo => !equal,
            ComparisonRule::GreaterOrEqual => number >= self.value,
            ComparisonRule::GreaterThan => number > self.value,
        }
    }
}

impl Actors {
    /// Returns all agents that may act.
    pub fn all(&self) -> impl Iterator<Item = usize> {
        self.named.iter().chain(&self.may_trigger).copied()
    }
}
