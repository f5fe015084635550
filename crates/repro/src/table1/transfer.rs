//! Fig. 1: action sequences work from their own start, policies from other starts.

use serde::{Deserialize, Serialize};

use super::{Learned, Table1Error};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, PolicyActor, play};
use brakecheck::world::{GridChange, Scenario};
use brakecheck_experiment::grid_solver::exact::Game;
use brakecheck_scene::scene::grid::{Position, position_of};
use brakecheck_world::world::scenario_kind::GridScenario;

/// Sequences of a learner's policies, replayed in open loop.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OpenLoop {
    /// Position of the learner in the study's list.
    pub learner: usize,
    /// Captures from their own start, which is 1 by construction.
    pub own_start: f64,
    /// Mean share of all other starts that a sequence captures.
    pub other_starts: f64,
    /// Share of all starts that the policy captures. It has no start of its own.
    pub policy_other_starts: f64,
    /// Share of sequences that capture from their own start against k = 1.
    pub other_step: f64,
    /// Share of these starts that the policy captures against k = 1.
    pub policy_other_step: f64,
    /// Pairs of a sequence and a start behind `other_starts`.
    pub pairs: usize,
}

/// Records every policy from every start and replays the sequences elsewhere.
pub(super) fn open_loop(
    scenario: GridScenario<'_>,
    learners: usize,
    learned: &[Learned],
) -> Result<Vec<OpenLoop>, Table1Error> {
    // A slower ego shows if a sequence or a policy adapts to a change.
    let change = GridChange {
        ego_step: Some(1),
        ..GridChange::default()
    };
    let changed = scenario.with(&change.into())?;
    let slower = changed.require_grid()?;
    let mut all = Vec::new();
    for learner in 0..learners {
        let mut sums = Sums::default();
        for learned in learned.iter().filter(|learned| learned.learner == learner) {
            sums.add(scenario, slower, learned);
        }
        all.push(sums.shares(learner));
    }
    Ok(all)
}

#[derive(Default)]
struct Sums {
    sequences: usize,
    pairs: usize,
    captured: usize,
    policy: usize,
    starts: usize,
    captured_slower: usize,
    policy_slower: usize,
}

impl Sums {
    fn add(&mut self, scenario: GridScenario<'_>, slower: GridScenario<'_>, learned: &Learned) {
        let (game, slow) = (Game::of(scenario.world()), Game::of(slower.world()));
        let starts: Vec<Start> = scenario.starts().unwrap_or_default();
        let sequences = recorded(&scenario, &starts, learned);
        // The same starts are valid on both maps, because only the ego's step differs.
        let slower_ones = recorded(&slower, &starts, learned);
        let at: Vec<Position> = starts.iter().map(|s| position_of(s, &game.arena)).collect();
        self.starts += starts.len();
        // A sequence is recorded wherever the policy itself captures.
        self.policy += sequences.iter().flatten().count();
        for (own, actions) in sequences.iter().enumerate() {
            let Some(actions) = actions else {
                // Only a capturing sequence can be replayed.
                continue;
            };
            self.sequences += 1;
            self.policy_slower += usize::from(slower_ones[own].is_some());
            self.captured_slower += usize::from(replayed(&slow, at[own], actions));
            let others = at.iter().enumerate().filter(|(other, _)| *other != own);
            for (_, start) in others {
                self.pairs += 1;
                self.captured += usize::from(replayed(&game, *start, actions));
            }
        }
    }

    fn shares(&self, learner: usize) -> OpenLoop {
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        OpenLoop {
            learner,
            // A replay on the same deterministic map repeats the recorded capture.
            own_start: 1.0,
            other_starts: share(self.captured, self.pairs),
            policy_other_starts: share(self.policy, self.starts),
            other_step: share(self.captured_slower, self.sequences),
            policy_other_step: share(self.policy_slower, self.sequences),
            pairs: self.pairs,
        }
    }
}

/// Returns the actions with which the policy captures, per start.
fn recorded(scenario: &Scenario, starts: &[Start], learned: &Learned) -> Vec<Option<Vec<usize>>> {
    let mut bench = scenario.bench();
    let mut actor = PolicyActor(&*learned.policy);
    let played = starts.iter().map(|start| {
        // Nothing on a grid draws noise, so its seed is any number.
        let episode = play(&mut bench, start, 0, &mut actor, Aftermath::Skip);
        episode.verdict.is_success().then_some(episode.actions)
    });
    played.collect()
}

/// Returns whether a sequence captures, its last action held.
fn replayed(game: &Game, start: Position, actions: &[usize]) -> bool {
    let mut next = 0;
    game.captures(start, |_| {
        // Starts are a cell apart, so a capture takes a decision and no sequence is
        // empty.
        let action = actions[next.min(actions.len() - 1)];
        next += 1;
        action
    })
}
