//! Checked world, with its content and its derived objects.

use std::sync::Arc;

use indexmap::IndexMap;

use super::family::{Family, TrainingEgos};
use super::rule_spec::RuleSpec;
use crate::ego::{Actuated, ControllerSpec, Process, StockController};
use crate::natural::DeclaredTraffic;
use crate::rl::{LearnerConfig, Spaces};
use crate::ron_file::Problem;
use crate::ron_file::ValuePath;
use crate::rulebook::{Rule, Rulebook};
use crate::scene::drive::{Agent, Drive, EgoController, EgoDrive};
use crate::scene::{Availability, Axis, Dynamics, Start, World};
use crate::stl::{Formula, Names};
use crate::testbench::Repeats;
use crate::testbench::Testbench;
use crate::trace::Signal;
use crate::world_file::{Change, DeclaredTrafficFile, OriginFile, TrainingGoal};

/// Checked world, with everything that its test bench requires.
#[derive(Clone)]
pub struct Scenario {
    /// Name of the world, which is part of every start's key.
    pub name: String,
    /// Question of the world.
    pub question: String,
    /// Origin of the world.
    pub source: String,
    /// Pose of its origin in a road file of another simulator, if it is known.
    pub origin: Option<OriginFile>,
    /// Text of the file, verbatim except for trained ados.
    ///
    /// The content of their run directories is written out.
    pub text: String,
    /// Specification ψ_ego.
    pub ego_spec: Formula,
    /// Requirement that ψ_ego expresses, if the world names it.
    pub requirement: Option<String>,
    /// Rules of the ados, in the file's order.
    pub rules: Vec<RuleSpec>,
    /// Constants and named formulas.
    pub names: Names,
    /// Settings of the learner.
    pub learner: LearnerConfig,
    /// Alternative learners by name.
    pub learners: IndexMap<String, LearnerConfig>,
    /// Name of the current learner. `None` for the world's own.
    pub learning: Option<String>,
    /// Failures that a training looks for. Empty for any.
    pub goals: Vec<TrainingGoal>,
    /// Training opponent of an ado.
    pub against: TrainingEgos,
    /// Structure of the family that training leaves out.
    pub left_out: Option<String>,
    /// Changed egos for the reuse of a trained ado.
    pub reuse: IndexMap<String, Change>,
    /// Number of runs of each start, for egos that are not deterministic.
    pub repeats: Repeats,
    /// Warnings about allowed but odd content.
    pub warnings: Vec<Problem>,
    pub(super) family: Option<Arc<Family>>,
    pub(super) world: World,
    pub(super) rulebook: Arc<Rulebook>,
    /// True if programs that files name may be started.
    pub(super) programs_allowed: bool,
    /// True if foreign egos begin every episode anew.
    pub(super) fresh_egos: bool,
    /// Traffic in which the ados drive, with a limit on their rarity if any.
    pub(super) traffic: DeclaredTraffic,
    /// Laws of the starts and of the ados' actions, if declared.
    pub(super) laws: Option<Arc<DeclaredTrafficFile>>,
}

impl std::fmt::Debug for Scenario {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Only the name, because the whole world would fill pages of a message.
        let mut shown = f.debug_struct("Scenario");
        shown.field("name", &self.name).finish_non_exhaustive()
    }
}

impl Scenario {
    /// Returns the name of the world, which is part of every start's key.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the question of the world.
    pub fn question(&self) -> &str {
        &self.question
    }

    /// Returns the origin of the world.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Returns the file's text, with trained ados written out.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the specification ψ_ego.
    pub fn ego_spec(&self) -> &Formula {
        &self.ego_spec
    }

    /// Returns the rules of the ados, in the file's order.
    pub fn rules(&self) -> &[RuleSpec] {
        &self.rules
    }

    /// Returns the constants and named formulas.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// Returns the settings of the learner.
    pub fn learner(&self) -> &LearnerConfig {
        &self.learner
    }

    /// Returns the alternative learners by name.
    pub fn learners(&self) -> &IndexMap<String, LearnerConfig> {
        &self.learners
    }

    /// Returns the failures that a training looks for. Empty for any.
    pub fn goals(&self) -> &[TrainingGoal] {
        &self.goals
    }

    /// Returns the training opponent of an ado.
    pub fn against(&self) -> TrainingEgos {
        self.against
    }

    /// Returns the changed egos for the reuse of a trained ado.
    pub fn reuse(&self) -> &IndexMap<String, Change> {
        &self.reuse
    }

    /// Returns the number of runs of each start.
    pub fn repeats(&self) -> Repeats {
        self.repeats
    }

    /// Returns the warnings about allowed but odd content.
    pub fn warnings(&self) -> &[Problem] {
        &self.warnings
    }

    /// Returns the assembled world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Returns the axes of X_init.
    pub fn axes(&self) -> Vec<Axis> {
        self.world.axes()
    }

    /// Returns all starts of a finite world, each once.
    pub fn starts(&self) -> Option<Vec<Start>> {
        self.world.starts()
    }

    /// Returns a joint action in words.
    pub fn action_label(&self, action: usize) -> String {
        self.world.action_label(action)
    }

    /// Returns the bound rulebook.
    pub fn rulebook(&self) -> &Rulebook {
        &self.rulebook
    }

    /// Returns a new test bench, one per worker.
    pub fn bench(&self) -> Testbench {
        let bench = Testbench::new(self.world.scene(), Arc::clone(&self.rulebook));
        match self.traffic.limit() {
            Some(limit) => bench.limited(limit),
            None => bench,
        }
    }

    /// Returns the dynamics of the world.
    pub fn plant(&self) -> Dynamics {
        self.world.dynamics()
    }

    /// Returns the family of egos under `train_against`, if any.
    #[doc(hidden)]
    pub fn family(&self) -> Option<&Family> {
        self.family.as_deref()
    }

    /// Returns the spaces of an ado.
    pub fn spaces(&self) -> &Spaces {
        self.world.spaces()
    }

    /// Returns the drive of the ego. `None` on a grid.
    #[doc(hidden)]
    pub fn ego(&self) -> Option<&EgoDrive> {
        Some(&self.drive()?.spec().ego)
    }

    /// Returns the program that this world starts as its ego, if any.
    pub fn program(&self) -> Option<&Process> {
        self.ego()?.controller.program()
    }

    /// Returns the name of the user's own controller, if it is the ego.
    pub fn own_ego(&self) -> Option<&str> {
        match &self.ego()?.controller {
            EgoController::Stock(_) => None,
            EgoController::Own { name, .. } => Some(name),
            EgoController::Recorded(_) => Some("recorded"),
        }
    }

    /// Returns true if an ego passes or fails each start by itself.
    ///
    /// Such starts are a table, a single start, or starts of a world without an
    /// ado. With an ado that acts without a plan, a world with a single start
    /// is for search and training.
    pub fn has_points(&self) -> bool {
        let Some(spec) = self.drive().map(|driving| driving.spec()) else {
            return false;
        };
        let is_free = |agent: &Agent| matches!(agent.drive, Drive::Ado { base: None, .. });
        let planned = spec.agents.iter().filter(|agent| agent.plan().is_some());
        let acting = spec.action_sets().count();
        // More action sets than plans mean that a light or the weather acts freely.
        let strays = !spec.agents.iter().any(is_free) && acting <= planned.count();
        // A placed ado whose rules are judged is an adversary, too.
        let alone = acting == 0 && !spec.trained().any(|(_, trained)| trained.judged);
        !spec.points.is_empty() || alone || (spec.axes().is_empty() && strays)
    }

    /// Returns true if each ego's own failures determine its trivial starts.
    ///
    /// The world's own ego is no measure if it only coasts, or the starts are a
    /// table of points.
    pub fn judges_each_ego(&self) -> bool {
        self.drive().is_some_and(|driving| {
            let spec = driving.spec();
            let coasts = matches!(
                spec.ego.controller,
                EgoController::Stock(ControllerSpec(StockController::Coast(_)))
            );
            coasts || !spec.points.is_empty()
        })
    }

    /// Returns every program that the world's file names, with the ego's name.
    pub fn programs(&self) -> Vec<(&str, &Process)> {
        let own = self.program().map(|program| ("nominal", program));
        let reused = self.reuse.iter().filter_map(|(name, change)| {
            let controller = change.controller.as_ref()?;
            Some((name.as_str(), controller.controller.program()?))
        });
        let of_family = self.family().into_iter().flat_map(Family::programs);
        own.into_iter().chain(reused).chain(of_family).collect()
    }

    /// Returns true if programs that files name may be started.
    pub fn may_start_programs(&self) -> bool {
        self.programs_allowed
    }

    /// Returns true if foreign egos begin every episode anew.
    pub fn begins_egos_anew(&self) -> bool {
        self.fresh_egos
    }

    /// Returns the ego's stock controller with its actuator, if any.
    pub fn controller(&self) -> Option<Actuated<ControllerSpec>> {
        self.ego()?.stock()
    }

    /// Returns every signal that formulas may use, including derived signals.
    pub fn signals(&self) -> Vec<(Signal, Availability)> {
        self.world.signals()
    }
}

/// Change that does not fit the world.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what}")]
pub struct ChangeError {
    /// Statement of the problem.
    pub what: String,
    /// Fix, if known.
    pub help: Option<String>,
    /// Fields from the change to the place.
    pub place: Vec<String>,
}

impl ChangeError {
    pub(super) fn path(&self, change: &ValuePath) -> ValuePath {
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
    // The sort is stable: rules of equal priority keep the file's order.
    bound.sort_by_key(|rule| rule.priority);
    bound
}
