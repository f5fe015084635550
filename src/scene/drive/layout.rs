//! What of a driving scene does not move: a spec, bound to its signals.

use std::sync::Arc;

use super::course::{Course, CourseError};
use super::signals::Source;
use super::spec::{DriveSpec, EgoDrive, Trained};
use super::trained::{Frozen, TrainedError};
use crate::ego::{Briefing, RoadGeometry};
use crate::rl::Spaces;
use crate::scene::Axis;
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};

/// What all scenes of a world share.
#[derive(Clone)]
pub(super) struct Layout {
    pub(super) spec: DriveSpec,
    pub(super) course: Course,
    pub(super) ego: usize,
    pub(super) ego_drive: EgoDrive,
    pub(super) schema: Arc<Schema>,
    pub(super) sources: Vec<Source>,
    pub(super) derived: Vec<BoundExpr>,
    pub(super) observed: Vec<(usize, f64, f64)>,
    /// The trained ados, road users first.
    pub(super) frozen: Vec<Frozen>,
    pub(super) axes: Vec<Axis>,
    pub(super) spaces: Spaces,
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
    pub(super) fn new(spec: DriveSpec) -> Result<Layout, SceneError> {
        let egos: Vec<(usize, &EgoDrive)> = spec.egos().collect();
        let [(ego, ego_drive)] = egos[..] else {
            return Err(SceneError::Egos { count: egos.len() });
        };
        let ego_drive = ego_drive.clone();
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
            ego_drive,
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
    let bind = |(name, trained): (&str, &Trained)| {
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
    pub(super) fn briefing(&self) -> Briefing {
        let road = &self.spec.road;
        Briefing {
            sample_s: self.spec.clock.sample_s,
            speed_limit_mps: road.speed_limit_mps(),
            road: RoadGeometry {
                lanes: road.lanes(),
                lane_width_m: road.lane_width_m(),
                pieces: self.course.pieces(),
            },
        }
    }
}

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
