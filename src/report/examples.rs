//! Counterexamples as curves: speeds, what ψ_ego reads, and why it is violated.

use maud::{Markup, html};

use super::plot::{Chart, Curve, Mark, chart};
use super::{Example, Report};
use crate::scenario::Scenario;
use crate::scene::Role;
use crate::testbench::Episode;
use crate::trace::{SignalKind, Trace};

/// One counterexample: numbers, curves and explanation.
pub(super) fn example(report: &Report<'_>, example: &Example) -> Markup {
    let scenario = report.scenario;
    let episode = &example.episode;
    let mut judged = episode.trace.clone();
    judged.truncate(episode.judged);
    let why = scenario.rulebook().spec.explain(&judged);
    html! {
        section class="card example" {
            div {
                h3 { (example.chosen_for) }
                p class="dim" { "Start " (example.start) ": " (start_in_words(scenario, episode)) }
                p class="dim" { "Actions: " (actions_in_words(scenario, episode)) }
                @for line in example.about.to_string().lines() { p { (line) } }
            }
            div class="cards" {
                @for picture in [speeds(scenario, episode), watched(scenario, episode)].into_iter().flatten() {
                    div { (chart(&picture)) }
                }
                pre { (why) }
            }
        }
    }
}

fn start_in_words(scenario: &Scenario, episode: &Episode) -> String {
    let axes = scenario.axes();
    let values = axes.iter().zip(&episode.start.0);
    let words = values.map(|(axis, value)| format!("{} {value:.2} {}", axis.name, axis.unit));
    words.collect::<Vec<_>>().join(", ")
}

/// Joint actions, each with how long it was held.
fn actions_in_words(scenario: &Scenario, episode: &Episode) -> String {
    let clock = *scenario.bench().clock();
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for action in &episode.actions {
        match runs.last_mut() {
            Some((last, times)) if last == action => *times += 1,
            _ => runs.push((*action, 1)),
        }
    }
    let words = runs.iter().map(|(action, times)| {
        let seconds = *times as f64 * clock.decision_s;
        format!("{} for {seconds:.2} s", scenario.action_label(*action))
    });
    words.collect::<Vec<_>>().join("; ")
}

/// The speeds of all agents.
fn speeds(scenario: &Scenario, episode: &Episode) -> Option<Chart> {
    let cast = scenario.bench().stage().cast;
    let curves = cast.iter().enumerate().filter_map(|(nth, who)| {
        let column = episode.trace.signal(&format!("{}.speed", who.name))?;
        Some(Curve {
            name: who.name.clone(),
            class: class_of(who.role, nth),
            points: over_time(&episode.trace, column),
        })
    });
    let curves: Vec<Curve> = curves.collect();
    (!curves.is_empty()).then(|| Chart {
        title: "Speeds".to_owned(),
        x_label: "time [s]".to_owned(),
        y_label: "speed [m/s]".to_owned(),
        curves,
        at_x: instants(episode),
        ..Chart::default()
    })
}

/// The signals that ψ_ego reads, with its bound where it has one.
fn watched(scenario: &Scenario, episode: &Episode) -> Option<Chart> {
    let trace = &episode.trace;
    let spec = &scenario.rulebook().spec;
    let signals = trace.schema().signals();
    let read: Vec<usize> = spec
        .signals()
        .into_iter()
        .filter(|i| signals[*i].kind == SignalKind::Real)
        .collect();
    let first = &signals[*read.first()?];
    let shown: Vec<usize> = read
        .iter()
        .copied()
        .filter(|i| signals[*i].unit == first.unit)
        .collect();
    let bound = match shown[..] {
        [only] => spec.invariant(trace).and_then(|margin| {
            let column = trace.column(only);
            let bound = column.first()? - margin.first()?;
            let constant = column
                .iter()
                .zip(&margin)
                .all(|(value, margin)| (value - margin - bound).abs() < 1e-9);
            constant.then_some(bound)
        }),
        _ => None,
    };
    let names: Vec<&str> = shown.iter().map(|i| signals[*i].name.as_str()).collect();
    let curves = shown.iter().enumerate().map(|(nth, i)| Curve {
        name: match shown.len() {
            1 => String::new(),
            _ => signals[*i].name.clone(),
        },
        class: format!("c-{}", nth % 6),
        points: over_time(trace, trace.column(*i)),
    });
    Some(Chart {
        title: names.join(", "),
        x_label: "time [s]".to_owned(),
        y_label: match first.unit.is_empty() {
            true => names.join(", "),
            false => format!("{} [{}]", names.join(", "), first.unit),
        },
        curves: curves.collect(),
        at_x: instants(episode),
        at_y: bound
            .map(|at| Mark {
                at,
                word: format!("bound of ψ_ego, {at:.2}"),
            })
            .into_iter()
            .collect(),
        ..Chart::default()
    })
}

fn instants(episode: &Episode) -> Vec<Mark> {
    let decided_s = episode.judged.saturating_sub(1) as f64 * episode.trace.dt_s();
    let violated = Mark {
        at: decided_s,
        word: "ψ_ego violated".to_owned(),
    };
    let contact = episode.contact.as_ref().map(|touch| Mark {
        at: touch.time_s,
        word: format!("contact, {:.1} m/s", touch.closing_speed_mps),
    });
    std::iter::once(violated).chain(contact).collect()
}

fn over_time(trace: &Trace, column: &[f64]) -> Vec<(f64, f64)> {
    let values = column.iter().enumerate();
    values
        .map(|(i, value)| (i as f64 * trace.dt_s(), *value))
        .collect()
}

fn class_of(role: Role, nth: usize) -> String {
    match role {
        Role::Ego => "c-ego".to_owned(),
        Role::Ado if nth < 2 => "c-ado".to_owned(),
        _ => format!("c-{}", 2 + nth % 4),
    }
}
