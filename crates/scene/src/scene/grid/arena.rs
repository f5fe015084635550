//! Map and moves of the grid game.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A fine cell: column from the left, row from the bottom, both from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// Column.
    pub x: i32,
    /// Row.
    pub y: i32,
}

impl Cell {
    /// Returns the Manhattan distance |Δx| + |Δy|, in fine cells.
    pub fn manhattan(self, other: Cell) -> i32 {
        (self.x - other.x).abs() + (self.y - other.y).abs()
    }

    fn moved(self, dx: i32, dy: i32) -> Cell {
        Cell {
            x: self.x + dx,
            y: self.y + dy,
        }
    }
}

/// Cells of both agents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Position {
    /// The cell of the ego.
    pub ego: Cell,
    /// The cell of the ado.
    pub ado: Cell,
}

/// Behaviour of the ego when its best move leaves the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub enum AtWall {
    /// The ego stays (reading A).
    Stays,
    /// The ego takes the first direction that stays in the map (reading B).
    FirstInMap,
}

/// Up, down, left, right: the order in which the ego breaks ties.
const DIRECTIONS: [(i32, i32); 4] = [(0, 1), (0, -1), (-1, 0), (1, 0)];

/// A square map and the moves of both agents on it.
///
/// ```
/// use brakecheck_scene::scene::grid::{Arena, Cell, Position};
/// use brakecheck_scene::scene::grid::AtWall;
///
/// let arena = Arena { size: 4, refine: 1, ego_step: 2, at_wall: AtWall::Stays };
/// let both = Position { ego: Cell { x: 1, y: 1 }, ado: Cell { x: 1, y: 0 } };
/// let next = arena.next(both, (0, 1));
/// assert_eq!(next.ego, Cell { x: 1, y: 3 });
/// assert_eq!(next.ado, Cell { x: 1, y: 1 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Arena {
    /// n: cells along each side.
    pub size: u32,
    /// ε: every cell is cut into ε × ε fine cells (RQ5). 1 is the plain map.
    pub refine: u32,
    /// k: fine cells per step of the ego.
    pub ego_step: u32,
    /// Behaviour of the ego at a wall.
    pub at_wall: AtWall,
}

impl Arena {
    /// Returns the number of fine cells along each side.
    pub fn side(&self) -> i32 {
        (self.size * self.refine) as i32
    }

    /// Returns the number of fine cells of the map.
    pub fn cells(&self) -> usize {
        (self.side() * self.side()) as usize
    }

    /// Returns the cell of a number, row by row from the bottom left.
    pub fn cell(&self, index: usize) -> Cell {
        let index = index as i32;
        Cell {
            x: index % self.side(),
            y: index / self.side(),
        }
    }

    /// Returns the number of a cell of the map.
    pub fn index(&self, cell: Cell) -> usize {
        (cell.y * self.side() + cell.x) as usize
    }

    /// Returns whether a cell is on the map.
    pub fn holds(&self, cell: Cell) -> bool {
        let inside = 0..self.side();
        inside.contains(&cell.x) && inside.contains(&cell.y)
    }

    /// Returns whether both are less than one whole cell apart (d_man < 1).
    pub fn touching(&self, both: Position) -> bool {
        both.ego.manhattan(both.ado) < self.refine as i32
    }

    /// Returns all positions an episode may start from: at least one cell apart.
    pub fn starts(&self) -> impl Iterator<Item = Position> + '_ {
        let pairs = (0..self.cells()).flat_map(|ego| (0..self.cells()).map(move |ado| (ego, ado)));
        pairs
            .map(|(ego, ado)| Position {
                ego: self.cell(ego),
                ado: self.cell(ado),
            })
            .filter(|both| !self.touching(*both))
    }

    /// Returns the cell to which the ego moves, given the current position.
    ///
    /// The ego sees the ado's current cell and not its simultaneous move. Of
    /// the four moves of k cells it takes the one that ends farthest from the
    /// ado in Manhattan distance. It ignores walls in this choice and breaks
    /// ties in the order up, down, left, right.
    pub fn ego_moves(&self, both: Position) -> Cell {
        let step = self.ego_step as i32;
        let target = |(dx, dy)| both.ego.moved(step * dx, step * dy);
        let mut best = both.ego;
        // Below every distance, so the first direction always replaces the
        // ego's cell.
        let mut farthest = -1;
        for direction in DIRECTIONS {
            let distance = target(direction).manhattan(both.ado);
            // Strictly farther: among equal moves the first in `DIRECTIONS`
            // stays chosen.
            if farthest < distance {
                (best, farthest) = (target(direction), distance);
            }
        }
        if self.holds(best) {
            return best;
        }
        match self.at_wall {
            AtWall::Stays => both.ego,
            AtWall::FirstInMap => {
                // Paper: the move off the map is left open; here reading B
                // takes the first direction inside it, whatever its distance.
                let mut targets = DIRECTIONS.into_iter().map(target);
                targets.find(|cell| self.holds(*cell)).unwrap_or(both.ego)
            }
        }
    }

    /// Returns the ado's next cell for a move in whole cells. Walls block it.
    pub fn ado_moves(&self, ado: Cell, step: (i32, i32)) -> Cell {
        let (dx, dy) = step;
        let refine = self.refine as i32;
        let target = ado.moved(refine * dx, refine * dy);
        if self.holds(target) { target } else { ado }
    }

    /// Returns the position after both moved at once. A swap is no capture.
    pub fn next(&self, both: Position, step: (i32, i32)) -> Position {
        Position {
            ego: self.ego_moves(both),
            ado: self.ado_moves(both.ado, step),
        }
    }
}
