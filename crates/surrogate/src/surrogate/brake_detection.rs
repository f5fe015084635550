//! Fits the emergency brake of an ego to its recorded motion.
//!
//! The line of full braking gives the braked samples ([`braking_line`]).
//! The threshold then separates braked from unbraked samples by a weighted sum.
//! Samples at which braking began or ended give a first fit. Logistic regression on
//! nearby samples refines it.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::brake_line::{braking_line, worth};
use super::emergency_brake::{COUNTS, EmergencyBrake, MARGIN, Situation, TERMS};
use crate::seed;
use crate::stats::{CrossEntropySearch, SMALL_WEIGHTS, add_equation, logistic};

/// Smallest explained share of the braked samples.
///
/// Wrongly braked samples are subtracted.
// Brakes of `CcDriver`, `FsmDriver` and `RssDriver` are late or limited in jerk, and explain
// less than four fifths. With brakes, 20 of 20 starts of a safety filter are solved, before 9.
const LEAST_SHARE: f64 = 0.8;
/// Share that each distance in the sum must explain.
const PER_TERM: f64 = 0.01;
/// Draws of edge samples per sum of distances.
const DRAWS: usize = 200;
/// Largest number of samples used to choose the sum.
const TO_CHOOSE: usize = 4_000;
/// Number of sums refined by regression.
const REFINED: usize = 12;
/// Distances from the threshold within which samples refine it, m, in order.
const NEARBY_M: [f64; 5] = [1.0, 0.5, 0.3, 0.2, 0.1];
/// Smallest number of samples of each kind for a regression.
const FEW: usize = 5;
/// Distance from the threshold of samples that start a sum with a term less, m.
const SIMPLER_M: f64 = 2.0;

/// Fits the brake of an ego to its situations and changes of acceleration.
///
/// Returns `None` if no brake explains the samples. `before` is the brake fitted to
/// fewer runs of the same ego. Equal arguments give equal results.
pub(super) fn brake_in(
    situations: &[Situation],
    changes: &[f64],
    before: Option<EmergencyBrake>,
    seed: u64,
) -> Option<EmergencyBrake> {
    let mut dice = seed::generator("brake", &[seed]);
    let sample_s = situations.first()?.sample_s;
    let (line, near_mps2) = braking_line(situations, changes, sample_s, &mut dice)?;
    // Only the deceleration and the lag are known here. The weights follow.
    let brake = line.brake(sample_s);
    let pairs = situations.iter().zip(changes);
    let worths: Vec<f64> = pairs
        .map(|(situation, change)| worth(&brake, situation, *change, near_mps2))
        .collect();
    // Without a sample of full braking, any threshold would fit.
    if !worths.iter().any(|worth| *worth > 0.0) {
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
    let mut found: Vec<(Sum<'_>, [f64; TERMS], f64)> = Vec::new();
    let few: Vec<Cases> = kinds.iter().map(Cases::few).collect();
    for (kind, few) in kinds.iter().zip(&few) {
        // The margin is always in the sum, so the mask covers the other terms only.
        for terms in (1..1 << MARGIN).map(terms_of) {
            let sum = Sum { kind, few, terms };
            let drawn = sum.drawn(&mut dice).into_iter();
            let start_weights = drawn.chain(sum.separated(few, None));
            let best = start_weights
                .map(|weights| (weights, few.explained(&weights)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            found.extend(best.map(|(weights, explained)| {
                let net_gain = explained - PER_TERM * sum.terms.len() as f64;
                (sum, weights, net_gain)
            }));
        }
    }
    // The sort is stable, so equal candidates keep their order and results repeat.
    found.sort_by(|a, b| b.2.total_cmp(&a.2));
    found.truncate(REFINED);
    // The earlier brake is a candidate too, so runs that show no threshold do not lose it.
    if let Some(before) = before {
        let same = |kind: &Cases| {
            let of = (kind.of.counts, kind.of.only_closing);
            of == (before.counts, before.only_closing)
        };
        let weights = before.weights();
        // The earlier brake keeps its own terms.
        let terms: Vec<usize> = (0..TERMS)
            .filter(|&term| term == MARGIN || weights[term] != 0.0)
            .collect();
        let mut pairs = kinds.iter().zip(&few);
        let same = pairs.find(|(kind, _)| same(kind));
        found.extend(same.map(|(kind, few)| (Sum { kind, few, terms }, weights, 0.0)));
    }
    let refined = found
        .into_iter()
        .map(|(sum, weights, _)| sum.refined(weights, &mut dice));
    let best = refined.max_by(|a, b| a.net_gain().total_cmp(&b.net_gain()))?;
    let RefinedSum {
        sum,
        weights,
        explained,
    } = simpler(best, &mut dice);
    (explained >= LEAST_SHARE).then(|| sum.kind.of.weighing(weights))
}

/// Sample in which a brake may act.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BrakeSample {
    terms: [f64; TERMS],
    clearance_m: f64,
    worth: f64,
}

impl BrakeSample {
    /// Returns by how much the weighted sum exceeds the clear distance.
    fn over_m(&self, weights: &[f64; TERMS]) -> f64 {
        let pairs = self.terms.iter().zip(weights);
        pairs.map(|(term, weight)| term * weight).sum::<f64>() - self.clearance_m
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
        let pairs = situations.iter().zip(worths);
        let all = pairs.map(|(situation, &worth)| {
            let ahead = situation.nearest(brake.counts)?;
            let can = !brake.only_closing || ahead.closing_mps() > 0.0;
            can.then(|| BrakeSample {
                terms: ahead.terms(),
                clearance_m: ahead.clearance_m,
                worth,
            })
        });
        let cases: Vec<Option<BrakeSample>> = all.collect();
        let neighbours = cases.windows(2).zip(situations.windows(2));
        let edges = neighbours.filter_map(|(cases, situations)| {
            let (Some(one), Some(other)) = (&cases[0], &cases[1]) else {
                return None;
            };
            // The time restarts between runs, so the last sample of a run has no neighbour.
            let is_one = situations[0].time_s < situations[1].time_s;
            (is_one && one.worth * other.worth < 0.0).then(|| BrakeSample {
                terms: std::array::from_fn(|i| 0.5 * (one.terms[i] + other.terms[i])),
                clearance_m: 0.5 * (one.clearance_m + other.clearance_m),
                // An edge only marks the threshold, and no share is explained by it.
                worth: 0.0,
            })
        });
        Cases {
            of: *brake,
            edges: edges.collect(),
            // Of all samples, so that criteria with fewer cases are not flattered.
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
            // Each remaining sample stands for those that were left out.
            let more = if case.worth < 0.0 { every as f64 } else { 1.0 };
            wrong += usize::from(case.worth < 0.0);
            (case.worth > 0.0 || wrong.is_multiple_of(every)).then_some(BrakeSample {
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
    fn explained(&self, weights: &[f64; TERMS]) -> f64 {
        let braked = self.all.iter().filter(|case| case.over_m(weights) > 0.0);
        braked.map(|case| case.worth).sum::<f64>() / self.total
    }
}

/// Sum with refined weights.
#[derive(Clone)]
struct RefinedSum<'a> {
    sum: Sum<'a>,
    weights: [f64; TERMS],
    explained: f64,
}

impl RefinedSum<'_> {
    /// Returns the explained share less the cost of the terms.
    fn net_gain(&self) -> f64 {
        self.explained - PER_TERM * self.sum.terms.len() as f64
    }
}

/// Drops terms one at a time while this raises the value.
///
/// The weights of similar terms can otherwise compensate each other.
fn simpler<'a>(mut best: RefinedSum<'a>, dice: &mut ChaCha8Rng) -> RefinedSum<'a> {
    loop {
        let terms = best.sum.terms.iter().filter(|&&term| term != MARGIN);
        let without = terms.map(|&term| {
            let others = best.sum.terms.iter().filter(|&&other| other != term);
            Sum {
                terms: others.copied().collect(),
                ..best.sum
            }
        });
        let refined = without.filter_map(|sum| {
            let start_weights = sum.separated(sum.kind, Some((&best.weights, SIMPLER_M)))?;
            Some(sum.refined(start_weights, dice))
        });
        let simplest = refined.max_by(|a, b| a.net_gain().total_cmp(&b.net_gain()));
        match simplest {
            Some(simplest) if best.net_gain() < simplest.net_gain() => best = simplest,
            _ => return best,
        }
    }
}

/// Returns the positions of the selected terms, the margin always included.
fn terms_of(mask: usize) -> Vec<usize> {
    (0..TERMS)
        .filter(|&term| term == MARGIN || mask >> term & 1 == 1)
        .collect()
}

/// Weighted sum of some distances.
#[derive(Clone)]
struct Sum<'a> {
    kind: &'a Cases,
    /// Subset of `kind` with fewer samples.
    few: &'a Cases,
    terms: Vec<usize>,
}

impl<'a> Sum<'a> {
    /// Returns the best weights among thresholds drawn through a few edges.
    fn drawn(&self, dice: &mut ChaCha8Rng) -> Option<[f64; TERMS]> {
        let edges = &self.few.edges;
        let drawn = self.terms.len() + 1;
        if edges.len() < drawn {
            return None;
        }
        // Terms are scaled to comparable size, so the same regularisation suits all of them.
        let size = |term: usize| {
            let sizes = edges.iter().map(|edge| edge.terms[term].abs());
            sizes.fold(1e-9, f64::max)
        };
        let sizes: Vec<f64> = self.terms.iter().map(|&term| size(term)).collect();
        let one = |_| {
            let mut left = DMatrix::identity(self.terms.len(), self.terms.len()) * SMALL_WEIGHTS;
            let mut right = DVector::zeros(self.terms.len());
            for _ in 0..drawn {
                let edge = &edges[dice.random_range(0..edges.len())];
                let terms = self.terms.iter().zip(&sizes);
                let row: Vec<f64> = terms.map(|(&term, size)| edge.terms[term] / size).collect();
                add_equation(&mut left, &mut right, &row, 1.0, edge.clearance_m);
            }
            // A singular draw has no solution and is skipped.
            let solved = left.cholesky()?.solve(&right);
            let scaled = solved
                .iter()
                .zip(&sizes)
                .map(|(weight, size)| weight / size);
            Some(self.whole(scaled))
        };
        let drawn = (0..DRAWS)
            .filter_map(one)
            .map(|weights| (self.few.explained(&weights), weights));
        let best = drawn.max_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, weights)| weights)
    }

    /// Returns the threshold that separates braked from unbraked samples best.
    ///
    /// Logistic regression fits it to all samples, or to samples near another threshold.
    fn separated(&self, cases: &Cases, near: Option<(&[f64; TERMS], f64)>) -> Option<[f64; TERMS]> {
        let nearby: Vec<&BrakeSample> = cases
            .all
            .iter()
            .filter(|case| near.is_none_or(|(weights, near_m)| case.over_m(weights).abs() < near_m))
            .collect();
        let row = |case: &BrakeSample| {
            let terms = self.terms.iter().map(|&term| case.terms[term]);
            terms.chain([-case.clearance_m]).collect::<Vec<f64>>()
        };
        let rows: Vec<Vec<f64>> = nearby.iter().map(|case| row(case)).collect();
        let worths: Vec<f64> = nearby.iter().map(|case| case.worth).collect();
        let count = |is: fn(&f64) -> bool| worths.iter().filter(|&worth| is(worth)).count();
        if count(|&worth| worth > 0.0) < FEW || count(|&worth| worth < 0.0) < FEW {
            return None;
        }
        let found = logistic(&rows, &worths)?;
        let (clear, weights) = found.split_last()?;
        // A brake acts sooner with less clearance, so the weight of the clearance is positive.
        (*clear > 0.0).then(|| self.whole(weights.iter().map(|weight| weight / clear)))
    }

    /// Refines a threshold with ever nearer samples, then by cross-entropy search.
    fn refined(self, weights: [f64; TERMS], dice: &mut ChaCha8Rng) -> RefinedSum<'a> {
        let mut best = (weights, self.kind.explained(&weights));
        let mut here = weights;
        for near_m in NEARBY_M {
            // Too few samples near the threshold end the refinement.
            let Some(there) = self.separated(self.kind, Some((&here, near_m))) else {
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
    fn near(&self, weights: &[f64; TERMS], dice: &mut ChaCha8Rng) -> [f64; TERMS] {
        let cases = &self.few.all;
        let size = |term: usize| {
            let squares = cases.iter().map(|case| case.terms[term] * case.terms[term]);
            let size = (squares.sum::<f64>() / cases.len().max(1) as f64).sqrt();
            // A distance that is always zero keeps its weight.
            if size < 1e-6 { f64::INFINITY } else { size }
        };
        let sizes: Vec<f64> = self.terms.iter().map(|&term| size(term)).collect();
        // A point holds the change in metres that each weight makes to its term.
        let at = |point: &Vec<f64>| {
            let moved = self.terms.iter().zip(point).zip(&sizes);
            self.whole(moved.map(|((&term, by_m), size)| weights[term] + by_m / size))
        };
        let costs = |points: &[Vec<f64>]| -> Vec<f64> {
            let explained = points.iter().map(|point| self.few.explained(&at(point)));
            explained.map(|explained| -explained).collect()
        };
        at(&CrossEntropySearch::NEAR
            .run(vec![0.0; self.terms.len()], dice, &costs)
            .point)
    }

    /// Expands the weights of the summed terms to all terms.
    fn whole(&self, of: impl Iterator<Item = f64>) -> [f64; TERMS] {
        let mut weights = [0.0; TERMS];
        for (&term, weight) in self.terms.iter().zip(of) {
            weights[term] = weight;
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogate::recorded_runs::runs_of;

    fn seen_of(name: &str) -> (Vec<Situation>, Vec<f64>) {
        let runs = runs_of(name, crate::sim::PlantKind::Kinematic, 33);
        let percepts = runs.iter().flat_map(|run| {
            let answers = run.answers.iter().map(|answer| answer[0]);
            run.inputs.percepts.iter().zip(answers)
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
        let filter = brake_in(&situations, &changes, None, 1).expect("it brakes");
        close(filter.brake_mps2, 6.0, 0.01);
        close(filter.lag_s, 0.4, 0.005);
        close(filter.own_s2_per_m, 1.0 / 12.0, 0.003);
        close(filter.others_s2_per_m, 1.0 / 12.0, 0.003);
        close(filter.margin_m, 0.2, 0.02);
        assert_eq!(brake_in(&situations, &changes, None, 1), Some(filter));

        let (situations, changes) = seen_of("aeb");
        let aeb = brake_in(&situations, &changes, None, 1).expect("it brakes");
        close(aeb.brake_mps2, 8.0, 0.01);
        close(aeb.closing_s2_per_m, 1.0 / 8.0, 0.003);
        close(aeb.margin_m, 1.5, 0.05);
        assert!(aeb.only_closing);
        assert_eq!(aeb.own_s2_per_m, 0.0);
    }

    #[test]
    fn a_brake_that_was_found_before_is_kept_where_nothing_tells_otherwise() {
        let (situations, changes) = seen_of("filter");
        let before = brake_in(&situations, &changes, None, 1).expect("it brakes");
        let pairs = situations.iter().zip(&changes);
        let braked = pairs.filter(|(situation, change)| {
            let braking = before.change_mps2(situation);
            braking.is_some_and(|braking| (braking - *change).abs() < 1e-3)
        });
        let (situations, changes): (Vec<_>, Vec<_>) = braked
            .map(|(situation, change)| (situation.clone(), *change))
            .unzip();
        assert_eq!(brake_in(&situations, &changes, None, 1), None);
        let kept = brake_in(&situations, &changes, Some(before), 1);
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
        assert_eq!(brake_in(&situations, &changes, None, 1), None);
        changes.fill(0.0);
        assert_eq!(brake_in(&situations, &changes, None, 1), None);
        assert_eq!(brake_in(&[], &[], None, 1), None);
    }
}
