//! Who is there, in the frame of the ego's road.

use core::f64::consts::{FRAC_PI_2, PI};

use super::entity::Entity;
use super::error::ImportError;
use super::places::is_along;
use super::scenario::Concrete;
use super::spot::Spot;
use super::ways::OnWay;

/// A pedestrian who faces a side within this does.
const SQUARE_RAD: f64 = 0.02;

/// Somebody in the frame of the ego's road.
pub(super) struct Seen<'a> {
    pub entity: &'a Entity,
    pub name: String,
    /// The point that a scenario moves.
    pub spot: Spot,
    pub path: Path<'a>,
}

/// On what somebody moves.
pub(super) enum Path<'a> {
    /// The ego's road, with it or against it.
    With,
    Against,
    /// Across it on foot: to the left or to the right.
    Left,
    Right,
    /// A way of its own: where that begins, and where it is on it.
    Own(Spot, &'a OnWay),
    /// It stands, turned from the road.
    Turned,
}

impl Seen<'_> {
    /// From the moved point to the front, along the road.
    pub fn front_along_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            Path::With => front_m,
            Path::Against => -front_m,
            Path::Own(..) => front_m,
            Path::Left | Path::Right | Path::Turned => 0.0,
        }
    }

    pub fn front_left_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            Path::Left => front_m,
            Path::Right => -front_m,
            _ => 0.0,
        }
    }

    pub fn stands(&self) -> bool {
        let entity = self.entity;
        entity.speed_mps == 0.0 && entity.steps.is_empty() && entity.meets.is_none()
    }

    /// How much of it lies behind its front, along the ego's road.
    pub fn rear_m(&self) -> f64 {
        let body = &self.entity.body;
        match self.path {
            Path::With => body.length_m,
            Path::Left | Path::Right => 0.5 * body.width_m,
            _ => 0.0,
        }
    }
}

/// Somebody as the ego's road has it.
pub(super) fn seen<'a>(concrete: &Concrete, entity: &'a Entity) -> Result<Seen<'a>, ImportError> {
    let spot = concrete.in_frame(&entity.placed)?;
    let refused = |what: String| entity.at.error(what);
    let moves = entity.speed_mps != 0.0 || !entity.steps.is_empty() || entity.meets.is_some();
    // On foot it goes where its way leads, whatever it looks at.
    let heading_rad = match (&entity.placed.way, entity.body.on_foot) {
        (Some(on), true) => {
            let placed = super::places::Placed {
                spot: on.way.begins,
                ..entity.placed.clone()
            };
            concrete.in_frame(&placed)?.heading_rad
        }
        _ => spot.heading_rad,
    };
    // A road that turns off is nobody's but who keeps to that very way.
    let shares_road = concrete.is_on_road(&entity.placed);
    let near = |direction_rad: f64| (heading_rad - direction_rad).abs() < SQUARE_RAD;
    let path = match entity.body.on_foot {
        true if !shares_road => {
            return Err(refused(
                "nobody on foot is read beside a way that bends".to_owned(),
            ));
        }
        true if near(FRAC_PI_2) => Path::Left,
        true if near(-FRAC_PI_2) => Path::Right,
        true if near(0.0) => Path::With,
        true if near(PI) || near(-PI) => Path::Against,
        true => {
            return Err(refused(
                "on foot one faces along the road or across it".to_owned(),
            ));
        }
        false if shares_road && is_along(heading_rad, 0.0) => Path::With,
        false if shares_road && is_along(heading_rad, PI) => Path::Against,
        false => match (&entity.placed.way, moves) {
            (Some(on), true) => {
                let placed = super::places::Placed {
                    spot: on.way.begins,
                    ..entity.placed.clone()
                };
                Path::Own(concrete.in_frame(&placed)?, on)
            }
            (None, true) => {
                return Err(refused(
                    "it moves across the ego's road on no way of its own".to_owned(),
                ));
            }
            (_, false) => Path::Turned,
        },
    };
    Ok(Seen {
        entity,
        name: named(&entity.name),
        spot,
        path,
    })
}

/// From the point of the ego that a scenario moves to its front.
pub(super) fn ego_lever_m(all: &[Seen]) -> f64 {
    let ego = all.iter().find(|it| it.entity.is_ego);
    ego.map_or(0.0, |it| it.entity.body.front_m)
}

/// `ObstructionVehicle_Large` as `obstruction_vehicle_large`.
pub(super) fn named(name: &str) -> String {
    let mut named = String::new();
    let mut before = '_';
    for c in name.chars() {
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
