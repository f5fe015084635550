//! Marks of starts as scores, and where their variance comes from.

use std::collections::BTreeMap;

use crate::stats::outcomes::Outcomes;

/// More effective starts per start than this are not believed.
const MOST_EFFECTIVE: f64 = 100.0;

/// The marks of one side on one ego, with the side's sign.
type Part<'a> = (f64, &'a [&'a Outcomes]);

/// What an estimate is made of: sides, whose weighted means add up to it.
pub(super) struct Scores {
    pub(super) sides: Vec<Side>,
}

/// Trainings that are drawn together, and their scores on every start.
pub(super) struct Side {
    /// Its share in the estimate; negative if it is taken away.
    pub(super) weight: f64,
    /// Score in [0, 1] per training and start.
    scores: Vec<Vec<f64>>,
    /// Mean score per training.
    pub(super) means: Vec<f64>,
}

/// Variance of a side that is neither of trainings nor of starts alone.
pub(super) struct Spread {
    /// Its part in the variance of the side's mean.
    pub(super) rest: f64,
    /// Starts on which a training would have to be tested for its rate to be as
    /// noisy, if every start were a coin of its own.
    pub(super) effective_starts: f64,
}

impl Scores {
    /// One side; `None` if no start counts.
    pub(super) fn of_rate(solved: &[&Outcomes]) -> Option<Scores> {
        Scores::of(&[(1.0, solved)], 1)
    }

    /// Two sides, or more where egos met different numbers of trainings.
    pub(super) fn of_difference(pairs: &[(Vec<&Outcomes>, Vec<&Outcomes>)]) -> Option<Scores> {
        let parts: Vec<Part> = pairs
            .iter()
            .flat_map(|(a, b)| [(1.0, &a[..]), (-1.0, &b[..])])
            .collect();
        Scores::of(&parts, 2)
    }

    /// Parts with their signs; every `together` of them are of one ego.
    fn of(parts: &[Part], together: usize) -> Option<Scores> {
        let lengths = parts.iter().flat_map(|(_, solved)| solved.iter());
        let starts = lengths.map(|marks| marks.len()).min()?;
        let egos: Vec<(&[Part], Vec<bool>)> = parts
            .chunks(together)
            .map(|ego| (ego, counted(ego, starts)))
            .filter(|(_, counts)| counts.contains(&true))
            .collect();
        // A start that no ego counts is no start.
        let kept: Vec<usize> = (0..starts)
            .filter(|&start| egos.iter().any(|(_, counts)| counts[start]))
            .collect();
        let mut sides: BTreeMap<(bool, usize), Side> = BTreeMap::new();
        for (ego, counts) in &egos {
            for &(sign, solved) in *ego {
                let key = (sign < 0.0, solved.len());
                let side = sides.entry(key).or_insert_with(|| Side {
                    weight: 0.0,
                    scores: vec![vec![0.0; kept.len()]; solved.len()],
                    means: Vec::new(),
                });
                side.weight += sign / egos.len() as f64;
                side.add(solved, counts, &kept);
            }
        }
        let mut sides: Vec<Side> = sides.into_values().collect();
        for side in &mut sides {
            side.close((side.weight.abs() * egos.len() as f64).round());
        }
        (!kept.is_empty()).then_some(Scores { sides })
    }

    /// Starts that count.
    pub(super) fn starts(&self) -> usize {
        let first = self.sides.first().and_then(|side| side.scores.first());
        first.map_or(0, Vec::len)
    }

    /// Variance of the estimate if only starts were drawn anew: of the starts
    /// themselves and of what is left, divided by the number of trainings.
    pub(super) fn start_variance(&self, estimate: f64) -> f64 {
        let n = self.starts();
        let of_start = |start: usize| -> f64 {
            let sides = self.sides.iter();
            sides.map(|side| side.weight * side.on(start)).sum()
        };
        let squares = (0..n).map(|start| (of_start(start) - estimate).powi(2));
        squares.sum::<f64>() / (n.max(2) - 1) as f64 / n.max(1) as f64
    }
}

/// On which starts every part of an ego has a mark that counts.
fn counted(ego: &[Part], starts: usize) -> Vec<bool> {
    let counts = |start: usize| {
        ego.iter().all(|(_, solved)| {
            let mut scores = solved.iter().map(|outcomes| outcomes[start].score());
            scores.any(|score| score.is_some())
        })
    };
    (0..starts).map(counts).collect()
}

impl Side {
    /// Adds the marks of one ego.
    ///
    /// A mark that does not count is replaced by the mean of its training
    /// against this ego, so that it neither helps nor harms.
    fn add(&mut self, solved: &[&Outcomes], counts: &[bool], kept: &[usize]) {
        let seen = |outcomes: &Outcomes, start: usize| match counts[start] {
            true => outcomes[start].score(),
            false => None,
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

    /// What it adds to the estimate.
    pub(super) fn contribution(&self) -> f64 {
        self.weight * self.mean()
    }

    /// Mean score of all trainings on a start.
    fn on(&self, start: usize) -> f64 {
        mean(self.scores.iter().map(|scores| scores[start])).unwrap_or(0.0)
    }

    /// The residual of the two-way layout training × start.
    pub(super) fn spread(&self) -> Spread {
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
        // As if one more episode had come out otherwise, so that trainings that
        // agree on every start seen are not taken for noiseless.
        let inside = super::trainings::inside(rate, n as f64);
        let coin = inside * (1.0 - inside);
        let noise = (squares + 1.0) / (freedom + 1.0 / coin);
        Spread {
            rest: squares / freedom / (rows * n).max(1) as f64,
            effective_starts: n as f64 * (coin / noise).clamp(1.0, MOST_EFFECTIVE),
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), value| (sum + value, n + 1));
    (0 < n).then(|| sum / n as f64)
}
