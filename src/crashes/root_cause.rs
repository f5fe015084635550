//! Why a counterexample is one: the leaf, the ado's action, the ego's last chance.
//!
//! Each is an answer to "what if", played from the recorded start with its noise
//! on the world's own plant, with everything else as recorded. Avoided is a
//! failure where the verdict is that the ego held; a replay in which an ado
//! breaks a rule answers nothing.

use std::sync::Arc;

use super::reruns::{KEEP_RUNS, Reruns};
use crate::ego::{Controller, FullBrake, RecordedCommands, Takeover};
use crate::experiment::{Watch, violated};
use crate::rulebook::Verdict;
use crate::run_dir::{Decisive, LastChance, NotAsked, Why};
use crate::scene::drive::ControllerFactory;
use crate::sim::GRAVITY_MPS2;
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::Scenario;

/// A driver in the ego's place.
#[derive(Clone)]
pub struct SubstituteDriver {
    /// How sentences call it.
    pub name: String,
    /// Makes one; its commands pass the ego's own actuator.
    pub factory: ControllerFactory,
}

impl SubstituteDriver {
    /// The ideal driver: no delay, all the deceleration the road gives.
    ///
    /// `None`: the world is not driven.
    pub fn full_brake(scenario: &Scenario) -> Option<SubstituteDriver> {
        let brake_mps2 = scenario.drive()?.road.friction() * GRAVITY_MPS2;
        Some(SubstituteDriver {
            name: "full braking".to_owned(),
            factory: Arc::new(move || Box::new(FullBrake { brake_mps2 })),
        })
    }
}

/// Why the ego fails in an episode of `scenario`.
///
/// The last chance is that of `driver`, [`SubstituteDriver::full_brake`] if left out.
pub fn why(scenario: &Scenario, episode: &Episode, driver: Option<&SubstituteDriver>) -> Why {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    why_within(&reruns, episode, driver)
}

/// The same with an ego that is asked about more than that.
pub(super) fn why_within(
    reruns: &Reruns<'_>,
    episode: &Episode,
    driver: Option<&SubstituteDriver>,
) -> Why {
    let scenario = reruns.scenario();
    let (decisive, not_asked) = match decisive_within(reruns, episode) {
        Ok(decisive) => (decisive, None),
        Err(reason) => (None, Some(reason)),
    };
    let explanation = scenario
        .rulebook()
        .spec
        .explain(&violated(scenario, episode));
    let leaf = explanation.leaf();
    let ideal = SubstituteDriver::full_brake(scenario);
    Why {
        leaf: leaf.map(|leaf| leaf.formula.clone()).unwrap_or_default(),
        leaf_s: tidy(leaf.map_or(0.0, |leaf| leaf.time_s)),
        decisive,
        not_asked,
        last_chance: driver
            .or(ideal.as_ref())
            .and_then(|driver| last_chance(scenario, episode, driver)),
    }
}

/// The earliest decision whose replacement by the neutral action, later ones as
/// recorded, avoids the failure; if there is none, the earliest stretch of one
/// action that does.
///
/// `None`: neither does, or the ego cannot be asked.
pub fn decisive(scenario: &Scenario, episode: &Episode) -> Option<Decisive> {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    decisive_within(&reruns, episode).ok().flatten()
}

/// Each decision that is not neutral, then each stretch of one such action.
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

/// How many questions the decisive action of a sequence takes at most.
pub(super) fn spans_asked(scenario: &Scenario, actions: &[usize]) -> usize {
    spans(scenario, actions).iter().map(Vec::len).sum()
}

/// The same with an ego that is asked about more than that.
fn decisive_within(reruns: &Reruns<'_>, episode: &Episode) -> Result<Option<Decisive>, NotAsked> {
    let (scenario, actions) = (reruns.scenario(), &episode.actions);
    let neutral = scenario.world().spaces().neutral;
    if actions.iter().all(|action| *action == neutral) {
        return Err(NotAsked::NothingDone);
    }
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

/// The first of some spans that avoid the failure if neutral, each asked by a
/// whole run.
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

/// The first of some spans of decisions that avoid the failure if neutral.
///
/// The spans come in order of their beginnings; up to there everything is as
/// recorded, so that much is played once.
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

/// The verdict after these actions; they coast when the recording has ended.
fn finish(mut bench: Testbench, actions: &[usize]) -> Option<Verdict> {
    let neutral = bench.spaces().neutral;
    let mut rest = actions.iter().copied().chain(std::iter::repeat(neutral));
    while let Some(action) = rest.next().filter(|_| !bench.is_done()) {
        bench.decide(action);
    }
    bench.verdict()
}

/// The last sample from which `driver`, in the ego's place, avoids the failure,
/// ados acting as recorded.
///
/// It is looked for backwards, decision by decision and then sample by sample
/// within the first that helps: a chance that comes and goes between two
/// decisions may be passed over. `None`: the world is not driven.
pub fn last_chance(
    scenario: &Scenario,
    episode: &Episode,
    driver: &SubstituteDriver,
) -> Option<LastChance> {
    let sample_s = scenario.drive()?.clock.sample_s;
    let judged = episode.judged.saturating_sub(1);
    let per_decision = scenario.bench().clock().samples_per_decision().max(1);
    let avoids = |after: usize| is_avoided(scenario, episode, driver, after);
    let coarse = (0..=judged.div_ceil(per_decision)).rev();
    let coarse = coarse.map(|decision| decision * per_decision);
    let mut coarse = coarse.filter(|after| *after <= judged);
    let at = coarse.find(|after| avoids(*after)).map(|from| {
        let last = (from + per_decision - 1).min(judged);
        (from + 1..=last)
            .rev()
            .find(|after| avoids(*after))
            .unwrap_or(from)
    });
    Some(LastChance {
        driver: driver.name.clone(),
        at_s: at.map(|at| tidy(at as f64 * sample_s)),
        violated_s: tidy(violated(scenario, episode).len().saturating_sub(1) as f64 * sample_s),
    })
}

/// Whether `driver` avoids it that takes over after so many samples.
fn is_avoided(
    scenario: &Scenario,
    episode: &Episode,
    driver: &SubstituteDriver,
    after: usize,
) -> bool {
    let Some(spec) = scenario.drive() else {
        return false;
    };
    let (own, commands) = (spec.ego.controller.clone(), episode.commands.clone());
    let second = driver.factory.clone();
    let factory = move || -> Box<dyn Controller> {
        let first: Box<dyn Controller> = if commands.is_empty() {
            own.build()
        } else {
            // One that nobody here wrote repeats what it commanded.
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
        Verdict::Held { .. } | Verdict::Uncounted { .. }
    )
}

/// A time without the dust of binary fractions.
fn tidy(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e9
}
