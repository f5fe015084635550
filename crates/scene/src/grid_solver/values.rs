//! Discounted values of the grid game: V over position pairs and steps left.
//!
//! Decisions are numbered from 0. An episode that ends with decision T returns
//! γ^T R_T, the sum of the paper's Theorem 1. A capture ends it, so T differs
//! between starts. Without a capture, T = K − 1.
//!
//! ```
//! use brakecheck_scene::grid_solver::exact::{Game, UNIT_MOVES};
//! use brakecheck_scene::grid_solver::values::ValueTable;
//! use brakecheck_scene::scene::grid::{Arena, Cell, Position};
//! use brakecheck_scene::scene::grid::AtWall;
//!
//! let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::FirstInMap };
//! let game = Game { arena, steps: 8, moves: UNIT_MOVES.to_vec() };
//! let exact = ValueTable::exact(&game, 0.8, |rho| rho);
//! let start = Position { ego: Cell { x: 0, y: 0 }, ado: Cell { x: 3, y: 3 } };
//! let decisions = exact.actions(start).len() as i32;
//! assert!((exact.at(start) - 0.8f64.powi(decisions - 1)).abs() < 1e-12);
//! ```

use super::exact::Game;
use crate::rl::Policy;
use crate::scene::grid::{GridWorld, Position};

/// V of every position pair with every number of steps left.
///
/// An episode without a capture is rewarded by its least distance over all
/// steps. A table holds the value of a pair as if the episode began there,
/// which suffices for every decision.
#[derive(Clone, Debug)]
pub struct ValueTable {
    game: Game,
    discount: f64,
    /// Successors of every pair, action by action.
    successors: Vec<u32>,
    /// `layers[left][pair]`. Layer 0 is the reward of an episode whose least
    /// distance is that of the pair.
    layers: Vec<Vec<f64>>,
}

impl ValueTable {
    /// Computes V* by backward induction from the reward of a robustness ρ(¬ψ).
    ///
    /// `lawful` maps ρ(¬ψ) to the reward of an episode without rule violations.
    pub fn exact(game: &Game, discount: f64, lawful: impl Fn(f64) -> f64) -> ValueTable {
        let mut table = ValueTable::zero(game, discount, lawful);
        for left in 1..table.layers.len() {
            table.layers[left] = table.backed_up(left);
        }
        table
    }

    /// Runs value iteration from 0 and returns the number of sweeps as well.
    ///
    /// Stops when two iterates differ by at most α(1 − γ)/(2γ), the stopping
    /// rule that the paper cites for |V_k − V*| ≤ α.
    pub fn iterated(
        game: &Game,
        discount: f64,
        lawful: impl Fn(f64) -> f64,
        alpha: f64,
    ) -> (ValueTable, usize) {
        let mut table = ValueTable::zero(game, discount, lawful);
        let close = alpha * (1.0 - discount) / (2.0 * discount);
        let mut sweeps = 0;
        loop {
            let next = (1..table.layers.len()).map(|left| table.backed_up(left));
            let next: Vec<Vec<f64>> = next.collect();
            let moved = next.iter().flatten();
            let moved = moved.zip(table.layers[1..].iter().flatten());
            let moved = moved.map(|(new, old)| (new - old).abs());
            let moved = moved.fold(0.0, f64::max);
            // Layer 0 holds rewards and is never iterated.
            table.layers.truncate(1);
            table.layers.extend(next);
            sweeps += 1;
            if moved <= close {
                return (table, sweeps);
            }
        }
    }

    /// Reads V from a trained ado, at every pair with every number of steps left.
    pub fn learned(&self, world: &GridWorld, policy: &dyn Policy) -> ValueTable {
        let mut scene = world.scene();
        let mut obs = vec![0.0; world.spaces().observation];
        self.replaced(|left, both, _| {
            scene.observe_at(both, self.game.steps.saturating_sub(left), &mut obs);
            f64::from(policy.value(&obs))
        })
    }

    /// Returns the same game with other values. Captured pairs keep theirs.
    #[must_use]
    pub fn replaced(&self, mut value: impl FnMut(u32, Position, f64) -> f64) -> ValueTable {
        let mut other = self.clone();
        for (left, layer) in other.layers.iter_mut().enumerate().skip(1) {
            for (pair, old) in layer.iter_mut().enumerate() {
                let both = self.game.position(pair);
                if !self.game.arena.touching(both) {
                    *old = value(left as u32, both, *old);
                }
            }
        }
        other
    }

    /// Returns the discount γ.
    pub fn discount(&self) -> f64 {
        self.discount
    }

    /// Returns the game.
    pub fn game(&self) -> &Game {
        &self.game
    }

    /// Returns V of a start with all K steps left.
    pub fn at(&self, both: Position) -> f64 {
        self.layers
            .last()
            .map_or(0.0, |layer| layer[self.game.pair(both)])
    }

    /// Returns the actions of the greedy policy from a start, up to the capture.
    ///
    /// The policy looks one step ahead in the model. Ties go to the lowest
    /// index.
    pub fn actions(&self, start: Position) -> Vec<usize> {
        self.game.actions(start, |both, step| {
            let left = self.layers.len() - 1 - step as usize;
            self.greedy(left, self.game.pair(both))
        })
    }

    /// Returns max |V − V'| over all pairs that are not captured and all steps left.
    pub fn distance(&self, other: &ValueTable) -> f64 {
        let layers = self.layers.iter().zip(&other.layers).skip(1);
        let values = layers.flat_map(|(ours, others)| ours.iter().zip(others));
        values.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// Returns max |V − V'| over the states compared by the greedy policy.
    ///
    /// These are the successors of every state on its path from `start`. Only
    /// errors in these states can change its actions.
    pub fn distance_ahead(&self, truth: &ValueTable, start: Position) -> f64 {
        let (mut both, mut worst) = (start, 0.0f64);
        for (left, action) in (1..self.layers.len()).rev().zip(self.actions(start)) {
            for step in &self.game.moves {
                let next = self.game.arena.next(both, *step);
                // Captures and last steps are valued by layer 0, which is exact
                // in both tables.
                if 1 < left && !self.game.arena.touching(next) {
                    let pair = self.game.pair(next);
                    let off = self.layers[left - 1][pair] - truth.layers[left - 1][pair];
                    worst = worst.max(off.abs());
                }
            }
            both = self.game.arena.next(both, self.game.moves[action]);
        }
        worst
    }

    /// Returns the largest violation of the optimality equation of `game`.
    ///
    /// Under `discount`, it is 0 for V* and for no other table.
    pub fn residual(&self, discount: f64) -> f64 {
        let truth = ValueTable {
            discount,
            ..self.clone()
        };
        let layers = (1..self.layers.len()).map(|left| (left, truth.backed_up(left)));
        let residuals = layers.flat_map(|(left, layer)| {
            let values = layer.into_iter().zip(&self.layers[left]);
            values.map(|(want, have)| (want - have).abs())
        });
        residuals.fold(0.0, f64::max)
    }

    fn zero(game: &Game, discount: f64, lawful: impl Fn(f64) -> f64) -> ValueTable {
        let per_fine = 1.0 / f64::from(game.arena.refine);
        let positions = (0..game.pairs()).map(|pair| game.position(pair));
        let ends: Vec<f64> = positions
            .clone()
            .map(|both| lawful(1.0 - f64::from(both.ego.manhattan(both.ado)) * per_fine))
            .collect();
        let undecided =
            positions.zip(&ends).map(
                |(both, end)| {
                    if game.arena.touching(both) { *end } else { 0.0 }
                },
            );
        let undecided: Vec<f64> = undecided.collect();
        let rest = std::iter::repeat_n(undecided, game.steps as usize);
        ValueTable {
            game: game.clone(),
            discount,
            successors: game.successors(),
            layers: std::iter::once(ends).chain(rest).collect(),
        }
    }

    /// Computes one sweep over the pairs with `left` ≥ 1 steps left.
    fn backed_up(&self, left: usize) -> Vec<f64> {
        // Without a capture the reward comes with the last decision, `left` − 1
        // steps later.
        let held = self.discount.powi(left as i32 - 1);
        let pairs = (0..self.game.pairs()).map(|pair| {
            if self.game.arena.touching(self.game.position(pair)) {
                return self.layers[0][pair];
            }
            // Return if no later position is closer than this pair.
            let held = held * self.layers[0][pair];
            let actions = 0..self.game.moves.len();
            actions.fold(held, |best, action| {
                best.max(self.ahead(left, pair, action))
            })
        });
        pairs.collect()
    }

    fn greedy(&self, left: usize, pair: usize) -> usize {
        let value = |action: &usize| self.ahead(left, pair, *action);
        let mut actions = 0..self.game.moves.len();
        let first = actions.next().unwrap_or(0);
        let better = |best: usize, action: usize| {
            if value(&best) < value(&action) {
                action
            } else {
                best
            }
        };
        actions.fold(first, better)
    }

    /// Returns the value of an action with `left` ≥ 1 steps left.
    fn ahead(&self, left: usize, pair: usize, action: usize) -> f64 {
        let next = self.successors[pair * self.game.moves.len() + action] as usize;
        let ends = left == 1 || self.game.arena.touching(self.game.position(next));
        if ends {
            self.layers[0][next]
        } else {
            self.discount * self.layers[left - 1][next]
        }
    }
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
