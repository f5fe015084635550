//! Counterexamples: an outcome, an animated picture and curves for each.

use maud::{Markup, html};

use super::Example;
use super::animation::{animation, colour_class};
use super::plot::{Chart, Curve, Mark, chart};
use super::verdict::{VerdictWords, ego_failed};
use crate::experiment::{action_runs, decided};
use crate::testbench::Episode;
use crate::trace::{SignalKind, Trace};
use crate::world::Scenario;

/// Returns one counterexample, which is number `nth` of `all`.
///
/// It consists of the outcome, the animated picture, the known facts and the
/// curves.
pub(super) fn example(scenario: &Scenario, example: &Example, nth: usize, all: usize) -> Markup {
    let episode = &example.episode;
    // The explanation must not read samples after the verdict.
    let why = scenario.rulebook().spec.explain(&episode.judged_trace());
    let verdict = VerdictWords::of(scenario, example);
    let (blame, blame_class) = &verdict.blame;
    html! {
        section class="card example" {
            div {
                p class="dim rank" { (nth + 1) " of " (all) " · " (example.chosen_for) @if let Some(start) = example.start { " · start " (start) } }
                h3 { (verdict.sentence()) }
                p class="badges" {
                    span class={ "badge " (blame_class) } { (blame) }
                    @if let Some(severity) = &example.about.severity {
                        span class="badge" { "closing " (format!("{:.1}", severity.closing_speed_mps)) " m/s" }
                        span class="badge" { "Δv " (format!("{:.1}", severity.impact.ego_delta_v_mps)) " m/s" }
                        @match &severity.injury_risk {
                            Some(risk) => { span class="badge" { (risk.curve.about()) ": " (format!("{:.1}", 100.0 * risk.probability)) " %" } }
                            None => { span class="badge" { "injury risk not computed" } }
                        }
                    }
                }
            }
            (animation(scenario, example, nth, &verdict))
            (known(scenario, example))
            div class="cards" {
                @for picture in [speeds(scenario, episode), watched(scenario, episode)].into_iter().flatten() {
                    div { (chart(&picture)) }
                }
            }
            @if let [road, replay, external] = &example.scenarios[..] {
                p class="dim" {
                    "As OpenSCENARIO: " a href=(replay) download { "the crash again" } ", "
                    a href=(external) download { "the others, for an ego of yours" } ", "
                    a href=(road) download { "their road" }
                }
            }
            details { summary { "Every action, and how ψ_ego comes to its value" } p { (actions_in_words(scenario, episode)) } pre { (why) } }
        }
    }
}

/// Known facts of a counterexample.
fn known(scenario: &Scenario, example: &Example) -> Markup {
    let (about, episode) = (&example.about, &example.episode);
    let after = about.after_contact.as_ref();
    let facts: [(&str, Option<String>); 9] = [
        ("How bad", about.severity.as_ref().map(ToString::to_string)),
        ("After it", after.map(|after| after.sentences().join("; "))),
        ("Why", about.why.as_ref().map(ToString::to_string)),
        (
            "Who avoids it",
            about.preventability.as_ref().map(ToString::to_string),
        ),
        (
            "How natural",
            about.naturalness.as_ref().map(ToString::to_string),
        ),
        (
            "How likely",
            about.traffic.as_ref().map(ToString::to_string),
        ),
        ("How small", about.shrunk.as_ref().map(ToString::to_string)),
        (
            "Still there",
            about.persistence.as_ref().map(ToString::to_string),
        ),
        ("Start", Some(start_in_words(scenario, episode))),
    ];
    html! {
        dl { @for (name, words) in facts { @if let Some(words) = words { dt { (name) } dd { (marked(&words)) } } } }
    }
}

/// Text in which backticks mark code.
fn marked(text: &str) -> Markup {
    html! {
        // Every second part lies between two backticks.
        @for (nth, part) in text.split('`').enumerate() {
            @if nth % 2 == 0 { (part) } @else { code { (part) } }
        }
    }
}

fn start_in_words(scenario: &Scenario, episode: &Episode) -> String {
    let axes = scenario.axes();
    let values = axes.iter().zip(&episode.start.0);
    let words = values.map(|(axis, value)| format!("{} {value:.2} {}", axis.name, axis.unit));
    words.collect::<Vec<_>>().join(", ")
}

/// Joint actions with their durations.
fn actions_in_words(scenario: &Scenario, episode: &Episode) -> String {
    let decision_s = scenario.bench().clock().decision_s;
    let words = action_runs(&episode.actions).into_iter().map(|run| {
        let seconds = (run.until - run.from) as f64 * decision_s;
        format!("{} for {seconds:.2} s", scenario.action_label(run.action))
    });
    words.collect::<Vec<_>>().join("; ")
}

/// Speeds of all agents.
fn speeds(scenario: &Scenario, episode: &Episode) -> Option<Chart> {
    let agents = scenario.bench().stage().agents;
    let found = agents.iter().enumerate().filter_map(|(nth, who)| {
        let column = episode.trace.signal(&format!("{}.speed", who.name))?;
        Some(Curve {
            name: who.name.clone(),
            class: colour_class(&agents, nth),
            points: over_time(&episode.trace, column),
            dots: Vec::new(),
        })
    });
    let curves: Vec<Curve> = found.collect();
    (!curves.is_empty()).then(|| Chart {
        title: "Speeds".to_owned(),
        x_label: "time [s]".to_owned(),
        y_label: "speed [m/s]".to_owned(),
        curves,
        at_x: instants(scenario, episode),
        ..Chart::default()
    })
}

/// Signals that ψ_ego reads, with its bound, if any.
fn watched(scenario: &Scenario, episode: &Episode) -> Option<Chart> {
    let trace = &episode.trace;
    let spec = &scenario.rulebook().spec;
    let signals = trace.schema().signals();
    let read: Vec<usize> = spec
        .signals()
        .into_iter()
        .filter(|i| signals[*i].kind == SignalKind::Real)
        .collect();
    // A formula over flags alone has no curve.
    let first = &signals[*read.first()?];
    // Only signals of the first unit share an axis.
    let shown: Vec<usize> = read
        .iter()
        .copied()
        .filter(|i| signals[*i].unit == first.unit)
        .collect();
    // A bound is drawn if the margin is the signal less a constant. With
    // several signals no single bound exists.
    let bound = match shown[..] {
        [only] => spec.invariant(trace).and_then(|margin| {
            let column = trace.column(only);
            let bound = column.first()? - margin.first()?;
            let constant = column
                .iter()
                .zip(&margin)
                // Rounding alone, since the margin is a difference of the same
                // numbers.
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
        // The colours of the ego and the ados stay reserved.
        class: format!("c-{}", 2 + (nth + 1) % 4),
        points: over_time(trace, trace.column(*i)),
        dots: Vec::new(),
    });
    Some(Chart {
        title: names.join(", "),
        x_label: "time [s]".to_owned(),
        y_label: if first.unit.is_empty() {
            names.join(", ")
        } else {
            format!("{} [{}]", names.join(", "), first.unit)
        },
        curves: curves.collect(),
        at_x: instants(scenario, episode),
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

fn instants(scenario: &Scenario, episode: &Episode) -> Vec<Mark> {
    // A specification that holds is decided, too, but not violated.
    let decided = decided(scenario, episode).filter(|_| ego_failed(episode));
    let violated = decided.map(|decided| Mark {
        at: decided.time_s,
        word: "ψ_ego violated".to_owned(),
    });
    let contact = episode.contact.as_ref().map(|touch| Mark {
        at: touch.time_s,
        word: format!("contact, {:.1} m/s", touch.closing_speed_mps),
    });
    violated.into_iter().chain(contact).collect()
}

fn over_time(trace: &Trace, column: &[f64]) -> Vec<(f64, f64)> {
    let values = column.iter().enumerate();
    values
        .map(|(i, value)| (i as f64 * trace.dt_s(), *value))
        .collect()
}
