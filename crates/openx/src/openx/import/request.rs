//! Request to import a scenario file.

use std::path::{Path, PathBuf};

/// Request to import a scenario file.
#[derive(Clone, Copy, Debug)]
pub struct Import<'a> {
    /// Path of the scenario.
    pub scenario: &'a Path,
    /// Path of its variation file. Without it, the file itself is the only point.
    pub points: Option<&'a Path>,
    /// Index of the only point to import, from 0. Without it, all are imported.
    pub only: Option<usize>,
    /// True to leave out invalid points instead of refusing them.
    ///
    /// A point is invalid if it breaks a constraint of the file, or if the
    /// ego's lane leads off the road.
    pub skips_broken: bool,
    /// Name of the worlds.
    pub name: &'a str,
    /// Entity that becomes an ado and may deviate from its plan.
    pub ado: Option<&'a str>,
    /// Entity that is the ego. Default: `Ego`.
    pub ego: Option<&'a str>,
    /// True to leave the motion that the file gives the ego to the user's controller.
    ///
    /// Without it, such a motion is refused.
    pub leaves_ego: bool,
    /// Road files of maps that the scenario gives by name only.
    pub maps: &'a [(String, PathBuf)],
}
