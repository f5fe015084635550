//! Search of a single start by one thread.

use super::near_starts::Spreads;
use super::search_stream::SearchStream;
use crate::experiment::Watch;
use crate::rl::Demonstration;
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::search::{Tree, WalkControl, mutate};
use crate::seed;
use crate::testbench::{Aftermath, NoisyStart, Replay, Testbench, play};
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
    /// Largest number of switches of which every sequence was played, without a success.
    pub walked: Option<usize>,
}

/// Benches of one thread.
pub(super) struct SearchWorker<'a> {
    stream: &'a SearchStream<'a>,
    /// Bench on which sequences are searched.
    pub(super) first: Testbench,
    /// Bench on which sequences must succeed, if another one.
    pub(super) target: Option<Testbench>,
    watch: &'a Watch<'a>,
}

impl<'a> SearchWorker<'a> {
    /// Creates the benches of a stream.
    pub(super) fn new(stream: &'a SearchStream<'a>, watch: &'a Watch<'a>) -> SearchWorker<'a> {
        let SearchStream {
            scenario, cheap, ..
        } = stream;
        SearchWorker {
            stream,
            first: cheap.as_ref().unwrap_or(scenario).bench(),
            target: cheap.as_ref().map(|_| scenario.bench()),
            watch,
        }
    }

    /// Searches the start of an index. `None`: stopped.
    pub(super) fn search(
        &mut self,
        index: u64,
        effort: SearchEffort<'_>,
        simulations: u64,
    ) -> Option<Scouted> {
        let key = self.stream.key(index);
        self.stream
            .place_member(key, &mut self.first, self.target.as_mut());
        let start = self.first.draw(key);
        let from = NoisyStart {
            start: &start,
            noise: self.first.noise_of(key),
        };
        // Whether an ego can be copied is only known once it runs.
        self.first.begin(&start, from.noise, Aftermath::Skip);
        let forks = self.first.fork().is_some();
        let scouted = match effort {
            SearchEffort::Walk { switches } if forks => {
                self.walk(from, index, switches, simulations)
            }
            SearchEffort::Walk { switches } => self.sample(from, index, switches, simulations),
            SearchEffort::Mutate { known, switches } => {
                self.mutate(from, index, known, switches, simulations)
            }
        };
        // A stopped search has not shown that there is no success, but a success counts.
        let found = scouted.actions.is_some();
        (found || !self.watch.stopped()).then_some(scouted)
    }

    /// Returns the number of sequences with at most a number of switches.
    pub(super) fn sequences(&self, switches: usize) -> u64 {
        let actions = self.first.spaces().actions as u64;
        let decisions = self.first.clock().decisions() as u64;
        let (mut sum, mut term) = (0u64, actions);
        for k in 0..=switches as u64 {
            // Their number may exceed any integer, and such a walk is only too long.
            sum = sum.saturating_add(term);
            // Terms follow from each other: one switch more has a later place and another
            // action.
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
        from: NoisyStart<'_>,
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
            // Where the plants disagree, most successes of the quick one would fail again.
            if confirmed || confirmations >= MAX_CONFIRMATIONS {
                WalkControl::Stop
            } else {
                WalkControl::Continue
            }
        };
        let first = &mut self.first;
        let mut tree = Tree::new(first, from, index as usize, &mut accept, self.watch);
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
        // Read first, because the tree borrows the counts that are added to.
        let (simulations, physics_steps) = (tree.simulations, tree.physics_steps);
        // A walk that a budget or a success ends is stopped.
        scouted.walked = (next == WalkControl::Continue).then_some(switches);
        scouted.simulations += simulations;
        scouted.physics_steps += physics_steps;
        scouted
    }

    /// Plays random sequences, if the ego cannot be copied.
    ///
    /// Every sequence is then played from the start, which costs several times as much.
    fn sample(
        &mut self,
        from: NoisyStart<'_>,
        index: u64,
        switches: usize,
        simulations: u64,
    ) -> Scouted {
        let mut scouted = Scouted::default();
        let actions = self.first.spaces().actions;
        let decisions = self.first.clock().decisions();
        let mut dice = seed::generator("training_search", &[from.noise, index]);
        // A fifth of the simulations, because none of these begins at a copied prefix.
        while scouted.simulations < simulations.div_ceil(5) && !self.watch.stopped() {
            let mut times: Vec<usize> = (0..dice.random_range(0..=switches))
                .map(|_| dice.random_range(0..decisions))
                .collect();
            times.sort_unstable();
            let mut sequence = Vec::new();
            for until in times.into_iter().chain([decisions]) {
                // An empty part draws as well, so that the stream does not depend on the
                // times.
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
        from: NoisyStart<'_>,
        index: u64,
        known: &[Demonstration],
        switches: usize,
        simulations: u64,
    ) -> Scouted {
        let mut scouted = Scouted::default();
        let actions = self.first.spaces().actions;
        let decisions = self.first.clock().decisions();
        let mut dice = seed::generator("training_search, mutating", &[from.noise, index]);
        let mut nearest = self.nearest(from.start, known).into_iter();
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
                    // Half of the candidates have one change, a quarter two, and so on.
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
            // Under Definition 4 exactly the successes have a reward above 0.
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
        let starts = self.stream.starts(indices);
        let spreads = Spreads::of(&starts);
        let distance = |other: &Start| spreads.distance(start, other);
        let mut ranked: Vec<(f64, usize)> = starts.iter().map(distance).zip(0..).collect();
        // The number breaks ties, so that equal distances have one order.
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let near = ranked.into_iter().take(HINTS);
        near.map(|(_, at)| known[at].actions.clone()).collect()
    }

    /// Plays a sequence on the searching bench, with the last action held, and returns
    /// its reward.
    fn reward(&mut self, from: NoisyStart<'_>, actions: &[usize], scouted: &mut Scouted) -> f64 {
        let verdict = verdict_of(&mut self.first, from, actions, scouted);
        let reward = self.first.rulebook().reward_of(&verdict);
        // A fault has no reward, and is no parent of a change.
        reward.unwrap_or(f64::NEG_INFINITY)
    }

    /// Returns whether a sequence succeeds on the target bench too, if there is one.
    fn is_confirmed(
        &mut self,
        from: NoisyStart<'_>,
        actions: &[usize],
        scouted: &mut Scouted,
    ) -> bool {
        let target = self.target.as_mut();
        target.is_none_or(|target| confirms(target, from, actions, scouted))
    }
}

/// Plays a sequence and returns whether it succeeds.
pub(super) fn confirms(
    bench: &mut Testbench,
    from: NoisyStart<'_>,
    actions: &[usize],
    scouted: &mut Scouted,
) -> bool {
    verdict_of(bench, from, actions, scouted).is_success()
}

/// Plays a sequence, with the last action held, and counts its cost.
fn verdict_of(
    bench: &mut Testbench,
    from: NoisyStart<'_>,
    actions: &[usize],
    scouted: &mut Scouted,
) -> Verdict {
    let mut replay = Replay::holding(actions);
    let episode = play(bench, from.start, from.noise, &mut replay, Aftermath::Skip);
    scouted.simulations += 1;
    scouted.physics_steps += episode.physics_steps;
    episode.verdict
}
