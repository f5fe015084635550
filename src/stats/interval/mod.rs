//! Intervals of success rates over starts and trainings.
//!
//! A rate is measured on some starts with some trainings, and speaks of other
//! starts and other trainings. Both vary: starts are easy or hard, and easy ones
//! are so for most trainings; trainings differ, and there are few of them. So
//! the variance of a mean rate has three parts, which a two-way layout of the
//! marks tells apart (`scores`): trainings, starts, and what is left in single
//! episodes. The part of the starts is near normal, since there are hundreds;
//! that of three or five trainings is not, and a bootstrap of so few is far too
//! narrow. It comes from a beta-binomial model instead (`trainings`), which in
//! the middle is about as wide as Student's t with one degree of freedom less
//! than there are trainings, and knows at the edges that rates end at 0 and 1.
//!
//! docs/intervals.md has the method in formulas, docs/lab/coverage.md its coverage.

mod mcnemar;
mod predicted;
mod scores;
#[cfg(test)]
mod tests;
mod trainings;

pub use mcnemar::mcnemar;
pub use predicted::predicted;

use super::outcomes::{Outcomes, StartOutcome};
use scores::{Scores, Side};

/// The 97.5th percentile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// Wilson's 95 % score interval of `successes` out of `n`; [0, 1] for n = 0.
pub fn wilson(successes: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    wilson_of(successes as f64 / n as f64, n as f64)
}

/// The same for a rate that was measured on as many coins.
fn wilson_of(p: f64, n: f64) -> [f64; 2] {
    let z2 = Z * Z;
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    // Exact at the edges, where rounding would leave dust.
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

/// The 95 % upper bound of a rate of which `n` trials have shown nothing.
///
/// Clopper and Pearson's one-sided bound, exact: with this rate, n trials show
/// nothing with probability 0.05. About 3 / n; 1 for n = 0.
pub fn at_most(n: usize) -> f64 {
    match n {
        0 => 1.0,
        n => 1.0 - libm::pow(0.05, 1.0 / n as f64),
    }
}

/// 95 % interval of the mean success rate over trainings and starts.
///
/// `solved` holds the outcomes of one training each, all over the same starts;
/// only solved and unsolved ones count. The interval is of what other trainings reach on other
/// starts in the mean, and contains the mean of the rates seen. With one training
/// it is Wilson's and speaks of that policy only. [0, 1] if nothing counts.
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
    // The starts' part goes into the same scale, on which no bound is near.
    let inside = trainings::inside(rate, scores.starts() as f64);
    let (centre, slope) = (logit(inside), 1.0 / (inside * (1.0 - inside)));
    let starts = (scores.start_variance(rate) - spread.rest).max(0.0);
    let half = Z * slope * starts.sqrt();
    let below = libm::hypot(half, (centre - logit(lo)).max(0.0));
    let above = libm::hypot(half, (logit(hi) - centre).max(0.0));
    [
        rate.min(expit(centre - below)),
        rate.max(expit(centre + above)),
    ]
}

/// 95 % interval of a success rate over starts that were played several times.
///
/// The outcomes of one run of the same policy each, all over the same starts.
/// Runs of a start are no new start: Wilson's interval for as many coins as have
/// the variance seen between starts, at least one and at most all runs of each.
pub fn runs_interval(solved: &[&Outcomes]) -> [f64; 2] {
    let Some(scores) = Scores::of_rate(solved) else {
        return [0.0, 1.0];
    };
    let rate: f64 = scores.sides.iter().map(Side::contribution).sum();
    let starts = scores.starts() as f64;
    let variance = scores.start_variance(rate);
    let coins = match 0.0 < variance {
        true => rate * (1.0 - rate) / variance,
        false => starts,
    };
    wilson_of(rate, coins.clamp(starts, starts * solved.len() as f64))
}

/// Mean of `a − b` in success rate, and its 95 % interval, paired on starts.
///
/// Each side has the outcomes of every training, all over the same starts; a side
/// with one training is a fixed policy, of which no other training is meant.
/// A start counts where both sides have one that is solved or not. (0, [−1, 1]) if none does.
pub fn paired_difference(a: &[&Outcomes], b: &[&Outcomes]) -> (f64, [f64; 2]) {
    mean_difference(&[(a.to_vec(), b.to_vec())])
}

/// Mean over egos of `a − b` in success rate, with its 95 % interval.
///
/// One pair per ego, each side as in [`paired_difference`], all over the same
/// starts. A start that is easy for every ego counts once, and so does a training
/// that is good against all of them: the same trainings meet every ego. (Sides
/// with different numbers of them are taken for different trainings.) The
/// interval speaks of these egos, not of others; egos without a start that counts
/// are left out.
pub fn mean_difference(pairs: &[(Vec<&Outcomes>, Vec<&Outcomes>)]) -> (f64, [f64; 2]) {
    let Some(scores) = Scores::of_difference(pairs) else {
        return (0.0, [-1.0, 1.0]);
    };
    let difference: f64 = scores.sides.iter().map(Side::contribution).sum();
    // Trainings of both sides and the starts err independently, so squares add
    // up, each in its own direction (Zou and Donner 2008).
    let (mut below, mut above, mut rest) = (0.0, 0.0, 0.0);
    for side in scores.sides.iter().filter(|side| 1 < side.means.len()) {
        let spread = side.spread();
        let [lo, hi] = trainings::interval(&side.means, spread.effective_starts);
        let down = (side.mean() - lo).max(0.0) * side.weight;
        let up = (hi - side.mean()).max(0.0) * side.weight;
        let (down, up) = if 0.0 < side.weight {
            (down, up)
        } else {
            (up, down)
        };
        below += down * down;
        above += up * up;
        rest += side.weight * side.weight * spread.rest;
    }
    // Two more starts, one that only a solves and one that only b does (Bonett
    // and Price 2012): equal rows are no proof that nothing ever differs.
    let n = scores.starts() as f64;
    let more = n + 2.0;
    let towards_0 = difference * 2.0 / more;
    let starts = (scores.start_variance(difference) - rest).max(0.0);
    let half = Z * (starts + 2.0 / (more * more)).sqrt();
    below += (half + towards_0).max(0.0).powi(2);
    above += (half - towards_0).max(0.0).powi(2);
    let interval = [difference - below.sqrt(), difference + above.sqrt()];
    (difference, interval.map(|end| end.clamp(-1.0, 1.0)))
}

fn logit(p: f64) -> f64 {
    libm::log(p / (1.0 - p))
}

fn expit(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}
