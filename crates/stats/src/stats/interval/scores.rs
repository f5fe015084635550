//! Scores of starts, and the parts of their variance.

use std::collections::BTreeMap;

use crate::stats::outcomes::Outcomes;

/// Greatest credible number of effective starts per start.
const MOST_EFFECTIVE: f64 = 100.0;

/// Outcomes of one side on one ego, with the sign of the side.
type SideOutcomes<'a> = (f64, &'a [&'a Outcomes]);

/// Sides of an estimate, whose weighted means add up to it.
pub(super) struct Scores {
    pub(super) sides: Vec<ScoreSide>,
}

/// Trainings that are drawn together, and their scores on every start.
pub(super) struct ScoreSide {
    /// Share in the estimate, negative if it is subtracted.
    pub(super) weight: f64,
    /// Score in [0, 1], `[training, start]`.
    scores: Vec<Vec<f64>>,
    /// Mean score per training.
    pub(super) means: Vec<f64>,
}

/// Residual variance of a side, which is due to neither trainings nor starts alone.
pub(super) struct ResidualVariance {
    /// Part in the variance of the side's mean.
    pub(super) rest: f64,
    /// Number of independent starts with the same noise in a training's rate.
    pub(super) effective_starts: f64,
}

impl Scores {
    /// Returns a single side. `None` if no start counts.
    pub(super) fn of_rate(solved: &[&Outcomes]) -> Option<Scores> {
        Scores::of(&[(1.0, solved)], 1)
    }

    /// Returns two sides, or more if egos have different numbers of trainings.
    pub(super) fn of_difference(pairs: &[(Vec<&Outcomes>, Vec<&Outcomes>)]) -> Option<Scores> {
        let parts: Vec<SideOutcomes> = pairs
            .iter()
            .flat_map(|(a, b)| [(1.0, &a[..]), (-1.0, &b[..])])
            .collect();
        Scores::of(&parts, 2)
    }

    /// Returns parts with their signs. Every `together` of them belong to one ego.
    fn of(parts: &[SideOutcomes], together: usize) -> Option<Scores> {
        let lengths = parts.iter().flat_map(|(_, solved)| solved.iter());
        // Only starts that all parts have can be paired.
        let starts = lengths.map(|marks| marks.len()).min()?;
        let egos: Vec<(&[SideOutcomes], Vec<bool>)> = parts
            .chunks(together)
            .map(|ego| (ego, counted(ego, starts)))
            .filter(|(_, counts)| counts.contains(&true))
            .collect();
        // A start that counts for no ego is left out.
        let kept: Vec<usize> = (0..starts)
            .filter(|&start| egos.iter().any(|(_, counts)| counts[start]))
            .collect();
        // A sorted map fixes the order of the sums, and with it the last bits.
        let mut sides: BTreeMap<(bool, usize), ScoreSide> = BTreeMap::new();
        for (ego, counts) in &egos {
            for &(sign, solved) in *ego {
                let key = (sign < 0.0, solved.len());
                let side = sides.entry(key).or_insert_with(|| ScoreSide {
                    weight: 0.0,
                    scores: vec![vec![0.0; kept.len()]; solved.len()],
                    means: Vec::new(),
                });
                side.weight += sign / egos.len() as f64;
                side.add(solved, counts, &kept);
            }
        }
        let mut sides: Vec<ScoreSide> = sides.into_values().collect();
        for side in &mut sides {
            // The weight of a side is its number of egos over all egos.
            side.close((side.weight.abs() * egos.len() as f64).round());
        }
        (!kept.is_empty()).then_some(Scores { sides })
    }

    /// Returns the number of starts that count.
    pub(super) fn starts(&self) -> usize {
        let first = self.sides.first().and_then(|side| side.scores.first());
        first.map_or(0, Vec::len)
    }

    /// Variance of the estimate if only starts were drawn again.
    ///
    /// It contains the starts themselves and the residual, divided by the
    /// number of trainings.
    pub(super) fn start_variance(&self, estimate: f64) -> f64 {
        let n = self.starts();
        let of_start = |start: usize| -> f64 {
            let sides = self.sides.iter();
            sides.map(|side| side.weight * side.on(start)).sum()
        };
        let squares = (0..n).map(|start| (of_start(start) - estimate).powi(2));
        // One start has no variance, and its guard avoids a division by 0.
        squares.sum::<f64>() / (n.max(2) - 1) as f64 / n.max(1) as f64
    }
}

/// Starts on which every part of an ego has an outcome that counts.
fn counted(ego: &[SideOutcomes], starts: usize) -> Vec<bool> {
    let counts = |start: usize| {
        ego.iter().all(|(_, solved)| {
            let mut scores = solved.iter().map(|outcomes| outcomes[start].score());
            scores.any(|score| score.is_some())
        })
    };
    (0..starts).map(counts).collect()
}

impl ScoreSide {
    /// Adds the outcomes of one ego.
    ///
    /// An outcome that does not count is replaced by the mean of its training
    /// against this ego, so it has no effect on the rate.
    fn add(&mut self, solved: &[&Outcomes], counts: &[bool], kept: &[usize]) {
        let seen = |outcomes: &Outcomes, start: usize| {
            if counts[start] {
                outcomes[start].score()
            } else {
                None
            }
        };
        let means: Vec<Option<f64>> = solved
            .iter()
            .map(|marks| mean(kept.iter().filter_map(|&start| seen(marks, start))))
            .collect();
        let of_others = mean(means.iter().flatten().copied()).unwrap_or(0.0);
        for ((scores, marks), mean) in self.scores.iter_mut().zip(solved).zip(&means) {
            let otherwise = mean.unwrap_or(of_others);
            for (score, &start) in scores.iter_mut().zip(kept) {
                *score += seen(marks, start).unwrap_or(otherwise);
            }
        }
    }

    /// Turns sums over egos into means.
    fn close(&mut self, egos: f64) {
        for score in self.scores.iter_mut().flatten() {
            *score /= egos;
        }
        let means = self
            .scores
            .iter()
            .map(|scores| mean(scores.iter().copied()));
        self.means = means.map(|mean| mean.unwrap_or(0.0)).collect();
    }

    /// Mean score over trainings and starts.
    pub(super) fn mean(&self) -> f64 {
        mean(self.means.iter().copied()).unwrap_or(0.0)
    }

    /// Contribution to the estimate.
    pub(super) fn contribution(&self) -> f64 {
        self.weight * self.mean()
    }

    /// Mean score of all trainings on a start.
    fn on(&self, start: usize) -> f64 {
        mean(self.scores.iter().map(|scores| scores[start])).unwrap_or(0.0)
    }

    /// Residual of the two-way layout training × start.
    pub(super) fn spread(&self) -> ResidualVariance {
        let (rows, rate) = (self.scores.len(), self.mean());
        let n = self.scores.first().map_or(0, Vec::len);
        let mut squares = 0.0;
        for start in 0..n {
            let on = self.on(start);
            for (scores, mean) in self.scores.iter().zip(&self.means) {
                squares += (scores[start] - mean - on + rate).powi(2);
            }
        }
        let freedom = ((rows.max(2) - 1) * (n.max(2) - 1)) as f64;
        // One more episode counts as deviating. Trainings that agree on every
        // start are then not taken for noiseless.
        let inside = super::trainings::inside(rate, n as f64);
        let coin = inside * (1.0 - inside);
        let noise = (squares + 1.0) / (freedom + 1.0 / coin);
        ResidualVariance {
            rest: squares / freedom / (rows * n).max(1) as f64,
            effective_starts: n as f64 * (coin / noise).clamp(1.0, MOST_EFFECTIVE),
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), value| (sum + value, n + 1));
    (n > 0).then(|| sum / n as f64)
}
