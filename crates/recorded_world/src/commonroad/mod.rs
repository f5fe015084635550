//! CommonRoad scenarios (2018b and 2020a) as worlds.
//!
//! A planning problem is the start of the ego, lanelets along its way are the world's road,
//! and obstacles follow their recorded states. Speed limits, stops, lights and the goal
//! become formulas. Values that cannot be right are refused with their lines, all at once.
//! Content without an effect is listed.
//!
//! Architecture Invariant: a function provides the files, and this module writes none.

mod bodies;
mod drops;
mod elements;
mod lane_way;
mod laws;
mod map;
mod obstacles;
mod problem;
mod request;
mod route;
#[cfg(test)]
mod tests;
mod touching;
mod traffic_agents;
mod world;

use crate::opendrive::error::{At, Blockers, UnreadPart};
use crate::opendrive::tree::XmlNode;
use crate::opendrive::{Files, ImportError};
use crate::traffic::{FilePlace, FileProblem, ReadError, TrafficRecording, read_commonroad};
pub use drops::DroppedContent;
use drops::Drops;
use map::RoadMap;
use obstacles::{ObstacleMotion, Obstacles};
pub use request::CommonRoadImport;
use world::ScenarioParts;

/// Versions that are read.
const VERSIONS: [&str; 2] = ["2018b", "2020a"];
/// Elements of a scenario that no world has, with their kinds.
const NO_EFFECT: [(&str, &str); 2] = [
    ("intersection", "intersections"),
    ("signalSeries", "signals of obstacles"),
];

/// World that an import of a scenario produced.
#[derive(Clone, Debug, PartialEq)]
pub struct CommonRoadWorld {
    /// RON text of the world.
    pub text: String,
    /// Content of the file without an effect on the world, by kind.
    pub dropped: Vec<DroppedContent>,
    /// Greatest distance of the road from the middle of its lanelets in metres.
    pub road_m: f64,
    /// Elements from which the parts of the text come, by the offsets at which they begin.
    places: Vec<(usize, At)>,
}

impl CommonRoadWorld {
    /// Returns a problem of the text, from an offset on, as one of the element that leads to it.
    pub fn refused(&self, offset: usize, what: &str) -> Option<ImportError> {
        let begun = self.places.iter().rev().find(|it| it.0 <= offset);
        begun.map(|(_, at)| at.error(what))
    }
}

impl CommonRoadImport<'_> {
    /// Reads the scenario and returns its world.
    ///
    /// # Errors
    ///
    /// Returns an error with file, element and line for each value that cannot be right and
    /// for unsupported content.
    pub fn read(&self, files: Files<'_>) -> Result<CommonRoadWorld, ImportError> {
        let root = XmlNode::read(self.scenario, "CommonRoad", files)?;
        let mut blockers = Blockers::default();
        let step_s = blockers.keep(step_s(&root));
        let map = RoadMap::read(&root, &mut blockers);
        let obstacles = Obstacles::read(&root, &mut blockers);
        let problem = problem::read(&root, self.ego, &mut blockers);
        blockers
            .none()
            .map_err(|error| error.before(UnreadPart::OnTheRoads))?;
        let (Some(step_s), Some((problem, further))) = (step_s, problem) else {
            // Invariant: what is not there is among the problems.
            return Err(root.error("it cannot be read"));
        };
        let mut drops = Drops::default();
        drops.add_many("further planning problems", root.line, further);
        list_without_effect(&root, &mut drops);
        let recording = self.recording(&root, &obstacles, files);
        let parts = ScenarioParts {
            root: &root,
            step_s,
            map: &map,
            obstacles: &obstacles,
            problem: &problem,
        };
        let mut blockers = Blockers::default();
        let recording = blockers.keep(recording);
        let road = blockers.keep(parts.road());
        blockers.none()?;
        let (Some(recording), Some(road)) = (recording, road) else {
            // Invariant: what is not there is among the problems.
            return Err(root.error("it cannot be read"));
        };
        let made = parts.world(self, &road, recording.as_ref(), &mut drops)?;
        Ok(CommonRoadWorld {
            text: made.text,
            dropped: drops.list(),
            road_m: road.road.worst_m,
            places: made.places,
        })
    }

    /// Reads the recorded motion, `None` without any.
    fn recording(
        &self,
        root: &XmlNode,
        obstacles: &Obstacles,
        files: Files<'_>,
    ) -> Result<Option<TrafficRecording>, ImportError> {
        let is_recorded =
            |it: &obstacles::FileObstacle| matches!(it.motion, ObstacleMotion::Recorded { .. });
        if !obstacles.all.iter().any(is_recorded) {
            return Ok(None);
        }
        let text = files(self.scenario)
            .map_err(|error| At::file(self.scenario).error(error.to_string()))?;
        let name = self.scenario.display().to_string();
        let found = read_commonroad(text.as_bytes(), &name);
        found.map(Some).map_err(|error| refused(root, &error))
    }
}

/// Returns the seconds of a time step, of a scenario in a version that is read.
fn step_s(root: &XmlNode) -> Result<f64, ImportError> {
    if root.name != "commonRoad" {
        let what = format!("its root is `{}`", root.name);
        return Err(root.refused(what, "name a CommonRoad scenario"));
    }
    let version = root.need("commonRoadVersion")?;
    if !VERSIONS.contains(&version) {
        let what = format!("version `{version}` is not read");
        let help = "convert it to 2018b or 2020a, as commonroad-io does";
        return Err(root.refused(what, help));
    }
    let text = root.need("timeStepSize")?;
    let step_s = text.trim().parse().ok().filter(|it: &f64| it.is_finite());
    step_s.filter(|it| *it > 0.0).ok_or_else(|| {
        let what = format!("`timeStepSize` is `{text}`");
        root.refused(what, "write the seconds of a time step")
    })
}

/// Returns an error of the recorded motion at its line.
fn refused(root: &XmlNode, error: &ReadError) -> ImportError {
    let (at, what) = match error {
        ReadError::Content { place, problem, .. } => {
            let at = match place {
                FilePlace::Line(line) => {
                    At::element(root.file(), "state".to_owned(), *line as usize)
                }
                _ => root.at(),
            };
            (at, problem.to_string())
        }
        other => (root.at(), other.to_string()),
    };
    let help = match error {
        ReadError::Content {
            problem:
                FileProblem::SpeedsDiffer { .. } | FileProblem::Fast { .. } | FileProblem::Period { .. },
            ..
        } => "correct `timeStepSize`, or the `velocity` of the states".to_owned(),
        ReadError::Content {
            problem: FileProblem::HeadingsDiffer { .. },
            ..
        } => "write each `orientation` in radians, counter-clockwise from x".to_owned(),
        _ => error.help(),
    };
    at.error(what).helped(&help)
}

/// Lists elements that no world has.
fn list_without_effect(root: &XmlNode, drops: &mut Drops) {
    for node in &root.children {
        if let Some((_, kind)) = NO_EFFECT.iter().find(|it| it.0 == node.name) {
            drops.add(kind, node.line);
        }
        for inner in &node.children {
            if inner.name == "environment" {
                drops.add("weather, time of day and state of the road", inner.line);
            }
            if let Some((_, kind)) = NO_EFFECT.iter().find(|it| it.0 == inner.name) {
                drops.add(kind, inner.line);
            }
        }
    }
}
