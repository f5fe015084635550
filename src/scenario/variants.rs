//! The same world, changed: another ego, plant, learner or consent.

use std::path::Path as FilePath;
use std::sync::Arc;

use super::file::{Change, GridChange};
use super::language::{Judging, rulebook};
use super::{Against, ChangeError, Family, LoadError, Path, Repeats, Scenario, ScenarioError};
use super::{changed, check, counting, read};
use crate::ego::Command;
use crate::rl::{ConfigError, LearnerConfig};
use crate::rulebook::{Counts, JudgeKind, Rulebook, TrainingGoal};
use crate::scene::World;
use crate::scene::drive::{ControllerFactory, DriveSpec, DriveWorld, EgoController, Sensors};
use crate::sim::PlantKind;
use crate::testbench::Episode;

impl Scenario {
    /// The same world, to learn so.
    #[must_use]
    pub fn learning_with(&self, learner: LearnerConfig) -> Scenario {
        Scenario {
            learner,
            ..self.clone()
        }
    }

    /// The same world without the rules of some names.
    #[must_use]
    pub fn without_rules(&self, left_out: impl Fn(&str) -> bool) -> Scenario {
        let mut same = self.clone();
        same.rules.retain(|rule| !left_out(&rule.name));
        let mut rulebook = Rulebook::clone(&self.rulebook);
        rulebook.rules.retain(|rule| !left_out(&rule.name));
        same.rulebook = Arc::new(rulebook);
        same
    }

    /// The same world where every violation counts, each run judged up to it.
    pub(crate) fn counting_every_violation(&self) -> Scenario {
        let rulebook = Rulebook {
            counts: Counts::Violation,
            judge: JudgeKind::UntilViolation,
            ..Rulebook::clone(&self.rulebook)
        };
        Scenario {
            rulebook: Arc::new(rulebook),
            ..self.clone()
        }
    }

    /// The same world, each start played so often.
    #[must_use]
    pub fn repeated(&self, repeats: Repeats) -> Scenario {
        Scenario {
            repeats,
            ..self.clone()
        }
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
        let learner = self.learner.clone().with_decisions(decisions)?;
        Ok(self.learning_with(learner))
    }

    /// The same world, whose trainings look for such failures.
    ///
    /// # Errors
    /// A goal is named twice, or cannot be reached in this world.
    pub fn training_towards(&self, goals: &[TrainingGoal]) -> Result<Scenario, ChangeError> {
        let others = self.drive().map(|spec| spec.agents.len().saturating_sub(1));
        if let Some((what, help)) = counting::against_goals(goals, others) {
            return Err(ChangeError {
                what,
                help: Some(help),
                place: Vec::new(),
            });
        }
        Ok(Scenario {
            goals: goals.to_vec(),
            ..self.clone()
        })
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
        // A conditional ado could not be told of a structure which it is.
        let told = against == Against::Conditional;
        let family = self.family().filter(|_| told).map(|family| {
            let structures = Vec::new();
            Arc::new(Family {
                structures,
                ..family.clone()
            })
        });
        Some(Scenario {
            learner,
            against,
            family: family.or_else(|| self.family.clone()),
            ..self.clone()
        })
    }

    /// The same world, one structure of its family never met in training: to ask
    /// what an ado does against a kind of controller that is new to it.
    ///
    /// `None`: its family has no such structure.
    pub fn leaving_out(&self, structure: &str) -> Option<Scenario> {
        let mut family = self.family()?.clone();
        let all = family.structures.len();
        family.structures.retain(|other| other.name != structure);
        (family.structures.len() < all).then(|| Scenario {
            left_out: Some(structure.to_owned()),
            family: Some(Arc::new(family)),
            ..self.clone()
        })
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

    /// The same driving world, sampled so often; decisions stay where they are.
    ///
    /// `None`: it is not driven, its formulas do not bind to such samples, or a
    /// trained ado in it was trained on others.
    pub fn sampled_every(&self, sample_s: f64) -> Option<Scenario> {
        let mut spec = self.drive()?.clone();
        spec.clock.sample_s = sample_s;
        let world = DriveWorld::new(spec).ok()?;
        let judging = Judging {
            judge: self.rulebook.judge,
            counts: self.rulebook.counts.clone(),
            reward: self.rulebook.reward,
        };
        let (spec, rules, names) = (&self.ego_spec, &self.rules, &self.names);
        let bound = rulebook(world.schema(), spec, rules, names, judging).ok()?;
        Some(Scenario {
            rulebook: Arc::new(Rulebook {
                spec: bound.spec,
                rules: bound.rules,
                ..Rulebook::clone(&self.rulebook)
            }),
            world: World::Drive(world),
            ..self.clone()
        })
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
        spec.ego.controller = EgoController::Own {
            name: name.to_owned(),
            factory,
        };
        self.remade(spec)
    }

    /// A model of the same world, in which the ego is what `factory` makes.
    ///
    /// Nothing stands between what that ego
    /// sees or commands and what is there or happens. A world that is not driven
    /// stays as it is.
    pub(crate) fn as_model(&self, plant: PlantKind, factory: ControllerFactory) -> Scenario {
        let World::Drive(world) = &self.world else {
            return self.clone();
        };
        let mut spec = world.spec().clone();
        spec.plant = plant;
        spec.sensors = Sensors::default();
        spec.ego.lag_s = 0.0;
        spec.ego.controller = EgoController::Own {
            name: "model".to_owned(),
            factory,
        };
        self.remade(spec)
    }

    /// The same world with an ego that repeats what this one commanded.
    ///
    /// They pass the actuator of the present ego. A world that is not driven
    /// stays as it is.
    pub fn with_commands(&self, commands: &Arc<[Command]>) -> Scenario {
        let World::Drive(world) = &self.world else {
            return self.clone();
        };
        let mut spec = world.spec().clone();
        spec.ego.controller = EgoController::Recorded(Arc::clone(commands));
        self.remade(spec)
    }

    /// The same world, to play an episode of it again: an ego that may answer
    /// otherwise the next time repeats its commands, so no program is started.
    pub fn repeating(&self, episode: &Episode) -> Scenario {
        match episode.commands.is_empty() {
            true => self.clone(),
            false => self.with_commands(&episode.commands.clone().into()),
        }
    }

    /// A change read from a file, for `--ego FILE`.
    ///
    /// # Errors
    /// The file cannot be read, is no change, or does not fit this world.
    pub fn changed_by(&self, path: &FilePath) -> Result<(Change, Scenario), LoadError> {
        let file = path.display().to_string();
        let text = read::text(&file, path)?;
        let text = read::without_mark(&text);
        let fail = |problem| {
            LoadError::Scenario(Box::new(ScenarioError {
                file: file.clone(),
                text: text.to_owned(),
                problems: vec![problem],
            }))
        };
        let change = match &self.world {
            World::Drive(_) => read::parse(text).map_err(fail)?,
            World::Grid(_) => read::parse::<GridChange>(text).map_err(fail)?.into(),
        };
        match self.with(&change) {
            Ok(scenario) => Ok((change, scenario)),
            Err(error) => {
                let at = error.path(&Path::top());
                Err(fail(error.problem(at.find(text))))
            }
        }
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
    if let EgoController::Stock(controller) = &mut spec.ego.controller {
        controller.allow_programs(allowed);
    }
}
