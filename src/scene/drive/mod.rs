//! The driving scene, assembled from data: a road, an ego, ados and traffic.
//!
//! There is no scene type per scenario. Whatever a world file describes is a
//! [`DriveSpec`], and [`DriveScene`] moves it on either plant.

mod actions;
mod bounds;
mod course;
mod light;
mod motion;
mod perceiving;
mod reading;
mod road;
mod script;
mod sensors;
mod signals;
mod spec;
mod staging;
mod steering;
mod trained;
mod variant;

use std::sync::Arc;

pub use actions::{Actions, Grid, Lateral, Turn};
pub use bounds::Bounds;
pub use course::{Course, CourseError, OnRoad, Piece};
pub use light::{Light, LightDrive, Schedule};
pub use motion::DriveScene;
pub use road::Road;
pub use script::Script;
pub use sensors::Sensors;
pub use signals::{SignalSource, TTC_CAP_S, current_name};
pub use spec::{
    Agent, ControllerFactory, Drive, DriveSpec, EgoController, EgoDrive, Range, StartPlace,
};
pub use trained::{TrainedAdo, TrainedError};
pub use variant::EgoVariant;

use super::Axis;
use crate::ego::{Briefing, RoadGeometry};
use crate::rl::Spaces;
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};
use signals::Source;
use trained::Frozen;

/// A driving scene could not be assembled.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The signals clash.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A derived signal does not bind.
    #[error("the signal `{name}`: {source}")]
    Derived {
        /// Its name.
        name: String,
        /// Why.
        source: Box<StlError>,
    },
    /// An observed signal is not published.
    #[error("`{name}` is observed but not published")]
    Observed {
        /// Its name.
        name: String,
    },
    /// There must be exactly one ego.
    #[error("a driving scene has exactly one ego, not {count}")]
    Egos {
        /// How many there are.
        count: usize,
    },
    /// A trained ado cannot act in it.
    #[error("the trained ado `{name}`: {source}")]
    Trained {
        /// Its name here.
        name: String,
        /// Why.
        source: Box<TrainedError>,
    },
    /// The road cannot be laid.
    #[error(transparent)]
    Course(#[from] CourseError),
}

/// An assembled driving world: makes scenes that share everything fixed.
#[derive(Clone)]
pub struct DriveWorld(Arc<Layout>);

#[derive(Clone)]
struct Layout {
    spec: DriveSpec,
    course: Course,
    ego: usize,
    schema: Arc<Schema>,
    sources: Vec<Source>,
    derived: Vec<BoundExpr>,
    observed: Vec<(usize, f64, f64)>,
    /// The trained ados, road users first.
    frozen: Vec<Frozen>,
    axes: Vec<Axis>,
    spaces: Spaces,
}

/// The schema of a spec's traces: published signals, then derived ones.
///
/// # Errors
/// Two signals of one name.
pub fn schema_of(spec: &DriveSpec) -> Result<Schema, SchemaError> {
    let published = spec.published().into_iter().map(|offer| offer.signal);
    let derived = spec.derived.iter().map(|derived| derived.signal.clone());
    Schema::new(spec.clock.sample_s, published.chain(derived))
}

impl Layout {
    fn new(spec: DriveSpec) -> Result<Layout, SceneError> {
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
        let observed = spec
            .observe
            .iter()
            .map(|observed| match schema.position(&observed.name) {
                Some(position) => Ok((position, observed.mid, 1.0 / observed.half)),
                None => Err(SceneError::Observed {
                    name: observed.name.clone(),
                }),
            })
            .collect::<Result<Vec<_>, _>>()?;
        let (mut actions, mut neutral) = (1, 0);
        for (_, set, set_neutral) in spec.action_sets() {
            neutral += set_neutral * actions;
            actions *= set.len();
        }
        let frozen = frozen(&spec)?;
        Ok(Layout {
            frozen,
            course: spec.road.course()?,
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
            },
            observed,
            spec,
        })
    }
}

/// The trained ados of a spec, bound to it.
fn frozen(spec: &DriveSpec) -> Result<Vec<Frozen>, SceneError> {
    let bind = |(name, trained): (&str, &TrainedAdo)| {
        trained
            .bind(spec, name)
            .map_err(|source| SceneError::Trained {
                name: name.to_owned(),
                source: Box::new(source),
            })
    };
    spec.trained().map(bind).collect()
}

impl Layout {
    /// What the ego is told of the road before its first episode.
    fn briefing(&self) -> Briefing {
        let road = &self.spec.road;
        Briefing {
            sample_s: self.spec.clock.sample_s,
            lag_s: self.spec.ego.lag_s,
            speed_limit_mps: road.speed_limit_mps(),
            road: RoadGeometry {
                lanes: road.lanes(),
                lane_width_m: road.lane_width_m(),
                pieces: self.course.pieces(),
            },
        }
    }
}

impl DriveWorld {
    /// Assembles a world.
    ///
    /// # Errors
    /// Signals that clash or do not bind; no ego or several.
    pub fn new(spec: DriveSpec) -> Result<DriveWorld, SceneError> {
        Layout::new(spec).map(|layout| DriveWorld(Arc::new(layout)))
    }

    /// What it was assembled from.
    pub fn spec(&self) -> &DriveSpec {
        &self.0.spec
    }

    /// The published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }

    /// A scene at rest, to be `reset`.
    pub fn scene(&self) -> DriveScene {
        DriveScene::new(Arc::clone(&self.0))
    }
}
