//! Successes of a search on training starts, as demonstrations for a learner.
//!
//! They are searched before a training, and later where the ado fails.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::near_starts::StartCandidates;
use super::rollout::TrainingStarts;
use super::search_worker::{Scouted, SearchEffort};
use super::training_search::{SearchProgress, TrainingSearch};
use crate::experiment::Watch;
use crate::rl::{Demonstration, Learner, Seeding};
use crate::run_dir::Sought;
use crate::seed::Purpose;
use crate::testbench::{FIRST_KNOWN, KnownEpisode};
use crate::world::Scenario;

/// First start that is searched, which no learner reaches by itself.
const FIRST_START: u64 = 1 << 40;
/// First start that an ado plays before the search.
const FIRST_PLAYED: u64 = 1 << 41;
/// First start near a success that is searched.
const FIRST_NEAR: u64 = 3 << 40;
/// Starts that an ado plays at a time.
const PLAYED: u64 = 300;
/// Starts that are searched between two checks of the budget.
const CHUNK: usize = 10;
/// Starts after which the share solved with one switch is checked.
const TRIED: usize = 50;
/// Least share of these starts that one switch must solve.
const ENOUGH: f64 = 0.05;
/// Largest multiple of its equal share of the budget that a start may spend.
const UNEVEN: u64 = 3;
/// Number of successes from which successes of near starts are changed.
const FEW: usize = 10;
/// Number of successes from which only such changes are tried.
const MANY: usize = 50;
/// Simulations per start for such changes.
const MUTATIONS: u64 = 200;

/// Demonstrations, with the cost of their search.
#[derive(Default)]
pub(super) struct Seeded {
    pub demonstrations: Vec<Demonstration>,
    pub sought: Sought,
    pub cpu_s: f64,
    /// Starts of which every sequence with at most this many switches was played.
    pub walked: BTreeMap<u64, usize>,
}

/// Searches training starts of `seed` for demonstrations. `None`: stopped.
///
/// Episodes of a bank are played first. If some succeed again, they are changed on the
/// training starts, instead of a search from nothing.
///
/// The search uses one switch of action first, then a harder search on unsolved starts. A
/// training that may continue keeps half of the remaining budget for the starts on which
/// its ado fails ([`seed_failures`]).
pub(super) fn seed_training(
    scenario: &Scenario,
    seed: u64,
    seeding: &Seeding,
    bank: &Arc<[KnownEpisode]>,
    watch: &Watch<'_>,
) -> Option<Seeded> {
    let training_search = TrainingSearch::new(scenario, Purpose::Train, seed).knowing(bank);
    let most = most_simulations(scenario, &training_search, seeding);
    let indices: Vec<u64> = (0..seeding.starts as u64)
        .map(|i| FIRST_START + i)
        .collect();
    let mut seeded = Seeded::default();
    let known: Vec<u64> = (0..bank.len() as u64).map(|i| FIRST_KNOWN + i).collect();
    // Against this ego first: what made another one fail may not work here.
    let played = training_search.play_known(&known, watch);
    if watch.stopped() {
        return None;
    }
    seeded.note(&known, played);
    let mut unsolved =
        seeded.search_one_switch(&training_search, &indices, most, bank.is_empty(), watch)?;
    // Starts that were not reached have no success with one switch either.
    let reached = seeded.sought.starts as usize;
    let again = unsolved.len();
    unsolved.extend(&indices[reached..]);
    if seeded.demonstrations.len() >= FEW && bank.is_empty() {
        // Half, because the starts without a success are still to be searched.
        let left = most.saturating_sub(seeded.sought.simulations);
        seeded.search_near(&training_search, left / 2, watch)?;
    }
    let left = most.saturating_sub(seeded.sought.simulations);
    // An extended training looks for failures again, and needs its share then.
    let keeps = scenario.learner.decisions() < scenario.learner.longest();
    let budget = Budget {
        simulations: if keeps { left / 2 } else { left },
        switches: usize::MAX,
    };
    let searched = seeded.search_harder(&training_search, &unsolved, budget, watch)?;
    // A start counts once, however often it was searched.
    seeded.sought.starts += searched.saturating_sub(again) as u64;
    Some(seeded)
}

/// Plays an ado on more training starts and searches those on which it fails.
///
/// The search stays within the budget of the training, of which `spent` simulations are
/// gone. `None`: stopped.
pub(super) fn seed_failures(
    scenario: &Scenario,
    seed: u64,
    learner: &dyn Learner,
    seeding: &Seeding,
    spent: u64,
    watch: &Watch<'_>,
) -> Option<Seeded> {
    let training_search = TrainingSearch::new(scenario, Purpose::Train, seed);
    let left = most_simulations(scenario, &training_search, seeding).saturating_sub(spent);
    let mut seeded = Seeded::default();
    // Too little is left for both, the runs of the ado and a search.
    if left <= PLAYED || seeding.starts == 0 {
        return Some(seeded);
    }
    // Other starts at every look, the same whenever it is repeated.
    let first = FIRST_PLAYED + learner.decisions() * PLAYED;
    let indices: Vec<u64> = (first..first + PLAYED).collect();
    let starts = TrainingStarts {
        scenario,
        purpose: Purpose::Train,
        seed,
    };
    let played = starts.successes(&indices, &*learner.policy(), watch)?;
    let mut failed = Vec::new();
    for (&index, played) in indices.iter().zip(played) {
        seeded.sought.simulations += 1;
        seeded.sought.physics_steps += played.physics_steps;
        seeded.cpu_s += played.cpu_s;
        match played.success {
            Some(actions) => seeded.demonstrations.push(Demonstration { index, actions }),
            None => failed.push(index),
        }
    }
    let own = seeded.demonstrations.len();
    // Half, because an extended training looks for failures again.
    let budget = Budget {
        simulations: (left - PLAYED) / 2,
        switches: usize::MAX,
    };
    let searched = seeded.search_harder(&training_search, &failed, budget, watch)?;
    seeded.sought.starts = searched as u64;
    // The ado's own successes are left out, because the learner has enough of them.
    seeded.demonstrations.drain(..own);
    Some(seeded)
}

/// Budget of all searches of a training.
fn most_simulations(
    scenario: &Scenario,
    training_search: &TrainingSearch<'_>,
    seeding: &Seeding,
) -> u64 {
    let decisions = scenario.learner.decisions();
    let most = seeding.simulations.min(decisions.saturating_mul(2));
    if training_search.forks() {
        most
    } else {
        // Without copies, every sequence is played from its start.
        most / 100
    }
}

/// Budget of a harder search, and its largest number of switches.
#[derive(Clone, Copy)]
pub(super) struct Budget {
    pub simulations: u64,
    pub switches: usize,
}

impl Seeded {
    /// Returns demonstrations that cost no search.
    pub(super) fn known(demonstrations: Vec<Demonstration>) -> Seeded {
        Seeded {
            demonstrations,
            ..Seeded::default()
        }
    }

    /// Searches starts in order with one switch of action, and returns those unsolved.
    ///
    /// It ends early if changes of known successes need fewer simulations, or if one switch
    /// solves too few starts. `None`: stopped. `most` simulations are those of all searches.
    fn search_one_switch(
        &mut self,
        training_search: &TrainingSearch<'_>,
        indices: &[u64],
        most: u64,
        is_bank_empty: bool,
        watch: &Watch<'_>,
    ) -> Option<Vec<u64>> {
        let mut unsolved = Vec::new();
        for chunk in indices.chunks(CHUNK) {
            let spent = self.sought.simulations;
            let tried = self.sought.starts as usize;
            // All starts at this price would take more than half of the budget.
            let dear = most < 2 * spent / (tried as u64).max(1) * indices.len() as u64;
            if self.demonstrations.len() >= FEW && (dear || !is_bank_empty) {
                break;
            }
            // Where one switch hardly ever suffices, the budget is for sequences with
            // more.
            let few = (self.demonstrations.len() as f64) < ENOUGH * tried as f64;
            if most <= spent || (tried >= TRIED && few) {
                break;
            }
            // At least 1, or starts would count as searched on which
            // no sequence is played.
            let each = (UNEVEN * (most - spent) / (indices.len() - tried) as u64)
                .min((most - spent) / CHUNK as u64)
                .max(1);
            let progress = SearchProgress {
                done: tried,
                total: indices.len(),
            };
            let effort = SearchEffort::Walk { switches: 1 };
            let found = training_search.search(chunk, effort, each, progress, watch);
            if watch.stopped() {
                return None;
            }
            self.sought.starts += chunk.len() as u64;
            unsolved.extend(self.note(chunk, found));
        }
        Some(unsolved)
    }

    /// Searches in order the starts that one switch of action does not solve.
    ///
    /// Returns the number of searched starts. `None`: stopped.
    ///
    /// While few successes are known, all sequences with at most two switches are played,
    /// within a fair share of the budget. Once there are successes of near starts, they
    /// are changed instead, which needs far fewer simulations.
    pub(super) fn search_harder(
        &mut self,
        training_search: &TrainingSearch<'_>,
        indices: &[u64],
        budget: Budget,
        watch: &Watch<'_>,
    ) -> Option<usize> {
        let until = self.sought.simulations + budget.simulations;
        let mut done = 0;
        for chunk in indices.chunks(CHUNK) {
            let left = until.saturating_sub(self.sought.simulations);
            // Easy starts leave most of their share, which hard ones may spend.
            let share =
                (UNEVEN * left / (indices.len() - done) as u64).min(left / chunk.len() as u64);
            if share == 0 {
                break;
            }
            let progress = SearchProgress {
                done,
                total: indices.len(),
            };
            // A copy, since results are noted while it is read.
            let known = self.demonstrations.clone();
            let mut rest = chunk.to_vec();
            if known.len() >= FEW {
                let effort = SearchEffort::Mutate {
                    known: &known,
                    switches: budget.switches,
                };
                let most = MUTATIONS.min(share);
                let found = training_search.search(&rest, effort, most, progress, watch);
                rest = self.note(&rest, found);
            }
            if known.len() < MANY && !rest.is_empty() {
                let effort = SearchEffort::Walk { switches: 2 };
                let found = training_search.search(&rest, effort, share, progress, watch);
                self.note(&rest, found);
            }
            if watch.stopped() {
                return None;
            }
            done += chunk.len();
        }
        Some(done)
    }

    /// Searches starts near those that are solved, nearest first, by changes of their
    /// successes.
    ///
    /// `None`: stopped.
    pub(super) fn search_near(
        &mut self,
        training_search: &TrainingSearch<'_>,
        simulations: u64,
        watch: &Watch<'_>,
    ) -> Option<()> {
        let until = self.sought.simulations + simulations;
        // More than the budget can search, so that only near ones are.
        let total = 2 * simulations / MUTATIONS;
        let candidates = FIRST_NEAR..FIRST_NEAR + total;
        let starts = training_search.starts(candidates.clone());
        let mut near = StartCandidates::new(candidates, starts);
        let mut noted = 0;
        loop {
            let new = self.demonstrations[noted..].iter();
            for solved in training_search.starts(new.map(|shown| shown.index)) {
                near.note_solved(&solved);
            }
            noted = self.demonstrations.len();
            let left = until.saturating_sub(self.sought.simulations);
            let most = MUTATIONS.min(left / CHUNK as u64);
            // Few at a time, because each success brings further starts near.
            let chunk = near.take(CHUNK);
            if most == 0 || chunk.is_empty() {
                return Some(());
            }
            let known = self.demonstrations.clone();
            let effort = SearchEffort::Mutate {
                known: &known,
                switches: usize::MAX,
            };
            let progress = SearchProgress {
                done: total as usize - near.len(),
                total: total as usize,
            };
            let found = training_search.search(&chunk, effort, most, progress, watch);
            if watch.stopped() {
                return None;
            }
            self.sought.starts += chunk.len() as u64;
            self.note(&chunk, found);
        }
    }

    /// Records the results of some starts and returns those without a success.
    pub(super) fn note(&mut self, starts: &[u64], found: Vec<Option<Scouted>>) -> Vec<u64> {
        let mut unsolved = Vec::new();
        for (&index, scouted) in starts.iter().zip(found) {
            // A start that an interruption left out has cost nothing and shown nothing.
            let scouted = scouted.unwrap_or_default();
            self.sought.simulations += scouted.simulations;
            self.sought.physics_steps += scouted.physics_steps;
            self.cpu_s += scouted.cpu_s;
            if let Some(switches) = scouted.walked {
                let walked = self.walked.entry(index).or_default();
                *walked = switches.max(*walked);
            }
            match scouted.actions {
                Some(actions) => {
                    self.sought.solved += 1;
                    self.demonstrations.push(Demonstration { index, actions });
                }
                None => unsolved.push(index),
            }
        }
        unsolved
    }
}
