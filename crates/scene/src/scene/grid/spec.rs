//! Data of a grid world: checked, without spans.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::arena::{Arena, AtWall, Cell, Position};
use crate::scene::{Axis, Clock, Derived, Observed, Start};
use crate::stl::Constants;

/// Number of steps of an episode, K in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Horizon {
    /// A fixed number of steps.
    Steps(u32),
    /// A number of steps per cell along a side: `PerSize(2)` is K = 2n.
    PerSize(u32),
}

impl Horizon {
    /// Returns K on a map of `size` cells a side.
    pub fn steps(self, size: u32) -> u32 {
        match self {
            Horizon::Steps(steps) => steps,
            // A file may name any factor, and a huge one must be refused instead of
            // wrapped.
            Horizon::PerSize(per_cell) => per_cell.saturating_mul(size),
        }
    }
}

/// Set of starts X_init.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Starts {
    /// Every ordered pair of cells at least one cell apart, each once.
    #[default]
    AllPairs,
    /// The same pairs, drawn at random and never listed.
    Uniform,
    /// Listed pairs: `[((ego_x, ego_y), (ado_x, ado_y)), …]` in fine cells.
    Pairs(Vec<((i32, i32), (i32, i32))>),
}

/// A grid world, assembled from data.
#[derive(Clone, Debug)]
pub struct GridSpec {
    /// Name of the world, which is part of the key of every start.
    pub world: String,
    /// The map and the ego.
    pub arena: Arena,
    /// Horizon K.
    pub horizon: Horizon,
    /// The ado's actions: cells to the right and up.
    pub moves: Vec<(i32, i32)>,
    /// The action that stays.
    pub neutral: usize,
    /// Set of starts X_init.
    pub starts: Starts,
    /// Signals published besides the basic ones, by name.
    pub extra: Vec<String>,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ado's observation.
    pub observe: Vec<Observed>,
}

impl GridSpec {
    /// Returns the clocks: a step is one sample, one decision and one second.
    pub fn clock(&self) -> Clock {
        Clock {
            horizon_s: f64::from(self.steps()),
            decision_s: 1.0,
            sample_s: 1.0,
            substeps: 1,
        }
    }

    /// Returns the number of steps K.
    pub fn steps(&self) -> u32 {
        self.horizon.steps(self.arena.size)
    }

    /// Returns an action in words.
    pub fn action_label(&self, action: usize) -> String {
        match self.moves[action] {
            (0, 0) => "stay".to_owned(),
            (0, 1) => "up".to_owned(),
            (0, -1) => "down".to_owned(),
            (-1, 0) => "left".to_owned(),
            (1, 0) => "right".to_owned(),
            (right, up) => format!("({right:+}, {up:+})"),
        }
    }

    /// Returns the axes of X_init: both positions, in fine cells.
    pub fn axes(&self) -> Vec<Axis> {
        let names = ["ego.x", "ego.y", "ado.x", "ado.y"];
        names.map(|name| self.axis(name)).into()
    }

    fn axis(&self, name: &str) -> Axis {
        Axis {
            name: name.to_owned(),
            unit: "fine cell",
            lo: 0.0,
            hi: f64::from(self.arena.side() - 1),
        }
    }

    /// Returns all starts, or `None` if they are drawn and not listed.
    pub fn all_starts(&self) -> Option<Vec<Start>> {
        match &self.starts {
            Starts::AllPairs => Some(self.arena.starts().map(start_of).collect()),
            Starts::Uniform => None,
            Starts::Pairs(pairs) => {
                let starts = pairs
                    .iter()
                    .map(|(ego, ado)| start_of(position(*ego, *ado)));
                Some(starts.collect())
            }
        }
    }
}

/// Returns the position of both agents at cells (x, y), as a world file writes them.
pub fn position(ego: (i32, i32), ado: (i32, i32)) -> Position {
    let cell = |(x, y)| Cell { x, y };
    Position {
        ego: cell(ego),
        ado: cell(ado),
    }
}

/// Converts a position to a start.
pub fn start_of(both: Position) -> Start {
    let Position { ego, ado } = both;
    Start([ego.x, ego.y, ado.x, ado.y].map(f64::from).into())
}

/// Converts a start to a position, rounded to cells of the map.
///
/// Missing values are 0, and values outside the map are moved to its border.
pub fn position_of(start: &Start, arena: &Arena) -> Position {
    let highest = f64::from(arena.side() - 1);
    let at = |i: usize| {
        let value = start.0.get(i).copied().unwrap_or(0.0);
        // A perturbed start may lie between cells or off the map.
        value.round().clamp(0.0, highest) as i32
    };
    Position {
        ego: Cell { x: at(0), y: at(1) },
        ado: Cell { x: at(2), y: at(3) },
    }
}

/// Names of the wall rules, after the readings of the paper's text.
impl AtWall {
    /// Returns the letter of the reading in docs/background/paper.md.
    pub fn reading(self) -> char {
        match self {
            AtWall::Stays => 'A',
            AtWall::FirstInMap => 'B',
        }
    }
}
