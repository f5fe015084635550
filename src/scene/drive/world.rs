//! A driving world: what its scenes share, and what they are made of.

use std::sync::Arc;

use super::course::Course;
use super::layout::{Layout, SceneError};
use super::network::goes_first;
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

    /// Whether one agent goes before another where their ways cross, as the
    /// signal `A.B.priority` has it; `None`: they never cross, or nobody is called so.
    pub fn goes_before(&self, one: &str, other: &str) -> Option<bool> {
        let agents = &self.0.spec.agents;
        let of = |name: &str| agents.iter().position(|agent| agent.name == name);
        let pair = [of(one)?, of(other)?];
        let crossings = self.0.network.crossings(pair[0], pair[1]);
        (!crossings.is_empty()).then(|| goes_first(&self.0.spec, crossings, pair))
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
