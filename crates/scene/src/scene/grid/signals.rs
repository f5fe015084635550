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

impl GridSpec {
    /// Returns every signal this scene can publish, except derived ones.
    pub fn catalogue(&self) -> Vec<GridSignalSource> {
        let steps = f64::from(self.steps());
        // Constant instead of the map's size: a policy of one map then sees the
        // same numbers on a larger one.
        let length = (0.0, USUAL_CELLS);
        let offset = (-USUAL_CELLS, USUAL_CELLS);
        let mut offers = Vec::new();
        let mut offer = |name: &str, unit, about: &str, range, always, source| {
            offers.push(GridSignalSource {
                signal: Signal::real(name, unit, about),
                range,
                always,
                source,
            });
        };
        offer(
            "time",
            "s",
            "steps taken, one second each",
            (0.0, steps),
            false,
            Source::Time,
        );
        offer(
            "time_left",
            "s",
            "steps to the horizon",
            (0.0, steps),
            true,
            Source::TimeLeft,
        );
        for (name, who) in [("ego", Who::Ego), ("ado", Who::Ado)] {
            let at = |field: &str| format!("{name}.{field}");
            offer(
                &at("x"),
                "cell",
                "distance from the left wall",
                length,
                true,
                Source::X(who),
            );
            offer(
                &at("y"),
                "cell",
                "distance from the bottom wall",
                length,
                true,
                Source::Y(who),
            );
            offer(
                &at("column"),
                "cell",
                "column of the whole cell it is in, from 0",
                length,
                false,
                Source::Column(who),
            );
            offer(
                &at("row"),
                "cell",
                "row of the whole cell it is in, from 0",
                length,
                false,
                Source::Row(who),
            );
            for (field, about, source) in [
                ("up", "free cells above it", Source::Up(who)),
                ("down", "free cells below it", Source::Down(who)),
                ("left", "free cells to its left", Source::Left(who)),
                ("right", "free cells to its right", Source::Right(who)),
            ] {
                offer(&at(field), "cell", about, length, false, source);
            }
        }
        offer(
            "speed_inf",
            "cell/s",
            "‖v‖∞ of the ado: cells moved in the last step along the larger axis",
            (0.0, 2.0),
            true,
            Source::Speed(Who::Ado),
        );
        offer(
            "ego.speed_inf",
            "cell/s",
            "‖v‖∞ of the ego over the last step",
            length,
            false,
            Source::Speed(Who::Ego),
        );
        offer(
            "away.x",
            "cell",
            "how far the ego is to the right of the ado",
            offset,
            false,
            Source::AwayX,
        );
        offer(
            "away.y",
            "cell",
            "how far the ego is above the ado",
            offset,
            false,
            Source::AwayY,
        );
        offer(
            "behind.x",
            "cell",
            "free cells behind the ego as the ado sees it, along x; to the right if level",
            length,
            false,
            Source::BehindX,
        );
        offer(
            "behind.y",
            "cell",
            "free cells behind the ego as the ado sees it, along y; above it if level",
            length,
            false,
            Source::BehindY,
        );
        offer(
            "ego.step",
            "cell",
            "k: cells the ego moves per step",
            length,
            false,
            Source::EgoStep,
        );
        offer(
            "d_man",
            "cell",
            "Manhattan distance of the two",
            (0.0, 2.0 * USUAL_CELLS),
            true,
            Source::Manhattan,
        );
        offer(
            "size",
            "cell",
            "n: cells along a side",
            (0.0, 10.0),
            false,
            Source::Size,
        );
        offers.push(GridSignalSource {
            signal: Signal::boolean("captured", "whether the two are less than one cell apart"),
            range: (0.0, 1.0),
            always: false,
            source: Source::Captured,
        });
        offers
    }

    /// Returns the signals in a trace of this scene, except derived ones.
    pub(super) fn published(&self) -> Vec<GridSignalSource> {
        let mut offers = self.catalogue();
        offers.retain(|offer| offer.always || self.extra.contains(&offer.signal.name));
        offers
    }
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
