//! The driving scene, assembled from data: a road, an ego, ados and traffic.
//!
//! No scene type per scenario exists. A world file describes a [`DriveSpec`],
//! and [`DriveScene`] simulates it on either plant.

mod actions;
mod bounds;
mod carrying;
mod course;
mod drawn;
mod frozen;
mod ghost;
mod layout;
mod light;
mod motion;
mod names;
mod network;
mod observing;
mod perceiving;
mod placed;
mod plan;
mod planned;
mod range;
mod replaying;
mod road;
mod script;
mod seeing;
mod sensors;
mod sight;
mod signals;
mod spec;
mod staging;
mod state;
mod steering;
mod trained;
mod variant;
mod world;

pub use actions::{Actions, Deviation, Grid, Lateral, PhaseAction};
pub use bounds::Bounds;
pub use course::{Course, CourseError, OnRoad, Piece};
pub use frozen::TrainedError;
pub use layout::SceneError;
pub use light::{Light, LightDrive, Schedule};
pub use motion::DriveScene;
pub use names::AgentNames;
pub use placed::{Direction, PlacedRoad, PlacedRoads, Priority, RoadPlace};
pub use plan::{MeetEgo, MotionLaw, MotionPlan, ScriptStep, SteadyPart};
pub use range::Range;
pub use road::Road;
pub use script::Script;
pub use sensors::Sensors;
pub use signals::{SignalSource, TTC_CAP_S, current_name, schema_of};
pub use spec::{
    Agent, ControllerFactory, Drive, DriveSpec, EgoController, EgoDrive, PlanSpec, StartPlace,
};
pub use steering::LaneKeeping;
pub use trained::{TrainedAdo, TrainingWorld};
pub use variant::EgoVariant;
pub use world::DriveWorld;
