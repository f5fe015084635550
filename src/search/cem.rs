//! The cross-entropy method over sequences of actions.
//!
//! Rubinstein, "The Cross-Entropy Method for Combinatorial and Continuous
//! Optimization", 1999: draw a population, keep the best, draw the next one
//! from what they have in common. The fitness is the rulebook's reward, so that
//! a sequence that breaks a rule ranks below all lawful ones (Lemma 2).

use rand::RngExt;

use super::found::Found;
use super::method::{MethodInfo, MethodSettings, SearchError, SearchMethod, StartSearch};
use super::trials::Trials;
use crate::run_dir::Unconfirmed;
use crate::seed;
use crate::stats::pick;

/// The cross-entropy method, with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cem {
    /// Sequences per generation (20).
    pub population: usize,
    /// The best of them, from which the next generation is drawn (4).
    pub elites: usize,
    /// Weight of the elites against the old distribution (0.6).
    pub smoothing: f64,
    /// Decisions for which a drawn action is held (5).
    pub hold: usize,
    /// Chance that an action is drawn uniformly after all (0.2).
    pub exploration: f64,
}

impl Default for Cem {
    fn default() -> Cem {
        Cem {
            population: 20,
            elites: 4,
            smoothing: 0.6,
            hold: 5,
            exploration: 0.2,
        }
    }
}

impl SearchMethod<'_> for Cem {
    const INFO: MethodInfo = MethodInfo::sampling(
        "cem",
        "The cross-entropy method, with the rulebook's reward",
    );

    fn with(_: &MethodSettings<'_>) -> Result<Cem, SearchError> {
        Ok(Cem::default())
    }

    fn text(&self, budget: u64, _: Option<Unconfirmed>) -> String {
        format!(
            "{}, held {}, {budget} simulations",
            Self::INFO.name,
            self.hold
        )
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<Found> {
        Trials::spend(one, |trials| solve(trials, *self))
    }
}

/// Tries sequences until one succeeds; the dice depend on the noise.
fn solve(trials: &mut Trials<'_>, cem: Cem) {
    let mut rng = seed::generator("cem", &[trials.noise()]);
    let (decisions, actions) = (trials.decisions(), trials.actions());
    let blocks = decisions.div_ceil(cem.hold.max(1));
    let mut shares = vec![vec![1.0 / actions as f64; actions]; blocks];
    loop {
        let mut tried: Vec<(f64, Vec<usize>)> = Vec::with_capacity(cem.population);
        for _ in 0..cem.population.max(1) {
            let mut draw = |share: &Vec<f64>| match rng.random::<f64>() < cem.exploration {
                true => rng.random_range(0..actions),
                false => pick(share, &mut rng),
            };
            let drawn: Vec<usize> = shares.iter().map(&mut draw).collect();
            let held = drawn.iter().flat_map(|&a| std::iter::repeat_n(a, cem.hold));
            let sequence: Vec<usize> = held.take(decisions).collect();
            let Some(reward) = trials.replay(&sequence) else {
                return;
            };
            tried.push((reward, drawn));
        }
        // Equal rewards keep the order in which they were drawn.
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        tried.truncate(cem.elites.max(1));
        for (block, share) in shares.iter_mut().enumerate() {
            for (action, share) in share.iter_mut().enumerate() {
                let chosen = tried.iter().filter(|(_, drawn)| drawn[block] == action);
                let among_elites = chosen.count() as f64 / tried.len() as f64;
                *share += cem.smoothing * (among_elites - *share);
            }
        }
    }
}
