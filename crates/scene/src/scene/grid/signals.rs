//! Signals of a grid scene: their catalogue and their sources.
//!
//! A cell is one unit long and a step takes one second. Observations are scaled
//! by ranges that do not depend on the size of the map, so an observation means
//! the same on every map.

use super::arena::{Arena, Cell, Position};
use super::spec::GridSpec;
use crate::trace::Signal;

/// Agent to which a quantity belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    Ego,
    Ado,
}

/// Source of a published value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Time,
    TimeLeft,
    X(Who),
    Y(Who),
    Column(Who),
    Row(Who),
    Speed(Who),
    Up(Who),
    Down(Who),
    Left(Who),
    Right(Who),
    AwayX,
    AwayY,
    Manhattan,
    Captured,
    BehindX,
    BehindY,
    EgoStep,
    Size,
}

impl Source {
    /// Returns whether the value follows from the current position alone.
    pub(super) fn is_positional(self) -> bool {
        // Times need the step, and speeds the position before.
        !matches!(self, Source::Time | Source::TimeLeft | Source::Speed(_))
    }
}

/// A signal that can be published, with the range by which it is observed.
#[derive(Clone, Debug)]
pub struct GridSignalSource {
    /// Declaration of the signal.
    pub signal: Signal,
    /// Usual range, by which observations are scaled.
    pub range: (f64, f64),
    /// True if every trace holds it. Otherwise it is published when mentioned.
    pub always: bool,
    pub(super) source: Source,
}

/// Cells that fill the range of an observed length.
const USUAL_CELLS: f64 = 4.0;

/// Range by which lengths are observed.
///
/// It is constant instead of the map's size, so that a policy of one map sees the same
/// numbers on a larger one.
const LENGTH: (f64, f64) = (0.0, USUAL_CELLS);
/// Range by which offsets of both signs are observed.
const OFFSET: (f64, f64) = (-USUAL_CELLS, USUAL_CELLS);

impl GridSignalSource {
    /// Creates a length in cells, which is published when mentioned.
    fn length(name: impl Into<String>, about: &str, source: Source) -> GridSignalSource {
        GridSignalSource::new(Signal::real(name, "cell", about), LENGTH, source)
    }

    fn new(signal: Signal, range: (f64, f64), source: Source) -> GridSignalSource {
        GridSignalSource {
            signal,
            range,
            always: false,
            source,
        }
    }

    /// Makes every trace hold it.
    fn always(self) -> GridSignalSource {
        GridSignalSource {
            always: true,
            ..self
        }
    }

    /// Sets the usual range.
    fn within(self, range: (f64, f64)) -> GridSignalSource {
        GridSignalSource { range, ..self }
    }
}

impl GridSpec {
    /// Returns every signal this scene can publish, except derived ones.
    pub fn catalogue(&self) -> Vec<GridSignalSource> {
        // Traces have their columns in this order, and kept files the traces.
        let mut all = Vec::from(self.clock_signals());
        all.extend(agent_signals("ego", Who::Ego));
        all.extend(agent_signals("ado", Who::Ado));
        all.extend(speed_signals());
        all.extend(pair_signals());
        all.extend(map_signals());
        all
    }

    fn clock_signals(&self) -> [GridSignalSource; 2] {
        let steps = (0.0, f64::from(self.steps()));
        let time = Signal::real("time", "s", "steps taken, one second each");
        let time_left = Signal::real("time_left", "s", "steps to the horizon");
        [
            GridSignalSource::new(time, steps, Source::Time),
            GridSignalSource::new(time_left, steps, Source::TimeLeft).always(),
        ]
    }

    /// Returns the signals in a trace of this scene, except derived ones.
    pub(super) fn published(&self) -> Vec<GridSignalSource> {
        let mut offers = self.catalogue();
        offers.retain(|offer| offer.always || self.extra.contains(&offer.signal.name));
        offers
    }
}

/// Returns the place of an agent and the free cells around it.
fn agent_signals(name: &str, who: Who) -> [GridSignalSource; 8] {
    let length = |field: &str, about: &str, source: Source| {
        GridSignalSource::length(format!("{name}.{field}"), about, source)
    };
    let column = "column of the whole cell it is in, from 0";
    let row = "row of the whole cell it is in, from 0";
    [
        length("x", "distance from the left wall", Source::X(who)).always(),
        length("y", "distance from the bottom wall", Source::Y(who)).always(),
        length("column", column, Source::Column(who)),
        length("row", row, Source::Row(who)),
        length("up", "free cells above it", Source::Up(who)),
        length("down", "free cells below it", Source::Down(who)),
        length("left", "free cells to its left", Source::Left(who)),
        length("right", "free cells to its right", Source::Right(who)),
    ]
}

fn speed_signals() -> [GridSignalSource; 2] {
    let ado = "‖v‖∞ of the ado: cells moved in the last step along the larger axis";
    let ego = "‖v‖∞ of the ego over the last step";
    let speed = |name: &str, about: &str| Signal::real(name, "cell/s", about);
    [
        // Without an owner in its name, as in the paper's rules, which limit the ado.
        GridSignalSource::new(speed("speed_inf", ado), (0.0, 2.0), Source::Speed(Who::Ado))
            .always(),
        GridSignalSource::new(speed("ego.speed_inf", ego), LENGTH, Source::Speed(Who::Ego)),
    ]
}

/// Returns the place of the ego as the ado sees it.
fn pair_signals() -> [GridSignalSource; 4] {
    let right = "how far the ego is to the right of the ado";
    let above = "how far the ego is above the ado";
    let behind_x = "free cells behind the ego as the ado sees it, along x; to the right if level";
    let behind_y = "free cells behind the ego as the ado sees it, along y; above it if level";
    [
        GridSignalSource::length("away.x", right, Source::AwayX).within(OFFSET),
        GridSignalSource::length("away.y", above, Source::AwayY).within(OFFSET),
        GridSignalSource::length("behind.x", behind_x, Source::BehindX),
        GridSignalSource::length("behind.y", behind_y, Source::BehindY),
    ]
}

/// Returns the constants of the map, and the distance that decides a capture.
fn map_signals() -> [GridSignalSource; 4] {
    let step = "k: cells the ego moves per step";
    let distance = "Manhattan distance of the two";
    let captured = "whether the two are less than one cell apart";
    [
        GridSignalSource::length("ego.step", step, Source::EgoStep),
        GridSignalSource::length("d_man", distance, Source::Manhattan)
            // Both coordinates add up to it.
            .within((0.0, 2.0 * USUAL_CELLS))
            .always(),
        GridSignalSource::length("size", "n: cells along a side", Source::Size).within((0.0, 10.0)),
        GridSignalSource::new(
            Signal::boolean("captured", captured),
            (0.0, 1.0),
            Source::Captured,
        ),
    ]
}

/// Current and previous position of both agents, with the step count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PositionHistory {
    pub(super) now: Position,
    pub(super) before: Position,
    pub(super) step: u32,
    pub(super) steps: u32,
}

impl PositionHistory {
    /// Returns the value of a signal.
    pub(super) fn value(&self, arena: &Arena, source: Source) -> f64 {
        let per_fine = 1.0 / f64::from(arena.refine);
        let cells = |fine: i32| f64::from(fine) * per_fine;
        let whole = |fine: i32| f64::from(fine / arena.refine as i32);
        let last = arena.side() - 1;
        let of = |who: Who| self.cell(who);
        match source {
            Source::Time => f64::from(self.step),
            // A grid scene can be advanced past its horizon, where the time
            // left is 0.
            Source::TimeLeft => f64::from(self.steps.saturating_sub(self.step)),
            // Cells count from 0 at the wall, so a coordinate is the number of free
            // cells before it.
            Source::X(who) | Source::Left(who) => cells(of(who).x),
            Source::Y(who) | Source::Down(who) => cells(of(who).y),
            Source::Up(who) => cells(last - of(who).y),
            Source::Right(who) => cells(last - of(who).x),
            Source::Column(who) => whole(of(who).x),
            Source::Row(who) => whole(of(who).y),
            Source::Speed(who) => {
                let (to, from) = match who {
                    Who::Ego => (self.now.ego, self.before.ego),
                    Who::Ado => (self.now.ado, self.before.ado),
                };
                cells((to.x - from.x).abs().max((to.y - from.y).abs()))
            }
            Source::AwayX => cells(self.now.ego.x - self.now.ado.x),
            Source::AwayY => cells(self.now.ego.y - self.now.ado.y),
            Source::BehindX => {
                if self.value(arena, Source::AwayX) >= 0.0 {
                    self.value(arena, Source::Right(Who::Ego))
                } else {
                    self.value(arena, Source::Left(Who::Ego))
                }
            }
            Source::BehindY => {
                if self.value(arena, Source::AwayY) >= 0.0 {
                    self.value(arena, Source::Up(Who::Ego))
                } else {
                    self.value(arena, Source::Down(Who::Ego))
                }
            }
            Source::EgoStep => cells(arena.ego_step as i32),
            Source::Manhattan => cells(self.now.ego.manhattan(self.now.ado)),
            Source::Captured => f64::from(u8::from(arena.touching(self.now))),
            Source::Size => f64::from(arena.size),
        }
    }

    fn cell(&self, who: Who) -> Cell {
        match who {
            Who::Ego => self.now.ego,
            Who::Ado => self.now.ado,
        }
    }
}
