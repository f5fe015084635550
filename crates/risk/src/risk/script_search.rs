//! Search for failures of every kind before the proposals are learned.
//!
//! Candidates are scripts: actions of the ados for stretches of a run, in which the law of
//! the traffic may decide some. They are drawn in generations. Half of a first generation has
//! several random phases. Later ones change the likeliest failures of each kind, the rare
//! kinds as often as the others, so that failures become kinds and then likely ones (as in the
//! archive of a population: MAP-Elites, Mouret and Clune 2015).

use indexmap::IndexMap;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use super::record::{KnownFailure, RiskRun};
use super::start_law::StartLaw;
use crate::search::mutate;
use crate::seed::generator;

/// Candidates of a generation.
pub(super) const GENERATION: usize = 250;
/// Most runs of a search.
pub(super) const SEARCHING: usize = 5_000;
/// Likeliest failures of a kind from which others are changed.
const KEPT: usize = 30;
/// Most phases of a random script.
const PHASES: usize = 4;
/// Share of scripts that are random.
const RANDOM: f64 = 0.3;
/// Share of changed scripts on another start, and of those on any start.
const MOVED: [f64; 2] = [0.5, 0.2];
/// Greatest change of a start, as a share of the law.
const NEAR: f64 = 0.1;
/// Trials of a start inside X_init.
const TRIALS: usize = 20;
/// Likelihood of a probe, as a share of that of the likeliest failure of its kind.
const LIKELY: f64 = 1e-3;

/// Action of a script that the law of the traffic decides.
pub(super) const BY_LAW: usize = usize::MAX;

/// Failure of a kind with its likelihood.
#[derive(Clone, Debug)]
struct KnownScript {
    run: RiskRun,
    /// Logarithm of the probability of its actions.
    likelihood: f64,
}

/// Archive of the likeliest failures of each kind.
pub(super) struct ScriptSearch {
    seed: u64,
    generation: u64,
    decisions: usize,
    actions: usize,
    /// By the number of the ego and the kind.
    kinds: IndexMap<(usize, String), Vec<KnownScript>>,
}

impl ScriptSearch {
    /// Creates a search of runs of some decisions with some joint actions.
    pub(super) fn new(seed: u64, decisions: usize, actions: usize) -> ScriptSearch {
        ScriptSearch {
            seed,
            generation: 0,
            decisions,
            actions,
            kinds: IndexMap::new(),
        }
    }

    /// Draws the scripts of the next generation, at most `most`.
    pub(super) fn generation(&mut self, starts: &StartLaw, most: usize) -> Vec<KnownFailure> {
        let generation = self.generation;
        self.generation += 1;
        let each = 0..most.min(GENERATION) as u64;
        // Each script has a generator of its own, so its draws do not depend on the others.
        let drawn = each.filter_map(|number| {
            let key = [self.seed, generation, number];
            self.candidate(starts, &mut generator("risk-scripts", &key))
        });
        drawn.collect()
    }

    /// Adds a run of an ego, if it is a failure that the traffic can produce.
    pub(super) fn add(&mut self, ego: usize, run: &RiskRun) {
        let Some(failure) = run.failure().filter(|_| run.is_possible()) else {
            return;
        };
        let known = self.kinds.entry((ego, failure.mode.clone())).or_default();
        let likelihood = log_likelihood(run);
        // Behind equal failures, so that the first one found stays ahead.
        let at = known.partition_point(|it| likelihood <= it.likelihood);
        // Equal sequences would fill the archive with one failure.
        let is_new = known
            .iter()
            .all(|it| it.run.actions != run.actions || it.run.shares != run.shares);
        if at < KEPT && is_new {
            let run = run.clone();
            known.insert(at, KnownScript { run, likelihood });
            known.truncate(KEPT);
        }
    }

    /// Returns the failures of each kind that are not much less likely than its likeliest.
    pub(super) fn likely(&self) -> impl Iterator<Item = (usize, &RiskRun)> {
        self.kinds.iter().flat_map(|((ego, _), known)| {
            let best = known.first().map_or(0.0, |it| it.likelihood);
            let least = best + libm::log(LIKELY);
            let likely = known.iter().filter(move |it| least <= it.likelihood);
            likely.map(|it| (*ego, &it.run))
        })
    }

    /// Draws a start and a script. `None`: no start is inside X_init.
    fn candidate(&self, starts: &StartLaw, dice: &mut ChaCha8Rng) -> Option<KnownFailure> {
        let Some(parent) = self.parent(dice).filter(|_| !dice.random_bool(RANDOM)) else {
            return Some(KnownFailure {
                start: inside(starts, || uniform(starts, dice))?,
                noise: dice.next_u64(),
                actions: phases(self.decisions, self.actions, dice),
            });
        };
        let mut actions: Vec<usize> = parent.actions.iter().map(|it| *it as usize).collect();
        // Recorded actions end with the failure, but a changed run may last longer.
        actions.resize(self.decisions, actions.last().copied().unwrap_or(BY_LAW));
        self.change(&mut actions, dice);
        if !dice.random_bool(MOVED[0]) {
            // On its own start and noise, a change shows what the actions do.
            return Some(KnownFailure {
                start: starts.start(&parent.shares)?,
                noise: parent.noise,
                actions,
            });
        }
        let is_any = dice.random_bool(MOVED[1]);
        let start = inside(starts, || {
            if is_any {
                uniform(starts, dice)
            } else {
                near(&parent.shares, dice)
            }
        })?;
        Some(KnownFailure {
            start,
            noise: dice.next_u64(),
            actions,
        })
    }

    /// Draws one of the likeliest failures of a kind, every kind as often.
    fn parent(&self, dice: &mut ChaCha8Rng) -> Option<&RiskRun> {
        if self.kinds.is_empty() {
            return None;
        }
        let (_, known) = self
            .kinds
            .get_index(dice.random_range(0..self.kinds.len()))?;
        known
            // No kind is empty, but an empty range would panic.
            .get(dice.random_range(0..known.len().max(1)))
            .map(|it| &it.run)
    }

    /// Changes a script: other actions for a stretch, or those of the law.
    fn change(&self, actions: &mut [usize], dice: &mut ChaCha8Rng) {
        loop {
            if dice.random::<bool>() {
                mutate(actions, self.actions, dice);
            } else if !actions.is_empty() {
                let from = dice.random_range(0..actions.len());
                let to = dice.random_range(from..actions.len());
                actions[from..=to].fill(BY_LAW);
            }
            // Half of the scripts are changed again, half of those once more, and so on.
            if dice.random::<bool>() {
                return;
            }
        }
    }
}

/// Returns the logarithm of the probability of a run's actions.
///
/// The start adds nothing, because its uniform numbers are all equally likely.
pub(super) fn log_likelihood(run: &RiskRun) -> f64 {
    let actions = run.actions.iter().enumerate();
    let taken = actions.map(|(at, action)| f64::from(run.law(at)[*action as usize]));
    taken.map(libm::log).sum()
}

/// Returns a start inside X_init. `None` after too many trials.
fn inside(starts: &StartLaw, mut draw: impl FnMut() -> Vec<f64>) -> Option<crate::scene::Start> {
    (0..TRIALS).find_map(|_| starts.start(&draw()))
}

fn uniform(starts: &StartLaw, dice: &mut ChaCha8Rng) -> Vec<f64> {
    (0..starts.dimensions()).map(|_| dice.random()).collect()
}

fn near(shares: &[f64], dice: &mut ChaCha8Rng) -> Vec<f64> {
    let moved = shares.iter().map(|share| {
        let by = NEAR * (2.0 * dice.random::<f64>() - 1.0);
        // Never 1, which is no uniform number.
        (share + by).clamp(0.0, 1.0 - f64::EPSILON)
    });
    moved.collect()
}

/// Returns random actions in one to [`PHASES`] phases.
fn phases(decisions: usize, actions: usize, dice: &mut ChaCha8Rng) -> Vec<usize> {
    let count = dice.random_range(1..=PHASES);
    let mut ends: Vec<usize> = (1..count)
        .map(|_| dice.random_range(0..decisions.max(1)))
        .collect();
    ends.sort_unstable();
    let mut script = Vec::new();
    for end in ends.into_iter().chain([decisions]) {
        // A phase may have no length, so scripts with fewer phases are drawn too.
        script.resize(end, dice.random_range(0..actions));
    }
    script
}

#[cfg(test)]
mod tests {
    use super::super::RiskTraffic;
    use super::super::record::{EgoFailure, RunEnd};
    use super::super::tests::{TRAFFIC, world};
    use super::*;

    fn failed(mode: &str, actions: &[u32]) -> RiskRun {
        RiskRun {
            shares: vec![0.5],
            actions: actions.to_vec(),
            inputs: vec![0.0; actions.len()],
            laws: [1e-4, 1.0 - 1e-4].repeat(actions.len()),
            ..RiskRun::ending(RunEnd::Failed(EgoFailure {
                mode: mode.to_owned(),
                lawful: true,
                preventable: None,
            }))
        }
    }

    #[test]
    fn the_likeliest_failures_of_each_kind_are_kept() {
        let mut search = ScriptSearch::new(0, 4, 2);
        search.add(0, &failed("a", &[0, 1]));
        search.add(0, &failed("a", &[1, 1]));
        search.add(0, &failed("a", &[1, 1]));
        search.add(0, &failed("b", &[0, 0]));
        search.add(1, &failed("a", &[1, 0]));
        search.add(0, &RiskRun::ending(RunEnd::Held { lawful: None }));
        let mut impossible = failed("c", &[1]);
        impossible.ratios = vec![0.0];
        search.add(0, &impossible);
        let likely: Vec<(usize, Vec<u32>)> = search
            .likely()
            .map(|(ego, run)| (ego, run.actions.clone()))
            .collect();
        // One that is a thousand times less likely than the likeliest is no probe.
        let expected = [(0, vec![1, 1]), (0, vec![0, 0]), (1, vec![1, 0])];
        assert_eq!(likely, expected);
        for at in 0..2 * KEPT as u32 {
            let bits: Vec<u32> = (0..6).map(|bit| at >> bit & 1).collect();
            search.add(0, &failed("many", &bits));
        }
        assert!(search.kinds.values().all(|it| it.len() <= KEPT));
    }

    #[test]
    fn scripts_have_several_phases_and_change_those_that_fail() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let mut search = ScriptSearch::new(7, 8, 3);
        let scripts = search.generation(&traffic.starts, 1000);
        assert_eq!(scripts.len(), GENERATION);
        let switches =
            |it: &KnownFailure| it.actions.windows(2).filter(|it| it[0] != it[1]).count();
        for count in 0..PHASES {
            let found = scripts.iter().filter(|it| switches(it) == count).count();
            assert!(found > 10, "{found} with {count} switches");
        }
        assert!(scripts.iter().all(|it| it.actions.len() == 8));
        search.add(0, &failed("a", &[0, 0, 1]));
        let changed = search.generation(&traffic.starts, 100);
        assert_eq!(changed.len(), 100);
        let by_law = changed.iter().filter(|it| it.actions.contains(&BY_LAW));
        assert!(by_law.count() > 20);
        // Most are on its start or near it.
        let start = traffic.starts.start(&[0.5]).expect("inside");
        let same = changed.iter().filter(|it| it.start == start).count();
        assert!((20..60).contains(&same), "{same}");
        // Another generation has other scripts, and the same seed the same ones.
        let mut again = ScriptSearch::new(7, 8, 3);
        assert_eq!(again.generation(&traffic.starts, 1000), scripts);
        assert_ne!(again.generation(&traffic.starts, 1000), scripts);
    }
}
