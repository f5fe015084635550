//! Entities in the frame of the ego's road.

use core::f64::consts::{FRAC_PI_2, PI};

use super::concrete::Concrete;
use super::entity::ImportedEntity;
use super::frame::{SQUARE_RAD, is_square};
use super::places::is_along;
use crate::opendrive::error::ImportError;
use crate::opendrive::ways::OnWay;
use crate::sim::{Pose, wrapped};

/// Tolerance in radians of the direction along lanes.
const LANE_RAD: f64 = 0.003;

/// Entity in the frame of the ego's road.
pub(super) struct EntityInFrame<'a> {
    pub entity: &'a ImportedEntity,
    pub name: String,
    /// Reference point of the entity.
    pub spot: Pose,
    pub path: EntityPath<'a>,
}

/// Path of an entity.
pub(super) enum EntityPath<'a> {
    /// Along the ego's road, with its direction or against it.
    With,
    Against,
    /// Across the road on foot, to the left or to the right.
    Left,
    Right,
    /// Path of its own: the start of the path, and the position on it.
    Own(Pose, &'a OnWay),
    /// Standing entity, turned away from the road.
    Turned,
}

impl EntityInFrame<'_> {
    /// Distance in metres from the reference point to the front, along the road.
    pub(super) fn front_along_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            EntityPath::With => front_m,
            EntityPath::Against => -front_m,
            EntityPath::Own(..) => front_m,
            // Across the road a front lies beside the reference point, and obstacles
            // place theirs elsewhere.
            EntityPath::Left | EntityPath::Right | EntityPath::Turned => 0.0,
        }
    }

    pub(super) fn front_left_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            EntityPath::Left => front_m,
            EntityPath::Right => -front_m,
            _ => 0.0,
        }
    }

    /// Initial lateral position on its own road, in metres.
    pub(super) fn start_t_m(&self) -> f64 {
        self.entity.placed.lane.as_ref().map_or(0.0, |at| at.t_m)
    }

    pub(super) fn stands(&self) -> bool {
        !self.entity.moves()
    }
}

/// Returns an entity in the frame of the ego's road.
///
/// # Errors
///
/// Returns an error for a direction that a world file cannot express.
pub(super) fn seen<'a>(
    concrete: &Concrete,
    entity: &'a ImportedEntity,
) -> Result<EntityInFrame<'a>, ImportError> {
    let spot = concrete.in_frame(&entity.placed, &entity.at)?;
    let refused = |what: String| entity.at.error(what);
    let moves = entity.moves();
    // A pedestrian walks in the direction of its path, whatever its own
    // heading.
    let heading_rad = match (&entity.placed.way, entity.body.on_foot) {
        (Some(on), true) => {
            let placed = super::places::Placed {
                spot: on.way.start(),
                ..entity.placed.clone()
            };
            concrete.in_frame(&placed, &entity.at)?.heading_rad
        }
        _ => spot.heading_rad,
    };
    // A road that turns off is shared only by entities on the same path.
    let shares_road = concrete.is_on_road(&entity.placed);
    // Headings are within ±π, and both ends mean the opposite direction.
    let near = |direction_rad: f64| (heading_rad - direction_rad).abs() < SQUARE_RAD;
    // The arcs of a way along lanes only nearly have the direction of the lanes, and
    // files round the half turn of an entity that drives against them.
    let on_way = entity.placed.way.as_ref().is_some_and(|on| on.is_lane);
    let on_lanes = on_way || (moves && entity.placed.lane.is_some());
    let leads = |direction_rad: f64| {
        let off_rad = wrapped(heading_rad - direction_rad).abs();
        is_along(heading_rad, direction_rad) || (on_lanes && off_rad < LANE_RAD)
    };
    let own = entity.placed.way.as_ref();
    // Who walks on a path in another direction than these does so on its own.
    let turns = own.is_some_and(|on| on.has_corners());
    let leaves = entity.body.on_foot && (!is_square(heading_rad) || !shares_road);
    let own = own.filter(|_| (moves || entity.body.on_foot) && (turns || leaves));
    let path = if let Some(on) = own {
        EntityPath::Own(concrete.in_plane(&on.way.start()), on)
    } else if entity.body.on_foot {
        if !shares_road {
            let help = "let it follow a trajectory";
            let what = "a pedestrian beside a way that bends is not read".to_owned();
            return Err(refused(what).helped(help));
        } else if near(FRAC_PI_2) {
            EntityPath::Left
        } else if near(-FRAC_PI_2) {
            EntityPath::Right
        } else if near(0.0) {
            EntityPath::With
        } else if near(PI) || near(-PI) {
            EntityPath::Against
        } else {
            let help = "turn it by a quarter or a half circle, or let it follow a trajectory";
            let what = "a pedestrian that faces neither along its road nor across it";
            return Err(refused(what.to_owned()).helped(help));
        }
    } else if shares_road && leads(0.0) {
        EntityPath::With
    } else if shares_road && leads(PI) && entity.is_ego {
        let help = "let it drive in the direction of its lane";
        return Err(refused("the ego faces against its lane".to_owned()).helped(help));
    } else if shares_road && leads(PI) {
        EntityPath::Against
    } else {
        match (&entity.placed.way, moves) {
            (Some(on), true) => EntityPath::Own(concrete.in_plane(&on.way.start()), on),
            (None, true) => {
                let help = "let it follow a trajectory, or place it along a lane";
                let what = "it moves across the ego's road on no way of its own";
                return Err(refused(what.to_owned()).helped(help));
            }
            (_, false) if entity.is_ego => {
                let help = "place it along its lane, or name another entity with --ego";
                return Err(refused("the ego stands across its road".to_owned()).helped(help));
            }
            // A standing entity needs no path.
            (_, false) => EntityPath::Turned,
        }
    };
    Ok(EntityInFrame {
        entity,
        name: agent_name(&entity.name),
        spot,
        path,
    })
}

/// Distance in metres from the ego's reference point to its front.
pub(super) fn ego_lever_m(all: &[EntityInFrame]) -> f64 {
    let ego = all.iter().find(|it| it.entity.is_ego);
    ego.map_or(0.0, |it| it.entity.body.front_m)
}

/// Name of an agent. Names of a world are ASCII and begin with a letter: `4` is `agent_4`.
pub(super) fn agent_name(name: &str) -> String {
    let snake = named(name);
    let parts = snake.chars().map(|c| {
        let code = u32::from(c);
        if c.is_ascii() {
            c.to_string()
        } else {
            format!("u{code:x}")
        }
    });
    let written: String = parts.collect();
    if written.starts_with(|c: char| c.is_ascii_alphabetic()) {
        written
    } else {
        format!("agent_{written}")
    }
}

/// Name in snake case: `ObstructionVehicle_Large` is `obstruction_vehicle_large`.
pub(super) fn named(name: &str) -> String {
    let mut named = String::new();
    let mut before = '_';
    for c in name.chars() {
        // Runs of capitals stay together, such as `VUT` in `VUT_Front`.
        if c.is_uppercase() && before != '_' && !before.is_uppercase() {
            named.push('_');
        }
        named.extend(
            c.to_lowercase()
                .filter(|c| c.is_alphanumeric() || *c == '_'),
        );
        before = c;
    }
    named
}
