//! Best response of the ego: the member of the family that a mixture of ados solves least.
//!
//! A cross-entropy search over the ranges of the world's own structure, and of every
//! other structure, minimizes the recall of the mixture. Three constraints keep the ego
//! useful:
//!
//! - It fails by itself on no start on which the nominal ego does not.
//! - Its mean speed without an adversary is at least 90 % of the nominal ego's.
//! - Search solves at least 10 % of the starts. An ego that nothing can fail would
//!   minimize every payoff and teach the ados nothing.

use super::payoff::{FreeDrive, PayoffStarts};
use crate::experiment::Watch;
use crate::rl::Policy;
use crate::seed;
use crate::stats::CrossEntropySearch;
use crate::world::family::EgoSample;

/// Least mean speed without an adversary, as a share of the nominal ego's.
const PROGRESS: f64 = 0.9;
/// Least share of the starts that search solves.
const REACHABLE: f64 = 0.1;
/// Least cost of a member that violates a constraint. A recall is at most 1.
const REFUSED: f64 = 2.0;

/// Search for a response of the ego, on starts that no payoff uses.
pub(super) struct EgoResponse<'a> {
    pub(super) starts: &'a PayoffStarts<'a>,
    /// Policies with their probabilities.
    pub(super) ados: Vec<(f64, &'a dyn Policy)>,
    /// Motion of the nominal ego on the starts.
    pub(super) nominal: FreeDrive,
}

impl EgoResponse<'_> {
    /// Returns the best member found. `None`: stopped, or no member keeps the constraints.
    pub(super) fn search(&self, key: [u64; 2], watch: &Watch<'_>) -> Option<EgoSample> {
        let structures = (0..self.starts.family.structures.len()).map(Some);
        let all = [None].into_iter().chain(structures).enumerate();
        let found = all.map(|(number, structure)| {
            let key = [key[0], key[1], number as u64];
            self.best_of(structure, &key, watch)
        });
        // Ties go to the first structure, which is the world's own.
        let best = found.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        (!watch.stopped() && best.0 < REFUSED).then_some(best.1)
    }

    /// Searches the members of a structure, `None` for the world's own.
    fn best_of(
        &self,
        structure: Option<usize>,
        key: &[u64],
        watch: &Watch<'_>,
    ) -> (f64, EgoSample) {
        let family = self.starts.family;
        let plant = self.starts.plant();
        let costs = |points: &[Vec<f64>]| -> Vec<f64> {
            let members = points
                .iter()
                .map(|point| family.at(structure, point, plant));
            members.map(|member| self.cost(&member, watch)).collect()
        };
        let middle = vec![0.0; family.dimensions(structure)];
        // A program has no parameters.
        if middle.is_empty() {
            let cost = costs(std::slice::from_ref(&middle))[0];
            return (cost, family.at(structure, &middle, plant));
        }
        let mut dice = seed::generator("league, response of the ego", key);
        let fit = CrossEntropySearch::COARSE.run(middle, &mut dice, &costs);
        (fit.cost, family.at(structure, &fit.point, plant))
    }

    /// Returns the recall of the mixture against a member, or at least [`REFUSED`].
    fn cost(&self, member: &EgoSample, watch: &Watch<'_>) -> f64 {
        self.recall(member, watch)
            .unwrap_or_else(|refused| REFUSED + refused)
    }

    /// Returns the recall, or the amount by which a member violates a constraint.
    pub(super) fn recall(&self, member: &EgoSample, watch: &Watch<'_>) -> Result<f64, f64> {
        // A member that does not fit or a stop is worse than every other violation.
        const NO_RESULT: f64 = 10.0;
        let ego = self.starts.ego(member).map_err(|_| NO_RESULT)?;
        let alone = self.starts.drive_alone(&ego, watch).ok_or(NO_RESULT)?;
        // The worse a violation, the larger, which leads the search back to sound egos.
        if alone.failures > self.nominal.failures {
            return Err(2.0 + alone.failures);
        }
        let shortfall = PROGRESS * self.nominal.speed_mps - alone.speed_mps;
        if shortfall > 0.0 {
            return Err(1.0 + shortfall / self.nominal.speed_mps);
        }
        let opponent = self
            .starts
            .searched(member.clone(), ego, watch)
            .ok_or(NO_RESULT)?;
        if opponent.searched_share() < REACHABLE {
            return Err(REACHABLE - opponent.searched_share());
        }
        let mut recall = 0.0;
        for (share, policy) in &self.ados {
            recall += share
                * self
                    .starts
                    .recall(*policy, &opponent, watch)
                    .ok_or(NO_RESULT)?;
        }
        Ok(recall)
    }
}
