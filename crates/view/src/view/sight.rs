//! Sight of the ego: which bodies it sees, as lanes and as frames around hidden bodies.

use re_sdk_types::archetypes::{Boxes3D, Clear, StateConfiguration};

use super::entity::{agent_path, path};
use super::error::ViewError;
use super::lines::{colour, log_states};
use super::log_writer::LogWriter;
use super::palette;
use super::viewed_episode::ViewedEpisode;
use crate::experiment::SampleInstant;

/// States of an agent, and the label of a hidden one.
const STATES: [&str; 2] = ["hidden from the ego", "seen by the ego"];

/// Instants at which the ego begins or ceases to see an agent, including the first.
///
/// Without sensors that can miss an agent there are none.
fn turns(story: &ViewedEpisode<'_>, who: usize) -> Vec<(SampleInstant, bool)> {
    let mut turns: Vec<(SampleInstant, bool)> = Vec::new();
    for it in &story.shown.frames {
        let Some(seen) = it.frame.seen.as_ref().and_then(|seen| seen.get(who)) else {
            continue;
        };
        if turns.last().is_none_or(|(_, last)| last != seen) {
            let (sample, time_s) = (it.sample, it.time_s);
            turns.push((SampleInstant { sample, time_s }, *seen));
        }
    }
    turns
}

/// Members of the cast that the ego may see, with the instants at which that changes.
fn watched<'a>(
    story: &'a ViewedEpisode<'_>,
) -> impl Iterator<Item = (usize, Vec<(SampleInstant, bool)>)> + 'a {
    let others = (0..story.shown.stage.agents.len()).filter(|who| *who != story.ego());
    let watched = others.map(|who| (who, turns(story, who)));
    watched.filter(|(_, turns)| !turns.is_empty())
}

/// Number of lanes.
pub(super) fn lanes(story: &ViewedEpisode<'_>) -> usize {
    watched(story).count()
}

/// Logs when the ego sees each agent, as coloured lanes.
pub(super) fn log_lanes(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    for (who, turns) in watched(story) {
        let entity = path(["sight", &story.shown.stage.agents[who].name]);
        let lanes = StateConfiguration::new()
            .with_values(STATES)
            .with_labels(STATES)
            .with_colors([palette::HIDDEN, palette::IDLE].map(colour));
        journal.always(entity.clone(), &[&lanes])?;
        let instants = turns.iter().map(|(at, _)| (at.sample, at.time_s));
        let states = turns.iter().map(|(_, seen)| STATES[usize::from(*seen)]);
        log_states(entity, instants, states, story, journal)?;
    }
    Ok(())
}

/// Logs a labelled frame around each agent while the ego does not see it.
pub(super) fn log_frames(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    for (who, turns) in watched(story) {
        let agent = &story.shown.stage.agents[who];
        let entity = agent_path(&agent.name).join(&path(["hidden"]));
        // Slightly larger than the body, whose faces would cover its edges.
        let size = agent.size_m.map(|size_m| size_m as f32 + 0.2);
        for (at, seen) in turns {
            if seen {
                // Data holds until it is replaced, so a frame has to be
                // cleared.
                journal.from(at, entity.clone(), &[&Clear::flat()])?;
                continue;
            }
            let frame = Boxes3D::from_sizes([size])
                .with_colors([palette::HIDDEN])
                .with_radii([0.04])
                .with_labels([STATES[0]]);
            journal.from(at, entity.clone(), &[&frame])?;
        }
    }
    Ok(())
}
