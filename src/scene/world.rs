//! A world of any kind: what makes its scenes and knows its shapes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::drive::DriveWorld;
use super::grid::GridWorld;
use super::{Axis, Clock, Scene, Start};
use crate::rl::Spaces;
use crate::sim::PlantKind;
use crate::trace::{Schema, Signal};

/// An assembled world: makes scenes that share everything fixed.
#[derive(Clone)]
pub enum World {
    /// Cars on a road.
    Drive(DriveWorld),
    /// Cells on a map.
    Grid(GridWorld),
}

/// What moves a world, as rows and files name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Dynamics {
    /// 3D rigid bodies.
    Rigid,
    /// 2D, closed form.
    Kinematic,
    /// Cells: one whole move per step.
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
    /// The plant of a driving world.
    pub fn plant(self) -> Option<PlantKind> {
        match self {
            Dynamics::Rigid => Some(PlantKind::Rigid),
            Dynamics::Kinematic => Some(PlantKind::Kinematic),
            Dynamics::Cells => None,
        }
    }
}

/// Whether traces hold a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Availability {
    /// Always, or because the world mentions it.
    Recorded,
    /// Only when a world mentions it.
    OnDemand,
    /// Computed from others by the world file.
    Derived,
}

impl Availability {
    /// The word in listings.
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
    /// What is observed of a value: −1 to 1 within the declared range.
    pub fn scaled(&self, value: f64) -> f32 {
        ((value - self.mid) * self.per_half()) as f32
    }

    /// By what the distance from the middle is multiplied.
    pub(super) fn per_half(&self) -> f64 {
        1.0 / self.half
    }
}

/// A derived signal: an expression over published ones.
#[derive(Clone, Debug)]
pub struct Derived {
    /// Its declaration.
    pub signal: Signal,
    /// Its value.
    pub expr: crate::stl::Expr,
}

impl World {
    /// The clocks.
    pub fn clock(&self) -> &Clock {
        match self {
            World::Drive(world) => &world.spec().clock,
            World::Grid(world) => world.clock(),
        }
    }

    /// The signals of its traces.
    pub fn schema(&self) -> &Arc<Schema> {
        match self {
            World::Drive(world) => world.schema(),
            World::Grid(world) => world.schema(),
        }
    }

    /// Shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        match self {
            World::Drive(world) => world.spaces(),
            World::Grid(world) => world.spaces(),
        }
    }

    /// A scene at rest, to be `reset`.
    pub fn scene(&self) -> Box<dyn Scene> {
        match self {
            World::Drive(world) => Box::new(world.scene()),
            World::Grid(world) => Box::new(world.scene()),
        }
    }

    /// X_init.
    pub fn axes(&self) -> Vec<Axis> {
        match self {
            World::Drive(world) => world.spec().axes(),
            World::Grid(world) => world.spec().axes(),
        }
    }

    /// What moves it.
    pub fn dynamics(&self) -> Dynamics {
        match self {
            World::Drive(world) => world.spec().plant.into(),
            World::Grid(_) => Dynamics::Cells,
        }
    }

    /// A joint action in words.
    pub fn action_label(&self, action: usize) -> String {
        match self {
            World::Drive(world) => world.spec().action_label(action),
            World::Grid(world) => world.spec().action_label(action),
        }
    }

    /// How far two joint actions are apart, 0 to 1; on a grid, moves are alike
    /// or not.
    pub fn action_distance(&self, a: usize, b: usize) -> f64 {
        match self {
            World::Drive(world) => world.spec().action_distance(a, b),
            World::Grid(_) => f64::from(u8::from(a != b)),
        }
    }

    /// Every signal that formulas may use, derived ones included.
    pub fn signals(&self) -> Vec<(Signal, Availability)> {
        match self {
            World::Drive(world) => {
                let spec = world.spec();
                let offers = spec.catalogue().into_iter();
                let offers = offers.map(|offer| (offer.signal, offer.always));
                listed(offers, &spec.extra, &spec.derived)
            }
            World::Grid(world) => {
                let spec = world.spec();
                let offers = spec.catalogue().into_iter();
                let offers = offers.map(|offer| (offer.signal, offer.always));
                listed(offers, &spec.extra, &spec.derived)
            }
        }
    }

    /// The ados' observation.
    pub fn observed(&self) -> &[Observed] {
        match self {
            World::Drive(world) => &world.spec().observe,
            World::Grid(world) => &world.spec().observe,
        }
    }

    /// All starts of a finite world, each once.
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
        let held = match always || extra.contains(&signal.name) {
            true => Availability::Recorded,
            false => Availability::OnDemand,
        };
        (signal, held)
    });
    let derived = derived.iter();
    let derived = derived.map(|derived| (derived.signal.clone(), Availability::Derived));
    published.chain(derived).collect()
}
