//! Test protocols from OpenSCENARIO and OpenDRIVE, as brakecheck worlds.
//!
//! A scenario is read at each point of its variation file, with every parameter
//! evaluated. It becomes roads, bodies, places and a storyboard. Points that
//! differ only in numbers share one world with a table of starts. Unsupported
//! content is refused with file, element and point. Content without an effect
//! on motion (logs, lights, weather) is dropped and listed.
//!
//! Architecture Invariant: a function provides the files, and this module
//! writes none.

mod agents;
mod bodies;
mod bounds;
mod catalog;
mod concrete;
mod draft;
mod driven_lanes;
mod dropped;
mod ego_events;
mod entity;
mod file_content;
mod first_story;
mod frame;
mod gaps;
mod later;
mod laws;
mod lights;
mod motion;
mod places;
mod plans;
mod points;
mod request;
mod run_end;
mod scenario;
mod seen;
mod still;
mod story;
mod trajectories;
mod words;
mod world;

pub use crate::opendrive::{Files, ImportError};
pub use draft::ImportedWorld;
pub use driven_lanes::{DrivenLanes, PlaceOnLane, driven_lanes, lane_places};
pub use dropped::DroppedElements;
pub use ego_events::EgoEvent;
pub use points::ImportedPoint;
pub use request::Import;

use std::path::Path;

use crate::opendrive::error::{At, Blockers, UnreadPart};
use scenario::Protocol;

/// Number of points that are read once one is refused, to name their problems, too.
const MOST_REFUSED_POINTS: usize = 20;

/// Returns the points of a variation file, in the order of execution.
///
/// # Errors
///
/// Returns an error with file and element for content that is not supported.
pub fn points_of(path: &Path, files: Files<'_>) -> Result<Vec<ImportedPoint>, ImportError> {
    points::read(path, files, points::MAX_POINTS)
}

/// Result of an import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Worlds with their points.
    pub worlds: Vec<ImportedWorld>,
    /// Number of points that were left out.
    pub broken: usize,
    /// Elements of the files without an effect on the worlds, by kind.
    pub dropped: Vec<DroppedElements>,
    /// Events of the file that move the ego, which the user's controller must drive.
    pub ego_events: Vec<EgoEvent>,
}

impl Import<'_> {
    /// Reads all files and returns the worlds.
    ///
    /// # Errors
    ///
    /// Returns an error with file, element and point for unsupported content.
    pub fn read(&self, files: Files<'_>) -> Result<Imported, ImportError> {
        let protocol = Protocol::open(self, files)?;
        // A single point of a large file takes no time.
        let most = match self.only {
            Some(_) => points::MAX_POINTS,
            None => points::most_points(protocol.elements()),
        };
        let points = match self.points {
            Some(path) => points::read(path, files, most)?,
            None => vec![ImportedPoint::default()],
        };
        let mut drafts = Vec::new();
        let mut broken = 0;
        let mut blockers = Blockers::default();
        let mut refused_points = 0;
        let mut unread = None;
        let wanted = |index: usize| self.only.is_none_or(|only| only == index);
        if let Some(only) = self.only.filter(|only| points.len() <= *only) {
            let what = format!("there is no point {only}: there are {}", points.len());
            let at = At::file(self.points.unwrap_or(self.scenario));
            return Err(at.error(what).helped("points count from 0"));
        }
        for (index, point) in points
            .iter()
            .enumerate()
            .filter(|(index, _)| wanted(*index))
        {
            let at = |error: ImportError| error.at_point(index, &point.0);
            if !blockers.is_empty() {
                refused_points += 1;
            }
            // Points of one file mostly have the same problems.
            if refused_points > MOST_REFUSED_POINTS {
                unread = Some(UnreadPart::LaterPoints);
                break;
            }
            let Some(scope) = blockers.keep(protocol.scope(point).map_err(at)) else {
                continue;
            };
            match blockers.keep(protocol.broken(&scope).map_err(at)) {
                Some(None) => {}
                Some(Some(_)) if self.skips_broken => {
                    broken += 1;
                    continue;
                }
                Some(Some(error)) => {
                    blockers.add(at(error));
                    continue;
                }
                None => continue,
            }
            // The constraints of the file do not cover an ego whose lane leads
            // off the road.
            match protocol.draft_at(&scope, files, self.ado).map_err(at) {
                Err(error) if error.is_of_point && self.skips_broken => broken += 1,
                drafted => drafts.extend(blockers.keep(drafted).map(|draft| (index, draft))),
            }
        }
        blockers.none().map_err(|error| match unread {
            Some(part) => error.before(part),
            None => error,
        })?;
        // Problems have ended the import above, so all points are left out here.
        if drafts.is_empty() {
            let error =
                At::file(self.scenario).error("every point breaks a constraint of the file");
            let help = "leave --skip-broken out: the message then names the constraint";
            return Err(error.helped(help));
        }
        // Points that are not read may have other maps.
        let has_all = self.only.is_none() && broken == 0;
        if let Some(name) = protocol.unused_map().filter(|_| has_all) {
            let what = format!("the file has no map called `{name}`");
            let help = format!("leave --road {name}=… out, or correct the name of the map");
            return Err(At::file(self.scenario).error(what).helped(&help));
        }
        let cut = drafts.iter().filter(|(_, draft)| draft.is_cut).count();
        let mut dropped = protocol.dropped.list();
        // Worlds end before an entity leaves its road, which may be earlier
        // than in the file.
        if cut > 0 {
            dropped.push(DroppedElements {
                kind: "what happens behind the end of a road",
                file: self.scenario.to_owned(),
                line: protocol.ends().line,
                count: cut,
            });
        }
        let source = self.source(&protocol);
        let worlds = draft::worlds(self.name, &source, drafts).map_err(|error| {
            let help = "report this file";
            At::file(self.scenario)
                .error(error.to_string())
                .helped(help)
        })?;
        let worlds = worlds.ok_or_else(|| {
            let most = draft::MOST_WORLDS;
            let what = format!("the points differ in more than numbers, in over {most} ways");
            let help = "keep roads and bodies alike, or import fewer points";
            At::file(self.points.unwrap_or(self.scenario))
                .error(what)
                .helped(help)
        })?;
        Ok(Imported {
            worlds,
            broken,
            dropped,
            ego_events: protocol.ego_events(),
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
