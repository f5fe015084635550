//! Identifying an ego seen only from outside as a member of a family.
//!
//! Some runs of the ego are recorded: where it was and how fast, while the ado
//! took held random actions. Members of the family then drive the same starts
//! under the same actions in the simulator, and cross-entropy search looks for
//! the one that stays nearest. Nothing of the ego's inside is used.
//!
//! The residual is the root of the mean, over all samples of all runs, of the
//! squared distance between the ego and the member, in m; a difference of
//! 1 m/s in speed counts like 1 m.

mod entropy;
mod record;

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use self::entropy::{Fit, Search};
use self::record::{Recording, noise_m, residual_m};
use super::Watch;
use crate::scenario::{Family, Member, Scenario};
use crate::seed;
use crate::sim::PlantKind;

/// Independent fits, to see whether they agree.
const REFITS: u64 = 3;
/// A member explains an ego that it follows as closely as this, on top of the
/// ego's own noise: about the depth of a violation between two cars.
const CLOSE_M: f64 = 0.1;
/// A quantity shows in the runs if its range moves the residual by this much,
const SHOWS_M: f64 = 0.05;
/// or by this share of it.
const SHOWS_SHARE: f64 = 0.2;

/// Whom to identify, in which family.
#[derive(Clone, Copy)]
pub struct IdentifyRequest<'a> {
    /// The world with its family: the model.
    pub world: &'a Scenario,
    /// The ego, which is only run.
    pub ego: &'a Scenario,
    /// Runs of it to record.
    pub runs: usize,
    /// Seed of the runs and of the search.
    pub seed: u64,
    /// Quantities that stay nominal, as if the family did not vary them.
    pub fixed: &'a [String],
}

/// The member found, and how far it is to be trusted.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// The nearest member; quantities that do not show are nominal.
    pub member: Member,
    /// Standard deviation of each quantity over independent fits.
    pub spread: Vec<f64>,
    /// Quantities that do not show in the runs.
    pub hidden: Vec<bool>,
    /// How far the member stays from the ego.
    pub residual_m: f64,
    /// How far the nominal ego stays from it.
    pub nominal_residual_m: f64,
    /// How far the ego stays from itself under other noise; 0 without any.
    pub noise_m: f64,
    /// The residuals of all independent fits.
    pub refits_m: Vec<f64>,
    /// Runs recorded of the ego.
    pub recorded: u64,
    /// Runs simulated of members.
    pub simulations: u64,
}

impl Identified {
    /// Whether the member follows the ego about as closely as noise allows.
    pub fn explains(&self) -> bool {
        self.residual_m <= self.bound_m()
    }

    /// The residual up to which a member explains the ego.
    pub fn bound_m(&self) -> f64 {
        CLOSE_M + self.noise_m
    }
}

/// An ego could not be identified.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The world has no family.
    #[error("`{world}` names no family of egos")]
    NoFamily {
        /// The world.
        world: String,
    },
    /// A quantity to be left nominal is not in the family.
    #[error("the family does not vary `{name}`; it varies {known}")]
    NotVaried {
        /// The quantity.
        name: String,
        /// All there are.
        known: String,
    },
    /// Nothing is left to fit.
    #[error("every quantity of the family is left out: nothing is fitted")]
    NothingToFit,
    /// The ego failed in every run.
    #[error("the ego failed in each of {runs} runs: nothing was recorded")]
    NoRuns {
        /// Runs tried.
        runs: usize,
    },
}

/// Fits the family to recorded runs of an ego. `None`: stopped from outside.
///
/// Equal requests give equal answers, on any number of threads.
///
/// # Errors
/// There is no family, nothing to fit, or nothing could be recorded.
pub fn identify(
    request: &IdentifyRequest<'_>,
    watch: &Watch<'_>,
) -> Result<Option<Identified>, IdentifyError> {
    let world = request.world;
    let no_family = || IdentifyError::NoFamily {
        world: world.name.clone(),
    };
    let family = world.family().ok_or_else(no_family)?;
    let free = free(family, request.fixed)?;
    let spec = request.ego.drive().ok_or_else(no_family)?;
    let recordings = record::record(request.ego, request.runs, request.seed);
    if recordings.is_empty() {
        let runs = request.runs;
        return Err(IdentifyError::NoRuns { runs });
    }
    let lab = Lab {
        world,
        family,
        recordings: &recordings,
        simulations: AtomicU64::new(0),
    };
    let total = REFITS;
    let mut fits: Vec<Fit> = Vec::new();
    for refit in 0..total {
        if watch.stopped() {
            return Ok(None);
        }
        fits.push(lab.fit(&free, spec.plant, request.seed, refit));
        (watch.progress)(refit + 1, total);
    }
    Ok(Some(lab.conclude(&free, spec.plant, &fits)))
}

/// Positions of the quantities that are fitted.
fn free(family: &Family, fixed: &[String]) -> Result<Vec<usize>, IdentifyError> {
    let names: Vec<&str> = family.quantities.iter().map(|q| q.varied.name()).collect();
    if let Some(name) = fixed.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(IdentifyError::NotVaried {
            name: name.clone(),
            known: names.join(", "),
        });
    }
    let quantities = family.quantities.iter().enumerate();
    // What an ego does on average tells nothing about noise.
    let free = quantities
        .filter(|(_, q)| !q.varied.is_noise() && !fixed.iter().any(|name| name == q.varied.name()));
    let free: Vec<usize> = free.map(|(i, _)| i).collect();
    match free.is_empty() {
        true => Err(IdentifyError::NothingToFit),
        false => Ok(free),
    }
}

/// The recordings, and members to be tried on them.
struct Lab<'a> {
    world: &'a Scenario,
    family: &'a Family,
    recordings: &'a [Recording],
    simulations: AtomicU64,
}

impl Lab<'_> {
    /// One independent fit.
    ///
    /// The kinematic plant, which is some ten times faster, finds the region;
    /// on another plant the search then goes on there.
    fn fit(&self, free: &[usize], plant: PlantKind, seed: u64, refit: u64) -> Fit {
        let mut dice = seed::generator("identify", &[seed, refit]);
        let coarse = |points: &[Vec<f64>]| self.costs(free, PlantKind::Kinematic, points);
        let found = Search::WIDE.run(vec![0.0; free.len()], &mut dice, &coarse);
        if plant == PlantKind::Kinematic {
            return found;
        }
        let fine = |points: &[Vec<f64>]| self.costs(free, plant, points);
        Search::NARROW.run(found.point, &mut dice, &fine)
    }

    /// Residuals of points of the free quantities, scaled to −1 ..= 1.
    fn costs(&self, free: &[usize], plant: PlantKind, points: &[Vec<f64>]) -> Vec<f64> {
        let members = points.par_iter();
        members
            .map(|point| self.residual_m(&self.member(free, plant, point)))
            .collect()
    }

    fn member(&self, free: &[usize], plant: PlantKind, point: &[f64]) -> Member {
        let mut member = self.family.nominal(plant);
        for (&i, u) in free.iter().zip(point) {
            let quantity = &self.family.quantities[i];
            let value = 0.5 * (quantity.lo + quantity.hi + u * (quantity.hi - quantity.lo));
            member.values[i] = quantity.fit(value);
        }
        member
    }

    fn residual_m(&self, member: &Member) -> f64 {
        let mut tuning = self.family.tuning(member);
        // Members drive as they would on average.
        tuning.sensors.position_sd_m = 0.0;
        tuning.sensors.speed_sd_mps = 0.0;
        let runs = self.recordings.len() as u64;
        self.simulations.fetch_add(runs, Ordering::Relaxed);
        match self.world.scene_of(&tuning) {
            Some(mut scene) => residual_m(&mut *scene, self.world, self.recordings),
            None => f64::INFINITY,
        }
    }

    fn conclude(&self, free: &[usize], plant: PlantKind, fits: &[Fit]) -> Identified {
        let members: Vec<Member> = fits
            .iter()
            .map(|fit| self.member(free, plant, &fit.point))
            .collect();
        let best = (0..fits.len()).min_by(|&a, &b| fits[a].cost.total_cmp(&fits[b].cost));
        let best = best.unwrap_or(0);
        let mut member = members[best].clone();
        let hidden: Vec<bool> = (0..member.values.len())
            .map(|i| !free.contains(&i) || self.is_hidden(&member, i, fits[best].cost))
            .collect();
        for (i, hidden) in hidden.iter().enumerate() {
            if *hidden {
                member.values[i] = self.family.quantities[i].nominal;
            }
        }
        let spread = (0..member.values.len()).map(|i| {
            let values: Vec<f64> = members.iter().map(|member| member.values[i]).collect();
            deviation(&values)
        });
        Identified {
            spread: spread.collect(),
            hidden,
            residual_m: self.residual_m(&member),
            nominal_residual_m: self.residual_m(&self.family.nominal(plant)),
            noise_m: noise_m(self.recordings),
            refits_m: fits.iter().map(|fit| fit.cost).collect(),
            recorded: 2 * self.recordings.len() as u64,
            simulations: self.simulations.load(Ordering::Relaxed),
            member,
        }
    }

    /// Whether either end of a quantity's range would do about as well.
    fn is_hidden(&self, member: &Member, i: usize, cost_m: f64) -> bool {
        let quantity = &self.family.quantities[i];
        let at = |value: f64| {
            let mut other = member.clone();
            other.values[i] = value;
            self.residual_m(&other)
        };
        let moved_m = at(quantity.lo).max(at(quantity.hi)) - cost_m;
        moved_m < SHOWS_M.max(SHOWS_SHARE * cost_m)
    }
}

fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt()
}
