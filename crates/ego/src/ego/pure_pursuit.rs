//! Cruise control, emergency braking, and steering where braking is not enough.
//!
//! It brakes like [`Aeb`]. If avoiding an agent takes too much braking, it also
//! leaves its place in the lane. It passes the agent on the nearer side that is
//! free and on the road, and returns when its lane is free again. While it
//! steers around an agent it brakes no harder than while cruising: tyres share
//! their grip between both, and a standing car cannot steer.
//!
//! Steering is pure pursuit (Coulter 1992). It aims at the point of the wanted
//! line at a look-ahead distance l. The arc through that point that leaves
//! along the own heading has the curvature κ = 2 sin α / l, with α the angle to
//! the point. The law turns a heading ψ by ψ' = κ v, and the commanded speed
//! across the road is v sin ψ. In curves the road counts as straightened, and
//! the car adds its curvature.

use super::aeb::Aeb;
use super::parameters::parameters;
use super::{Briefing, Command, Controller, Fault, Own, Percept, Seen};

/// Largest angle to the road: cars move sideways at most at 0.4 of their speed.
const MAX_ANGLE_RAD: f64 = 0.38;
/// Time ahead for which agents on the other side matter.
const FREE_S: f64 = 3.0;

parameters! {
    /// Keeps its lane by pure pursuit, brakes, and steers where braking is not enough.
    pub struct PurePursuit {
        /// Gain on the cruising speed's error, 1/s.
        cruise_gain_per_s, at_least 0.0;
        /// Hardest acceleration or braking while cruising, m/s².
        cruise_limit_mps2, at_least 0.0;
        /// Deceleration needed at or above which it brakes, m/s².
        trigger_mps2, at_least 0.0;
        /// Deceleration of the emergency brake, m/s².
        max_brake_mps2, at_least 0.0;
        /// Clearance to be kept after stopping, m.
        margin_m, at_least 0.0;
        /// Free width to be kept at either side, m.
        side_m, at_least 0.0;
        /// Time ahead for which lateral motion is predicted, s.
        look_ahead_s, at_least 0.0;
        /// Deceleration needed at or above which it steers as well, m/s².
        evade_mps2, at_least 0.0;
        /// Time to the point that it aims at, s.
        preview_s, at_least 0.1;
        /// Least distance of that point, m.
        preview_min_m, at_least 1.0;
        /// Hardest lateral acceleration of its steering, m/s².
        side_limit_mps2, at_least 0.0;
    }
}

/// The controller with its road data, its lane and its steering state.
#[derive(Clone, Debug)]
pub(super) struct Pursuing {
    spec: PurePursuit,
    brakes: Aeb,
    /// Lateral positions of the road's right and left edge.
    edges_m: (f64, f64),
    cruise_mps: Option<f64>,
    /// Lateral position that it keeps while nothing is in the way.
    home_m: f64,
    /// Lateral position at which it passes an agent.
    evades_to_m: Option<f64>,
    /// Heading ψ relative to the road.
    angle_rad: f64,
}

impl PurePursuit {
    pub(super) fn build(&self) -> Pursuing {
        Pursuing {
            brakes: Aeb {
                cruise_gain_per_s: self.cruise_gain_per_s,
                cruise_limit_mps2: self.cruise_limit_mps2,
                trigger_mps2: self.trigger_mps2,
                max_brake_mps2: self.max_brake_mps2,
                margin_m: self.margin_m,
                side_m: self.side_m,
                look_ahead_s: self.look_ahead_s,
            },
            spec: self.clone(),
            edges_m: (f64::NEG_INFINITY, f64::INFINITY),
            cruise_mps: None,
            home_m: 0.0,
            evades_to_m: None,
            angle_rad: 0.0,
        }
    }

    /// Returns κ = 2 sin α / l towards a line to the left, within tyre limits.
    fn curvature_per_m(&self, aside_m: f64, angle_rad: f64, speed_mps: f64) -> f64 {
        let ahead_m = self.preview_min_m.max(self.preview_s * speed_mps);
        let point_rad = libm::asin((aside_m / ahead_m).clamp(-1.0, 1.0));
        let curvature_per_m = 2.0 * libm::sin(point_rad - angle_rad) / ahead_m;
        // Below 1 m/s the quotient would grow without bound.
        let most_per_m = self.side_limit_mps2 / (speed_mps * speed_mps).max(1.0);
        curvature_per_m.clamp(-most_per_m, most_per_m)
    }
}

impl Pursuing {
    /// Returns whether an agent leaves the position `aside_m` to the left free.
    ///
    /// The position must stay free for as long as the ego needs to pass.
    fn is_free(&self, own: &Own, seen: &Seen, aside_m: f64) -> bool {
        let room = seen.room();
        let half_m = 0.5 * own.width_m + self.spec.side_m;
        let is_beside = -own.length_m - self.spec.margin_m < room.far_m;
        let closing_mps = own.speed_mps - seen.speed_mps;
        let reaches = room.near_m < self.spec.margin_m + closing_mps.max(0.0) * FREE_S;
        let then_m = seen.lateral_mps * self.spec.look_ahead_s;
        let (right_m, left_m) = (room.right_m - aside_m, room.left_m - aside_m);
        let inside =
            right_m.min(right_m + then_m) < half_m && -half_m < left_m.max(left_m + then_m);
        !(is_beside && reaches && inside)
    }

    /// Returns the nearer free side of an agent, as a lateral position on the road.
    fn way_around(&self, percept: &Percept, threat: &Seen) -> Option<f64> {
        let own = &percept.own;
        // At almost equal speeds the time to the agent would diverge.
        let closing_mps = (own.speed_mps - threat.speed_mps).max(0.1);
        let room = threat.room();
        let then_m = threat.lateral_mps * (room.near_m.max(0.0) / closing_mps);
        // At least 0.3 m, so that a side margin of 0 does not graze the agent.
        let half_m = 0.5 * own.width_m + self.spec.side_m.max(0.3);
        // Behind a moving agent, or before the far edge of its future place.
        let left_m = room.left_m.max(room.left_m + then_m) + half_m;
        let right_m = room.right_m.min(room.right_m + then_m) - half_m;
        let fits = |aside_m: &f64| {
            let to_m = own.lateral_m + aside_m;
            let edges_m = (
                self.edges_m.0 + 0.5 * own.width_m,
                self.edges_m.1 - 0.5 * own.width_m,
            );
            let mut others = percept
                .others
                .iter()
                .filter(|seen| seen.name != threat.name);
            edges_m.0 <= to_m
                && to_m <= edges_m.1
                && others.all(|seen| self.is_free(own, seen, *aside_m))
        };
        let sides = [left_m, right_m].into_iter().filter(fits);
        // The left side is first, and wins a tie.
        let nearer = sides.min_by(|a, b| a.abs().total_cmp(&b.abs()));
        nearer.map(|aside_m| own.lateral_m + aside_m)
    }

    /// Returns the wanted lateral position.
    fn wanted_m(&mut self, percept: &Percept) -> f64 {
        let own = &percept.own;
        // A started evasion ends only when the own lane is free: a new choice
        // at every sample could alternate between the sides.
        if let Some(evades_to_m) = self.evades_to_m {
            let aside_m = self.home_m - own.lateral_m;
            let mut others = percept.others.iter();
            if others.all(|seen| self.is_free(own, seen, aside_m)) {
                self.evades_to_m = None
            } else {
                return evades_to_m;
            }
        }
        let needed = percept
            .others
            .iter()
            .map(|seen| (self.brakes.needed_mps2(own, seen), seen));
        let worst = needed.max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((needed_mps2, threat)) = worst
            && self.spec.evade_mps2 <= needed_mps2
        {
            self.evades_to_m = self.way_around(percept, threat);
        }
        self.evades_to_m.unwrap_or(self.home_m)
    }
}

impl Controller for Pursuing {
    fn brief(&mut self, briefing: &Briefing) {
        let road = &briefing.road;
        let right_m = -0.5 * road.lane_width_m;
        self.edges_m = (right_m, right_m + road.lanes as f64 * road.lane_width_m);
    }

    fn reset(&mut self, _seed: u64) {
        (self.cruise_mps, self.evades_to_m, self.angle_rad) = (None, None, 0.0);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let own = &percept.own;
        // Distinguishes the first percept. `reset` does not know the position.
        if self.cruise_mps.is_none() {
            self.home_m = own.lateral_m;
        }
        let cruise_mps = *self.cruise_mps.get_or_insert(own.speed_mps);
        let aside_m = self.wanted_m(percept) - own.lateral_m;
        let curvature_per_m = self
            .spec
            .curvature_per_m(aside_m, self.angle_rad, own.speed_mps);
        let turned_rad = self.angle_rad + curvature_per_m * own.speed_mps * percept.sample_s;
        // The angle is the controller's own state and not the car's heading.
        self.angle_rad = turned_rad.clamp(-MAX_ANGLE_RAD, MAX_ANGLE_RAD);
        let braking_mps2 = self.brakes.accel_mps2(percept, cruise_mps);
        Ok(Command {
            accel_mps2: match self.evades_to_m {
                Some(_) => braking_mps2.max(-self.spec.cruise_limit_mps2),
                None => braking_mps2,
            },
            // A standing car cannot move sideways, which the product states.
            lateral_mps: own.speed_mps * libm::sin(self.angle_rad),
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: PurePursuit = PurePursuit {
        cruise_gain_per_s: 0.5,
        cruise_limit_mps2: 2.0,
        trigger_mps2: 4.0,
        max_brake_mps2: 7.0,
        margin_m: 1.0,
        side_m: 0.3,
        look_ahead_s: 2.0,
        evade_mps2: 5.0,
        preview_s: 1.0,
        preview_min_m: 5.0,
        side_limit_mps2: 1e3,
    };

    #[test]
    fn the_arc_goes_through_the_point_that_is_pursued() {
        // From the origin along x to (√(l² − y²), y): a circle of radius l²/2y.
        let curvature_per_m = LAW.curvature_per_m(2.0, 0.0, 20.0);
        assert!((curvature_per_m - 2.0 * 2.0 / 400.0).abs() < 1e-12);
        let onto = libm::asin(2.0 / 20.0);
        assert!(LAW.curvature_per_m(2.0, onto, 20.0).abs() < 1e-12);
        assert!((LAW.curvature_per_m(1.0, 0.0, 1.0) - 2.0 / 25.0).abs() < 1e-12);
    }

    #[test]
    fn it_passes_on_the_nearer_side_that_is_free() {
        let own = Own {
            speed_mps: 15.0,
            length_m: 4.5,
            width_m: 1.8,
            ..Own::default()
        };
        let car = |name: &str, headway_m: f64, lateral_m: f64| Seen {
            name: name.to_owned(),
            headway_m,
            lateral_m,
            length_m: 4.5,
            width_m: 1.8,
            ..Seen::default()
        };
        let mut pursuing = LAW.build();
        pursuing.edges_m = (-1.75, 5.25);
        for (others, side) in [
            (vec![car("a", 25.0, 0.2)], Some(1.0)),
            (vec![car("a", 25.0, 0.2), car("b", 30.0, 3.5)], None),
            (vec![car("a", 25.0, -1.6), car("b", 200.0, 3.5)], Some(1.0)),
        ] {
            let percept = Percept {
                own,
                others,
                ..Percept::default()
            };
            let found = pursuing.way_around(&percept, &percept.others[0]);
            assert_eq!(found.map(f64::signum), side, "{:?}", percept.others);
        }
    }
}
