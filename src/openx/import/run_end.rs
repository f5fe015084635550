//! End of a run: the expected encounters, and the first entity that leaves its road.

use super::concrete::Concrete;
use super::ends::{leaves_s, road_ahead_m};
use super::seen::{EntityInFrame, EntityPath, ego_lever_m};
use crate::opendrive::error::ImportError;

/// Duration in seconds of a run after the expected encounter.
const BEYOND_S: f64 = 5.0;

/// End of the expected encounters in seconds, where it is known.
pub(super) fn ends_s(
    concrete: &Concrete,
    all: &[EntityInFrame],
    (ego_front_m, ego_mps): (f64, f64),
) -> Result<Option<f64>, ImportError> {
    let mut until_s: Option<f64> = None;
    for it in all.iter().filter(|it| !it.entity.is_ego) {
        let encounter_s = match &it.entity.approach {
            Some(approach) => {
                let ego = concrete.station(&approach.ego)?;
                // The ego coasts, so it arrives at a time that is known in
                // advance.
                (ego.x_m + ego_lever_m(all) - ego_front_m) / ego_mps
            }
            None => {
                let way_m = it.spot.x_m - ego_front_m;
                let away_mps = match it.path {
                    EntityPath::With => it.entity.speed_mps,
                    EntityPath::Against => -it.entity.speed_mps,
                    _ => 0.0,
                };
                // Steps change the speeds, so the time of the encounter is not
                // known.
                match way_m / (ego_mps - away_mps) {
                    encounter_s if it.entity.steps.is_empty() => encounter_s,
                    _ => continue,
                }
            }
        };
        // Parallel motion never leads to an encounter, and a negative time lies
        // in the past.
        if encounter_s.is_finite() && 0.0 < encounter_s {
            until_s = Some(until_s.unwrap_or(0.0).max(encounter_s + BEYOND_S));
        }
    }
    // A stop time of the file takes precedence.
    Ok(concrete.stop_s.or(until_s))
}

/// Time in seconds at which the first entity leaves its road.
pub(super) fn first_leaves_s(
    concrete: &Concrete,
    all: &[EntityInFrame],
    (ego_front_m, ego_mps): (f64, f64),
) -> Result<f64, ImportError> {
    let mut first_s = f64::INFINITY;
    for it in all {
        let on_foot = it.entity.body.on_foot;
        let ahead_m = |placed| road_ahead_m(concrete, placed, on_foot);
        let own_s = match &it.entity.approach {
            Some(approach) => {
                let ego = concrete.station(&approach.ego)?;
                let encounter_s = (ego.x_m + ego_lever_m(all) - ego_front_m) / ego_mps;
                // Pedestrians stop at the end of their path.
                if on_foot && approach.here.way.is_some() {
                    continue;
                }
                encounter_s + ahead_m(&approach.here) / approach.speed_mps
            }
            None => leaves_s(it.entity, ahead_m(&it.entity.placed), ego_mps),
        };
        // A standing entity never leaves, even from the end of a road.
        if own_s.is_finite() {
            first_s = first_s.min(own_s);
        }
    }
    Ok(first_s)
}
