//! Emergency brake: hard braking beyond a threshold.
//!
//! Many egos follow smoothly and brake fully below a critical distance.
//! A network rounds this step off, so a plan with centimetres of margin misses.
//! Collision avoidance systems compare the clear distance with a sum of distances.
//! The sum includes the stopping distances of both vehicles, the distance travelled
//! before the brakes act, and a distance for closing.
//! Seiler, Song & Hedrick (SAE 980853) compare the systems of Mazda, Honda and Berkeley.
//! Required deceleration and time to collision have the same form.
//! A brake therefore has a weight for each distance. [`super::brake_detection`] fits the weights
//! and so finds the distances that an ego compares.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::ego::{Actuator, Own, Percept, Seen};

/// Number of weighted distances.
pub(super) const TERMS: usize = 6;
/// Index of the last distance, the margin, which is constant.
pub(super) const MARGIN: usize = TERMS - 1;

/// Brake that acts while the clear distance is less than a weighted sum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct EmergencyBrake {
    /// Deceleration, m/s².
    pub brake_mps2: f64,
    /// Time constant of the build-up, s.
    pub lag_s: f64,
    /// Stopping distance per own speed squared, s²/m.
    pub(crate) own_s2_per_m: f64,
    /// Stopping distance per other speed squared, which is subtracted, s²/m.
    pub(crate) others_s2_per_m: f64,
    /// Distance until the brakes act per own speed, s.
    pub reaction_s: f64,
    /// Distance per closing speed, a time to collision, s.
    pub(crate) closing_s: f64,
    /// Distance per closing speed squared, s²/m.
    pub(crate) closing_s2_per_m: f64,
    /// Distance to be left, m.
    pub margin_m: f64,
    /// Whether the brake acts only while the clear distance shrinks.
    pub(crate) only_closing: bool,
    /// Vehicles that count as being ahead.
    pub counts: BrakedFor,
}

/// Criterion by which a vehicle counts as being ahead.
///
/// Its body must come nearer to the ego's path than `side_m` within `look_ahead_s`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BrakedFor {
    /// Free width at either side, m.
    pub side_m: f64,
    /// Time for which lateral motion is extrapolated, s.
    pub look_ahead_s: f64,
}

/// Criteria for vehicles ahead that are tried.
pub(super) const COUNTS: [BrakedFor; 4] = [
    BrakedFor {
        side_m: 0.0,
        look_ahead_s: 0.0,
    },
    BrakedFor {
        side_m: 0.3,
        look_ahead_s: 0.0,
    },
    BrakedFor {
        side_m: 0.0,
        look_ahead_s: 1.0,
    },
    BrakedFor {
        side_m: 0.3,
        look_ahead_s: 3.0,
    },
];

/// Sample in which an ego may brake.
#[derive(Clone, Debug)]
pub(super) struct Situation {
    pub time_s: f64,
    pub sample_s: f64,
    pub own: Own,
    /// All vehicles ahead.
    ahead: Vec<VehicleAhead>,
}

/// Vehicle ahead, as a brake sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct VehicleAhead {
    pub clearance_m: f64,
    own_mps: f64,
    other_mps: f64,
    /// Lateral gap between the sides, negative where they overlap.
    side_m: f64,
    towards_mps: f64,
}

impl VehicleAhead {
    /// Returns the vehicle, or `None` if it is not ahead.
    fn of(own: &Own, seen: &Seen) -> Option<VehicleAhead> {
        let room = seen.room();
        // A vehicle that still overlaps the ego lengthwise counts as ahead.
        if room.far_m <= 0.0 {
            return None;
        }
        Some(VehicleAhead {
            clearance_m: room.near_m,
            own_mps: own.speed_mps,
            other_mps: seen.speed_mps,
            side_m: room.right_m.max(-room.left_m) - 0.5 * own.width_m,
            // Only motion towards the ego's path counts.
            towards_mps: (-seen.lateral_mps * seen.lateral_m.signum()).max(0.0),
        })
    }

    /// Returns the rate at which the clear distance shrinks.
    pub(super) fn closing_mps(&self) -> f64 {
        self.own_mps - self.other_mps
    }

    /// Returns the distances that the weights apply to.
    pub(super) fn terms(&self) -> [f64; TERMS] {
        // A vehicle that reverses or recedes adds no distance.
        let (own_mps, other_mps) = (self.own_mps, self.other_mps.max(0.0));
        let closing_mps = self.closing_mps().max(0.0);
        [
            own_mps * own_mps,
            -other_mps * other_mps,
            own_mps,
            closing_mps,
            closing_mps * closing_mps,
            1.0,
        ]
    }
}

impl Situation {
    /// Reduces a percept to the quantities that a brake uses.
    pub(super) fn of(percept: &Percept) -> Situation {
        let others = percept.others.iter();
        Situation {
            time_s: percept.time_s,
            sample_s: percept.sample_s,
            own: percept.own,
            ahead: others
                .filter_map(|seen| VehicleAhead::of(&percept.own, seen))
                .collect(),
        }
    }

    /// Returns the nearest vehicle that counts.
    pub(super) fn nearest(&self, counts: BrakedFor) -> Option<&VehicleAhead> {
        let BrakedFor {
            side_m,
            look_ahead_s,
        } = counts;
        let ahead = self.ahead.iter();
        // Lateral motion towards the path widens the corridor in proportion.
        ahead
            .filter(|ahead| ahead.side_m < side_m + look_ahead_s * ahead.towards_mps)
            .min_by(|a, b| a.clearance_m.total_cmp(&b.clearance_m))
    }
}

impl EmergencyBrake {
    /// Returns the change of acceleration until the next sample, if the brake acts.
    pub(super) fn change_mps2(&self, situation: &Situation) -> Option<f64> {
        let ahead = situation.nearest(self.counts)?;
        if self.only_closing && ahead.closing_mps() <= 0.0 {
            return None;
        }
        let pairs = self.weights().into_iter().zip(ahead.terms());
        let needed_m: f64 = pairs.map(|(weight, term)| weight * term).sum();
        (ahead.clearance_m < needed_m).then(|| self.full_braking_mps2(situation))
    }

    /// Returns the change of acceleration until the next sample while the brake acts.
    pub(super) fn full_braking_mps2(&self, situation: &Situation) -> f64 {
        let Situation { own, sample_s, .. } = situation;
        // The build-up starts from the present acceleration, whatever the command was before.
        let actuator = Actuator::new(self.lag_s, *sample_s);
        // Full braking must not drive the ego backwards within the sample.
        let next_mps2 = actuator.from(own.accel_mps2).step(-self.brake_mps2);
        next_mps2.max(-own.speed_mps / sample_s) - own.accel_mps2
    }

    /// Returns the weights of all distances.
    pub(super) fn weights(&self) -> [f64; TERMS] {
        [
            self.own_s2_per_m,
            self.others_s2_per_m,
            self.reaction_s,
            self.closing_s,
            self.closing_s2_per_m,
            self.margin_m,
        ]
    }

    /// Returns the same brake with other weights.
    pub(super) fn weighing(self, weights: [f64; TERMS]) -> EmergencyBrake {
        let [
            own_s2_per_m,
            others_s2_per_m,
            reaction_s,
            closing_s,
            closing_s2_per_m,
            margin_m,
        ] = weights;
        EmergencyBrake {
            own_s2_per_m,
            others_s2_per_m,
            reaction_s,
            closing_s,
            closing_s2_per_m,
            margin_m,
            ..self
        }
    }
}

impl Display for EmergencyBrake {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "brakes with {:.1} m/s²", self.brake_mps2)?;
        if self.lag_s > 0.0 {
            write!(f, " (time constant {:.2} s)", self.lag_s)?;
        }
        f.write_str(" where the clear way is less than")?;
        let names = ["v²", "−w²", "v", "c", "c²", ""];
        let terms = self.weights().into_iter().zip(names);
        for (i, (weight, name)) in terms.filter(|term| term.0 != 0.0).enumerate() {
            // The name of the second term has a minus, because the other's stopping distance
            // is subtracted.
            let is_less = (weight < 0.0) != name.starts_with('−');
            let sign = match (i, is_less) {
                (0, false) => "",
                (0, true) => "−",
                (_, false) => "+ ",
                (_, true) => "− ",
            };
            let name = name.trim_start_matches('−');
            let gap = if name.is_empty() { "" } else { " " };
            write!(f, " {sign}{:.3}{gap}{name}", weight.abs())?;
        }
        f.write_str(" m")?;
        if self.only_closing {
            f.write_str(" and shrinks")?;
        }
        Ok(())
    }
}
#[cfg(test)]
mod tests {
    use super::*;

    const BRAKE: EmergencyBrake = EmergencyBrake {
        brake_mps2: 6.0,
        lag_s: 0.0,
        own_s2_per_m: 0.1,
        others_s2_per_m: 0.05,
        reaction_s: 0.0,
        closing_s: 0.0,
        closing_s2_per_m: 0.0,
        margin_m: 2.0,
        only_closing: false,
        counts: BrakedFor {
            side_m: 0.0,
            look_ahead_s: 0.0,
        },
    };

    /// Ego at 20 m/s, 2 m wide, and another vehicle at 10 m/s, 4 m long.
    fn seen(headway_m: f64, lateral_m: f64, lateral_mps: f64) -> Percept {
        Percept {
            sample_s: 0.05,
            own: Own {
                speed_mps: 20.0,
                accel_mps2: -1.0,
                width_m: 2.0,
                ..Own::default()
            },
            others: vec![Seen {
                headway_m,
                lateral_m,
                lateral_mps,
                speed_mps: 10.0,
                length_m: 4.0,
                width_m: 2.0,
                ..Seen::default()
            }],
            ..Percept::default()
        }
    }

    fn change_of(brake: &EmergencyBrake, percept: &Percept) -> Option<f64> {
        brake.change_mps2(&Situation::of(percept))
    }

    #[test]
    fn it_brakes_where_the_weighted_sum_exceeds_the_clear_distance() {
        // 0.1 · 20² − 0.05 · 10² + 2 = 37 m, and the body is 4 m long.
        assert_eq!(change_of(&BRAKE, &seen(40.9, 0.0, 0.0)), Some(-5.0));
        assert_eq!(change_of(&BRAKE, &seen(41.1, 0.0, 0.0)), None);
        assert_eq!(change_of(&BRAKE, &seen(-5.0, 0.0, 0.0)), None, "behind");
        let slow = EmergencyBrake {
            lag_s: 0.4,
            ..BRAKE
        };
        let change = change_of(&slow, &seen(10.0, 0.0, 0.0)).expect("it brakes");
        assert!((change + 5.0 * (1.0 - (-0.125f64).exp())).abs() < 1e-9);
        let mut stopped = seen(5.0, 0.0, 0.0);
        stopped.others[0].speed_mps = 0.0;
        (stopped.own.speed_mps, stopped.own.accel_mps2) = (0.01, 0.0);
        let change = change_of(&BRAKE, &stopped).expect("it brakes");
        assert!((change + 0.2).abs() < 1e-9, "it stops within the sample");
    }

    #[test]
    fn vehicles_beside_or_leaving_count_by_the_criterion() {
        let beside = seen(20.0, 2.5, 0.0);
        assert_eq!(change_of(&BRAKE, &beside), None);
        let wide = EmergencyBrake {
            counts: BrakedFor {
                side_m: 0.6,
                look_ahead_s: 0.0,
            },
            ..BRAKE
        };
        assert_eq!(change_of(&wide, &beside), Some(-5.0));
        let foresees = EmergencyBrake {
            counts: BrakedFor {
                side_m: 0.0,
                look_ahead_s: 1.0,
            },
            ..BRAKE
        };
        assert_eq!(change_of(&foresees, &seen(20.0, 2.5, -0.6)), Some(-5.0));
        assert_eq!(change_of(&foresees, &seen(20.0, 2.5, 0.6)), None);
        let patient = EmergencyBrake {
            only_closing: true,
            ..BRAKE
        };
        let mut leaves = seen(20.0, 0.0, 0.0);
        assert_eq!(change_of(&patient, &leaves), Some(-5.0));
        leaves.others[0].speed_mps = 20.0;
        assert_eq!(change_of(&BRAKE, &leaves), Some(-5.0));
        assert_eq!(change_of(&patient, &leaves), None);
    }

    #[test]
    fn its_text_states_when_it_brakes() {
        let brake = EmergencyBrake {
            lag_s: 0.4,
            closing_s: -0.25,
            only_closing: true,
            ..BRAKE
        };
        assert_eq!(
            brake.to_string(),
            "brakes with 6.0 m/s² (time constant 0.40 s) where the clear way is less than \
             0.100 v² − 0.050 w² − 0.250 c + 2.000 m and shrinks"
        );
    }
}
