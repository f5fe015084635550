//! Systems under test: the controllers that drive the ego.
//!
//! A [`Controller`] receives a [`Percept`] once per sample and returns a
//! [`Command`]. Percepts hold quantities that sensors could measure, and no
//! internal state of an ado. To test your own controller, implement the trait
//! and pass it to the test bench. Its commands go through the actuator of its
//! car ([`Actuated`]).
//!
//! ```
//! # use brakecheck_ego as brakecheck;
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
//! The stock egos are the kinds of [`ControllerSpec`]. New ego: one file here,
//! and its line in the list in `stock.rs`.

mod acc;
mod actuator;
mod aeb;
mod coast;
mod courteous_acc;
mod curve_speed;
#[cfg(test)]
mod example_ego;
mod fault;
mod following;
mod fvdm;
mod gipps;
mod idm;
mod iso_acc;
mod krauss;
mod merge;
mod parameters;
mod process;
mod pure_pursuit;
mod recorded;
pub mod reference;
mod room;
mod safety_filter_acc;
mod stock;
pub mod takeover;
mod traffic_light_acc;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::road::RoadPiece;
pub use actuator::Actuated;
pub use actuator::Actuator;
pub use fault::{Fault, FaultKind};
pub(crate) use fault::{PLAUSIBLE_ACCEL_MPS2, PLAUSIBLE_LATERAL_MPS};
pub use parameters::{Parameter, UnknownParameter};
pub use process::{Cause, DOCUMENT, DeclaredParameter, Hello, Maker, Recorder, stop_waiting};
pub use process::{Exercise, Finding, Process, Transcripts, exercise};
pub use recorded::RecordedCommands;
pub use reference::ReferenceDriver;
pub use room::LaneOccupancy;
pub use stock::ControllerSpec;
pub use stock::*;
pub use takeover::{FullBrake, Takeover};

/// State of the ego, as known to itself.
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
    /// Heading relative to the road's, counter-clockwise.
    pub heading_rad: f64,
    /// Speed of its front bumper to the left of its heading.
    ///
    /// Not sent to programs.
    #[serde(skip)]
    pub lateral_mps: f64,
    /// Turning rate, counter-clockwise. Not sent to programs.
    #[serde(skip)]
    pub yaw_rate_rad_per_s: f64,
    /// Length of the own body.
    pub length_m: f64,
    /// Width of the own body.
    pub width_m: f64,
}

/// A road user, as perceived by the ego's sensors.
///
/// Given along the road, with its curves straightened out, and in the ego's
/// frame. The origin of that frame is the middle of the ego's front bumper,
/// with x along its heading and y to the left (ISO 8855).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Name in the world file.
    pub name: String,
    /// Distance along the road, front bumper to front bumper, positive ahead.
    pub headway_m: f64,
    /// Lateral offset relative to the ego, positive to the left.
    pub lateral_m: f64,
    /// Its speed along the road.
    pub speed_mps: f64,
    /// Its speed across the road, positive to the left.
    pub lateral_mps: f64,
    /// Lane of its front bumper, 0 for the rightmost.
    pub lane: usize,
    /// Position of the middle of its front, ahead in the ego's frame.
    pub x_m: f64,
    /// Position of the middle of its front, to the left in the ego's frame.
    pub y_m: f64,
    /// Its heading relative to the ego's, counter-clockwise.
    pub heading_rad: f64,
    /// Heading relative to the road's beside it, −π to π. Not sent to programs.
    #[serde(skip)]
    pub road_heading_rad: f64,
    /// Turning rate, counter-clockwise. Not sent to programs.
    #[serde(skip)]
    pub yaw_rate_rad_per_s: f64,
    /// Its velocity over ground, along the ego's x.
    pub vx_mps: f64,
    /// Its velocity over ground, along the ego's y.
    pub vy_mps: f64,
    /// Its acceleration along its own heading, along the ego's x.
    pub ax_mps2: f64,
    /// Its acceleration along its own heading, along the ego's y.
    pub ay_mps2: f64,
    /// Its length.
    pub length_m: f64,
    /// Its width.
    pub width_m: f64,
}

/// Phase of a traffic light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
    /// Returns the phase that follows.
    pub fn next(self) -> Phase {
        match self {
            Phase::Green => Phase::Yellow,
            Phase::Yellow => Phase::Red,
            Phase::Red => Phase::Green,
        }
    }
}

/// A traffic light, as perceived by the ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeenLight {
    /// Name in the world file.
    pub name: String,
    /// Distance along the road from the front bumper to its stop line.
    ///
    /// Positive before the line.
    pub line_m: f64,
    /// Current phase.
    pub phase: Phase,
    /// Time since the phase began.
    pub phase_s: f64,
}

/// Percept of the ego at a sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percept {
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Time to the next percept.
    pub sample_s: f64,
    /// State of the ego itself.
    pub own: Own,
    /// All other road users, in the order of the world file.
    pub others: Vec<Seen>,
    /// Traffic lights of the world's own road, in the order of the world file.
    #[serde(default)]
    pub lights: Vec<SeenLight>,
}

impl Percept {
    /// Returns the nearest road user whose body is in the ego's path.
    ///
    /// This includes agents that stand across the path or come along it. An
    /// agent that crosses the path counts if it will be there within 2 s and at
    /// the same time as the ego. [`Seen::clearance_m`] returns the distance to
    /// its nearest face, whatever its heading.
    pub fn leader(&self) -> Option<&Seen> {
        self.others
            .iter()
            .filter(|seen| seen.is_ahead_of(&self.own))
            .min_by(|a, b| {
                // Headways of equal clearance compare agents of any heading
                // fairly.
                let headway_m = Seen::following_headway_m;
                headway_m(a).total_cmp(&headway_m(b))
            })
    }

    /// Returns the nearest road user behind that overlaps the ego's path laterally.
    pub fn follower(&self) -> Option<&Seen> {
        self.others
            .iter()
            .filter(|seen| seen.headway_m <= 0.0)
            .filter(|seen| seen.lateral_m.abs() < (seen.width_m + self.own.width_m) / 2.0)
            .max_by(|a, b| a.headway_m.total_cmp(&b.headway_m))
    }

    /// Returns the nearest light whose stop line is less than `past_m` behind.
    pub fn light(&self, past_m: f64) -> Option<&SeenLight> {
        self.lights
            .iter()
            .filter(|light| -past_m <= light.line_m)
            .min_by(|a, b| a.line_m.total_cmp(&b.line_m))
    }
}

/// Constant data of an episode that the ego may know.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Briefing {
    /// Time between two percepts.
    pub sample_s: f64,
    /// Time constant of the lag behind its commands. Not sent to programs.
    #[serde(skip)]
    pub lag_s: f64,
    /// Legal speed limit on this road, if the world file has one.
    pub speed_limit_mps: Option<f64>,
    /// The road.
    pub road: RoadGeometry,
    /// Values that are set for parameters of a program, by name.
    ///
    /// A program receives the values of all parameters that it declares instead.
    #[serde(skip)]
    pub parameters: BTreeMap<String, f64>,
}

/// Lanes along a course, as in a map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoadGeometry {
    /// Number of lanes. Lane 0 is the rightmost, and its middle is the course.
    pub lanes: usize,
    /// Width of a lane.
    pub lane_width_m: f64,
    /// The course in pieces. Around the pieces, or without any, it is straight.
    pub pieces: Vec<RoadPiece>,
}

/// Command of the ego to its vehicle until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Net acceleration along the heading.
    pub accel_mps2: f64,
    /// Speed across the road, positive to the left, 0 to keep the lateral position.
    #[serde(default)]
    pub lateral_mps: f64,
}

impl Command {
    /// Creates a command that accelerates or brakes, and keeps the lane.
    pub fn accelerate(accel_mps2: f64) -> Command {
        Command {
            accel_mps2,
            lateral_mps: 0.0,
        }
    }

    /// Returns whether a car could follow the command, so that it has no flaw.
    #[inline]
    pub fn is_plausible(&self) -> bool {
        // NaN fails both comparisons.
        self.accel_mps2.abs() <= PLAUSIBLE_ACCEL_MPS2
            && self.lateral_mps.abs() <= PLAUSIBLE_LATERAL_MPS
    }

    /// Returns the fault of a command that no car could follow.
    pub fn flaw(&self) -> Option<Fault> {
        let Command {
            accel_mps2,
            lateral_mps,
        } = *self;
        // Checked first, because NaN would pass the comparisons below.
        if !(accel_mps2.is_finite() && lateral_mps.is_finite()) {
            return Some(Fault::new(
                FaultKind::NotFinite,
                format!("its command is not finite: {accel_mps2} m/s², {lateral_mps} m/s across"),
            ));
        }
        let beyond = |what: &str, value: f64, unit: &str, most: f64| {
            let message = format!("{what} of {value:?} {unit} is beyond ±{most} {unit}");
            Some(Fault::new(FaultKind::Implausible, message))
        };
        if accel_mps2.abs() > PLAUSIBLE_ACCEL_MPS2 {
            return beyond("an acceleration", accel_mps2, "m/s²", PLAUSIBLE_ACCEL_MPS2);
        }
        if lateral_mps.abs() > PLAUSIBLE_LATERAL_MPS {
            return beyond("a lateral speed", lateral_mps, "m/s", PLAUSIBLE_LATERAL_MPS);
        }
        None
    }
}

/// A system under test.
///
/// `control` is called once per sample, and its command holds until the next
/// call.
pub trait Controller: Send {
    /// Receives the road data, before the first episode on a road.
    ///
    /// In worlds with an agent `Road`, also with each piece of road laid ahead, during
    /// an episode.
    fn brief(&mut self, _briefing: &Briefing) {}

    /// Begins an episode. All randomness must derive from `seed`.
    fn reset(&mut self, seed: u64);

    /// Returns the command for a percept.
    ///
    /// # Errors
    /// A [`Fault`] makes the episode invalid, a success of neither side.
    fn control(&mut self, percept: &Percept) -> Result<Command, Fault>;

    /// Ends the episode. No further call precedes the next `reset`.
    fn finish(&mut self) {}

    /// Returns an independent copy in the same state, if possible.
    ///
    /// With `None` (an external process), searches run again from the start.
    fn fork(&self) -> Option<Box<dyn Controller>>;
}
