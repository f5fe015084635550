//! The exact solution of the grid world by backward induction.
//!
//! The ego is deterministic, so the game is a shortest-path problem of the ado
//! over ordered pairs of cells. What is solved is ψ_ego = `always[0, K]
//! (d_man >= 1)` under unit moves: both shipped grid worlds.
//!
//! ```
//! use brakecheck::scene::grid::exact::{Game, UNIT_MOVES};
//! use brakecheck::scene::grid::{Arena, AtWall};
//!
//! let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::FirstInMap };
//! let solution = Game { arena, steps: 8, moves: UNIT_MOVES.to_vec() }.solve();
//! assert_eq!(solution.captures(), 240);
//! assert_eq!(solution.starts(), 240);
//! ```

use std::collections::HashMap;

use super::{Arena, GridWorld, Position};
use crate::rl::Policy;

/// Up, down, left, right, stay.
pub const UNIT_MOVES: [(i32, i32); 5] = [(0, 1), (0, -1), (-1, 0), (1, 0), (0, 0)];

/// Marks a pair of cells from which the ado never captures.
const NEVER: u16 = u16::MAX;

/// What is played: map, horizon K and the ado's moves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Game {
    /// The map and the ego.
    pub arena: Arena,
    /// K.
    pub steps: u32,
    /// The ado's moves, by action.
    pub moves: Vec<(i32, i32)>,
}

/// The best an ado can do from every pair of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    game: Game,
    /// Steps to the capture under best play, within K.
    capture_in: Vec<u16>,
    /// Least Manhattan distance ever reached within K, in fine cells.
    closest: Vec<u16>,
    /// The action that captures soonest, else comes closest.
    best: Vec<u8>,
}

impl Game {
    /// The game of a grid world.
    pub fn of(world: &GridWorld) -> Game {
        let spec = world.spec();
        Game {
            arena: spec.arena,
            steps: spec.steps(),
            moves: spec.moves.clone(),
        }
    }

    /// Ordered pairs of cells, the same cell twice included.
    pub fn pairs(&self) -> usize {
        self.arena.cells() * self.arena.cells()
    }

    /// The pair of a number, below [`Game::pairs`].
    pub fn position(&self, pair: usize) -> Position {
        let cells = self.arena.cells();
        Position {
            ego: self.arena.cell(pair / cells),
            ado: self.arena.cell(pair % cells),
        }
    }

    /// The number of a pair, below [`Game::pairs`].
    pub fn pair(&self, both: Position) -> usize {
        self.arena.index(both.ego) * self.arena.cells() + self.arena.index(both.ado)
    }

    /// Successors of every pair, action by action.
    pub(super) fn successors(&self) -> Vec<u32> {
        let pairs = (0..self.pairs()).flat_map(|pair| {
            let both = self.position(pair);
            let next = move |step: &(i32, i32)| self.pair(self.arena.next(both, *step)) as u32;
            self.moves.iter().map(next)
        });
        pairs.collect()
    }

    /// Solves it: K sweeps over all pairs.
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
            let before = closest.clone();
            for pair in 0..self.pairs() {
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

    /// Probability that uniformly random actions capture, for every start.
    ///
    /// The sum is the expected count.
    pub fn random_captures(&self) -> Vec<f64> {
        let chance = self.random_chances();
        let starts = self.arena.starts();
        starts.map(|both| chance[self.pair(both)]).collect()
    }

    /// The same for every pair of cells: exact, by backward induction.
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

    /// Whether a fixed rule captures from a start within K steps.
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

    /// How many starts a table of one action per pair of cells captures.
    ///
    /// `action` is asked once per pair, in order of the pairs.
    pub fn table_captures(&self, mut action: impl FnMut() -> usize) -> usize {
        let table: Vec<usize> = (0..self.pairs()).map(|_| action()).collect();
        let captured = |start: &Position| self.captures(*start, |both| table[self.pair(both)]);
        self.arena.starts().filter(captured).count()
    }
}

/// A two-line hunter: a step along the larger axis towards where the ego is.
///
/// Ties go to the horizontal axis. Falls back to action 0 if the game lacks
/// the move.
pub fn chase(both: Position, moves: &[(i32, i32)]) -> usize {
    let (dx, dy) = (both.ego.x - both.ado.x, both.ego.y - both.ado.y);
    let wanted = match dy.abs() <= dx.abs() {
        true => (dx.signum(), 0),
        false => (0, dy.signum()),
    };
    moves.iter().position(|step| *step == wanted).unwrap_or(0)
}

impl Solution {
    /// Starts of the game.
    pub fn starts(&self) -> usize {
        self.game.arena.starts().count()
    }

    /// Starts from which the best ado captures within K.
    pub fn captures(&self) -> usize {
        let starts = self.game.arena.starts();
        starts
            .filter(|both| self.capture_in(*both).is_some())
            .count()
    }

    /// Steps to the capture under best play; `None` if K is too short.
    pub fn capture_in(&self, both: Position) -> Option<u32> {
        let steps = self.capture_in[self.game.pair(both)];
        (steps != NEVER).then_some(u32::from(steps))
    }

    /// Largest ρ(¬ψ) that an ado can reach from here: 1 − d_man at its least.
    pub fn robustness(&self, both: Position) -> f64 {
        let fine = f64::from(self.closest[self.game.pair(both)]);
        1.0 - fine / f64::from(self.game.arena.refine)
    }

    /// The action that captures soonest; ties go to the lowest index.
    pub fn act(&self, both: Position) -> usize {
        usize::from(self.best[self.game.pair(both)])
    }
}

/// Two positions that a policy of the observation cannot tell apart.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the ado's observation is the same at {0:?} and {1:?}, where different actions are due")]
pub struct Indistinct(pub Position, pub Position);

/// A rule over positions, as a policy of what the ado observes.
///
/// Of the observed numbers only those count that follow from the positions;
/// an observation that belongs to no position gets the neutral action.
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

    /// The best ado of a world, with V* in units of its reward.
    ///
    /// # Errors
    /// The observation does not tell positions apart that need it.
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
