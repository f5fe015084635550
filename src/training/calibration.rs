//! Whether an ado has learned its world: its successes on calibration starts
//! beside those of a cheap search, on starts that nothing is reported on.

use super::demonstrations::{Budget, Seeded};
use super::rollout::successes;
use super::training_search::{SearchEffort, TrainingSearch};
use crate::experiment::Watch;
use crate::rl::Policy;
use crate::run_dir::Calibration;
use crate::seed::Purpose;
use crate::world::Scenario;

/// Starts that are searched, once, and played after it: one per thousand
/// decisions of the training, within these bounds.
const STARTS: (u64, u64) = (10, 100);
/// Simulations per decision of the training that the search may spend at most.
const SHARE: u64 = 4;
/// The same per start where the ego cannot be copied.
const WITHOUT_COPIES: u64 = 50;
/// Simulations per decision of the training that a search with two switches of
/// the starts that one does not solve may spend at most.
const TWICE: u64 = 1;

/// Calibration starts of a training, and which of them a search solves.
pub(super) struct Calibrator<'a> {
    scenario: &'a Scenario,
    seed: u64,
    solved: Vec<bool>,
    switches: usize,
    /// What the search took.
    simulations: u64,
    searched_steps: u64,
    /// What the search and the last playing took.
    pub physics_steps: u64,
    /// All of it, and all playings.
    pub cpu_s: f64,
}

impl<'a> Calibrator<'a> {
    /// Searches the calibration starts of a training; `None`: stopped.
    ///
    /// With at most one switch of action, then with two where one solves nothing,
    /// as far as the budget goes.
    pub fn new(scenario: &'a Scenario, seed: u64, watch: &Watch<'_>) -> Option<Calibrator<'a>> {
        let scout = TrainingSearch::new(scenario, Purpose::Calibration, seed);
        let decisions = scenario.learner.decisions();
        let starts = (decisions / 1000).clamp(STARTS.0, STARTS.1);
        let forks = scout.forks();
        let each = if forks {
            SHARE.saturating_mul(decisions) / starts
        } else {
            WITHOUT_COPIES
        };
        let indices: Vec<u64> = (0..starts).collect();
        let progress = (0, indices.len());
        let effort = SearchEffort::Walk { switches: 1 };
        let found = scout.search(&indices, (effort, each.max(20)), progress, watch);
        if watch.stopped() {
            return None;
        }
        let mut searched = Seeded::default();
        let unsolved = searched.note(&indices, found);
        let budget = Budget {
            simulations: if forks {
                TWICE.saturating_mul(decisions)
            } else {
                WITHOUT_COPIES * unsolved.len() as u64
            },
            switches: 2,
        };
        searched.search_harder(&scout, &unsolved, budget, watch)?;
        let mut solved = vec![false; indices.len()];
        for shown in &searched.demonstrations {
            solved[shown.index as usize] = true;
        }
        Some(Calibrator {
            scenario,
            seed,
            solved,
            switches: if unsolved.is_empty() { 1 } else { 2 },
            simulations: searched.sought.simulations,
            searched_steps: searched.sought.physics_steps,
            physics_steps: 0,
            cpu_s: searched.cpu_s,
        })
    }

    /// What an ado does on them; `None`: stopped.
    pub fn of(&mut self, policy: &dyn Policy, watch: &Watch<'_>) -> Option<Calibration> {
        let indices: Vec<u64> = (0..self.solved.len() as u64).collect();
        let of = (self.scenario, Purpose::Calibration, self.seed);
        let played = successes(of, &indices, policy, watch)?;
        let mut calibration = Calibration {
            starts: indices.len() as u64,
            switches: self.switches as u64,
            ..Calibration::default()
        };
        self.physics_steps = self.searched_steps;
        for (played, &searched) in played.into_iter().zip(&self.solved) {
            let success = played.success.is_some();
            self.physics_steps += played.physics_steps;
            self.cpu_s += played.cpu_s;
            calibration.searched += u64::from(searched);
            calibration.both += u64::from(searched && success);
            calibration.ado_only += u64::from(success && !searched);
        }
        calibration.simulations = self.simulations + calibration.starts;
        Some(calibration)
    }
}
