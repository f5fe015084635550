//! Calibration: successes of an ado beside those of a cheap search, on starts of no
//! report.

use super::demonstrations::{Budget, Seeded};
use super::rollout::TrainingStarts;
use super::search_worker::SearchEffort;
use super::training_search::{SearchProgress, TrainingSearch};
use crate::experiment::Watch;
use crate::rl::Policy;
use crate::run_dir::Calibration;
use crate::seed::Purpose;
use crate::testbench::Sampling;
use crate::world::Scenario;

/// Bounds on the number of calibration starts, one per thousand decisions of the
/// training.
const STARTS: (u64, u64) = (10, 100);
/// Largest number of simulations of the search per decision of the training.
const SHARE: u64 = 4;
/// Largest number of simulations per start if the ego cannot be copied.
const WITHOUT_COPIES: u64 = 50;
/// Largest number of simulations per decision of the training for a second search.
///
/// It uses two switches on the starts that one switch does not solve.
const TWICE: u64 = 1;

/// Calibration starts of a training, with those that a search solves.
pub(super) struct Calibrator<'a> {
    scenario: &'a Scenario,
    seed: u64,
    solved: Vec<bool>,
    /// Unsolved starts on which the search did not try all sequences.
    cut: Vec<bool>,
    /// Result of the search alone.
    search: Calibration,
    searched_steps: u64,
    /// Cost of the search and the last evaluation of the ado.
    pub physics_steps: u64,
    /// Cost of the search and all evaluations.
    pub cpu_s: f64,
    /// Cost of the search alone.
    search_cpu_s: f64,
}

impl<'a> Calibrator<'a> {
    /// Searches the calibration starts of a training. `None`: stopped.
    ///
    /// The search uses at most one switch of action, then two switches on unsolved
    /// starts, within the budget.
    pub(super) fn new(
        scenario: &'a Scenario,
        seed: u64,
        watch: &Watch<'_>,
    ) -> Option<Calibrator<'a>> {
        let training_search = TrainingSearch::new(scenario, Purpose::Calibration, seed);
        let decisions = scenario.learner.decisions();
        // In proportion, so that judging a short training costs little of it.
        let starts = (decisions / 1000).clamp(STARTS.0, STARTS.1);
        let forks = training_search.forks();
        let each = if forks {
            SHARE.saturating_mul(decisions) / starts
        } else {
            WITHOUT_COPIES
        };
        let indices: Vec<u64> = (0..starts).collect();
        let progress = SearchProgress {
            done: 0,
            total: indices.len(),
        };
        let effort = SearchEffort::Walk { switches: 1 };
        // The share of a very short training would not even pay for the constant actions.
        let found = training_search.search(&indices, effort, each.max(20), progress, watch);
        if watch.stopped() {
            return None;
        }
        // Counted as demonstrations are, although no learner sees these.
        let mut searched = Seeded::default();
        let unsolved = searched.note(&indices, found);
        let one_switch = searched.sought.solved;
        let budget = Budget {
            simulations: if forks {
                TWICE.saturating_mul(decisions)
            } else {
                WITHOUT_COPIES * unsolved.len() as u64
            },
            switches: 2,
        };
        searched.search_harder(&training_search, &unsolved, budget, watch)?;
        let mut solved = vec![false; indices.len()];
        for shown in &searched.demonstrations {
            solved[shown.index as usize] = true;
        }
        // Without an unsolved start, the second search did not run.
        let switches = if unsolved.is_empty() { 1 } else { 2 };
        let is_cut = |index: &u64| {
            let walked = searched.walked.get(index).copied().unwrap_or(0);
            !solved[*index as usize] && walked < switches
        };
        let sequences = training_search.sequences();
        Some(Calibrator {
            scenario,
            seed,
            cut: indices.iter().map(is_cut).collect(),
            solved,
            search: Calibration {
                starts,
                switches: switches as u64,
                one_switch,
                search_simulations: searched.sought.simulations,
                sequences,
                ..Calibration::default()
            },
            searched_steps: searched.sought.physics_steps,
            physics_steps: 0,
            cpu_s: searched.cpu_s,
            search_cpu_s: searched.cpu_s,
        })
    }

    /// Returns the processor time of a simulation of the search. `None`: there was none.
    pub(super) fn seconds_per_simulation(&self) -> Option<f64> {
        let simulations = self.search.search_simulations;
        (simulations > 0).then(|| self.search_cpu_s / simulations as f64)
    }

    /// Plays an ado on the calibration starts. `None`: stopped.
    pub(super) fn of(&mut self, policy: &dyn Policy, watch: &Watch<'_>) -> Option<Calibration> {
        let indices: Vec<u64> = (0..self.solved.len() as u64).collect();
        let starts = TrainingStarts {
            scenario: self.scenario,
            purpose: Purpose::Calibration,
            seed: self.seed,
        };
        let played = starts.successes(&indices, policy, watch)?;
        let mut calibration = self.search;
        let mut missed = Vec::new();
        // Of the last evaluation only, so that interruptions do not change the cost.
        self.physics_steps = self.searched_steps;
        for (index, played) in played.into_iter().enumerate() {
            let searched = self.solved[index];
            let success = played.success.is_some();
            self.physics_steps += played.physics_steps;
            self.cpu_s += played.cpu_s;
            calibration.searched += u64::from(searched);
            calibration.both += u64::from(searched && success);
            calibration.ado_only += u64::from(success && !searched);
            calibration.undecided += u64::from(self.cut[index] && !success);
            if searched && !success {
                missed.push(index as u64);
            }
        }
        let drawn = starts.drawn_successes(&missed, policy, Sampling::SECOND_LOOK, watch)?;
        let mut draws = 0;
        for (success, episodes, cost) in drawn {
            draws += episodes;
            self.physics_steps += cost.physics_steps;
            self.cpu_s += cost.cpu_s;
            calibration.drawn += u64::from(success);
        }
        let search = calibration.search_simulations;
        calibration.simulations = search + calibration.starts + draws;
        Some(calibration)
    }
}
