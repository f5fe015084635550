//! Trial runs of a world at load, which reveal mistakes that no text shows.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Point2, Vector2};

use super::Scenario;
use super::scenario_kind::{DriveScenario, ScenarioKind};
use super::warnings::{Oddity, rule_place};
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::rulebook::{Judge, JudgeKind, Rulebook, Verdict};
use crate::scene::{Dynamics, Start};
use crate::seed::{Purpose, StartKey};
use crate::sim::{Placement, PlantKind};
use crate::testbench::{Actor, Aftermath, Constant, HeldRandom, Testbench, play};

/// Number of starts of the trial runs, besides the corners of X_init.
const TRIED_STARTS: u64 = 32;
/// Greatest number of corners of X_init that are tried.
const MAX_CORNERS: u32 = 256;
/// Greatest number of samples of the coasting runs at load.
const TRIED_SAMPLES: usize = 200_000;
/// Greatest number of runs in search of a run that keeps every rule.
const MAX_TRIALS: usize = 200;
/// Least number of runs that show that a rule cannot be kept.
const LEAST_TRIALS: usize = 10;
/// Greatest number of entries of a file's list of agents that are searched.
const MAX_AGENTS: usize = 1000;
/// Greatest number of decisions for which changing actions are held.
const MAX_HOLD: usize = 12;

/// Number of agents up to which a sample costs about as much as for two.
const FEW_AGENTS: usize = 20;

/// Number of samples that a trial may take.
///
/// Agents are compared with each other, so samples of many agents cost more.
fn affordable_samples(scenario: &Scenario) -> usize {
    // Counted without the stage, whose roads are drawn up to their crossings.
    let driving = scenario.drive().map(|it| it.spec().agents.len());
    let agents = driving.unwrap_or_else(|| scenario.bench().stage().agents.len());
    // Pairs of bodies make a sample's cost grow with the square of the agents.
    TRIED_SAMPLES / (agents / FEW_AGENTS).max(1).pow(2)
}

/// Returns the world on the plant of the trial runs.
pub(super) fn on_kinematic_plant(scenario: &Scenario) -> Scenario {
    if scenario.plant() == Dynamics::Kinematic {
        // A clone keeps the crossings of its paths, which are searched once.
        scenario.clone()
    } else {
        scenario.on(PlantKind::Kinematic)
    }
}

/// Starts of the trial runs: listed starts, or corners of X_init and random draws.
pub(super) fn tried_starts(scenario: &Scenario) -> Vec<Start> {
    let bench = scenario.bench();
    if let Some(starts) = scenario.starts() {
        // Evenly spread over the list, which may be long.
        let every = starts.len().div_ceil(MAX_CORNERS as usize).max(1);
        return starts.into_iter().step_by(every).collect();
    }
    let axes = bench.axes();
    // With many axes only the corners of the first axes are tried.
    let corners = 1u32 << axes.len().min(MAX_CORNERS.ilog2() as usize);
    let corner = |bits: u32| {
        let picked = axes
            .iter()
            .enumerate()
            .map(|(i, axis)| match bits >> i & 1 {
                0 => axis.lo,
                _ => axis.hi,
            });
        Start(picked.collect())
    };
    let drawn = (0..TRIED_STARTS).map(|index| {
        bench.draw(StartKey {
            // Calibration starts, because training and test starts must stay
            // untouched.
            purpose: Purpose::Calibration,
            seed: 0,
            index,
        })
    });
    match scenario.kind() {
        ScenarioKind::Drive(_) => (0..corners).map(corner).chain(drawn).collect(),
        // On a grid two corners may be one cell, so only draws are starts.
        ScenarioKind::Grid(_) => drawn.collect(),
    }
}

/// Checks that no rule is broken, and ψ_ego not violated, at t = 0.
pub(super) fn begins_well(problems: &mut Problems, path: &ValuePath, scenario: &Scenario) {
    let tried = on_kinematic_plant(scenario);
    let mut bench = tried.bench();
    let rulebook = tried.rulebook();
    // Only bodies on roads can miss a meeting point or overlap.
    let spec = scenario.drive().map(DriveScenario::spec);
    let mut row = vec![0.0; bench.schema().len()];
    for start in tried_starts(&tried) {
        if let Some(spec) = spec
            && let Err((i, (why, cure))) = spec.admits(&start)
        {
            let agent = &spec.agents[i];
            let entry = entry_of(&path.to("agents"), &scenario.text, &agent.name);
            let words = in_words(&tried, &start);
            super::plans::refuse_encounter(problems, &entry, agent, why, cure, &words);
            return;
        }
        // One seed is enough, as nothing has been perceived yet.
        bench.begin(&start, 0, Aftermath::Skip);
        // An empty trace means that the first row was refused.
        if bench.trace().is_empty() {
            // One example suffices: the other starts probably have the same cause.
            let what = "a signal is not finite at the start".to_owned();
            problems.add(
                &path.to("signals"),
                what,
                "here",
                Some(in_words(&tried, &start)),
            );
            return;
        }
        if let Some((i, j)) = spec.and_then(|_| first_overlap(&bench)) {
            let names = bench.stage().agents;
            let (first, second) = (&names[i].name, &names[j].name);
            let what = format!("`{first}` and `{second}` may start inside each other");
            let place = entry_of(&path.to("agents"), &scenario.text, second).to("start");
            let help = Some(in_words(&tried, &start));
            problems.add(&place, what, "overlapping starts", help);
            return;
        }
        bench.trace().read_row(0, &mut row);
        // A specification that is lost on the first sample is lost under any
        // judge.
        let first = match rulebook.judge {
            JudgeKind::UntilContact => Cow::Owned(Rulebook {
                judge: JudgeKind::UntilViolation,
                ..rulebook.clone()
            }),
            _ => Cow::Borrowed(rulebook),
        };
        let mut judge = Judge::new(&first, bench.clock().samples());
        match judge.push(&first, bench.trace(), &row, None) {
            Some(Verdict::Foul { rule, .. }) => {
                let rule = &rulebook.rules[rule];
                let what = format!("the rule `{}` is broken already at the start", rule.name);
                let help = format!("{}; rules need ρ > 0", in_words(&tried, &start));
                let place = rule_place(scenario, rule);
                problems.add(&place, what, "ρ ≤ 0 at t = 0", Some(help));
                return;
            }
            Some(Verdict::Counterexample { .. }) => {
                let what = "the ego's specification is violated already at the start";
                let help = Some(in_words(&tried, &start));
                problems.add(&path.to("ego_spec"), what, "ρ < 0 at t = 0", help);
                return;
            }
            _ => {}
        }
    }
}

/// First two bodies that overlap from above.
fn first_overlap(bench: &Testbench) -> Option<(usize, usize)> {
    let (agents, frame) = (bench.stage().agents, bench.frame());
    let boxes: Vec<GroundRectangle> = agents
        .iter()
        .zip(&frame.placements)
        .map(|(who, place)| GroundRectangle::of(who.size_m, place))
        .collect();
    let mut pairs = (0..boxes.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
    pairs.find(|&(i, j)| boxes[i].overlaps(&boxes[j]))
}

/// Body as a rectangle on the ground.
struct GroundRectangle {
    centre_m: Point2<f64>,
    /// Half length along, and half width across.
    half_m: [Vector2<f64>; 2],
}

impl GroundRectangle {
    fn of(size_m: [f64; 3], place: &Placement) -> GroundRectangle {
        let frame = place.ground_frame();
        GroundRectangle {
            centre_m: frame.origin_m,
            half_m: [
                frame.ahead() * (0.5 * size_m[0]),
                frame.left() * (0.5 * size_m[1]),
            ],
        }
    }

    /// Returns true if no side of either rectangle separates them.
    fn overlaps(&self, other: &GroundRectangle) -> bool {
        let apart = other.centre_m - self.centre_m;
        let sides = || self.half_m.into_iter().chain(other.half_m);
        sides().all(|axis| {
            let reach: f64 = sides().map(|side| axis.dot(&side).abs()).sum();
            // Strict, so that bodies which only touch may start.
            axis.dot(&apart).abs() < reach
        })
    }
}

/// Entry of an agent in the file's list of agents.
pub(super) fn entry_of(list: &ValuePath, text: &str, name: &str) -> ValuePath {
    let quoted = format!("\"{name}\"");
    let mut entries = (0..MAX_AGENTS).map(|i| list.at(i));
    // Searched in the text, because the entry may differ from the position in
    // the spec.
    let found = entries.find(|entry| text[entry.to("name").find(text)] == quoted);
    found.unwrap_or_else(|| list.clone())
}

fn in_words(scenario: &Scenario, start: &Start) -> String {
    let axes = scenario.axes();
    let values = axes.iter().zip(&start.0);
    let list: Vec<String> = values
        .map(|(axis, value)| format!("{} = {value:.3} {}", axis.name, axis.unit))
        .collect();
    if list.is_empty() {
        "for the only start there is".to_owned()
    } else {
        format!("for example at {}", list.join(", "))
    }
}

/// Reports a rule that is broken whatever the ados do, which cannot be intended.
///
/// It is found by trial runs: constant actions for complete runs, and changing
/// actions.
///
/// Returns a warning for rules that no run kept together, or for a rule that
/// was broken in all of too few runs.
pub(super) fn can_be_kept(
    problems: &mut Problems,
    scenario: &Scenario,
) -> Option<(Oddity, Problem)> {
    let tried = on_kinematic_plant(scenario);
    let rules = &tried.rulebook().rules;
    let runs = rules_kept(&tried);
    let tries = runs.len();
    // Without runs, as with a program as the ego, no rule can be judged.
    if tries == 0 {
        return None;
    }
    // The diagonal shows whether a single rule was ever kept.
    let ever = |i: usize, j: usize| runs.iter().any(|kept| kept[i] && kept[j]);
    let numbered = || 0..rules.len();
    if let Some(broken) = numbered().find(|&i| !ever(i, i)) {
        let name = &rules[broken].name;
        let place = rule_place(scenario, &rules[broken]);
        if tries >= LEAST_TRIALS {
            let what = format!("the rule `{name}` cannot be kept");
            let help = format!("it was broken in each of {tries} runs with all kinds of actions");
            problems.add(&place, what, "ρ ≤ 0 whatever the ado does", Some(help));
            return None;
        }
        let runs = match tries {
            1 => "the one run".to_owned(),
            _ => format!("each of the {tries} runs"),
        };
        let problem = Problem {
            what: format!("the rule `{name}` was broken in {runs} that were tried"),
            span: place.find(&scenario.text),
            label: "can it be kept?".to_owned(),
            help: Some(
                "an episode is so long that more were not tried: shorten `horizon_s`".into(),
            ),
        };
        return Some((Oddity::BarelyTried, problem));
    }
    let mut pairs = numbered().flat_map(|j| (0..j).map(move |i| (i, j)));
    let (i, j) = pairs.find(|&(i, j)| !ever(i, j))?;
    Some(excluding(scenario, i, j, tries))
}

/// Warning for rules that no run to the horizon keeps, alone or together.
///
/// An episode may end before a rule requires anything. [`can_be_kept`] reads
/// episodes, so it considers `always[2, T] φ` kept by a run of one second. Here
/// only a contact ends a run, and every rule is evaluated on the complete run.
pub(super) fn kept_to_the_end(scenario: &Scenario) -> Option<(Oddity, Problem)> {
    let rules = &scenario.rulebook().rules;
    let runs = rules_kept_to_the_end(&on_kinematic_plant(scenario));
    let tries = runs.len();
    if tries < LEAST_TRIALS {
        return None;
    }
    let numbered = || 0..rules.len();
    let together = |i: usize, j: usize| runs.iter().any(|kept| kept[i] && kept[j]);
    if let Some(never) = numbered().find(|&i| !together(i, i)) {
        let name = &rules[never].name;
        let problem = Problem {
            what: format!("the rule `{name}` was kept to the end of none of {tries} runs"),
            span: rule_place(scenario, &rules[never]).find(&scenario.text),
            label: "can it be kept up to T?".to_owned(),
            help: Some("an episode that ends early may keep it: ask for less, or later".to_owned()),
        };
        return Some((Oddity::NeverKept, problem));
    }
    let mut pairs = numbered().flat_map(|j| (0..j).map(move |i| (i, j)));
    let (i, j) = pairs.find(|&(i, j)| !together(i, j))?;
    Some(excluding(scenario, i, j, tries))
}

/// Warning for two rules that no run kept together.
fn excluding(scenario: &Scenario, i: usize, j: usize, tries: usize) -> (Oddity, Problem) {
    let rules = &scenario.rulebook().rules;
    let (first, second) = (&rules[i].name, &rules[j].name);
    let problem = Problem {
        what: format!("the rules `{first}` and `{second}` were never kept together"),
        span: rule_place(scenario, &rules[j]).find(&scenario.text),
        label: format!("not together with `{first}`"),
        help: Some(format!(
            "each was kept in some of {tries} runs with all kinds of actions, both in none: \
             do they exclude each other?"
        )),
    };
    (Oddity::ExcludingRules, problem)
}

/// Kept rules of some runs to the horizon. The last run may have kept all.
fn rules_kept_to_the_end(tried: &Scenario) -> Vec<Vec<bool>> {
    // Without rules, and judged as a whole, no run ends before its horizon or
    // a contact.
    let lawless = Rulebook {
        rules: Vec::new(),
        judge: JudgeKind::WholeRun,
        ..tried.rulebook().clone()
    };
    let mut bench = Testbench::new(tried.world().scene(), Arc::new(lawless));
    let mut runs: Vec<Vec<bool>> = Vec::new();
    // An ego that is a program is not started for a warning.
    if bench.fork().is_none() || tried.rulebook().rules.is_empty() {
        return runs;
    }
    let (actions, neutral) = (bench.spaces().actions, bench.spaces().neutral);
    let mut scratch = crate::stl::Scratch::default();
    let (mut samples, affordable) = (0, affordable_samples(tried));
    for (i, start) in tried_starts(tried).iter().enumerate() {
        // The neutral action first: a run that keeps all rules ends the search
        // early.
        let others = (0..actions).filter(|action| *action != neutral);
        let constant = std::iter::once(neutral)
            .chain(others)
            .map(|action| Box::new(Constant(action)) as Box<dyn Actor>);
        let changing = HeldRandom::new(actions, 1 + i % MAX_HOLD);
        for mut actor in constant.chain([Box::new(changing) as Box<dyn Actor>]) {
            let episode = play(&mut bench, start, i as u64, &mut *actor, Aftermath::Skip);
            samples += episode.trace.len();
            let rules = tried.rulebook().rules.iter();
            let kept: Vec<bool> = rules
                .map(|rule| rule.monitor.robustness(&episode.trace, &mut scratch) > 0.0)
                .collect();
            let together = kept.iter().all(|kept| *kept);
            runs.push(kept);
            if together || runs.len() >= MAX_TRIALS || affordable <= samples {
                return runs;
            }
        }
    }
    runs
}

/// Kept rules of some runs. The last run may have kept all.
///
/// The number of samples is limited, not the number of runs. Runs that break a
/// rule end early, so there are many of them even if episodes are long.
fn rules_kept(tried: &Scenario) -> Vec<Vec<bool>> {
    let mut bench = tried.bench();
    let mut runs: Vec<Vec<bool>> = Vec::new();
    // An ego that is a program is not started here.
    if bench.fork().is_none() {
        return runs;
    }
    let actions = bench.spaces().actions;
    let mut scratch = crate::stl::Scratch::default();
    let (mut samples, affordable) = (0, affordable_samples(tried));
    for (i, start) in tried_starts(tried).iter().enumerate() {
        // Every start tries another action, so that all have their turn.
        let mut constant = Constant(i % actions);
        let mut changing = HeldRandom::new(actions, 1 + i % MAX_HOLD);
        let actors: [&mut dyn Actor; 2] = [&mut constant, &mut changing];
        for actor in actors {
            let episode = play(&mut bench, start, i as u64, actor, Aftermath::Skip);
            // Rules are judged on the samples up to the verdict, as in
            // training.
            let mut judged = episode.trace;
            judged.truncate(episode.judged);
            samples += judged.len();
            let kept: Vec<bool> = tried
                .rulebook()
                .rules
                .iter()
                .map(|rule| rule.monitor.robustness(&judged, &mut scratch) > 0.0)
                .collect();
            let together = kept.iter().all(|kept| *kept);
            runs.push(kept);
            if together || runs.len() >= MAX_TRIALS || affordable <= samples {
                return runs;
            }
        }
    }
    runs
}

/// Warning for coasting runs with ρ = 0 exactly, which are allowed but odd.
pub(super) fn tie(text: &str, scenario: &Scenario) -> Option<(Oddity, Problem)> {
    let tried = on_kinematic_plant(scenario);
    // Rules are left out, because breaking a rule would end the run. A rule
    // that is about to be broken passes through ρ = 0.
    let lawless = Rulebook {
        rules: Vec::new(),
        ..tried.rulebook().clone()
    };
    let mut bench = Testbench::new(tried.world().scene(), Arc::new(lawless));
    let neutral = bench.spaces().neutral;
    let mut scratch = crate::stl::Scratch::default();
    let affordable = affordable_samples(&tried) / bench.clock().samples();
    // An ego that is a program is not started for a warning.
    let runs = bench.fork().map_or(0, |_| affordable.max(1));
    let mut starts: Vec<Start> = tried_starts(&tried).into_iter().take(runs).collect();
    // Equal starts coast alike. Without axes there is only one.
    starts.dedup();
    for start in starts {
        let mut actor = Constant(neutral);
        let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Skip);
        let rules = &tried.rulebook().rules;
        let mut judged = episode.trace.clone();
        judged.truncate(episode.judged);
        let tie = rules
            .iter()
            .find(|rule| rule.monitor.robustness(&judged, &mut scratch) == 0.0);
        let top = ValuePath::top();
        let (what, place) = match tie {
            Some(rule) => (
                format!(
                    "a coasting run keeps the rule `{}` with ρ = 0 exactly",
                    rule.name
                ),
                rule_place(scenario, rule),
            ),
            // On a grid, whole numbers are compared, so ρ = 0 next to the ego
            // is no accident.
            None if episode.robustness == 0.0 && scenario.drive().is_some() => (
                "a coasting run satisfies the ego's specification with ρ = 0 exactly".to_owned(),
                top.to("ego_spec"),
            ),
            None => continue,
        };
        let problem = Problem {
            what,
            span: place.find(text),
            label: "neither kept nor broken".to_owned(),
            help: Some(format!(
                "{}; write it with slack, such as `>= -0.1`",
                in_words(&tried, &start)
            )),
        };
        return Some((Oddity::Tie, problem));
    }
    None
}
