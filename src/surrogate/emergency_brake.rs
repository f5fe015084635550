//! An emergency brake: what an ego does beyond a threshold.
//!
//! Many an ego follows smoothly and brakes with all it has once it gets too near. A
//! network rounds that off, and a plan that must fit some centimetres then misses.
//! What systems that avoid rear-end collisions compare with the clear way ahead is a
//! sum of ways: to a stop, the own and the other's, what is covered until the brakes
//! grip, and what closing takes (Seiler, Song & Hedrick, SAE 980853, compare those of
//! Mazda, Honda and Berkeley; required deceleration and time to collision are of the
//! same form). So a brake has a weight for each of these ways, and whichever of them
//! an ego compares is found by looking for weights ([`super::brake_detection`]).

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::ego::{Actuator, Own, Percept, Seen};

/// What weights are of.
pub(super) const WAYS: usize = 6;
/// The last of them, of which there is as much everywhere.
pub(super) const MARGIN: usize = WAYS - 1;

/// A brake that grips as long as the clear way to the one ahead is less than a sum of
/// ways.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EmergencyBrake {
    /// Its deceleration, m/s².
    pub brake_mps2: f64,
    /// Time constant with which it builds up, s.
    pub lag_s: f64,
    /// Way to a stop per own speed squared, s²/m.
    pub own_s2_per_m: f64,
    /// The other's, which leaves more room, s²/m.
    pub others_s2_per_m: f64,
    /// Way until the brakes grip, per own speed, s.
    pub reaction_s: f64,
    /// Way per closing speed, a time to collision, s.
    pub closing_s: f64,
    /// Way per closing speed squared, s²/m.
    pub closing_s2_per_m: f64,
    /// What is to be left, m.
    pub margin_m: f64,
    /// Whether it grips only while the clear way shrinks.
    pub only_closing: bool,
    /// Who counts as being ahead.
    pub counts: BrakedFor,
}

/// Who counts as being ahead: whose body, in so many seconds, comes nearer than this to
/// the ego's path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrakedFor {
    /// Free width at either side, m.
    pub side_m: f64,
    /// How far ahead motion across the road is expected to go on, s.
    pub look_ahead_s: f64,
}

/// A moment in which an ego may brake.
#[derive(Clone, Debug)]
pub(super) struct Situation {
    pub time_s: f64,
    pub sample_s: f64,
    pub own: Own,
    /// Everybody ahead.
    ahead: Vec<Ahead>,
}

/// Somebody ahead, as a brake sees them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    pub clearance_m: f64,
    own_mps: f64,
    other_mps: f64,
    /// Between their sides, negative where they overlap.
    side_m: f64,
    towards_mps: f64,
}

impl Ahead {
    /// `None`: it is not ahead.
    fn of(own: &Own, seen: &Seen) -> Option<Ahead> {
        let room = seen.room();
        if room.far_m <= 0.0 {
            return None;
        }
        Some(Ahead {
            clearance_m: room.near_m,
            own_mps: own.speed_mps,
            other_mps: seen.speed_mps,
            side_m: room.right_m.max(-room.left_m) - 0.5 * own.width_m,
            towards_mps: (-seen.lateral_mps * seen.lateral_m.signum()).max(0.0),
        })
    }

    /// How fast the clear way shrinks.
    pub fn closing_mps(&self) -> f64 {
        self.own_mps - self.other_mps
    }

    /// What the weights are of.
    pub fn ways(&self) -> [f64; WAYS] {
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
    /// What a brake sees of a percept.
    pub fn of(percept: &Percept) -> Situation {
        let others = percept.others.iter();
        Situation {
            time_s: percept.time_s,
            sample_s: percept.sample_s,
            own: percept.own,
            ahead: others
                .filter_map(|seen| Ahead::of(&percept.own, seen))
                .collect(),
        }
    }

    /// The nearest of those who count.
    pub fn nearest(&self, counts: BrakedFor) -> Option<&Ahead> {
        let BrakedFor {
            side_m,
            look_ahead_s,
        } = counts;
        let ahead = self.ahead.iter();
        ahead
            .filter(|ahead| ahead.side_m < side_m + look_ahead_s * ahead.towards_mps)
            .min_by(|a, b| a.clearance_m.total_cmp(&b.clearance_m))
    }
}

impl EmergencyBrake {
    /// The change of acceleration until the next sample, if it grips.
    pub(super) fn change_mps2(&self, situation: &Situation) -> Option<f64> {
        let ahead = situation.nearest(self.counts)?;
        if self.only_closing && ahead.closing_mps() <= 0.0 {
            return None;
        }
        let pairs = self.weights().into_iter().zip(ahead.ways());
        let way_m: f64 = pairs.map(|(weight, way)| weight * way).sum();
        (ahead.clearance_m < way_m).then(|| self.gripping_mps2(situation))
    }

    /// The same, gripping.
    pub(super) fn gripping_mps2(&self, situation: &Situation) -> f64 {
        let Situation { own, sample_s, .. } = situation;
        let actuator = Actuator::new(self.lag_s, *sample_s);
        // Whoever brakes to a stop stands.
        let next_mps2 = actuator.from(own.accel_mps2).step(-self.brake_mps2);
        next_mps2.max(-own.speed_mps / sample_s) - own.accel_mps2
    }

    /// The weights of all ways.
    pub(super) fn weights(&self) -> [f64; WAYS] {
        [
            self.own_s2_per_m,
            self.others_s2_per_m,
            self.reaction_s,
            self.closing_s,
            self.closing_s2_per_m,
            self.margin_m,
        ]
    }

    /// The same brake with other weights.
    pub(super) fn weighing(self, weights: [f64; WAYS]) -> EmergencyBrake {
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
        if 0.0 < self.lag_s {
            write!(f, " (time constant {:.2} s)", self.lag_s)?;
        }
        f.write_str(" where the clear way is less than")?;
        let names = ["v²", "−w²", "v", "c", "c²", ""];
        let terms = self.weights().into_iter().zip(names);
        for (i, (weight, name)) in terms.filter(|term| term.0 != 0.0).enumerate() {
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

    /// The ego drives 20 m/s, 2 m wide; somebody drives 10 m/s, 4 m long.
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
    fn it_grips_where_the_ways_are_longer_than_the_clear_one() {
        // 0.1 · 20² − 0.05 · 10² + 2 = 37 m, and the body is 4 m long.
        assert_eq!(change_of(&BRAKE, &seen(40.9, 0.0, 0.0)), Some(-5.0));
        assert_eq!(change_of(&BRAKE, &seen(41.1, 0.0, 0.0)), None);
        assert_eq!(change_of(&BRAKE, &seen(-5.0, 0.0, 0.0)), None, "behind");
        let slow = EmergencyBrake {
            lag_s: 0.4,
            ..BRAKE
        };
        let change = change_of(&slow, &seen(10.0, 0.0, 0.0)).expect("it grips");
        assert!((change + 5.0 * (1.0 - (-0.125f64).exp())).abs() < 1e-9);
        let mut stands = seen(5.0, 0.0, 0.0);
        stands.others[0].speed_mps = 0.0;
        (stands.own.speed_mps, stands.own.accel_mps2) = (0.01, 0.0);
        let change = change_of(&BRAKE, &stands).expect("it grips");
        assert!((change + 0.2).abs() < 1e-9, "it stands then");
    }

    #[test]
    fn who_is_beside_or_leaves_counts_as_it_says() {
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
    fn it_says_when_it_brakes() {
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
