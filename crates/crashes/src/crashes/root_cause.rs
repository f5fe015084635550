//! Cause of a counterexample: the leaf, the ado's action and the last chance.
//!
//! Each is a counterfactual: a replay from the recorded start with its noise, on the
//! world's own plant, with everything else as recorded. A failure is avoided if the
//! verdict is that the ego holds. A replay with a rule violation is no answer.

use std::sync::Arc;

use super::reruns::{KEEP_RUNS, Reruns};
use crate::ego::{Controller, FullBrake, RecordedCommands, Takeover};
use crate::experiment::{Watch, violated};
use crate::rulebook::Verdict;
use crate::run_dir::{Decisive, LastChance, NotAsked, Why};
use crate::scene::drive::{ControllerFactory, DriveSpec};
use crate::sim::GRAVITY_MPS2;
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::{DriveScenario, Scenario};

/// Driver in the ego's place.
#[derive(Clone)]
pub struct SubstituteDriver {
    /// Name in sentences.
    pub name: String,
    /// Factory of the driver. Its commands pass the ego's own actuator.
    pub factory: ControllerFactory,
}

impl SubstituteDriver {
    /// Returns the ideal driver: no delay, all the deceleration of the road.
    ///
    /// If starts draw the friction, pass the scenario [at a start](Scenario::at_start).
    pub fn full_brake(scenario: DriveScenario<'_>) -> SubstituteDriver {
        SubstituteDriver::braking_by(greatest_friction(scenario.spec()))
    }

    fn braking_by(friction: f64) -> SubstituteDriver {
        let brake_mps2 = friction * GRAVITY_MPS2;
        SubstituteDriver {
            name: "full braking".to_owned(),
            factory: Arc::new(move || Box::new(FullBrake { brake_mps2 })),
        }
    }
}

/// Returns the greatest friction of an episode. The plant caps braking at the present one.
fn greatest_friction(spec: &DriveSpec) -> f64 {
    let bounds = spec.weather.as_ref().and_then(|weather| weather.friction);
    let road = spec.road.friction();
    bounds.map_or(road, |bounds| bounds.hi.max(road))
}

/// Returns the cause of the failure in an episode of `scenario`.
///
/// The last chance is that of `driver`, by default [`SubstituteDriver::full_brake`].
pub fn why(scenario: &Scenario, episode: &Episode, driver: Option<&SubstituteDriver>) -> Why {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    why_within(&reruns, episode, driver)
}

/// Finds the cause within the runs of `reruns`.
pub(super) fn why_within(
    reruns: &Reruns<'_>,
    episode: &Episode,
    driver: Option<&SubstituteDriver>,
) -> Why {
    let scenario = reruns.scenario();
    // A refusal is kept, so that a missing decisive action is not read as a result.
    let (decisive, not_asked) = match decisive_within(reruns, episode) {
        Ok(decisive) => (decisive, None),
        Err(reason) => (None, Some(reason)),
    };
    let explanation = scenario
        .rulebook()
        .spec
        .explain(&violated(scenario, episode));
    let leaf = explanation.leaf();
    Why {
        leaf: leaf.map(|leaf| leaf.formula.clone()).unwrap_or_default(),
        leaf_s: tidy(leaf.map_or(0.0, |leaf| leaf.time_s)),
        decisive,
        not_asked,
        last_chance: scenario.drive().map(|scenario| match driver {
            Some(driver) => last_chance(scenario, episode, driver),
            None => {
                let begun = scenario.world().at_start(&episode.start);
                let driver = SubstituteDriver::braking_by(greatest_friction(begun.spec()));
                last_chance(scenario, episode, &driver)
            }
        }),
    }
}

/// Returns the earliest decision whose neutral replacement avoids the failure.
///
/// Later decisions stay as recorded. If no such decision exists, it returns the earliest
/// stretch of equal actions with this property. `None` if neither exists, or if the ego
/// refuses questions.
pub fn decisive(scenario: &Scenario, episode: &Episode) -> Option<Decisive> {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    decisive_within(&reruns, episode).ok().flatten()
}

/// Returns all decisions that are not neutral, then all stretches of such actions.
fn spans(scenario: &Scenario, actions: &[usize]) -> [Vec<(usize, usize)>; 2] {
    let neutral = scenario.world().spaces().neutral;
    let does_something = |span: &(usize, usize)| actions[span.0] != neutral;
    let singles = (0..actions.len()).map(|at| (at, at + 1));
    let stretch_ends = |from: usize| {
        let rest = actions[from..].iter();
        from + rest.take_while(|action| **action == actions[from]).count()
    };
    let begins = (0..actions.len()).filter(|&at| at == 0 || actions[at - 1] != actions[at]);
    let stretches = begins.map(|from| (from, stretch_ends(from)));
    [
        singles.filter(does_something).collect(),
        stretches.filter(does_something).collect(),
    ]
}

/// Returns the most questions that the decisive action of a sequence needs.
pub(super) fn span_runs(scenario: &Scenario, actions: &[usize]) -> usize {
    spans(scenario, actions).iter().map(Vec::len).sum()
}

/// Finds the decisive action within the runs of `reruns`.
fn decisive_within(reruns: &Reruns<'_>, episode: &Episode) -> Result<Option<Decisive>, NotAsked> {
    let (scenario, actions) = (reruns.scenario(), &episode.actions);
    let neutral = scenario.world().spaces().neutral;
    if actions.iter().all(|action| *action == neutral) {
        return Err(NotAsked::NothingDone);
    }
    // Zero questions cost nothing, but return an existing refusal.
    reruns.ask(0, 0)?;
    for spans in spans(scenario, actions) {
        let found = if reruns.copies() {
            let counted = spans.iter().inspect(|_| reruns.count(1));
            earliest(scenario, episode, counted.copied())
        } else {
            earliest_of_whole_runs(reruns, episode, &spans)?
        };
        let Some((from, to)) = found else {
            continue;
        };
        let decision_s = scenario.bench().clock().decision_s;
        return Ok(Some(Decisive {
            action: scenario.action_label(actions[from]),
            from_s: tidy(from as f64 * decision_s),
            until_s: tidy(to as f64 * decision_s),
        }));
    }
    Ok(None)
}

/// Returns the first span whose neutral replacement avoids the failure.
///
/// Each span takes a whole run.
fn earliest_of_whole_runs(
    reruns: &Reruns<'_>,
    episode: &Episode,
    spans: &[(usize, usize)],
) -> Result<Option<(usize, usize)>, NotAsked> {
    let neutral = reruns.scenario().world().spaces().neutral;
    for &(from, to) in spans {
        reruns.ask(1, 0)?;
        let mut changed = episode.actions.clone();
        changed[from..to].fill(neutral);
        if reruns.holds(episode, &changed) {
            return Ok(Some((from, to)));
        }
    }
    Ok(None)
}

/// Returns the first span whose neutral replacement avoids the failure.
///
/// The spans are in the order of their beginnings. The actions before a span are as
/// recorded, so their part is played only once.
fn earliest(
    scenario: &Scenario,
    episode: &Episode,
    mut spans: impl Iterator<Item = (usize, usize)>,
) -> Option<(usize, usize)> {
    let neutral = scenario.world().spaces().neutral;
    let mut bench = scenario.bench();
    bench.begin(&episode.start, episode.noise, Aftermath::Skip);
    let mut played = 0;
    spans.find(|&(from, to)| {
        while played < from && !bench.is_done() {
            bench.decide(episode.actions[played]);
            played += 1;
        }
        let mut changed = episode.actions.clone();
        changed[from..to].fill(neutral);
        // Without a copy of the ego, the recorded part is played again.
        let verdict = match bench.fork() {
            Some(branch) => finish(branch, &changed[played..]),
            None => {
                let mut anew = scenario.bench();
                anew.begin(&episode.start, episode.noise, Aftermath::Skip);
                finish(anew, &changed)
            }
        };
        matches!(verdict, Some(Verdict::Held { .. }))
    })
}

/// Returns the verdict after these actions, followed by the neutral action.
fn finish(mut bench: Testbench, actions: &[usize]) -> Option<Verdict> {
    let neutral = bench.spaces().neutral;
    let mut rest = actions.iter().copied().chain(std::iter::repeat(neutral));
    while let Some(action) = rest.next().filter(|_| !bench.is_done()) {
        bench.decide(action);
    }
    bench.verdict()
}

/// Returns the last sample from which `driver` avoids the failure.
///
/// The ados act as recorded. The search goes backwards by decisions, then by samples
/// within the first decision that helps. A chance that exists only between two decisions
/// may be missed.
pub fn last_chance(
    scenario: DriveScenario<'_>,
    episode: &Episode,
    driver: &SubstituteDriver,
) -> LastChance {
    let sample_s = scenario.spec().clock.sample_s;
    let judged = episode.judged.saturating_sub(1);
    let per_decision = scenario.bench().clock().samples_per_decision().max(1);
    let avoids = |after: usize| is_avoided(scenario, episode, driver, after);
    // Every sample would be a whole replay, so whole decisions come first.
    let coarse = (0..=judged.div_ceil(per_decision)).rev();
    let coarse = coarse.map(|decision| decision * per_decision);
    let mut coarse = coarse.filter(|after| *after <= judged);
    // Within a decision of the chance, samples are tried from its end.
    let at = coarse.find(|after| avoids(*after)).map(|from| {
        let last = (from + per_decision - 1).min(judged);
        (from + 1..=last)
            .rev()
            .find(|after| avoids(*after))
            .unwrap_or(from)
    });
    LastChance {
        driver: driver.name.clone(),
        at_s: at.map(|at| tidy(at as f64 * sample_s)),
        violated_s: tidy(violated(&scenario, episode).len().saturating_sub(1) as f64 * sample_s),
    }
}

/// Returns whether `driver` avoids the failure if it takes over after `after` samples.
fn is_avoided(
    scenario: DriveScenario<'_>,
    episode: &Episode,
    driver: &SubstituteDriver,
    after: usize,
) -> bool {
    let (own, commands) = (
        scenario.spec().ego.controller.clone(),
        episode.commands.clone(),
    );
    let second = driver.factory.clone();
    let factory = move || -> Box<dyn Controller> {
        let first: Box<dyn Controller> = if commands.is_empty() {
            own.build()
        } else {
            // A foreign ego repeats its recorded commands up to the takeover.
            Box::new(RecordedCommands::new(commands.clone().into()))
        };
        Box::new(Takeover::new(first, second(), after))
    };
    let world = scenario.with_ego(&driver.name, Arc::new(factory));
    let mut bench = world.bench();
    let mut ado = Replay::then(&episode.actions, bench.spaces().neutral);
    let (start, noise) = (&episode.start, episode.noise);
    let replayed = play(&mut bench, start, noise, &mut ado, Aftermath::Skip);
    matches!(
        replayed.verdict,
        // A violation that does not count is no failure of the test.
        Verdict::Held { .. } | Verdict::Uncounted { .. }
    )
}

/// Rounds a time to nanoseconds, which removes binary noise.
fn tidy(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e9
}
