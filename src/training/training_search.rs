//! Cheap search of training and calibration starts, which appear in no report.
//!
//! Its successes are demonstrations for learners, and its results show whether a trained
//! ado has learned its world.

use std::sync::Arc;

use super::near_starts::Spreads;
use crate::experiment::{EpisodeLoop, Watch};
use crate::rl::Demonstration;
use crate::rulebook::Verdict;
use crate::scene::{Dynamics, Start};
use crate::search::mutate;
use crate::search::{Tree, WalkControl};
use crate::seed;
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, FIRST_KNOWN, KnownEpisode, Replay, Testbench, play};
use crate::world::Scenario;
use rand::RngExt;

/// Pre-screened successes per start that are tried on the requested plant.
const MAX_CONFIRMATIONS: u64 = 30;

/// Decisions between two switches, the coarsest walk first.
const STRIDES: [usize; 5] = [16, 8, 4, 2, 1];

/// Known successes of near starts that are tried before any is changed.
const HINTS: usize = 10;
/// Number of best sequences, one of which is changed next.
const ELITES: usize = 5;

/// Method by which a start is searched.
#[derive(Clone, Copy)]
pub(super) enum SearchEffort<'a> {
    /// All sequences with at most a number of switches, within the simulations.
    Walk { switches: usize },
    /// Successes of the nearest starts, and changes of them, with at most a number of
    /// switches.
    Mutate {
        known: &'a [Demonstration],
        switches: usize,
    },
}

/// Result of the search of one start.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Scouted {
    /// Actions that make the ego fail with all rules kept, if any were found.
    pub actions: Option<Vec<usize>>,
    /// Number of episodes, partial episodes included.
    pub simulations: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
}

/// Search of the starts of a stream, each with its member of the family.
pub(super) struct TrainingSearch<'a> {
    scenario: &'a Scenario,
    /// World on the plant of the pre-screening, if another plant is requested.
    cheap: Option<Scenario>,
    purpose: Purpose,
    seed: u64,
    /// Episodes beyond the stream, from index [`FIRST_KNOWN`] on.
    known: Arc<[KnownEpisode]>,
}

impl<'a> TrainingSearch<'a> {
    /// Creates the search of the stream (purpose, seed), which is no test stream.
    pub(super) fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> TrainingSearch<'a> {
        // Invariant: training never sees a test start.
        let open = matches!(purpose, Purpose::Train | Purpose::Calibration);
        assert!(open, "test starts are not searched");
        // Kinematic runs are about a hundred times as fast. Their successes are confirmed on
        // the requested plant.
        let rigid = scenario.plant() == Dynamics::Rigid;
        let cheap = rigid.then(|| scenario.on(PlantKind::Kinematic));
        TrainingSearch {
            scenario,
            cheap,
            purpose,
            seed,
            known: Arc::default(),
        }
    }

    /// Returns the search with known episodes, whose starts follow [`FIRST_KNOWN`].
    pub(super) fn knowing(mut self, known: &Arc<[KnownEpisode]>) -> TrainingSearch<'a> {
        self.known = Arc::clone(known);
        self
    }

    /// Returns a known episode by its index.
    fn known(&self, index: u64) -> Option<&KnownEpisode> {
        self.known.get(index.checked_sub(FIRST_KNOWN)? as usize)
    }

    /// Plays known episodes by their indices, one run each.
    pub(super) fn play_known(&self, indices: &[u64], watch: &Watch<'_>) -> Vec<Option<Scouted>> {
        let all = EpisodeLoop::counted(watch, indices.len());
        let worker = || self.worker(watch);
        all.run(indices, worker, |worker, &index, turn| {
            let known = self.known(index)?;
            let mut scouted = Scouted::default();
            self.place_member(self.key(index), &mut worker.first, worker.target.as_mut());
            let from = (&known.start, known.noise);
            let bench = worker.target.as_mut().unwrap_or(&mut worker.first);
            if confirms(bench, from, &known.actions, &mut scouted) {
                scouted.actions = Some(known.actions.clone());
            }
            scouted.cpu_s = turn.cpu_s();
            Some(scouted)
        })
    }

    /// Returns the starts of some indices.
    pub(super) fn starts(&self, indices: impl Iterator<Item = u64>) -> Vec<Start> {
        let scene = self.scenario.world().scene();
        let drawn = indices.map(|index| match self.known(index) {
            Some(known) => known.start.clone(),
            None => scene.draw(self.key(index)),
        });
        drawn.collect()
    }

    /// Returns whether the ego can be copied, which makes the search cheap.
    pub(super) fn forks(&self) -> bool {
        let mut bench = self.scenario.bench();
        let key = self.key(0);
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        bench.begin(&start, noise, Aftermath::Skip);
        bench.fork().is_some()
    }

    fn key(&self, index: u64) -> StartKey {
        StartKey {
            purpose: self.purpose,
            seed: self.seed,
            index,
        }
    }

    /// Searches the starts with these indices in parallel, each within a number of
    /// simulations.
    ///
    /// Starts that were not tried are left out. `None`: stopped by `watch`. The progress
    /// continues from `done` of `total` starts.
    pub(super) fn search(
        &self,
        indices: &[u64],
        (effort, simulations): (SearchEffort<'_>, u64),
        (done, total): (usize, usize),
        watch: &Watch<'_>,
    ) -> Vec<Option<Scouted>> {
        let all = EpisodeLoop::counted_from(watch, done, total);
        let watch = watch.quiet();
        let worker = || self.worker(&watch);
        all.run(indices, worker, |worker, &index, turn| {
            let mut scouted = worker.search(index, effort, simulations)?;
            scouted.cpu_s = turn.cpu_s();
            Some(scouted)
        })
    }

    fn worker<'b>(&'b self, watch: &'b Watch<'b>) -> SearchWorker<'b> {
        SearchWorker {
            training_search: self,
            first: self.cheap.as_ref().unwrap_or(self.scenario).bench(),
            target: self.cheap.as_ref().map(|_| self.scenario.bench()),
            watch,
        }
    }

    /// Puts the ego of an episode on the benches, if there is a family.
    fn place_member(&self, key: StartKey, first: &mut Testbench, target: Option<&mut Testbench>) {
        let against = self.scenario.against;
        let Some(family) = self.scenario.family().filter(|_| !against.is_nominal()) else {
            return;
        };
        // The member of the training episode of this key, or a success would not hold there.
        let mut member = family.draw(&self.scenario.name, key);
        if let Some(target) = target {
            self.scenario.place_member(&family.variant(&member), target);
        }
        member.plant = PlantKind::Kinematic;
        let cheap = self.cheap.as_ref().unwrap_or(self.scenario);
        cheap.place_member(&family.variant(&member), first);
    }
}

/// Benches of one thread.
struct SearchWorker<'a> {
    training_search: &'a TrainingSearch<'a>,
    /// Bench on which sequences are searched.
    first: Testbench,
    /// Bench on which sequences must succeed, if another one.
    target: Option<Testbench>,
    watch: &'a Watch<'a>,
}

impl SearchWorker<'_> {
    fn search(
        &mut self,
        index: u64,
        effort: SearchEffort<'_>,
        simulations: u64,
    ) -> Option<Scouted> {
        let key = self.training_search.key(index);
        self.training_search
            .place_member(key, &mut self.first, self.target.as_mut());
        let (start, noise) = (self.first.draw(key), self.first.noise_of(key));
        let from = (&start, noise);
        self.first.begin(&start, noise, Aftermath::Skip);
        let forks = self.first.fork().is_some();
        let scouted = match effort {
            SearchEffort::Walk { switches } if forks => {
                self.walk(from, index, switches, simulations)
            }
            SearchEffort::Walk { switches } => self.sample(from, index, switches, simulations),
            SearchEffort::Mutate { known, switches } => {
                self.mutate(from, index, (known, switches), simulations)
            }
        };
        // A stopped search has not shown that there is no success, but a success counts.
        let found = scouted.actions.is_some();
        (found || !self.watch.stopped()).then_some(scouted)
    }

    /// Returns the number of sequences with at most a number of switches.
    fn sequences(&self, switches: usize) -> u64 {
        let actions = self.first.spaces().actions as u64;
        let decisions = self.first.clock().decisions() as u64;
        let (mut sum, mut term) = (0u64, actions);
        for k in 0..=switches as u64 {
            sum = sum.saturating_add(term);
            let switched = decisions.saturating_sub(1 + k) * actions.saturating_sub(1);
            term = term.saturating_mul(switched) / (k + 1);
        }
        sum
    }

    /// Plays all sequences within the simulations, those with the fewest switches first.
    ///
    /// Shared prefixes are played once, by copies of the ego.
    ///
    /// A branch ends at a rule violation, so far fewer sequences may be possible than
    /// [`SearchWorker::sequences`] counts. If the simulations may not suffice for these,
    /// sequences that switch at every 16th decision come first, then those at every 8th
    /// and so on, so that omissions are spread evenly.
    fn walk(
        &mut self,
        from: (&Start, u64),
        index: u64,
        switches: usize,
        simulations: u64,
    ) -> Scouted {
        let strides = if self.sequences(switches) <= simulations {
            &STRIDES[STRIDES.len() - 1..]
        } else {
            &STRIDES
        };
        let mut scouted = Scouted::default();
        let mut confirmations = 0;
        let target = &mut self.target;
        let mut accept = |actions: &[usize], _: &Testbench| {
            let confirmed = match target {
                None => true,
                Some(target) => {
                    confirmations += 1;
                    confirms(target, from, actions, &mut scouted)
                }
            };
            if confirmed {
                scouted.actions = Some(actions.to_vec());
            }
            if confirmed || MAX_CONFIRMATIONS <= confirmations {
                WalkControl::Stop
            } else {
                WalkControl::Continue
            }
        };
        let from = (from, index as usize);
        let first = &mut self.first;
        let mut tree = Tree::new(first, from, Aftermath::Skip, &mut accept, self.watch);
        tree.most = simulations;
        let mut next = WalkControl::Continue;
        for stride in strides {
            tree.stride = *stride;
            for switches in 0..=switches {
                for action in 0..first.spaces().actions {
                    if next == WalkControl::Continue {
                        next = tree.begin(first, action, switches);
                    }
                }
            }
        }
        let (simulations, physics_steps) = (tree.simulations, tree.physics_steps);
        scouted.simulations += simulations;
        scouted.physics_steps += physics_steps;
        scouted
    }

    /// Plays random sequences, if the ego cannot be copied.
    ///
    /// Every sequence is then played from the start, which costs several times as much.
    fn sample(
        &mut self,
        from: (&Start, u64),
        index: u64,
        switches: usize,
        simulations: u64,
    ) -> Scouted {
        let mut scouted = Scouted::default();
        let actions = self.first.spaces().actions;
        let decisions = self.first.clock().decisions();
        let mut dice = seed::generator("training_search", &[from.1, index]);
        // A fifth of the simulations, because none of these begins at a copied prefix.
        while scouted.simulations < simulations.div_ceil(5) && !self.watch.stopped() {
            let mut times: Vec<usize> = (0..dice.random_range(0..=switches))
                .map(|_| dice.random_range(0..decisions))
                .collect();
            times.sort_unstable();
            let mut sequence = Vec::new();
            for until in times.into_iter().chain([decisions]) {
                sequence.resize(until, dice.random_range(0..actions));
            }
            if !confirms(&mut self.first, from, &sequence, &mut scouted) {
                continue;
            }
            if self.is_confirmed(from, &sequence, &mut scouted) {
                scouted.actions = Some(sequence);
                break;
            }
        }
        scouted
    }

    /// Plays successes of the nearest starts first, then changes of the best sequences.
    ///
    /// A solution of one start often solves another start a decision earlier or later,
    /// where a walk through all sequences would need thousands of simulations.
    fn mutate(
        &mut self,
        from: (&Start, u64),
        index: u64,
        (known, switches): (&[Demonstration], usize),
        simulations: u64,
    ) -> Scouted {
        let mut scouted = Scouted::default();
        let actions = self.first.spaces().actions;
        let decisions = self.first.clock().decisions();
        let mut dice = seed::generator("training_search, mutating", &[from.1, index]);
        let mut nearest = self.nearest(from.0, known).into_iter();
        let mut elites: Vec<(f64, Vec<usize>)> = Vec::new();
        while scouted.simulations < simulations && !self.watch.stopped() {
            let sequence = match nearest.next() {
                Some(one) => one,
                None if elites.is_empty() => break,
                None => {
                    let mut one = elites[dice.random_range(0..elites.len())].1.clone();
                    // Successes end with the failure, but a change may have to come later.
                    one.resize(decisions, one.last().copied().unwrap_or(0));
                    mutate(&mut one, actions, &mut dice);
                    while dice.random::<bool>() {
                        mutate(&mut one, actions, &mut dice);
                    }
                    one
                }
            };
            let switched = sequence.windows(2).filter(|pair| pair[0] != pair[1]);
            if switches < switched.count() {
                // It needs no simulation, so it must be limited.
                scouted.simulations += 1;
                continue;
            }
            let reward = self.reward(from, &sequence, &mut scouted);
            if reward > 0.0 && self.is_confirmed(from, &sequence, &mut scouted) {
                scouted.actions = Some(sequence);
                break;
            }
            // The newest of equal sequences comes first, so that the search advances.
            let at = elites.partition_point(|elite| elite.0 > reward);
            elites.insert(at, (reward, sequence));
            elites.truncate(ELITES);
        }
        scouted
    }

    /// Returns the sequences of the nearest starts, with each axis scaled by its spread.
    fn nearest(&self, start: &Start, known: &[Demonstration]) -> Vec<Vec<usize>> {
        let indices = known.iter().map(|shown| shown.index);
        let starts = self.training_search.starts(indices);
        let spreads = Spreads::of(&starts);
        let distance = |other: &Start| spreads.distance(start, other);
        let mut ranked: Vec<(f64, usize)> = starts.iter().map(distance).zip(0..).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let near = ranked.into_iter().take(HINTS);
        near.map(|(_, at)| known[at].actions.clone()).collect()
    }

    /// Plays a sequence on the searching bench, with the last action held, and returns
    /// its reward.
    fn reward(&mut self, from: (&Start, u64), actions: &[usize], scouted: &mut Scouted) -> f64 {
        let verdict = verdict_of(&mut self.first, from, actions, scouted);
        let reward = self.first.rulebook().reward_of(&verdict);
        reward.unwrap_or(f64::NEG_INFINITY)
    }

    /// Returns whether a sequence succeeds on the target bench too, if there is one.
    fn is_confirmed(
        &mut self,
        from: (&Start, u64),
        actions: &[usize],
        scouted: &mut Scouted,
    ) -> bool {
        let target = self.target.as_mut();
        target.is_none_or(|target| confirms(target, from, actions, scouted))
    }
}

/// Plays a sequence and returns whether it succeeds.
fn confirms(
    bench: &mut Testbench,
    from: (&Start, u64),
    actions: &[usize],
    scouted: &mut Scouted,
) -> bool {
    verdict_of(bench, from, actions, scouted).is_success()
}

/// Plays a sequence, with the last action held, and counts its cost.
fn verdict_of(
    bench: &mut Testbench,
    (start, noise): (&Start, u64),
    actions: &[usize],
    scouted: &mut Scouted,
) -> Verdict {
    let mut replay = Replay::holding(actions);
    let episode = play(bench, start, noise, &mut replay, Aftermath::Skip);
    scouted.simulations += 1;
    scouted.physics_steps += episode.physics_steps;
    episode.verdict
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two switches of `acc`'s three actions in thirty decisions: 5,133 sequences
    /// by the count, far fewer where rules end them.
    #[test]
    fn a_walk_is_not_given_up_for_sequences_that_rules_end_early() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = world.on(PlantKind::Kinematic);
        let training_search = TrainingSearch::new(&world, Purpose::Calibration, 3);
        let watch = Watch::unwatched();
        let indices: Vec<u64> = (0..20).collect();
        let solved = |simulations: u64| {
            let found = training_search.search(
                &indices,
                (SearchEffort::Walk { switches: 2 }, simulations),
                (0, indices.len()),
                &watch,
            );
            let found: Vec<Scouted> = found.into_iter().flatten().collect();
            let most = found.iter().map(|it| it.simulations).max().unwrap_or(0);
            assert!(most <= simulations, "{most} of {simulations}");
            let solved = found.iter().filter(|it| it.actions.is_some());
            solved.count()
        };
        let nominal = training_search.worker(&watch).sequences(2);
        let all = solved(nominal);
        assert!(5_000 < nominal && 10 < all, "{nominal} {all}");
        // Below the nominal count it still walks, coarsely first.
        assert!(all <= solved(nominal - 1) + 1);
        assert!(all <= 2 * solved(nominal / 20));
    }

    /// What solves one start is found again on another, a decision apart, in far
    /// fewer simulations than a walk takes.
    #[test]
    fn changes_of_known_successes_solve_other_starts() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let world = world.on(PlantKind::Kinematic);
        let training_search = TrainingSearch::new(&world, Purpose::Calibration, 3);
        let watch = Watch::unwatched();
        let indices: Vec<u64> = (0..40).collect();
        let walk = (SearchEffort::Walk { switches: 2 }, 3000);
        let walked = training_search.search(&indices, walk, (0, 40), &watch);
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
            let effort = (SearchEffort::Mutate { known, switches }, 100);
            let found = training_search.search(&others, effort, (0, 20), &watch);
            let found: Vec<Scouted> = found.into_iter().flatten().collect();
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
