//! Dynamics of the grid game, and how often untrained ados capture in it.
//!
//! Capture is contact here, and no rule counts. [`super::game_graph`] has the game with
//! its specification and its rules.
//!
//! ```
//! use brakecheck_experiment::grid_solver::exact::{Game, UNIT_MOVES, chase};
//! use brakecheck_scene::scene::grid::Arena;
//! use brakecheck_scene::scene::grid::AtWall;
//!
//! let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::FirstInMap };
//! let game = Game { arena, steps: 8, moves: UNIT_MOVES.to_vec() };
//! let chased = |both: &_| game.captures(*both, |both| chase(both, &game.moves));
//! assert_eq!(arena.starts().filter(chased).count(), 20);
//! ```

use crate::scene::grid::{Arena, GridWorld, Position};

/// The moves up, down, left, right and stay.
pub const UNIT_MOVES: [(i32, i32); 5] = [(0, 1), (0, -1), (-1, 0), (1, 0), (0, 0)];

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
    fn successors(&self) -> Vec<u32> {
        let pairs = (0..self.pairs()).flat_map(|pair| {
            let both = self.position(pair);
            let next = move |step: &(i32, i32)| self.pair(self.arena.next(both, *step)) as u32;
            self.moves.iter().map(next)
        });
        pairs.collect()
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
            // Each pass reads the chances with one step fewer left.
            let before = chance.clone();
            // A capture is absorbing, so pairs in contact keep their chance of 1.
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
            // Before the move, because a start may be in contact already.
            if self.arena.touching(both) {
                return true;
            }
            both = self.arena.next(both, self.moves[act(both)]);
        }
        // The last move may capture as well.
        self.arena.touching(both)
    }

    /// Counts the starts that a table of one action per pair of cells captures.
    ///
    /// `action` is called once per pair, in order of the pairs.
    pub fn table_captures(&self, mut action: impl FnMut() -> usize) -> usize {
        // Filled before any start is played, so that the calls of `action` do not depend
        // on the captures.
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
