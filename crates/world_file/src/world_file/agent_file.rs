//! Agents of a world file: road users, obstacles, lights and ados without a body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::default_field::is_default;
use super::number_or_range::NumberOrRange;
use super::rule_file::RuleFile;
use super::trained_file::TrainedFile;
use crate::ego::{Actuated, ControllerSpec, Phase};
use crate::rl::LearnerSettings;
use crate::road::Direction;
use crate::scene::drive::{
    Actions, LaneKeeping, MeetEgo, MotionPlan, Schedule, Script, ScriptStep,
};

/// Agent of a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum AgentFile {
    /// Road user on wheels.
    Vehicle {
        /// Name, which begins the names of its signals.
        name: String,
        /// Name of a body.
        body: String,
        /// Named road. Default: the world's own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
        /// Lane, counted from the right. Default: 0.
        #[serde(default, skip_serializing_if = "is_default")]
        lane: usize,
        /// Driving direction. Default: `With`.
        #[serde(default, skip_serializing_if = "is_default")]
        direction: Direction,
        /// Point of the vehicle that keeps the line in bends. Default: `Front`.
        #[serde(default, skip_serializing_if = "is_default")]
        lane_keeping: LaneKeeping,
        /// Offset to the left of the lane's middle, m. Default: 0.
        #[serde(default, skip_serializing_if = "is_default")]
        offset_m: NumberOrRange,
        /// Place and speed at the start.
        start: StartFile,
        /// Its driver.
        drive: DriveFile,
    },
    /// Road user on foot.
    Pedestrian {
        /// Name, which begins the names of its signals.
        name: String,
        /// Name of a body on foot. Default: `pedestrian`.
        #[serde(default = "pedestrian", skip_serializing_if = "is_pedestrian")]
        body: String,
        /// Named road. Default: the world's own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
        /// Offset to the left of lane 0's middle, m.
        lateral_m: NumberOrRange,
        /// Direction in which it faces. Default: `Left`.
        #[serde(default, skip_serializing_if = "is_default")]
        facing: Facing,
        /// Place and speed at the start.
        start: StartFile,
        /// Its motion.
        drive: DriveFile,
    },
    /// Standing object, such as a parked car.
    Obstacle {
        /// Name, which begins the names of its signals.
        name: String,
        /// Name of a body on wheels.
        body: String,
        /// Named road. Default: the world's own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
        /// Station of its front along the road, m.
        s_m: NumberOrRange,
        /// Offset to the left of lane 0's middle, m.
        lateral_m: NumberOrRange,
        /// Heading, counter-clockwise from the road's direction. Default: 0.
        #[serde(default, skip_serializing_if = "is_default")]
        heading_rad: f64,
    },
    /// Traffic light.
    Light {
        /// Name, which begins the names of its signals.
        name: String,
        /// Named road. Default: the world's own.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        road: Option<String>,
        /// Signal of the road's OpenDRIVE file, which becomes its `line_m`. Default: none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        signal: Option<String>,
        /// Station of its stop line along the road, m. Default: that of `signal`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        line_m: Option<f64>,
        /// First phase. Default: `Green`.
        #[serde(default, skip_serializing_if = "is_default")]
        phase: Phase,
        /// Its phases over time.
        drive: LightFile,
    },
    /// Weather that an ado changes, at most once in a world.
    Weather(WeatherFile),
    /// The world's own road, laid by an ado, at most once in a world.
    Road(RoadAgentFile),
    /// Ado that decides which placed ados act.
    Turns {
        /// Name, which begins the names of its signals.
        name: String,
        /// Its ado.
        drive: SceneAdoFile,
    },
}

fn pedestrian() -> String {
    "pedestrian".to_owned()
}

// Serde passes a reference to the field itself, which rules out `&str`.
fn is_pedestrian(body: &String) -> bool {
    *body == pedestrian()
}

impl AgentFile {
    /// Returns its name.
    pub fn name(&self) -> &str {
        match self {
            AgentFile::Vehicle { name, .. }
            | AgentFile::Pedestrian { name, .. }
            | AgentFile::Obstacle { name, .. }
            | AgentFile::Light { name, .. }
            | AgentFile::Turns { name, .. }
            | AgentFile::Weather(WeatherFile { name, .. })
            | AgentFile::Road(RoadAgentFile { name, .. }) => name,
        }
    }

    /// Returns the point of the agent that keeps the line.
    pub fn lane_keeping(&self) -> LaneKeeping {
        match self {
            AgentFile::Vehicle { lane_keeping, .. } => *lane_keeping,
            _ => LaneKeeping::default(),
        }
    }

    /// Returns the lane in which it starts, 0 for agents without lanes.
    pub fn lane(&self) -> usize {
        match self {
            AgentFile::Vehicle { lane, .. } => *lane,
            _ => 0,
        }
    }

    /// Returns the name of its road, if stated.
    pub fn road(&self) -> Option<&str> {
        match self {
            AgentFile::Vehicle { road, .. }
            | AgentFile::Pedestrian { road, .. }
            | AgentFile::Obstacle { road, .. }
            | AgentFile::Light { road, .. } => road.as_deref(),
            AgentFile::Weather(_) | AgentFile::Road(_) | AgentFile::Turns { .. } => None,
        }
    }
}

/// Direction of a pedestrian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Facing {
    /// Across the road, to the left.
    #[default]
    Left,
    /// Across the road, to the right.
    Right,
    /// Along the road.
    Ahead,
    /// Against the road.
    Back,
}

/// Place and speed at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum StartFile {
    /// Place along the road.
    At {
        /// Station of its front along its road, m.
        x_m: NumberOrRange,
        /// Speed, m/s.
        speed_mps: NumberOrRange,
    },
    /// Place relative to an agent declared before.
    Ahead {
        /// Name of that agent.
        of: String,
        /// Distance from front to front, m. Negative is behind it.
        headway_m: NumberOrRange,
        /// Speed, m/s.
        speed_mps: NumberOrRange,
    },
}

/// Driver of a vehicle, or motion of a pedestrian.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum DriveFile {
    /// The system under test.
    Ego(Actuated<ControllerSpec>),
    /// A learning adversary.
    Ado(AdoFile),
    /// An ado trained in another world, frozen, as traffic.
    Trained(TrainedFile),
    /// A fixed motion.
    Scripted(Script),
    /// The actions of the storyboard.
    Story,
    /// A plan by laws.
    Script(Vec<ScriptStep<NumberOrRange, String>>),
    /// A meeting with the ego.
    Meet(MeetEgo<NumberOrRange>),
}

/// Phases of a light over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum LightFile {
    /// Phases, each from its time on.
    Schedule(Schedule),
    /// An ado trained in another world, frozen.
    Trained(TrainedFile),
    /// A learning adversary.
    Ado(AdoFile),
}

/// Weather: bounds of what it changes, its start and its ado.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Weather", deny_unknown_fields)]
pub struct WeatherFile {
    /// Name, which begins the names of its signals.
    pub name: String,
    /// Bounds of what it changes.
    pub bounds: WeatherBoundsFile,
    /// Weather at the start. Default: clear.
    #[serde(default, skip_serializing_if = "is_default")]
    pub start: WeatherStartFile,
    /// Its ado.
    pub drive: SceneAdoFile,
}

/// Bounds of the weather. A quantity without bounds never changes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherBoundsFile {
    /// μ under all tyres, instead of the road's. Default: constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction: Option<NumberOrRange>,
    /// Distance beyond which the ego perceives no road user, m. Default: constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub visibility_m: Option<NumberOrRange>,
    /// Factor on the noise of `sensors`. Default: constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_scale: Option<NumberOrRange>,
}

/// Weather at the start. The friction is that of the road, and the factor on the noise 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WeatherStartFile {
    /// Distance beyond which the ego perceives no road user, m. Default: its upper bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub visibility_m: Option<NumberOrRange>,
}

/// World's own road, laid by an ado ahead of all road users.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Road", deny_unknown_fields)]
// The schema has one definition per name, and `Road` is that of the world's own road.
#[schemars(rename = "RoadAgent")]
pub struct RoadAgentFile {
    /// Name, which begins the names of its signals.
    pub name: String,
    /// Length of laid road ahead of the foremost road user, m.
    pub ahead_m: f64,
    /// Length of a piece, m.
    pub piece_m: f64,
    /// Its ado.
    pub drive: SceneAdoFile,
}

/// Drive of an ado without a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
// A single variant, so that files write `Ado(…)` as they do for agents with a body.
pub enum SceneAdoFile {
    /// A learning adversary.
    Ado(AdoFile),
}

impl SceneAdoFile {
    /// Returns the ado.
    pub fn ado(&self) -> &AdoFile {
        let SceneAdoFile::Ado(ado) = self;
        ado
    }
}

/// Learning adversary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Ado", deny_unknown_fields)]
pub struct AdoFile {
    /// Plan from which the actions deviate. Default: the storyboard, for `Deviate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<PlanFile>,
    /// The choices at each decision.
    pub actions: Actions,
    /// The index, from 0, of the action with which the ado does not interfere: 1 in
    /// `Accelerations([-3.0, 0.0, 3.0])`. Starts that fail with it are trivial.
    pub neutral: usize,
    /// The signals that the policy sees. Several ados share one policy, which sees the
    /// signals of all of them. `check` prints them with their scales. Default: default
    /// observation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observe: Option<Vec<String>>,
    /// `Rule(name: …, stl: …)`, the most important first. `priority:` overrides the order.
    pub rulebook: Vec<RuleFile>,
    /// A learner of its own. Every ado then has a policy of its own. Default: the world's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    // Without the box, every agent of a file would have the size of a learner's settings.
    pub learner: Option<Box<LearnerSettings>>,
    /// Time constant with which a vehicle's acceleration follows. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub lag_s: f64,
}

/// Plan in the form of a file.
pub type PlanFile = MotionPlan<NumberOrRange, String>;
