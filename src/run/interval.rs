//! Intervals of rates: Wilson for one run, bootstrap over seeds and starts.

use std::collections::BTreeMap;

use rand::RngExt;

use crate::seed;

/// Replicates of the bootstrap.
const REPLICATES: usize = 2_000;

/// Wilson's 95 % score interval of `successes` out of `n`; [0, 1] for n = 0.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    const Z: f64 = 1.959_963_984_540_054;
    let (n, p) = (n as f64, successes as f64 / n as f64);
    let z2 = Z * Z;
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    // Exact at the edges, where rounding would leave dust.
    let lo = if successes == 0 {
        0.0
    } else {
        (centre - half).max(0.0)
    };
    let hi = if p == 1.0 {
        1.0
    } else {
        (centre + half).min(1.0)
    };
    [lo, hi]
}

/// 95 % interval of the mean success rate of several training seeds.
///
/// `solved` holds one `solved` string per seed, all over the same starts.
/// Seeds and starts are drawn with replacement, the same starts for all seeds
/// of a replicate; trivial starts (`t`) and unreached ones (`-`) do not count.
pub fn two_level_bootstrap(solved: &[&str]) -> [f64; 2] {
    let marks = Marks::new(solved);
    percentiles(&marks, |seeds, starts| marks.rate(seeds, starts))
}

/// Mean of `a − b` in success rate, and its 95 % interval, paired on starts.
///
/// Both sides are over the same starts; each may have any number of seeds.
pub fn paired_difference(a: &[&str], b: &[&str]) -> (f64, [f64; 2]) {
    let (a, b) = (Marks::new(a), Marks::new(b));
    let all: Vec<usize> = (0..a.starts).collect();
    let whole = |marks: &Marks| marks.rate(&(0..marks.seeds.len()).collect::<Vec<_>>(), &all);
    let mut dice = seed::generator("bootstrap/other", &[]);
    let interval = percentiles(&a, |seeds, starts| {
        let others = draw(b.seeds.len(), &mut dice);
        a.rate(seeds, starts) - b.rate(&others, starts)
    });
    (whole(&a) - whole(&b), interval)
}

/// Mean over egos of `a − b` in success rate, with its 95 % interval.
///
/// One pair per ego, each side with any number of seeds, all over the same
/// starts. Starts are drawn together for all egos and both sides, so that a
/// start that is easy everywhere counts once. Seeds are drawn per side, the same
/// ones for all egos: it is the same trainings that meet them. Egos are not
/// drawn: the interval speaks of these egos, not of others.
pub fn mean_difference(pairs: &[(Vec<&str>, Vec<&str>)]) -> (f64, [f64; 2]) {
    let pairs: Vec<(Marks, Marks)> = pairs
        .iter()
        .map(|(a, b)| (Marks::new(a), Marks::new(b)))
        .collect();
    let Some((first, _)) = pairs.first() else {
        return (0.0, [-1.0, 1.0]);
    };
    let mean = |starts: &[usize], of: &mut dyn FnMut(Side, usize) -> Vec<usize>| {
        let mut sum = 0.0;
        for (a, b) in &pairs {
            sum += a.rate(&of(Side::A, a.seeds.len()), starts);
            sum -= b.rate(&of(Side::B, b.seeds.len()), starts);
        }
        sum / pairs.len() as f64
    };
    let all: Vec<usize> = (0..first.starts).collect();
    let mut dice = seed::generator("bootstrap/egos", &[]);
    let interval = percentiles(first, |_, starts| {
        let mut drawn: BTreeMap<(Side, usize), Vec<usize>> = BTreeMap::new();
        mean(starts, &mut |side, seeds| {
            let once = drawn.entry((side, seeds));
            once.or_insert_with(|| draw(seeds, &mut dice)).clone()
        })
    });
    (mean(&all, &mut |_, seeds| (0..seeds).collect()), interval)
}

/// One side of a comparison.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    A,
    B,
}

/// Which starts were solved, per seed.
struct Marks {
    seeds: Vec<Vec<u8>>,
    starts: usize,
}

impl Marks {
    fn new(solved: &[&str]) -> Marks {
        let seeds: Vec<Vec<u8>> = solved.iter().map(|s| s.as_bytes().to_vec()).collect();
        let starts = seeds.iter().map(Vec::len).min().unwrap_or(0);
        Marks { seeds, starts }
    }

    fn rate(&self, seeds: &[usize], starts: &[usize]) -> f64 {
        let (mut ones, mut counted) = (0u64, 0u64);
        for &seed in seeds {
            for &start in starts {
                let mark = self.seeds[seed][start];
                ones += u64::from(mark == b'1');
                counted += u64::from(mark == b'1' || mark == b'0');
            }
        }
        ones as f64 / counted.max(1) as f64
    }
}

fn draw(n: usize, dice: &mut rand_chacha::ChaCha8Rng) -> Vec<usize> {
    (0..n).map(|_| dice.random_range(0..n)).collect()
}

fn percentiles(marks: &Marks, mut statistic: impl FnMut(&[usize], &[usize]) -> f64) -> [f64; 2] {
    if marks.seeds.is_empty() || marks.starts == 0 {
        return [0.0, 1.0];
    }
    let mut dice = seed::generator("bootstrap", &[]);
    let mut values: Vec<f64> = (0..REPLICATES)
        .map(|_| {
            let seeds = draw(marks.seeds.len(), &mut dice);
            let starts = draw(marks.starts, &mut dice);
            statistic(&seeds, &starts)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (REPLICATES - 1) as f64).round() as usize];
    [at(0.025), at(0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_agrees_with_published_values() {
        // Newcombe 1998, Table I: 81 of 263, and 0 of 20.
        let [lo, hi] = wilson(81, 263);
        assert!((lo - 0.2553).abs() < 1e-4 && (hi - 0.3662).abs() < 1e-4);
        let [lo, hi] = wilson(0, 20);
        assert!(lo == 0.0 && (hi - 0.1611).abs() < 1e-4);
        for n in 1..200 {
            assert_eq!((wilson(0, n)[0], wilson(n, n)[1]), (0.0, 1.0));
        }
    }

    #[test]
    fn with_one_seed_the_bootstrap_is_near_wilson() {
        let solved = format!("{}{}ttt", "1".repeat(80), "0".repeat(20));
        let [lo, hi] = two_level_bootstrap(&[&solved]);
        let [wilson_lo, wilson_hi] = wilson(80, 100);
        assert!((lo - wilson_lo).abs() < 0.03 && (hi - wilson_hi).abs() < 0.03);
    }

    #[test]
    fn pairing_sees_what_unpaired_intervals_hide() {
        // b solves what a solves, less three starts: clearly worse, if paired.
        let a = format!("{}{}", "1".repeat(60), "0".repeat(40));
        let b = format!("{}{}", "1".repeat(52), "0".repeat(48));
        let (difference, [lo, hi]) = paired_difference(&[&a], &[&b]);
        assert!((difference - 0.08).abs() < 1e-12);
        assert!(0.0 < lo && hi < 0.2, "{lo} {hi}");
        let (_, [lo, hi]) = paired_difference(&[&a], &[&a]);
        assert!(lo == 0.0 && hi == 0.0);
    }

    #[test]
    fn a_start_that_is_easy_for_every_ego_counts_once() {
        // Ten egos that fail on the very same starts tell no more than one.
        let a = format!("{}{}", "1".repeat(60), "0".repeat(40));
        let b = format!("{}{}", "1".repeat(52), "0".repeat(48));
        let pair = || (vec![a.as_str()], vec![b.as_str()]);
        let ten: Vec<_> = (0..10).map(|_| pair()).collect();
        let (one, [lo, hi]) = mean_difference(&[pair()]);
        let (mean, [lo10, hi10]) = mean_difference(&ten);
        assert!((one - 0.08).abs() < 1e-12 && (mean - 0.08).abs() < 1e-12);
        assert!((lo - lo10).abs() < 1e-12 && (hi - hi10).abs() < 1e-12);
        let mixed = [pair(), (vec![&*b], vec![&*a])];
        assert!(mean_difference(&mixed).0.abs() < 1e-12);
    }

    #[test]
    fn a_training_that_failed_fails_on_every_ego() {
        // Two trainings, one good for nothing: ten egos tell no more of that
        // than one.
        let (good, bad) = ("1".repeat(100), "0".repeat(100));
        let pair = || (vec![good.as_str(), bad.as_str()], vec![bad.as_str()]);
        let ten: Vec<_> = (0..10).map(|_| pair()).collect();
        let (mean, [lo, hi]) = mean_difference(&ten);
        assert_eq!((mean, lo, hi), (0.5, 0.0, 1.0));
    }

    #[test]
    fn several_seeds_widen_the_interval_by_their_spread() {
        let good = "1".repeat(100);
        let bad = "0".repeat(100);
        let [lo, hi] = two_level_bootstrap(&[&good, &bad, &good, &bad]);
        assert!(lo <= 0.25 && 0.75 <= hi);
    }
}
