//! Systems under test: the controllers that drive the ego.
//!
//! A [`Controller`] sees a [`Percept`] once per sample and answers with a
//! [`Command`]. It never sees the ado's mind: percepts hold what sensors could
//! measure. To test your own, implement the trait and hand it to the test bench.
//!
//! ```
//! use brakecheck::ego::{Command, Controller, Fault, Percept};
//!
//! /// Brakes whenever the car ahead is nearer than two seconds.
//! #[derive(Clone)]
//! struct TwoSeconds;
//!
//! impl Controller for TwoSeconds {
//!     fn reset(&mut self, _seed: u64) {}
//!     fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
//!         let near = percept
//!             .leader()
//!             .is_some_and(|lead| lead.headway_m < 2.0 * percept.own.speed_mps);
//!         Ok(Command::accelerate(if near { -4.0 } else { 0.0 }))
//!     }
//!     fn fork(&self) -> Option<Box<dyn Controller>> {
//!         Some(Box::new(self.clone()))
//!     }
//! }
//! ```
//!
//! New ego: one file here, and its variant in [`ControllerSpec`].

mod acc;
mod actuator;
mod parameters;

use serde::{Deserialize, Serialize};

pub use acc::Acc;
pub use actuator::Actuator;
pub use parameters::{Parameter, UnknownParameter};

/// The ego's own state, as it knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Own {
    /// Speed along its heading.
    pub speed_mps: f64,
    /// Acceleration along its heading over the last sample.
    pub accel_mps2: f64,
    /// Distance along the road of the front bumper.
    pub s_m: f64,
    /// Offset to the left of the middle of lane 0.
    pub lateral_m: f64,
    /// Lane, counted from the right, 0 first.
    pub lane: usize,
    /// Length of the own body.
    pub length_m: f64,
    /// Width of the own body.
    pub width_m: f64,
}

/// Another road user, as the ego's sensors see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Name in the world file.
    pub name: String,
    /// Distance along the road, front bumper to front bumper; positive is ahead.
    pub headway_m: f64,
    /// Lateral offset relative to the ego, positive to the left.
    pub lateral_m: f64,
    /// Its speed along the road.
    pub speed_mps: f64,
    /// Its speed across the road, positive to the left.
    pub lateral_mps: f64,
    /// Its lane.
    pub lane: usize,
    /// Its length.
    pub length_m: f64,
    /// Its width.
    pub width_m: f64,
}

/// What the ego perceives at one sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percept {
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Time to the next percept.
    pub sample_s: f64,
    /// The ego itself.
    pub own: Own,
    /// Everybody else, in the order of the world file.
    pub others: Vec<Seen>,
}

impl Percept {
    /// The nearest road user ahead whose body overlaps the ego's path laterally.
    pub fn leader(&self) -> Option<&Seen> {
        self.others
            .iter()
            .filter(|seen| 0.0 < seen.headway_m)
            .filter(|seen| seen.lateral_m.abs() < (seen.width_m + self.own.width_m) / 2.0)
            .min_by(|a, b| a.headway_m.total_cmp(&b.headway_m))
    }
}

/// What the ego asks its vehicle to do until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// Net acceleration along the heading.
    pub accel_mps2: f64,
    /// Speed across the road, positive to the left; 0 keeps the lateral position.
    #[serde(default)]
    pub lateral_mps: f64,
}

impl Command {
    /// Accelerate (or brake, below 0) and keep the lane.
    pub fn accelerate(accel_mps2: f64) -> Command {
        Command {
            accel_mps2,
            lateral_mps: 0.0,
        }
    }
}

/// The ego or the physics failed: never a success of the ado.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Fault {
    /// The controller answered with something that is no finite command.
    #[error("the ego's command is not finite at {time_ms} ms")]
    NotFinite {
        /// When, in milliseconds.
        time_ms: u64,
    },
    /// The controller reported an error or died.
    #[error("the ego failed: {what}")]
    Ego {
        /// What it said.
        what: String,
    },
    /// A state left the bounds within which the plant is sound.
    #[error("the physics broke down at {time_ms} ms")]
    Physics {
        /// When, in milliseconds.
        time_ms: u64,
    },
}

/// A system under test.
///
/// `control` is called once per sample; between calls the command holds.
pub trait Controller: Send {
    /// Begins an episode; `seed` feeds whatever randomness it has.
    fn reset(&mut self, seed: u64);

    /// Answers a percept with a command.
    ///
    /// # Errors
    /// A [`Fault`] makes the episode invalid: neither side's success.
    fn control(&mut self, percept: &Percept) -> Result<Command, Fault>;

    /// An independent copy in the same state, where that is possible.
    ///
    /// `None` (an external process) makes searches re-run from the start.
    fn fork(&self) -> Option<Box<dyn Controller>>;
}

/// A controller as named in a world file, with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ControllerSpec {
    /// Adaptive cruise control, Sec. V-B.
    Acc(Acc),
}

impl ControllerSpec {
    /// The controller itself, ready for `reset`.
    pub fn build(&self) -> Box<dyn Controller> {
        match self {
            ControllerSpec::Acc(acc) => Box::new(acc.clone()),
        }
    }

    /// Name of the kind, as written in the world file.
    pub fn kind(&self) -> &'static str {
        match self {
            ControllerSpec::Acc(_) => "Acc",
        }
    }

    /// Its numeric parameters: name, unit, meaning and value.
    pub fn parameters(&self) -> Vec<Parameter> {
        match self {
            ControllerSpec::Acc(acc) => acc.parameters(),
        }
    }

    /// Sets one parameter by name.
    ///
    /// # Errors
    /// The name is none of this controller's parameters.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
        match self {
            ControllerSpec::Acc(acc) => acc.set(name, value),
        }
    }

    /// Time constant of the first-order lag behind the command; 0 is none.
    pub fn lag_s(&self) -> f64 {
        match self {
            ControllerSpec::Acc(acc) => acc.lag_s,
        }
    }
}
