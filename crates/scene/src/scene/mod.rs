//! Scenes: a plant, an ego and its ados, and the signals they publish.
//!
//! A [`Scene`] advances sample by sample under the ados' actions and publishes
//! one row of signals per sample. The rulebook decides what a row means for
//! success.
//!
//! Architecture Invariant: a scene computes no reward and no verdict.

pub mod drive;
mod figure;
pub mod grid;
pub mod ground;
mod record;
mod world;

use std::sync::Arc;

pub use crate::severity::{CrashKind, Impact, InjuryRisk, RiskCurve, Side};
pub use crate::sim::{BodyCommand, BodyState, Placement, Pose};
pub use figure::BodyFigure;
pub use record::Passage;
pub use record::{BodySample, Motion};
pub use world::Derived;
pub use world::{Availability, Dynamics, Observed, World};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ego::{Command, Fault, Phase};
use crate::rl::Spaces;
use crate::seed::StartKey;
use crate::sim::BodyShape;
use crate::trace::Schema;

/// The three clocks of an episode: samples, decisions and the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clock {
    /// Length of an episode, T in the paper.
    pub horizon_s: f64,
    /// Time between two actions of the ado, a multiple of `sample_s`.
    pub decision_s: f64,
    /// Time between two rows of the trace and between two commands of the ego.
    pub sample_s: f64,
    /// Physics steps per sample.
    pub substeps: u32,
}

impl Clock {
    /// Returns the number of samples of a full episode, including t = 0.
    pub fn samples(&self) -> usize {
        // Rounds because T / sample is not exact in binary: 0.3 / 0.1 is just
        // below 3.
        (self.horizon_s / self.sample_s).round() as usize + 1
    }

    /// Returns the number of samples between two decisions.
    pub fn samples_per_decision(&self) -> usize {
        (self.decision_s / self.sample_s).round() as usize
    }

    /// Returns the number of decisions of a full episode.
    pub fn decisions(&self) -> usize {
        // The sample at t = 0 precedes the first action. A horizon that is no
        // multiple of the decision interval ends in a shortened decision.
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

impl Axis {
    /// Returns the position of a value among `bins` bins of equal width.
    ///
    /// An axis of one value has only the first bin.
    pub fn bin(&self, value: f64, bins: usize) -> usize {
        let width = self.hi - self.lo;
        // A fixed quantity has a single bin, and a width of 0 must not divide.
        if width <= 0.0 {
            return 0;
        }
        let share = (value - self.lo) / width;
        // The upper end of the axis belongs to the last bin. The cast saturates at 0.
        ((share * bins as f64) as usize).min(bins.saturating_sub(1))
    }

    /// Returns the ends of a bin of `bins` bins of equal width.
    pub fn bin_ends(&self, bin: usize, bins: usize) -> [f64; 2] {
        let end = |n: usize| self.lo + (self.hi - self.lo) * n as f64 / bins.max(1) as f64;
        [end(bin), end(bin + 1)]
    }
}

/// One point of X_init: a value per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start(pub Vec<f64>);

/// Result of advancing a scene by one sample.
#[derive(Clone, Debug, PartialEq)]
pub enum StepOutcome {
    /// The motion continues.
    Going,
    /// Two agents touched during this sample, which ends the motion.
    Contact(ContactEvent),
    /// The ego or the physics failed.
    Fault(Fault),
}

/// First contact of an episode, as the scene reports it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactEvent {
    /// Names of the two agents.
    pub between: (String, String),
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Approach speed along the contact normal.
    pub closing_speed_mps: f64,
    /// Point of contact in the world frame.
    pub point_m: [f64; 3],
    /// Effect on the ego.
    ///
    /// `None` if the ego is not involved, if the world is a grid, or if an
    /// earlier version recorded the contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub impact: Option<Impact>,
}

impl ContactEvent {
    /// Returns whether this contact equals the recorded one.
    ///
    /// An impact that the record lacks, because an earlier version wrote it, is
    /// not compared.
    pub fn is_as_recorded(&self, recorded: &ContactEvent) -> bool {
        let said = ContactEvent {
            // Files from before impacts were recorded have none, and stay comparable.
            impact: recorded.impact.and(self.impact),
            ..self.clone()
        };
        said == *recorded
    }
}

/// Time after the contact that episodes have which are kept or shown, in seconds.
///
/// A world's own `after_contact_s` replaces it.
pub const KEPT_AFTER_CONTACT_S: f64 = 2.0;

/// Motion of the agents after the first contact, as the physics resolves it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AfterContact {
    /// Time that is played after the contact.
    pub duration_s: f64,
    /// Collisions in the order of time. The first is that of the contact.
    pub collisions: Vec<CollisionEvent>,
    /// Colliding vehicles that came into another lane or off the road, in the order of
    /// time.
    pub pushed: Vec<PushedEvent>,
}

/// Collision of two agents after the first contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CollisionEvent {
    /// Names of the two agents.
    pub between: (String, String),
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Change of the velocity of each agent's centre of mass.
    pub delta_v_mps: (f64, f64),
}

/// Vehicle in another lane after a collision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PushedEvent {
    /// Name of the agent.
    pub agent: String,
    /// Time since the start of the episode.
    pub time_s: f64,
    /// Lane before, counted from 0 at the right. `None` off the road.
    pub from: Option<usize>,
    /// Lane after.
    pub to: Option<usize>,
}

impl AfterContact {
    /// Returns one sentence per event after the first collision, in the order of time.
    pub fn sentences(&self) -> Vec<String> {
        let events = self.described().into_iter();
        let sentences = events.map(|(time_s, what, speeds)| match speeds {
            Some(speeds) => format!("{what} at {time_s:.2} s: {speeds} by the physics"),
            None => format!("{what} at {time_s:.2} s"),
        });
        sentences.collect()
    }

    /// Returns the time and a clause of every collision and push, in the order of time.
    pub fn events(&self) -> Vec<(f64, String)> {
        let events = self
            .described()
            .into_iter()
            .map(|(time_s, what, speeds)| match speeds {
                Some(speeds) => (time_s, format!("{what}, {speeds}")),
                None => (time_s, what),
            });
        events.collect()
    }

    /// Returns time, clause and changes of velocity of every event, in the order of time.
    fn described(&self) -> Vec<(f64, String, Option<String>)> {
        let lane = |lane: Option<usize>| match lane {
            Some(lane) => format!("into lane {lane}"),
            None => "off the road".to_owned(),
        };
        let mut events = Vec::new();
        for (index, collision) in self.collisions.iter().enumerate() {
            let CollisionEvent {
                between: (a, b),
                time_s,
                delta_v_mps: (of_a, of_b),
            } = collision;
            let then = if index == 0 {
                "collide"
            } else {
                "then collide"
            };
            let speeds = format!("Δv {of_a:.1} and {of_b:.1} m/s");
            events.push((*time_s, format!("{a} and {b} {then}"), Some(speeds)));
        }
        for push in &self.pushed {
            let text = format!("{} is pushed {}", push.agent, lane(push.to));
            events.push((push.time_s, text, None));
        }
        // Stable, so that a collision precedes the pushes of its instant.
        events.sort_by(|a, b| a.0.total_cmp(&b.0));
        events
    }
}

/// Role of an agent, for viewers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Role {
    /// The system under test.
    Ego,
    /// A learning adversary.
    Ado,
    /// Background traffic.
    Scripted,
}

/// Description of an agent, for viewers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AgentDescription {
    /// Name in the world file.
    pub name: String,
    /// Role in the world.
    pub role: Role,
    /// Name of its kind of body.
    pub body: String,
    /// Length, width and height of its body.
    pub size_m: [f64; 3],
    /// Collision shape of its body. Pages draw figures of the size instead.
    #[serde(skip)]
    pub shape: BodyShape,
    /// Colour of its body: red, green, blue.
    pub colour: [u8; 3],
    /// True for a pedestrian.
    pub on_foot: bool,
}

/// A traffic light, for viewers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightPost {
    /// Name in the world file.
    pub name: String,
    /// Right and left end of its stop line, on the ground.
    pub stop_line_m: [[f64; 3]; 2],
}

/// Static content of an episode, for viewers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneGeometry {
    /// The agents, in file order.
    pub agents: Vec<AgentDescription>,
    /// Lane borders as polylines on the ground.
    pub lane_borders_m: Vec<Vec<[f64; 3]>>,
    /// Lane borders of the other roads, road by road.
    pub side_roads_m: Vec<Vec<Vec<[f64; 3]>>>,
    /// The traffic lights, in file order.
    pub lights: Vec<LightPost>,
}

/// Poses of all agents and phases of all lights at one sample, for viewers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// One placement per member of the cast.
    pub placements: Vec<Placement>,
    /// One phase per traffic light.
    pub phases: Vec<Phase>,
    /// Whether the ego sees each member of the cast. `None` if nothing can hide one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seen: Option<Vec<bool>>,
}

/// A world in motion.
///
/// Equal starts, noise seeds and actions give bit-identical episodes.
pub trait Scene: Send {
    /// Returns the schema of the published signals, one value of a row for each.
    fn schema(&self) -> &Arc<Schema>;
    /// Returns the shapes of the ados' joint observation and action.
    fn spaces(&self) -> &Spaces;
    /// Returns the clocks.
    fn clock(&self) -> &Clock;
    /// Returns the axes of X_init.
    fn axes(&self) -> &[Axis];
    /// Draws the start of a key: a pure function of world and key.
    fn draw(&self, key: StartKey) -> Start;
    /// Begins an episode at t = 0.
    fn reset(&mut self, start: &Start, noise: u64);
    /// Returns which joint actions are allowed at this decision, `None` if all are.
    ///
    /// The neutral action is always allowed.
    fn allowed(&self) -> Option<Vec<bool>> {
        None
    }
    /// Sets the ados' joint action until the next decision.
    fn decide(&mut self, action: usize);
    /// Advances by one sample.
    fn advance(&mut self) -> StepOutcome;
    /// Advances by one sample in which another simulator moves some agents.
    ///
    /// `given` has an agent's state at the end of the sample, in the order of the cast,
    /// or `None` for an agent that this scene moves. An ego without a state coasts.
    /// `None` for a scene without bodies.
    fn advance_given(&mut self, _given: &[Option<BodyState>]) -> Option<StepOutcome> {
        None
    }
    /// Writes the current row of signals.
    fn publish(&self, row: &mut [f64]);
    /// Writes the ados' observation of the row just published.
    fn observe(&self, row: &[f64], obs: &mut [f32]);
    /// Returns the static content, for viewers.
    fn stage(&self) -> SceneGeometry;
    /// Returns the poses of all agents at the current sample.
    fn frame(&self) -> Frame;
    /// Appends the current motion of every agent, in the order of the cast.
    ///
    /// Appends nothing if no plant moves the agents, as on a grid.
    fn bodies(&self, _into: &mut Vec<BodySample>) {}
    /// Returns the driving world of this scene, or `None` for a grid.
    #[doc(hidden)]
    fn driven(&self) -> Option<drive::DriveWorld> {
        None
    }
    /// Returns the steps of rapier's pipeline in this episode.
    ///
    /// 0 without a plant of rapier.
    fn rapier_steps(&self) -> u64 {
        0
    }
    /// Plays on after a contact and returns the events with a frame per sample.
    ///
    /// It plays `default_s` where the world states no `after_contact_s`. rapier moves
    /// all bodies, also those of the kinematic plant. The scene itself stays at the
    /// contact. `None` if nothing is played: without a contact or without bodies.
    fn after_contact(&self, _default_s: f64) -> Option<(AfterContact, Vec<Frame>)> {
        None
    }
    /// Ends the episode, so that an external ego stops waiting for a sample.
    fn finish(&mut self) {}
    /// Returns the commands of an external ego in this episode, per sample.
    ///
    /// Empty for egos of this crate: they are deterministic and need no record.
    fn commands(&self) -> &[Command] {
        &[]
    }
    /// Returns a copy that continues bit for bit, or `None` if the ego cannot fork.
    fn fork(&self) -> Option<Box<dyn Scene>>;
}
