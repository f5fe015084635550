//! Traffic lights: a post beside the stop line, and its phases over time.

use re_sdk_types::archetypes::Transform3D;
use re_sdk_types::archetypes::{Boxes3D, LineStrips3D, Points3D, StateConfiguration};
use re_sdk_types::components::Color;
use re_sdk_types::components::FillMode;

use super::entity::{agent_path, path};
use super::error::ViewError;
use super::lines::log_states;
use super::log_writer::LogWriter;
use super::palette;
use super::space::{distance, lifted, quaternion};
use super::viewed_episode::ViewedEpisode;
use crate::ego::Phase;
use crate::experiment::{SampleInstant, phase_word};
use crate::scene::LightPost;
use crate::sim::Placement;

/// Distance of the post from the right edge of the road, in metres.
const ASIDE_M: f32 = 1.0;
/// Height of the middle lamp, in metres.
const LAMP_M: f32 = 3.2;
/// Distance between lamps, in metres.
const APART_M: f32 = 0.42;
/// Width of the stop line, in metres.
const LINE_M: f32 = 0.5;

/// Phases from the top lamp to the bottom lamp.
const PHASES: [Phase; 3] = [Phase::Red, Phase::Yellow, Phase::Green];

/// Logs every light at its place, with its lit lamp.
pub(super) fn log_posts(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    for (l, light) in story.shown.stage.lights.iter().enumerate() {
        log_post(light, journal)?;
        for (instant, phase) in story.shown.light_turns(l) {
            log_lit(light, instant, phase, journal)?;
        }
    }
    Ok(())
}

/// Logs the phases of every light as coloured lanes.
pub(super) fn log_phases(
    story: &ViewedEpisode<'_>,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    for (l, light) in story.shown.stage.lights.iter().enumerate() {
        log_lanes(story, light, &story.shown.light_turns(l), journal)?;
    }
    Ok(())
}

/// Logs the post with dark lamps.
///
/// Its frame is at the right end of the stop line: x along the road, y along
/// the line to the left.
fn log_post(light: &LightPost, journal: &mut LogWriter) -> Result<(), ViewError> {
    let [right, left] = light.stop_line_m;
    let turn_rad = (left[1] - right[1]).atan2(left[0] - right[0]) - std::f64::consts::FRAC_PI_2;
    let frame = Transform3D::from_translation(lifted(right, 0.0))
        .with_quaternion(quaternion(&Placement::upright(right, turn_rad)));
    let mast = LineStrips3D::new([[[0.0, -ASIDE_M, 0.0], [0.0, -ASIDE_M, LAMP_M]]])
        .with_radii([0.07])
        .with_colors([palette::POST]);
    // Dark lamps lie slightly behind the lit lamp, which covers its dark twin.
    let lamps = PHASES.map(|phase| lamp(phase, -0.12));
    let (mut centres, mut sizes) = (vec![[0.0, -ASIDE_M, LAMP_M]], vec![[0.2, 0.5, 1.4]]);
    let mut colours = vec![palette::TYRE];
    for (centre, phase) in lamps.into_iter().zip(PHASES) {
        centres.push(centre);
        sizes.push([0.06, 0.3, 0.3]);
        colours.push(palette::dimmed(palette::of_phase(phase), 0.25));
    }
    let housing = Boxes3D::from_centers_and_sizes(centres, sizes)
        .with_colors(colours)
        .with_fill_mode(FillMode::Solid);
    journal.always(agent_path(&light.name), &[&frame, &mast, &housing])
}

fn lamp(phase: Phase, ahead_m: f32) -> [f32; 3] {
    // A phase without a lamp of its own is shown in the middle.
    let down = PHASES.iter().position(|other| *other == phase).unwrap_or(1) as f32;
    [ahead_m, -ASIDE_M, LAMP_M + (1.0 - down) * APART_M]
}

/// Logs the lit lamp and the stop line in its colour, from a sample on.
fn log_lit(
    light: &LightPost,
    instant: SampleInstant,
    phase: Phase,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let [right, left] = light.stop_line_m;
    // The only cast from lengths to pictures here.
    let width_m = distance(right, left) as f32;
    let line =
        Boxes3D::from_centers_and_sizes([[0.0, 0.5 * width_m, 0.02]], [[LINE_M, width_m, 0.03]])
            .with_colors([palette::of_phase(phase)])
            .with_fill_mode(FillMode::Solid);
    let lamp = Points3D::new([lamp(phase, -0.2)])
        .with_radii([0.2])
        .with_colors([palette::of_phase(phase)])
        .with_labels([format!("{} {}", light.name, phase_word(phase))]);
    let entity = agent_path(&light.name).join(&path(["lit"]));
    journal.from(instant, entity, &[&line, &lamp])
}

/// Logs the phases of one light as coloured lanes.
fn log_lanes(
    story: &ViewedEpisode<'_>,
    light: &LightPost,
    turns: &[(SampleInstant, Phase)],
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let entity = path(["lights", &light.name]);
    let colour = |phase: Phase| {
        let [r, g, b] = palette::dimmed(palette::of_phase(phase), 0.75);
        Color::from_rgb(r, g, b)
    };
    let lanes = StateConfiguration::new()
        .with_values(PHASES.map(phase_word))
        .with_labels(PHASES.map(phase_word))
        .with_colors(PHASES.map(colour));
    journal.always(entity.clone(), &[&lanes])?;
    let instants = turns
        .iter()
        .map(|(instant, _)| (instant.sample, instant.time_s));
    let states = turns.iter().map(|(_, phase)| phase_word(*phase));
    log_states(entity, instants, states, story, journal)
}
