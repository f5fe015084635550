//! End of a run: the expected encounters, and the first entity that leaves its road.

use core::f64::consts::{FRAC_PI_3, PI};

use super::concrete::Concrete;
use super::places::Placed;
use super::seen::{EntityInFrame, EntityPath, ego_lever_m};
use crate::opendrive::error::ImportError;

/// Duration in seconds of a run after the expected encounter.
const BEYOND_S: f64 = 5.0;
/// Lateral distance in metres within which the end of a road is the end of a path.
const BESIDE_M: f64 = 20.0;

/// Start of the ego along its road.
#[derive(Clone, Copy)]
pub(super) struct EgoStart {
    /// Station of its front.
    pub front_m: f64,
    pub speed_mps: f64,
}

/// End of the expected encounters in seconds, where it is known.
pub(super) fn ends_s(
    concrete: &Concrete,
    all: &[EntityInFrame],
    start: EgoStart,
) -> Result<Option<f64>, ImportError> {
    let mut until_s: Option<f64> = None;
    for it in all.iter().filter(|it| !it.entity.is_ego) {
        let encounter_s = match &it.entity.approach {
            Some(approach) => {
                let ego = concrete.station(&approach.ego, &it.entity.at)?;
                // The ego coasts, so it arrives at a time that is known in
                // advance.
                (ego.x_m + ego_lever_m(all) - start.front_m) / start.speed_mps
            }
            None => {
                let way_m = it.spot.x_m - start.front_m;
                let away_mps = match it.path {
                    EntityPath::With => it.entity.speed_mps,
                    EntityPath::Against => -it.entity.speed_mps,
                    _ => 0.0,
                };
                // Steps change the speeds, so the time of the encounter is not
                // known.
                match way_m / (start.speed_mps - away_mps) {
                    encounter_s if !it.entity.is_driven() => encounter_s,
                    _ => continue,
                }
            }
        };
        // Parallel motion never leads to an encounter, and a negative time lies
        // in the past.
        if encounter_s.is_finite() && encounter_s > 0.0 {
            // The latest one counts, so that the run contains them all.
            until_s = Some(until_s.unwrap_or(0.0).max(encounter_s + BEYOND_S));
        }
    }
    // Events may come after any encounter with those that have none.
    let acts = all.iter().any(|it| it.entity.later.acts);
    // A stop time of the file takes precedence.
    Ok(concrete.stop_s.or(until_s.filter(|_| !acts)))
}

/// Time in seconds at which the first entity leaves its road, and that entity.
///
/// The time is infinite if none ever does.
pub(super) fn first_leaves_s<'a>(
    concrete: &Concrete,
    all: &'a [EntityInFrame<'a>],
    start: EgoStart,
) -> Result<(f64, Option<&'a EntityInFrame<'a>>), ImportError> {
    let mut first = (f64::INFINITY, None);
    for it in all {
        let on_foot = it.entity.body.on_foot;
        let ahead_m = |placed| road_ahead_m(concrete, placed, on_foot);
        let own_s = match &it.entity.approach {
            Some(approach) => {
                let ego = concrete.station(&approach.ego, &it.entity.at)?;
                let encounter_s = (ego.x_m + ego_lever_m(all) - start.front_m) / start.speed_mps;
                // Pedestrians stop at the end of their path.
                if on_foot && approach.here.way.is_some() {
                    continue;
                }
                encounter_s + ahead_m(&approach.here) / approach.speed_mps
            }
            None => it.entity.leaves_s(ahead_m(&it.entity.placed)),
        };
        // A standing entity never leaves, even from the end of a road.
        if own_s.is_finite() && own_s < first.0 {
            first = (own_s, Some(it));
        }
    }
    Ok(first)
}

/// Distance in metres to the end of an entity's road, in its direction.
///
/// The road ends where that of the world ends. The distance is infinite for an
/// entity that faces the side of its road.
fn road_ahead_m(concrete: &Concrete, placed: &Placed, on_foot: bool) -> f64 {
    let roads = &concrete.roads;
    if let Some(on) = &placed.way {
        // What comes after the end of such a path is not in the file.
        if on_foot || on.is_lane || on.has_corners() {
            return on.ends_m - on.along_m;
        }
        // A path continues straight after its end, up to the last end of a
        // road.
        let end = on.way.pose(on.ends_m, 0.0);
        let ends = roads.all().flat_map(|(_, line)| {
            let places = [line.at(0.0, 0.0), line.at(line.length_m, 0.0)];
            places.map(|place| end.sees(&place))
        });
        let ahead = ends.filter(|place| place.y_m.abs() <= BESIDE_M);
        let beyond_m = ahead.map(|place| place.x_m).fold(0.0, f64::max);
        return on.ends_m - on.along_m + beyond_m;
    }
    let at = placed.lane.as_ref();
    let Some((line, at)) = at.and_then(|at| Some((roads.get(&at.road)?, at))) else {
        return f64::INFINITY;
    };
    // Within 60° of the road's direction, or of the opposite direction, an
    // entity drives along it.
    let turned_rad = line.at(at.s_m, at.t_m).sees(&placed.spot).heading_rad.abs();
    if turned_rad < FRAC_PI_3 {
        line.way_m(at.s_m, concrete.ends_m(&at.road), at.t_m)
    } else if PI - FRAC_PI_3 < turned_rad {
        line.way_m(0.0, at.s_m, at.t_m)
    } else {
        f64::INFINITY
    }
}
