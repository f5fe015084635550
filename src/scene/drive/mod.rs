//! The driving scene, assembled from data: a road, an ego, ados and traffic.
//!
//! No scene type per scenario exists. A world file describes a [`DriveSpec`],
//! and [`DriveScene`] simulates it on either plant.

mod actions;
mod after_contact;
mod bounds;
mod commands;
mod default_observation;
mod ego_percept;
mod environment;
mod frozen_policy;
mod ghost;
mod kinematic_playback;
mod layout;
mod light;
mod line_of_sight;
mod motion;
mod motion_profile;
mod names;
mod observing;
mod plan;
mod plan_execution;
mod range;
mod replaying;
mod road_ado;
mod road_laying;
mod scene_geometry;
mod script;
mod sensors;
mod signals;
mod spec;
mod start_environment;
mod start_sampling;
mod state;
mod trained;
mod variant;
mod weather;
mod weather_rates;
mod world;

pub use actions::{Actions, Deviation, Grid, Lateral, PhaseAction};
pub use bounds::Bounds;
pub use environment::{EnvironmentQuantity, EnvironmentRange};
pub use frozen_policy::TrainedError;
pub use layout::SceneError;
pub use light::{Light, LightDrive, Schedule};
pub use motion::DriveScene;
pub use names::AgentNames;
pub use plan::{MeetEgo, MotionLaw, MotionPlan, ScriptStep, SteadyPart};
pub use range::Range;
pub(crate) use road_ado::MAX_HEADING_RAD;
pub use road_ado::RoadAdo;
pub use script::Script;
pub use sensors::Sensors;
pub use signals::SignalSource;
pub use spec::{Agent, ControllerFactory, Drive, DriveSpec, EgoController, StartPlace};
pub(crate) use spec::{EgoDrive, PlanSpec};
pub use trained::{TrainedAdo, TrainingWorld};
pub use variant::EgoVariant;
pub use weather::Weather;
pub use weather_rates::WeatherRates;
pub use world::DriveWorld;
