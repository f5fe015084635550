//! Cause of a counterexample: the leaf, the ado's action and the last chance.
//!
//! Each is a counterfactual: a replay from the recorded start with its noise, on the
//! world's own plant, with everything else as recorded. After the recorded actions the ado
//! takes its neutral action. A failure is avoided if the verdict is that the ego holds.
//! A replay with a rule violation or a fault is no answer.
//!
//! Reference drivers repeat the recorded motion instead, which goes on after its end. So
//! that no two labels contradict each other, full braking is replayed in both ways, and an
//! answer is given only if both give it.

use std::sync::Arc;

use super::reruns::{KEEP_RUNS, Reruns};
use crate::ego::{Controller, FullBrake, RecordedCommands, Takeover};
use crate::experiment::{Watch, ending_at, violated};
use crate::preventability::{BrakingReplays, Preventability};
use crate::rulebook::Verdict;
use crate::run_dir::{Answer, DecisiveSpan, LastChance, NoAnswer, NotAsked, Why};
use crate::scene::drive::{ControllerFactory, DriveSpec};
use crate::sim::{GRAVITY_MPS2, PlantKind};
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::{DriveScenario, Scenario};

/// Time by which the last chance may differ between the plants.
const PLANTS_S: f64 = 0.1;

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
        leaf_s: leaf.map_or(0.0, |leaf| ending_at(episode, leaf.sample).time_s),
        decisive,
        not_asked,
        last_chance: scenario.drive().map(|driving| match driver {
            Some(driver) => last_chance(driving, episode, driver),
            None => {
                let begun = driving.world().at_start(&episode.start);
                let driver = SubstituteDriver::braking_by(greatest_friction(begun.spec()));
                let motion = scenario.braking_replays(episode);
                chance(driving, episode, &driver, motion)
            }
        }),
    }
}

/// Withdraws "not avoided" if a reference driver, which only brakes, avoids the contact.
pub(super) fn reconcile(why: &mut Why, panel: &Preventability) {
    let Some(chance) = &mut why.last_chance else {
        return;
    };
    if chance.answer() == Answer::NotAvoided
        && let Some(driver) = panel.any_driver()
    {
        chance.no_answer = Some(NoAnswer::OnlyDriver {
            driver: driver.name().to_owned(),
        });
    }
}

/// Returns the reason why a replay with this verdict is no answer, `None` if it is one.
pub(super) fn no_answer(scenario: &Scenario, verdict: Verdict) -> Option<NoAnswer> {
    match verdict {
        Verdict::Foul { rule, .. } => Some(NoAnswer::RuleBroken {
            rule: scenario.rulebook().rules[rule].name.clone(),
        }),
        Verdict::Invalid => Some(NoAnswer::Fault),
        _ => None,
    }
}

/// Returns the answer of a replay that ended with this verdict.
fn answer(scenario: &Scenario, verdict: Verdict) -> Answer {
    match (no_answer(scenario, verdict), verdict) {
        (Some(reason), _) => Answer::NoAnswer(reason),
        (None, Verdict::Held { .. }) => Answer::Avoided,
        // A violation that does not count is a violation nevertheless.
        (None, _) => Answer::NotAvoided,
    }
}

/// Returns the earliest decision whose neutral replacement avoids the failure.
///
/// Later decisions stay as recorded. If no such decision exists, it returns the earliest
/// stretch of equal actions with this property. `None` if neither exists, or if the ego
/// refuses questions.
pub fn decisive(scenario: &Scenario, episode: &Episode) -> Option<DecisiveSpan> {
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
fn decisive_within(
    reruns: &Reruns<'_>,
    episode: &Episode,
) -> Result<Option<DecisiveSpan>, NotAsked> {
    let (scenario, actions) = (reruns.scenario(), &episode.actions);
    let neutral = scenario.world().spaces().neutral;
    // With neutral actions alone there is nothing to replace, and the cause is the start.
    if actions.iter().all(|action| *action == neutral) {
        return Err(NotAsked::NothingDone);
    }
    // Zero questions cost nothing, but return an existing refusal.
    reruns.ask(0, 0)?;
    let mut unanswered = None;
    for spans in spans(scenario, actions) {
        let found = if reruns.copies() {
            let counted = spans.iter().inspect(|_| reruns.count(1));
            earliest(scenario, episode, counted.copied(), &mut unanswered)
        } else {
            earliest_of_whole_runs(reruns, episode, &spans, &mut unanswered)?
        };
        let Some((from, to)) = found else {
            continue;
        };
        let decision_s = scenario.bench().clock().decision_s;
        return Ok(Some(DecisiveSpan {
            action: scenario.action_label(actions[from]),
            from_s: tidy(from as f64 * decision_s),
            until_s: tidy(to as f64 * decision_s),
        }));
    }
    match unanswered {
        Some(reason) => Err(NotAsked::NoAnswer(reason)),
        None => Ok(None),
    }
}

/// Returns the first span whose neutral replacement avoids the failure.
///
/// Each span takes a whole run. `unanswered` gets the first reason of a run without answer.
fn earliest_of_whole_runs(
    reruns: &Reruns<'_>,
    episode: &Episode,
    spans: &[(usize, usize)],
    unanswered: &mut Option<NoAnswer>,
) -> Result<Option<(usize, usize)>, NotAsked> {
    let scenario = reruns.scenario();
    let neutral = scenario.world().spaces().neutral;
    for &(from, to) in spans {
        reruns.ask(1, 0)?;
        let mut changed = episode.actions.clone();
        changed[from..to].fill(neutral);
        let verdict = reruns.verdict(episode, &changed);
        if avoids(scenario, verdict, unanswered) {
            return Ok(Some((from, to)));
        }
    }
    Ok(None)
}

/// Returns whether a replay avoids the failure, and notes why it has no answer.
fn avoids(scenario: &Scenario, verdict: Verdict, unanswered: &mut Option<NoAnswer>) -> bool {
    match answer(scenario, verdict) {
        Answer::Avoided => true,
        Answer::NotAvoided => false,
        Answer::NoAnswer(reason) => {
            unanswered.get_or_insert(reason);
            false
        }
    }
}

/// Returns the first span whose neutral replacement avoids the failure.
///
/// The spans are in the order of their beginnings. The actions before a span are as
/// recorded, so their part is played only once.
fn earliest(
    scenario: &Scenario,
    episode: &Episode,
    mut spans: impl Iterator<Item = (usize, usize)>,
    unanswered: &mut Option<NoAnswer>,
) -> Option<(usize, usize)> {
    let neutral = scenario.world().spaces().neutral;
    let mut bench = scenario.bench();
    // The question ends with the verdict, so no motion after it is computed.
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
        avoids(scenario, verdict, unanswered)
    })
}

/// Returns the verdict after these actions, followed by the neutral action.
fn finish(mut bench: Testbench, actions: &[usize]) -> Verdict {
    let neutral = bench.spaces().neutral;
    let mut rest = actions.iter().copied().chain(std::iter::repeat(neutral));
    while let Some(action) = rest.next().filter(|_| !bench.is_done()) {
        bench.decide(action);
    }
    bench.verdict().unwrap_or(Verdict::Invalid)
}

/// Returns the last sample from which `driver` avoids the failure.
///
/// The ados act as recorded. The search goes backwards by decisions, then by samples
/// within the first decision that helps. If no decision helps, every sample is tried.
pub fn last_chance(
    scenario: DriveScenario<'_>,
    episode: &Episode,
    driver: &SubstituteDriver,
) -> LastChance {
    chance(scenario, episode, driver, None)
}

/// Returns the last chance, which the replays of the recorded motion must confirm.
fn chance(
    scenario: DriveScenario<'_>,
    episode: &Episode,
    driver: &SubstituteDriver,
    mut motion: Option<BrakingReplays>,
) -> LastChance {
    let sample_s = scenario.spec().clock.sample_s;
    let judged = episode.judged.saturating_sub(1);
    let per_decision = scenario.bench().clock().samples_per_decision().max(1);
    let mut unanswered = None;
    // In the recorded motion every sample is cheap. With the first, nothing is left to ask.
    let contact = motion.as_mut().and_then(BrakingReplays::last);
    let is_refuted = motion.is_some() && contact.is_none();
    // The motion of a rigid record is replayed on the kinematic plant, which brakes alike
    // but not bit for bit.
    let slack = match scenario.spec().plant {
        PlantKind::Rigid => (PLANTS_S / sample_s).round() as usize,
        PlantKind::Kinematic => 0,
    };
    let mut only_contact = false;
    let mut avoids = |after: usize, unanswered: &mut Option<NoAnswer>| {
        let mut moves = |samples: std::ops::RangeInclusive<usize>| {
            let motion = motion.as_mut()?;
            let avoiding = samples.clone().filter(|sample| motion.avoids(*sample));
            Some((avoiding.count(), samples.count()))
        };
        let about = moves(after.saturating_sub(slack)..=after).map(|(some, _)| some > 0);
        if about == Some(false) && contact.is_some() {
            return false;
        }
        let run = substituted(scenario, episode, driver, after);
        // Either plant may brake a little better than the other.
        let moved = match run.answer {
            Answer::NotAvoided => moves(after..=after + slack).map(|(some, all)| some == all),
            _ => about,
        };
        match both(&run, moved) {
            Answer::Avoided => true,
            Answer::NotAvoided => false,
            // The violation is certain at this sample.
            Answer::NoAnswer(NoAnswer::OnlyContact) => {
                only_contact = true;
                false
            }
            Answer::NoAnswer(reason) => {
                unanswered.get_or_insert(reason);
                false
            }
        }
    };
    // Every sample would be a whole replay, so whole decisions come first.
    let mut coarse = (0..=judged.div_ceil(per_decision))
        .rev()
        .map(|decision| decision * per_decision)
        .filter(|after| *after <= judged);
    let at = match coarse.find(|after| avoids(*after, &mut unanswered)) {
        // Within a decision of the chance, samples are tried from its end.
        Some(from) => {
            // A takeover after the violation cannot avoid it.
            let last = (from + per_decision - 1).min(judged);
            let mut between = (from + 1..=last).rev();
            let found = between.find(|after| avoids(*after, &mut unanswered));
            Some(found.unwrap_or(from))
        }
        // A chance may begin and end between two decisions. The recorded motion has been
        // tried at every sample already, and a missing answer stays one.
        None if is_refuted || unanswered.is_some() => None,
        None => {
            let mut between = (0..=judged)
                .rev()
                .filter(|after| !after.is_multiple_of(per_decision));
            between.find(|after| avoids(*after, &mut unanswered))
        }
    };
    let time_s = |sample: usize| tidy(sample as f64 * sample_s);
    LastChance {
        driver: driver.name.clone(),
        at_s: at.map(time_s),
        violated_s: ending_at(
            episode,
            violated(&scenario, episode).len().saturating_sub(1),
        )
        .time_s,
        no_answer: match at {
            None if only_contact => unanswered.or(Some(NoAnswer::OnlyContact)),
            None if contact.is_some() => unanswered.or(Some(NoAnswer::ReplaysDiffer)),
            _ => unanswered,
        },
        contact_s: contact.map(time_s),
    }
}

/// Replay with another driver.
struct SubstituteRun {
    answer: Answer,
    /// True if the ego has a contact in it.
    has_contact: bool,
}

/// Returns the answer of the replay of the actions and that of the recorded motion.
///
/// `moved` is whether the motion avoids the contact, `None` if it cannot be replayed.
fn both(acted: &SubstituteRun, moved: Option<bool>) -> Answer {
    match (&acted.answer, moved) {
        (Answer::Avoided, Some(false)) => Answer::NoAnswer(NoAnswer::ReplaysDiffer),
        (Answer::NotAvoided, Some(true)) => Answer::NoAnswer(if acted.has_contact {
            NoAnswer::ReplaysDiffer
        } else {
            NoAnswer::OnlyContact
        }),
        (answer, _) => answer.clone(),
    }
}

/// Plays the episode with `driver`, which takes over after `after` samples.
fn substituted(
    scenario: DriveScenario<'_>,
    episode: &Episode,
    driver: &SubstituteDriver,
    after: usize,
) -> SubstituteRun {
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
    // A contact may follow the violation.
    let replayed = play(&mut bench, start, noise, &mut ado, Aftermath::Play);
    SubstituteRun {
        answer: answer(&world, replayed.verdict),
        has_contact: replayed.contact.is_some(),
    }
}

/// Rounds a time to nanoseconds, which removes binary noise.
fn tidy(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_replays_must_give_an_answer() {
        let rule = || {
            Answer::NoAnswer(NoAnswer::RuleBroken {
                rule: "stays".to_owned(),
            })
        };
        let differ = || Answer::NoAnswer(NoAnswer::ReplaysDiffer);
        let cases = [
            (Answer::Avoided, Some(true), Answer::Avoided),
            (Answer::Avoided, None, Answer::Avoided),
            (Answer::Avoided, Some(false), differ()),
            (Answer::NotAvoided, Some(false), Answer::NotAvoided),
            (Answer::NotAvoided, None, Answer::NotAvoided),
            (
                Answer::NotAvoided,
                Some(true),
                Answer::NoAnswer(NoAnswer::OnlyContact),
            ),
            (rule(), Some(true), rule()),
            (rule(), Some(false), rule()),
        ];
        for (acted, moved, expected) in cases {
            let run = |has_contact| SubstituteRun {
                answer: acted.clone(),
                has_contact,
            };
            assert_eq!(both(&run(false), moved), expected, "{acted:?}, {moved:?}");
            if acted != Answer::NotAvoided {
                assert_eq!(both(&run(true), moved), expected, "{acted:?}, {moved:?}");
            }
        }
        let touches = SubstituteRun {
            answer: Answer::NotAvoided,
            has_contact: true,
        };
        assert_eq!(both(&touches, Some(true)), differ());
        assert_eq!(both(&touches, Some(false)), Answer::NotAvoided);
    }

    #[test]
    fn a_verdict_is_an_answer_unless_a_rule_or_the_ego_broke() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let rule = NoAnswer::RuleBroken {
            rule: "keeps the speed limit".to_owned(),
        };
        let cases = [
            (Verdict::Held { margin: 1.0 }, Answer::Avoided),
            (Verdict::Counterexample { by: 1.0 }, Answer::NotAvoided),
            (Verdict::Uncounted { by: 1.0 }, Answer::NotAvoided),
            (
                Verdict::Foul {
                    rule: 1,
                    forfeited: 1,
                },
                Answer::NoAnswer(rule),
            ),
            (Verdict::Invalid, Answer::NoAnswer(NoAnswer::Fault)),
        ];
        for (verdict, expected) in cases {
            assert_eq!(answer(&world, verdict), expected, "{verdict:?}");
        }
    }
}
