//! Cheap search of training and calibration starts, which appear in no report.
//!
//! Its successes are demonstrations for learners, and its results show whether a trained
//! ado has learned its world.

use std::sync::Arc;

use super::search_stream::SearchStream;
use super::search_worker::{Scouted, SearchEffort, SearchWorker, confirms};
use crate::experiment::{EpisodeLoop, Watch};
use crate::scene::Start;
use crate::seed::Purpose;
use crate::testbench::{Aftermath, KnownEpisode, NoisyStart};
use crate::world::Scenario;

/// Starts that are searched already, of all those that will be, as the progress shows them.
#[derive(Clone, Copy)]
pub(super) struct SearchProgress {
    pub done: usize,
    pub total: usize,
}

/// Search of the starts of a stream.
pub(super) struct TrainingSearch<'a>(SearchStream<'a>);

impl<'a> TrainingSearch<'a> {
    /// Creates the search of the stream (purpose, seed), which is no test stream.
    pub(super) fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> TrainingSearch<'a> {
        TrainingSearch(SearchStream::new(scenario, purpose, seed))
    }

    /// Returns the search with known episodes, whose starts follow
    /// [`FIRST_KNOWN`](crate::testbench::FIRST_KNOWN).
    pub(super) fn knowing(self, known: &Arc<[KnownEpisode]>) -> TrainingSearch<'a> {
        TrainingSearch(self.0.knowing(known))
    }

    /// Returns the starts of some indices.
    pub(super) fn starts(&self, indices: impl Iterator<Item = u64>) -> Vec<Start> {
        self.0.starts(indices)
    }

    /// Plays known episodes by their indices, one run each.
    pub(super) fn play_known(&self, indices: &[u64], watch: &Watch<'_>) -> Vec<Option<Scouted>> {
        let all = EpisodeLoop::counted(watch, indices.len());
        let worker = || SearchWorker::new(&self.0, watch);
        all.run(indices, worker, |worker, &index, turn| {
            let known = self.0.known(index)?;
            let mut scouted = Scouted::default();
            let key = self.0.key(index);
            self.0
                .place_member(key, &mut worker.first, worker.target.as_mut());
            let from = NoisyStart {
                start: &known.start,
                noise: known.noise,
            };
            // The success counts on the requested plant alone.
            let bench = worker.target.as_mut().unwrap_or(&mut worker.first);
            if confirms(bench, from, &known.actions, &mut scouted) {
                scouted.actions = Some(known.actions.clone());
            }
            scouted.cpu_s = turn.cpu_s();
            Some(scouted)
        })
    }

    /// Returns whether the ego can be copied, which makes the search cheap.
    pub(super) fn forks(&self) -> bool {
        let mut bench = self.0.scenario.bench();
        let key = self.0.key(0);
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        bench.begin(&start, noise, Aftermath::Skip);
        bench.fork().is_some()
    }

    /// Returns the numbers of sequences with at most one and at most two switches.
    pub(super) fn sequences(&self) -> [u64; 2] {
        // Sequences are counted by a formula, so there is nothing to watch.
        let watch = Watch::unwatched();
        let worker = SearchWorker::new(&self.0, &watch);
        [1, 2].map(|switches| worker.sequences(switches))
    }

    /// Searches the starts with these indices in parallel, each within a number of
    /// simulations.
    ///
    /// Starts that were not tried are left out. `None`: stopped by `watch`.
    pub(super) fn search(
        &self,
        indices: &[u64],
        effort: SearchEffort<'_>,
        simulations: u64,
        progress: SearchProgress,
        watch: &Watch<'_>,
    ) -> Vec<Option<Scouted>> {
        let all = EpisodeLoop::counted_from(watch, progress.done, progress.total);
        // The loop above reports the progress, so the searches inside stay quiet.
        let watch = watch.quiet();
        let worker = || SearchWorker::new(&self.0, &watch);
        all.run(indices, worker, |worker, &index, turn| {
            let mut scouted = worker.search(index, effort, simulations)?;
            scouted.cpu_s = turn.cpu_s();
            Some(scouted)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::Demonstration;
    use crate::sim::PlantKind;

    fn first_of(total: usize) -> SearchProgress {
        SearchProgress { done: 0, total }
    }

    /// Two switches of `acc`'s three actions in thirty decisions: 5,133 sequences
    /// by the count, far fewer where rules end them.
    #[test]
    fn a_walk_is_not_given_up_for_sequences_that_rules_end_early() {
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(PlantKind::Kinematic);
        let training_search = TrainingSearch::new(&world, Purpose::Calibration, 3);
        let watch = Watch::unwatched();
        let indices: Vec<u64> = (0..20).collect();
        let solved = |simulations: u64| {
            let found: Vec<Scouted> = training_search
                .search(
                    &indices,
                    SearchEffort::Walk { switches: 2 },
                    simulations,
                    first_of(indices.len()),
                    &watch,
                )
                .into_iter()
                .flatten()
                .collect();
            let most = found.iter().map(|it| it.simulations).max().unwrap_or(0);
            assert!(most <= simulations, "{most} of {simulations}");
            let solved = found.iter().filter(|it| it.actions.is_some());
            solved.count()
        };
        let nominal = SearchWorker::new(&training_search.0, &watch).sequences(2);
        let all = solved(nominal);
        assert!(nominal > 5_000 && all > 10, "{nominal} {all}");
        // Below the nominal count it still walks, coarsely first.
        assert!(all <= solved(nominal - 1) + 1);
        assert!(all <= 2 * solved(nominal / 20));
    }

    /// What solves one start is found again on another, a decision apart, in far
    /// fewer simulations than a walk takes.
    #[test]
    fn changes_of_known_successes_solve_other_starts() {
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(PlantKind::Kinematic);
        let training_search = TrainingSearch::new(&world, Purpose::Calibration, 3);
        let watch = Watch::unwatched();
        let indices: Vec<u64> = (0..40).collect();
        let walk = SearchEffort::Walk { switches: 2 };
        let walked = training_search.search(&indices, walk, 3000, first_of(40), &watch);
        let mut known = Vec::new();
        let mut solved = 0;
        for (&index, found) in indices.iter().zip(walked) {
            let actions = found.and_then(|found| found.actions);
            solved += usize::from(actions.is_some());
            if let (0..20, Some(actions)) = (index, actions) {
                known.push(Demonstration { index, actions });
            }
        }
        assert!(solved > 20 && known.len() > 5, "{solved} {}", known.len());
        let others: Vec<u64> = (20..40).collect();
        let count = |known: &[Demonstration]| {
            let switches = 2;
            let effort = SearchEffort::Mutate { known, switches };
            let found: Vec<Scouted> = training_search
                .search(&others, effort, 100, first_of(20), &watch)
                .into_iter()
                .flatten()
                .collect();
            assert!(found.iter().all(|it| it.simulations <= 101));
            let sequences = found.into_iter().filter_map(|it| it.actions);
            sequences
                .inspect(|it| {
                    let switched = it.windows(2).filter(|pair| pair[0] != pair[1]);
                    assert!(switched.count() <= switches);
                })
                .count()
        };
        assert!(3 * count(&known) >= 2 * (solved - known.len()));
        assert_eq!(count(&[]), 0);
    }
}
