//! Crashes as files of other tools: OpenSCENARIO XML 1.3 and OpenDRIVE 1.7.
//!
//! A counterexample becomes three files. The first is the road. The second is a
//! replay, in which all agents follow their recorded paths up to the contact, and on
//! after it in worlds that play that motion.
//! The third is a scenario for an ego of your own, in which the other agents
//! follow their paths to the horizon. `docs/guide/export.md` describes their content,
//! their use and their limits.
//!
//! Equal crashes give equal bytes. Lengths are in metres and angles in radians.
//! Positions are those of the trace, bit for bit, except for the offset from
//! the front bumper to the reference point of OpenSCENARIO.
//!
//! Architecture Invariant: this module plays no episode and writes nothing to
//! disk. It converts passages that the caller recorded.

mod elevation;
mod entity;
mod lights;
mod origin;
mod path;
mod road;
mod storyboard;
mod stretch;

use std::io;

use crate::scene::Passage;
use crate::scene::drive::DriveSpec;
use crate::testbench::{Episode, FilmAfterContact};
use crate::world::DriveScenario;
use crate::xml::{XmlElement, decimal};
use elevation::Elevation;
use entity::PerformanceLimits;
pub(crate) use entity::vehicle_category;
use origin::{AUTHOR, DATE};
use path::Vertex;
use storyboard::{MotionSource, StoryboardAgent};
use stretch::Stretch;

/// Recorded counterexample to export.
#[derive(Clone, Copy)]
pub(crate) struct Crash<'a> {
    /// Name of the files, without an extension.
    pub name: &'a str,
    /// World of the crash, with the ego that crashed.
    pub scenario: DriveScenario<'a>,
    /// Name of the ego: `nominal`, or the name of a change.
    pub ego: &'a str,
    /// Episode of the crash.
    pub episode: &'a Episode,
    /// Passage up to the contact, or to the end of the episode.
    pub recorded: &'a Passage,
    /// Motion after the contact, if there is one.
    pub after: Option<&'a FilmAfterContact>,
    /// Passage to the horizon, simulated without contact ([`ghostly`][ghostly]).
    ///
    /// [ghostly]: crate::scene::drive::DriveWorld::ghostly
    pub(crate) ghostly: &'a Passage,
}

/// Texts of the three files of a crash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenX {
    /// `NAME.xodr`: the road, to which both scenarios refer.
    pub road: String,
    /// `NAME.xosc`: the replay of the crash.
    pub replay: String,
    /// `NAME.external.xosc`: the other agents, for an ego of your own.
    pub external: String,
}

/// Reason why a crash has no OpenSCENARIO form.
#[derive(Debug, thiserror::Error)]
pub enum OpenXError {
    /// The passage has a single instant, and a trajectory takes two.
    #[error("it begins in contact, so nothing moves in it")]
    NoMotion,
    /// The weather changes, which the files cannot state.
    #[error("the weather `{name}` changes during the episode")]
    ChangingWeather {
        /// Name of the weather.
        name: String,
    },
    /// The world has banked roads or wind, which the files do not state.
    #[error("the world has {what}")]
    BanksOrWind {
        /// `banks` or `wind`.
        what: &'static str,
    },
    /// The XML writer failed, which is not expected in memory.
    #[error("writing XML failed: {0}")]
    Xml(#[from] io::Error),
}

impl Crash<'_> {
    /// Returns the three files of the crash.
    ///
    /// # Errors
    ///
    /// Returns an error for a contact before any agent moved, for weather that an
    /// ado changes, and for wind.
    pub fn files(&self) -> Result<OpenX, OpenXError> {
        // A file without them would play another crash, so it is refused rather than
        // simplified.
        if let Some(weather) = &self.scenario.spec().weather {
            let name = weather.name.clone();
            return Err(OpenXError::ChangingWeather { name });
        }
        let spec = self.scenario.spec();
        let has_banks =
            (0..spec.roads.len() + 1).any(|road| !spec.profile_of(road).banks.is_empty());
        let unwritten = [("banks", has_banks), ("wind", spec.wind.is_some())];
        if let Some((what, _)) = unwritten.into_iter().find(|(_, is_there)| *is_there) {
            return Err(OpenXError::BanksOrWind { what });
        }
        let world = self.scenario.world();
        // Both passages fit on the written road, since both scenarios refer to
        // it.
        let stretch =
            |road| Stretch::around(world, road, &[self.recorded, self.ghostly], self.after);
        let road = road::document(self.name, world, stretch);
        Ok(OpenX {
            road: road.document()?,
            replay: self.replay()?.document()?,
            external: self.external()?.document()?,
        })
    }

    fn replay(&self) -> Result<XmlElement, OpenXError> {
        let title = format!("{}: the crash as it was recorded", self.name);
        // The ego follows its record, too, so that a player shows the crash whatever its
        // own models do.
        let drivers = vec![MotionSource::Trajectory; self.scenario.spec().agents.len()];
        let mut properties = self.properties();
        properties.extend(self.after.map(|after| {
            let events = after.motion.sentences().join("; ");
            ("after_contact".to_owned(), events)
        }));
        let header = header(&title, properties);
        self.scenario_of(self.recorded, self.after, &drivers, header)
    }

    fn external(&self) -> Result<XmlElement, OpenXError> {
        let title = format!(
            "{}: the others of the crash, for an ego of yours",
            self.name
        );
        let agents = self.scenario.spec().agents.iter();
        let drivers: Vec<MotionSource> = agents.map(storyboard::driver_beside_an_own_ego).collect();
        let mut properties = self.properties();
        properties.push((
            "after_contact".to_owned(),
            "simulated again without contact: the others go on to the horizon as if the recorded \
             ego were a ghost; they do not answer to yours"
                .to_owned(),
        ));
        let header = header(&title, properties);
        self.scenario_of(self.ghostly, None, &drivers, header)
    }

    /// Returns the scenario of a passage, with a driver for every agent.
    fn scenario_of(
        &self,
        passage: &Passage,
        after: Option<&FilmAfterContact>,
        drivers: &[MotionSource],
        header: XmlElement,
    ) -> Result<XmlElement, OpenXError> {
        let spec = self.scenario.spec();
        let mut ways = ways(spec, passage, after)?;
        if let Some(elevation) = Elevation::of(self.scenario.world()) {
            for (way, agent) in ways.iter_mut().zip(&spec.agents) {
                elevation.lift(agent.road, way);
            }
        }
        let parts: Vec<StoryboardAgent> = (spec.agents.iter().zip(&ways).zip(drivers).enumerate())
            .map(|(number, ((agent, way), &driver))| StoryboardAgent {
                agent,
                way,
                // Speeds are written once, for the first instant. Later speeds
                // follow from the times of the vertices.
                speed_mps: passage.motion.at(0)[number].state.speed_mps,
                driver,
            })
            .collect();
        let friction = spec.road.friction();
        let limits = PerformanceLimits {
            friction,
            fastest_mps: fastest_mps(passage),
        };
        let entities = parts.iter().map(|part| {
            let entity = entity::entity(part.agent, limits);
            match part.driver {
                MotionSource::Trajectory => entity,
                MotionSource::External => entity.child(storyboard::external_controller(part.agent)),
            }
        });
        let file = XmlElement::new("LogicFile").text("filepath", format!("{}.xodr", self.name));
        let mut network = XmlElement::new("RoadNetwork").child(file);
        if !spec.lights.is_empty() {
            network = network.child(lights::controllers(spec, passage));
        }
        let ends = ways.iter().flat_map(|way| way.last());
        // The scenario runs to the end of the longest trajectory, so none is
        // cut.
        let stop_s = ends.fold(0.0, |last: f64, vertex| last.max(vertex.time_s));
        Ok(XmlElement::new("OpenSCENARIO")
            .child(header)
            .child(XmlElement::new("CatalogLocations"))
            .child(network)
            .child(XmlElement::new("Entities").children(entities))
            .child(storyboard::storyboard(&parts, friction, stop_s)))
    }

    /// Properties for human readers. Other tools ignore them.
    fn properties(&self) -> Vec<(String, String)> {
        let (scenario, spec) = (self.scenario, self.scenario.spec());
        let contact = match &self.episode.contact {
            Some(touch) => format!(
                "{} and {} at {} s, closing at {} m/s",
                touch.between.0,
                touch.between.1,
                decimal(touch.time_s),
                decimal(touch.closing_speed_mps),
            ),
            None => "none".to_owned(),
        };
        let mut properties: Vec<(String, String)> = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("world", scenario.name().to_owned()),
            ("ego", self.ego.to_owned()),
            ("ego_spec", scenario.ego_spec().to_string()),
            ("robustness", decimal(self.episode.robustness)),
            ("contact", contact),
            ("friction", decimal(spec.road.friction())),
            ("sample_s", decimal(spec.clock.sample_s)),
            ("replay", format!("brakecheck replay {}.ron", self.name)),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec();
        let rules = scenario.rules().iter().enumerate();
        properties.extend(rules.map(|(i, rule)| {
            let text = format!("{}: {}", rule.name, rule.formula);
            (format!("rule.{}", i + 1), text)
        }));
        let constants = scenario.names().constants.iter();
        properties
            .extend(constants.map(|(name, value)| (format!("constant.{name}"), decimal(*value))));
        properties
    }
}

/// Trajectories of all agents in a passage.
///
/// # Errors
///
/// Returns an error for a trajectory of fewer than two vertices.
fn ways(
    spec: &DriveSpec,
    passage: &Passage,
    after: Option<&FilmAfterContact>,
) -> Result<Vec<Vec<Vertex>>, OpenXError> {
    let agents = spec.agents.iter().enumerate();
    let mut ways: Vec<Vec<Vertex>> = agents
        .map(|(number, agent)| {
            path::vertices(&passage.motion, number, &agent.body, spec.clock.sample_s)
        })
        .collect();
    if let Some(after) = after {
        for (number, (way, agent)) in ways.iter_mut().zip(&spec.agents).enumerate() {
            path::go_on(way, after, number, &agent.body);
        }
    }
    // Agents share their samples, so one short trajectory means that all are
    // short.
    if ways.iter().all(|way| way.len() >= 2) {
        Ok(ways)
    } else {
        Err(OpenXError::NoMotion)
    }
}

fn fastest_mps(passage: &Passage) -> f64 {
    let motion = &passage.motion;
    let bodies = (0..motion.len()).flat_map(|sample| motion.at(sample));
    bodies.fold(0.0, |most: f64, body| most.max(body.state.speed_mps))
}

fn header(title: &str, properties: Vec<(String, String)>) -> XmlElement {
    let properties = properties.into_iter().map(|(name, value)| {
        // The prefix keeps the names apart from those of other tools.
        let name = format!("{AUTHOR}.{name}");
        XmlElement::new("Property")
            .text("name", name)
            .text("value", value)
    });
    XmlElement::new("FileHeader")
        .text("revMajor", "1")
        .text("revMinor", "3")
        .text("date", DATE)
        .text("author", AUTHOR)
        .text("description", title)
        .child(XmlElement::new("Properties").children(properties))
}
