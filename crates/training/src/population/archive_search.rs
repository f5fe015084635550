//! Search that fills the archive of a population.
//!
//! Candidates are changed sequences of archived failures of rare cells, on their own
//! starts, on near starts and on any start, and short random sequences. They are drawn
//! in generations. A generation depends on the archive before it alone, so the result is
//! the same for any number of threads.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::archive::{ArchivedFailure, FailureArchive};
use crate::crashes::CellFinder;
use crate::experiment::{EpisodeLoop, Watch, badness};
use crate::rl::Demonstration;
use crate::scene::Start;
use crate::search::mutate;
use crate::seed::{self, Purpose, StartKey};
use crate::testbench::{Aftermath, Constant, Episode, Replay, Testbench, play};
use crate::world::Scenario;

/// First training start of the search, which no learner reaches by itself.
const FIRST_START: u64 = 1 << 42;
/// Training starts from which candidates are played.
const STARTS: u64 = 400;
/// Candidates of a generation.
const GENERATION: u64 = 256;
/// Number of nearest starts from which a near start is drawn.
const NEAR: usize = 10;
/// Share of candidates that are random sequences.
const RANDOM: f64 = 0.1;
/// Most switches of action of a random sequence.
const SWITCHES: usize = 2;
/// Simulations between two lines of the coverage.
const REPORT: u64 = 1000;
/// Largest depth of a violation that is stored, since JSON has no infinity.
const DEEPEST: f64 = 1e9;

/// Point of the curve of an archive's coverage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoveragePoint {
    /// Finished members.
    pub members: usize,
    /// Decisions of their trainings.
    pub decisions: u64,
    /// Simulations of the search so far, including replays that find cells.
    pub simulations: u64,
    /// Occupied cells.
    pub cells: usize,
    /// Failures that were found.
    pub failures: u64,
}

/// Cost of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SearchCost {
    pub(super) simulations: u64,
    pub(super) physics_steps: u64,
    pub(super) cpu_s: f64,
}

impl SearchCost {
    fn add(&mut self, other: SearchCost) {
        self.simulations += other.simulations;
        self.physics_steps += other.physics_steps;
        self.cpu_s += other.cpu_s;
    }
}

/// Search of the training starts of a seed, against one ego.
pub(super) struct ArchiveSearch<'a> {
    scenario: &'a Scenario,
    /// World on the plant of the pre-screening, if another plant is requested.
    cheap: Option<Scenario>,
    seed: u64,
    /// Starts on which the ego does not fail by itself, with their indices.
    starts: Vec<(u64, Start)>,
    /// Reciprocal width of each axis of X_init.
    per_width: Vec<f64>,
    pub(super) cost: SearchCost,
}

/// Benches of one thread.
struct Worker<'a> {
    scenario: &'a Scenario,
    cheap: Option<Testbench>,
    bench: Testbench,
    finder: CellFinder,
    cost: SearchCost,
}

impl<'a> ArchiveSearch<'a> {
    /// Creates the search and leaves out starts on which the ego fails by itself.
    ///
    /// `None`: stopped.
    pub(super) fn new(
        scenario: &'a Scenario,
        seed: u64,
        watch: &Watch<'_>,
    ) -> Option<ArchiveSearch<'a>> {
        // Without the minimum, an axis of no width would divide by 0.
        let width = |lo: f64, hi: f64| (hi - lo).max(f64::MIN_POSITIVE);
        let axes = scenario.axes();
        let mut search = ArchiveSearch {
            scenario,
            cheap: scenario.screening(),
            seed,
            starts: Vec::new(),
            per_width: axes
                .iter()
                .map(|axis| 1.0 / width(axis.lo, axis.hi))
                .collect(),
            cost: SearchCost::default(),
        };
        let indices: Vec<u64> = (FIRST_START..FIRST_START + STARTS).collect();
        let all = EpisodeLoop::uncounted(watch);
        let tried = all.run(
            &indices,
            || search.worker(),
            |worker, &index, turn| {
                let start = (!worker.fails_alone(search.key(index)))
                    .then(|| (index, worker.bench.draw(search.key(index))));
                Some((start, worker.spent(turn.cpu_s())))
            },
        );
        for (start, cost) in tried.into_iter().flatten() {
            search.starts.extend(start);
            search.cost.add(cost);
        }
        (!watch.stopped()).then_some(search)
    }

    fn key(&self, index: u64) -> StartKey {
        StartKey {
            purpose: Purpose::Train,
            seed: self.seed,
            index,
        }
    }

    fn worker(&self) -> Worker<'_> {
        Worker {
            scenario: self.scenario,
            cheap: self.cheap.as_ref().map(Scenario::bench),
            bench: self.scenario.bench(),
            finder: CellFinder::new(self.scenario),
            cost: SearchCost::default(),
        }
    }

    /// Inserts failures that were found elsewhere, such as by a training.
    ///
    /// They are confirmed first, and those on which the ego fails by itself left out.
    /// Returns whether the search was not stopped.
    pub(super) fn absorb(
        &mut self,
        archive: &mut FailureArchive,
        found: &[Demonstration],
        watch: &Watch<'_>,
    ) -> bool {
        self.play(archive, found, true, watch)
    }

    /// Searches until so many simulations are spent, and notes the coverage on the way.
    ///
    /// `round` distinguishes the searches of a population. Returns whether the search
    /// was not stopped.
    pub(super) fn fill(
        &mut self,
        archive: &mut FailureArchive,
        round: u64,
        simulations: u64,
        note: &mut dyn FnMut(u64, &FailureArchive),
        watch: &Watch<'_>,
    ) -> bool {
        // Confirming the failures of a training is not part of this budget.
        let first = self.cost.simulations;
        let mut reported = first;
        let mut drawn = 0;
        let bench = self.scenario.bench();
        // Without a start nothing can be simulated, so the budget would never be spent.
        while self.cost.simulations - first < simulations && !self.starts.is_empty() {
            let numbers = drawn..drawn + GENERATION;
            drawn += GENERATION;
            // Each candidate has a generator of its own, so its draws do not depend on
            // the others.
            let candidates: Vec<Demonstration> = numbers
                .map(|number| {
                    let key = [self.seed, round, number];
                    self.candidate(&bench, archive, &mut seed::generator("archive", &key))
                })
                .collect();
            if !self.play(archive, &candidates, false, watch) {
                return false;
            }
            if reported + REPORT <= self.cost.simulations {
                reported = self.cost.simulations;
                note(reported, archive);
            }
            let done = (self.cost.simulations - first).min(simulations);
            (watch.progress)(done, simulations);
        }
        true
    }

    /// Draws a start and a sequence of actions.
    fn candidate(
        &self,
        bench: &Testbench,
        archive: &FailureArchive,
        dice: &mut ChaCha8Rng,
    ) -> Demonstration {
        let any = self.starts[dice.random_range(0..self.starts.len())].0;
        let decisions = bench.clock().decisions();
        let actions = self.scenario.spaces().actions;
        // An empty archive has no parents, so the first generation is random.
        let parent = archive.rare(dice).filter(|_| !dice.random_bool(RANDOM));
        let Some(parent) = parent else {
            return Demonstration {
                index: any,
                actions: random_sequence(decisions, actions, dice),
            };
        };
        let mut sequence = parent.actions.clone();
        // Stored actions end with the failure, but a changed episode may last longer.
        sequence.resize(decisions, sequence.last().copied().unwrap_or(0));
        let index = match dice.random_range(0..5) {
            0 | 1 => parent.index,
            2 | 3 => self.near(bench, parent.index, dice),
            _ => any,
        };
        // On another start, the sequence itself may fail the ego in another way.
        if index == parent.index || dice.random::<bool>() {
            mutate(&mut sequence, actions, dice);
            while dice.random::<bool>() {
                mutate(&mut sequence, actions, dice);
            }
        }
        Demonstration {
            index,
            actions: sequence,
        }
    }

    /// Draws one of the nearest starts of another start.
    fn near(&self, bench: &Testbench, index: u64, dice: &mut ChaCha8Rng) -> u64 {
        let from = bench.draw(self.key(index));
        let distance = |start: &Start| -> f64 {
            let pairs = from.0.iter().zip(&start.0).zip(&self.per_width);
            pairs.map(|((a, b), per)| ((a - b) * per).powi(2)).sum()
        };
        let distances = self
            .starts
            .iter()
            .map(|(index, start)| (distance(start), *index));
        // A start would always be its own nearest neighbour.
        let mut ranked: Vec<(f64, u64)> = distances.filter(|(_, other)| *other != index).collect();
        // The index breaks ties, so that equal distances have one order.
        let order = |a: &(f64, u64), b: &(f64, u64)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let near = NEAR.min(ranked.len());
        if near == 0 {
            return index;
        }
        // Only the nearest starts are used, so the others need no order.
        if near < ranked.len() {
            ranked.select_nth_unstable_by(near - 1, order);
        }
        ranked.truncate(near);
        // The selection leaves the nearest in no fixed order.
        ranked.sort_by(order);
        ranked[dice.random_range(0..near)].1
    }

    /// Plays candidates in parallel and inserts their failures in order.
    fn play(
        &mut self,
        archive: &mut FailureArchive,
        candidates: &[Demonstration],
        foreign: bool,
        watch: &Watch<'_>,
    ) -> bool {
        // The search reports the progress of its whole budget by itself.
        let all = EpisodeLoop::uncounted(watch);
        let played = all.run(
            candidates,
            || self.worker(),
            |worker, candidate, turn| {
                let key = self.key(candidate.index);
                // Own candidates begin where the ego is known not to fail by itself.
                let alone = foreign && worker.fails_alone(key);
                let found = if alone {
                    None
                } else {
                    worker.try_out(key, candidate, watch)
                };
                Some((found, worker.spent(turn.cpu_s())))
            },
        );
        // Part of a generation would make the archive depend on the time of the stop.
        if watch.stopped() {
            return false;
        }
        for (found, cost) in played.into_iter().flatten() {
            self.cost.add(cost);
            if let Some(found) = found {
                archive.insert(found);
            }
        }
        true
    }
}

impl Worker<'_> {
    /// Returns the cost since the last call, with the processor time of a turn.
    fn spent(&mut self, cpu_s: f64) -> SearchCost {
        // A worker plays many candidates, and each cost must be added once.
        let mut cost = std::mem::take(&mut self.cost);
        cost.simulations += std::mem::take(&mut self.finder.simulations);
        cost.physics_steps += std::mem::take(&mut self.finder.physics_steps);
        SearchCost { cpu_s, ..cost }
    }

    fn fails_alone(&mut self, key: StartKey) -> bool {
        let neutral = self.scenario.spaces().neutral;
        let (start, noise) = (self.bench.draw(key), self.bench.noise_of(key));
        let mut coasting = Constant(neutral);
        let episode = play(
            &mut self.bench,
            &start,
            noise,
            &mut coasting,
            Aftermath::Skip,
        );
        self.count(&episode);
        episode.verdict.is_success()
    }

    /// Plays a candidate and returns its failure, if the ego fails.
    fn try_out(
        &mut self,
        key: StartKey,
        candidate: &Demonstration,
        watch: &Watch<'_>,
    ) -> Option<ArchivedFailure> {
        let (start, noise) = (self.bench.draw(key), self.bench.noise_of(key));
        let mut replay = Replay::holding(&candidate.actions);
        // Most candidates do not fail the ego, which the cheap plant shows at less cost.
        if let Some(cheap) = &mut self.cheap {
            let screened = play(cheap, &start, noise, &mut replay, Aftermath::Skip);
            self.count(&screened);
            if !screened.verdict.is_success() {
                return None;
            }
        }
        // The screening has used up the first replay.
        let mut replay = Replay::holding(&candidate.actions);
        // Its cell and severity depend on the contact, which may come after the verdict.
        let episode = play(&mut self.bench, &start, noise, &mut replay, Aftermath::Play);
        self.count(&episode);
        watch.faults.note(candidate.index, episode.fault.as_ref());
        if !episode.verdict.is_success() {
            return None;
        }
        let cell = self.finder.cell(self.scenario, &episode);
        Some(ArchivedFailure {
            cell,
            index: candidate.index,
            severity: badness(&episode).map(|one| one.min(DEEPEST)),
            actions: episode.actions,
            failures: 1,
        })
    }

    fn count(&mut self, episode: &Episode) {
        self.cost.simulations += 1;
        self.cost.physics_steps += episode.physics_steps;
    }
}

/// Returns a sequence with at most [`SWITCHES`] random switches of action.
fn random_sequence(decisions: usize, actions: usize, dice: &mut ChaCha8Rng) -> Vec<usize> {
    let switches = dice.random_range(0..=SWITCHES);
    let mut times: Vec<usize> = (0..switches)
        .map(|_| dice.random_range(0..decisions.max(1)))
        .collect();
    times.sort_unstable();
    let mut sequence = Vec::new();
    // Equal times make a part empty, which only lowers the number of switches.
    for until in times.into_iter().chain([decisions]) {
        sequence.resize(until, dice.random_range(0..actions));
    }
    sequence
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::run_dir::{CellFailure, FailureCell};
    use crate::sim::PlantKind;

    fn world(name: &str) -> Scenario {
        let world = Scenario::shipped(name).expect("shipped").expect("sound");
        world.on(PlantKind::Kinematic)
    }

    fn filled(world: &Scenario, seed: u64, simulations: u64) -> (FailureArchive, SearchCost) {
        let watch = Watch::unwatched();
        let mut search = ArchiveSearch::new(world, seed, &watch).expect("not stopped");
        let mut archive = FailureArchive::default();
        let mut noted = Vec::new();
        let mut note = |spent, archive: &FailureArchive| noted.push((spent, archive.len()));
        assert!(search.fill(&mut archive, 1, simulations, &mut note, &watch));
        assert!(noted.is_sorted() && noted.len() > 2, "{noted:?}");
        (archive, search.cost)
    }

    /// Cells of all sequences with one switch, from some starts.
    fn exhaustive(world: &Scenario, seed: u64, starts: u64) -> (BTreeSet<FailureCell>, u64) {
        let watch = Watch::unwatched();
        let search = ArchiveSearch::new(world, seed, &watch).expect("not stopped");
        let mut worker = search.worker();
        let (decisions, actions) = (worker.bench.clock().decisions(), world.spaces().actions);
        let mut cells = BTreeSet::new();
        for index in FIRST_START..FIRST_START + starts {
            for pair in 0..actions * actions {
                for at in 0..decisions {
                    let mut sequence = vec![pair % actions; at];
                    sequence.resize(decisions, pair / actions);
                    let candidate = Demonstration {
                        index,
                        actions: sequence,
                    };
                    let found = worker.try_out(search.key(index), &candidate, &watch);
                    cells.extend(found.map(|found| found.cell));
                }
            }
        }
        let spent = worker.spent(0.0).simulations;
        (cells, spent)
    }

    #[test]
    fn a_search_finds_the_cells_of_all_sequences_with_one_switch_in_fewer_simulations() {
        let world = world("cut_in");
        let (known, spent) = exhaustive(&world, 3, 6);
        let (archive, cost) = filled(&world, 3, spent / 2);
        let found: BTreeSet<&FailureCell> = archive.iter().map(|it| &it.cell).collect();
        let both = known.iter().filter(|cell| found.contains(cell)).count();
        assert!(
            known.len() > 5 && both * 4 >= known.len() * 3 && found.len() > known.len(),
            "{both} of {}, {} found in {} of {spent} simulations",
            known.len(),
            found.len(),
            cost.simulations,
        );
        // What is archived fails the ego again, in the same cell.
        let watch = Watch::unwatched();
        let search = ArchiveSearch::new(&world, 3, &watch).expect("not stopped");
        let mut worker = search.worker();
        for known in archive.iter() {
            let candidate = Demonstration {
                index: known.index,
                actions: known.actions.clone(),
            };
            let again = worker
                .try_out(search.key(known.index), &candidate, &watch)
                .expect("it fails again");
            assert_eq!((&again.cell, again.severity), (&known.cell, known.severity));
        }
    }

    #[test]
    fn agents_on_both_sides_of_the_ego_are_partners_of_different_cells() {
        let text = include_str!("../../../../worlds/others/both_sides.ron");
        let world = Scenario::parse("both_sides.ron", text).expect("sound");
        let (archive, _) = filled(&world.on(PlantKind::Kinematic), 3, 4000);
        let partner = |it: &ArchivedFailure| match &it.cell.failure {
            CellFailure::Contact { partner, .. } => Some(partner.clone()),
            CellFailure::Violation { .. } => None,
        };
        let partners: BTreeSet<String> = archive.iter().filter_map(partner).collect();
        assert_eq!(partners.into_iter().collect::<Vec<_>>(), ["bike", "van"]);
    }
}
