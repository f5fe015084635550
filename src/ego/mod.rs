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
//!
//! | stock ego | file | what it does |
//! | --- | --- | --- |
//! | [`Acc`] | `acc` | follows the car ahead, Sec. V-B |
//! | [`FilteredAcc`] | `filtered` | the same under a braking safety filter |
//! | [`PoliteAcc`] | `polite` | the same, but brakes softly when tailgated |
//! | [`Idm`] | `idm` | the intelligent driver model |
//! | [`Aeb`] | `aeb` | cruises, and brakes for whoever crosses its path |
//! | [`Merge`] | `merge` | the switching merge controller, Sec. V-C |
//! | [`YellowLight`] | `yellow` | follows, and stops for lights by the paper's d(t) |
//! | [`YellowLightFixed`] | `yellow` | the same with the stopping distance |

mod acc;
mod actuator;
mod aeb;
mod filtered;
mod idm;
mod merge;
mod parameters;
mod polite;
mod process;
mod stock;
mod yellow;

use serde::{Deserialize, Serialize};

pub use acc::Acc;
pub use actuator::Actuator;
pub use aeb::Aeb;
pub use filtered::FilteredAcc;
pub use idm::Idm;
pub use merge::Merge;
pub use parameters::{Parameter, UnknownParameter};
pub use polite::PoliteAcc;
pub use process::{Process, ProcessController};
pub use stock::ControllerSpec;
pub use yellow::{YellowLight, YellowLightFixed};

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

/// What a traffic light shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Phase {
    /// Go.
    #[default]
    Green,
    /// Stop if you can.
    Yellow,
    /// Stop.
    Red,
}

impl Phase {
    /// The phase that follows.
    pub fn next(self) -> Phase {
        match self {
            Phase::Green => Phase::Yellow,
            Phase::Yellow => Phase::Red,
            Phase::Red => Phase::Green,
        }
    }
}

/// A traffic light, as the ego sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenLight {
    /// Name in the world file.
    pub name: String,
    /// Distance along the road from the front bumper to its stop line;
    /// positive before it.
    pub line_m: f64,
    /// What it shows.
    pub phase: Phase,
    /// For how long it has shown it.
    pub phase_s: f64,
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
    /// All traffic lights, in the order of the world file.
    #[serde(default)]
    pub lights: Vec<SeenLight>,
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

    /// The nearest road user behind whose body overlaps the ego's path laterally.
    pub fn follower(&self) -> Option<&Seen> {
        self.others
            .iter()
            .filter(|seen| seen.headway_m <= 0.0)
            .filter(|seen| seen.lateral_m.abs() < (seen.width_m + self.own.width_m) / 2.0)
            .max_by(|a, b| a.headway_m.total_cmp(&b.headway_m))
    }

    /// The nearest light whose stop line is less than `past_m` behind.
    pub fn light(&self, past_m: f64) -> Option<&SeenLight> {
        self.lights
            .iter()
            .filter(|light| -past_m <= light.line_m)
            .min_by(|a, b| a.line_m.total_cmp(&b.line_m))
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
