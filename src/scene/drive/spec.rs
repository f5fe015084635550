//! What a driving scene is made of: checked data, no spans.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::ego::{Controller, ControllerSpec};
use crate::scene::{Axis, Clock, Derived, Observed};
use crate::sim::{Body, PlantKind};
use crate::stl::Constants;

/// A fixed number or a range from which starts are drawn uniformly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least value.
    pub lo: f64,
    /// Greatest value; equal to `lo` for a fixed number.
    pub hi: f64,
}

impl Range {
    /// Whether there is nothing to draw.
    pub fn is_fixed(&self) -> bool {
        self.lo == self.hi
    }
}

/// The road. Lane 0 is the rightmost; its middle is y = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Road {
    /// Along world x, without end.
    Straight {
        /// Number of lanes.
        lanes: usize,
        /// Width of a lane.
        lane_width_m: f64,
        /// Coefficient of friction μ of the surface.
        friction: f64,
    },
}

impl Road {
    /// Number of lanes.
    pub fn lanes(&self) -> usize {
        match *self {
            Road::Straight { lanes, .. } => lanes,
        }
    }

    /// Width of a lane.
    pub fn lane_width_m(&self) -> f64 {
        match *self {
            Road::Straight { lane_width_m, .. } => lane_width_m,
        }
    }

    /// Coefficient of friction μ.
    pub fn friction(&self) -> f64 {
        match *self {
            Road::Straight { friction, .. } => friction,
        }
    }

    /// Lays another surface.
    pub fn set_friction(&mut self, to: f64) {
        match self {
            Road::Straight { friction, .. } => *friction = to,
        }
    }

    /// Lateral position of a lane's middle.
    pub fn lane_middle_m(&self, lane: usize) -> f64 {
        lane as f64 * self.lane_width_m()
    }

    /// The lane in which a lateral position lies, clamped to the road.
    pub fn lane_at(&self, lateral_m: f64) -> usize {
        let lane = (lateral_m / self.lane_width_m()).round();
        (lane.max(0.0) as usize).min(self.lanes() - 1)
    }
}

/// Where and how fast an agent starts.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// At a position along the road.
    At {
        /// Front bumper along the road.
        x_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
    /// Relative to an agent declared before.
    Ahead {
        /// Position of that agent in the file.
        of: usize,
        /// Front bumper to front bumper; negative is behind.
        headway_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
}

impl Place {
    /// The initial speed.
    pub fn speed_mps(&self) -> Range {
        match *self {
            Place::At { speed_mps, .. } | Place::Ahead { speed_mps, .. } => speed_mps,
        }
    }
}

/// What the ado may choose from at each decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Actions {
    /// Net accelerations along the lane, m/s².
    Accelerations(Vec<f64>),
}

impl Actions {
    /// Number of actions.
    pub fn len(&self) -> usize {
        match self {
            Actions::Accelerations(list) => list.len(),
        }
    }

    /// Whether there is nothing to choose.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// An action in words.
    pub fn label(&self, action: usize) -> String {
        match self {
            Actions::Accelerations(list) => format!("{:+} m/s²", list[action]),
        }
    }

    /// Net acceleration of an action.
    pub(super) fn accel_mps2(&self, action: usize) -> f64 {
        match self {
            Actions::Accelerations(list) => list[action],
        }
    }
}

/// A background vehicle's plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Script {
    /// Keeps its initial speed.
    ConstantSpeed,
    /// Net accelerations, each from its time on: `[(at_s, accel_mps2), …]`.
    Profile(Vec<(f64, f64)>),
}

impl Script {
    /// Net acceleration at a time.
    pub(super) fn accel_mps2(&self, time_s: f64) -> f64 {
        match self {
            Script::ConstantSpeed => 0.0,
            Script::Profile(points) => points
                .iter()
                .take_while(|(at_s, _)| *at_s <= time_s + 1e-9)
                .last()
                .map_or(0.0, |(_, accel_mps2)| *accel_mps2),
        }
    }
}

/// Makes a fresh controller, once per worker.
pub type ControllerFactory = Arc<dyn Fn() -> Box<dyn Controller> + Send + Sync>;

/// The ego's controller: a stock one from the world file, or the user's own.
#[derive(Clone)]
pub enum EgoDrive {
    /// From the world file.
    Stock(ControllerSpec),
    /// A Rust type implementing [`Controller`].
    Own {
        /// How rows call it.
        name: String,
        /// Makes one.
        factory: ControllerFactory,
    },
}

impl EgoDrive {
    /// A fresh controller.
    pub fn build(&self) -> Box<dyn Controller> {
        match self {
            EgoDrive::Stock(spec) => spec.build(),
            EgoDrive::Own { factory, .. } => factory(),
        }
    }

    /// Time constant of the lag behind its commands.
    pub fn lag_s(&self) -> f64 {
        match self {
            EgoDrive::Stock(spec) => spec.lag_s(),
            EgoDrive::Own { .. } => 0.0,
        }
    }
}

impl std::fmt::Debug for EgoDrive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EgoDrive::Stock(spec) => spec.fmt(f),
            EgoDrive::Own { name, .. } => write!(f, "Own({name})"),
        }
    }
}

/// Who drives an agent.
#[derive(Clone, Debug)]
pub enum Drive {
    /// The system under test.
    Ego(EgoDrive),
    /// A learning adversary.
    Ado {
        /// What it may choose from.
        actions: Actions,
        /// The action that leaves things alone.
        neutral: usize,
    },
    /// Background traffic.
    Scripted(Script),
}

/// One agent.
#[derive(Clone, Debug)]
pub struct Agent {
    /// Name in signals.
    pub name: String,
    /// Its body.
    pub body: Body,
    /// The lane it starts in and keeps.
    pub lane: usize,
    /// Where it starts.
    pub place: Place,
    /// Who drives it.
    pub drive: Drive,
}

/// A driving scene, assembled from data.
#[derive(Clone, Debug)]
pub struct DriveSpec {
    /// Name of the world; part of every start's key.
    pub world: String,
    /// The clocks.
    pub clock: Clock,
    /// Which physics.
    pub plant: PlantKind,
    /// The road.
    pub road: Road,
    /// The agents, in file order; exactly one is the ego.
    pub agents: Vec<Agent>,
    /// Signals published besides the basic ones, by name.
    pub extra: Vec<String>,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ados' observation.
    pub observe: Vec<Observed>,
}

impl DriveSpec {
    /// The agents driven by a system under test, with their positions.
    pub fn egos(&self) -> impl Iterator<Item = (usize, &EgoDrive)> {
        let agents = self.agents.iter().enumerate();
        agents.filter_map(|(i, agent)| match &agent.drive {
            Drive::Ego(drive) => Some((i, drive)),
            _ => None,
        })
    }

    /// The ados' action sets, in file order.
    pub fn action_sets(&self) -> impl Iterator<Item = (&Agent, &Actions, usize)> {
        self.agents.iter().filter_map(|agent| match &agent.drive {
            Drive::Ado { actions, neutral } => Some((agent, actions, *neutral)),
            _ => None,
        })
    }

    /// A joint action in words: one label per ado.
    pub fn action_label(&self, mut action: usize) -> String {
        let mut labels = Vec::new();
        for (_, actions, _) in self.action_sets() {
            labels.push(actions.label(action % actions.len()));
            action /= actions.len();
        }
        labels.join(" | ")
    }

    /// X_init: one axis per range in the agents' places.
    pub fn axes(&self) -> Vec<Axis> {
        let mut axes = Vec::new();
        for agent in &self.agents {
            let (what, along) = match agent.place {
                Place::At { x_m, .. } => ("x", x_m),
                Place::Ahead { headway_m, .. } => ("headway", headway_m),
            };
            let ranges = [
                (what, "m", along),
                ("speed", "m/s", agent.place.speed_mps()),
            ];
            for (what, unit, range) in ranges {
                if !range.is_fixed() {
                    axes.push(Axis {
                        name: format!("{}.{what}", agent.name),
                        unit,
                        lo: range.lo,
                        hi: range.hi,
                    });
                }
            }
        }
        axes
    }
}
