//! A checked world: what it holds, and what it gives.

use std::sync::Arc;

use indexmap::IndexMap;

use super::error::Problem;
use super::family::{Against, Family};
use super::file::Change;
use super::locate::Path;
use super::repeats::Repeats;
use crate::ego::{Actuated, ControllerSpec, Process};
use crate::rl::{LearnerConfig, Spaces};
use crate::rulebook::{Rule, Rulebook, TrainingGoal};
use crate::scene::drive::{Agent, Drive, DriveSpec, EgoController, EgoVariant};
use crate::scene::grid::GridWorld;
use crate::scene::{Availability, Axis, Dynamics, Scene, Start, World};
use crate::stl::{Formula, Names};
use crate::testbench::Testbench;
use crate::trace::Signal;

/// A world, checked: everything needed to build its test bench.
#[derive(Clone)]
pub struct Scenario {
    /// Name of the world; part of every start's key.
    pub(crate) name: String,
    /// The question it asks.
    pub(crate) question: String,
    /// Where it comes from.
    pub(crate) source: String,
    /// The file's text, verbatim but for trained ados: what their run
    /// directories held is written out.
    pub(crate) text: String,
    /// ψ_ego.
    pub(crate) ego_spec: Formula,
    /// The requirement that ψ_ego stands for, if the world names one.
    pub(crate) requirement: Option<String>,
    /// The ados' rules, in the file's order.
    pub(crate) rules: Vec<RuleSpec>,
    /// Constants and named formulas.
    pub(crate) names: Names,
    /// How to learn.
    pub(crate) learner: LearnerConfig,
    /// Other ways to learn, by name.
    pub(crate) learners: IndexMap<String, LearnerConfig>,
    /// Which of them is `learner`; `None`: the world's own.
    pub(crate) learning: Option<String>,
    /// Which failures a training looks for; empty: any.
    pub(crate) goals: Vec<TrainingGoal>,
    /// What an ado is trained against.
    pub(crate) against: Against,
    /// The structure of the family that is not met.
    pub(crate) left_out: Option<String>,
    /// What the same trained ado is reused on.
    pub(crate) reuse: IndexMap<String, Change>,
    /// How often each start is played, for egos that do not answer twice alike.
    pub(crate) repeats: Repeats,
    /// What looked odd but is allowed.
    pub(crate) warnings: Vec<Problem>,
    pub(super) family: Option<Arc<Family>>,
    pub(super) world: World,
    pub(super) rulebook: Arc<Rulebook>,
    /// Whether programs that files name may be started.
    pub(super) programs_allowed: bool,
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
    /// The requirement it stands for, such as a paragraph of a regulation.
    pub requirement: Option<String>,
    /// Where its formula stands in the file.
    pub(super) place: Path,
}

impl Scenario {
    /// Name of the world; part of every start's key.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The question it asks.
    pub fn question(&self) -> &str {
        &self.question
    }

    /// Where it comes from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The file's text, verbatim but for trained ados, which are written out.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// ψ_ego.
    pub fn ego_spec(&self) -> &Formula {
        &self.ego_spec
    }

    /// The ados' rules, in the file's order.
    pub fn rules(&self) -> &[RuleSpec] {
        &self.rules
    }

    /// Constants and named formulas.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// How to learn.
    pub fn learner(&self) -> &LearnerConfig {
        &self.learner
    }

    /// Other ways to learn, by name.
    pub fn learners(&self) -> &IndexMap<String, LearnerConfig> {
        &self.learners
    }

    /// Which failures a training looks for; empty: any.
    pub fn goals(&self) -> &[TrainingGoal] {
        &self.goals
    }

    /// What an ado is trained against.
    pub fn against(&self) -> Against {
        self.against
    }

    /// What the same trained ado is reused on.
    pub fn reuse(&self) -> &IndexMap<String, Change> {
        &self.reuse
    }

    /// How often each start is played.
    pub fn repeats(&self) -> Repeats {
        self.repeats
    }

    /// What looked odd but is allowed.
    pub fn warnings(&self) -> &[Problem] {
        &self.warnings
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

    /// The same, to be kept beside the world.
    pub fn shared_rulebook(&self) -> Arc<Rulebook> {
        Arc::clone(&self.rulebook)
    }

    /// A fresh test bench, one per worker.
    pub fn bench(&self) -> Testbench {
        Testbench::new(self.world.scene(), Arc::clone(&self.rulebook))
    }

    /// What moves the world.
    pub fn plant(&self) -> Dynamics {
        self.world.dynamics()
    }

    /// The family of egos under `train_against`, if the world has one.
    pub fn family(&self) -> Option<&Family> {
        self.family.as_deref()
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
    pub fn scene_of(&self, variant: &EgoVariant) -> Option<Box<dyn Scene>> {
        match &self.world {
            World::Drive(world) => {
                let mut variant = variant.clone();
                variant
                    .controller
                    .controller
                    .allow_programs(self.programs_allowed);
                Some(Box::new(world.with_variant(&variant).scene()))
            }
            World::Grid(_) => None,
        }
    }

    /// Programs that playing this world starts: its ego, if it is one.
    pub fn program(&self) -> Option<&Process> {
        match &self.drive()?.ego.controller {
            EgoController::Stock(spec) => spec.program(),
            EgoController::Own { .. } | EgoController::Recorded(_) => None,
        }
    }

    /// The name of the user's own controller, if that is the ego.
    pub fn own_ego(&self) -> Option<&str> {
        match &self.drive()?.ego.controller {
            EgoController::Stock(_) => None,
            EgoController::Own { name, .. } => Some(name),
            EgoController::Recorded(_) => Some("recorded"),
        }
    }

    /// Whether its starts are points that an ego passes or fails, one by one: a
    /// table of them, a single start, or starts of a world without an ado.
    ///
    /// An ado that acts without a plan makes a world with a single start one to
    /// search and to train in.
    pub fn has_points(&self) -> bool {
        let Some(spec) = self.drive() else {
            return false;
        };
        let is_free = |agent: &Agent| matches!(agent.drive, Drive::Ado { base: None, .. });
        let planned = spec.agents.iter().filter(|agent| agent.plan().is_some());
        let acting = spec.action_sets().count();
        let strays = !spec.agents.iter().any(is_free) && acting <= planned.count();
        !spec.points.is_empty() || acting == 0 || (spec.axes().is_empty() && strays)
    }

    /// Whether the world's own ego says nothing of which starts are too hard for
    /// another: it only coasts, or the starts are a table of points.
    pub fn judges_each_ego(&self) -> bool {
        let Some(spec) = self.drive() else {
            return false;
        };
        let coasts = matches!(
            spec.ego.controller,
            EgoController::Stock(ControllerSpec::Coast(_))
        );
        coasts || !spec.points.is_empty()
    }

    /// Every program that the world's file names, with the ego's name.
    pub fn programs(&self) -> Vec<(&str, &Process)> {
        let own = self.program().map(|program| ("nominal", program));
        let reused = self.reuse.iter().filter_map(|(name, change)| {
            let controller = change.controller.as_ref()?;
            Some((name.as_str(), controller.controller.program()?))
        });
        let met = self.family().into_iter().flat_map(Family::programs);
        own.into_iter().chain(reused).chain(met).collect()
    }

    /// Whether programs that files name may be started.
    pub fn may_start_programs(&self) -> bool {
        self.programs_allowed
    }

    /// The ego's stock controller and its actuator, if it has one.
    pub fn controller(&self) -> Option<Actuated<ControllerSpec>> {
        super::quantity::controller(self.drive()?)
    }

    /// Every signal that formulas may use, derived ones included.
    pub fn signals(&self) -> Vec<(Signal, Availability)> {
        self.world.signals()
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
    pub(super) fn path(&self, change: &Path) -> Path {
        self.place
            .iter()
            .fold(change.clone(), |path, name| path.to(name))
    }

    pub(super) fn problem(&self, span: std::ops::Range<usize>) -> Problem {
        Problem {
            what: self.what.clone(),
            span,
            label: "here".to_owned(),
            help: self.help.clone(),
        }
    }
}

pub(super) fn bound_rules(rules: &[RuleSpec], monitors: Vec<crate::stl::Monitor>) -> Vec<Rule> {
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
