//! Cross-entropy search in a box (Rubinstein 1999): draw, keep the best, refit.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::seed::normal;

/// The best point found, in −1 ..= 1 per dimension, and its cost.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fit {
    pub point: Vec<f64>,
    pub cost: f64,
}

/// Least standard deviation, of a range from −1 to 1.
const LEAST_SPREAD: f64 = 0.005;

/// Length and width of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossEntropySearch {
    generations: usize,
    population: usize,
    elite: usize,
    /// Standard deviation at the start.
    wide: f64,
}

impl CrossEntropySearch {
    /// Search of the whole box.
    pub const WIDE: CrossEntropySearch = CrossEntropySearch {
        generations: 20,
        population: 48,
        elite: 8,
        wide: 0.8,
    };
    /// Search around a point that is nearly right.
    pub const NEAR: CrossEntropySearch = CrossEntropySearch {
        generations: 10,
        population: 32,
        elite: 6,
        wide: 0.2,
    };

    /// Searches around `mean`; `costs` measures many points at once.
    pub fn run(
        &self,
        mut mean: Vec<f64>,
        dice: &mut ChaCha8Rng,
        costs: &dyn Fn(&[Vec<f64>]) -> Vec<f64>,
    ) -> Fit {
        let mut spread = vec![self.wide; mean.len()];
        let mut best = Fit {
            point: mean.clone(),
            cost: f64::INFINITY,
        };
        for _ in 0..self.generations {
            let mut points: Vec<Vec<f64>> = (1..self.population)
                .map(|_| draw(&mean, &spread, dice))
                .collect();
            points.push(mean.clone());
            let measured = costs(&points);
            let mut order: Vec<usize> = (0..points.len()).collect();
            // Equal costs keep the order of the draws: a stable sort.
            order.sort_by(|&a, &b| measured[a].total_cmp(&measured[b]));
            if measured[order[0]] < best.cost {
                best = Fit {
                    point: points[order[0]].clone(),
                    cost: measured[order[0]],
                };
            }
            let elite: Vec<&Vec<f64>> = order[..self.elite].iter().map(|&i| &points[i]).collect();
            (mean, spread) = refit(&elite, LEAST_SPREAD);
        }
        best
    }
}

/// Mean and standard deviation of one or more points, per dimension; the deviation is at
/// least `least`, which keeps a search from standing still too early.
fn refit(points: &[&Vec<f64>], least: f64) -> (Vec<f64>, Vec<f64>) {
    // Invariant: there is a point.
    debug_assert!(!points.is_empty());
    let count = points.len() as f64;
    let dimensions = points.first().map_or(0, |point| point.len());
    let per_dimension = (0..dimensions).map(|d| {
        let mean = points.iter().map(|point| point[d]).sum::<f64>() / count;
        let squares = points.iter().map(|point| (point[d] - mean).powi(2));
        (mean, (squares.sum::<f64>() / count).sqrt().max(least))
    });
    per_dimension.unzip()
}

/// A point about `mean`, in the box.
fn draw(mean: &[f64], spread: &[f64], dice: &mut ChaCha8Rng) -> Vec<f64> {
    let pairs = mean.iter().zip(spread);
    pairs
        .map(|(mean, spread)| (mean + spread * normal(dice)).clamp(-1.0, 1.0))
        .collect()
}

/// A position by its share; rounding leaves what remains to the last one.
pub(crate) fn pick(shares: &[f64], rng: &mut ChaCha8Rng) -> usize {
    let mut left = rng.random::<f64>();
    let below = shares.iter().position(|share| {
        left -= share;
        left < 0.0
    });
    below.unwrap_or(shares.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed;

    #[test]
    fn the_least_of_a_bowl_is_found_and_the_box_is_kept() {
        let mut dice = seed::generator("test", &[]);
        let bowl = |points: &[Vec<f64>]| -> Vec<f64> {
            let cost = |p: &Vec<f64>| (p[0] - 0.3).powi(2) + 4.0 * (p[1] + 2.0).powi(2);
            points.iter().map(cost).collect()
        };
        let found = CrossEntropySearch::WIDE.run(vec![0.0, 0.0], &mut dice, &bowl);
        assert!((found.point[0] - 0.3).abs() < 0.01, "{found:?}");
        assert_eq!(found.point[1], -1.0);
    }
}
