//! Vacuous formulas, which hold or fail in every run.

use super::Scenario;
use super::dry_run::{on_kinematic_plant, tried_starts};
use super::scenario_kind::DriveScenario;
use super::warnings::{Oddity, formulas, rule_place};
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::Bounds;
use crate::stl::{Interval, Monitor, Scratch};
use crate::testbench::Aftermath;

/// Reports a specification that no run violates, and rules that no run keeps.
pub(super) fn check(problems: &mut Problems, path: &ValuePath, scenario: DriveScenario<'_>) {
    let bounds = scenario.spec().bounds();
    let ranges: Vec<Interval> = bounds.iter().map(|known| known.range).collect();
    check_spec(problems, &path.to("ego_spec"), &scenario, &bounds);
    for rule in &scenario.rulebook().rules {
        let range = rule.monitor.range(&ranges);
        // ρ = 0 counts as broken, so a rule requires more.
        if range.hi <= 0.0 {
            let what = format!("the rule `{}` cannot be kept", rule.name);
            let label = format!("ρ is at most {}", range.hi);
            let help = reasons(&scenario, &rule.monitor, &bounds);
            problems.add(&rule_place(&scenario, rule), what, &label, help);
        }
    }
}

fn check_spec(problems: &mut Problems, place: &ValuePath, scenario: &Scenario, bounds: &[Bounds]) {
    let ranges: Vec<Interval> = bounds.iter().map(|known| known.range).collect();
    let monitor = &scenario.rulebook().spec;
    let signals = monitor.signals();
    let range = monitor.range(&ranges);
    // Checked first, because no signal's bounds explain the range of a constant
    // formula.
    if signals.is_empty() {
        let what = "the ego's specification mentions no signal";
        let help = "say what the ego must never do, such as `always (ego.ado.gap >= 0.5)`";
        problems.add(place, what, "the same in every run", Some(help.to_owned()));
    } else if range.lo >= 0.0 {
        // ρ = 0 counts as satisfied, so a violation requires less.
        let what = "no run can violate the ego's specification";
        let label = format!("ρ is at least {}", range.lo);
        problems.add(place, what, &label, reasons(scenario, monitor, bounds));
    } else if signals.iter().all(|&signal| bounds[signal].untouched) {
        let what = "no ado can influence what the ego's specification is about";
        let names = named(scenario, &signals);
        let help = format!("it mentions only {names}: mention the ego or an ado");
        problems.add(place, what, "the same whatever an ado does", Some(help));
    }
}

/// Warnings for rules that no run can break.
pub(super) fn warnings(scenario: DriveScenario<'_>) -> Vec<(Oddity, Problem)> {
    let bounds = scenario.spec().bounds();
    let ranges: Vec<Interval> = bounds.iter().map(|known| known.range).collect();
    let rules = scenario.rulebook().rules.iter();
    let idle = rules.filter(|rule| rule.monitor.range(&ranges).lo > 0.0);
    idle.map(|rule| {
        let problem = Problem {
            what: format!("the rule `{}` cannot be broken", rule.name),
            span: rule_place(&scenario, rule).find(&scenario.text),
            label: "ρ > 0 whatever the ado does".to_owned(),
            help: reasons(&scenario, &rule.monitor, &bounds),
        };
        (Oddity::UnbreakableRule, problem)
    })
    .collect()
}

/// Warnings for formulas that the first sample decides at every tried start.
///
/// Such a formula lacks an `always`, or requires an event that has happened at the start.
pub(super) fn decided_at_once(scenario: &Scenario) -> Vec<(Oddity, Problem)> {
    let tried = on_kinematic_plant(scenario);
    // Of the tried world, whose monitors have the signals of its traces.
    let all = formulas(&tried);
    let can_be_decided = |i: &usize| {
        let monitor = all[*i].2;
        // A rule that looks ahead may be about some starts only, and others
        // keep it at once. The specification is the first formula.
        let may_look_ahead = *i == 0;
        // A formula without signals is reported as one that no run can break.
        let reads = !monitor.signals().is_empty();
        reads && (may_look_ahead || monitor.horizon_samples() == Some(0))
    };
    let mut decided: Vec<usize> = (0..all.len()).filter(can_be_decided).collect();
    let mut bench = tried.bench();
    let mut scratch = Scratch::default();
    for start in tried_starts(&tried) {
        // The first start already excludes every formula of usual worlds.
        if decided.is_empty() {
            break;
        }
        bench.begin(&start, 0, Aftermath::Skip);
        // The least ρ of all that may follow is 0 or more if the formula is
        // kept already.
        decided.retain(|&i| all[i].2.interval(bench.trace(), &mut scratch).lo >= 0.0);
    }
    let warning = |i: usize| {
        let (who, place, _) = &all[i];
        let problem = Problem {
            what: format!("the first sample alone decides {who}"),
            span: place.find(&scenario.text),
            label: "kept at the start, whatever follows".to_owned(),
            help: Some("did you mean `always (…)`?".to_owned()),
        };
        (Oddity::FirstSampleOnly, problem)
    };
    decided.into_iter().map(warning).collect()
}

/// Bounds of the signals that explain a formula's range.
fn reasons(scenario: &Scenario, monitor: &Monitor, bounds: &[Bounds]) -> Option<String> {
    let signals = scenario.world().schema().signals();
    let reasons = monitor.signals().into_iter().filter_map(|signal| {
        let name = &signals[signal].name;
        match bounds[signal].range {
            range if range == Interval::ANY => None,
            Interval { lo, hi } if hi == f64::INFINITY => {
                Some(format!("`{name}` is at least {lo}"))
            }
            Interval { lo, hi } => Some(format!("`{name}` lies in {lo} ..= {hi}")),
        }
    });
    let known: Vec<String> = reasons.collect();
    (!known.is_empty()).then(|| known.join(", "))
}

fn named(scenario: &Scenario, signals: &[usize]) -> String {
    let all = scenario.world().schema().signals();
    let names: Vec<String> = signals
        .iter()
        .map(|&signal| format!("`{}`", all[signal].name))
        .collect();
    names.join(", ")
}
