//! Proposals of starts: the law of the starts, tilted to where failures are likely.

/// Least share of the law itself in a proposal.
const NATURAL: f64 = 0.1;
/// Most leaves.
const LEAVES: usize = 64;
/// Fewest starts of a leaf.
const LEAST_STARTS: usize = 24;

/// Density over the uniform numbers behind a start, constant in boxes.
///
/// Boxes have known sizes, so the density needs no normalisation by draws.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StartTree {
    leaves: Vec<StartBox>,
}

#[derive(Clone, Debug, PartialEq)]
struct StartBox {
    ends: Vec<[f64; 2]>,
    /// Density against the law, 1 for the law itself.
    density: f64,
    volume: f64,
}

/// Box with the starts in it.
struct StartCell {
    ends: Vec<[f64; 2]>,
    starts: Vec<usize>,
    volume: f64,
    /// Volume times the root of the mean squared value.
    cost: f64,
}

impl StartTree {
    /// Returns the law of the starts itself.
    pub(super) fn natural(dimensions: usize) -> StartTree {
        StartTree {
            leaves: vec![StartBox {
                ends: vec![[0.0, 1.0]; dimensions],
                density: 1.0,
                volume: 1.0,
            }],
        }
    }

    /// Fits a density to values of starts that were drawn from the law.
    ///
    /// Its variance is least if the density of a box is the root of the mean squared
    /// value. Boxes are halved where that helps most.
    pub(super) fn fit(starts: &[(Vec<f64>, f64)], dimensions: usize) -> StartTree {
        let whole = StartCell::new(
            vec![[0.0, 1.0]; dimensions],
            (0..starts.len()).collect(),
            starts,
        );
        // Without a value above 0, no start is better than another.
        if dimensions == 0 || whole.cost <= 0.0 {
            return StartTree::natural(dimensions);
        }
        let mut cells = vec![whole];
        while cells.len() < LEAVES {
            let gains = cells.iter().enumerate().filter_map(|(at, cell)| {
                let (gain, pair) = cell.best_halves(starts)?;
                Some((gain, at, pair))
            });
            // Strictly more, so that the first of equal boxes is halved.
            let best = gains.reduce(|best, it| if best.0 < it.0 { it } else { best });
            let Some((gain, at, [low, high])) = best else {
                break;
            };
            if gain <= 0.0 {
                break;
            }
            // The order of the boxes decides what a uniform number draws, so it must be
            // reproducible.
            cells[at] = low;
            cells.push(high);
        }
        let sum: f64 = cells.iter().map(|cell| cell.cost).sum();
        let leaf = |cell: StartCell| StartBox {
            // A share of the law itself bounds the weights where V is wrong.
            density: NATURAL + (1.0 - NATURAL) * cell.cost / (sum * cell.volume),
            volume: cell.volume,
            ends: cell.ends,
        };
        StartTree {
            leaves: cells.into_iter().map(leaf).collect(),
        }
    }

    /// Returns the density of a start against the law.
    pub(super) fn density(&self, shares: &[f64]) -> f64 {
        let holds = |leaf: &&StartBox| {
            let mut all = leaf.ends.iter().zip(shares);
            // The last box of an axis includes its end.
            all.all(|([lo, hi], it)| lo <= it && (it < hi || *hi == 1.0))
        };
        self.leaves
            .iter()
            .find(holds)
            .map_or(1.0, |leaf| leaf.density)
    }

    /// Returns a start of the density, from uniform numbers. `which` chooses the box.
    pub(super) fn draw(&self, which: f64, uniform: &[f64]) -> Vec<f64> {
        let mut left = which;
        let mut chosen = &self.leaves[0];
        for leaf in &self.leaves {
            // Rounding may leave a rest, which falls into the last box.
            chosen = leaf;
            left -= leaf.density * leaf.volume;
            if left < 0.0 {
                break;
            }
        }
        let inside = chosen.ends.iter().zip(uniform);
        inside.map(|([lo, hi], it)| lo + it * (hi - lo)).collect()
    }
}

impl StartCell {
    fn new(ends: Vec<[f64; 2]>, starts: Vec<usize>, all: &[(Vec<f64>, f64)]) -> StartCell {
        let volume: f64 = ends.iter().map(|[lo, hi]| hi - lo).product();
        let squares = starts.iter().map(|at| all[*at].1 * all[*at].1);
        let mean = squares.sum::<f64>() / starts.len().max(1) as f64;
        StartCell {
            ends,
            starts,
            volume,
            cost: volume * libm::sqrt(mean),
        }
    }

    /// Returns the halves that lower the cost most, with the gain.
    fn best_halves(&self, all: &[(Vec<f64>, f64)]) -> Option<(f64, [StartCell; 2])> {
        let halves = (0..self.ends.len()).filter_map(|axis| {
            let [lo, hi] = self.ends[axis];
            // Halves are binary fractions, so the volumes of all boxes
            // add up to 1 exactly.
            let middle = 0.5 * (lo + hi);
            let is_low = |at: &usize| all[*at].0[axis] < middle;
            let own = self.starts.iter().copied();
            let (low, high): (Vec<usize>, Vec<usize>) = own.partition(is_low);
            // A density of few starts would be fitted to chance.
            if low.len().min(high.len()) < LEAST_STARTS {
                return None;
            }
            let half = |starts: Vec<usize>, ends: [f64; 2]| {
                let mut own = self.ends.clone();
                own[axis] = ends;
                StartCell::new(own, starts, all)
            };
            let pair = [half(low, [lo, middle]), half(high, [middle, hi])];
            Some((self.cost - pair[0].cost - pair[1].cost, pair))
        });
        halves.reduce(|best, it| if best.0 < it.0 { it } else { best })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::generator;
    use rand::RngExt;

    #[test]
    fn densities_integrate_to_one_and_draws_follow_them() {
        let mut rng = generator("tree", &[1]);
        let mut starts = Vec::new();
        for _ in 0..4000 {
            let shares = vec![rng.random::<f64>(), rng.random::<f64>()];
            let fails = shares[0] < 0.1 && shares[1] > 0.6;
            starts.push((shares, if fails { 0.3 } else { 1e-6 }));
        }
        let tree = StartTree::fit(&starts, 2);
        let whole: f64 = tree.leaves.iter().map(|it| it.density * it.volume).sum();
        assert!((whole - 1.0).abs() < 1e-12);
        // The mean of 1 / density under the draws is 1, the size of the unit square.
        let (mut inverse, mut inside, n) = (0.0, 0, 20_000);
        for _ in 0..n {
            let uniform = [rng.random::<f64>(), rng.random::<f64>()];
            let shares = tree.draw(rng.random::<f64>(), &uniform);
            inverse += 1.0 / tree.density(&shares) / f64::from(n);
            inside += i32::from(shares[0] < 0.125 && shares[1] > 0.5);
        }
        assert!((inverse - 1.0).abs() < 0.08, "{inverse}");
        assert!(n / 2 < inside, "{inside} of {n} draws where failures are");
    }

    #[test]
    fn boxes_contain_their_lower_ends_and_the_last_one_its_upper_end() {
        let starts: Vec<_> = (0..200)
            .map(|at| {
                let share = (f64::from(at) + 0.5) / 200.0;
                (vec![share], if share < 0.5 { 1.0 } else { 0.0 })
            })
            .collect();
        let tree = StartTree::fit(&starts, 1);
        for (share, density) in [(0.0, 1.9), (0.499, 1.9), (0.5, 0.1), (1.0, 0.1)] {
            let found = tree.density(&[share]);
            assert!((found - density).abs() < 1e-9, "{share}: {found}");
        }
        // A start outside all boxes has the density of the law.
        assert_eq!(tree.density(&[-0.5]), 1.0);
        // Draws fill the boxes in the order of their shares.
        assert_eq!(tree.draw(0.0, &[0.5]), [0.25]);
        assert_eq!(tree.draw(0.94, &[0.5]), [0.25]);
        assert_eq!(tree.draw(0.96, &[0.5]), [0.75]);
        assert_eq!(tree.draw(1.0, &[0.5]), [0.75]);
    }

    #[test]
    fn few_starts_equal_values_and_no_failure_split_nothing() {
        let fitted = |n: u32, value: fn(f64) -> f64| {
            let starts = (0..n).map(|at| {
                let share = (f64::from(at) + 0.5) / f64::from(n);
                (vec![share], value(share))
            });
            StartTree::fit(&starts.collect::<Vec<_>>(), 1)
        };
        let halves = |share: f64| if share < 0.5 { 1.0 } else { 0.0 };
        // A half needs 24 starts.
        assert_eq!(fitted(46, halves).leaves.len(), 1);
        assert_eq!(fitted(48, halves).leaves.len(), 2);
        assert_eq!(fitted(1000, |_| 0.5).leaves.len(), 1);
        assert_eq!(fitted(1000, |_| 0.0), StartTree::natural(1));
        assert_eq!(
            StartTree::fit(&[(Vec::new(), 1.0)], 0),
            StartTree::natural(0)
        );
        // A steep value splits until a half has too few starts, or there are 64 boxes.
        let steep = fitted(20_000, |share| libm::exp(-40.0 * share));
        assert_eq!(steep.leaves.len(), 64);
        assert!(steep.density(&[0.001]) > 10.0 && steep.density(&[0.9]) < 0.11);
    }
}
