//! Variants of a world: another ego, plant, learner or consent.

use std::path::Path as FilePath;
use std::sync::Arc;

use super::family::EgoSample;
use super::language::{Judging, rulebook};
use super::{ChangeError, DriveScenario, Repeats, Scenario, ScenarioKind, TrainingEgos};
use super::{changed, check, counts_check};
use crate::ego::{Command, Transcripts};
use crate::rl::{ConfigError, LearnerConfig};
use crate::ron_file::{LoadError, ScenarioError, ValuePath, read};
use crate::rulebook::{Counts, JudgeKind, Rulebook};
use crate::scene::drive::{ControllerFactory, DriveSpec, DriveWorld, EgoController, Sensors};
use crate::scene::{Dynamics, World};
use crate::sim::PlantKind;
use crate::testbench::Episode;
use crate::world_file::{Change, GridChange, TrainingGoal};

impl Scenario {
    /// Returns the world with another learner.
    #[must_use]
    pub fn learning_with(&self, learner: LearnerConfig) -> Scenario {
        Scenario {
            learner,
            ..self.clone()
        }
    }

    /// Returns the world without the rules of some names.
    #[must_use]
    pub fn without_rules(&self, left_out: impl Fn(&str) -> bool) -> Scenario {
        let mut same = self.clone();
        same.rules.retain(|rule| !left_out(&rule.name));
        let mut rulebook = Rulebook::clone(&self.rulebook);
        // Bound rules have the names of the written rules, and both lists lose
        // the same rules.
        rulebook.rules.retain(|rule| !left_out(&rule.name));
        same.rulebook = Arc::new(rulebook);
        same
    }

    /// Returns the world with every violation counting, and runs judged up to it.
    pub fn counting_every_violation(&self) -> Scenario {
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

    /// Returns the world with a number of runs of each start.
    #[must_use]
    pub fn repeated(&self, repeats: Repeats) -> Scenario {
        Scenario {
            repeats,
            ..self.clone()
        }
    }

    /// Returns the world with another of its learners. `None` for an unknown name.
    pub fn learning_by(&self, name: &str) -> Option<Scenario> {
        Some(Scenario {
            learner: self.learners.get(name)?.clone(),
            learning: Some(name.to_owned()),
            ..self.clone()
        })
    }

    /// Returns the world with a number of training decisions.
    ///
    /// # Errors
    ///
    /// Returns an error for 0 decisions, or more than a learner accepts.
    pub fn training_for(&self, decisions: u64) -> Result<Scenario, ConfigError> {
        let learner = self.learner.clone().with_decisions(decisions)?;
        Ok(self.learning_with(learner))
    }

    /// Returns the world with goals for its trainings.
    ///
    /// # Errors
    ///
    /// Returns an error for a goal that is repeated or cannot be reached in this world.
    pub fn training_towards(&self, goals: &[TrainingGoal]) -> Result<Scenario, ChangeError> {
        let spec = self.drive().map(DriveScenario::spec);
        // Every agent but the ego has a body that can touch it.
        let others = spec.map(|spec| spec.agents.len().saturating_sub(1));
        if let Some((what, help)) = counts_check::against_goals(goals, others) {
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

    /// Returns the world with a training opponent.
    ///
    /// `None` if it has no family.
    pub fn training_against(&self, against: TrainingEgos) -> Option<Scenario> {
        let learner = match against {
            TrainingEgos::Nominal => self.learner.clone(),
            TrainingEgos::Randomized => self.family()?.wide.clone(),
        };
        Some(Scenario {
            learner,
            against,
            ..self.clone()
        })
    }

    /// Returns the world with a mixture of egos as the training opponent.
    ///
    /// Each member has a probability. The learner is that of a nominal ado. `None` if
    /// the world has no family.
    pub fn training_against_mixture(&self, mixture: Vec<(f64, EgoSample)>) -> Option<Scenario> {
        let mut family = self.family()?.clone();
        family.mixture = mixture;
        Some(Scenario {
            against: TrainingEgos::Randomized,
            family: Some(Arc::new(family)),
            ..self.clone()
        })
    }

    /// Returns the world without one structure of its family in training.
    ///
    /// It serves to test an ado against a kind of controller that is new to it.
    ///
    /// `None` if its family has no such structure.
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

    /// Returns the world with or without consent to start programs.
    ///
    /// The consent concerns programs that the world and its changes name. A
    /// world from a file has no consent, because files cannot consent. Without
    /// it an ego that is a program is a fault in every episode.
    #[must_use]
    pub fn allow_programs(&self, allowed: bool) -> Scenario {
        Scenario {
            programs_allowed: allowed,
            ..self.redriven(|spec| permit(spec, allowed))
        }
    }

    /// Returns the world whose foreign egos begin every episode anew.
    ///
    /// A program is started anew, and a controller of yours is made anew, at a cost of one
    /// start per episode. State that it keeps over `reset` then has no effect. Changes of
    /// the world have the same.
    #[must_use]
    pub fn with_fresh_egos(&self) -> Scenario {
        Scenario {
            fresh_egos: true,
            ..self.redriven(|spec| spec.ego.controller.set_fresh())
        }
    }

    /// Returns the world with a change.
    ///
    /// # Errors
    ///
    /// Returns an error with its path within the change.
    pub fn with(&self, change: &Change) -> Result<Scenario, ChangeError> {
        match self.kind() {
            ScenarioKind::Drive(scenario) => {
                let mut spec = scenario.spec().clone();
                changed::apply(&mut spec, change)?;
                // The change may bring a program of its own, which has no
                // consent yet.
                permit(&mut spec, self.programs_allowed);
                if self.fresh_egos {
                    spec.ego.controller.set_fresh();
                }
                check::still_apart(&spec)?;
                Ok(self.remade(spec))
            }
            ScenarioKind::Grid(scenario) => self.with_grid(scenario.world(), change),
        }
    }

    /// Returns the driving world on another plant. Other worlds stay as they are.
    pub fn on(&self, plant: PlantKind) -> Scenario {
        self.redriven(|spec| spec.plant = plant)
    }

    /// Returns a world in which action sequences are tried first, because it is cheaper.
    ///
    /// A world of the rigid plant has one on the kinematic plant. `None` where roads have
    /// grades or banks, whose crests the kinematic plant does not feel, and for other worlds.
    pub fn screening(&self) -> Option<Scenario> {
        // The kinematic plant knows no surface, so it is no model of slopes.
        let is_level = self
            .drive()
            .is_some_and(|driving| !driving.spec().has_slopes());
        (is_level && self.plant() == Dynamics::Rigid).then(|| self.on(PlantKind::Kinematic))
    }

    /// Returns the world with each start played several times.
    pub fn repeating_starts(&self, repeats: Repeats) -> Scenario {
        Scenario {
            repeats,
            ..self.clone()
        }
    }

    /// Returns the names of the placed ados whose rules are judged.
    pub fn judged_ados(&self) -> Vec<&str> {
        let driving = self.drive();
        let all = driving.iter().flat_map(|driving| driving.spec().trained());
        let judged = all.filter(|(_, trained)| trained.judged);
        judged.map(|(name, _)| name).collect()
    }

    /// Returns the world with some placed ados idle, and the others as before.
    ///
    /// An idle ado plays its action without effect throughout. Only ados whose rules are
    /// judged become idle, since the others are traffic.
    pub fn with_idle_ados(&self, idle: impl Fn(&str) -> bool) -> Scenario {
        if self.judged_ados().is_empty() {
            return self.clone();
        }
        self.redriven(|spec| {
            for (name, trained) in spec.trained_mut() {
                trained.idle = trained.judged && idle(name);
            }
        })
    }

    /// Returns the world with the user's own controller as the ego.
    ///
    /// `name` is its name in rows and files. Its commands pass through the
    /// actuator of the current ego. A world without driving stays as it is.
    pub fn with_ego(&self, name: &str, factory: ControllerFactory) -> Scenario {
        self.redriven(|spec| {
            spec.ego.controller = EgoController::Own {
                name: name.to_owned(),
                factory,
                fresh: self.fresh_egos,
                transcripts: Some(Transcripts::default()),
            };
        })
    }

    /// Returns a model of the world, whose ego is made by `factory`.
    ///
    /// The ego's perception and actuation are perfect. A world without driving
    /// stays as it is.
    pub fn as_model(&self, plant: PlantKind, factory: ControllerFactory) -> Scenario {
        self.redriven(|spec| {
            spec.plant = plant;
            // The model replaces the complete ego, so perception and actuation
            // must add nothing.
            spec.sensors = Sensors::default();
            spec.fix_environment(|it| it.quantity.is_of_sensors());
            spec.ego.lag_s = 0.0;
            spec.ego.controller = EgoController::Own {
                name: "model".to_owned(),
                factory,
                fresh: false,
                transcripts: None,
            };
        })
    }

    /// Returns the world with an ego that repeats recorded commands.
    ///
    /// They pass through the actuator of the current ego. A world without
    /// driving stays as it is.
    pub fn with_commands(&self, commands: &Arc<[Command]>) -> Scenario {
        self.redriven(|spec| spec.ego.controller = EgoController::Recorded(Arc::clone(commands)))
    }

    /// Returns the world for a replay of an episode.
    ///
    /// An ego that is not deterministic repeats its commands, so no program is
    /// started.
    pub fn repeating(&self, episode: &Episode) -> Scenario {
        if episode.commands.is_empty() {
            self.clone()
        } else {
            self.with_commands(&episode.commands.clone().into())
        }
    }

    /// Returns a change from a file, for `--ego FILE`, and the changed world.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, is no change, or does not
    /// fit the world.
    pub fn changed_by(&self, path: &FilePath) -> Result<(Change, Scenario), LoadError> {
        let file = path.display().to_string();
        let content = read::text(&file, path)?;
        let text = read::without_mark(&content);
        let fail = |problem| {
            LoadError::Scenario(Box::new(ScenarioError {
                file: file.clone(),
                text: text.to_owned(),
                problems: vec![problem],
            }))
        };
        let change = match self.kind() {
            ScenarioKind::Drive(_) => read::parse(text).map_err(fail)?,
            // A grid's file has the fields of a `GridChange` at its top.
            ScenarioKind::Grid(_) => read::parse::<GridChange>(text).map_err(fail)?.into(),
        };
        match self.with(&change) {
            Ok(scenario) => Ok((change, scenario)),
            Err(error) => {
                let at = error.path(&ValuePath::top());
                Err(fail(error.problem(at.find(text))))
            }
        }
    }

    /// Returns the driving world with a changed spec. Other worlds stay as they are.
    pub(super) fn redriven(&self, change: impl FnOnce(&mut DriveSpec)) -> Scenario {
        let Some(scenario) = self.drive() else {
            return self.clone();
        };
        let mut spec = scenario.spec().clone();
        change(&mut spec);
        self.remade(spec)
    }

    fn remade(&self, spec: DriveSpec) -> Scenario {
        // Invariant: signals and observations do not depend on parts that a
        // change can alter. So a world that was assembled once assembles again.
        let world = DriveWorld::new(spec).map(World::Drive);
        assert!(world.is_ok(), "a changed world assembles like the original");
        Scenario {
            world: world.unwrap_or_else(|_| self.world.clone()),
            ..self.clone()
        }
    }
}

impl DriveScenario<'_> {
    /// Returns the driving world with another sampling time.
    ///
    /// Decisions keep their times, and `substeps` divide a sample for the physics.
    ///
    /// `None` for formulas that do not bind to such samples, or a trained ado
    /// with another sampling time.
    pub fn sampled_every(self, sample_s: f64, substeps: u32) -> Option<Scenario> {
        let mut spec = self.spec().clone();
        spec.clock.sample_s = sample_s;
        spec.clock.substeps = substeps;
        let world = DriveWorld::new(spec).ok()?;
        let judging = Judging {
            judge: self.rulebook.judge,
            counts: self.rulebook.counts.clone(),
            reward: self.rulebook.reward,
        };
        let (spec, rules, names) = (&self.ego_spec, &self.rules, &self.names);
        // Windows of formulas are counted in samples, so they are bound again.
        let bound = rulebook(world.schema(), spec, rules, names, judging).ok()?;
        Some(Scenario {
            rulebook: Arc::new(Rulebook {
                spec: bound.spec,
                rules: bound.rules,
                ..Rulebook::clone(&self.rulebook)
            }),
            world: World::Drive(world),
            ..Scenario::clone(&self)
        })
    }
}

/// Gives or withdraws the consent to start an ego that is a program.
fn permit(spec: &mut DriveSpec, allowed: bool) {
    if let EgoController::Stock(controller) = &mut spec.ego.controller {
        controller.allow_programs(allowed);
    }
}
