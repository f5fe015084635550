//! An assembled driving world: all data that is bound once and shared.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::frozen_policy::{Frozen, TrainedError};
use super::observing::Observation;
use super::signals::{SignalReading, schema_of};
use super::spec::{Agent, DriveSpec};
use super::turns::{Turn, turns};
use crate::ego::{Briefing, RoadGeometry};
use crate::rl::{PartSpaces, Spaces};
use crate::road::{CourseError, RoadNetwork};
use crate::scene::Axis;
use crate::stl::{BoundExpr, Formula, Monitor, Settings, StlError};
use crate::trace::{Schema, SchemaError};

/// Error: a driving scene could not be assembled.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// Two signals have the same name.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A derived signal does not bind.
    #[error("the signal `{name}`: {source}")]
    Derived {
        /// Name of the signal.
        name: String,
        /// Cause.
        source: Box<StlError>,
    },
    /// A formula that triggers a step of a plan does not bind.
    #[error("what a step of `{name}` waits for: {source}")]
    When {
        /// Name of the agent.
        name: String,
        /// Cause.
        source: Box<StlError>,
    },
    /// A formula of the storyboard does not bind.
    #[error("a condition of the storyboard: {source}")]
    Condition {
        /// Cause.
        source: Box<StlError>,
    },
    /// An observed signal is not published.
    #[error("`{name}` is observed but not published")]
    Observed {
        /// Name of the signal.
        name: String,
    },
    /// The number of egos differs from one.
    #[error("a driving scene has exactly one ego, not {count}")]
    Egos {
        /// Number of egos.
        count: usize,
    },
    /// A trained ado cannot act in this world.
    #[error("the trained ado `{name}`: {source}")]
    Trained {
        /// Name of the ado in this world.
        name: String,
        /// Cause.
        source: Box<TrainedError>,
    },
    /// The course of the road is infeasible.
    #[error(transparent)]
    Course(#[from] CourseError),
}

/// Data that the scenes of a world share.
#[derive(Clone)]
pub struct DriveLayout {
    /// Description of the world.
    pub spec: Arc<DriveSpec>,
    /// Roads of the world.
    pub network: Arc<RoadNetwork>,
    /// Index of the ego among the agents.
    pub ego: usize,
    /// Published signals.
    pub schema: Arc<Schema>,
    /// Source of each published signal that is not derived.
    pub sources: Vec<SignalReading>,
    /// Derived signals, after the others.
    pub derived: Vec<BoundExpr>,
    /// Signals that the ados observe.
    pub observed: Observation,
    /// The trained ados, road users first.
    pub(super) frozen: Vec<Frozen>,
    /// Turns of the placed ados, by the actions of the ado that gives them.
    pub(super) turns: Vec<Turn>,
    /// Triggers of the steps of each agent's plan.
    pub whens: Vec<Arc<[Option<Monitor>]>>,
    /// Formulas of the storyboard's conditions.
    pub(super) story_formulas: Vec<Monitor>,
    pub(crate) axes: Vec<Axis>,
    pub(crate) spaces: Spaces,
}

impl DriveLayout {
    pub(super) fn new(spec: DriveSpec) -> Result<DriveLayout, SceneError> {
        let egos: Vec<usize> = spec.egos().collect();
        let [ego] = egos[..] else {
            return Err(SceneError::Egos { count: egos.len() });
        };
        let schema = schema_of(&spec)?;
        let derived = spec
            .derived
            .iter()
            .map(|derived| {
                derived
                    .expr
                    .bind(&schema, &spec.constants)
                    .map_err(|source| SceneError::Derived {
                        name: derived.signal.name.clone(),
                        source: Box::new(source),
                    })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let observed =
            Observation::bind(&spec.observe, &schema).map_err(|name| SceneError::Observed {
                name: name.to_owned(),
            })?;
        // Joint actions are numbers in mixed radix, and the first ado is the
        // lowest digit. `DriveScene::decide` reads them in the same order.
        let (mut actions, mut neutral) = (1, 0);
        for (_, set, set_neutral) in spec.action_sets() {
            neutral += set_neutral * actions;
            actions *= set.len();
        }
        let frozen = frozen(&spec)?;
        let whens = spec
            .agents
            .iter()
            .map(|agent| whens(&spec, &schema, agent))
            .collect::<Result<_, _>>()?;
        let story_formulas = story_formulas(&spec, &schema)?;
        Ok(DriveLayout {
            frozen,
            turns: turns(&spec),
            whens,
            story_formulas,
            network: Arc::new(spec.network()?),
            ego,
            schema: Arc::new(schema),
            sources: spec
                .published()
                .into_iter()
                .map(|offer| offer.source)
                .collect(),
            derived,
            axes: spec.axes(),
            spaces: Spaces {
                observation: observed.len(),
                actions,
                neutral,
                parts: parts(&spec),
            },
            observed,
            spec: Arc::new(spec),
        })
    }
}

/// Binds the triggers of an agent's plan: each must have been true once.
fn whens(
    spec: &DriveSpec,
    schema: &Schema,
    agent: &Agent,
) -> Result<Arc<[Option<Monitor>]>, SceneError> {
    let bind = |when: &Formula| {
        // A monitor rates a formula at its first sample. `eventually` makes
        // this: true at some sample since the step began to wait.
        let once = format!("eventually ({when})").parse::<Formula>();
        let monitor =
            once.and_then(|once| once.bind_with(schema, &spec.formulas, &Settings::default()));
        monitor.map_err(|source| SceneError::When {
            name: agent.name.clone(),
            source: Box::new(source),
        })
    };
    let steps = agent.plan().map_or(&[][..], |plan| plan.steps());
    let bound = steps
        .iter()
        .map(|step| step.when.as_ref().map(bind).transpose());
    bound.collect()
}

/// Binds the formulas of the storyboard's conditions.
fn story_formulas(spec: &DriveSpec, schema: &Schema) -> Result<Vec<Monitor>, SceneError> {
    let formulas = spec.story.iter().flat_map(|story| story.formulas());
    let bound = formulas.map(|formula| {
        let parsed = formula.text.parse::<Formula>();
        let monitor =
            parsed.and_then(|it| it.bind_with(schema, &spec.formulas, &Settings::default()));
        monitor.map_err(|source| SceneError::Condition {
            source: Box::new(source),
        })
    });
    bound.collect()
}

/// Returns the ados' shares of a joint decision, in the order of its digits.
fn parts(spec: &DriveSpec) -> Vec<PartSpaces> {
    let parts = spec.action_sets().map(|(name, set, neutral)| {
        let own = spec.own_observe.get(name);
        // An ado without a list of its own observes all that the world lists.
        let sees = |signal: &String| own.is_none_or(|own| own.contains(signal));
        let all = spec.observe.iter().enumerate();
        let observed = all.filter(|(_, observed)| sees(&observed.name));
        PartSpaces {
            name: name.to_owned(),
            actions: set.len(),
            neutral,
            observed: observed.map(|(i, _)| i).collect(),
        }
    });
    parts.collect()
}

/// Returns the trained ados of a spec, bound to it.
fn frozen(spec: &DriveSpec) -> Result<Vec<Frozen>, SceneError> {
    let bound = spec.trained().map(|(name, trained)| {
        trained
            .bind(spec, name)
            .map_err(|source| SceneError::Trained {
                name: name.to_owned(),
                source: Box::new(source),
            })
    });
    bound.collect()
}

impl DriveLayout {
    /// Returns the road data that the ego receives before its first episode.
    pub fn briefing(&self) -> Briefing {
        let road = &self.spec.road;
        let program = self.spec.ego.controller.program();
        Briefing {
            sample_s: self.spec.clock.sample_s,
            lag_s: self.spec.ego.lag_s,
            speed_limit_mps: road.speed_limit_mps(),
            road: RoadGeometry {
                lanes: road.lanes(),
                lane_width_m: road.lane_width_m(),
                pieces: self.network.main().pieces(),
            },
            parameters: program.map_or_else(BTreeMap::new, |it| it.parameters.clone()),
        }
    }
}
