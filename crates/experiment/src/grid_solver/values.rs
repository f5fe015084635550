//! Discounted values of the grid game: V over its states and steps left.
//!
//! Decisions are numbered from 0. An episode that ends with decision T returns
//! γ^T R_T, the sum of the paper's Theorem 1. A capture ends it, so T differs
//! between starts. Without a capture or a broken rule, T = K − 1.

use std::sync::Arc;

use super::exact::Game;
use super::game_graph::{GameGraph, GameStep, Next};
use crate::rl::Policy;
use crate::rulebook::{Rulebook, Verdict};
use crate::scene::grid::{GridWorld, Position};

/// Discount under which an earlier success is better, at every horizon in f64.
const SOONER: f64 = 0.999;

/// V of every state that is no end of an episode.
#[derive(Clone, Debug)]
pub struct ValueTable {
    graph: Arc<GameGraph>,
    discount: f64,
    /// Reward of every verdict of the graph.
    rewards: Vec<f64>,
    /// By the number of decisions before a state, and its number there.
    layers: Vec<Vec<f64>>,
}

impl ValueTable {
    /// Computes V* by backward induction from the reward of each verdict.
    pub fn exact(
        graph: Arc<GameGraph>,
        discount: f64,
        reward: impl Fn(&Verdict) -> f64,
    ) -> ValueTable {
        let mut table = ValueTable::zero(graph, discount, reward);
        // Successors are one layer later, so a single pass from the end is exact.
        for layer in (0..table.layers.len()).rev() {
            table.layers[layer] = table.backed_up(layer);
        }
        table
    }

    /// Computes the values of an ado that wants a counterexample as soon as possible.
    ///
    /// Without one it keeps its rules as long as it can. The value is above 0 exactly
    /// where a counterexample exists.
    pub fn soonest(graph: Arc<GameGraph>) -> ValueTable {
        ValueTable::exact(graph, SOONER, |verdict| match verdict {
            // The depth is left out, because only the moment of the success orders the
            // actions.
            Verdict::Counterexample { .. } => 1.0,
            // Discounted like a success, so a rule that must break is broken as late as
            // possible.
            Verdict::Foul { forfeited, .. } => -(*forfeited as f64),
            _ => 0.0,
        })
    }

    /// Runs value iteration from 0 and returns the number of sweeps as well.
    ///
    /// Stops when two iterates differ by at most α(1 − γ)/(2γ), the stopping
    /// rule that the paper cites for |V_k − V*| ≤ α.
    pub fn iterated(
        graph: Arc<GameGraph>,
        discount: f64,
        reward: impl Fn(&Verdict) -> f64,
        alpha: f64,
    ) -> (ValueTable, usize) {
        let mut table = ValueTable::zero(graph, discount, reward);
        // The graph is layered, so the loop ends even for γ = 1, where this limit is 0.
        let close = alpha * (1.0 - discount) / (2.0 * discount);
        let mut sweeps = 0;
        loop {
            // All layers read the iterate before. Updated in place, one sweep from the
            // last layer would do, and the number of sweeps would show nothing.
            let next: Vec<Vec<f64>> = (0..table.layers.len())
                .map(|layer| table.backed_up(layer))
                .collect();
            let pairs = next.iter().flatten().zip(table.layers.iter().flatten());
            let moved = largest_gap(pairs);
            table.layers = next;
            sweeps += 1;
            if moved <= close {
                return (table, sweeps);
            }
        }
    }

    /// Reads V from a trained ado, at every state.
    pub fn learned(&self, world: &GridWorld, policy: &dyn Policy) -> ValueTable {
        let mut scene = world.scene();
        let mut obs = vec![0.0; world.spaces().observation];
        // The scene counts decisions from the start, the table those that are left.
        let steps = self.game().steps;
        self.replaced(|left, both, _| {
            scene.observe_at(both, steps.saturating_sub(left), &mut obs);
            f64::from(policy.value(&obs))
        })
    }

    /// Returns the same game with other values: of steps left, position and old value.
    #[must_use]
    pub fn replaced(&self, mut value: impl FnMut(u32, Position, f64) -> f64) -> ValueTable {
        let mut other = self.clone();
        let steps = self.layers.len();
        for (step, layer) in other.layers.iter_mut().enumerate() {
            for (state, old) in layer.iter_mut().enumerate() {
                let both = self.graph.position(step, state);
                *old = value((steps - step) as u32, both, *old);
            }
        }
        other
    }

    /// Returns the discount γ.
    pub fn discount(&self) -> f64 {
        self.discount
    }

    /// Returns the graph of the game.
    pub fn graph(&self) -> &Arc<GameGraph> {
        &self.graph
    }

    /// Returns the game.
    pub fn game(&self) -> &Game {
        self.graph.game()
    }

    /// Returns V of a start with all K steps left. `None` if the graph lacks the start.
    pub fn at(&self, both: Position) -> Option<f64> {
        Some(match self.graph.start(both)?.step() {
            // The first sample decides the episode, and no decision follows.
            GameStep::End(verdict) => self.rewards[verdict],
            GameStep::State(state) => self.layers[0][state],
        })
    }

    /// Returns the number of starts with a value above 0.
    pub fn successes(&self) -> usize {
        let starts = self.graph.starts();
        starts
            .filter(|both| self.at(*both).is_some_and(|value| value > 0.0))
            .count()
    }

    /// Returns the actions of the greedy policy from a start, up to the end.
    ///
    /// The policy looks one step ahead in the model. Ties go to the lowest
    /// index.
    pub fn actions(&self, start: Position) -> Vec<usize> {
        let mut actions = Vec::new();
        self.walk(start, |_, _, best| {
            actions.push(best.action());
            best.action()
        });
        actions
    }

    /// Follows a rule from a start, up to the end of the episode.
    ///
    /// `act` receives the number of decisions so far, the position and the best action
    /// there, and returns the action to take.
    pub(super) fn walk(
        &self,
        start: Position,
        mut act: impl FnMut(u32, Position, BestAction<'_>) -> usize,
    ) {
        let mut here = self.graph.start(start);
        // One decision per layer, so a walk ends with the horizon at the latest.
        for layer in 0..self.layers.len() {
            // A start that the graph lacks, or that its first sample decides, has no
            // decision.
            let Some(GameStep::State(state)) = here.map(Next::step) else {
                return;
            };
            let table = self;
            let best = BestAction {
                table,
                layer,
                state,
            };
            let action = act(layer as u32, self.graph.position(layer, state), best);
            here = Some(self.graph.next(layer, state)[action]);
        }
    }

    /// Returns max |V − V'| over all states.
    pub fn distance(&self, other: &ValueTable) -> f64 {
        let ours = self.layers.iter().flatten();
        largest_gap(ours.zip(other.layers.iter().flatten()))
    }

    /// Returns max |V − V'| over the states compared by the greedy policy.
    ///
    /// These are the successors of every state on its path from `start`. Only
    /// errors in these states can change its actions.
    pub fn distance_ahead(&self, truth: &ValueTable, start: Position) -> f64 {
        let mut worst = 0.0f64;
        self.walk(start, |_, _, best| {
            for next in self.graph.next(best.layer, best.state) {
                // Ends have the same reward in both tables.
                if let GameStep::State(next) = next.step() {
                    let [ours, theirs] = [self, truth].map(|it| it.layers[best.layer + 1][next]);
                    worst = worst.max((ours - theirs).abs());
                }
            }
            best.action()
        });
        worst
    }

    /// Returns the largest violation of the optimality equation of the game.
    ///
    /// Under `discount`, it is 0 for V* and for no other table.
    pub fn residual(&self, discount: f64) -> f64 {
        // A sweep leaves a table unchanged if it is V* of this discount, whichever
        // discount it was computed with.
        let truth = ValueTable {
            discount,
            ..self.clone()
        };
        let layers = (0..self.layers.len()).map(|layer| {
            let backed_up = truth.backed_up(layer);
            largest_gap(backed_up.iter().zip(&self.layers[layer]))
        });
        layers.fold(0.0, f64::max)
    }

    /// Returns the value of an action in a state.
    fn ahead(&self, layer: usize, state: usize, action: usize) -> f64 {
        match self.graph.next(layer, state)[action].step() {
            GameStep::End(verdict) => self.rewards[verdict],
            // The horizon ends every action of the last layer, so a next layer exists
            // here.
            GameStep::State(next) => self.discount * self.layers[layer + 1][next],
        }
    }

    /// Returns the best action in a state, of equal ones the first.
    fn greedy(&self, layer: usize, state: usize) -> usize {
        let actions = 0..self.game().moves.len();
        let values = actions.map(|action| (action, self.ahead(layer, state, action)));
        // Strict, so that the first of equal actions stays.
        let best = values.reduce(|best, other| if other.1 > best.1 { other } else { best });
        best.map_or(0, |(action, _)| action)
    }

    fn zero(graph: Arc<GameGraph>, discount: f64, reward: impl Fn(&Verdict) -> f64) -> ValueTable {
        let layers = 0..graph.depth();
        ValueTable {
            layers: layers.map(|layer| vec![0.0; graph.len(layer)]).collect(),
            rewards: graph.verdicts().iter().map(reward).collect(),
            graph,
            discount,
        }
    }

    /// Computes one sweep over the states of a layer.
    fn backed_up(&self, layer: usize) -> Vec<f64> {
        let states = 0..self.graph.len(layer);
        states
            .map(|state| self.ahead(layer, state, self.greedy(layer, state)))
            .collect()
    }
}

/// Returns the reward of each verdict under a rulebook.
pub fn rewards(rulebook: &Rulebook) -> impl Fn(&Verdict) -> f64 + '_ {
    // A grid has no faults, so no verdict of its game is invalid.
    |verdict| rulebook.reward_of(verdict).unwrap_or(f64::NEG_INFINITY)
}

/// Best action of a table in a state.
#[derive(Clone, Copy)]
pub(super) struct BestAction<'a> {
    table: &'a ValueTable,
    layer: usize,
    state: usize,
}

impl BestAction<'_> {
    /// Returns the best action, of equal ones the first.
    pub(super) fn action(&self) -> usize {
        self.table.greedy(self.layer, self.state)
    }

    /// Returns whether no action is better.
    pub(super) fn is_best(&self, action: usize) -> bool {
        self.of(action) >= self.of(self.action())
    }

    /// Returns the value of the best action.
    pub(super) fn value(&self) -> f64 {
        self.of(self.action())
    }

    fn of(&self, action: usize) -> f64 {
        self.table.ahead(self.layer, self.state, action)
    }
}

fn largest_gap<'a>(pairs: impl Iterator<Item = (&'a f64, &'a f64)>) -> f64 {
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

impl Game {
    /// Returns the actions of a rule from a start, up to the capture or K steps.
    ///
    /// `act` receives the position and the number of steps before it.
    pub fn actions(
        &self,
        start: Position,
        mut act: impl FnMut(Position, u32) -> usize,
    ) -> Vec<usize> {
        let mut both = start;
        let mut actions = Vec::new();
        for step in 0..self.steps {
            if self.arena.touching(both) {
                break;
            }
            let action = act(both, step);
            both = self.arena.next(both, self.moves[action]);
            actions.push(action);
        }
        actions
    }
}
