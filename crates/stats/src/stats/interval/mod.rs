//! Intervals of success rates over starts and trainings.
//!
//! A rate is measured on some starts with some trainings, and is an estimate
//! for other starts and other trainings. Both vary. Easy starts are easy for
//! most trainings, and there are only a few trainings, which differ. So the
//! variance of a mean rate has three parts: trainings, starts, and the rest in
//! single episodes. A two-way layout of the marks separates them (`scores`).
//!
//! The part of the starts is close to normal, because there are hundreds. The
//! part of three or five trainings is not, and a bootstrap of so few is far too
//! narrow. It comes from a beta-binomial model (`trainings`). In the middle,
//! this model is about as wide as Student's t with one degree of freedom less
//! than trainings. At the edges it respects that rates end at 0 and 1.
//!
//! docs/background/intervals.md derives the method, and `examples/coverage` measures its
//! coverage.

mod mcnemar;
mod predicted;
mod scores;
#[cfg(test)]
mod tests;
mod trainings;

pub use mcnemar::mcnemar;
pub use predicted::predicted;

use super::outcomes::{Outcomes, StartOutcome};
use scores::{ScoreSide, Scores};

/// 97.5th percentile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Wilson's 95 % score interval of `successes` out of `n`. [0, 1] for n = 0.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    wilson_of(successes as f64 / n as f64, n as f64)
}

/// Wilson's interval of a rate that was measured on `n` coins.
fn wilson_of(p: f64, n: f64) -> [f64; 2] {
    let z2 = Z * Z;
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    // Exact at the edges, where rounding would leave a small difference.
    let lo = if p == 0.0 {
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

/// 95 % upper bound of a rate of which `n` trials have shown no success.
///
/// It is Clopper and Pearson's exact one-sided bound: with this rate, n trials
/// show no success with probability 0.05. It is about 3 / n, and 1 for n = 0.
pub fn at_most(n: usize) -> f64 {
    match n {
        0 => 1.0,
        n => 1.0 - libm::pow(0.05, 1.0 / n as f64),
    }
}

/// 95 % interval of the mean success rate over trainings and starts.
///
/// `solved` has the outcomes of one training each, all over the same starts.
/// Only solved and unsolved starts count. The interval concerns the mean rate
/// of other trainings on other starts, and contains the mean of the measured
/// rates. With one training it is Wilson's interval and concerns that policy
/// only. It is [0, 1] if nothing counts.
pub fn seeds_interval(solved: &[&Outcomes]) -> [f64; 2] {
    if solved.len() < 2 {
        let of = |outcome| solved.iter().map(|outcomes| outcomes.count(outcome)).sum();
        let successes: usize = of(StartOutcome::Solved);
        return wilson(successes, successes + of(StartOutcome::Unsolved));
    }
    let Some(scores) = Scores::of_rate(solved) else {
        return [0.0, 1.0];
    };
    let Some(side) = scores.sides.first() else {
        return [0.0, 1.0];
    };
    let rate = side.mean();
    let spread = side.spread();
    let [lo, hi] = trainings::interval(&side.means, spread.effective_starts);
    // The part of the starts is added on the logit scale, which has no bounds.
    let inside = trainings::inside(rate, scores.starts() as f64);
    let (centre, slope) = (logit(inside), 1.0 / (inside * (1.0 - inside)));
    // The residual is part of both variances and must count once.
    let starts = (scores.start_variance(rate) - spread.rest).max(0.0);
    let half = Z * slope * starts.sqrt();
    let below = libm::hypot(half, (centre - logit(lo)).max(0.0));
    let above = libm::hypot(half, (logit(hi) - centre).max(0.0));
    // Rounding and shrinkage must not put the mean of the measured rates
    // outside.
    [
        rate.min(expit(centre - below)),
        rate.max(expit(centre + above)),
    ]
}

/// 95 % interval of a success rate over starts that were played several times.
///
/// `solved` has the outcomes of one run of the same policy each, all over the
/// same starts. Runs of a start are no new starts. So it is Wilson's interval
/// for the number of coins that gives the measured variance between starts.
/// This number is at least one and at most all runs per start.
pub fn runs_interval(solved: &[&Outcomes]) -> [f64; 2] {
    let Some(scores) = Scores::of_rate(solved) else {
        return [0.0, 1.0];
    };
    let rate: f64 = scores.sides.iter().map(ScoreSide::contribution).sum();
    let starts = scores.starts() as f64;
    let variance = scores.start_variance(rate);
    let coins = if variance > 0.0 {
        rate * (1.0 - rate) / variance
    } else {
        starts
    };
    wilson_of(rate, coins.clamp(starts, starts * solved.len() as f64))
}

/// Mean of `a − b` in success rate, and its 95 % interval, paired on starts.
///
/// Each side has the outcomes of all its trainings, over the same starts. A
/// side with one training is a fixed policy, without other trainings. A start
/// counts if both sides have an outcome that is solved or unsolved. The result
/// is (0, [−1, 1]) if none does.
pub fn paired_difference(a: &[&Outcomes], b: &[&Outcomes]) -> (f64, [f64; 2]) {
    mean_difference(&[(a.to_vec(), b.to_vec())])
}

/// Mean over egos of `a − b` in success rate, with its 95 % interval.
///
/// There is one pair per ego, with sides as in [`paired_difference`], all over
/// the same starts. A start that is easy for every ego counts once. So does a
/// training that is good against all of them, because the same trainings face
/// every ego. Sides with different numbers of trainings count as different
/// trainings. The interval concerns these egos and no others. Egos without a
/// start that counts are left out.
pub fn mean_difference(pairs: &[(Vec<&Outcomes>, Vec<&Outcomes>)]) -> (f64, [f64; 2]) {
    let Some(scores) = Scores::of_difference(pairs) else {
        return (0.0, [-1.0, 1.0]);
    };
    let difference: f64 = scores.sides.iter().map(ScoreSide::contribution).sum();
    // The trainings of both sides and the starts err independently. So squares
    // add up, separately in each direction (Zou and Donner 2008).
    let (mut below, mut above, mut rest) = (0.0, 0.0, 0.0);
    // A side with one training is a fixed policy, so no other trainings widen the
    // interval.
    for side in scores.sides.iter().filter(|side| side.means.len() > 1) {
        let spread = side.spread();
        let [lo, hi] = trainings::interval(&side.means, spread.effective_starts);
        let down = (side.mean() - lo).max(0.0) * side.weight;
        let up = (hi - side.mean()).max(0.0) * side.weight;
        // The negative side errs in the opposite direction.
        let (down, up) = if side.weight > 0.0 {
            (down, up)
        } else {
            (up, down)
        };
        below += down * down;
        above += up * up;
        rest += side.weight * side.weight * spread.rest;
    }
    // Two more starts, one that only a solves and one that only b solves
    // (Bonett and Price 2012). Equal rows are no proof that no start ever
    // differs.
    let n = scores.starts() as f64;
    let more = n + 2.0;
    // These two starts pull the centre towards 0, while the reported difference
    // is the measured difference.
    let towards_0 = difference * 2.0 / more;
    let starts = (scores.start_variance(difference) - rest).max(0.0);
    let half = Z * (starts + 2.0 / (more * more)).sqrt();
    below += (half + towards_0).max(0.0).powi(2);
    above += (half - towards_0).max(0.0).powi(2);
    let interval = [difference - below.sqrt(), difference + above.sqrt()];
    // The normal part knows no bounds, while two rates differ by at most 1.
    (difference, interval.map(|end| end.clamp(-1.0, 1.0)))
}

fn logit(p: f64) -> f64 {
    libm::log(p / (1.0 - p))
}

fn expit(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}
