//! Page of a report, from top to bottom.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::examples::example;
use super::results::percent;
use super::{Nominal, Report, animation, lookup, results, reuse};
use crate::visible::visible_markup;
use crate::world::Scenario;

/// Colours and pictures, shared with the figures.
pub(super) const STYLE: &str = include_str!("style.css");
const PAGE_STYLE: &str = include_str!("page.css");

/// Head of a page, with additional style.
pub(super) fn head(title: &str, more_style: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="generator" content={ "brakecheck " (env!("CARGO_PKG_VERSION")) };
            title { (title) }
            style { (PreEscaped(STYLE)) (PreEscaped(PAGE_STYLE)) (PreEscaped(more_style)) }
        }
    }
}

pub(super) fn html(report: &Report<'_>) -> String {
    let scenario = report.scenario;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("brakecheck: {}", scenario.name), animation::STYLE))
            body { main {
                (opening(report))
                @if let Some(nominal) = &report.nominal { (seen(report, nominal)) }
                h2 { "Training" }
                (results::training(&report.trainings))
                @if let Some(nominal) = &report.nominal { (reuse::which_rate(&nominal.row, &report.trainings)) }
                @if let Some(nominal) = &report.nominal { (starts(report, nominal)) }
                @if let Some(coverage) = &report.coverage {
                    h2 { "What these starts covered" }
                    @for line in &coverage.verdict { p { (line) } }
                    (coverage.table.to_html())
                }
                @if !report.tested.is_empty() {
                    h2 { "Reuse: the same ado against other egos" }
                    p { (report.about_tested) }
                    (reuse::rows(&report.tested))
                }
                @if !report.sweeps.is_empty() {
                    h2 { "Over a parameter of the ego" }
                    p { "Starts on which any of the sweep's ados or searches makes the ego fail with that value, every rule kept." }
                    (results::sweeps(&report.sweeps))
                }
                @if report.costs.len() > 1 {
                    h2 { "What it costs" }
                    p { "One simulation is one episode. The trained ado has paid its training and then plays each start once; a search pays for every start." }
                    (results::costs(&report.costs))
                }
                (world(scenario))
                (again(report))
            }
            @if report.nominal.is_some() {
                script { (PreEscaped(animation::SCRIPT)) (PreEscaped(lookup::SCRIPT)) }
            } }
        }
    };
    visible_markup(&page.into_string()).into_owned()
}

fn opening(report: &Report<'_>) -> Markup {
    let scenario = report.scenario;
    html! {
        p class="dim" { "brakecheck report: " (scenario.name) @if let Some(ego) = &report.ego { ", ego " (ego) } }
        h1 { (scenario.question) }
        @if !scenario.source.is_empty() { p class="dim" { (scenario.source) } }
        @for note in &report.notes { p class="note" { (note) } }
        @if !report.faults.is_empty() {
            p class="note" { "What is below is no verdict on the ego:" }
            @for fault in &report.faults { p class="note" { (fault) } }
        }
        @if let Some(nominal) = &report.nominal {
            @let row = &nominal.row;
            @let all = row.starts + row.trivial;
            div class="tiles" {
                div class="tile" { b { (results::success(row)) } span { "starts on which the ego violates its specification, every rule kept [" (results::interval(row)) "]" } }
                div class="tile" { b { (results::share_of(all, row.trivial as f64 / all as f64)) } span { "of " (all) " starts fail without an adversary; left out" } }
                div class="tile" { b { (results::share_of(row.starts, row.foul_rate)) } span { "fouls: the ado broke a rule" } }
                div class="tile" { b { (results::share_of(row.starts, row.contact_rate)) } span { "end in contact" @if let Some(speed) = row.closing_speed_mps { ", closing at " (format!("{:.1}", speed.median)) " m/s (median), " (format!("{:.1}", speed.p90)) " m/s (90 %)" } @if let Some(late) = row.foul_before_contact_rate.filter(|_| row.starts > 0) { "; on " (percent(late)) " of the starts the ado broke a rule between the failure and the contact" } } }
                div class="tile" { b { (format!("{:.0} s", report.manifest.cpu_s)) } span { "of processor time trained the ado, " (report.manifest.decisions_done) " decisions" } }
                div class="tile" { b { (row.plant) } span { "plant; judged " (row.judge) } }
            }
        }
    }
}

fn seen(report: &Report<'_>, nominal: &Nominal) -> Markup {
    let all = nominal.highlights.len();
    html! {
        h2 { "Most informative counterexamples, the worst first" }
        @if nominal.row.starts == 0 {
            p { "No test start has a result." }
        } @else if nominal.highlights.is_empty() {
            p { "The ego violates its specification on none of the test starts." }
        } @else {
            p class="dim" { "Seen from above, at their true sizes, forward to the right. Each plays its last four seconds; press play, drag the slider or choose a still for the rest. Dashed outlines: where they were when the requirement was broken. Red lamps: braking." }
        }
        @for (nth, chosen) in nominal.highlights.iter().enumerate() { (example(report.scenario, chosen, nth, all)) }
    }
}

fn starts(report: &Report<'_>, nominal: &Nominal) -> Markup {
    html! {
        h2 { "Which starts fail" }
        (results::starts(nominal, &report.scenario.axes()))
    }
}

pub(super) fn world(scenario: &Scenario) -> Markup {
    let constants = &scenario.names.constants;
    let actions = scenario.world().spaces().actions;
    html! {
        h2 { "The world" }
        p { "The ego must keep ψ_ego, and the ado keeps its rules, the most important first:" }
        div class="wide" { table {
            thead { tr { th { "" } th { "agent" } th { "requirement" } th { "formula" } } }
            tbody {
                tr { td { "ψ_ego" } td { "ego" } td class="w" { @if let Some(requirement) = &scenario.requirement { (requirement) } } td class="w" { code { (scenario.ego_spec) } } }
                @for rule in &scenario.rules {
                    tr { td { "rule " (rule.priority + 1) } td { (rule.ado) } td class="w" { (rule.name) @if let Some(requirement) = &rule.requirement { " (" (requirement) ")" } } td class="w" { code { (rule.formula) } } }
                }
            }
        } }
        @if !constants.is_empty() {
            p { "Constants: " @for (n, (name, value)) in constants.iter().enumerate() { @if n > 0 { ", " } code { (name) " = " (value) } } "." }
        }
        p { "Actions: " @for action in 0..actions { @if action > 0 { "; " } (scenario.action_label(action)) } "." }
        details {
            summary { "Starts" }
            div class="wide" { table {
                thead { tr { th { "quantity" } th class="n" { "from" } th class="n" { "to" } th { "unit" } } }
                tbody { @for axis in scenario.axes() { tr { td { (axis.name) } td class="n" { (axis.lo) } td class="n" { (axis.hi) } td { (axis.unit) } } } }
            } }
        }
        details {
            summary { "Signals" }
            div class="wide" { table {
                thead { tr { th { "signal" } th { "unit" } th { "meaning" } } }
                tbody { @for (signal, _) in scenario.signals() { tr { td { code { (signal.name) } } td { (signal.unit) } td class="w" { (signal.about) } } } }
            } }
        }
        details { summary { "The world file" } pre { (scenario.text) } }
    }
}

fn again(report: &Report<'_>) -> Markup {
    let manifest = report.manifest;
    html! {
        h2 { "How to make it again" }
        pre { @for command in &report.commands { (command) "\n" } }
        p { "This page was made by brakecheck " (env!("CARGO_PKG_VERSION")) "; the run by " (manifest.brakecheck) " on " (manifest.target) ", seed " (manifest.seed) ", plant " (manifest.plant) @if let Some(learner) = &manifest.learner { ", learner " (learner) } "." }
        div class="wide" { table { tbody {
            tr { td { "world.ron" } td { "SHA-256 " code { (manifest.world_sha256) } } }
            tr { td { "policy.safetensors" } td { @match &manifest.policy_sha256 { Some(hash) => { "SHA-256 " code { (hash) } } None => { "not there yet" } } } }
        } } }
    }
}
