//! Verdict in words, for a reader of the animation.

use std::fmt::Write as _;

use re_sdk_types::archetypes::TextDocument;

use crate::experiment::action_runs;
use crate::rulebook::Verdict;
use crate::scene::Role;
use crate::stl::Explanation;
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::log_writer::LogWriter;
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;

pub(super) static PANEL: Panel = Panel {
    name: "verdict",
    column: Column::Words,
    shown: PanelWorlds::Everywhere,
    entities: &[("/verdict", "the verdict in words, and why")],
    log,
    views,
};

fn views(_: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let verdict = layout.view("TextDocument", "verdict", "/verdict", &["$origin"])?;
    Ok(vec![(verdict, 1.0)])
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let document = TextDocument::from_markdown(document(story));
    journal.always("verdict", &[&document])
}

/// Verdict document as markdown.
fn document(story: &ViewedEpisode<'_>) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_document(story, &mut text);
    text
}

fn write_document(story: &ViewedEpisode<'_>, text: &mut String) -> std::fmt::Result {
    let episode = story.episode;
    writeln!(text, "# {}\n", headline(story))?;
    writeln!(text, "*{}*\n", story.scenario.question)?;
    writeln!(text, "{}\n", sentence(story))?;
    if !story.caption.is_empty() {
        writeln!(text, "{}\n", story.caption)?;
    }
    if let Some(sample) = story.departs {
        let time_s = story.time_s(sample);
        writeln!(
            text,
            "**Beware:** from {time_s:.2} s on this build's re-simulation departs from the \
             recorded run; the cars show the former, the curves the latter.\n"
        )?;
    }
    writeln!(
        text,
        "| robustness ρ | {} |\n|---|---|",
        signed(episode.robustness)
    )?;
    if let Some(decided) = story.shown.decided {
        writeln!(text, "| decided at | {:.2} s |", decided.time_s)?;
    }
    match &episode.contact {
        Some(touch) => {
            let (a, b) = &touch.between;
            writeln!(text, "| contact | {:.3} s, {a} and {b} |", touch.time_s)?;
            writeln!(text, "| closing at | {:.2} m/s |", touch.closing_speed_mps)?;
        }
        None => writeln!(text, "| contact | none |")?,
    }
    writeln!(text, "| plant | {} |", story.scenario.plant())?;
    writeln!(text, "\n| start | |\n|---|---|")?;
    let axes = story.scenario.axes();
    for (axis, value) in axes.iter().zip(&episode.start.0) {
        writeln!(text, "| {} | {value:.2} {} |", axis.name, axis.unit)?;
    }
    writeln!(text, "\n**Actions**\n")?;
    for run in runs(story) {
        writeln!(text, "- {run}")?;
    }
    writeln!(text, "\n**Why**\n\n```text\n{}\n```", why(story))?;
    writeln!(text, "\n**Rules**\n")?;
    for (running, rule) in story.rules.iter().zip(&story.scenario.rulebook().rules) {
        let kept = match running.lost {
            // A rule that breaks after the verdict did not affect it.
            Some(sample) if sample < episode.judged => {
                format!("**broken** at {:.2} s", story.time_s(sample))
            }
            Some(sample) => {
                let time_s = story.time_s(sample);
                format!("kept until the verdict, **broken** at {time_s:.2} s")
            }
            None => "kept".to_owned(),
        };
        writeln!(text, "- {}: {} — {kept}", rule.ado, rule.name)?;
    }
    Ok(())
}

fn headline(story: &ViewedEpisode<'_>) -> String {
    match story.episode.verdict {
        Verdict::Counterexample { .. } => "Counterexample".to_owned(),
        Verdict::Uncounted { .. } => "Uncounted".to_owned(),
        Verdict::Held { .. } => "Held".to_owned(),
        Verdict::Foul { .. } => "Foul".to_owned(),
        Verdict::Invalid => "Invalid".to_owned(),
    }
}

/// Verdict in one sentence.
fn sentence(story: &ViewedEpisode<'_>) -> String {
    let names = |role: Role| {
        let cast = story
            .shown
            .stage
            .agents
            .iter()
            .filter(|who| who.role == role);
        let names: Vec<&str> = cast.map(|who| who.name.as_str()).collect();
        names.join(" and ")
    };
    let (ego, ados) = (names(Role::Ego), names(Role::Ado));
    let decided = story.shown.decided;
    let at = decided.map_or(String::new(), |it| format!(" at {:.2} s", it.time_s));
    match story.episode.verdict {
        Verdict::Counterexample { by } => format!(
            "**Yes, from this start:** {ado} kept every rule, and {ego} violated its \
             specification{at}, in the end by {by:.3}.",
            ado = if ados.is_empty() { "traffic" } else { &ados },
        ),
        Verdict::Uncounted { by } => format!(
            "**Not one that counts:** {ego} violated its specification{at}, in the end by \
             {by:.3}, but not in the way this world's `counts` asks for.",
        ),
        Verdict::Held { margin } => {
            format!("**Not this time:** {ego} kept its specification, with {margin:.3} to spare.")
        }
        Verdict::Foul { rule, .. } => {
            let rule = &story.scenario.rulebook().rules[rule];
            format!(
                "**This does not count:** {} broke its rule \"{}\"{at}.",
                rule.ado, rule.name
            )
        }
        Verdict::Invalid => match &story.episode.fault {
            Some(fault) => format!("**No success:** {fault}."),
            None => "**No success:** the run could not be judged.".to_owned(),
        },
    }
}

/// Explanation in words, with the instants that all panels have.
///
/// Its own instant is that of the deciding value, which can be later than that of the
/// verdict, so it is left to the last line.
fn why(story: &ViewedEpisode<'_>) -> String {
    let mut explanation = explanation(story);
    for step in &mut explanation.path {
        // Rounded, since a product of the sample time may print many digits.
        step.time_s = (1e3 * story.time_s(step.sample)).round() / 1e3;
    }
    let text = explanation.to_string();
    let Some((head, path)) = text.split_once('\n') else {
        return text;
    };
    let robustness = head
        .split_once(", decided at")
        .map_or(head, |(first, _)| first);
    let reason = head.split_once(')').map_or("", |(_, reason)| reason);
    format!("{robustness}{reason}\n{path}")
}

/// Explanation of the deciding value: the broken rule, or the specification.
fn explanation(story: &ViewedEpisode<'_>) -> Explanation {
    let rulebook = story.scenario.rulebook();
    let monitor = match story.episode.verdict {
        // A rule violation is explained by its rule, because ψ_ego was not decided.
        Verdict::Foul { rule, .. } => &rulebook.rules[rule].monitor,
        _ => &rulebook.spec,
    };
    monitor.explain(&story.episode.judged_trace())
}

/// Joint actions as runs such as `0.0-4.5 s: +3 m/s²`.
fn runs(story: &ViewedEpisode<'_>) -> Vec<String> {
    let mut runs = Vec::new();
    for run in action_runs(&story.episode.actions) {
        let from_s = story.time_s(story.decision_sample(run.from));
        // The last decision may extend beyond the end of the episode.
        let until = story.decision_sample(run.until);
        let to_s = story.time_s(until).min(story.end_s());
        let label = story.scenario.action_label(run.action);
        runs.push(format!("{from_s:.1}–{to_s:.1} s: {label}"));
    }
    runs
}

/// Robustness with its sign.
fn signed(value: f64) -> String {
    // A minus sign is as wide as a plus sign, and a hyphen is not.
    format!("{value:+.3}").replace('-', "−")
}
