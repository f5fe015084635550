//! Starts near others, by the distance of their values.

use crate::scene::Start;

/// Widths of the ranges that some starts fill, axis by axis.
pub(super) struct Spreads(Vec<f64>);

impl Spreads {
    /// Returns the widths of some starts.
    pub(super) fn of(starts: &[Start]) -> Spreads {
        let axes = starts.first().map_or(0, |start| start.0.len());
        let spread = |axis: usize| {
            let values = starts.iter().filter_map(|start| start.0.get(axis));
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
                (low.min(x), high.max(x))
            });
            // Starts may all agree on an axis, which would divide by 0.
            (high - low).max(1e-9)
        };
        Spreads((0..axes).map(spread).collect())
    }

    /// Returns the squared distance of two starts, with each axis scaled by its width.
    pub(super) fn distance(&self, a: &Start, b: &Start) -> f64 {
        let pairs = a.0.iter().zip(&b.0).zip(&self.0);
        pairs
            .map(|((a, b), spread)| ((a - b) / spread).powi(2))
            .sum()
    }
}

/// Candidates for a search, nearest to the solved starts first.
pub(super) struct StartCandidates {
    spreads: Spreads,
    /// Index, start and distance to the nearest solved start.
    candidates: Vec<(u64, Start, f64)>,
}

impl StartCandidates {
    /// Creates the candidates, before any start is solved.
    pub(super) fn new(indices: impl Iterator<Item = u64>, starts: Vec<Start>) -> StartCandidates {
        StartCandidates {
            spreads: Spreads::of(&starts),
            candidates: indices
                .zip(starts)
                // Infinite distances let the first solved start count, however far it is.
                .map(|(index, start)| (index, start, f64::INFINITY))
                .collect(),
        }
    }

    /// Returns the number of candidates left.
    pub(super) fn len(&self) -> usize {
        self.candidates.len()
    }

    /// Notes a solved start.
    pub(super) fn note_solved(&mut self, solved: &Start) {
        for (_, start, nearest) in &mut self.candidates {
            *nearest = nearest.min(self.spreads.distance(start, solved));
        }
    }

    /// Takes the nearest candidates out.
    pub(super) fn take(&mut self, count: usize) -> Vec<u64> {
        // Farthest first, so that the nearest are at the end. The sort is stable.
        self.candidates.sort_by(|a, b| b.2.total_cmp(&a.2));
        let rest = self.candidates.len().saturating_sub(count);
        let taken = self.candidates.split_off(rest);
        taken.into_iter().map(|(index, ..)| index).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_candidates_are_taken_first_with_scaled_axes() {
        let start = |x: f64, v: f64| Start(vec![x, v]);
        // The first axis is a hundred times as wide as the second.
        let starts = vec![
            start(0.0, 0.0),
            start(100.0, 0.0),
            start(0.0, 1.0),
            start(60.0, 0.1),
        ];
        let mut near = StartCandidates::new(10..14, starts);
        near.note_solved(&start(50.0, 0.0));
        assert_eq!(near.take(1), [13]);
        near.note_solved(&start(0.0, 0.9));
        assert_eq!(near.take(1), [12]);
        assert_eq!(near.len(), 2);
        assert_eq!(near.take(9).len(), 2);
        assert!(near.take(1).is_empty());
    }
}
