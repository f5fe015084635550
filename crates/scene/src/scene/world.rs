//! Worlds of either kind, which build scenes and know their shapes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use strum::Display;

use super::drive::DriveWorld;
use super::grid::GridWorld;
use super::{Axis, Clock, Scene, Start};
use crate::rl::Spaces;
use crate::sim::PlantKind;
use crate::trace::{Schema, Signal};

/// An assembled world: builds scenes that share all fixed data.
#[derive(Clone)]
pub enum World {
    /// Cars on a road.
    #[doc(hidden)]
    Drive(DriveWorld),
    /// Cells on a map.
    #[doc(hidden)]
    Grid(GridWorld),
}

/// Dynamics of a world. Rows have their names, and texts have them in lower case.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[strum(serialize_all = "lowercase")]
pub enum Dynamics {
    /// 3D rigid bodies.
    Rigid,
    /// 2D, closed form.
    Kinematic,
    /// Cells of a grid, with a whole move per step.
    Cells,
}

impl From<PlantKind> for Dynamics {
    fn from(plant: PlantKind) -> Dynamics {
        match plant {
            PlantKind::Rigid => Dynamics::Rigid,
            PlantKind::Kinematic => Dynamics::Kinematic,
        }
    }
}

impl Dynamics {
    /// Returns the plant of a driving world, or `None` for a grid.
    pub fn plant(self) -> Option<PlantKind> {
        match self {
            Dynamics::Rigid => Some(PlantKind::Rigid),
            Dynamics::Kinematic => Some(PlantKind::Kinematic),
            Dynamics::Cells => None,
        }
    }
}

/// Condition under which traces hold a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Availability {
    /// Recorded always, or because the world mentions it.
    Recorded,
    /// Recorded only if a world mentions it.
    OnDemand,
    /// Computed from other signals by the world file.
    Derived,
}

impl Availability {
    /// Returns the word used in listings.
    pub fn word(self) -> &'static str {
        match self {
            Availability::Recorded => "recorded",
            Availability::OnDemand => "on demand",
            Availability::Derived => "derived",
        }
    }
}

/// An observed signal with its fixed scale: `(value − mid) / half`.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Name of the signal.
    pub name: String,
    /// Middle of the declared range.
    pub mid: f64,
    /// Half of the declared range.
    pub half: f64,
}

impl Observed {
    /// Returns the observation of a value: −1 to 1 within the declared range.
    pub fn scaled(&self, value: f64) -> f32 {
        // A product with the reciprocal, as scenes compute it: a division could
        // round differently, and served ados must see the same bits.
        ((value - self.mid) * self.per_half()) as f32
    }

    /// Returns the factor applied to the distance from the middle.
    pub(super) fn per_half(&self) -> f64 {
        1.0 / self.half
    }
}

/// A derived signal: an expression over published ones.
#[derive(Clone, Debug)]
pub struct Derived {
    /// Declaration of the signal.
    pub signal: Signal,
    /// Expression of its value.
    pub expr: crate::stl::Expr,
}

impl Derived {
    /// Returns the signal with other names of itself and of those it mentions.
    pub fn renamed(&self, new: &dyn Fn(&str) -> Option<String>) -> Derived {
        let Signal {
            name, unit, about, ..
        } = &self.signal;
        let name = new(name).unwrap_or_else(|| name.to_string());
        Derived {
            signal: Signal::real(name, unit.to_string(), about.to_string()),
            expr: self.expr.renamed(new),
        }
    }
}

impl World {
    /// Returns the clocks.
    pub fn clock(&self) -> &Clock {
        match self {
            World::Drive(world) => &world.spec().clock,
            World::Grid(world) => world.clock(),
        }
    }

    /// Returns the signals of its traces.
    pub fn schema(&self) -> &Arc<Schema> {
        match self {
            World::Drive(world) => world.schema(),
            World::Grid(world) => world.schema(),
        }
    }

    /// Returns the shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        match self {
            World::Drive(world) => world.spaces(),
            World::Grid(world) => world.spaces(),
        }
    }

    /// Returns a scene at rest. Call `reset` before use.
    pub fn scene(&self) -> Box<dyn Scene> {
        match self {
            World::Drive(world) => Box::new(world.scene()),
            World::Grid(world) => Box::new(world.scene()),
        }
    }

    /// Returns the axes of X_init.
    pub fn axes(&self) -> Vec<Axis> {
        match self {
            World::Drive(world) => world.spec().axes(),
            World::Grid(world) => world.spec().axes(),
        }
    }

    /// Returns the dynamics of this world.
    pub fn dynamics(&self) -> Dynamics {
        match self {
            World::Drive(world) => world.spec().plant.into(),
            World::Grid(_) => Dynamics::Cells,
        }
    }

    /// Returns a joint action in words.
    pub fn action_label(&self, action: usize) -> String {
        match self {
            World::Drive(world) => world.spec().action_label(action),
            World::Grid(world) => world.spec().action_label(action),
        }
    }

    /// Returns the distance of two joint actions, 0 to 1.
    ///
    /// On a grid, equal moves have distance 0 and all others 1.
    pub fn action_distance(&self, a: usize, b: usize) -> f64 {
        match self {
            World::Drive(world) => world.spec().action_distance(a, b),
            World::Grid(_) => f64::from(u8::from(a != b)),
        }
    }

    /// Returns every signal that formulas may use, including derived ones.
    pub fn signals(&self) -> Vec<(Signal, Availability)> {
        match self {
            World::Drive(world) => {
                let spec = world.spec();
                let offers = spec
                    .catalogue()
                    .into_iter()
                    .map(|offer| (offer.signal, offer.always));
                listed(offers, &spec.extra, &spec.derived)
            }
            World::Grid(world) => {
                let spec = world.spec();
                let offers = spec
                    .catalogue()
                    .into_iter()
                    .map(|offer| (offer.signal, offer.always));
                listed(offers, &spec.extra, &spec.derived)
            }
        }
    }

    /// Returns the signals of the ados' observation with their scales.
    pub fn observed(&self) -> &[Observed] {
        match self {
            World::Drive(world) => &world.spec().observe,
            World::Grid(world) => &world.spec().observe,
        }
    }

    /// Returns all starts of a finite world, each once, or `None`.
    pub fn starts(&self) -> Option<Vec<Start>> {
        match self {
            World::Drive(world) => {
                let points = &world.spec().points;
                (!points.is_empty()).then(|| points.clone())
            }
            World::Grid(world) => world.spec().all_starts(),
        }
    }
}

fn listed(
    offers: impl Iterator<Item = (Signal, bool)>,
    extra: &[String],
    derived: &[Derived],
) -> Vec<(Signal, Availability)> {
    let published = offers.map(|(signal, always)| {
        // `extra` lists the signals that formulas, plans or observations
        // mention.
        let held = if always || extra.contains(&signal.name) {
            Availability::Recorded
        } else {
            Availability::OnDemand
        };
        (signal, held)
    });
    let others = derived
        .iter()
        .map(|derived| (derived.signal.clone(), Availability::Derived));
    published.chain(others).collect()
}
