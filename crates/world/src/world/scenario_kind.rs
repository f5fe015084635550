//! Scenarios by the kind of their world: roads or cells.

use std::ops::Deref;

use super::Scenario;
use crate::scene::drive::{DriveSpec, DriveWorld, EgoVariant};
use crate::scene::grid::GridWorld;
use crate::scene::{Scene, Start, World};
use crate::testbench::{Episode, Testbench};

/// Scenario by the kind of its world.
#[derive(Clone, Copy)]
pub enum ScenarioKind<'a> {
    /// Cars on a road.
    Drive(DriveScenario<'a>),
    /// Cells on a map.
    Grid(GridScenario<'a>),
}

/// Scenario with a driving world, for code that requires roads.
#[derive(Clone, Copy)]
pub struct DriveScenario<'a> {
    scenario: &'a Scenario,
    world: &'a DriveWorld,
}

/// Scenario with a grid world, for code that requires cells.
#[derive(Clone, Copy)]
pub struct GridScenario<'a> {
    scenario: &'a Scenario,
    world: &'a GridWorld,
}

/// Error of a world that is not a grid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{world}` is no grid world")]
pub struct NotAGrid {
    /// Name of the world.
    pub world: String,
}

impl Scenario {
    /// Returns the scenario by the kind of its world.
    #[doc(hidden)]
    pub fn kind(&self) -> ScenarioKind<'_> {
        let scenario = self;
        match &self.world {
            World::Drive(world) => ScenarioKind::Drive(DriveScenario { scenario, world }),
            World::Grid(world) => ScenarioKind::Grid(GridScenario { scenario, world }),
        }
    }

    /// Returns the scenario if its world drives.
    #[doc(hidden)]
    pub fn drive(&self) -> Option<DriveScenario<'_>> {
        match self.kind() {
            ScenarioKind::Drive(scenario) => Some(scenario),
            ScenarioKind::Grid(_) => None,
        }
    }

    /// Returns the scenario if its world is a grid.
    #[doc(hidden)]
    pub fn grid(&self) -> Option<GridScenario<'_>> {
        match self.kind() {
            ScenarioKind::Drive(_) => None,
            ScenarioKind::Grid(scenario) => Some(scenario),
        }
    }

    /// Returns the scenario if its world is a grid.
    ///
    /// # Errors
    ///
    /// Returns an error for a driving world.
    #[doc(hidden)]
    pub fn require_grid(&self) -> Result<GridScenario<'_>, NotAGrid> {
        self.grid().ok_or_else(|| NotAGrid {
            world: self.name.clone(),
        })
    }

    /// Returns the scenario in the environment that a start draws.
    ///
    /// Its spec then has the friction and the sensors of that start. A grid, and
    /// a world without ranges in its environment, stays as it is.
    pub fn at_start(&self, start: &Start) -> Scenario {
        match &self.world {
            World::Drive(world) => Scenario {
                world: World::Drive(world.at_start(start)),
                ..self.clone()
            },
            World::Grid(_) => self.clone(),
        }
    }

    /// Returns the scenario in the environment and on the road of an episode.
    ///
    /// As [`Scenario::at_start`], with the pieces of road that an ado laid.
    pub fn of_episode(&self, episode: &Episode) -> Scenario {
        let begun = self.at_start(&episode.start);
        match &begun.world {
            World::Drive(world) => Scenario {
                world: World::Drive(world.along(&episode.trace)),
                ..begun
            },
            World::Grid(_) => begun,
        }
    }

    /// Puts a member of the family on a bench. Only driving worlds have a family.
    pub fn place_member(&self, variant: &EgoVariant, bench: &mut Testbench) {
        if let Some(driving) = self.drive() {
            bench.replace_scene(driving.scene_of(variant));
        }
    }
}

impl<'a> DriveScenario<'a> {
    /// Returns a scenario with its world, which was just assembled.
    pub(super) fn new(scenario: &'a Scenario, world: &'a DriveWorld) -> DriveScenario<'a> {
        DriveScenario { scenario, world }
    }

    /// Returns the driving world.
    pub fn world(self) -> &'a DriveWorld {
        self.world
    }

    /// Returns the spec of the scene.
    pub fn spec(self) -> &'a DriveSpec {
        self.world.spec()
    }

    /// Returns the scene of a member of the family.
    pub fn scene_of(self, variant: &EgoVariant) -> Box<dyn Scene> {
        Box::new(self.world_of(variant).scene())
    }

    /// Returns the scenario with a member of the family as its ego.
    pub fn with_member(self, variant: &EgoVariant) -> Scenario {
        Scenario {
            world: World::Drive(self.world_of(variant)),
            ..self.scenario.clone()
        }
    }

    fn world_of(self, variant: &EgoVariant) -> DriveWorld {
        // Consent and fresh beginnings belong to this scenario, and members have neither.
        let mut variant = variant.clone();
        let controller = &mut variant.controller.controller;
        controller.allow_programs(self.programs_allowed);
        if self.fresh_egos {
            controller.set_fresh();
        }
        self.world.with_variant(&variant)
    }

    /// Returns the columns of the ego's x, y and speed in traces.
    pub fn ego_columns(self) -> [usize; 3] {
        let (spec, schema) = (self.spec(), self.world.schema());
        let ego = spec.egos().next().map(|ego| spec.agents[ego].name.as_str());
        let name = ego.unwrap_or_default();
        // Invariant: every trace holds these three columns of every road user.
        ["x", "y", "speed"].map(|field| schema.position(&format!("{name}.{field}")).unwrap_or(0))
    }
}

impl<'a> GridScenario<'a> {
    /// Returns the grid world.
    pub fn world(self) -> &'a GridWorld {
        self.world
    }
}

impl Deref for DriveScenario<'_> {
    type Target = Scenario;

    fn deref(&self) -> &Scenario {
        self.scenario
    }
}

impl Deref for GridScenario<'_> {
    type Target = Scenario;

    fn deref(&self) -> &Scenario {
        self.scenario
    }
}
