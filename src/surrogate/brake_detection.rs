//! Fits the emergency brake of an ego to its recorded motion.
//!
//! While a brake acts, the acceleration converges to the same value.
//! Its changes therefore lie on a line over the acceleration, whatever is ahead.
//! Few other behaviours lie on one line, apart from other limits of the ego.
//! Consensus finds this line and the braked samples first (Fischler & Bolles 1981).
//! The threshold then separates braked from unbraked samples by a weighted sum.
//! Samples at which braking began or ended give a first fit. Logistic regression on
//! nearby samples refines it.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::emergency_brake::{BrakedFor, EmergencyBrake, MARGIN, Situation, WAYS};
use super::regression::{SMALL_WEIGHTS, add, logistic};
use crate::seed;
use crate::stats::CrossEntropySearch;

/// Number of candidate lines, and largest number of samples they are checked on.
const LINES: usize = 2_000;
const HELD_AGAINST: usize = 3_000;
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
/// Smallest explained share of the braked samples.
///
/// Wrongly braked samples are subtracted.
const LEAST_SHARE: f64 = 0.8;
/// Share that each distance in the sum must explain.
const PER_WAY: f64 = 0.01;
/// Draws of edge samples per sum of distances.
const DRAWS: usize = 200;
/// Largest number of samples used to choose the sum.
const TO_CHOOSE: usize = 4_000;
/// Number of sums refined by regression.
const SETTLED: usize = 12;
/// Distances from the threshold within which samples refine it, m, in order.
const NEARBY_M: [f64; 5] = [1.0, 0.5, 0.3, 0.2, 0.1];
/// Smallest number of samples of each kind for a regression.
const FEW: usize = 5;
/// Distance from the threshold of samples that start a sum with a term less, m.
const SIMPLER_M: f64 = 2.0;
/// Criteria for vehicles ahead that are tried.
const COUNTS: [BrakedFor; 4] = [
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

/// Fits the brake of an ego to its situations and changes of acceleration.
///
/// Returns `None` if no brake explains the samples. `before` is the brake fitted to
/// fewer runs of the same ego. Equal arguments give equal results.
pub(super) fn brake_in(
    situations: &[Situation],
    changes: &[f64],
    (before, seed): (Option<EmergencyBrake>, u64),
) -> Option<EmergencyBrake> {
    let mut dice = seed::generator("brake", &[seed]);
    let sample_s = situations.first()?.sample_s;
    let (line, near_mps2) = line(situations, changes, sample_s, &mut dice)?;
    // Only the deceleration and the lag are known here. The weights follow.
    let brake = line.brake(sample_s);
    let pairs = situations.iter().zip(changes);
    let worths = pairs.map(|(situation, change)| worth(&brake, situation, *change, near_mps2));
    let worths: Vec<f64> = worths.collect();
    if !worths.iter().any(|worth| 0.0 < *worth) {
        return None;
    }
    let mut kinds: Vec<Cases> = Vec::new();
    for counts in COUNTS {
        for only_closing in [false, true] {
            let brake = EmergencyBrake {
                counts,
                only_closing,
                ..brake
            };
            let cases = Cases::of(&brake, situations, &worths);
            // Without lateral motion all criteria select the same samples.
            // Duplicates are dropped.
            if !kinds.iter().any(|kind| kind.all == cases.all) {
                kinds.push(cases);
            }
        }
    }
    let mut found: Vec<(Sum<'_>, [f64; WAYS], f64)> = Vec::new();
    let few: Vec<Cases> = kinds.iter().map(Cases::few).collect();
    for (kind, few) in kinds.iter().zip(&few) {
        // The margin is always in the sum, so the mask covers the other terms only.
        for ways in (1..1 << MARGIN).map(ways_of) {
            let sum = Sum { kind, few, ways };
            let drawn = sum.drawn(&mut dice).into_iter();
            let begun = drawn.chain(sum.told_apart(few, None));
            let best = begun.map(|weights| (weights, few.explained(&weights)));
            let best = best.max_by(|a, b| a.1.total_cmp(&b.1));
            found.extend(best.map(|(weights, explained)| {
                let worth_it = explained - PER_WAY * sum.ways.len() as f64;
                (sum, weights, worth_it)
            }));
        }
    }
    // The sort is stable, so equal candidates keep their order and results repeat.
    found.sort_by(|a, b| b.2.total_cmp(&a.2));
    found.truncate(SETTLED);
    // The earlier brake is a candidate too, so runs that show no threshold do not lose it.
    if let Some(before) = before {
        let same = |kind: &Cases| {
            let of = (kind.of.counts, kind.of.only_closing);
            of == (before.counts, before.only_closing)
        };
        let weights = before.weights();
        // The earlier brake keeps its own terms.
        let ways = (0..WAYS).filter(|&way| way == MARGIN || weights[way] != 0.0);
        let ways: Vec<usize> = ways.collect();
        let mut pairs = kinds.iter().zip(&few);
        let same = pairs.find(|(kind, _)| same(kind));
        found.extend(same.map(|(kind, few)| (Sum { kind, few, ways }, weights, 0.0)));
    }
    let settled = found
        .into_iter()
        .map(|(sum, weights, _)| sum.settled(weights, &mut dice));
    let best = settled.max_by(|a, b| a.worth_it().total_cmp(&b.worth_it()))?;
    let RefinedSum {
        sum,
        weights,
        explained,
    } = simpler(best, &mut dice);
    (LEAST_SHARE <= explained).then(|| sum.kind.of.weighing(weights))
}

/// Line of changes of acceleration: a fixed share of the way to a deceleration.
#[derive(Clone, Copy, Debug)]
struct BrakeLine {
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
    fn brake(&self, sample_s: f64) -> EmergencyBrake {
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
fn line(
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
    let every = all.len().div_ceil(HELD_AGAINST);
    let few: Vec<(f64, f64)> = all.iter().step_by(every).copied().collect();
    // Subtracts twice the number expected on the line if the neighbourhood is chance.
    let excess = |line: &BrakeLine, near_mps2: f64| {
        let mut on_and_around = [0.0; 2];
        for &(accel_mps2, change_mps2) in &few {
            let gripping = line.change_mps2(accel_mps2);
            let off = (change_mps2 - gripping).abs();
            // Changes near zero lie on many lines and count for none.
            if gripping < -3.0 * near_mps2 && off < AROUND * near_mps2 {
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
    let settled = BrakeLine::of(fitted.0, fitted.1, sample_s).unwrap_or(line);
    (LEAST_SAMPLES <= excess * every as f64).then_some((settled, near_mps2))
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
fn worth(brake: &EmergencyBrake, situation: &Situation, change_mps2: f64, near_mps2: f64) -> f64 {
    let gripping_mps2 = brake.gripping_mps2(situation);
    let off_mps2 = change_mps2 - gripping_mps2;
    let near_mps2 = 3.0 * near_mps2;
    // The brake would change almost nothing here, so the sample shows neither.
    if -LEAST_MPS2 / 2.0 < gripping_mps2 {
        0.0
    } else if off_mps2.abs() < near_mps2 {
        f64::from(u8::from(gripping_mps2 < -LEAST_MPS2))
    } else {
        -(off_mps2 / WRONG_MPS2).clamp(0.0, 1.0)
    }
}

/// Sample in which a brake may act.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BrakeSample {
    ways: [f64; WAYS],
    clearance_m: f64,
    worth: f64,
}

impl BrakeSample {
    /// Returns by how much the weighted sum exceeds the clear distance.
    fn over_m(&self, weights: &[f64; WAYS]) -> f64 {
        let pairs = self.ways.iter().zip(weights);
        pairs.map(|(way, weight)| way * weight).sum::<f64>() - self.clearance_m
    }
}

/// All samples in which some brake may act.
struct Cases {
    of: EmergencyBrake,
    all: Vec<BrakeSample>,
    /// Midpoints between neighbouring samples between which braking began or ended.
    edges: Vec<BrakeSample>,
    /// Value of all braked samples, including those in which this brake cannot act.
    total: f64,
}

impl Cases {
    fn of(brake: &EmergencyBrake, situations: &[Situation], worths: &[f64]) -> Cases {
        let case = |(situation, &worth): (&Situation, &f64)| {
            let ahead = situation.nearest(brake.counts)?;
            let can = !brake.only_closing || 0.0 < ahead.closing_mps();
            can.then(|| BrakeSample {
                ways: ahead.ways(),
                clearance_m: ahead.clearance_m,
                worth,
            })
        };
        let cases: Vec<Option<BrakeSample>> = situations.iter().zip(worths).map(case).collect();
        let neighbours = cases.windows(2).zip(situations.windows(2));
        let edges = neighbours.filter_map(|(cases, situations)| {
            let (Some(one), Some(other)) = (&cases[0], &cases[1]) else {
                return None;
            };
            // The time restarts between runs, so the last sample of a run has no neighbour.
            let is_one = situations[0].time_s < situations[1].time_s;
            (is_one && one.worth * other.worth < 0.0).then(|| BrakeSample {
                ways: std::array::from_fn(|i| 0.5 * (one.ways[i] + other.ways[i])),
                clearance_m: 0.5 * (one.clearance_m + other.clearance_m),
                worth: 0.0,
            })
        });
        Cases {
            of: *brake,
            edges: edges.collect(),
            total: worths.iter().map(|worth| worth.max(0.0)).sum(),
            all: cases
                .into_iter()
                .flatten()
                .filter(|case| case.worth != 0.0)
                .collect(),
        }
    }

    /// Returns a subset with fewer unbraked samples, each weighted accordingly.
    fn few(&self) -> Cases {
        let every = self.all.len().div_ceil(TO_CHOOSE).max(1);
        let mut wrong = 0;
        let thinned = self.all.iter().filter_map(|case| {
            // Braked samples are rare, so all of them stay.
            let more = if case.worth < 0.0 { every as f64 } else { 1.0 };
            wrong += usize::from(case.worth < 0.0);
            (0.0 < case.worth || wrong.is_multiple_of(every)).then_some(BrakeSample {
                worth: more * case.worth,
                ..*case
            })
        });
        Cases {
            all: thinned.collect(),
            edges: self.edges.clone(),
            ..*self
        }
    }

    /// Returns the explained share of braked samples, less the wrongly braked ones.
    fn explained(&self, weights: &[f64; WAYS]) -> f64 {
        let gripped = self.all.iter().filter(|case| 0.0 < case.over_m(weights));
        gripped.map(|case| case.worth).sum::<f64>() / self.total
    }
}

/// Sum with refined weights.
#[derive(Clone)]
struct RefinedSum<'a> {
    sum: Sum<'a>,
    weights: [f64; WAYS],
    explained: f64,
}

impl RefinedSum<'_> {
    /// Returns the explained share less the cost of the terms.
    fn worth_it(&self) -> f64 {
        self.explained - PER_WAY * self.sum.ways.len() as f64
    }
}

/// Drops terms one at a time while this raises the value.
///
/// The weights of similar terms can otherwise compensate each other.
fn simpler<'a>(mut best: RefinedSum<'a>, dice: &mut ChaCha8Rng) -> RefinedSum<'a> {
    loop {
        let ways = best.sum.ways.iter().filter(|&&way| way != MARGIN);
        let without = ways.map(|&way| {
            let others = best.sum.ways.iter().filter(|&&other| other != way);
            Sum {
                ways: others.copied().collect(),
                ..best.sum
            }
        });
        let settled = without.filter_map(|sum| {
            let begun = sum.told_apart(sum.kind, Some((&best.weights, SIMPLER_M)))?;
            Some(sum.settled(begun, dice))
        });
        let simplest = settled.max_by(|a, b| a.worth_it().total_cmp(&b.worth_it()));
        match simplest {
            Some(simplest) if best.worth_it() < simplest.worth_it() => best = simplest,
            _ => return best,
        }
    }
}

/// Returns the positions of the selected terms, the margin always included.
fn ways_of(mask: usize) -> Vec<usize> {
    (0..WAYS)
        .filter(|&way| way == MARGIN || mask >> way & 1 == 1)
        .collect()
}

/// Weighted sum of some distances.
#[derive(Clone)]
struct Sum<'a> {
    kind: &'a Cases,
    /// Subset of `kind` with fewer samples.
    few: &'a Cases,
    ways: Vec<usize>,
}

impl<'a> Sum<'a> {
    /// Returns the best weights among thresholds drawn through a few edges.
    fn drawn(&self, dice: &mut ChaCha8Rng) -> Option<[f64; WAYS]> {
        let edges = &self.few.edges;
        let drawn = self.ways.len() + 1;
        if edges.len() < drawn {
            return None;
        }
        // Terms are scaled to comparable size, so the same regularisation suits all of them.
        let size = |way: usize| {
            let sizes = edges.iter().map(|edge| edge.ways[way].abs());
            sizes.fold(1e-9, f64::max)
        };
        let sizes: Vec<f64> = self.ways.iter().map(|&way| size(way)).collect();
        let one = |_| {
            let mut left = DMatrix::identity(self.ways.len(), self.ways.len()) * SMALL_WEIGHTS;
            let mut right = DVector::zeros(self.ways.len());
            for _ in 0..drawn {
                let edge = &edges[dice.random_range(0..edges.len())];
                let ways = self.ways.iter().zip(&sizes);
                let row: Vec<f64> = ways.map(|(&way, size)| edge.ways[way] / size).collect();
                add(&mut left, &mut right, &row, (1.0, edge.clearance_m));
            }
            // A singular draw has no solution and is skipped.
            let solved = left.cholesky()?.solve(&right);
            let scaled = solved
                .iter()
                .zip(&sizes)
                .map(|(weight, size)| weight / size);
            Some(self.whole(scaled))
        };
        let drawn = (0..DRAWS).filter_map(one);
        let drawn = drawn.map(|weights| (self.few.explained(&weights), weights));
        let best = drawn.max_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, weights)| weights)
    }

    /// Returns the threshold that separates braked from unbraked samples best.
    ///
    /// Logistic regression fits it to all samples, or to samples near another threshold.
    fn told_apart(&self, cases: &Cases, near: Option<(&[f64; WAYS], f64)>) -> Option<[f64; WAYS]> {
        let nearby = cases.all.iter().filter(|case| {
            near.is_none_or(|(weights, near_m)| case.over_m(weights).abs() < near_m)
        });
        let nearby: Vec<&BrakeSample> = nearby.collect();
        let row = |case: &BrakeSample| {
            let ways = self.ways.iter().map(|&way| case.ways[way]);
            ways.chain([-case.clearance_m]).collect::<Vec<f64>>()
        };
        let rows: Vec<Vec<f64>> = nearby.iter().map(|case| row(case)).collect();
        let worths: Vec<f64> = nearby.iter().map(|case| case.worth).collect();
        let count = |is: fn(&f64) -> bool| worths.iter().filter(|&worth| is(worth)).count();
        if count(|&worth| 0.0 < worth) < FEW || count(|&worth| worth < 0.0) < FEW {
            return None;
        }
        let found = logistic(&rows, &worths)?;
        let (clear, weights) = found.split_last()?;
        // A brake acts sooner with less clearance, so the weight of the clearance is positive.
        (0.0 < *clear).then(|| self.whole(weights.iter().map(|weight| weight / clear)))
    }

    /// Refines a threshold with ever nearer samples, then by cross-entropy search.
    fn settled(self, weights: [f64; WAYS], dice: &mut ChaCha8Rng) -> RefinedSum<'a> {
        let mut best = (weights, self.kind.explained(&weights));
        let mut here = weights;
        for near_m in NEARBY_M {
            // Too few samples near the threshold end the refinement.
            let Some(there) = self.told_apart(self.kind, Some((&here, near_m))) else {
                break;
            };
            let explained = self.kind.explained(&there);
            // Each step may worsen the fit, so the best threshold so far is kept.
            if best.1 < explained {
                best = (there, explained);
            }
            here = there;
        }
        let near = self.near(&best.0, dice);
        let explained = self.kind.explained(&near);
        if best.1 < explained {
            best = (near, explained);
        }
        RefinedSum {
            sum: self,
            weights: best.0,
            explained: best.1,
        }
    }

    /// Returns the threshold with the largest explained share near a given threshold.
    fn near(&self, weights: &[f64; WAYS], dice: &mut ChaCha8Rng) -> [f64; WAYS] {
        let cases = &self.few.all;
        let size = |way: usize| {
            let squares = cases.iter().map(|case| case.ways[way] * case.ways[way]);
            let size = (squares.sum::<f64>() / cases.len().max(1) as f64).sqrt();
            // A distance that is always zero keeps its weight.
            if size < 1e-6 { f64::INFINITY } else { size }
        };
        let sizes: Vec<f64> = self.ways.iter().map(|&way| size(way)).collect();
        // A point holds the change in metres that each weight makes to its term.
        let at = |point: &Vec<f64>| {
            let moved = self.ways.iter().zip(point).zip(&sizes);
            self.whole(moved.map(|((&way, by_m), size)| weights[way] + by_m / size))
        };
        let costs = |points: &[Vec<f64>]| -> Vec<f64> {
            let explained = points.iter().map(|point| self.few.explained(&at(point)));
            explained.map(|explained| -explained).collect()
        };
        at(&CrossEntropySearch::NEAR
            .run(vec![0.0; self.ways.len()], dice, &costs)
            .point)
    }

    /// Expands the weights of the summed terms to all terms.
    fn whole(&self, of: impl Iterator<Item = f64>) -> [f64; WAYS] {
        let mut weights = [0.0; WAYS];
        for (&way, weight) in self.ways.iter().zip(of) {
            weights[way] = weight;
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogate::recorded_ego::runs_of;

    fn seen_of(name: &str) -> (Vec<Situation>, Vec<f64>) {
        let runs = runs_of(name, crate::sim::PlantKind::Kinematic, 33);
        let percepts = runs.iter().flat_map(|run| {
            let answers = run.answers.iter().map(|answer| answer[0]);
            run.heard.percepts.iter().zip(answers)
        });
        percepts
            .map(|(percept, change)| (Situation::of(percept), change))
            .unzip()
    }

    #[test]
    fn the_brakes_of_published_egos_are_found_with_their_numbers() {
        let close = |value: f64, truth: f64, by: f64| {
            assert!((value - truth).abs() < by, "{value} for {truth}");
        };
        let (situations, changes) = seen_of("filter");
        let filter = brake_in(&situations, &changes, (None, 1)).expect("it brakes");
        close(filter.brake_mps2, 6.0, 0.01);
        close(filter.lag_s, 0.4, 0.005);
        close(filter.own_s2_per_m, 1.0 / 12.0, 0.003);
        close(filter.others_s2_per_m, 1.0 / 12.0, 0.003);
        close(filter.margin_m, 0.2, 0.02);
        assert_eq!(brake_in(&situations, &changes, (None, 1)), Some(filter));

        let (situations, changes) = seen_of("aeb");
        let aeb = brake_in(&situations, &changes, (None, 1)).expect("it brakes");
        close(aeb.brake_mps2, 8.0, 0.01);
        close(aeb.closing_s2_per_m, 1.0 / 8.0, 0.003);
        close(aeb.margin_m, 1.5, 0.05);
        assert!(aeb.only_closing);
        assert_eq!(aeb.own_s2_per_m, 0.0);
    }

    #[test]
    fn a_brake_that_was_found_before_is_kept_where_nothing_tells_otherwise() {
        let (situations, changes) = seen_of("filter");
        let before = brake_in(&situations, &changes, (None, 1)).expect("it brakes");
        let pairs = situations.iter().zip(&changes);
        let gripped = pairs.filter(|(situation, change)| {
            let braking = before.change_mps2(situation);
            braking.is_some_and(|braking| (braking - *change).abs() < 1e-3)
        });
        let (situations, changes): (Vec<_>, Vec<_>) = gripped
            .map(|(situation, change)| (situation.clone(), *change))
            .unzip();
        assert_eq!(brake_in(&situations, &changes, (None, 1)), None);
        let kept = brake_in(&situations, &changes, (Some(before), 1));
        assert_eq!(kept.map(|kept| kept.weights()), Some(before.weights()));
    }

    #[test]
    fn one_who_only_follows_has_no_brake() {
        let (situations, mut changes) = seen_of("filter");
        // Soft braking that depends smoothly on the percept.
        for (situation, change) in situations.iter().zip(&mut changes) {
            let speed_mps = situation.own.speed_mps;
            let wish = libm::sin(0.02 * speed_mps * speed_mps - 4.0);
            *change = 0.1 * (wish - situation.own.accel_mps2 * 0.3);
        }
        assert_eq!(brake_in(&situations, &changes, (None, 1)), None);
        changes.fill(0.0);
        assert_eq!(brake_in(&situations, &changes, (None, 1)), None);
        assert_eq!(brake_in(&[], &[], (None, 1)), None);
    }
}
