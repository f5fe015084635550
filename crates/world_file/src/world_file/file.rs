//! Driving world: the fields of `Scenario(…)`.
//!
//! The comments of the fields are the words of editors and of
//! `brakecheck reference world-file`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::agent_file::AgentFile;
use super::change_file::Change;
use super::declared_traffic_file::DeclaredTrafficFile;
use super::default_field::is_default;
use super::environment_file::{LanesFile, OwnRoad, SensorsFile, WindFile};
use super::family_file::FamilyFile;
use super::natural_file::NaturalFile;
use super::number_or_range::NumberOrRange;
use super::origin_file::OriginFile;
use super::signal_file::SignalFile;
use super::training_goal::TrainingGoal;
use crate::rl::LearnerSettings;
use crate::road::{Piece, Priority, RoadPlace};
use crate::ron_file::Ordered;
use crate::rulebook::{Counts, JudgeKind, Reward};
use crate::scene::Clock;
use crate::sim::{Body, PlantKind};
use crate::story::values::Storyboard;
use crate::testbench::Repeats;

/// Driving world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Scenario", deny_unknown_fields)]
pub struct ScenarioFile {
    /// Letters, digits, `_` and `-`. It is part of the key of every start, so a new name
    /// changes the starts of your world, and rates under both names are of different
    /// starts.
    pub name: String,
    /// One sentence, shown in all output.
    pub question: String,
    /// Origin of the world. Default: empty.
    #[serde(default, skip_serializing_if = "is_default")]
    pub source: String,
    /// Times.
    pub clock: Clock,
    /// `Rigid` (3D, rapier) or `Kinematic` (2D, 20 to 35 times faster). Default: `Rigid`.
    #[serde(default = "rigid", skip_serializing_if = "is_rigid")]
    pub plant: PlantKind,
    /// Seconds that rapier plays after the first contact of every episode, at most 20. Hit
    /// vehicles roll freely, and others keep their last command. Verdicts do not depend on
    /// it. Default: 2 if kept or shown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after_contact_s: Option<f64>,
    /// The judged part of a run: `UntilViolation` ends at the first decided sample,
    /// `UntilContact` at a contact or the end, `WholeRun` at the end. Default:
    /// `UntilViolation`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub judge: JudgeKind,
    /// The violations that are counterexamples: `Violation`, `Contact(closing_mps: 3.0)`,
    /// `Preventable(by: [RSS])`. Default: `Violation`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub counts: Counts,
    /// Failures for which training pays more: `[Severe]`, `[Distinct]`, both or `[]`.
    /// Default: `[Severe]` if the specification is about a gap or a contact and the learner
    /// is `Dqfd`, otherwise `[]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goals: Option<Vec<TrainingGoal>>,
    /// Lanes and their course.
    pub road: OwnRoad,
    /// Pose of the world's origin in a road file of another simulator, which `serve` reports.
    /// Default: none, or that of `OpenDrive`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<OriginFile>,
    /// Grades of the `road`: station and rise per metre, each from its station on. Default:
    /// flat.
    #[serde(default, skip_serializing_if = "is_default")]
    pub grades: Vec<(f64, NumberOrRange)>,
    /// Length of the parabola from one grade to the next, m. Default: 0, an edge.
    #[serde(default, skip_serializing_if = "is_default")]
    pub vertical_curve_m: f64,
    /// Banks of the `road`: station and slope across, positive where the left side is
    /// higher. Default: flat.
    #[serde(default, skip_serializing_if = "is_default")]
    pub banks: Vec<(f64, f64)>,
    /// Wind and a gust. Default: still air.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind: Option<WindFile>,
    /// Other roads by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub roads: Ordered<RoadFile>,
    /// Your own bodies by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bodies: Ordered<Body>,
    /// Road users, obstacles and lights, with exactly one ego. A world without an ado trains
    /// nothing.
    pub agents: Vec<AgentFile>,
    /// Further numbers of a start, by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parameters: Ordered<NumberOrRange>,
    /// Starts as a table. Default: the ranges determine the starts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsFile>,
    /// Stories that move agents, in the words of OpenSCENARIO. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub storyboard: Option<Storyboard>,
    /// Delay, noise and occlusion of the ego's perception. Default: perfect.
    #[serde(default, skip_serializing_if = "is_default")]
    pub sensors: SensorsFile,
    /// Signals derived from others, in order. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub signals: Ordered<SignalFile>,
    /// Named formulas. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub formulas: Ordered<String>,
    /// ψ_ego: the specification that the ego must satisfy.
    pub ego_spec: String,
    /// The requirement behind `ego_spec`, such as `"R157 5.2.5.2"`, shown in the page, JSON
    /// and JUnit. A `Rule` may have its own. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// Numbers by name. `T` is the horizon. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub constants: Ordered<f64>,
    /// Number per verdict. `Plain(rho_max: …)` is Definition 4 as printed. Default:
    /// `Tanh(rho_max: 50.0, scale: 10.0, jump: 0.5, foul_span: 0.1)`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub reward: Reward,
    /// The learner and its settings, all with defaults. Default: `Dqfd(…)`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub learner: LearnerSettings,
    /// Other learners by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub learners: Ordered<LearnerSettings>,
    /// The family of egos for `train --against wide`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub train_against: Option<FamilyFile>,
    /// Runs of each start, for random egos: `5`, or `(runs: 5, gate: 3)`. Default: `1`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub repeats: Repeats,
    /// Warnings that you suppress, by the word at the end of each: `["bounds_beyond_T"]`.
    /// Default: `[]`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub allow: Vec<String>,
    /// Changed egos by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub reuse: Ordered<Change>,
    /// Traffic of the ados and a limit on them. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub natural: Option<NaturalFile>,
    /// Laws of starts and actions for `risk`: `Traffic(…)`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traffic: Option<DeclaredTrafficFile>,
}

impl ScenarioFile {
    /// Returns a world with the default of every field that has one.
    pub fn new(
        name: impl Into<String>,
        question: impl Into<String>,
        clock: Clock,
        road: OwnRoad,
        agents: Vec<AgentFile>,
        ego_spec: impl Into<String>,
    ) -> ScenarioFile {
        // All fields are named here, because the required ones rule out a `Default`.
        ScenarioFile {
            name: name.into(),
            question: question.into(),
            source: String::new(),
            clock,
            plant: rigid(),
            after_contact_s: None,
            judge: JudgeKind::default(),
            counts: Counts::default(),
            goals: None,
            road,
            origin: None,
            grades: Vec::new(),
            vertical_curve_m: 0.0,
            banks: Vec::new(),
            wind: None,
            roads: Ordered::default(),
            bodies: Ordered::default(),
            agents,
            parameters: Ordered::default(),
            points: None,
            storyboard: None,
            sensors: SensorsFile::default(),
            signals: Ordered::default(),
            formulas: Ordered::default(),
            ego_spec: ego_spec.into(),
            requirement: None,
            constants: Ordered::default(),
            reward: Reward::default(),
            learner: LearnerSettings::default(),
            learners: Ordered::default(),
            train_against: None,
            repeats: Repeats::default(),
            allow: Vec::new(),
            reuse: Ordered::default(),
            natural: None,
            traffic: None,
        }
    }
}

fn rigid() -> PlantKind {
    PlantKind::Rigid
}

fn is_rigid(plant: &PlantKind) -> bool {
    *plant == rigid()
}

/// Road placed in the plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Road", deny_unknown_fields)]
#[schemars(rename = "PlacedRoad")]
pub struct RoadFile {
    /// Start of the middle of its lane 0. Default: given by `along`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<RoadPlace>,
    /// Way along lanes of the own road's OpenDRIVE file, in place of all else. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along: Option<LanesFile>,
    /// Number of lanes. Default: 1.
    #[serde(default = "one_lane", skip_serializing_if = "is_one_lane")]
    pub lanes: usize,
    /// Width of its lanes, m. Default: that of the world's own road.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lane_width_m: Option<f64>,
    /// Lines and arcs of its course. Default: straight.
    #[serde(default, skip_serializing_if = "is_default")]
    pub pieces: Vec<Piece>,
    /// Right of way where it crosses the world's own road. Default: `Equal`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub priority: Priority,
    /// Grades: station and rise per metre. Default: flat.
    #[serde(default, skip_serializing_if = "is_default")]
    pub grades: Vec<(f64, f64)>,
    /// Length of the vertical curves between them, m. Default: 0, an edge.
    #[serde(default, skip_serializing_if = "is_default")]
    pub vertical_curve_m: f64,
    /// Banks: station and slope to the left. Default: flat.
    #[serde(default, skip_serializing_if = "is_default")]
    pub banks: Vec<(f64, f64)>,
}

fn one_lane() -> usize {
    1
}

fn is_one_lane(lanes: &usize) -> bool {
    *lanes == one_lane()
}

/// Starts as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Points", deny_unknown_fields)]
pub struct PointsFile {
    /// Names of the columns: every range of the world, in any order.
    pub axes: Vec<String>,
    /// Starts: a number per column.
    pub rows: Vec<Vec<f64>>,
}
