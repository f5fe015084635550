//! Log of events, in the order of time.

use re_sdk_types::archetypes::TextLog;
use re_sdk_types::blueprint::archetypes::TextLogColumns;
use re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use re_sdk_types::components::TextLogLevel;

use crate::experiment::{action_runs, phase_word};
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::log_writer::{LogWriter, clock};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;

pub(super) static PANEL: Panel = Panel {
    name: "events",
    column: Column::Space,
    shown: PanelWorlds::Everywhere,
    entities: &[(
        "/verdict/events",
        "the log: actions, phases, violations, contact, collisions after it",
    )],
    log,
    views,
};

fn views(_: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let events = layout.view("TextLog", "events", "/verdict/events", &["$origin"])?;
    layout.property(&events, "TextLogColumns", &bodies_only())?;
    Ok(vec![(events, 1.6)])
}

/// Column of texts only, since all lines of the log come from one entity.
fn bodies_only() -> TextLogColumns {
    TextLogColumns::update_fields().with_text_log_columns([TextLogColumn {
        kind: TextLogColumnKind::Body,
        visible: true.into(),
    }])
}

fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let events = events(story);
    let log = TextLog::update_fields()
        .with_many_text(events.iter().map(|event| event.text.as_str()))
        .with_many_level(events.iter().map(|event| {
            if event.grave {
                TextLogLevel::WARN
            } else {
                TextLogLevel::INFO
            }
        }));
    let clock = clock(events.iter().map(|event| (event.sample, event.time_s)));
    journal.columns("verdict/events", clock, log.columns_of_unit_batches())
}

/// Event at one instant.
struct Event {
    sample: usize,
    time_s: f64,
    text: String,
    /// True for a violation, a fault, a verdict or a contact.
    grave: bool,
}

/// Events with a line in the log, in the order of time.
fn events(story: &ViewedEpisode<'_>) -> Vec<Event> {
    let mut events = Vec::new();
    let mut push = |sample: usize, time_s: f64, text: String, grave: bool| {
        events.push(Event {
            sample,
            time_s,
            text,
            grave,
        });
    };
    for run in action_runs(&story.episode.actions) {
        let sample = story.decision_sample(run.from);
        let label = story.scenario.action_label(run.action);
        push(
            sample,
            story.time_s(sample),
            format!("action {label}"),
            false,
        );
    }
    for (l, light) in story.shown.stage.lights.iter().enumerate() {
        for (at, phase) in story.shown.light_turns(l) {
            let text = format!("{} is {}", light.name, phase_word(phase));
            push(at.sample, at.time_s, text, false);
        }
    }
    if let Some(sample) = story.spec.lost {
        let text = "the ego's specification is violated".to_owned();
        push(sample, story.time_s(sample), text, true);
    }
    for rule in &story.rules {
        if let Some(sample) = rule.lost {
            let text = format!("rule broken: {}", rule.name);
            push(sample, story.time_s(sample), text, true);
        }
    }
    // Only an episode with an aftermath has samples after its verdict.
    if story.shown.decided.is_some() && story.episode.judged < story.samples() {
        // Invariant: a decided episode has judged at least one sample.
        let sample = story.episode.judged - 1;
        let word = story.episode.verdict.word();
        let text = format!("verdict: {word}; what follows is aftermath");
        push(sample, story.time_s(sample), text, true);
    }
    let last = story.samples().saturating_sub(1);
    if let Some(fault) = &story.episode.fault {
        push(last, story.end_s(), fault.to_string(), true);
    }
    if let Some(touch) = &story.episode.contact {
        let (a, b) = &touch.between;
        let closing = touch.closing_speed_mps;
        let text = format!("contact of {a} and {b}, closing at {closing:.2} m/s");
        // The instant of the contact lies between two samples.
        push(story.sample_of(touch.time_s), touch.time_s, text, true);
    }
    if let Some(after) = &story.after {
        for (time_s, text) in after.events() {
            // The pose at or after the event.
            let mut poses = story.pose_instants();
            let pose = poses.find(|(_, pose_s)| time_s <= pose_s + 1e-9);
            let sample = pose.map_or(last, |(sample, _)| sample);
            push(sample, time_s, format!("after the contact: {text}"), true);
        }
    }
    // The sort is stable: events of one instant keep the order of their causes
    // above.
    events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    events
}
