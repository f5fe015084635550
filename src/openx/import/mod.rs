//! Test protocols from OpenSCENARIO and OpenDRIVE: points of a scenario file as
//! worlds of our own.
//!
//! A scenario is read at each point of its variation file, with every parameter
//! evaluated, and turned into roads, bodies, places and laws. Points that differ
//! in numbers only become one world with a table of starts. What is not
//! understood is refused by file, element and point; what does not move anybody
//! (logs, lights, weather) is left out and listed.
//!
//! Architecture Invariant: files come in through a function; nothing is written.

mod acts;
mod bodies;
mod catalog;
mod draft;
mod dropped;
mod ends;
mod entity;
mod error;
mod expression;
mod files;
mod laws;
mod motion;
mod places;
mod plans;
mod points;
mod roads;
mod scenario;
mod scope;
mod seen;
mod spot;
mod surface;
mod tree;
mod triggers;
mod ways;
mod world;

pub use draft::ImportedWorld;
pub use dropped::DroppedElements;
pub use error::ImportError;
pub use files::Files;
pub use points::ImportedPoint;

use std::path::Path;

use error::At;
use scenario::Protocol;

/// What is to be imported.
#[derive(Clone, Copy, Debug)]
pub struct Import<'a> {
    /// The scenario.
    pub scenario: &'a Path,
    /// Its variation file; without one there is one point, the file's own.
    pub points: Option<&'a Path>,
    /// The only one of them that is wanted, from 0; left out: all.
    pub only: Option<usize>,
    /// Whether points that break a constraint of the file, or whose ego's lane
    /// leads off the road, are left out; else they are refused.
    pub skips_broken: bool,
    /// What the worlds are called.
    pub name: &'a str,
    /// Who is an ado that strays from its plan, if anybody.
    pub ado: Option<&'a str>,
}

/// The points of a variation file, in the order in which they are run.
///
/// # Errors
/// What cannot be read, by file and element.
pub fn points_of(path: &Path, files: Files<'_>) -> Result<Vec<ImportedPoint>, ImportError> {
    points::read(path, files)
}

/// What came of an import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The worlds, each with its points.
    pub worlds: Vec<ImportedWorld>,
    /// Number of points that were left out.
    pub broken: usize,
    /// What the files say and the worlds do not, by kind.
    pub dropped: Vec<DroppedElements>,
}

impl Import<'_> {
    /// Reads all files and makes the worlds.
    ///
    /// # Errors
    /// What cannot be read or said, by file, element and point.
    pub fn read(&self, files: Files<'_>) -> Result<Imported, ImportError> {
        let protocol = Protocol::open(self.scenario, files)?;
        let points = match self.points {
            Some(path) => points::read(path, files)?,
            None => vec![ImportedPoint::default()],
        };
        let mut drafts = Vec::new();
        let mut broken = 0;
        let wanted = |index: usize| self.only.is_none_or(|only| only == index);
        if let Some(only) = self.only.filter(|only| points.len() <= *only) {
            let what = format!("there is no point {only}: there are {}", points.len());
            return Err(At::file(self.points.unwrap_or(self.scenario)).error(what));
        }
        for (index, point) in points
            .iter()
            .enumerate()
            .filter(|(index, _)| wanted(*index))
        {
            let at = |error: ImportError| error.at_point(index, &point.0);
            let scope = protocol.scope(point).map_err(at)?;
            if let Some(error) = protocol.broken(&scope).map_err(at)? {
                match self.skips_broken {
                    true => broken += 1,
                    false => return Err(at(error)),
                }
                continue;
            }
            let concrete = match protocol.at(&scope, files).map_err(at) {
                Err(error) if error.is_of_point && self.skips_broken => {
                    broken += 1;
                    continue;
                }
                concrete => concrete?,
            };
            drafts.push((index, world::draft(&concrete, self.ado).map_err(at)?));
        }
        if drafts.is_empty() {
            let error =
                At::file(self.scenario).error("every point breaks a constraint of the file");
            return Err(error);
        }
        let cut = drafts.iter().filter(|(_, draft)| draft.is_cut).count();
        let mut dropped = protocol.dropped.list();
        if 0 < cut {
            dropped.push(DroppedElements {
                kind: "what happens behind the end of a road",
                file: self.scenario.to_owned(),
                line: protocol.ends_line(),
                count: cut,
            });
        }
        let source = self.source(&protocol);
        let worlds = draft::worlds(self.name, &source, drafts);
        Ok(Imported {
            worlds,
            broken,
            dropped,
        })
    }

    fn source(&self, protocol: &Protocol) -> String {
        let name = |path: &Path| {
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        };
        let points = self
            .points
            .map(|path| format!(" at the points of {}", name(path)));
        format!(
            "{}{}: {}",
            name(self.scenario),
            points.unwrap_or_default(),
            protocol.about
        )
    }
}
