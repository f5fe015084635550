//! World in space: moving bodies, paths and the place of contact.

use re_log_types::EntityPath;
use re_sdk_types::archetypes::{Arrows3D, LineStrips3D, Points3D, Transform3D};
use re_sdk_types::blueprint::archetypes::Background;
use re_sdk_types::blueprint::components::BackgroundKind;

use crate::experiment::SampleInstant;
use crate::rulebook::Verdict;
use crate::scene::Frame;
use crate::sim::Placement;
use crate::view::camera::{FOLLOW, SPACE, ViewExtent, look};
use crate::view::entity::{agent_path, path};
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::log_writer::{LogWriter, clock};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::space::{distance, lifted, quaternion};
use crate::view::viewed_episode::ViewedEpisode;
use crate::view::{figure, lights, palette, road, sight};

pub(super) static PANEL: Panel = Panel {
    name: "scene",
    column: Column::Space,
    shown: PanelWorlds::OnRoads,
    entities: &[
        ("/world/road", "surface, lane markings, a post every 10 m"),
        ("/world/<agent>", "body, moved by its transform"),
        (
            "/world/<agent>/velocity",
            "an arrow as long as the way in 0.5 s",
        ),
        (
            "/world/<agent>/hidden",
            "a frame around a body that the ego does not see",
        ),
        ("/world/<light>", "a post with its dark lamps"),
        (
            "/world/<light>/lit",
            "the lamp that is lit and the stop line in its colour",
        ),
        ("/trails", "everybody's path on the ground"),
        (
            "/follow",
            "a frame that goes with the ego, upright: the cameras'",
        ),
        (
            "/contact",
            "where and how fast two agents met, from that instant on",
        ),
        (
            "/verdict/mark",
            "where the ego was when the verdict became certain",
        ),
    ],
    log,
    views,
};

/// Time in seconds in which an agent covers the length of its arrow.
const ARROW_S: f64 = 0.5;

/// Scene from behind the ego, with room for the agents ahead.
fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let around = ViewExtent::of(story);
    let view = layout.view("3D", "scene", FOLLOW, &SPACE)?;
    let sky = Background::new(BackgroundKind::SolidColor)
        .with_color(re_sdk_types::components::Color::from_rgb(17, 20, 26));
    layout.property(&view, "Background", &sky)?;
    let (eye_m, at_m) = around.seen_aslant();
    look(layout, &view, eye_m, at_m, [0.0, 0.0, 1.0])?;
    Ok(vec![(view, 5.0)])
}

/// Logs all entities with a place in the world.
fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    road::log(story, journal)?;
    lights::log_posts(story, journal)?;
    let around = ViewExtent::of(story);
    for who in 0..story.shown.stage.agents.len() {
        figure::log(story, who, &around, journal)?;
        // After the figure, which is in the frame that this moves.
        log_motion(story, who, journal)?;
        log_velocity(story, who, journal)?;
    }
    sight::log_frames(story, journal)?;
    log_trails(story, journal)?;
    log_follow(story, journal)?;
    log_contact(story, journal)?;
    log_verdict_mark(story, journal)
}

/// Logs the pose of an agent, sample by sample.
fn log_motion(
    story: &ViewedEpisode<'_>,
    who: usize,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let placements = story.poses().map(|frame| frame.placements[who]);
    let entity = agent_path(&story.shown.stage.agents[who].name);
    log_transforms(story, entity, placements, journal)
}

/// Logs an arrow above the roof of an agent, as long as its way in [`ARROW_S`].
///
/// From the front it would end inside the agent ahead.
fn log_velocity(
    story: &ViewedEpisode<'_>,
    who: usize,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let agent = &story.shown.stage.agents[who];
    let entity = agent_path(&agent.name).join(&path(["velocity"]));
    // In the frame of the body, whose origin is its centre.
    let roof = lifted([0.0, 0.0, 0.5 * agent.size_m[2]], 0.25);
    let arrow = Arrows3D::update_fields()
        .with_origins([roof])
        .with_radii([0.09])
        .with_colors([palette::brightened(story.colour(who), 0.45)]);
    journal.always(entity.clone(), &[&arrow])?;
    let vectors = story.velocities_mps(who).into_iter();
    let ways = vectors.map(|mps| lifted(mps.map(|it| ARROW_S * it), 0.0));
    let moving = Arrows3D::update_fields().with_vectors(ways);
    let columns = moving.columns_of_unit_batches();
    journal.columns(entity, clock(story.pose_instants()), columns)
}

/// Logs the cameras' frame, which follows the ego without pitch and roll.
fn log_follow(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let ego = story.ego();
    let upright = story.poses().map(|frame| {
        let placement = &frame.placements[ego];
        let [x, y, _] = placement.centre_m;
        // A camera that pitched and rolled with the body would be hard to watch.
        Placement::upright([x, y, story.ground_m(ego, frame)], placement.heading_rad())
    });
    log_transforms(story, FOLLOW.into(), upright, journal)
}

fn log_transforms(
    story: &ViewedEpisode<'_>,
    entity: EntityPath,
    placements: impl Iterator<Item = Placement> + Clone,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let motion = Transform3D::update_fields()
        .with_many_translation(placements.clone().map(|place| lifted(place.centre_m, 0.0)))
        .with_many_quaternion(placements.map(|place| quaternion(&place)));
    let columns = motion.columns_of_unit_batches();
    journal.columns(entity, clock(story.pose_instants()), columns)
}

/// Logs the complete paths on the ground, narrow lines on top of broad lines.
fn log_trails(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    // A hundred points suffice for a path, whatever the length of the episode.
    let every = story.poses().count().div_ceil(100).max(1);
    let agents = 0..story.shown.stage.agents.len();
    let strip = |who: usize| -> Vec<[f32; 3]> {
        // The last pose always, so that a trail ends at its body.
        let sparse = story.poses().step_by(every).chain(story.poses().last());
        let ground = |frame: &Frame| {
            let [x, y, _] = frame.placements[who].centre_m;
            let z = story.ground_m(who, frame);
            // Each path a little higher, so that paths on the same ground do not flicker.
            lifted([x, y, z], 0.03 + 0.01 * who as f64)
        };
        sparse.map(ground).collect()
    };
    let trails = LineStrips3D::new(agents.clone().map(strip))
        // Each thinner than the one below it, so that both are seen on the same path.
        .with_radii(agents.clone().map(|who| 0.16 / (1.0 + who as f32)))
        .with_colors(agents.map(|who| palette::dimmed(story.colour(who), 0.8)));
    journal.always("trails", &[&trails])
}

/// Logs a pin at the contact, and an arrow along the closing direction.
///
/// The arrow is as long as the distance closed in 1 s.
fn log_contact(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let Some(touch) = &story.episode.contact else {
        return Ok(());
    };
    let sample = story.sample_of(touch.time_s);
    let Some(frame) = story.shown.at_sample(sample) else {
        return Ok(());
    };
    let centre_of = |name: &str| {
        let who = story
            .shown
            .stage
            .agents
            .iter()
            .position(|agent| agent.name == name);
        // A touching agent that is not in the cast has no centre.
        who.map_or(touch.point_m, |who| frame.placements[who].centre_m)
    };
    let (from, to) = (centre_of(&touch.between.0), centre_of(&touch.between.1));
    // Equal centres would have no direction.
    let apart_m = distance(from, to).max(1e-6);
    let closing = touch.closing_speed_mps;
    let along: [f64; 3] = std::array::from_fn(|i| (to[i] - from[i]) / apart_m * closing);
    let at = touch.point_m;
    let (pin, height_m) = (lifted(at, 0.2), 2.6_f32);
    // The arrow of the closing speed ends at the contact.
    let back = std::array::from_fn(|i| at[i] - along[i]);
    let arrows = Arrows3D::from_vectors([[0.0, 0.0, pin[2] - height_m], lifted(along, 0.0)])
        .with_origins([[pin[0], pin[1], height_m], lifted(back, 1.2)])
        .with_radii([0.07, 0.07])
        .with_colors([palette::CONTACT])
        .with_labels([
            format!("contact {:.2} s", touch.time_s),
            format!("closing {closing:.1} m/s"),
        ])
        // The point below has the label, and two texts would cover each other.
        .with_show_labels(false);
    // The label lies above the names of the touching agents, to the right of the ego.
    let side = beside(&frame.placements[story.ego()], at, -3.4);
    let point = Points3D::new([lifted(side, 4.4)])
        .with_radii([0.12])
        .with_colors([palette::CONTACT])
        .with_labels([format!("contact, closing at {closing:.1} m/s")]);
    let instant = SampleInstant {
        sample,
        time_s: touch.time_s,
    };
    journal.from(instant, "contact", &[&arrows, &point])
}

/// Logs a pin at the place of the ego when the verdict became certain.
fn log_verdict_mark(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    let Some(decided) = story.shown.decided else {
        return Ok(());
    };
    let Some(frame) = story.shown.at_sample(decided.sample) else {
        return Ok(());
    };
    let what = match story.episode.verdict {
        Verdict::Counterexample { .. } => "specification violated",
        Verdict::Uncounted { .. } => "specification violated, uncounted",
        Verdict::Foul { .. } => "rule broken",
        Verdict::Held { .. } => "held",
        Verdict::Invalid => "fault",
    };
    let own = &frame.placements[story.ego()];
    let ground = [
        own.centre_m[0],
        own.centre_m[1],
        story.ground_m(story.ego(), frame),
    ];
    let mark = Points3D::new([lifted(beside(own, ground, 3.4), 5.2)])
        .with_radii([0.12])
        .with_colors([palette::DECIDED])
        .with_labels([format!("{what} at {:.2} s", decided.time_s)]);
    journal.from(decided, "verdict/mark", &[&mark])
}

/// Place at a distance to the left of another one, as the ego is headed.
fn beside(ego: &Placement, from: [f64; 3], left_m: f64) -> [f64; 3] {
    let (sin, cos) = ego.heading_rad().sin_cos();
    [from[0] - left_m * sin, from[1] + left_m * cos, from[2]]
}
