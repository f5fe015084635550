//! Identification of an ego, seen from outside, as a member of a family.
//!
//! Some runs of the ego are recorded under held random actions of the ado. The recordings
//! hold position and speed only, and nothing internal to the ego is used.
//! Members of the family drive the same starts under the same actions in the simulator.
//! Cross-entropy search and Gauss-Newton steps minimize the distance to the recordings.
//!
//! The residual is the root mean square distance between ego and member over all samples
//! of all runs, in m. A speed difference of 1 m/s counts like 1 m.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::ego_recording::{RecordedRuns, deviations, noise_m, record};
use crate::experiment::Watch;
use crate::seed;
use crate::sim::PlantKind;
use crate::stats::{CrossEntropySearch, Fit, cost, descend};
use crate::world::{DriveScenario, EgoSample, Family, Scenario};

/// Number of independent fits, which show if they agree.
const REFITS: u64 = 3;
/// Share of the nominal residual up to which a member describes an ego.
///
/// It applies to members that do not explain the ego.
const DESCRIBES_SHARE: f64 = 0.5;
/// Distance from an ego, beyond its own noise, within which a member explains it.
///
/// It is about the depth of a violation between two cars.
const CLOSE_M: f64 = 0.1;
/// Change of the residual over a quantity's range from which it is observable.
const SHOWS_M: f64 = 0.05;
/// Share of the residual that has the same effect, if it is more.
const SHOWS_SHARE: f64 = 0.05;

/// Request to identify an ego within a family.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct IdentifyRequest<'a> {
    /// World with the family, which is the model.
    pub world: &'a Scenario,
    /// World with the ego under test, which is only run.
    pub ego: &'a Scenario,
    /// Number of starts to record from.
    pub runs: usize,
    /// Largest number of runs of the ego. `None`: as many as the starts require.
    ///
    /// The first start is run twice, and with noise every start is.
    pub at_most: Option<u64>,
    /// Seed of the runs and of the search.
    pub seed: u64,
    /// Quantities that stay nominal, as if the family did not vary them.
    pub fixed: &'a [String],
}

impl<'a> IdentifyRequest<'a> {
    /// Returns a request with seed 0, no limit of runs and every quantity free.
    pub fn new(world: &'a Scenario, ego: &'a Scenario, runs: usize) -> IdentifyRequest<'a> {
        IdentifyRequest {
            world,
            ego,
            runs,
            at_most: None,
            seed: 0,
            fixed: &[],
        }
    }

    /// Limits the runs of the ego.
    pub fn at_most(self, runs: u64) -> IdentifyRequest<'a> {
        IdentifyRequest {
            at_most: Some(runs),
            ..self
        }
    }

    /// Sets the seed.
    pub fn seed(self, seed: u64) -> IdentifyRequest<'a> {
        IdentifyRequest { seed, ..self }
    }

    /// Sets the quantities that stay nominal.
    pub fn fixed(self, fixed: &'a [String]) -> IdentifyRequest<'a> {
        IdentifyRequest { fixed, ..self }
    }
}

/// Identified member and the confidence in it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Identified {
    /// Nearest member. Quantities that are not observable are nominal.
    pub member: EgoSample,
    /// Standard deviation of each quantity over independent fits.
    pub spread: Vec<f64>,
    /// Whether each quantity is not observable in the runs.
    pub hidden: Vec<bool>,
    /// Residual of the member, m.
    pub residual_m: f64,
    /// Residual of the nominal ego, m.
    pub nominal_residual_m: f64,
    /// Influence of the ego's noise on the recorded runs, m. 0 without noise.
    pub noise_m: f64,
    /// Residuals of all independent fits, m.
    pub refits_m: Vec<f64>,
    /// Recorded runs of the ego.
    pub recorded: u64,
    /// Simulated runs of members.
    pub simulations: u64,
}

impl Identified {
    /// Returns whether the member follows the ego about as closely as noise allows.
    pub fn explains(&self) -> bool {
        self.residual_m <= self.bound_m()
    }

    /// Returns the parameters for a conditional ado, with their origin.
    ///
    /// They are those of the member, or nominal if the member does not describe the ego
    /// ([`describes`]).
    pub fn context(&self, family: &Family) -> (EgoSample, &'static str) {
        if describes(self.explains(), self.residual_m, self.nominal_residual_m) {
            (self.member.clone(), "identified")
        } else {
            (family.nominal(self.member.plant), "nominal")
        }
    }

    /// Returns the residual up to which a member explains the ego, m.
    pub fn bound_m(&self) -> f64 {
        bound_m(self.noise_m)
    }
}

/// Returns the residual up to which a member explains an ego with this noise, m.
fn bound_m(noise_m: f64) -> f64 {
    CLOSE_M + noise_m
}

/// Returns whether a member describes an ego.
///
/// It explains the ego, or its residual is at most half the nominal residual.
/// The nearest member may be far from an ego outside the family. An ado that is
/// conditioned on such a member does worse than with nominal parameters.
pub fn describes(explains: bool, residual_m: f64, nominal_residual_m: f64) -> bool {
    explains || residual_m <= DESCRIBES_SHARE * nominal_residual_m
}

/// Error of an identification.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The world has no family.
    #[error("`{world}` names no family of egos")]
    NoFamily {
        /// Name of the world.
        world: String,
    },
    /// A quantity to be kept nominal is not in the family.
    #[error("the family does not vary `{name}`; it varies {known}")]
    NotVaried {
        /// Name of the quantity.
        name: String,
        /// All quantities of the family.
        known: String,
    },
    /// No quantity is left to fit.
    #[error("every quantity of the family is left out: nothing is fitted")]
    NothingToFit,
    /// The ego failed in every run.
    #[error("the ego failed in each of {runs} runs: nothing was recorded")]
    NoRuns {
        /// Number of attempted runs.
        runs: usize,
    },
}

/// Fits the family to recorded runs of an ego. `None`: stopped from outside.
///
/// Equal requests give equal results on any number of threads.
///
/// # Errors
/// Returns an error without a family, without free quantities, or without recordings.
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
    let model = world.drive().ok_or_else(no_family)?;
    let ego = request.ego.drive().ok_or_else(no_family)?;
    let plant = ego.spec().plant;
    let most = request.at_most;
    let recorded = record(ego, (request.runs, most, request.seed), watch);
    if watch.stopped() {
        return Ok(None);
    }
    if recorded.recordings.is_empty() {
        let runs = request.runs;
        return Err(IdentifyError::NoRuns { runs });
    }
    let lab = Lab {
        model,
        family,
        recorded: &recorded,
        watch,
        simulations: AtomicU64::new(0),
    };
    let total = REFITS;
    watch.phase("fitting the family of egos");
    let mut fits: Vec<Fit> = Vec::new();
    for refit in 0..total {
        fits.push(lab.fit(&free, plant, request.seed, refit));
        (watch.progress)(refit + 1, total);
    }
    let concluded = lab.conclude(&free, plant, &fits);
    // A stopped measurement returns no deviations, so the conclusion is meaningless.
    Ok((!watch.stopped()).then_some(concluded))
}

/// Returns the positions of the fitted quantities.
fn free(family: &Family, fixed: &[String]) -> Result<Vec<usize>, IdentifyError> {
    let names: Vec<&str> = family.quantities.iter().map(|q| q.varied.name()).collect();
    if let Some(name) = fixed.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(IdentifyError::NotVaried {
            name: name.clone(),
            known: names.join(", "),
        });
    }
    let quantities = family.quantities.iter().enumerate();
    // Runs are compared by their mean, which contains no information on noise.
    let free = quantities
        .filter(|(_, q)| !q.varied.is_noise() && !fixed.iter().any(|name| name == q.varied.name()));
    let free: Vec<usize> = free.map(|(i, _)| i).collect();
    if free.is_empty() {
        Err(IdentifyError::NothingToFit)
    } else {
        Ok(free)
    }
}

/// Recordings, with the members to be tried on them.
struct Lab<'a> {
    model: DriveScenario<'a>,
    family: &'a Family,
    recorded: &'a RecordedRuns,
    watch: &'a Watch<'a>,
    simulations: AtomicU64,
}

impl Lab<'_> {
    /// Runs one independent fit from the nominal ego.
    ///
    /// The kinematic plant is about ten times faster and finds the region. On another plant
    /// the descent continues there.
    /// If the ego is still unexplained, a second search starts nearby. Its centre is the
    /// nominal ego if that fits better. Otherwise it is the present fit, if its residual is
    /// at most half the nominal residual.
    fn fit(&self, free: &[usize], plant: PlantKind, seed: u64, refit: u64) -> Fit {
        let mut dice = seed::generator("identify", &[seed, refit]);
        let coarse = |points: &[Vec<f64>]| self.measure(free, PlantKind::Kinematic, points);
        let costs = |points: &[Vec<f64>]| coarse(points).iter().map(|d| cost(d)).collect();
        let nominal = free.iter().map(|&i| self.family.quantities[i].unit());
        let nominal: Vec<f64> = nominal.collect();
        let mut found = CrossEntropySearch::WIDE.run(nominal.clone(), &mut dice, &costs);
        let smooth: Vec<usize> = (0..free.len())
            .filter(|&d| self.family.quantities[free[d]].step == 0.0)
            .collect();
        found = descend(found.point, &smooth, &coarse);
        // Quantities in whole steps have no slope, so every value is tried.
        for (d, &i) in free.iter().enumerate() {
            for unit in self.family.quantities[i].steps() {
                let mut point = found.point.clone();
                point[d] = unit;
                let other = descend(point, &smooth, &coarse);
                if other.cost < found.cost {
                    found = other;
                }
            }
        }
        let fine = |points: &[Vec<f64>]| self.measure(free, plant, points);
        if plant != PlantKind::Kinematic {
            found = descend(found.point, &smooth, &fine);
        }
        if found.cost <= self.bound_m() {
            return found;
        }
        // Some quantities act in whole samples on a switching controller, so the cost has
        // flat steps without slopes. The search restarts nearby if that is promising.
        let costs = |points: &[Vec<f64>]| fine(points).iter().map(|d| cost(d)).collect();
        // The decision needs the nominal residual on the real plant, not on the kinematic plant.
        let nominal_cost = self.residual_m(&self.family.nominal(plant));
        let centre = if nominal_cost < found.cost {
            nominal
        } else if describes(false, found.cost, nominal_cost) {
            found.point.clone()
        } else {
            return found;
        };
        let near = CrossEntropySearch::NEAR.run(centre, &mut dice, &costs);
        let near = descend(near.point, &smooth, &fine);
        if near.cost < found.cost { near } else { found }
    }

    fn bound_m(&self) -> f64 {
        bound_m(noise_m(&self.recorded.recordings))
    }

    /// Returns the deviations at points of the free quantities, scaled to −1 ..= 1.
    fn measure(&self, free: &[usize], plant: PlantKind, points: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let members = points.par_iter();
        members
            .map(|point| self.deviations(&self.member(free, plant, point)))
            .collect()
    }

    fn member(&self, free: &[usize], plant: PlantKind, point: &[f64]) -> EgoSample {
        let mut member = self.family.nominal(plant);
        for (&i, u) in free.iter().zip(point) {
            let quantity = &self.family.quantities[i];
            member.values[i] = quantity.at(*u);
        }
        member
    }

    fn residual_m(&self, member: &EgoSample) -> f64 {
        cost(&self.deviations(member))
    }

    fn deviations(&self, member: &EgoSample) -> Vec<f64> {
        let mut variant = self.family.variant(member);
        // Members drive without noise, as they do on average.
        variant.sensors.position_sd_m = 0.0;
        variant.sensors.speed_sd_mps = 0.0;
        if self.watch.stopped() {
            // `identify` discards the result after a stop.
            return Vec::new();
        }
        let recordings = &self.recorded.recordings;
        let runs = recordings.len() as u64;
        self.simulations.fetch_add(runs, Ordering::Relaxed);
        let mut scene = self.model.scene_of(&variant);
        deviations(&mut *scene, self.model.ego_columns(), recordings)
    }

    fn conclude(&self, free: &[usize], plant: PlantKind, fits: &[Fit]) -> Identified {
        let members: Vec<EgoSample> = fits
            .iter()
            .map(|fit| self.member(free, plant, &fit.point))
            .collect();
        let best = (0..fits.len()).min_by(|&a, &b| fits[a].cost.total_cmp(&fits[b].cost));
        let best = best.unwrap_or(0);
        let mut member = members[best].clone();
        let mut hidden = vec![true; member.values.len()];
        for &i in free {
            hidden[i] = self.hide(&mut member, i, fits[best].cost);
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
            noise_m: noise_m(&self.recorded.recordings),
            refits_m: fits.iter().map(|fit| fit.cost).collect(),
            recorded: self.recorded.runs,
            simulations: self.simulations.load(Ordering::Relaxed),
            member,
        }
    }

    /// Sets a quantity to nominal if its whole range fits about as well.
    fn hide(&self, member: &mut EgoSample, i: usize, cost_m: f64) -> bool {
        let quantity = &self.family.quantities[i];
        let bound_m = self.bound_m();
        let allowed_m = cost_m + SHOWS_M.max(SHOWS_SHARE * cost_m);
        // A member that explains the ego must still do so afterwards.
        let allowed_m = if cost_m <= bound_m {
            allowed_m.min(bound_m)
        } else {
            allowed_m
        };
        let mut other = member.clone();
        // The nominal value comes last, because the last value is kept.
        let hidden = [quantity.lo, quantity.hi, quantity.nominal]
            .into_iter()
            .all(|value| {
                other.values[i] = value;
                self.residual_m(&other) <= allowed_m
            });
        if hidden {
            *member = other;
        }
        hidden
    }
}

fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt()
}
