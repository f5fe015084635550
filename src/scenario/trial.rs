//! Trying a world at load: what only a run can show.

use super::Scenario;
use super::check::Problems;
use super::error::Problem;
use super::locate::Path;
use crate::rulebook::{Judge, Verdict};
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;
use crate::testbench::{Actor, Aftermath, Constant, Held, play};

/// Starts on which a world is tried at load, besides the corners of X_init.
const TRIED_STARTS: u64 = 32;
/// Corners of X_init that are tried at most.
const MAX_CORNERS: u32 = 256;
/// Samples spent at most on trying coasting runs at load.
const TRIED_SAMPLES: usize = 200_000;
/// Runs in search of one that keeps every rule.
const MAX_TRIALS: usize = 200;
/// Decisions for which changing actions are held at most.
const MAX_HOLD: usize = 12;

/// Starts to try a world on: those it lists, or corners of X_init and draws.
fn tried_starts(scenario: &Scenario) -> Vec<Start> {
    let bench = scenario.bench();
    if let Some(starts) = scenario.starts() {
        let every = starts.len().div_ceil(MAX_CORNERS as usize).max(1);
        return starts.into_iter().step_by(every).collect();
    }
    let axes = bench.axes();
    let corners = 1u32 << axes.len().min(MAX_CORNERS.ilog2() as usize);
    let corner = |bits: u32| {
        let pick = |(i, axis): (usize, &crate::scene::Axis)| match bits >> i & 1 {
            0 => axis.lo,
            _ => axis.hi,
        };
        Start(axes.iter().enumerate().map(pick).collect())
    };
    let drawn = (0..TRIED_STARTS).map(|index| {
        bench.draw(StartKey {
            purpose: Purpose::Calibration,
            seed: 0,
            index,
        })
    });
    match scenario.drive() {
        Some(_) => (0..corners).map(corner).chain(drawn).collect(),
        // On a grid two corners may be one cell: only draws are starts.
        None => drawn.collect(),
    }
}

/// At t = 0 no rule may be broken already, nor ψ_ego be lost.
pub(super) fn begins_well(problems: &mut Problems, path: &Path, scenario: &Scenario) {
    let tried = scenario.on(PlantKind::Kinematic);
    let mut bench = tried.bench();
    let rulebook = tried.rulebook();
    let mut row = vec![0.0; bench.schema().len()];
    for start in tried_starts(&tried) {
        bench.begin(&start, 0, Aftermath::Skip);
        if bench.trace().is_empty() {
            let what = "a signal is not finite at the start".to_owned();
            problems.add(
                &path.to("signals"),
                what,
                "here",
                Some(in_words(&tried, &start)),
            );
            return;
        }
        bench.trace().read_row(0, &mut row);
        let mut judge = Judge::new(rulebook, bench.clock().samples());
        match judge.push(rulebook, bench.trace(), &row, None) {
            Some(Verdict::Foul { rule, .. }) => {
                let rule = &rulebook.rules[rule];
                let what = format!("the rule `{}` is broken already at the start", rule.name);
                let help = format!("{}; rules need ρ > 0", in_words(&tried, &start));
                let place = rule_place(scenario, &rule.name);
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

fn in_words(scenario: &Scenario, start: &Start) -> String {
    let axes = scenario.axes();
    let values = axes.iter().zip(&start.0);
    let list: Vec<String> = values
        .map(|(axis, value)| format!("{} = {value:.3} {}", axis.name, axis.unit))
        .collect();
    match list.is_empty() {
        true => "for the only start there is".to_owned(),
        false => format!("for example at {}", list.join(", ")),
    }
}

fn rule_place(scenario: &Scenario, rule: &str) -> Path {
    let mut rules = scenario.rules.iter();
    let found = rules.find(|spec| spec.name == rule);
    found.map_or_else(Path::top, |spec| spec.place.clone())
}

/// A rule that is broken however the ados act cannot be meant.
///
/// Found by trying: every action for the whole run, and changing ones.
pub(super) fn can_be_kept(problems: &mut Problems, scenario: &Scenario) {
    let tried = scenario.on(PlantKind::Kinematic);
    let mut bench = tried.bench();
    let actions = bench.spaces().actions;
    let rules = &tried.rulebook().rules;
    let mut scratch = crate::stl::Scratch::default();
    let mut kept = vec![false; rules.len()];
    let mut runs = 0;
    // A program as the ego is not run for this.
    let affordable = TRIED_SAMPLES / bench.clock().samples();
    let most = bench.fork().map_or(0, |_| affordable.clamp(1, MAX_TRIALS));
    for (i, start) in tried_starts(&tried).iter().enumerate() {
        let mut constant = Constant(i % actions);
        let mut changing = Held::new(actions, 1 + i % MAX_HOLD);
        let actors: [&mut dyn Actor; 2] = [&mut constant, &mut changing];
        for actor in actors {
            if most <= runs || kept.iter().all(|kept| *kept) {
                break;
            }
            let episode = play(&mut bench, start, i as u64, actor, Aftermath::Skip);
            let mut judged = episode.trace;
            judged.truncate(episode.judged);
            runs += 1;
            for (kept, rule) in kept.iter_mut().zip(rules) {
                *kept = *kept || 0.0 < rule.monitor.robustness(&judged, &mut scratch);
            }
        }
    }
    let broken = rules.iter().zip(&kept).find(|(_, kept)| !**kept);
    if let (Some((rule, _)), true) = (broken, 0 < runs) {
        let what = format!("the rule `{}` cannot be kept", rule.name);
        let help = format!("it was broken in each of {runs} runs with all kinds of actions");
        let place = rule_place(scenario, &rule.name);
        problems.add(&place, what, "ρ ≤ 0 whatever the ado does", Some(help));
    }
}

/// What is allowed but odd: coasting runs that sit at ρ = 0 exactly.
pub(super) fn warnings(text: &str, scenario: &Scenario) -> Vec<Problem> {
    let tried = scenario.on(PlantKind::Kinematic);
    let mut bench = tried.bench();
    let neutral = bench.spaces().neutral;
    let mut scratch = crate::stl::Scratch::default();
    let affordable = TRIED_SAMPLES / bench.clock().samples();
    // A program as the ego is not run for a warning's sake.
    let affordable = bench.fork().map_or(0, |_| affordable.max(1));
    for start in tried_starts(&tried).into_iter().take(affordable) {
        let mut actor = Constant(neutral);
        let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Skip);
        let rules = &tried.rulebook().rules;
        let mut judged = episode.trace.clone();
        judged.truncate(episode.judged);
        let tie = rules
            .iter()
            .find(|rule| rule.monitor.robustness(&judged, &mut scratch) == 0.0);
        let top = Path::top();
        let (what, place) = match tie {
            Some(rule) => (
                format!(
                    "a coasting run keeps the rule `{}` with ρ = 0 exactly",
                    rule.name
                ),
                rule_place(scenario, &rule.name),
            ),
            // On a grid whole numbers meet: next to the ego is ρ = 0, a capture 1.
            None if episode.robustness == 0.0 && scenario.drive().is_some() => (
                "a coasting run satisfies the ego's specification with ρ = 0 exactly".to_owned(),
                top.to("ego_spec"),
            ),
            None => continue,
        };
        return vec![Problem {
            what,
            span: place.find(text),
            label: "neither kept nor broken".to_owned(),
            help: Some(format!(
                "{}; write it with slack, such as `>= -0.1`",
                in_words(&tried, &start)
            )),
        }];
    }
    Vec::new()
}
