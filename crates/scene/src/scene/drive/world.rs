//! Driving worlds: the data that their scenes share.

use std::sync::Arc;

use super::layout::{DriveLayout, SceneError};
use super::spec::DriveSpec;
use crate::rl::Spaces;
use crate::road::{Course, goes_first};
use crate::stl::BoundExpr;
use crate::trace::Schema;

/// An assembled driving world: builds scenes that share all fixed data.
#[derive(Clone)]
pub struct DriveWorld(pub Arc<DriveLayout>);

impl DriveWorld {
    /// Assembles a world.
    ///
    /// # Errors
    /// Signals clash or do not bind, or the number of egos is not one.
    pub fn new(spec: DriveSpec) -> Result<DriveWorld, SceneError> {
        DriveLayout::new(spec).map(|layout| DriveWorld(Arc::new(layout)))
    }

    /// Returns the spec it was assembled from.
    pub fn spec(&self) -> &DriveSpec {
        &self.0.spec
    }

    /// Returns the course of lane 0 of the world's own road.
    pub fn course(&self) -> &Course {
        self.0.network.main()
    }

    /// Returns the courses of all roads, the world's own first, then the named ones.
    pub fn courses(&self) -> &[Course] {
        self.0.network.courses()
    }

    /// Returns whether an agent has right of way over another.
    ///
    /// As in the signal `A.B.priority`, where their paths cross. `None` if they
    /// never cross or a name is unknown.
    pub fn goes_before(&self, one: &str, other: &str) -> Option<bool> {
        let agents = &self.0.spec.agents;
        let of = |name: &str| agents.iter().position(|agent| agent.name == name);
        let pair = [of(one)?, of(other)?];
        let crossings = self.0.network.crossings(pair[0], pair[1]);
        (!crossings.is_empty()).then(|| goes_first(crossings, self.0.spec.priorities(pair)))
    }

    /// Returns the schema of the published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Returns the expressions of the derived signals, bound to the rows of this world.
    pub fn derived_exprs(&self) -> &[BoundExpr] {
        &self.0.derived
    }

    /// Returns the shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }
}
