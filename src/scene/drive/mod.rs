//! The driving scene, assembled from data: a road, an ego, ados and traffic.
//!
//! There is no scene type per scenario. Whatever a world file describes is a
//! [`DriveSpec`], and [`DriveScene`] moves it on either plant.

mod actions;
mod bounds;
mod course;
mod frozen;
mod layout;
mod light;
mod motion;
mod names;
mod observing;
mod perceiving;
mod replaying;
mod road;
mod script;
mod sensors;
mod signals;
mod spec;
mod staging;
mod state;
mod steering;
mod trained;
mod variant;

use std::sync::Arc;

pub use actions::{Actions, Grid, Lateral, Turn};
pub use bounds::Bounds;
pub use course::{Course, CourseError, OnRoad, Piece};
pub use frozen::TrainedError;
pub use layout::SceneError;
pub use light::{Light, LightDrive, Schedule};
pub use motion::DriveScene;
pub use names::Names;
pub use road::Road;
pub use script::Script;
pub use sensors::Sensors;
pub use signals::{SignalSource, TTC_CAP_S, current_name, schema_of};
pub use spec::{
    Agent, ControllerFactory, Drive, DriveSpec, EgoController, EgoDrive, Range, StartPlace,
};
pub use trained::{TrainedAdo, TrainingWorld};
pub use variant::EgoVariant;

use crate::rl::Spaces;
use crate::trace::Schema;
use layout::Layout;

/// An assembled driving world: makes scenes that share everything fixed.
#[derive(Clone)]
pub struct DriveWorld(Arc<Layout>);

impl DriveWorld {
    /// Assembles a world.
    ///
    /// # Errors
    /// Signals that clash or do not bind; no ego or several.
    pub fn new(spec: DriveSpec) -> Result<DriveWorld, SceneError> {
        Layout::new(spec).map(|layout| DriveWorld(Arc::new(layout)))
    }

    /// What it was assembled from.
    pub fn spec(&self) -> &DriveSpec {
        &self.0.spec
    }

    /// The published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }

    /// A scene at rest, to be `reset`.
    pub fn scene(&self) -> DriveScene {
        DriveScene::new(Arc::clone(&self.0))
    }
}
