//! Scenes: a plant, an ego and its ados, and the signals they publish.
//!
//! A [`Scene`] moves on sample by sample under the ados' actions and publishes
//! one row of signals per sample. What the row means for anybody's success is
//! the rulebook's business.
//!
//! Architecture Invariant: a scene computes no reward and no verdict.

pub mod drive;
mod figure;
pub mod grid;
pub mod ground;
mod record;
mod world;

use std::sync::Arc;

pub use figure::Figure;
pub use record::{BodySample, Motion, Passage};
pub use world::{Availability, Derived, Dynamics, Observed, World};

use serde::{Deserialize, Serialize};

use crate::ego::{Command, Fault, Phase};
use crate::rl::Spaces;
use crate::seed::StartKey;
use crate::severity::Impact;
use crate::sim::Placement;
use crate::trace::Schema;

/// The three clocks: samples, decisions and the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    /// T: the length of an episode.
    pub horizon_s: f64,
    /// Time between two actions of the ado, a multiple of the sample.
    pub decision_s: f64,
    /// Time between two rows of the trace and two commands of the ego.
    pub sample_s: f64,
    /// Physics steps per sample.
    pub substeps: u32,
}

impl Clock {
    /// Samples of a full episode, the one at t = 0 included.
    pub fn samples(&self) -> usize {
        (self.horizon_s / self.sample_s).round() as usize + 1
    }

    /// Samples between two decisions.
    pub fn samples_per_decision(&self) -> usize {
        (self.decision_s / self.sample_s).round() as usize
    }

    /// Decisions of a full episode.
    pub fn decisions(&self) -> usize {
        (self.samples() - 1).div_ceil(self.samples_per_decision())
    }
}

/// One dimension of X_init: a quantity drawn uniformly from `lo ..= hi`.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Dotted name, such as `ado.headway`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Least value.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
}

/// One point of X_init: a value per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start(pub Vec<f64>);

/// What one sample of motion brought.
#[derive(Clone, Debug, PartialEq)]
pub enum Flow {
    /// The motion goes on.
    Going,
    /// Two agents touched during this sample: the motion ends.
    Contact(Touch),
    /// The ego or the physics failed.
    Fault(Fault),
}

/// A first contact as the scene reports it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// Names of the two agents.
    pub between: (String, String),
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Approach speed along the contact normal.
    pub closing_speed_mps: f64,
    /// Where, in the world frame.
    pub point_m: [f64; 3],
    /// What it does to the ego; `None`: the ego has no part in it, or is a cell
    /// of a grid, or an earlier version recorded it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impact: Option<Impact>,
}

impl Touch {
    /// Whether it is the contact that was recorded; what the record does not
    /// say, because an earlier version wrote it, is not compared.
    pub fn is_as_recorded(&self, recorded: &Touch) -> bool {
        let said = Touch {
            impact: recorded.impact.and(self.impact),
            ..self.clone()
        };
        said == *recorded
    }
}

/// Who somebody is, for viewers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The system under test.
    Ego,
    /// A learning adversary.
    Ado,
    /// Background traffic.
    Scripted,
}

/// Somebody on the stage, for viewers.
#[derive(Clone, Debug, PartialEq)]
pub struct Cast {
    /// Name in the world file.
    pub name: String,
    /// Who it is.
    pub role: Role,
    /// Its kind of body.
    pub body: String,
    /// Length, width and height of its body.
    pub size_m: [f64; 3],
    /// Colour of its body: red, green, blue.
    pub colour: [u8; 3],
    /// Whether it walks.
    pub on_foot: bool,
}

/// A traffic light, for viewers.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPost {
    /// Name in the world file.
    pub name: String,
    /// Right and left end of its stop line, on the ground.
    pub stop_line_m: [[f64; 3]; 2],
}

/// What does not change during an episode, for viewers.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// The agents, in file order.
    pub cast: Vec<Cast>,
    /// Lane borders as polylines on the ground.
    pub lane_borders_m: Vec<Vec<[f64; 3]>>,
    /// The same of other roads, one after the other.
    pub side_roads_m: Vec<Vec<Vec<[f64; 3]>>>,
    /// The traffic lights, in file order.
    pub lights: Vec<LightPost>,
}

/// Where everybody is at one sample, for viewers.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// One placement per member of the cast.
    pub placements: Vec<Placement>,
    /// One phase per traffic light.
    pub phases: Vec<Phase>,
}

/// A world in motion.
///
/// Equal starts, noise seeds and actions give equal bits.
pub trait Scene: Send {
    /// The published signals; a row has one value for each.
    fn schema(&self) -> &Arc<Schema>;
    /// Shapes of the ados' joint observation and action.
    fn spaces(&self) -> &Spaces;
    /// The clocks.
    fn clock(&self) -> &Clock;
    /// X_init.
    fn axes(&self) -> &[Axis];
    /// The start of a key: a pure function of world and key.
    fn draw(&self, key: StartKey) -> Start;
    /// Begins an episode at t = 0.
    fn reset(&mut self, start: &Start, noise: u64);
    /// Sets the ados' joint action until the next decision.
    fn decide(&mut self, action: usize);
    /// Moves on by one sample.
    fn advance(&mut self) -> Flow;
    /// Writes the current row of signals.
    fn publish(&self, row: &mut [f64]);
    /// Writes the ados' observation of the row just published.
    fn observe(&self, row: &[f64], obs: &mut [f32]);
    /// What does not move.
    fn stage(&self) -> Stage;
    /// Where everybody is.
    fn frame(&self) -> Frame;
    /// Adds everybody's present motion, in the order of the cast; nothing where
    /// no plant moves them.
    fn bodies(&self, _into: &mut Vec<BodySample>) {}
    /// The driving world in which it happens, if it is one.
    fn driven(&self) -> Option<drive::DriveWorld> {
        None
    }
    /// The episode is over: whoever waits for another command need not.
    fn finish(&mut self) {}
    /// What an ego that nobody here wrote commanded in this episode, sample by
    /// sample; empty for all others, which answer alike each time.
    fn commands(&self) -> &[Command] {
        &[]
    }
    /// A copy that continues bit for bit; `None` if the ego cannot be copied.
    fn fork(&self) -> Option<Box<dyn Scene>>;
}
