//! When somebody who does as the file says leaves its road.

use core::f64::consts::{FRAC_PI_3, PI};

use super::entity::{Entity, Law, Step};
use super::places::Placed;
use super::roads::RoadMap;

/// Ends of roads so far beside a way are ends of the way.
const BESIDE_M: f64 = 20.0;

/// How far it is to the end of the road on which somebody is, as it faces;
/// endless for who faces the side of it.
pub(super) fn road_ahead_m(roads: &RoadMap, placed: &Placed, on_foot: bool) -> f64 {
    if let Some(on) = &placed.way {
        if on_foot {
            return f64::INFINITY;
        }
        // The way goes straight on behind its end, to the last of the roads.
        let end = on.way.at(on.ends_m);
        let ends = roads.all().flat_map(|line| {
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
    let turned_rad = line.at(at.s_m, at.t_m).sees(&placed.spot).heading_rad.abs();
    if turned_rad < FRAC_PI_3 {
        line.way_m(at.s_m, line.length_m, at.t_m)
    } else if PI - FRAC_PI_3 < turned_rad {
        line.way_m(0.0, at.s_m, at.t_m)
    } else {
        f64::INFINITY
    }
}

/// The earliest time at which somebody has gone so far; relative speeds are those
/// of an ego that coasts.
pub(super) fn leaves_s(entity: &Entity, ahead_m: f64, ego_mps: f64) -> f64 {
    let t_m = entity.placed.lane.as_ref().map_or(0.0, |at| at.t_m);
    let mut journey = Journey {
        time_s: 0.0,
        left_m: ahead_m,
        speed_mps: entity.speed_mps,
        t_m,
        changed_m: 0.0,
    };
    for (i, step) in entity.steps.iter().enumerate() {
        if step.when.is_some() {
            // It may begin at any time: as fast as it ever is.
            let later = entity.steps[i..].iter().flat_map(|it| &it.laws);
            let later = later.filter_map(|law| to_mps(law, ego_mps));
            journey.speed_mps = later.fold(journey.speed_mps, f64::max);
            return journey.leaves_s();
        }
        if let Some(leaves_s) = journey.carry_out(step, ego_mps) {
            return leaves_s;
        }
    }
    journey.leaves_s()
}

/// The speed that a law leads to, beside an ego that coasts.
pub(super) fn to_mps(law: &Law, ego_mps: f64) -> Option<f64> {
    match law {
        Law::Speed {
            to_mps,
            relative_to,
            ..
        } => {
            let base_mps = relative_to.as_ref().map_or(0.0, |_| ego_mps);
            Some((base_mps + to_mps).max(0.0))
        }
        Law::Walk { .. } | Law::LaneChange { .. } | Law::Beside { .. } => None,
    }
}

/// Somebody on the way to the end of its road.
struct Journey {
    time_s: f64,
    left_m: f64,
    speed_mps: f64,
    /// Beside the reference line, and of that by changes of lanes.
    t_m: f64,
    changed_m: f64,
}

impl Journey {
    /// When the end is reached at the speed of now.
    fn leaves_s(&self) -> f64 {
        self.time_s + self.left_m / self.speed_mps
    }

    /// Goes on for a while at a speed that changes evenly; gives when the end is
    /// reached in it, by its mean speed.
    fn go_on(&mut self, for_s: f64, to_mps: f64) -> Option<f64> {
        let mean_mps = 0.5 * (self.speed_mps + to_mps);
        let way_m = mean_mps * for_s;
        if self.left_m <= way_m {
            return Some(self.time_s + self.left_m / self.speed_mps.max(to_mps));
        }
        self.left_m -= way_m;
        self.time_s += for_s;
        self.speed_mps = to_mps;
        None
    }

    /// Does a step; gives when the end is reached in it.
    fn carry_out(&mut self, step: &Step, ego_mps: f64) -> Option<f64> {
        let waits = self.go_on(step.after_s, self.speed_mps);
        if waits.is_some() {
            return waits;
        }
        let (mut ramp_s, mut aside_s, mut ends_mps) = (0.0, 0.0, self.speed_mps);
        for law in &step.laws {
            match law {
                Law::Speed { rate_mps2, .. } => {
                    ends_mps = to_mps(law, ego_mps).unwrap_or(ends_mps);
                    match rate_mps2 {
                        Some(rate_mps2) => ramp_s = (ends_mps - self.speed_mps).abs() / rate_mps2,
                        None => self.speed_mps = ends_mps,
                    }
                }
                Law::LaneChange { by_m, rate_mps } => {
                    aside_s = PI * by_m.abs() / (2.0 * rate_mps);
                    self.t_m += by_m;
                    self.changed_m += by_m;
                }
                Law::Beside {
                    t_m,
                    most_lateral_mps2,
                } => {
                    let by_m = t_m + self.changed_m - self.t_m;
                    aside_s = PI * (by_m.abs() / (2.0 * most_lateral_mps2)).sqrt();
                    self.t_m += by_m;
                }
                // On foot nobody leaves a road's end, and stands in the end.
                Law::Walk { .. } => return Some(f64::INFINITY),
            }
        }
        let ramp = self.go_on(ramp_s, ends_mps);
        ramp.or_else(|| self.go_on((aside_s - ramp_s).max(0.0), ends_mps))
    }
}
