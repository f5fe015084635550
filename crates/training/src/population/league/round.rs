//! Record of a round of a league, a line of `league.jsonl`.

use serde::{Deserialize, Serialize};

use crate::population::PopulationDir;
use crate::run_dir::RunError;
use crate::stats::Equilibrium;
use crate::world::family::EgoSample;

/// Payoff of a best response and of the mixtures before it, on the common starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeagueResponse {
    /// Recall of the ado mixture against the ego mixture.
    pub mixture: f64,
    /// Recall with the response in place of its own side's mixture.
    pub response: f64,
    /// Gain of the responding side.
    ///
    /// It is below 0 if the response found is worse than the mixture.
    pub gain: f64,
}

/// Round of a league: both populations after it, and the best responses in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeagueRound {
    /// Number of the round. Round 0 has the nominal ego and an ado trained against it.
    pub round: u64,
    /// Number of common starts.
    pub starts: usize,
    /// Egos in the order of the columns of `payoffs`.
    pub egos: Vec<EgoSample>,
    /// Recall of each ado, by row, against each ego, by column.
    pub payoffs: Vec<Vec<f64>>,
    /// Probability of each ado in the equilibrium of `payoffs`.
    pub ado_mixture: Vec<f64>,
    /// Probability of each ego in the equilibrium.
    pub ego_mixture: Vec<f64>,
    /// Recall of the ado mixture against the ego mixture.
    pub value: f64,
    /// Response of the ego to the ado mixture of the round before.
    ///
    /// `None` in round 0, and if no member of the family keeps the constraints.
    pub ego_response: Option<LeagueResponse>,
    /// Response of the ado to the ego mixture that includes the ego's response.
    pub ado_response: Option<LeagueResponse>,
    /// Sum of the gains of both responses, each at least 0. `None` in round 0.
    ///
    /// A lower bound of the exploitability, because a better response may exist.
    pub exploitability: Option<f64>,
}

impl LeagueRound {
    /// Returns the recorded rounds of a league.
    ///
    /// # Errors
    /// Their file is missing or damaged.
    pub fn all(dir: &PopulationDir) -> Result<Vec<LeagueRound>, RunError> {
        // Only lines that the manifest counts, because a killed process may leave more.
        let bytes = dir.curve_bytes()?;
        let lines = String::from_utf8_lossy(&bytes);
        let rounds = lines.lines().map(|line| {
            serde_json::from_str(line).map_err(|error| RunError::Damaged {
                path: dir.path().join(dir.manifest().origin.curve_file()),
                why: error.to_string(),
            })
        });
        rounds.collect()
    }

    /// Records the round in the directory of its league.
    ///
    /// # Errors
    /// The disk refuses.
    pub(super) fn record(&self, dir: &mut PopulationDir) -> Result<(), RunError> {
        // Invariant: a round is words and finite numbers.
        let line = serde_json::to_string(self).unwrap_or_default();
        dir.record(&format!("{line}\n"))
    }

    /// Returns the round of two populations without responses.
    pub(super) fn of(
        round: u64,
        starts: usize,
        egos: Vec<EgoSample>,
        payoffs: Vec<Vec<f64>>,
    ) -> LeagueRound {
        // A new row or column may change the share of every member.
        let equilibrium = Equilibrium::of(&payoffs);
        LeagueRound {
            round,
            starts,
            egos,
            payoffs,
            ado_mixture: equilibrium.rows,
            ego_mixture: equilibrium.columns,
            value: equilibrium.value,
            ego_response: None,
            ado_response: None,
            exploitability: None,
        }
    }

    /// Returns the mixture of egos to train against.
    pub(super) fn opponents(&self) -> Vec<(f64, EgoSample)> {
        let shares = self.ego_mixture.iter().copied();
        shares.zip(self.egos.iter().cloned()).collect()
    }
}
