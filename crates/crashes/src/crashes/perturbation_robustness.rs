//! Robustness of a counterexample to small perturbations.
//!
//! A failure that needs the last millimetre of its start, or a particular plant, is an
//! accident of the simulation. This module plays the recorded actions again in open loop,
//! with a single perturbation at a time. It reports the share of replays in which the ego
//! still fails, by the usual definition (`Verdict::is_success`).

use rayon::prelude::*;

use super::reruns::{KEEP_RUNS, Reruns};
use super::root_cause::no_answer;
use crate::experiment::Watch;
use crate::run_dir::{Persistence, Variation};
use crate::scene::Start;
use crate::scene::drive::Sensors;
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Episode, NoisyStart, Replay};
use crate::world::{Change, DriveScenario, Scenario};

/// Perturbation of a length or a speed of the start, in m and m/s.
pub(crate) const START: f64 = 0.1;
/// Factors on the road's friction.
pub(crate) const FRICTION: [f64; 2] = [0.9, 1.1];
/// Bounds of a road's friction.
const FRICTIONS: (f64, f64) = (0.01, 2.0);

/// Replays an episode of `scenario` with a single perturbation at a time.
///
/// Perturbations are the other plant, half the sample time, friction × 0.9 and × 1.1,
/// every axis of the start ± 0.1 m or m/s, and sensors that are later by a sample. Starts
/// may leave their ranges, but no speed falls below 0. After the recorded actions the ado
/// takes its neutral action. A replay in which an ado breaks a rule gives no answer.
///
/// Returns `None` if the world is not driven, or if its ego is not deterministic and the
/// world has no `repeats`.
pub fn persistence(scenario: &Scenario, episode: &Episode) -> Option<Persistence> {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    persistence_within(&reruns, episode)
}

/// Returns the number of questions that the persistence of an episode needs.
pub(super) fn variations(scenario: &Scenario, episode: &Episode) -> usize {
    varied(scenario, episode).map_or(0, |varied| varied.len())
}

/// Computes the persistence within the runs of `reruns`.
pub(super) fn persistence_within(reruns: &Reruns<'_>, episode: &Episode) -> Option<Persistence> {
    let varied = varied(reruns.scenario(), episode)?;
    // All variations or none, because a share of some would not be comparable.
    reruns.ask(varied.len(), 0).ok()?;
    // The parallel iterator is indexed, so labels keep this order on any number of
    // threads.
    let variations = varied.into_par_iter().map(|(name, world, start)| {
        let mut ado = Replay::then(&episode.actions, world.world().spaces().neutral);
        let from = NoisyStart {
            start: &start,
            noise: episode.noise,
        };
        let replayed = reruns.played(&world, from, &mut ado, Aftermath::Skip);
        let no_answer = no_answer(&world, replayed.verdict);
        Variation {
            name,
            fails: no_answer.is_none().then(|| replayed.verdict.is_success()),
            no_answer,
        }
    });
    Some(Persistence {
        variations: variations.collect(),
    })
}

type PerturbedStart = (String, Scenario, Start);

/// Returns all perturbed worlds and starts. `None` if the world is not driven.
fn varied(scenario: &Scenario, episode: &Episode) -> Option<Vec<PerturbedStart>> {
    let mut varied = worlds(scenario.drive()?, episode);
    varied.extend(starts(scenario, &episode.start));
    Some(varied)
}

/// Returns the perturbed worlds, each with the same start.
fn worlds(scenario: DriveScenario<'_>, episode: &Episode) -> Vec<PerturbedStart> {
    // A start may draw friction and sensors, and factors apply to the drawn values.
    let begun = scenario.world().at_start(&episode.start);
    let spec = begun.spec();
    let (plant, sample_s, friction) = (spec.plant, spec.clock.sample_s, spec.road.friction());
    let other = match plant {
        PlantKind::Rigid => PlantKind::Kinematic,
        PlantKind::Kinematic => PlantKind::Rigid,
    };
    let name = |plant: PlantKind| <&str>::from(plant);
    let mut worlds = vec![(format!("the {} plant", name(other)), scenario.on(other))];
    // A failure that exists at a single sample time is an artefact of the simulation.
    let halved = scenario.sampled_every(0.5 * sample_s, spec.clock.substeps);
    worlds.extend(halved.map(|world| ("half the sample time".to_owned(), world)));
    for factor in FRICTION {
        let change = Change {
            friction: Some((factor * friction).clamp(FRICTIONS.0, FRICTIONS.1)),
            ..Change::default()
        };
        // A world that refuses the change has fewer variations.
        let changed = scenario.with(&change).ok();
        worlds.extend(changed.map(|world| (format!("friction × {factor}"), world)));
    }
    let later = Change {
        sensors: Some(Sensors {
            // One sample is the least delay that changes a reading of the ego.
            delay_s: spec.sensors.delay_s + sample_s,
            ..spec.sensors
        }),
        ..Change::default()
    };
    let delayed = scenario.with(&later).ok();
    worlds.extend(delayed.map(|world| ("sensors one sample later".to_owned(), world)));
    let start = &episode.start;
    let all = worlds.into_iter();
    all.map(|(name, world)| (name, world, start.clone()))
        .collect()
}

/// Returns the perturbed starts, each in the same world.
fn starts(scenario: &Scenario, start: &Start) -> Vec<PerturbedStart> {
    let mut all = Vec::new();
    for (n, axis) in scenario.axes().iter().enumerate() {
        // Perturbations of other units, such as phases, have no common size.
        if !["m", "m/s"].contains(&axis.unit) {
            continue;
        }
        for by in [-START, START] {
            let mut varied = start.clone();
            varied.0[n] += by;
            // A perturbed speed must not reverse a vehicle that had no reverse speed.
            if axis.unit == "m/s" && start.0[n] >= 0.0 {
                varied.0[n] = varied.0[n].max(0.0);
            }
            let name = format!("{} {by:+} {}", axis.name, axis.unit);
            all.push((name, scenario.clone(), varied));
        }
    }
    all
}
