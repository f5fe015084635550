//! Counterexamples of a training, mutated until the first success.
//!
//! The nearest stored counterexamples are replayed unchanged, nearest first.
//! Then the best sequences so far are mutated. A mutation moves a switch of action,
//! replaces the action between two switches, or holds one action for a block of decisions.
//! A child replaces the worst of the best unless it scores less.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::found::SearchResult;
use super::method::{
    MethodInfo, MethodOption, MethodSettings, SearchError, SearchMethod, StartSearch,
};
use super::trials::Trials;
use crate::run_dir::Stored;
use crate::seed;

/// Stored counterexamples that are replayed first.
const SEEDS: usize = 10;
/// Number of best sequences from which the next parent is drawn.
const ELITES: usize = 5;
/// Longest shift of a switch and longest held block, in decisions.
const REACH: usize = 8;

/// Method that mutates the nearest of these counterexamples of a training.
#[derive(Clone, Copy, Debug)]
pub struct Mutate<'a>(pub &'a Stored);

impl<'a> SearchMethod<'a> for Mutate<'a> {
    const INFO: MethodInfo = MethodInfo {
        takes: &[MethodOption::Budget, MethodOption::Bank],
        ..MethodInfo::sampling(
            "mutate",
            "The nearest counterexamples of a training, then mutations of them",
        )
    };

    fn with(settings: &MethodSettings<'a>) -> Result<Mutate<'a>, SearchError> {
        let stored = settings.stored.map(Mutate);
        stored.ok_or(SearchError::NothingToMutate)
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
        Trials::spend(one, |trials| solve(trials, self.0))
    }
}

/// Tries sequences until the first success.
///
/// The generator depends on the noise of the start.
fn solve(trials: &mut Trials<'_>, stored: &Stored) {
    let mut rng = seed::generator("mutate", &[trials.noise()]);
    let (decisions, actions) = (trials.decisions(), trials.actions());
    let mut elites: Vec<(f64, Vec<usize>)> = Vec::new();
    for seed in stored.nearest(trials.start(), SEEDS) {
        let mut sequence = seed.actions.clone();
        // A stored sequence may be shorter than the episode, so its last action is held.
        let last = sequence.last().copied().unwrap_or(0);
        sequence.resize(decisions, last);
        let Some(reward) = trials.replay(&sequence) else {
            return;
        };
        elites.push((reward, sequence));
    }
    if elites.is_empty() {
        // Without counterexamples the search starts from a random sequence.
        let draw = |_| rng.random_range(0..actions);
        // The lowest possible score, so any child replaces it.
        elites.push((f64::NEG_INFINITY, (0..decisions).map(draw).collect()));
    }
    best_first(&mut elites);
    loop {
        let mut sequence = elites[rng.random_range(0..elites.len())].1.clone();
        mutate(&mut sequence, actions, &mut rng);
        // Half of the children are mutated again, half of those once more, and so on.
        while rng.random::<bool>() {
            mutate(&mut sequence, actions, &mut rng);
        }
        let Some(reward) = trials.replay(&sequence) else {
            return;
        };
        elites.push((reward, sequence));
        best_first(&mut elites);
    }
}

/// Sorts the best first and keeps at most [`ELITES`].
///
/// Among equals the newest comes first.
fn best_first(elites: &mut Vec<(f64, Vec<usize>)>) {
    // Reversed before a stable sort, so that the newest of equals comes first.
    elites.reverse();
    elites.sort_by(|a, b| b.0.total_cmp(&a.0));
    elites.truncate(ELITES);
}

/// Changes a sequence at one place.
pub fn mutate(sequence: &mut [usize], actions: usize, rng: &mut ChaCha8Rng) {
    let len = sequence.len();
    if len == 0 {
        return;
    }
    // A switch is the decision of the new action, so the first decision is none.
    let switches: Vec<usize> = (1..len)
        .filter(|&at| sequence[at - 1] != sequence[at])
        .collect();
    let kind = rng.random_range(0..3);
    match kind {
        // Without a switch there is none to move, and the last arm mutates instead.
        0 if !switches.is_empty() => {
            let at = switches[rng.random_range(0..switches.len())];
            let by = rng.random_range(1..=REACH);
            let (before, after) = (sequence[at - 1], sequence[at]);
            // The switch moves earlier or later with equal probability.
            if rng.random::<bool>() {
                sequence[at.saturating_sub(by)..at].fill(after)
            } else {
                sequence[at..(at + by).min(len)].fill(before)
            }
        }
        1 => {
            let mut borders = vec![0];
            borders.extend(&switches);
            borders.push(len);
            let stretch = rng.random_range(0..borders.len() - 1);
            let action = rng.random_range(0..actions);
            sequence[borders[stretch]..borders[stretch + 1]].fill(action);
        }
        _ => {
            let from = rng.random_range(0..len);
            let to = (from + rng.random_range(1..=REACH)).min(len);
            let action = rng.random_range(0..actions);
            sequence[from..to].fill(action);
        }
    }
}
