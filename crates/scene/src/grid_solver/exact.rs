//! The exact solution of the grid world by backward induction.
//!
//! The ego is deterministic, so the game is a shortest-path problem of the ado
//! over ordered pairs of cells. The solver covers ψ_ego = `always[0, K] (d_man
//! >= 1)` under unit moves, as in both shipped grid worlds.
//!
//! ```
//! use brakecheck_scene::grid_solver::exact::{Game, UNIT_MOVES};
//! use brakecheck_scene::scene::grid::Arena;
//! use brakecheck_scene::scene::grid::AtWall;
//!
//! let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::FirstInMap };
//! let solution = Game { arena, steps: 8, moves: UNIT_MOVES.to_vec() }.solve();
//! assert_eq!(solution.captures(), 240);
//! assert_eq!(solution.starts(), 240);
//! ```

use std::collections::HashMap;

use crate::rl::Policy;
use crate::scene::grid::{Arena, GridWorld, Position};

/// The moves up, down, left, right and stay.
pub const UNIT_MOVES: [(i32, i32); 5] = [(0, 1), (0, -1), (-1, 0), (1, 0), (0, 0)];

/// Marks a pair of cells from which the ado never captures.
const NEVER: u16 = u16::MAX;

/// A grid game: map, horizon K and the ado's moves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Game {
    /// The map and the ego.
    pub arena: Arena,
    /// Horizon K.
    pub steps: u32,
    /// The ado's moves, by action.
    pub moves: Vec<(i32, i32)>,
}

/// Best play of an ado from every pair of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    game: Game,
    /// Steps to the capture under best play, within K.
    capture_in: Vec<u16>,
    /// Least Manhattan distance reachable within K, in fine cells.
    closest: Vec<u16>,
    /// The action that captures soonest, or else approaches most.
    best: Vec<u8>,
}

impl Game {
    /// Returns the game of a grid world.
    pub fn of(world: &GridWorld) -> Game {
        let spec = world.spec();
        Game {
            arena: spec.arena,
            steps: spec.steps(),
            moves: spec.moves.clone(),
        }
    }

    /// Returns the number of ordered pairs of cells, equal cells included.
    pub fn pairs(&self) -> usize {
        self.arena.cells() * self.arena.cells()
    }

    /// Returns the pair with a number below [`Game::pairs`].
    pub fn position(&self, pair: usize) -> Position {
        let cells = self.arena.cells();
        Position {
            ego: self.arena.cell(pair / cells),
            ado: self.arena.cell(pair % cells),
        }
    }

    /// Returns the number of a pair, below [`Game::pairs`].
    pub fn pair(&self, both: Position) -> usize {
        self.arena.index(both.ego) * self.arena.cells() + self.arena.index(both.ado)
    }

    /// Returns the successors of every pair, action by action.
    pub(super) fn successors(&self) -> Vec<u32> {
        let pairs = (0..self.pairs()).flat_map(|pair| {
            let both = self.position(pair);
            let next = move |step: &(i32, i32)| self.pair(self.arena.next(both, *step)) as u32;
            self.moves.iter().map(next)
        });
        pairs.collect()
    }

    /// Solves the game in K sweeps over all pairs.
    pub fn solve(&self) -> Solution {
        let successors = self.successors();
        let actions = self.moves.len();
        let next = |pair: usize| &successors[pair * actions..(pair + 1) * actions];
        let distance: Vec<u16> = (0..self.pairs())
            .map(|pair| {
                let both = self.position(pair);
                both.ego.manhattan(both.ado) as u16
            })
            .collect();
        let captured = |closest: u16| u32::from(closest) < self.arena.refine;
        let mut closest = distance.clone();
        let mut capture_in: Vec<u16> = distance
            .iter()
            .map(|d| if captured(*d) { 0 } else { NEVER })
            .collect();
        for step in 1..=self.steps as u16 {
            // The values of one step less: reading updated ones would let a
            // pair use more steps than are left.
            let before = closest.clone();
            for pair in 0..self.pairs() {
                // The first sweep that captures is the shortest play, so it is
                // kept.
                if capture_in[pair] != NEVER {
                    continue;
                }
                let best = next(pair).iter().map(|s| before[*s as usize]).min();
                closest[pair] = distance[pair].min(best.unwrap_or(distance[pair]));
                if captured(closest[pair]) {
                    capture_in[pair] = step;
                }
            }
        }
        let best = (0..self.pairs()).map(|pair| {
            let rank = |action: &usize| {
                let successor = next(pair)[*action] as usize;
                // The action index breaks ties, so the table is deterministic.
                (capture_in[successor], closest[successor], *action)
            };
            (0..actions).min_by_key(rank).unwrap_or(0) as u8
        });
        Solution {
            best: best.collect(),
            game: self.clone(),
            capture_in,
            closest,
        }
    }

    /// Returns the probability that uniformly random actions capture, per start.
    ///
    /// The sum over all starts is the expected number of captures.
    pub fn random_captures(&self) -> Vec<f64> {
        let chance = self.random_chances();
        let starts = self.arena.starts();
        starts.map(|both| chance[self.pair(both)]).collect()
    }

    /// Returns the capture probability under random play for every pair of cells.
    ///
    /// Exact, by backward induction.
    pub fn random_chances(&self) -> Vec<f64> {
        let successors = self.successors();
        let actions = self.moves.len();
        let caught: Vec<bool> = (0..self.pairs())
            .map(|pair| self.arena.touching(self.position(pair)))
            .collect();
        let mut chance: Vec<f64> = caught.iter().map(|c| f64::from(u8::from(*c))).collect();
        for _ in 0..self.steps {
            let before = chance.clone();
            for pair in (0..self.pairs()).filter(|pair| !caught[*pair]) {
                let next = &successors[pair * actions..(pair + 1) * actions];
                let sum: f64 = next.iter().map(|s| before[*s as usize]).sum();
                chance[pair] = sum / actions as f64;
            }
        }
        chance
    }

    /// Returns whether a fixed rule captures from a start within K steps.
    pub fn captures(&self, start: Position, mut act: impl FnMut(Position) -> usize) -> bool {
        let mut both = start;
        for _ in 0..self.steps {
            if self.arena.touching(both) {
                return true;
            }
            both = self.arena.next(both, self.moves[act(both)]);
        }
        self.arena.touching(both)
    }

    /// Counts the starts that a table of one action per pair of cells captures.
    ///
    /// `action` is called once per pair, in order of the pairs.
    pub fn table_captures(&self, mut action: impl FnMut() -> usize) -> usize {
        let table: Vec<usize> = (0..self.pairs()).map(|_| action()).collect();
        let captured = |start: &Position| self.captures(*start, |both| table[self.pair(both)]);
        self.arena.starts().filter(captured).count()
    }
}

/// A two-line pursuit rule: steps along the larger axis towards the ego.
///
/// Ties go to the horizontal axis. Returns action 0 if the game lacks the move.
pub fn chase(both: Position, moves: &[(i32, i32)]) -> usize {
    let (dx, dy) = (both.ego.x - both.ado.x, both.ego.y - both.ado.y);
    let wanted = if dy.abs() <= dx.abs() {
        (dx.signum(), 0)
    } else {
        (0, dy.signum())
    };
    moves.iter().position(|step| *step == wanted).unwrap_or(0)
}

impl Solution {
    /// Returns the number of starts of the game.
    pub fn starts(&self) -> usize {
        self.game.arena.starts().count()
    }

    /// Returns the number of starts from which the best ado captures within K.
    pub fn captures(&self) -> usize {
        let starts = self.game.arena.starts();
        starts
            .filter(|both| self.capture_in(*both).is_some())
            .count()
    }

    /// Returns the steps to the capture under best play. `None` if K is too short.
    pub fn capture_in(&self, both: Position) -> Option<u32> {
        let steps = self.capture_in[self.game.pair(both)];
        (steps != NEVER).then_some(u32::from(steps))
    }

    /// Returns the largest ρ(¬ψ) an ado can reach: 1 − d_man at its least.
    pub fn robustness(&self, both: Position) -> f64 {
        let fine = f64::from(self.closest[self.game.pair(both)]);
        1.0 - fine / f64::from(self.game.arena.refine)
    }

    /// Returns the action that captures soonest. Ties go to the lowest index.
    pub fn act(&self, both: Position) -> usize {
        usize::from(self.best[self.game.pair(both)])
    }
}

/// Error: two positions have equal observations and need different actions.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the ado's observation is the same at {0:?} and {1:?}, where different actions are due")]
pub struct Indistinct(pub Position, pub Position);

/// A rule over positions, wrapped as a policy over the ado's observation.
///
/// The lookup uses only observed numbers that follow from the positions. An
/// observation of no known position gets the neutral action.
pub struct PositionPolicy {
    positional: Vec<bool>,
    neutral: usize,
    rows: HashMap<Vec<u32>, (usize, f32)>,
}

impl PositionPolicy {
    /// Tabulates `rule`: action and value V for every position of the world.
    ///
    /// # Errors
    /// Two positions look the same and their actions differ.
    pub fn new(
        world: &GridWorld,
        mut rule: impl FnMut(Position) -> (usize, f64),
    ) -> Result<PositionPolicy, Indistinct> {
        let mut policy = PositionPolicy {
            positional: world.positional(),
            neutral: world.spaces().neutral,
            rows: HashMap::new(),
        };
        let mut seen: HashMap<Vec<u32>, Position> = HashMap::new();
        let mut scene = world.scene();
        let mut obs = vec![0.0; world.spaces().observation];
        for both in world.spec().arena.starts() {
            scene.observe_at(both, 0, &mut obs);
            let key = policy.key(&obs);
            let (action, value) = rule(both);
            match policy.rows.get(&key) {
                Some((other, _)) if *other != action => {
                    return Err(Indistinct(seen[&key], both));
                }
                Some(_) => {}
                None => {
                    policy.rows.insert(key.clone(), (action, value as f32));
                    seen.insert(key, both);
                }
            }
        }
        Ok(policy)
    }

    /// Returns the best ado of a world, with V* in units of its reward.
    ///
    /// # Errors
    /// Two positions that need different actions have the same observation.
    pub fn optimal(
        world: &GridWorld,
        reward: impl Fn(f64) -> f64,
    ) -> Result<PositionPolicy, Indistinct> {
        let solution = Game::of(world).solve();
        PositionPolicy::new(world, |both| {
            (solution.act(both), reward(solution.robustness(both)))
        })
    }

    fn key(&self, obs: &[f32]) -> Vec<u32> {
        let pairs = obs.iter().zip(&self.positional);
        pairs
            .filter(|(_, positional)| **positional)
            // Bits and not values: floats are no hash keys, and equal positions
            // give equal bits.
            .map(|(value, _)| value.to_bits())
            .collect()
    }
}

impl Policy for PositionPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        let row = self.rows.get(&self.key(obs));
        row.map_or(self.neutral, |(action, _)| *action)
    }

    fn value(&self, obs: &[f32]) -> f32 {
        let row = self.rows.get(&self.key(obs));
        row.map_or(0.0, |(_, value)| *value)
    }
}
