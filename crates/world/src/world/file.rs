//! Shape of a world file for serde.

use std::fmt;

use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::declared_traffic_file::DeclaredTrafficFile;
use super::environment_file::{LanesFile, OwnRoad, SensorsFile, WindFile};
use super::family_file::FamilyFile;
use super::natural_file::NaturalFile;
pub(super) use super::number_or_range::NumberOrRange;
pub(super) use super::rule_file::RuleFile;
use super::trained::run::TrainedFile;
use super::training_goal::TrainingGoal;
use crate::ego::{Actuated, ControllerSpec, Phase};
use crate::rl::LearnerSettings;
use crate::road::{Direction, Piece, Priority, RoadPlace};
use crate::ron_file::{Ordered, Patch};
use crate::rulebook::{Counts, JudgeKind, Reward};
use crate::scene::Clock;
use crate::scene::drive::{
    Actions, LaneKeeping, MeetEgo, MotionPlan, Range, Schedule, Script, ScriptStep, Sensors,
};
use crate::scene::grid::{AtWall, Horizon, Starts};
use crate::sim::{Body, PlantKind};
use crate::testbench::Repeats;

#[derive(Deserialize)]
#[serde(rename = "Scenario", deny_unknown_fields)]
pub(super) struct ScenarioFile {
    pub(super) name: String,
    pub(super) question: String,
    #[serde(default)]
    pub(super) source: String,
    pub(super) clock: Clock,
    #[serde(default = "rigid")]
    pub(super) plant: PlantKind,
    #[serde(default)]
    pub(super) after_contact_s: Option<f64>,
    #[serde(default)]
    pub(super) judge: JudgeKind,
    #[serde(default)]
    pub(super) counts: Counts,
    #[serde(default)]
    pub(super) goals: Vec<TrainingGoal>,
    pub(super) road: OwnRoad,
    /// Grades of the world's own road: station and rise.
    #[serde(default)]
    pub(super) grades: Vec<(f64, NumberOrRange)>,
    /// Length of the vertical curves between them.
    #[serde(default)]
    pub(super) vertical_curve_m: f64,
    /// Banks of the world's own road: station and slope to the left.
    #[serde(default)]
    pub(super) banks: Vec<(f64, f64)>,
    #[serde(default)]
    pub(super) wind: Option<WindFile>,
    #[serde(default)]
    pub(super) roads: Ordered<RoadFile>,
    #[serde(default)]
    pub(super) bodies: Ordered<Body>,
    pub(super) agents: Vec<AgentFile>,
    /// Numbers of a start besides the agents' places.
    #[serde(default)]
    pub(super) parameters: Ordered<NumberOrRange>,
    /// Starts as a table. Without it, the ranges determine the starts.
    #[serde(default)]
    pub(super) points: Option<PointsFile>,
    #[serde(default)]
    pub(super) sensors: SensorsFile,
    #[serde(default)]
    pub(super) signals: Ordered<SignalFile>,
    #[serde(default)]
    pub(super) formulas: Ordered<String>,
    pub(super) ego_spec: String,
    /// Requirement that ψ_ego expresses, such as a paragraph of a regulation.
    #[serde(default)]
    pub(super) requirement: Option<String>,
    #[serde(default)]
    pub(super) constants: Ordered<f64>,
    #[serde(default)]
    pub(super) reward: Reward,
    #[serde(default)]
    pub(super) learner: LearnerSettings,
    #[serde(default)]
    pub(super) learners: Ordered<LearnerSettings>,
    #[serde(default)]
    pub(super) train_against: Option<FamilyFile>,
    #[serde(default)]
    pub(super) repeats: Repeats,
    /// Warnings to suppress, because the world intends what they warn of.
    #[serde(default)]
    pub(super) allow: Vec<String>,
    #[serde(default)]
    pub(super) reuse: Ordered<Change>,
    /// Traffic in which the ados drive, and a limit on how rare their driving becomes.
    #[serde(default)]
    pub(super) natural: Option<NaturalFile>,
    /// Laws of the starts and of the ados' actions, for the probability of a failure.
    #[serde(default)]
    pub(super) traffic: Option<DeclaredTrafficFile>,
}

fn rigid() -> PlantKind {
    PlantKind::Rigid
}

/// Road placed in the plane.
#[derive(Deserialize)]
#[serde(rename = "Road", deny_unknown_fields)]
pub(super) struct RoadFile {
    /// Start of the middle of its lane 0.
    #[serde(default)]
    pub(super) at: Option<RoadPlace>,
    /// Way along lanes of the own road's OpenDRIVE file, in place of all else.
    #[serde(default)]
    pub(super) along: Option<LanesFile>,
    #[serde(default = "one_lane")]
    pub(super) lanes: usize,
    /// Width of its lanes. Without it, that of the world's own road.
    #[serde(default)]
    pub(super) lane_width_m: Option<f64>,
    #[serde(default)]
    pub(super) pieces: Vec<Piece>,
    #[serde(default)]
    pub(super) priority: Priority,
    /// Grades: station and rise.
    #[serde(default)]
    pub(super) grades: Vec<(f64, f64)>,
    /// Length of the vertical curves between them.
    #[serde(default)]
    pub(super) vertical_curve_m: f64,
    /// Banks: station and slope to the left.
    #[serde(default)]
    pub(super) banks: Vec<(f64, f64)>,
}

fn one_lane() -> usize {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum AgentFile {
    Vehicle {
        name: String,
        body: String,
        /// Named road. Without it, the world's own road.
        #[serde(default)]
        road: Option<String>,
        #[serde(default)]
        lane: usize,
        #[serde(default)]
        direction: Direction,
        /// Point of the vehicle that keeps the line in bends.
        #[serde(default)]
        lane_keeping: LaneKeeping,
        /// Offset to the left of the lane's middle.
        #[serde(default = "nothing")]
        offset_m: NumberOrRange,
        start: StartFile,
        drive: DriveFile,
    },
    Pedestrian {
        name: String,
        #[serde(default = "pedestrian")]
        body: String,
        #[serde(default)]
        road: Option<String>,
        /// Offset to the left of lane 0's middle.
        lateral_m: NumberOrRange,
        #[serde(default)]
        facing: Facing,
        start: StartFile,
        drive: DriveFile,
    },
    /// Standing object, such as a parked car.
    Obstacle {
        name: String,
        body: String,
        #[serde(default)]
        road: Option<String>,
        /// Station of its front along the road.
        s_m: NumberOrRange,
        /// Offset to the left of lane 0's middle.
        lateral_m: NumberOrRange,
        /// Heading, counter-clockwise from the road's direction.
        #[serde(default)]
        heading_rad: f64,
    },
    Light {
        name: String,
        /// Named road. Without it, the world's own road.
        #[serde(default)]
        road: Option<String>,
        /// Signal of the road's OpenDRIVE file, which becomes its `line_m`.
        #[serde(default)]
        signal: Option<String>,
        #[serde(default)]
        line_m: Option<f64>,
        #[serde(default)]
        phase: Phase,
        drive: LightFile,
    },
    Weather(WeatherFile),
    Road(RoadAgentFile),
    Turns {
        name: String,
        drive: SceneAdoFile,
    },
}

fn nothing() -> NumberOrRange {
    NumberOrRange(Range::fixed(0.0))
}

fn pedestrian() -> String {
    "pedestrian".to_owned()
}

impl AgentFile {
    pub(super) fn name(&self) -> &str {
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
}

impl AgentFile {
    /// Returns the point of the agent that keeps the line.
    pub(super) fn lane_keeping(&self) -> LaneKeeping {
        match self {
            AgentFile::Vehicle { lane_keeping, .. } => *lane_keeping,
            _ => LaneKeeping::default(),
        }
    }

    /// Returns the lane in which it starts, 0 for agents without lanes.
    pub(super) fn lane(&self) -> usize {
        match self {
            AgentFile::Vehicle { lane, .. } => *lane,
            _ => 0,
        }
    }

    /// Returns the name of its road, if stated.
    pub(super) fn road(&self) -> Option<&str> {
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
#[derive(Clone, Copy, Default, Deserialize)]
pub(super) enum Facing {
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum StartFile {
    At {
        x_m: NumberOrRange,
        speed_mps: NumberOrRange,
    },
    Ahead {
        of: String,
        headway_m: NumberOrRange,
        speed_mps: NumberOrRange,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum DriveFile {
    Ego(Actuated<ControllerSpec>),
    Ado(AdoFile),
    Trained(TrainedFile),
    Scripted(Script),
    Script(Vec<ScriptStep<NumberOrRange, String>>),
    Meet(MeetEgo<NumberOrRange>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum LightFile {
    Schedule(Schedule),
    Trained(TrainedFile),
    Ado(AdoFile),
}

/// Weather: bounds of what it changes, its start and its ado.
#[derive(Deserialize)]
#[serde(rename = "Weather", deny_unknown_fields)]
pub(super) struct WeatherFile {
    pub(super) name: String,
    pub(super) bounds: WeatherBoundsFile,
    #[serde(default)]
    pub(super) start: WeatherStartFile,
    pub(super) drive: SceneAdoFile,
}

/// Bounds of the weather. A quantity without bounds never changes.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WeatherBoundsFile {
    pub(super) friction: Option<NumberOrRange>,
    pub(super) visibility_m: Option<NumberOrRange>,
    pub(super) noise_scale: Option<NumberOrRange>,
}

/// Weather at the start. The friction is that of the road, and the factor on the noise 1.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct WeatherStartFile {
    pub(super) visibility_m: Option<NumberOrRange>,
}

/// World's own road, laid by an ado ahead of all road users.
#[derive(Deserialize)]
#[serde(rename = "Road", deny_unknown_fields)]
pub(super) struct RoadAgentFile {
    pub(super) name: String,
    /// Length of laid road ahead of the foremost road user.
    pub(super) ahead_m: f64,
    /// Length of a piece.
    pub(super) piece_m: f64,
    pub(super) drive: SceneAdoFile,
}

/// Drive of an ado without a body.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum SceneAdoFile {
    Ado(AdoFile),
}

impl SceneAdoFile {
    pub(super) fn ado(&self) -> &AdoFile {
        let SceneAdoFile::Ado(ado) = self;
        ado
    }
}

#[derive(Deserialize)]
#[serde(rename = "Ado", deny_unknown_fields)]
pub(super) struct AdoFile {
    /// Plan from which the actions deviate. Without it, there is none.
    #[serde(default)]
    pub(super) base: Option<PlanFile>,
    pub(super) actions: Actions,
    pub(super) neutral: usize,
    /// Observed signals. The default is that of [`crate::scene::drive::DriveSpec`].
    #[serde(default)]
    pub(super) observe: Option<Vec<String>>,
    pub(super) rulebook: Vec<RuleFile>,
    /// Learner of this ado alone. The others then have a learner each, too.
    #[serde(default)]
    pub(super) learner: Option<Box<LearnerSettings>>,
    /// Time constant with which a vehicle's acceleration follows, in s.
    #[serde(default)]
    pub(super) lag_s: f64,
}

/// Plan in the form of a file.
pub(super) type PlanFile = MotionPlan<NumberOrRange, String>;

/// Starts as a table.
#[derive(Deserialize)]
#[serde(rename = "Points", deny_unknown_fields)]
pub(super) struct PointsFile {
    /// Names of the columns: every range of the world, in any order.
    pub(super) axes: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

/// Change of a world: content of `reuse` and `--ego FILE`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Change", deny_unknown_fields, default)]
pub struct Change {
    /// Parameters of the ego's controller by name.
    pub ego: Patch,
    /// Other controller, with its actuator.
    pub controller: Option<Actuated<ControllerSpec>>,
    /// Other body of the ego.
    pub ego_body: Option<String>,
    /// Other road surface.
    pub friction: Option<f64>,
    /// Other plant.
    pub plant: Option<PlantKind>,
    /// Other sensors of the ego.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensors: Option<Sensors>,
    /// Other map. Grid worlds accept no other change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridChange>,
}

/// Change of a grid world, as in its `reuse`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Change", deny_unknown_fields, default)]
pub struct GridChange {
    /// n: cells along each side.
    pub size: Option<u32>,
    /// ε: fine cells along each cell.
    pub refine: Option<u32>,
    /// k: fine cells per step of the ego.
    pub ego_step: Option<u32>,
    /// Behaviour of the ego at a wall.
    pub at_wall: Option<AtWall>,
    /// K: horizon in steps.
    pub horizon: Option<Horizon>,
    /// X_init.
    pub starts: Option<Starts>,
}

/// Signal: an expression, or `Signal(expr: "…", unit: "m", about: "…", …)`.
pub(super) struct SignalFile {
    pub(super) expr: String,
    pub(super) unit: Option<String>,
    pub(super) about: Option<String>,
    pub(super) range: Option<(f64, f64)>,
    /// True if it was written as a struct, which determines the place of errors.
    pub(super) long: bool,
}

#[derive(Deserialize)]
#[serde(rename = "Signal", deny_unknown_fields)]
struct LongSignal {
    expr: String,
    #[serde(default)]
    unit: Option<String>,
    #[serde(default)]
    about: Option<String>,
    #[serde(default)]
    range: Option<(f64, f64)>,
}

impl<'de> Deserialize<'de> for SignalFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SignalFile, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = SignalFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(
                    f,
                    "an expression such as \"ado.x - ego.x\" or Signal(expr: \"…\", …)"
                )
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<SignalFile, E> {
                Ok(SignalFile {
                    expr: v.to_owned(),
                    unit: None,
                    about: None,
                    range: None,
                    long: false,
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<SignalFile, A::Error> {
                let long = LongSignal::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(SignalFile {
                    expr: long.expr,
                    unit: long.unit,
                    about: long.about,
                    range: long.range,
                    long: true,
                })
            }
        }
        deserializer.deserialize_any(Either)
    }
}
