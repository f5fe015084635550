//! From a RON world file to a checked [`Scenario`].
//!
//! Architecture Invariant: after a `Scenario` is loaded no user mistake is
//! possible in it; every mistake before has a place, a reason and, where known,
//! a cure ([`ScenarioError`]). All spans, helps and limits live on this floor.
//!
//! ```
//! use brakecheck::scenario::Scenario;
//!
//! let broken = Scenario::parse("mine.ron", "Scenario(name: \"mine\", clok: ())");
//! let error = broken.unwrap_err();
//! assert!(error.to_string().starts_with("mine.ron:1:"));
//! ```

mod build;
mod cast;
mod changed;
mod check;
mod error;
mod family;
mod file;
mod grid;
mod kinship;
mod language;
mod locate;
mod quantity;
mod read;
mod repeats;
mod runs;
mod starts;
mod trained;
mod trial;
mod vacuous;

use std::path::Path as FilePath;
use std::sync::Arc;

use indexmap::IndexMap;

pub use error::{Problem, ScenarioError};
pub use family::{Against, Family, Member, MisfitMember, NoMember};
pub use file::{Change, GridChange, Patch};
pub use locate::Path;
pub use quantity::{Quantity, Varied};
pub use repeats::Repeats;
pub use runs::{NamedRun, RunRefused, RunSource};

use crate::ego::{Actuated, Command, Controller, ControllerSpec, Process, Recorded};
use crate::rl::{ConfigError, LearnerConfig, Spaces};
use crate::rulebook::{Rule, Rulebook};
use crate::scene::drive::{ControllerFactory, Drive, DriveSpec, DriveWorld, EgoController, Tuning};
use crate::scene::grid::GridWorld;
use crate::scene::{Axis, Dynamics, Held, Scene, Start, World};
use crate::sim::PlantKind;
use crate::stl::{Formula, Names};
use crate::testbench::Testbench;
use crate::trace::Signal;

/// A world, checked: everything needed to build its test bench.
#[derive(Clone)]
pub struct Scenario {
    /// Name of the world; part of every start's key.
    pub name: String,
    /// The question it asks.
    pub question: String,
    /// Where it comes from.
    pub source: String,
    /// The file's text, verbatim but for trained ados: what their run
    /// directories held is written out.
    pub text: String,
    /// ψ_ego.
    pub ego_spec: Formula,
    /// The ados' rules, in the file's order.
    pub rules: Vec<RuleSpec>,
    /// Constants and named formulas.
    pub names: Names,
    /// How to learn.
    pub learner: LearnerConfig,
    /// Other ways to learn, by name.
    pub learners: IndexMap<String, LearnerConfig>,
    /// Which of them is `learner`; `None`: the world's own.
    pub learning: Option<String>,
    /// What an ado is trained against.
    pub against: Against,
    /// What the same trained ado is reused on.
    pub reuse: IndexMap<String, Change>,
    /// How often each start is played, for egos that do not answer twice alike.
    pub repeats: Repeats,
    /// What looked odd but is allowed.
    pub warnings: Vec<Problem>,
    family: Option<Arc<Family>>,
    world: World,
    rulebook: Arc<Rulebook>,
    /// Whether programs that files name may be started.
    programs_allowed: bool,
}

impl std::fmt::Debug for Scenario {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut shown = f.debug_struct("Scenario");
        shown.field("name", &self.name).finish_non_exhaustive()
    }
}

/// A rule as written.
#[derive(Clone, Debug)]
pub struct RuleSpec {
    /// Its name.
    pub name: String,
    /// The ado that must keep it.
    pub ado: String,
    /// 0 is the most important.
    pub priority: usize,
    /// Kept when its robustness is above 0.
    pub formula: Formula,
    /// Where its formula stands in the file.
    place: Path,
}

/// A world file could not be read or used.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("cannot read `{file}`: {source}")]
    Io {
        /// Its path.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not a world.
    #[error(transparent)]
    Scenario(Box<ScenarioError>),
}

impl Scenario {
    /// Reads and checks a world file; `runs` finds the runs that it names.
    ///
    /// # Errors
    /// The file cannot be read, or it is not a world.
    pub fn load_with(path: &FilePath, runs: &dyn RunSource) -> Result<Scenario, LoadError> {
        let file = path.display().to_string();
        let text = read::text(&file, path)?;
        Scenario::parse_with(&file, &text, runs)
            .map_err(|error| LoadError::Scenario(Box::new(error)))
    }

    /// Checks the text of a world file; `file` names it in errors.
    ///
    /// Nothing is read: a text that names a run directory is refused.
    ///
    /// # Errors
    /// What is wrong, where, and how to cure it.
    pub fn parse(file: &str, text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::parse_with(file, text, &runs::Nowhere)
    }

    /// The same of a text whose runs `runs` finds.
    ///
    /// # Errors
    /// What is wrong, where, and how to cure it.
    pub fn parse_with(
        file: &str,
        text: &str,
        runs: &dyn RunSource,
    ) -> Result<Scenario, ScenarioError> {
        let fail = |problems| ScenarioError {
            file: file.to_owned(),
            text: text.to_owned(),
            problems,
        };
        let one = |problem| fail(vec![problem]);
        match read::kind(text).map_err(one)? {
            read::Kind::Scenario => {
                let parsed = read::parse(text).map_err(one)?;
                build::build(runs::Origin { file, runs }, text, parsed).map_err(fail)
            }
            read::Kind::Grid => {
                let parsed = read::parse(text).map_err(one)?;
                grid::build(text, parsed).map_err(fail)
            }
        }
    }

    /// What the scene of a driving world is made of.
    pub fn drive(&self) -> Option<&DriveSpec> {
        match &self.world {
            World::Drive(world) => Some(world.spec()),
            World::Grid(_) => None,
        }
    }

    /// The world, if it is a grid.
    pub fn grid(&self) -> Option<&GridWorld> {
        match &self.world {
            World::Drive(_) => None,
            World::Grid(world) => Some(world),
        }
    }

    /// The assembled world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// X_init.
    pub fn axes(&self) -> Vec<Axis> {
        self.world.axes()
    }

    /// All starts of a finite world, each once.
    pub fn starts(&self) -> Option<Vec<Start>> {
        self.world.starts()
    }

    /// A joint action in words.
    pub fn action_label(&self, action: usize) -> String {
        self.world.action_label(action)
    }

    /// The bound rulebook.
    pub fn rulebook(&self) -> &Rulebook {
        &self.rulebook
    }

    /// A fresh test bench, one per worker.
    pub fn bench(&self) -> Testbench {
        Testbench::new(self.world.scene(), Arc::clone(&self.rulebook))
    }

    /// What moves the world.
    pub fn plant(&self) -> Dynamics {
        self.world.dynamics()
    }

    /// The same world with another of its ways to learn; `None`: no such name.
    pub fn learning_by(&self, name: &str) -> Option<Scenario> {
        Some(Scenario {
            learner: self.learners.get(name)?.clone(),
            learning: Some(name.to_owned()),
            ..self.clone()
        })
    }

    /// The same world, to learn for so many decisions.
    ///
    /// # Errors
    /// There are none, or more than a learner takes.
    pub fn training_for(&self, decisions: u64) -> Result<Scenario, ConfigError> {
        Ok(Scenario {
            learner: self.learner.clone().with_decisions(decisions)?,
            ..self.clone()
        })
    }

    /// The family of egos under `train_against`, if the world has one.
    pub fn family(&self) -> Option<&Family> {
        self.family.as_deref()
    }

    /// The same world, to train against its family as that says.
    ///
    /// `None`: it has no family.
    pub fn training_against(&self, against: Against) -> Option<Scenario> {
        let learner = match (against, self.family()) {
            (Against::Nominal, _) => self.learner.clone(),
            (Against::Wide, family) => family?.wide.clone(),
            (Against::Conditional, family) => family?.conditional.clone(),
        };
        Some(Scenario {
            learner,
            against,
            ..self.clone()
        })
    }

    /// Shapes of what an ado sees, with what a conditional one is told.
    pub fn spaces(&self) -> Spaces {
        let mut spaces = self.world.spaces().clone();
        if let (Against::Conditional, Some(family)) = (self.against, self.family()) {
            spaces.observation += family.told_width();
        }
        spaces
    }

    /// The scene of a member of the family; `None`: this world is not driven.
    pub fn scene_of(&self, tuning: &Tuning) -> Option<Box<dyn Scene>> {
        match &self.world {
            World::Drive(world) => {
                let mut tuning = tuning.clone();
                tuning
                    .controller
                    .controller
                    .allow_programs(self.programs_allowed);
                Some(Box::new(world.tuned(&tuning).scene()))
            }
            World::Grid(_) => None,
        }
    }

    /// Programs that playing this world starts: its ego, if it is one.
    pub fn program(&self) -> Option<&Process> {
        let mut egos = self.drive()?.egos();
        egos.find_map(|(_, drive)| match &drive.controller {
            EgoController::Stock(spec) => spec.program(),
            EgoController::Own { .. } => None,
        })
    }

    /// Every program that the world's file names, with the ego's name.
    pub fn programs(&self) -> Vec<(&str, &Process)> {
        let own = self.program().map(|program| ("nominal", program));
        let reused = self.reuse.iter().filter_map(|(name, change)| {
            let controller = change.controller.as_ref()?;
            Some((name.as_str(), controller.controller.program()?))
        });
        own.into_iter().chain(reused).collect()
    }

    /// The same world, and the consent to start the programs that it and its
    /// changes name, or no such consent.
    ///
    /// A world that was read has none, wherever it was read from: files cannot
    /// consent. Without it a program as the ego is a fault in every episode.
    #[must_use]
    pub fn allow_programs(&self, allowed: bool) -> Scenario {
        let mut same = match &self.world {
            World::Drive(world) => {
                let mut spec = world.spec().clone();
                permit(&mut spec, allowed);
                self.remade(spec)
            }
            World::Grid(_) => self.clone(),
        };
        same.programs_allowed = allowed;
        same
    }

    /// Whether programs that files name may be started.
    pub fn may_start_programs(&self) -> bool {
        self.programs_allowed
    }

    /// The same world with something changed.
    ///
    /// # Errors
    /// What is wrong, with its path within the change.
    pub fn with(&self, change: &Change) -> Result<Scenario, ChangeError> {
        match &self.world {
            World::Drive(world) => {
                let mut spec = world.spec().clone();
                changed::apply(&mut spec, change)?;
                permit(&mut spec, self.programs_allowed);
                check::still_apart(&spec)?;
                Ok(self.remade(spec))
            }
            World::Grid(world) => self.with_grid(world, change),
        }
    }

    /// The same driving world on another plant; any other world as it is.
    pub fn on(&self, plant: PlantKind) -> Scenario {
        match &self.world {
            World::Drive(world) => {
                let mut spec = world.spec().clone();
                spec.plant = plant;
                self.remade(spec)
            }
            World::Grid(_) => self.clone(),
        }
    }

    /// The same world with the user's own controller as the ego.
    ///
    /// `name` is what rows and files call it. Its commands pass the actuator of
    /// the present ego. A world that is not driven stays as it is.
    pub fn with_ego(&self, name: &str, factory: ControllerFactory) -> Scenario {
        let World::Drive(world) = &self.world else {
            return self.clone();
        };
        let mut spec = world.spec().clone();
        for agent in &mut spec.agents {
            if let Drive::Ego(drive) = &mut agent.drive {
                drive.controller = EgoController::Own {
                    name: name.to_owned(),
                    factory: Arc::clone(&factory),
                };
            }
        }
        self.remade(spec)
    }

    /// The same world with an ego that repeats what this one commanded.
    ///
    /// They pass the actuator of the present ego. A world that is not driven
    /// stays as it is.
    pub fn with_commands(&self, commands: &Arc<[Command]>) -> Scenario {
        let commands = Arc::clone(commands);
        let recorded =
            move || Box::new(Recorded::new(Arc::clone(&commands))) as Box<dyn Controller>;
        self.with_ego("recorded", Arc::new(recorded))
    }

    /// The ego's stock controller and its actuator, if it has one.
    pub fn controller(&self) -> Option<Actuated<ControllerSpec>> {
        family::controller(self.drive()?)
    }

    /// A change read from a file, for `--ego FILE`.
    ///
    /// # Errors
    /// The file cannot be read, is no change, or does not fit this world.
    pub fn changed_by(&self, path: &FilePath) -> Result<(Change, Scenario), LoadError> {
        let file = path.display().to_string();
        let text = read::text(&file, path)?;
        let fail = |problem| {
            LoadError::Scenario(Box::new(ScenarioError {
                file: file.clone(),
                text: text.clone(),
                problems: vec![problem],
            }))
        };
        let change = match &self.world {
            World::Drive(_) => read::parse(&text).map_err(fail)?,
            World::Grid(_) => read::parse::<GridChange>(&text).map_err(fail)?.into(),
        };
        match self.with(&change) {
            Ok(scenario) => Ok((change, scenario)),
            Err(error) => {
                let at = error.path(&Path::top());
                Err(fail(error.problem(at.find(&text))))
            }
        }
    }

    /// Every signal that formulas may use, derived ones included.
    pub fn signals(&self) -> Vec<(Signal, Held)> {
        self.world.signals()
    }

    fn remade(&self, spec: DriveSpec) -> Scenario {
        // Invariant: signals and observations do not depend on what a change
        // can change, so a world that was assembled once assembles again.
        let world = DriveWorld::new(spec).map(World::Drive);
        assert!(world.is_ok(), "a changed world assembles like the original");
        Scenario {
            world: world.unwrap_or_else(|_| self.world.clone()),
            ..self.clone()
        }
    }
}

/// Gives or takes back the consent to start a program that is the ego.
fn permit(spec: &mut DriveSpec, allowed: bool) {
    for agent in &mut spec.agents {
        if let Drive::Ego(drive) = &mut agent.drive
            && let EgoController::Stock(controller) = &mut drive.controller
        {
            controller.allow_programs(allowed);
        }
    }
}

/// A change that does not fit the world.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what}")]
pub struct ChangeError {
    /// What is wrong.
    pub what: String,
    /// The cure, where one is known.
    pub help: Option<String>,
    /// Fields from the change to the place.
    pub place: Vec<String>,
}

impl ChangeError {
    fn path(&self, change: &Path) -> Path {
        self.place
            .iter()
            .fold(change.clone(), |path, name| path.to(name))
    }

    fn problem(&self, span: std::ops::Range<usize>) -> Problem {
        Problem {
            what: self.what.clone(),
            span,
            label: "here".to_owned(),
            help: self.help.clone(),
        }
    }
}

fn bound_rules(rules: &[RuleSpec], monitors: Vec<crate::stl::Monitor>) -> Vec<Rule> {
    let mut bound: Vec<Rule> = rules
        .iter()
        .zip(monitors)
        .map(|(rule, monitor)| Rule {
            name: rule.name.clone(),
            ado: rule.ado.clone(),
            priority: rule.priority,
            monitor,
        })
        .collect();
    bound.sort_by_key(|rule| rule.priority);
    bound
}
