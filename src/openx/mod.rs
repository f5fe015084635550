//! Crashes for other tools: OpenSCENARIO XML 1.3 and OpenDRIVE 1.7.
//!
//! A counterexample is three files: the road; a replay, in which everybody
//! follows the recorded way up to the contact; and a scenario for an ego of
//! your own, in which the others follow theirs to the horizon. What they hold,
//! how to play them, and what they are not is in `docs/export.md`.
//!
//! Equal crashes give equal bytes. Lengths are in metres, angles in radians;
//! positions are those of the trace, bit for bit but for the step from the
//! front bumper to the point that OpenSCENARIO moves.
//!
//! Architecture Invariant: nothing is played and nothing is written to disk
//! here; text follows from what somebody else played.

mod entity;
pub mod import;
mod lights;
mod origin;
mod path;
mod road;
mod storyboard;
mod stretch;
mod xml;

use std::io;

use crate::scene::drive::DriveWorld;
use crate::scene::{Passage, World};
use crate::testbench::Episode;
use crate::world::Scenario;
use entity::Limits;
use origin::{AUTHOR, DATE};
use path::Vertex;
use storyboard::{Driver, Part};
use stretch::Stretch;
use xml::{Element, number};

/// A counterexample, played again.
#[derive(Clone, Copy, Debug)]
pub struct Crash<'a> {
    /// What its files are called, without an ending.
    pub name: &'a str,
    /// The world in which it happened, its ego as it was.
    pub scenario: &'a Scenario,
    /// What the ego is called: `nominal`, or the name of a change.
    pub ego: &'a str,
    /// The episode.
    pub episode: &'a Episode,
    /// What happened up to the contact, or to the episode's end.
    pub recorded: &'a Passage,
    /// What would have happened to the horizon without contact
    /// ([`DriveWorld::ghostly`]).
    pub ghostly: &'a Passage,
}

/// The three files of a crash, as texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenX {
    /// `NAME.xodr`: the road, which both scenarios name.
    pub road: String,
    /// `NAME.xosc`: the crash again.
    pub replay: String,
    /// `NAME.external.xosc`: the others, for an ego of your own.
    pub external: String,
}

/// Why a crash cannot be written as OpenSCENARIO.
#[derive(Debug, thiserror::Error)]
pub enum OpenXError {
    /// It happened on a map of cells.
    #[error("it happens in the grid world `{world}`, and OpenSCENARIO has roads, not cells")]
    Grid {
        /// Name of the world.
        world: String,
    },
    /// A trajectory takes two instants.
    #[error("it begins in contact, so nobody moves in it")]
    NobodyMoves,
    /// The text could not be made; not expected.
    #[error("writing XML failed: {0}")]
    Xml(#[from] io::Error),
}

impl Crash<'_> {
    /// Its three files.
    ///
    /// # Errors
    /// It happened in a grid world, or before anybody moved.
    pub fn files(&self) -> Result<OpenX, OpenXError> {
        let World::Drive(world) = self.scenario.world() else {
            let world = self.scenario.name().to_owned();
            return Err(OpenXError::Grid { world });
        };
        let stretch = |road| Stretch::around(world, road, &[self.recorded, self.ghostly]);
        let road = road::document(self.name, world, stretch);
        Ok(OpenX {
            road: road.document()?,
            replay: self.replay(world)?.document()?,
            external: self.external(world)?.document()?,
        })
    }

    fn replay(&self, world: &DriveWorld) -> Result<Element, OpenXError> {
        let title = format!("{}: the crash as it was recorded", self.name);
        let drivers = vec![Driver::Trajectory; world.spec().agents.len()];
        let header = header(&title, self.properties(world));
        self.scenario_of(world, self.recorded, &drivers, header)
    }

    fn external(&self, world: &DriveWorld) -> Result<Element, OpenXError> {
        let title = format!(
            "{}: the others of the crash, for an ego of yours",
            self.name
        );
        let agents = world.spec().agents.iter();
        let drivers: Vec<Driver> = agents.map(storyboard::driver_beside_an_own_ego).collect();
        let mut properties = self.properties(world);
        properties.push((
            "after_contact".to_owned(),
            "simulated again without contact: the others go on to the horizon as if the recorded \
             ego were a ghost; they do not answer to yours"
                .to_owned(),
        ));
        let header = header(&title, properties);
        self.scenario_of(world, self.ghostly, &drivers, header)
    }

    /// A scenario of what happened in a passage.
    fn scenario_of(
        &self,
        world: &DriveWorld,
        passage: &Passage,
        drivers: &[Driver],
        header: Element,
    ) -> Result<Element, OpenXError> {
        let spec = world.spec();
        let ways = ways(world, passage)?;
        let parts: Vec<Part> = (spec.agents.iter().zip(&ways).zip(drivers).enumerate())
            .map(|(number, ((agent, way), &driver))| Part {
                agent,
                way,
                speed_mps: passage.motion.at(0)[number].state.speed_mps,
                driver,
            })
            .collect();
        let friction = spec.road.friction();
        let limits = Limits {
            friction,
            fastest_mps: fastest_mps(passage),
        };
        let entities = parts.iter().map(|part| {
            let entity = entity::entity(part.agent, limits);
            match part.driver {
                Driver::Trajectory => entity,
                Driver::External => entity.child(storyboard::external_controller(part.agent)),
            }
        });
        let file = Element::new("LogicFile").text("filepath", format!("{}.xodr", self.name));
        let mut network = Element::new("RoadNetwork").child(file);
        if !spec.lights.is_empty() {
            network = network.child(lights::controllers(spec, passage));
        }
        let ends = ways.iter().flat_map(|way| way.last());
        let stop_s = ends.fold(0.0, |last: f64, vertex| last.max(vertex.time_s));
        Ok(Element::new("OpenSCENARIO")
            .child(header)
            .child(Element::new("CatalogLocations"))
            .child(network)
            .child(Element::new("Entities").children(entities))
            .child(storyboard::storyboard(&parts, friction, stop_s)))
    }

    /// What other tools do not read, but people do.
    fn properties(&self, world: &DriveWorld) -> Vec<(String, String)> {
        let (scenario, spec) = (self.scenario, world.spec());
        let contact = match &self.episode.contact {
            Some(touch) => format!(
                "{} and {} at {} s, closing at {} m/s",
                touch.between.0,
                touch.between.1,
                number(touch.time_s),
                number(touch.closing_speed_mps),
            ),
            None => "none".to_owned(),
        };
        let mut properties: Vec<(String, String)> = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("world", scenario.name().to_owned()),
            ("ego", self.ego.to_owned()),
            ("ego_spec", scenario.ego_spec().to_string()),
            ("robustness", number(self.episode.robustness)),
            ("contact", contact),
            ("friction", number(spec.road.friction())),
            ("sample_s", number(spec.clock.sample_s)),
            ("replay", format!("brakecheck replay {}.ron", self.name)),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec();
        let rules = scenario.rules().iter().enumerate();
        properties.extend(rules.map(|(i, rule)| {
            let told = format!("{}: {}", rule.name, rule.formula);
            (format!("rule.{}", i + 1), told)
        }));
        let constants = scenario.names().constants.iter();
        properties
            .extend(constants.map(|(name, value)| (format!("constant.{name}"), number(*value))));
        properties
    }
}

/// Everybody's way in a passage.
fn ways(world: &DriveWorld, passage: &Passage) -> Result<Vec<Vec<Vertex>>, OpenXError> {
    let spec = world.spec();
    let agents = spec.agents.iter().enumerate();
    let ways = agents.map(|(number, agent)| {
        path::vertices(&passage.motion, number, &agent.body, spec.clock.sample_s)
    });
    let ways: Vec<Vec<Vertex>> = ways.collect();
    match ways.iter().all(|way| 2 <= way.len()) {
        true => Ok(ways),
        false => Err(OpenXError::NobodyMoves),
    }
}

fn fastest_mps(passage: &Passage) -> f64 {
    let motion = &passage.motion;
    let bodies = (0..motion.len()).flat_map(|sample| motion.at(sample));
    bodies.fold(0.0, |most: f64, body| most.max(body.state.speed_mps))
}

fn header(title: &str, properties: Vec<(String, String)>) -> Element {
    let properties = properties.into_iter().map(|(name, value)| {
        let name = format!("{AUTHOR}.{name}");
        Element::new("Property")
            .text("name", name)
            .text("value", value)
    });
    Element::new("FileHeader")
        .text("revMajor", "1")
        .text("revMinor", "3")
        .text("date", DATE)
        .text("author", AUTHOR)
        .text("description", title)
        .child(Element::new("Properties").children(properties))
}
