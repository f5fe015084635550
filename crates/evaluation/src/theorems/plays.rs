//! Episodes of a grid from all of its starts, with their discounted rewards.

use rayon::prelude::*;

use super::TheoremsError;
use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::grid_solver::exact::Game;
use crate::grid_solver::values::ValueTable;
use crate::rl::Policy;
use crate::rulebook::{Rulebook, Verdict};
use crate::scene::Start;
use crate::scene::grid::{Position, position_of};
use crate::testbench::{Aftermath, Episode, PolicyActor, Replay, Testbench, play};
use crate::world::{GridScenario, Scenario};

/// Tolerance for rounding in every comparison of values.
pub(super) const ROUNDING: f64 = 1e-9;

/// Grid world with a list of starts, under the discount of its learner.
pub(super) struct GridUnderTest<'a> {
    pub(super) scenario: GridScenario<'a>,
    pub(super) game: Game,
    /// Discount γ of the learner.
    pub(super) discount: f64,
    pub(super) starts: Vec<Start>,
    pub(super) positions: Vec<Position>,
}

/// Episode in the form that Theorems 1 and 2 use.
#[derive(Clone, Copy, Debug)]
pub(super) struct TheoremEpisode {
    /// Number of decisions, T + 1.
    pub(super) decisions: usize,
    /// γ^T, where T is the index of the decision that ended the episode.
    pub(super) weight: f64,
    /// Reward R_T.
    pub(super) reward: f64,
    /// True if every rule was strictly kept.
    pub(super) keeps_rules: bool,
    /// Whether the episode is a counterexample.
    pub(super) success: bool,
}

impl TheoremEpisode {
    /// Returns γ^T R_T.
    pub(super) fn paid(&self) -> f64 {
        self.weight * self.reward
    }
}

impl<'a> GridUnderTest<'a> {
    pub(super) fn of(scenario: GridScenario<'a>) -> Result<GridUnderTest<'a>, TheoremsError> {
        let Some(starts) = scenario.starts() else {
            let why = "it has no list of starts".to_owned();
            return Err(not_solved(&scenario, why));
        };
        let game = Game::of(scenario.world());
        Ok(GridUnderTest {
            positions: starts
                .iter()
                .map(|start| position_of(start, &game.arena))
                .collect(),
            scenario,
            game,
            discount: scenario.learner().discount(),
            starts,
        })
    }

    /// Plays the greedy policy of a table from every start.
    pub(super) fn greedy(&self, table: &ValueTable) -> Result<Vec<TheoremEpisode>, TheoremsError> {
        self.played(|bench, start| {
            let actions = table.actions(position_of(start, &self.game.arena));
            let mut ado = Replay::holding(&actions);
            // Nothing on a grid draws noise, so its seed is any number.
            play(bench, start, 0, &mut ado, Aftermath::Skip)
        })
    }

    /// Plays the trained ado from every start.
    pub(super) fn trained(
        &self,
        policy: &dyn Policy,
    ) -> Result<Vec<TheoremEpisode>, TheoremsError> {
        self.played(|bench, start| play(bench, start, 0, &mut PolicyActor(policy), Aftermath::Skip))
    }

    fn played(
        &self,
        episode: impl Fn(&mut Testbench, &Start) -> Episode + Sync + Send,
    ) -> Result<Vec<TheoremEpisode>, TheoremsError> {
        let unwatched = Watch::unwatched();
        let one = |bench: &mut Testbench, start: &Start, _: &WorkItem| {
            let episode = episode(bench, start);
            Some(self.read(&episode))
        };
        let all = EpisodeLoop::uncounted(&unwatched);
        // Unwatched, the loop stops at no start, so the episodes match
        // the starts one by one.
        let played = all.run(&self.starts, || self.scenario.bench(), one);
        played.into_iter().flatten().collect()
    }

    /// Reads an episode, if it is valid.
    fn read(&self, episode: &Episode) -> Result<TheoremEpisode, TheoremsError> {
        let Some(reward) = self.scenario.rulebook().reward_of(&episode.verdict) else {
            let why = format!("from {:?} the episode is invalid", episode.start.0);
            return Err(not_solved(&self.scenario, why));
        };
        // A held episode and a counterexample both keep all rules.
        let keeps_rules = !matches!(episode.verdict, Verdict::Foul { .. });
        // T counts from 0, and an episode without any decision ended where it began.
        let last = episode.actions.len().saturating_sub(1);
        Ok(TheoremEpisode {
            decisions: episode.actions.len(),
            weight: self.discount.powi(last as i32),
            reward,
            keeps_rules,
            success: episode.verdict.is_success(),
        })
    }

    /// Returns V of a table at every start.
    ///
    /// # Errors
    /// The table is of a game without one of the starts.
    pub(super) fn values(&self, table: &ValueTable) -> Result<Vec<f64>, TheoremsError> {
        let value = |both: &Position| {
            let missing = || not_solved(&self.scenario, format!("no value is known at {both:?}"));
            table.at(*both).ok_or_else(missing)
        };
        self.positions.iter().map(value).collect()
    }

    /// Returns the discounted reward above which only counterexamples lie.
    ///
    /// An episode without rule violation and counterexample earns at most R(0) ≤ 0, at decision K − 1.
    pub(super) fn held_at_best(&self) -> f64 {
        let last = self.game.steps.saturating_sub(1);
        // The reward is at most 0, so the latest decision discounts it
        // to the greatest value.
        self.discount.powi(last as i32) * self.scenario.rulebook().reward.lawful(0.0)
    }

    /// Returns the mildest penalty of a rule violation, ρ_max in Definition 4.
    pub(super) fn penalty(&self) -> f64 {
        let Rulebook { reward, rules, .. } = self.scenario.rulebook();
        // One broken rule has the least penalty of all numbers of them.
        -reward.foul(1, rules.len())
    }

    /// Sums counts over all pairs (x0, x0'), in parallel over x0.
    pub(super) fn sum<const N: usize>(
        &self,
        of_start: impl Fn(usize) -> [u64; N] + Sync + Send,
    ) -> [u64; N] {
        let all = (0..self.starts.len()).into_par_iter().map(of_start);
        // Integer sums do not depend on the order of the threads.
        all.reduce(
            || [0; N],
            |mut sum, counts| {
                for (sum, count) in sum.iter_mut().zip(counts) {
                    *sum += count;
                }
                sum
            },
        )
    }
}

pub(super) fn not_solved(scenario: &Scenario, why: String) -> TheoremsError {
    TheoremsError::NotSolved {
        world: scenario.name.clone(),
        why,
    }
}
