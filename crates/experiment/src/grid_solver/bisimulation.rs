//! Greatest ε-approximate bisimulation of two grid games (Definition 5).
//!
//! The two games share the size of their map. Either a grid is compared with
//! its refinement, or with the same grid under another ego. Both games are
//! deterministic and have the same actions, so conditions 2 and 3 coincide:
//! under every action the successors of a related pair are related.
//!
//! The distance of two states is the largest difference of a primary or
//! secondary signal: the centres of both cells, d_man, and the ado's speed. The
//! speed belongs to the step that led to the state. All of them count whole
//! cells. A captured position is absorbing, because a contact ends the motion.
//!
//! ```
//! use brakecheck_experiment::grid_solver::bisimulation::Bisimulation;
//! use brakecheck_experiment::grid_solver::exact::{Game, UNIT_MOVES};
//! use brakecheck_scene::scene::grid::Arena;
//! use brakecheck_scene::scene::grid::AtWall;
//!
//! let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::Stays };
//! let coarse = Game { arena, steps: 8, moves: UNIT_MOVES.to_vec() };
//! let fine = Game { arena: Arena { refine: 3, ego_step: 6, ..arena }, ..coarse.clone() };
//! let related = Bisimulation::greatest(&coarse, &fine, 0.4);
//! assert!(0 < related.len() && related.len() < related.candidates());
//! ```

use super::exact::Game;
use crate::scene::grid::{Cell, Position};

/// Tolerance for rounding: distances are multiples of half a fine cell.
const ROUNDING: f64 = 1e-9;
/// Largest product that [`Bisimulation::least_epsilon`] searches, in pairs.
const MOST_CANDIDATES: usize = 20_000_000;

/// A relation between the position pairs of two games.
#[derive(Clone, Debug)]
pub struct Bisimulation {
    first: Game,
    second: Game,
    epsilon: f64,
    /// Per cell of the second map, along one axis: the lowest cell of the first
    /// map within ε.
    lowest: Vec<i32>,
    /// Most cells of the first map within ε of a cell of the second, per axis.
    width: usize,
    /// By pair of the second game, then by the four offsets of the first's cells.
    related: Vec<bool>,
    candidates: usize,
    sweeps: usize,
}

impl Bisimulation {
    /// Computes the greatest ε-approximate bisimulation by fixpoint iteration.
    ///
    /// Starts with every pair of states within ε and drops each pair that some
    /// action leads out of the relation, until nothing changes.
    pub fn greatest(first: &Game, second: &Game, epsilon: f64) -> Bisimulation {
        let mut relation = Bisimulation::within(first, second, epsilon);
        while relation.sweep() {}
        relation
    }

    /// Relates every pair of states within ε: condition 1 alone, no bisimulation.
    pub fn within(first: &Game, second: &Game, epsilon: f64) -> Bisimulation {
        let near = near(first, second, epsilon);
        let width = near.iter().map(|(_, cells)| *cells).max().unwrap_or(0);
        let mut relation = Bisimulation {
            lowest: near.into_iter().map(|(lowest, _)| lowest).collect(),
            width,
            related: vec![false; second.pairs() * width.pow(4)],
            candidates: 0,
            sweeps: 0,
            first: first.clone(),
            second: second.clone(),
            epsilon,
        };
        // A slot stands for offsets on four axes. Slots whose cell is off the
        // map, or that is near on each axis but not in d_man, stay unrelated.
        for slot in 0..relation.related.len() {
            let Some((one, other)) = relation.states(slot) else {
                continue;
            };
            relation.related[slot] = relation.distance(one, other) <= epsilon + ROUNDING;
        }
        relation.candidates = relation.len();
        relation
    }

    /// Returns the least ε up to `most` that relates a start with its coarse start.
    ///
    /// Only distances that occur are tried. The greatest bisimulation must
    /// relate a start of the second game with the same start of the first.
    /// `None` if no such ε exists or the product exceeds the search limit.
    pub fn least_epsilon(first: &Game, second: &Game, most: f64) -> Option<f64> {
        // Centres lie on multiples of half a fine cell of either map, so this
        // unit divides every distance.
        let unit = 0.5 / f64::from(first.arena.refine * second.arena.refine);
        // Without the tolerance, rounding could cut off a `most` that is itself a step.
        let steps = (most / unit + ROUNDING) as u32;
        let mut before = None;
        for epsilon in (0..=steps).map(|i| f64::from(i) * unit) {
            let width = near(first, second, epsilon)
                .into_iter()
                .map(|(_, cells)| cells)
                .max()
                .unwrap_or(0);
            // The table has this many entries, so the check comes before its allocation.
            if width.pow(4).saturating_mul(second.pairs()) > MOST_CANDIDATES {
                return None;
            }
            let within = Bisimulation::within(first, second, epsilon);
            // Equal candidates have an equal fixpoint.
            if before.replace(within.len()) == Some(within.len()) {
                continue;
            }
            let mut relation = within;
            while relation.sweep() {}
            if relation.starts().next().is_some() {
                return Some(epsilon);
            }
        }
        None
    }

    /// Returns ε.
    pub fn epsilon(&self) -> f64 {
        self.epsilon
    }

    /// Returns the number of related pairs of states.
    pub fn len(&self) -> usize {
        self.related.iter().filter(|related| **related).count()
    }

    /// Returns whether no pair is related.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of pairs of states within ε.
    pub fn candidates(&self) -> usize {
        self.candidates
    }

    /// Returns the number of sweeps until nothing changed.
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }

    /// Returns whether a state of the first and one of the second are related.
    pub fn relates(&self, first: Position, second: Position) -> bool {
        let slot = self.slot(first, second);
        slot.is_some_and(|slot| self.related[slot])
    }

    /// Returns the state of the first game whose cells contain those of the second.
    pub fn coarse(&self, second: Position) -> Position {
        coarse(&self.first, &self.second, second)
    }

    /// Returns the starts of the second game that are related to their coarse start.
    pub fn starts(&self) -> impl Iterator<Item = Position> + '_ {
        let starts = self.second.arena.starts();
        starts.filter(|second| {
            let first = self.coarse(*second);
            !self.first.arena.touching(first) && self.relates(first, *second)
        })
    }

    /// Returns whether all related states agree by cell.
    ///
    /// If every related state of the second game lies in the cells of the state
    /// of the first, a policy over cells acts alike in both games.
    pub fn is_by_cell(&self) -> bool {
        let related = (0..self.related.len()).filter(|slot| self.related[*slot]);
        let mut states = related.filter_map(|slot| self.states(slot));
        states.all(|(first, second)| self.coarse(second) == first)
    }

    /// Drops pairs that an action leads out of the relation. True if any was.
    fn sweep(&mut self) -> bool {
        let mut dropped = false;
        for slot in 0..self.related.len() {
            if self.related[slot] && !self.stays(slot) {
                // Dropping at once, and not after the sweep, reaches the same
                // greatest fixpoint in no more sweeps.
                self.related[slot] = false;
                dropped = true;
            }
        }
        self.sweeps += 1;
        dropped
    }

    fn stays(&self, slot: usize) -> bool {
        let Some((first, second)) = self.states(slot) else {
            return false;
        };
        let one = PendingMove::of(&self.first, first);
        let other = PendingMove::of(&self.second, second);
        (0..self.first.moves.len()).all(|action| {
            // The ado's speed is a signal of the successor, so it is compared
            // here and not in `distance`.
            let (first, speed) = one.take(action);
            let (second, other_speed) = other.take(action);
            (speed - other_speed).abs() <= self.epsilon + ROUNDING && self.relates(first, second)
        })
    }

    /// Sup norm over positions and d_man, in whole cells.
    fn distance(&self, first: Position, second: Position) -> f64 {
        let axes = [
            (first.ego.x, second.ego.x),
            (first.ego.y, second.ego.y),
            (first.ado.x, second.ado.x),
            (first.ado.y, second.ado.y),
        ];
        let apart = |(cell, fine)| centres_apart(&self.first, &self.second, cell, fine);
        // Each game counts its own fine cells, so both are brought to whole cells.
        let manhattan = |game: &Game, both: Position| {
            f64::from(both.ego.manhattan(both.ado)) / f64::from(game.arena.refine)
        };
        let apart = axes.map(apart).into_iter().fold(0.0, f64::max);
        let d_man = manhattan(&self.first, first) - manhattan(&self.second, second);
        apart.max(d_man.abs())
    }

    fn states(&self, slot: usize) -> Option<(Position, Position)> {
        let second = self.second.position(slot / self.width.pow(4));
        let mut offsets = slot % self.width.pow(4);
        // The order of these calls is that of the digits in `slot`, lowest
        // first.
        let mut along = |fine: i32| {
            let offset = offsets % self.width;
            offsets /= self.width;
            self.lowest[fine as usize] + offset as i32
        };
        let mut cell = |at: Cell| Cell {
            x: along(at.x),
            y: along(at.y),
        };
        let first = Position {
            ego: cell(second.ego),
            ado: cell(second.ado),
        };
        let on_map = self.first.arena.holds(first.ego) && self.first.arena.holds(first.ado);
        on_map.then_some((first, second))
    }

    fn slot(&self, first: Position, second: Position) -> Option<usize> {
        // Highest digit first: the reverse of the order in `states`.
        let axes = [
            (first.ado.y, second.ado.y),
            (first.ado.x, second.ado.x),
            (first.ego.y, second.ego.y),
            (first.ego.x, second.ego.x),
        ];
        let mut slot = 0;
        for (cell, fine) in axes {
            let offset = usize::try_from(cell - self.lowest[fine as usize]).ok()?;
            // A cell at the border has fewer cells within ε than the widest window. Its
            // spare slots hold cells beyond ε, which `within` never relates.
            if self.width <= offset {
                return None;
            }
            slot = slot * self.width + offset;
        }
        Some(self.second.pair(second) * self.width.pow(4) + slot)
    }
}

/// Returns the state of the coarser game whose cells contain a finer state.
pub fn coarse(first: &Game, second: &Game, both: Position) -> Position {
    let along = |fine: i32| {
        // Doubled, so that the middle of a fine cell is an integer and no
        // division rounds a border cell into its neighbour.
        let middle = (2 * fine + 1) * first.arena.refine as i32;
        middle / (2 * second.arena.refine as i32)
    };
    let cell = |at: Cell| Cell {
        x: along(at.x),
        y: along(at.y),
    };
    Position {
        ego: cell(both.ego),
        ado: cell(both.ado),
    }
}

/// Returns, per cell of the second map, the cells of the first within ε.
///
/// Along one axis: the lowest such cell and their number.
fn near(first: &Game, second: &Game, epsilon: f64) -> Vec<(i32, usize)> {
    let within = |fine: i32| {
        let cells = 0..first.arena.side();
        cells.filter(move |cell| centres_apart(first, second, *cell, fine) <= epsilon + ROUNDING)
    };
    let axis = 0..second.arena.side();
    // Cells within ε of a centre are consecutive, so the lowest and their number suffice.
    axis.map(|fine| (within(fine).next().unwrap_or(0), within(fine).count()))
        .collect()
}

/// Returns the distance of two cell centres along an axis, in whole cells.
fn centres_apart(first: &Game, second: &Game, cell: i32, fine: i32) -> f64 {
    let centre = |game: &Game, cell: i32| (f64::from(cell) + 0.5) / f64::from(game.arena.refine);
    (centre(first, cell) - centre(second, fine)).abs()
}

/// A state about to move. The ego's move is the same under every action.
struct PendingMove<'a> {
    game: &'a Game,
    both: Position,
    ego: Cell,
    captured: bool,
}

impl<'a> PendingMove<'a> {
    fn of(game: &'a Game, both: Position) -> PendingMove<'a> {
        PendingMove {
            game,
            both,
            ego: game.arena.ego_moves(both),
            captured: game.arena.touching(both),
        }
    }

    /// Returns the successor and the ado's speed. A captured state stays.
    fn take(&self, action: usize) -> (Position, f64) {
        if self.captured {
            return (self.both, 0.0);
        }
        let ado = self
            .game
            .arena
            .ado_moves(self.both.ado, self.game.moves[action]);
        let (dx, dy) = (ado.x - self.both.ado.x, ado.y - self.both.ado.y);
        let speed = f64::from(dx.abs().max(dy.abs())) / f64::from(self.game.arena.refine);
        (Position { ego: self.ego, ado }, speed)
    }
}
