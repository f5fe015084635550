//! Line of full braking in the recorded changes of acceleration.
//!
//! While a brake acts, the acceleration converges to the same value.
//! Its changes therefore lie on a line over the acceleration, whatever is ahead.
//! Few other behaviours lie on a line, apart from other limits of the ego.
//! Consensus finds this line and the braked samples (Fischler & Bolles 1981).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::emergency_brake::{COUNTS, EmergencyBrake, Situation};

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
    fn of(accel_mps2: f64, change_mps2: f64, share: f64, sample_s: f64) -> Option<BrakeLine> {
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
        // Rounding may lift the share to 1 or above, where the rest has no logarithm.
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
        situation.own.speed_mps > MOVES_MPS && **change < -LEAST_MPS2 / 2.0
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
        // Equal accelerations make the share infinite or undefined,
        // which is refused here.
        let Some(line) = BrakeLine::of(a, change_a, share, sample_s) else {
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
    let (accel_mps2, change_mps2, share) = fitted(line, near_mps2, &all);
    // Without two different accelerations near the line, the share is undefined and the
    // drawn line stays.
    let refined = BrakeLine::of(accel_mps2, change_mps2, share, sample_s).unwrap_or(line);
    (excess * every as f64 >= LEAST_SAMPLES).then_some((refined, near_mps2))
}

/// Fits a line by least squares to the samples near a line.
///
/// Returns the acceleration and the change of the mean sample, and the share.
fn fitted(line: BrakeLine, near_mps2: f64, all: &[(f64, f64)]) -> (f64, f64, f64) {
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
    (accel, change, -along / across)
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
