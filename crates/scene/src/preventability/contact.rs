//! Partner and geometry of a contact, and reasons why drivers do not apply.

use super::outcome::{Exoneration, NotApplicable, Struck};
use crate::ego::reference::{Encounter, LaneBody, TtcReading};
use crate::scene::drive::DriveWorld;
use crate::scene::{ContactEvent, Motion};

/// Speed up to which the ego counts as standing.
pub(super) const STANDING_MPS: f64 = 0.5;
/// Sine of the angle between two headings up to which they count as parallel.
const ALONG: f64 = 0.5;

/// Returns the agent that the ego touched.
pub(super) fn other_of(world: &DriveWorld, touch: &ContactEvent) -> Option<usize> {
    let agents = &world.spec().agents;
    let ego = &agents[world.ego()].name;
    let other = match (&touch.between.0 == ego, &touch.between.1 == ego) {
        (true, _) => &touch.between.1,
        (_, true) => &touch.between.0,
        _ => return None,
    };
    agents.iter().position(|agent| agent.name == *other)
}

/// Returns the agent that the ego touches at the end of a motion.
pub(super) fn partner(world: &DriveWorld, motion: &Motion) -> Option<usize> {
    other_of(world, motion.contact.as_ref()?)
}

/// Returns the ego and the other in lane coordinates at their contact.
fn at_contact(world: &DriveWorld, motion: &Motion) -> Option<(LaneBody, LaneBody)> {
    let with = partner(world, motion)?;
    let row = motion.at(motion.len().checked_sub(1)?);
    let body = |i: usize| world.lane_body(i, &row[i].state);
    Some((body(world.ego()), body(with)))
}

/// Returns the reason why the motion cannot be replayed, or `None` if it can.
pub(super) fn reason_against_replays(world: &DriveWorld, motion: &Motion) -> Option<NotApplicable> {
    if motion.contact.is_none() {
        return Some(NotApplicable::NoContact);
    }
    let spec = world.spec();
    let story = spec.story.as_ref();
    // A motion holds no friction, so a replay could not repeat it.
    if spec.weather.is_some() || story.is_some_and(|story| story.changes_friction()) {
        return Some(NotApplicable::ChangingWeather);
    }
    // Replays have the listed road only.
    if spec.road_ado.is_some() {
        return Some(NotApplicable::ChangingRoad);
    }
    // The touch may join two other agents.
    let is_of_ego = partner(world, motion).is_some();
    (!is_of_ego).then_some(NotApplicable::WithoutEgo)
}

/// Returns the reason why the drivers do not apply, or `None` if they apply.
pub(super) fn reason_against(world: &DriveWorld, motion: &Motion) -> Option<NotApplicable> {
    if let Some(reason) = reason_against_replays(world, motion) {
        return Some(reason);
    }
    let (Some(with), Some((ego, other))) = (partner(world, motion), at_contact(world, motion))
    else {
        return Some(NotApplicable::WithoutEgo);
    };
    if world.spec().agents[with].body.is_on_foot() {
        return Some(NotApplicable::OnFoot);
    }
    let row = motion.at(motion.len() - 1);
    let heading = |i: usize| row[i].state.pose.heading_rad;
    let turned_rad = heading(with) - heading(world.ego());
    // Reference drivers judge others on parallel axes only.
    if libm::sin(turned_rad).abs() > ALONG {
        return Some(NotApplicable::Crossing);
    }
    // Oncoming by its heading, or because it drives backwards.
    if libm::cos(turned_rad) < 0.0 || other.speed_mps < -STANDING_MPS {
        return Some(NotApplicable::Oncoming);
    }
    (struck(&ego, &other) == Struck::Rear).then_some(NotApplicable::FromBehind)
}

/// Returns the reason why the ego is not at fault, if any.
pub(super) fn exoneration(world: &DriveWorld, motion: &Motion) -> Option<Exoneration> {
    let (ego, other) = at_contact(world, motion)?;
    if ego.speed_mps <= STANDING_MPS {
        return Some(Exoneration::Standing);
    }
    let lane_width_m = world.spec().road.lane_width_m();
    // Lane k has its middle at k widths, so rounding gives the nearest lane.
    let lanes = ego.y_m / lane_width_m;
    let off_m = (lanes - libm::round(lanes)).abs() * lane_width_m;
    // A body wider than its lane counts as inside only exactly in the middle.
    let in_lane = off_m <= 0.5 * (lane_width_m - ego.width_m).max(0.0);
    let from_behind = struck(&ego, &other) == Struck::Rear;
    (in_lane && from_behind).then_some(Exoneration::StruckFromBehind)
}

/// Returns the geometry of two bodies, without lane and acceleration.
pub(super) fn between(ego: &LaneBody, other: &LaneBody) -> Encounter {
    Encounter {
        ego: *ego,
        other: *other,
        accel_mps2: 0.0,
        lane_width_m: 0.0,
        ttc: TtcReading::Closing,
    }
}

/// Returns the struck side of the ego.
/// It is the front, unless the other's middle is behind the ego's.
pub(super) fn struck(ego: &LaneBody, other: &LaneBody) -> Struck {
    let encounter = between(ego, other);
    if ego.x_m <= other.x_m {
        Struck::Front
    // The axis of the smaller overlap is that of the contact.
    } else if encounter.clearance_m() <= encounter.gap_m() {
        Struck::Rear
    } else {
        Struck::Side
    }
}
