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
//!
//! While a brake acts, the acceleration converges to the same value.
//! Its changes therefore lie on a line over the acceleration, whatever is ahead.
//! Few other behaviours lie on a line, apart from other limits of the ego.
//! Consensus finds this line and the braked samples (Fischler & Bolles 1981).

use std::fmt::{self, Display, Formatter};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::ego::{Actuator, Own, Percept, Seen};

/// Number of weighted distances.
pub(super) const TERMS: usize = 6;
/// Index of the last distance, the margin, which is constant.
pub(super) const MARGIN: usize = TERMS - 1;

/// Brake that acts while the clear distance is less than a weighted sum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EmergencyBrake {
    /// Deceleration, m/s².
    pub brake_mps2: f64,
    /// Time constant of the build-up, s.
    pub lag_s: f64,
    /// Stopping distance per own speed squared, s²/m.
    pub own_s2_per_m: f64,
    /// Stopping distance per other speed squared, which is subtracted, s²/m.
    pub others_s2_per_m: f64,
    /// Distance until the brakes act per own speed, s.
    pub reaction_s: f64,
    /// Distance per closing speed, a time to collision, s.
    pub closing_s: f64,
    /// Distance per closing speed squared, s²/m.
    pub closing_s2_per_m: f64,
    /// Distance to be left, m.
    pub margin_m: f64,
    /// Whether the brake acts only while the clear distance shrinks.
    pub only_closing: bool,
    /// Vehicles that count as being ahead.
    pub counts: BrakedFor,
}

/// Criterion by which a vehicle counts as being ahead.
///
/// Its body must come nearer to the ego's path than `side_m` within `look_ahead_s`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrakedFor {
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
        if 0.0 < self.lag_s {
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

/// Number of candidate lines, and largest number of samples they are checked on.
const LINES: usize = 2_000;
const CHECKED: usize = 3_000;
/// Distances within which samples lie on a line, m/s².
///
/// The smallest suits a simulation without noise, the largest an ego that hardly
/// repeats itself.
const NEAR_MPS2: [f64; 4] = [1e-3, 1e-2, 3e-2, 1e-1];
/// Factor on that distance that bounds the neighbourhood from which chance is estimated.
const AROUND: f64 = 10.0;
/// Smallest change that counts as braking, m/s².
const LEAST_MPS2: f64 = 0.05;
/// Softest and hardest braking that a line may lead to.
const BRAKES_MPS2: std::ops::Range<f64> = 2.0..12.0;
/// The longest time constant, s.
const LONGEST_LAG_S: f64 = 1.0;
/// Lowest speed of a moving ego, m/s.
///
/// Below it, the stop limits the deceleration.
const MOVES_MPS: f64 = 0.5;
/// Smallest number of samples on a line.
const LEAST_SAMPLES: f64 = 20.0;
/// Deviation beyond which a wrongly braked sample counts fully, m/s².
const WRONG_MPS2: f64 = 0.1;

/// Line of changes of acceleration: a fixed share of the way to a deceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct BrakeLine {
    brake_mps2: f64,
    share: f64,
}

impl BrakeLine {
    /// Returns the line through a sample with the given slope.
    ///
    /// `share` is the part of the remaining deceleration reached per sample.
    /// `None`: no brake has this deceleration or time constant.
    fn of((accel_mps2, change_mps2): (f64, f64), share: f64, sample_s: f64) -> Option<BrakeLine> {
        let brake_mps2 = -accel_mps2 - change_mps2 / share;
        // A first-order lag reaches at least this share per sample.
        let least = 1.0 - libm::exp(-sample_s / LONGEST_LAG_S);
        // The tolerance admits a brake without lag, which has a share of 1 up to rounding.
        let is_one = (least..=1.0 + 1e-6).contains(&share) && BRAKES_MPS2.contains(&brake_mps2);
        is_one.then_some(BrakeLine { brake_mps2, share })
    }

    fn change_mps2(&self, accel_mps2: f64) -> f64 {
        self.share * (-self.brake_mps2 - accel_mps2)
    }

    /// Returns a brake with this line and zero weights, so it never acts.
    pub(super) fn brake(&self, sample_s: f64) -> EmergencyBrake {
        let left = 1.0 - self.share;
        EmergencyBrake {
            brake_mps2: self.brake_mps2,
            lag_s: if left <= 1e-6 {
                0.0
            } else {
                -sample_s / libm::log(left)
            },
            own_s2_per_m: 0.0,
            others_s2_per_m: 0.0,
            reaction_s: 0.0,
            closing_s: 0.0,
            closing_s2_per_m: 0.0,
            margin_m: 0.0,
            only_closing: false,
            counts: COUNTS[0],
        }
    }
}

/// Returns the line with the most samples beyond chance, and its tolerance.
pub(super) fn braking_line(
    situations: &[Situation],
    changes: &[f64],
    sample_s: f64,
    dice: &mut ChaCha8Rng,
) -> Option<(BrakeLine, f64)> {
    let pairs = situations.iter().zip(changes);
    // Near standstill the stop limits the deceleration, so these samples lie on no line.
    let braking = pairs.filter(|(situation, change)| {
        MOVES_MPS < situation.own.speed_mps && **change < -LEAST_MPS2 / 2.0
    });
    let all: Vec<(f64, f64)> = braking
        .map(|(situation, change)| (situation.own.accel_mps2, *change))
        .collect();
    if (all.len() as f64) < LEAST_SAMPLES {
        return None;
    }
    let every = all.len().div_ceil(CHECKED);
    let few: Vec<(f64, f64)> = all.iter().step_by(every).copied().collect();
    // Subtracts twice the number expected on the line if the neighbourhood is chance.
    let excess = |line: &BrakeLine, near_mps2: f64| {
        let mut on_and_around = [0.0; 2];
        for &(accel_mps2, change_mps2) in &few {
            let braking_mps2 = line.change_mps2(accel_mps2);
            let off = (change_mps2 - braking_mps2).abs();
            // Changes near zero lie on many lines and count for none.
            if braking_mps2 < -3.0 * near_mps2 && off < AROUND * near_mps2 {
                on_and_around[usize::from(near_mps2 <= off)] += 1.0;
            }
        }
        on_and_around[0] - 2.0 / AROUND * on_and_around[1]
    };
    let mut best: Option<(f64, BrakeLine, f64)> = None;
    for draw in 0..LINES {
        let one = dice.random_range(0..all.len());
        // Braking lasts several samples, so half of the pairs are drawn close together.
        let other = match draw % 2 {
            0 => dice.random_range(0..all.len()),
            _ => (one + dice.random_range(1..4)) % all.len(),
        };
        let [(a, change_a), (b, change_b)] = [all[one], all[other]];
        let share = (change_a - change_b) / (b - a);
        let Some(line) = BrakeLine::of((a, change_a), share, sample_s) else {
            continue;
        };
        for near_mps2 in NEAR_MPS2 {
            let excess = excess(&line, near_mps2);
            if best.is_none_or(|best| best.0 < excess) {
                best = Some((excess, line, near_mps2));
            }
        }
    }
    let (excess, line, near_mps2) = best?;
    // Least squares removes the error of the two drawn samples.
    let fitted = fitted(line, near_mps2, &all);
    let refined = BrakeLine::of(fitted.0, fitted.1, sample_s).unwrap_or(line);
    (LEAST_SAMPLES <= excess * every as f64).then_some((refined, near_mps2))
}

/// Fits a line by least squares to the samples near a line.
///
/// Returns the mean sample and the share.
fn fitted(line: BrakeLine, near_mps2: f64, all: &[(f64, f64)]) -> ((f64, f64), f64) {
    let on = || {
        let near = all
            .iter()
            .filter(|(accel, change)| (change - line.change_mps2(*accel)).abs() < near_mps2);
        near.copied()
    };
    let count = on().count() as f64;
    let mean = |of: fn((f64, f64)) -> f64| on().map(of).sum::<f64>() / count;
    let (accel, change) = (mean(|it| it.0), mean(|it| it.1));
    let [mut across, mut along] = [0.0; 2];
    for (a, c) in on() {
        across += (a - accel) * (a - accel);
        along += (a - accel) * (c - change);
    }
    ((accel, change), -along / across)
}

/// Returns the value of braking at a sample.
///
/// It is 1 where the ego braked as the brake does, and falls to −1 where it did not.
/// It is 0 where the sample shows neither.
pub(super) fn worth(
    brake: &EmergencyBrake,
    situation: &Situation,
    change_mps2: f64,
    near_mps2: f64,
) -> f64 {
    let full_braking_mps2 = brake.full_braking_mps2(situation);
    let off_mps2 = change_mps2 - full_braking_mps2;
    let near_mps2 = 3.0 * near_mps2;
    // The brake would change almost nothing here, so the sample shows neither.
    if -LEAST_MPS2 / 2.0 < full_braking_mps2 {
        0.0
    } else if off_mps2.abs() < near_mps2 {
        f64::from(u8::from(full_braking_mps2 < -LEAST_MPS2))
    } else {
        -(off_mps2 / WRONG_MPS2).clamp(0.0, 1.0)
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
