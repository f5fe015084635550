//! A driving world: what its scenes share, and what they are made of.

use std::sync::Arc;

use super::course::Course;
use super::layout::{Layout, SceneError};
use super::spec::DriveSpec;
use crate::rl::Spaces;
use crate::trace::Schema;

/// An assembled driving world: makes scenes that share everything fixed.
#[derive(Clone)]
pub struct DriveWorld(pub(super) Arc<Layout>);

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

    /// The course of lane 0 of the world's own road.
    pub fn course(&self) -> &Course {
        self.0.network.main()
    }

    /// The courses of all roads, the world's own first, then the named ones.
    pub fn courses(&self) -> &[Course] {
        self.0.network.courses()
    }

    /// The published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }
}
