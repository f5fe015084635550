//! Ego under test, and its relation to the world's own ego.

use std::path::Path;

use super::error::EgoError;
use crate::ego::Process;
use crate::run_dir::{ChangedEgo, ProgramContent};
use crate::scene::drive::ControllerFactory;
use crate::sim::PlantKind;
use crate::world::{Change, Scenario, ScenarioKind};

/// Ego under test: its name in rows, its change of the world's own ego, and its world.
#[derive(Clone, Debug)]
pub struct EgoUnderTest {
    name: String,
    change: Change,
    scenario: Scenario,
}

impl EgoUnderTest {
    /// Creates the world's own ego.
    pub fn nominal(world: &Scenario) -> EgoUnderTest {
        EgoUnderTest {
            name: "nominal".to_owned(),
            change: Change::default(),
            scenario: world.clone(),
        }
    }

    /// Finds the egos of a name in a world.
    ///
    /// The name is `nominal`, a name under `reuse`, a RON file with a `Change`, or `all`
    /// of the world's egos.
    ///
    /// # Errors
    /// The name is unknown, or the ego does not fit the world.
    pub fn find(world: &Scenario, requested: &str) -> Result<Vec<EgoUnderTest>, EgoError> {
        let reused = |name: &str, change: &Change| {
            EgoUnderTest::changed(world, name, change, "mend the world's `reuse`")
        };
        let nominal = EgoUnderTest::nominal(world);
        // Reserved words come first, so that a command means the same in every world.
        if requested == "nominal" {
            return Ok(vec![nominal]);
        }
        if requested == "all" {
            let each = world.reuse.iter();
            let changed = each.map(|(name, change)| reused(name, change));
            return std::iter::once(Ok(nominal)).chain(changed).collect();
        }
        if let Some(change) = world.reuse.get(requested) {
            return Ok(vec![reused(requested, change)?]);
        }
        let path = Path::new(requested);
        // The ending tells a file from a mistyped name, which needs another help.
        if path.extension().is_some_and(|extension| extension == "ron") {
            let (change, scenario) = world.changed_by(path)?;
            // A change has no name of its own, so rows name the file.
            let name = requested.to_owned();
            return Ok(vec![EgoUnderTest {
                name,
                change,
                scenario,
            }]);
        }
        let known = ["nominal", "all"]
            .into_iter()
            .chain(world.reuse.keys().map(String::as_str));
        Err(EgoError::Unknown {
            requested: requested.to_owned(),
            known: known.map(str::to_owned).collect(),
        })
    }

    /// Creates an ego from your own controller, with its name in rows and files.
    ///
    /// # Errors
    /// The world is not driven.
    pub fn own(
        world: &Scenario,
        name: &str,
        factory: ControllerFactory,
    ) -> Result<EgoUnderTest, EgoError> {
        // A grid moves its ego by a rule of its own, without any controller.
        if let ScenarioKind::Grid(_) = world.kind() {
            return Err(EgoError::NotDriven {
                world: world.name.clone(),
                ego: name.to_owned(),
            });
        }
        Ok(EgoUnderTest {
            name: name.to_owned(),
            change: Change::default(),
            scenario: world.with_ego(name, factory),
        })
    }

    /// Creates an ego from a program, to whose start you consent by naming it.
    ///
    /// # Errors
    /// The world is not driven.
    pub fn program(world: &Scenario, command: &[String]) -> Result<EgoUnderTest, EgoError> {
        let change = EgoUnderTest::change_to(command);
        let help = "a program drives the ego of a driving world";
        // The command is its name until the program says hello.
        let ego = EgoUnderTest::changed(world, &command.join(" "), &change, help)?;
        Ok(EgoUnderTest {
            scenario: ego.scenario.allow_programs(true),
            ..ego
        })
    }

    /// Returns the ego under the name in its program's hello, which starts the program.
    ///
    /// Its name stays without a program, and if another ego of the world has that name.
    #[must_use]
    pub fn named_by_hello(self) -> EgoUnderTest {
        let world = &self.scenario;
        // Rows are compared by name, so two egos must not share one.
        let is_free = |name: &String| name != "nominal" && !world.reuse.contains_key(name);
        match world
            .program()
            .and_then(Process::hello_name)
            .filter(is_free)
        {
            Some(name) => EgoUnderTest { name, ..self },
            None => self,
        }
    }

    /// Creates the ego of a program if there is one, under its own name, and otherwise
    /// finds the egos of a name.
    ///
    /// # Errors
    /// Both are given, or the name is unknown.
    pub fn find_or_program(
        world: &Scenario,
        requested: &str,
        program: &[String],
    ) -> Result<Vec<EgoUnderTest>, EgoError> {
        match (program.is_empty(), requested) {
            (true, _) => EgoUnderTest::find(world, requested),
            // Only the default may give way to a program, since two named egos
            // contradict.
            (false, "nominal") => Ok(vec![
                EgoUnderTest::program(world, program)?.named_by_hello(),
            ]),
            (false, _) => Err(EgoError::NamedTwice),
        }
    }

    /// Returns the change that makes a program the ego.
    pub fn change_to(command: &[String]) -> Change {
        Change {
            controller: Some(Process::new(command).into()),
            ..Change::default()
        }
    }

    /// Creates an ego by a change of the world's own, under a name.
    ///
    /// # Errors
    ///
    /// Returns an error with `help` if the change does not fit the world.
    pub fn changed(
        world: &Scenario,
        name: &str,
        change: &Change,
        help: &'static str,
    ) -> Result<EgoUnderTest, EgoError> {
        let scenario = world.with(change);
        Ok(EgoUnderTest {
            name: name.to_owned(),
            change: change.clone(),
            scenario: scenario.map_err(|error| EgoError::Misfit { error, help })?,
        })
    }

    /// Creates the ego of a run's training: the world's own, or the changed ego of the
    /// manifest.
    pub fn of_training(
        world: &Scenario,
        ego: Option<&ChangedEgo>,
    ) -> Result<EgoUnderTest, EgoError> {
        match ego {
            None => Ok(EgoUnderTest::nominal(world)),
            Some(ego) => {
                EgoUnderTest::changed(world, &ego.name, &ego.change, "the run's world has changed")
            }
        }
    }

    /// Returns whether the ego is the world's own.
    pub fn is_nominal(&self) -> bool {
        // An own controller leaves the change empty, although it replaces the ego.
        !self.is_own() && self.change == Change::default()
    }

    /// Returns whether the ego is your own controller, of which files contain a name
    /// only.
    pub fn is_own(&self) -> bool {
        self.scenario.own_ego().is_some()
    }

    /// Returns the name in rows.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the difference from the world's own ego.
    pub fn change(&self) -> &Change {
        &self.change
    }

    /// Returns the world with the ego.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Returns the ego in a variant of its world.
    pub fn in_world(&self, scenario: Scenario) -> EgoUnderTest {
        EgoUnderTest {
            scenario,
            ..self.clone()
        }
    }

    /// Returns the content of its program. `None`: it is none.
    pub fn program_content(&self) -> Option<ProgramContent> {
        self.scenario.program().map(ProgramContent::of)
    }

    /// Returns the ego as in manifests. `None`: it is the world's own.
    pub fn as_changed(&self) -> Option<ChangedEgo> {
        (self.change != Change::default()).then(|| ChangedEgo {
            name: self.name.clone(),
            change: self.change.clone(),
        })
    }
}

/// Returns a driving world on another plant.
///
/// # Errors
/// The world is not driven.
pub fn on_plant(world: &Scenario, plant: PlantKind) -> Result<Scenario, EgoError> {
    match world.kind() {
        ScenarioKind::Drive(_) => Ok(world.on(plant)),
        ScenarioKind::Grid(_) => Err(EgoError::NoPlant {
            world: world.name.clone(),
        }),
    }
}

/// Requires consent for the programs among the structures of a family of a training.
///
/// # Errors
/// A program is not allowed. No program was started.
pub fn consent_to_family(world: &Scenario) -> Result<(), EgoError> {
    // Structures of a family without a training are never started.
    let family = world.family().filter(|_| !world.against.is_nominal());
    let mut programs = family.into_iter().flat_map(|family| family.programs());
    // One program without consent is enough for a refusal, before any is started.
    match programs.next().filter(|_| !world.may_start_programs()) {
        Some((name, program)) => Err(EgoError::NotAllowed {
            who: format!("the structure `{name}`"),
            command: program.command.clone(),
        }),
        None => Ok(()),
    }
}

/// Requires consent before the start of a program that a file names as an ego.
///
/// The egos are that of `world`, which is played for its trivial starts, and `egos`.
///
/// # Errors
/// A program is not allowed. No program was started.
pub fn consent(world: &Scenario, egos: &[EgoUnderTest]) -> Result<(), EgoError> {
    let own = EgoUnderTest::nominal(world);
    consent_to(std::slice::from_ref(&own))?;
    consent_to(egos)
}

/// Requires consent where only `egos` are played.
///
/// # Errors
/// A program is not allowed. No program was started.
pub fn consent_to(egos: &[EgoUnderTest]) -> Result<(), EgoError> {
    let mut programs = egos
        .iter()
        .filter_map(|ego| Some((ego.name(), ego.scenario().program()?)));
    match programs.find(|(_, program)| !program.is_allowed()) {
        Some((name, program)) => Err(EgoError::NotAllowed {
            who: format!("the ego `{name}`"),
            command: program.command.clone(),
        }),
        None => Ok(()),
    }
}
