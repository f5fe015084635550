//! Whether a counterexample is still one when something small is different.
//!
//! A failure that needs the last millimetre of its start, or one particular
//! plant, is an accident of the simulation. So the recorded actions are played
//! again, open loop, with one thing different at a time, and the share of the
//! replays in which the ego still fails is reported, by the same notion of
//! failing as everywhere ([`Verdict::is_success`]).

use rayon::prelude::*;

use super::reruns::{KEEP_RUNS, Reruns};
use crate::experiment::Watch;
use crate::rulebook::Verdict;
use crate::run_dir::{Persistence, Variation};
use crate::scene::Start;
use crate::scene::drive::Sensors;
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Episode, Replay};
use crate::world::{Change, Scenario};

/// By how much a length or a speed of the start differs, in m and m/s.
pub const START: f64 = 0.1;
/// By what the road's friction is multiplied.
pub const FRICTION: [f64; 2] = [0.9, 1.1];
/// What a road's friction may be.
const FRICTIONS: (f64, f64) = (0.01, 2.0);

/// Replays an episode of `scenario` with one thing different at a time: the
/// other plant, half the sample time, friction × 0.9 and × 1.1, every axis of
/// the start ± 0.1 m or m/s, and the ego's sensors one sample later.
///
/// Starts may so lie outside of their ranges, but no speed below 0. When the
/// recorded actions end, the last one is held. `None`: the world is not driven,
/// or its ego is not deterministic and the world names no `repeats`.
pub fn persistence(scenario: &Scenario, episode: &Episode) -> Option<Persistence> {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    persistence_within(&reruns, episode)
}

/// How many questions the persistence of an episode takes.
pub(super) fn variations(scenario: &Scenario, episode: &Episode) -> usize {
    let starts = starts(scenario, &episode.start).len();
    worlds(scenario, episode).map_or(0, |worlds| worlds.len() + starts)
}

/// The same with an ego that is asked about more than that.
pub(super) fn persistence_within(reruns: &Reruns<'_>, episode: &Episode) -> Option<Persistence> {
    let scenario = reruns.scenario();
    let mut varied = worlds(scenario, episode)?;
    varied.extend(starts(scenario, &episode.start));
    reruns.ask(varied.len(), 0).ok()?;
    let variations = varied.into_par_iter().map(|(name, world, start)| {
        let mut ado = Replay::holding(&episode.actions);
        let from = (&start, episode.noise);
        let replayed = reruns.played(&world, from, &mut ado, Aftermath::Skip);
        let ran = replayed.verdict != Verdict::Invalid;
        Variation {
            name,
            fails: ran.then(|| replayed.verdict.is_success()),
        }
    });
    Some(Persistence {
        variations: variations.collect(),
    })
}

type PerturbedStart = (String, Scenario, Start);

/// The same start in worlds that differ.
fn worlds(scenario: &Scenario, episode: &Episode) -> Option<Vec<PerturbedStart>> {
    let spec = scenario.drive()?;
    let (plant, sample_s, friction) = (spec.plant, spec.clock.sample_s, spec.road.friction());
    let other = match plant {
        PlantKind::Rigid => PlantKind::Kinematic,
        PlantKind::Kinematic => PlantKind::Rigid,
    };
    let name = |plant: PlantKind| <&str>::from(plant);
    let mut worlds = vec![(format!("the {} plant", name(other)), scenario.on(other))];
    let halved = scenario.sampled_every(0.5 * sample_s);
    worlds.extend(halved.map(|world| ("half the sample time".to_owned(), world)));
    for factor in FRICTION {
        let change = Change {
            friction: Some((factor * friction).clamp(FRICTIONS.0, FRICTIONS.1)),
            ..Change::default()
        };
        let changed = scenario.with(&change).ok();
        worlds.extend(changed.map(|world| (format!("friction × {factor}"), world)));
    }
    let later = Change {
        sensors: Some(Sensors {
            delay_s: spec.sensors.delay_s + sample_s,
            ..spec.sensors
        }),
        ..Change::default()
    };
    let later = scenario.with(&later).ok();
    worlds.extend(later.map(|world| ("sensors one sample later".to_owned(), world)));
    let start = &episode.start;
    let all = worlds.into_iter();
    Some(
        all.map(|(name, world)| (name, world, start.clone()))
            .collect(),
    )
}

/// The same world from starts that differ.
fn starts(scenario: &Scenario, start: &Start) -> Vec<PerturbedStart> {
    let mut all = Vec::new();
    for (n, axis) in scenario.axes().iter().enumerate() {
        if !["m", "m/s"].contains(&axis.unit) {
            continue;
        }
        for by in [-START, START] {
            let mut varied = start.clone();
            varied.0[n] += by;
            if axis.unit == "m/s" && 0.0 <= start.0[n] {
                varied.0[n] = varied.0[n].max(0.0);
            }
            let name = format!("{} {by:+} {}", axis.name, axis.unit);
            all.push((name, scenario.clone(), varied));
        }
    }
    all
}
