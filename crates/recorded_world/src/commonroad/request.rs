//! Request to import a CommonRoad scenario.

use std::path::Path;

/// Request to import a CommonRoad scenario.
#[derive(Clone, Copy, Debug)]
pub struct CommonRoadImport<'a> {
    /// Scenario file.
    pub scenario: &'a Path,
    /// Name of the world.
    pub name: &'a str,
    /// Id of the planning problem. Default: the only one.
    pub ego: Option<&'a str>,
    /// Id of an obstacle, or the name of its agent, that may stray from its recording.
    pub ado: Option<&'a str>,
}
