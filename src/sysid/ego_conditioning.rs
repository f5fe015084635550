//! Which policy meets an ego: a conditional ado is told the ego's parameters.

use std::num::NonZeroU64;

use super::error::ConditioningError;
use super::identified_ego::{IdentifiedAs, identified};
use crate::adversary::other_members;
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::Policy;
use crate::run_dir::RunDir;
use crate::sim::PlantKind;
use crate::world::TrainingEgos;

/// Runs of an ego from which it is identified, where more are left to learn it from.
pub const RECORDED_RUNS: u64 = 10;

/// With fewer runs there is nothing to fit.
pub const LEAST_RUNS: u64 = 10;

/// Whence a conditional ado knows the ego it meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContextSource {
    /// It takes every ego for the nominal one.
    Nominal,
    /// It is told the parameters in the world file.
    True,
    /// Each ego is identified from so many runs of it.
    Identified(u64),
}

/// An ado, ready to meet one ego.
pub struct ConditionedAdo {
    /// Its policy; a conditional one is told what it takes the ego for.
    pub policy: Box<dyn Policy>,
    /// The same told of other egos, for [`crate::adversary::BestOfN`].
    pub others: Vec<Box<dyn Policy>>,
    /// What it was told, as rows have it; `None`: it is not told anything.
    pub told: Option<&'static str>,
    /// The same told of the nominal ego, where it was told of another one.
    pub untold: Option<Box<dyn Policy>>,
    /// What the runs of the ego showed, if it was identified.
    pub identified: Option<IdentifiedAs>,
}

impl ContextSource {
    /// What the ado of a run is told of egos that it may learn from so many `runs`
    /// of each; `None`: it is told nothing.
    ///
    /// # Errors
    /// The run has no policy, or its file is damaged.
    pub fn of(
        run: &RunDir,
        runs: Option<NonZeroU64>,
    ) -> Result<Option<ContextSource>, ConditioningError> {
        run.policy_bundle()?;
        Ok(
            (run.manifest().against == TrainingEgos::Conditioned).then_some(
                match runs.map(NonZeroU64::get) {
                    None => ContextSource::Nominal,
                    Some(few) if few < RECORDED_RUNS + LEAST_RUNS => ContextSource::Identified(few),
                    _ => ContextSource::Identified(RECORDED_RUNS),
                },
            ),
        )
    }

    /// Runs of each ego that go into identifying it.
    pub fn runs(&self) -> u64 {
        match self {
            ContextSource::Identified(runs) => *runs,
            ContextSource::Nominal | ContextSource::True => 0,
        }
    }
}

/// The ado of a run, told of an ego what `source` says.
///
/// `source` is `None` for an ado that is not conditional. `seed` is that of the
/// runs with which an ego is identified.
///
/// # Errors
/// The run has no policy, or the ego cannot be identified.
pub fn conditioned(
    run: &RunDir,
    source: Option<&ContextSource>,
    ego: &EgoUnderTest,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<ConditionedAdo, ConditioningError> {
    let Some(source) = source else {
        return Ok(ConditionedAdo {
            policy: run.policy()?,
            others: Vec::new(),
            told: None,
            untold: None,
            identified: None,
        });
    };
    let world = run.world()?;
    let (Some(family), Some(spec)) = (world.family(), ego.scenario().drive()) else {
        return Err(ConditioningError::NoFamily);
    };
    let nominal = family.nominal(spec.plant);
    let found = match *source {
        ContextSource::Identified(runs) => identified(run, &world, ego, (runs, seed), watch)?,
        ContextSource::Nominal | ContextSource::True => None,
    };
    let (member, told) = match (source, &found) {
        (ContextSource::True, _) => match family.member_of(spec) {
            Ok(member) => (member, "true"),
            Err(error) => {
                let name = ego.name();
                watch.note(&format!("`{name}`: {error}; told the nominal values"));
                (nominal.clone(), "nominal")
            }
        },
        (_, Some(found)) => found.told(family, plant_of(ego)?)?,
        // Nothing is known of it, or stopped: no row will be finished then either.
        (_, None) => (nominal.clone(), "nominal"),
    };
    if let Some(found) = &found {
        say_stranger(ego, told, found, watch);
    }
    let untold = match told {
        "identified" => Some(run.policy_told(&nominal)?),
        _ => None,
    };
    Ok(ConditionedAdo {
        policy: run.policy_told(&member)?,
        others: other_members(run, family, spec.plant)?,
        told: Some(told),
        untold,
        identified: found,
    })
}

fn plant_of(ego: &EgoUnderTest) -> Result<PlantKind, ConditioningError> {
    let plant = ego.scenario().plant().plant();
    plant.ok_or(ConditioningError::NoPlant)
}

/// Says of an ego that no member explains what the ado is told instead.
fn say_stranger(ego: &EgoUnderTest, told: &str, found: &IdentifiedAs, watch: &Watch<'_>) {
    if found.explains {
        return;
    }
    let what = match told {
        "identified" => "the ado is told its nearest member",
        _ => "which says nothing of it: the ado is told the nominal values",
    };
    watch.note(&format!(
        "`{}` is none of the family, its nearest member is {:.2} m away; {what}",
        ego.name(),
        found.residual_m
    ));
}
