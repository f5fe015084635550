//! Every statement of a label, checked against replays with the drivers concerned.

use std::sync::Arc;

use brakecheck::crashes::Regressions;
use brakecheck::ego::Controller;
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::preventability::{BrakingReplays, Label};
use brakecheck::rulebook::Verdict;
use brakecheck::run_dir::{About, Answer, LastChance, NoAnswer, NotAsked};
use brakecheck::search::{Hold, SearchRequest, search};
use brakecheck::testbench::{Aftermath, Episode, Replay, motion_of, play};
use brakecheck::world::{PlantKind, Scenario};
use brakecheck_crashes::crashes::description;
use brakecheck_crashes::crashes::minimize::shrink;
use brakecheck_ego::ego::{FullBrake, Takeover};

const WORLDS: [&str; 5] = ["acc", "merge", "pedestrian", "cut_in", "yellow_light"];

/// Crashes of each world that are searched for, as found and minimized.
///
/// `BRAKECHECK_CRASHES=20` asks for more.
fn each() -> usize {
    let asked = std::env::var("BRAKECHECK_CRASHES");
    asked.map_or(2, |asked| asked.parse().expect("a number"))
}

/// Crashes that a random search finds in a shipped world, on its own plant.
fn searched(name: &str, most: usize) -> Vec<(Scenario, Episode)> {
    let world = Scenario::shipped(name).expect("shipped").expect("sound");
    let watch = Watch::unwatched();
    let starts = test_starts(&world, 5, 12 * most, &watch).expect("not stopped");
    let request = SearchRequest {
        scenario: &world,
        ego: "nominal",
        method: Hold.into(),
        budget: 40,
        starts: &starts,
    };
    let found = search(&request, &watch).found;
    let played = found
        .iter()
        .zip(&starts.starts)
        .filter_map(|(found, (start, noise))| {
            let actions = found.as_ref()?.actions.as_ref()?;
            let mut ado = Replay::holding(actions);
            let episode = play(&mut world.bench(), start, *noise, &mut ado, Aftermath::Play);
            episode.verdict.is_success().then_some(episode)
        });
    let crashes = played.take(most).flat_map(|episode| {
        let (small, _) = shrink(&world, &episode, &watch);
        [episode, small]
    });
    crashes.map(|episode| (world.clone(), episode)).collect()
}

/// Crashes that this repository keeps, of worlds without programs.
fn kept() -> Vec<(Scenario, Episode)> {
    let all = Regressions::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regressions"))
        .expect("files")
        .replay_recorded()
        .expect("replayed");
    let driven = all.into_iter().filter(|it| it.scenario.drive().is_some());
    driven.map(|it| (it.scenario, it.episode)).collect()
}

fn verdict(world: &Scenario, of: &Episode, actions: &[usize]) -> Verdict {
    let mut bench = world.bench();
    let mut ado = Replay::then(actions, bench.spaces().neutral);
    play(&mut bench, &of.start, of.noise, &mut ado, Aftermath::Skip).verdict
}

/// Verdict of the own ego up to a sample, then all the brakes.
fn braked(world: &Scenario, of: &Episode, after: usize) -> Verdict {
    let own = world.controller().expect("a stock ego");
    let driving = world.drive().expect("driven");
    // The plant caps the command at the friction.
    let brake_mps2 = driving.world().at_start(&of.start).spec().road.friction() * 9.81;
    let factory = move || -> Box<dyn Controller> {
        let brake = FullBrake { brake_mps2 };
        Box::new(Takeover::new(
            own.controller.build(),
            Box::new(brake),
            after,
        ))
    };
    let world = world.with_ego("braking", Arc::new(factory));
    verdict(&world, of, &of.actions)
}

/// One crash under examination.
struct Checked<'a> {
    world: &'a Scenario,
    episode: &'a Episode,
    about: &'a About,
    motion: Option<BrakingReplays>,
    wrong: Vec<String>,
    statements: usize,
}

impl Checked<'_> {
    fn states(&mut self, holds: bool, statement: &str) {
        self.statements += 1;
        if !holds {
            self.wrong.push(format!("{statement}: {}", self.about));
        }
    }

    fn held(&self, after: usize) -> bool {
        matches!(
            braked(self.world, self.episode, after),
            Verdict::Held { .. }
        )
    }

    fn moved(&mut self, after: usize) -> Option<bool> {
        self.motion.as_mut().map(|motion| motion.avoids(after))
    }

    /// The same, up to 0.1 s earlier if the plant is not that of the replay.
    fn moved_about(&mut self, after: usize) -> Option<bool> {
        let driving = self.world.drive().expect("driven");
        let is_rigid = driving.world().spec().plant == PlantKind::Rigid;
        let sample_s = self.world.bench().clock().sample_s;
        let slack = if is_rigid {
            (0.1 / sample_s).round() as usize
        } else {
            0
        };
        let motion = self.motion.as_mut()?;
        Some((after.saturating_sub(slack)..=after).any(|at| motion.avoids(at)))
    }

    /// Samples at which decisions are taken, up to the failure.
    fn decisions(&self) -> Vec<usize> {
        let step = self.world.bench().clock().samples_per_decision();
        (0..self.episode.judged).step_by(step).collect()
    }

    fn last_chance(&mut self, chance: &LastChance) {
        let sample_s = self.world.bench().clock().sample_s;
        let decisions = self.decisions();
        match chance.answer() {
            Answer::Avoided => {
                let at = (chance.at_s.expect("avoided") / sample_s).round() as usize;
                let avoids = self.held(at) && self.moved_about(at) != Some(false);
                self.states(avoids, "avoids it");
                let mut later = decisions.into_iter().filter(|after| at < *after);
                let last =
                    !later.any(|after| self.held(after) && self.moved_about(after) != Some(false));
                self.states(last, "until then");
            }
            Answer::NotAvoided => {
                let none = decisions.iter().all(|after| {
                    let foul = braked(self.world, self.episode, *after).is_foul();
                    !foul && !self.held(*after)
                });
                self.states(none, "full braking does not");
                let moved = (0..self.episode.judged).any(|at| self.moved(at) == Some(true));
                self.states(!moved, "nor in the recorded motion");
                let panel = self.about.preventability.as_ref();
                let drivers = panel.is_some_and(|panel| {
                    let outcomes = panel
                        .handover
                        .values()
                        .chain(panel.t0.values())
                        .chain(&panel.perfect)
                        .chain(&panel.foresight);
                    outcomes.into_iter().any(|outcome| outcome.avoided)
                });
                self.states(!drivers, "nor a driver who brakes");
            }
            Answer::NoAnswer(NoAnswer::RuleBroken { rule }) => {
                let rules = &self.world.rulebook().rules;
                let broken = decisions.iter().any(|after| {
                    let verdict = braked(self.world, self.episode, *after);
                    matches!(verdict, Verdict::Foul { rule: nth, .. } if rules[nth].name == rule)
                });
                self.states(broken, "the rule is broken");
            }
            Answer::NoAnswer(NoAnswer::OnlyContact) => {
                let held = decisions.iter().any(|after| self.held(*after));
                self.states(!held, "the violation is not avoided");
                let moved = (0..self.episode.judged).any(|at| self.moved(at) == Some(true));
                self.states(moved, "the contact is avoided");
            }
            Answer::NoAnswer(NoAnswer::ReplaysDiffer) => {
                let samples = (0..self.episode.judged).collect::<Vec<_>>();
                let differ = samples.into_iter().any(|after| {
                    self.moved(after)
                        .is_some_and(|moved| moved != self.held(after))
                });
                self.states(differ, "the replays differ");
            }
            Answer::NoAnswer(NoAnswer::OnlyDriver { driver }) => {
                let panel = self.about.preventability.as_ref().expect("a driver");
                let named = panel.handover.iter().chain(&panel.t0);
                let mut avoiding = named.filter(|(_, outcome)| outcome.avoided);
                let avoids = avoiding.any(|(it, _)| it.name() == driver);
                self.states(avoids, "that driver avoids it");
            }
            Answer::NoAnswer(reason) => self.states(false, &format!("{reason:?}")),
        }
        if let Some(contact_s) = chance.contact_s {
            let at = (contact_s / sample_s).round() as usize;
            let avoids = self.moved(at) == Some(true) && self.moved(at + 1) != Some(true);
            self.states(avoids, "in the recorded motion");
        }
    }

    fn decisive(&mut self) {
        let why = self.about.why.as_ref().expect("it fails");
        let neutral = self.world.world().spaces().neutral;
        let decision_s = self.world.bench().clock().decision_s;
        let of = |from: usize, to: usize| {
            let mut actions = self.episode.actions.clone();
            actions[from..to].fill(neutral);
            verdict(self.world, self.episode, &actions)
        };
        match (&why.decisive, &why.not_asked) {
            (Some(decisive), _) => {
                let [from, to] = [decisive.from_s, decisive.until_s];
                let [from, to] = [from, to].map(|s| (s / decision_s).round() as usize);
                let avoids = matches!(of(from, to), Verdict::Held { .. });
                self.states(avoids, "it takes this action");
            }
            (None, None) => {
                let all = 0..self.episode.actions.len();
                let none = all
                    .map(|at| of(at, at + 1))
                    .all(|verdict| !verdict.is_foul() && !matches!(verdict, Verdict::Held { .. }));
                self.states(none, "no action decides it");
            }
            (None, Some(NotAsked::NothingDone)) => {
                let nothing = self.episode.actions.iter().all(|it| *it == neutral);
                self.states(nothing, "it does nothing");
            }
            (None, Some(NotAsked::NoAnswer(_))) => {
                let actions = &self.episode.actions;
                let stretch = |from: usize| {
                    let equal = actions[from..].iter();
                    from + equal.take_while(|it| **it == actions[from]).count()
                };
                let mut all = 0..actions.len();
                let foul = all.any(|at| of(at, at + 1).is_foul() || of(at, stretch(at)).is_foul());
                self.states(foul, "a rule is broken without it");
            }
            (None, Some(reason)) => self.states(false, &format!("{reason:?}")),
        }
    }

    fn drivers(&mut self) {
        let Some(panel) = &self.about.preventability else {
            return;
        };
        let motion = motion_of(&mut self.world.bench(), self.episode).expect("bodies");
        let mut replayer = self.world.replayer().expect("driven");
        let case = replayer.case(&motion);
        for (driver, outcome) in &panel.handover {
            let again = replayer.from_handover(&case, *driver, None);
            let contact = again.expect("a handover").contact;
            self.states(contact.is_none() == outcome.avoided, driver.name());
        }
        let last = self.motion.as_mut().and_then(BrakingReplays::last);
        let agrees = match panel.label {
            Label::UnavoidableByBraking => last.is_none(),
            Label::OnlyByPerfect | Label::OnlyByForesight => last.is_some(),
            _ => true,
        };
        self.states(agrees, "the label");
    }
}

/// The false statements about a crash, and the number of all.
fn check(world: &Scenario, episode: &Episode) -> (Vec<String>, usize) {
    let about = description(world, episode);
    let motion = motion_of(&mut world.bench(), episode).filter(|it| !it.is_empty());
    let replayer = world.replayer().expect("driven");
    let touched = motion.filter(|motion| motion.contact.is_some());
    let mut checked = Checked {
        world,
        episode,
        about: &about,
        motion: touched.and_then(|motion| replayer.braking(&motion)),
        wrong: Vec::new(),
        statements: 0,
    };
    let why = about.why.as_ref().expect("it fails");
    checked.last_chance(why.last_chance.as_ref().expect("driven"));
    checked.decisive();
    checked.drivers();
    (checked.wrong, checked.statements)
}

#[test]
fn no_statement_of_a_label_is_false() {
    let mut crashes = kept();
    for name in WORLDS {
        let found = searched(name, each());
        assert!(!found.is_empty(), "{name}");
        crashes.extend(found);
    }
    let (mut wrong, mut statements) = (Vec::new(), 0);
    let mut answers = [0; 3];
    for (world, episode) in &crashes {
        let (some, of) = check(world, episode);
        wrong.extend(some.into_iter().map(|it| format!("{}: {it}", world.name())));
        statements += of;
        let why = description(world, episode).why.expect("it fails");
        let chance = why.last_chance.expect("driven");
        let nth = match chance.answer() {
            Answer::Avoided => 0,
            Answer::NotAvoided => 1,
            Answer::NoAnswer(_) => 2,
        };
        answers[nth] += 1;
    }
    let shown = wrong.join("\n");
    println!(
        "{} of {statements} statements about {} crashes are false; avoided, not avoided, no \
         answer: {answers:?}",
        wrong.len(),
        crashes.len()
    );
    assert!(wrong.is_empty(), "{} are false:\n{shown}", wrong.len());
    let [avoided, not_avoided, unanswered] = answers;
    assert!(crashes.len() >= 20 && avoided > 0 && unanswered > 0);
    // Crashes that no braking avoids are rare: 2 of 204.
    assert!(crashes.len() < 200 || not_avoided > 0);
}

/// A car ahead brakes as its rule forbids from the second on, so a replay in which the ego
/// keeps away goes on until it does.
#[test]
fn a_replay_that_ends_in_a_broken_rule_is_no_answer() {
    let text = include_str!("../../worlds/acc.ron");
    // Its rule is broken at the end of its braking, which the crash prevents.
    let strict = text.replace("\"v_min\": 0.1", "\"v_min\": 4.0");
    let world = Scenario::parse("acc.ron", &strict).expect("a world");
    let mut seen = 0;
    let starts = test_starts(&world, 3, 30, &Watch::unwatched()).expect("not stopped");
    for (start, noise) in &starts.starts {
        let mut ado = Replay::holding(&[0]);
        let mut bench = world.bench();
        let episode = play(&mut bench, start, *noise, &mut ado, Aftermath::Play);
        if !episode.verdict.is_success() || episode.judged < 20 {
            continue;
        }
        // As an ado that brakes on through the crash is recorded.
        let mut long = episode.clone();
        long.actions.extend([0; 20]);
        let why = description(&world, &long).why.expect("it fails");
        let chance = why.last_chance.expect("driven");
        if let Answer::NoAnswer(NoAnswer::RuleBroken { rule }) = chance.answer() {
            assert_eq!(rule, "never stops or reverses");
            let words = chance.to_string();
            assert!(
                words.starts_with("no answer whether full braking avoids it"),
                "{words}"
            );
            assert!(
                !words.contains("does not avoid it from any sample"),
                "{words}"
            );
            seen += 1;
        }
    }
    assert!(seen > 0, "no rule is broken");
}

#[test]
fn a_label_of_an_earlier_version_claims_no_more_than_it_knew() {
    let old = "(driver: \"full braking\", at_s: None, violated_s: 3.5)";
    let chance: LastChance = ron::from_str(old).expect("an earlier version");
    assert_eq!(chance.answer(), Answer::NoAnswer(NoAnswer::EarlierVersion));
    let words = chance.to_string();
    assert!(
        words.contains("no answer") && words.contains("--refine"),
        "{words}"
    );
    let old = "(driver: \"full braking\", at_s: Some(2.5), violated_s: 3.5)";
    let chance: LastChance = ron::from_str(old).expect("an earlier version");
    assert_eq!(
        chance.to_string(),
        "full braking avoids it until 2.50 s, 1.00 s before"
    );
    // Today's says which of the two it is.
    for no_answer in [None, Some(NoAnswer::ReplaysDiffer)] {
        let chance = LastChance {
            driver: "full braking".to_owned(),
            at_s: None,
            violated_s: 3.5,
            no_answer: no_answer.clone(),
            contact_s: None,
        };
        let written = ron::to_string(&chance).expect("RON");
        assert_eq!(ron::from_str::<LastChance>(&written).expect("read"), chance);
        let denied = chance
            .to_string()
            .contains("does not avoid it from any sample on");
        assert_eq!(denied, no_answer.is_none());
    }
}
