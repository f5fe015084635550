//! Plants: the motion of road users under commands, and their contacts.
//!
//! One trait has two implementations: [`kinematic`] (2D, closed form) and
//! [`rigid`] (3D, rapier ray-cast cars with parry contacts). The ground is a plane, or
//! the surface that a scene lays under the rigid plant. Roads belong to the scene.
//! `docs/background/physics.md` lists the scope and the limits of both models.
//!
//! Frame: x forward, y left, z up (ISO 8855). Poses and states refer to the
//! **middle of the front bumper**, projected to the ground.
//!
//! ```
//! use brakecheck_sim::sim::{Body, BodyCommand, Ground, Pose, plant};
//! use brakecheck_sim::sim::PlantKind;
//!
//! let sedan = Body::shipped("sedan").unwrap().unwrap();
//! let mut plant = plant(PlantKind::Rigid, Ground { friction: 0.9 });
//! let rear = plant.spawn(&sedan, Pose::default(), 20.0);
//! let front = plant.spawn(&sedan, Pose { x_m: 14.54, ..Pose::default() }, 0.0);
//! plant.command(front, BodyCommand::Drive { accel_mps2: -6.0, curvature_per_m: 0.0 });
//! let contact = (0..100).find_map(|_| plant.advance(0.05, 4)).unwrap();
//! assert_eq!(contact.pair, (rear, front));
//! assert!((contact.closing_speed_mps - 20.0).abs() < 1e-3);
//! ```
//!
//! Architecture Invariant: no reward, no rule and no role lives here. A plant
//! does not know which body is the ego.

mod body;
mod body_model;
mod body_shape;
mod cyclist;
mod handling;
pub mod kinematic;
mod limits;
mod planar;
mod push;
mod riding;
pub mod rigid;
mod vehicle;
mod walker;
mod wind;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

pub use crate::pose::{GroundFrame, rotation_by, sine, wrapped};
pub use crate::pose::{Placement, Pose};
pub use body::{Body, BodyError, BodyKind};
pub use body_model::{BodyDimensions, InvalidBody};
pub use body_shape::{BodyPart, BodyShape};
pub use cyclist::Cyclist;
pub use handling::{Brakes, Tyres};
pub use kinematic::Kinematic;
pub(crate) use limits::AIR_KG_PER_M3;
pub use planar::{PosedBody, body_gap_m};
pub use push::Push;
pub use rigid::{GroundSurface, Rigid};
pub use vehicle::Vehicle;
pub use walker::Walker;
pub use wind::{Gust, Wind};

/// Gravitational acceleration, downwards.
pub const GRAVITY_MPS2: f64 = 9.81;

/// Creates an empty plant of a kind.
pub fn plant(kind: PlantKind, ground: Ground) -> Box<dyn Plant> {
    match kind {
        PlantKind::Rigid => Box::new(Rigid::new(ground)),
        PlantKind::Kinematic => Box::new(Kinematic::new(ground)),
    }
}

/// Returns the command, or `None` if a number in it is not finite.
fn finite(command: BodyCommand) -> Option<BodyCommand> {
    // Exhaustive, so that a new command must list its numbers. Shorter lists are
    // padded with zeros.
    let numbers = match command {
        BodyCommand::Drive {
            accel_mps2,
            curvature_per_m,
        } => [accel_mps2, curvature_per_m, 0.0],
        BodyCommand::Walk { x_mps, y_mps } => [x_mps, y_mps, 0.0],
        BodyCommand::Glide { to } | BodyCommand::Carry { to } | BodyCommand::Jump { to } => {
            [to.x_m, to.y_m, to.heading_rad]
        }
    };
    // One NaN would reach every body through the contacts.
    numbers.iter().all(|it| it.is_finite()).then_some(command)
}

/// A body in a plant, numbered in the order of spawning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct BodyId(pub usize);

/// Physical model of a plant.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    Serialize,
    Deserialize,
    VariantArray,
    EnumString,
    IntoStaticStr,
    EnumMessage,
    JsonSchema,
)]
#[strum(serialize_all = "kebab-case")]
pub enum PlantKind {
    /// 3D rigid bodies on rapier3d.
    Rigid,
    /// 2D, closed form.
    Kinematic,
}

/// Ground under all bodies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ground {
    /// Coefficient of friction μ between tyre and road, above 0.
    pub friction: f64,
}

/// State of a body, as a plant reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyState {
    /// Pose of the front bumper.
    pub pose: Pose,
    /// Velocity along the heading.
    pub speed_mps: f64,
    /// Velocity to the left of the heading.
    pub lateral_mps: f64,
    /// Turning rate, counter-clockwise.
    pub yaw_rate_rad_per_s: f64,
    /// Mean acceleration along the heading over the last `advance`.
    pub accel_mps2: f64,
}

/// Command to a body, in force until the next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyCommand {
    /// Command to a vehicle or cyclist: net acceleration and path curvature.
    ///
    /// The plant caps the acceleration at ±μg and by engine power. A braking vehicle
    /// stops at speed 0 unless it was already rolling backwards.
    Drive {
        /// Net acceleration along the heading.
        accel_mps2: f64,
        /// Curvature of the path, positive to the left.
        curvature_per_m: f64,
    },
    /// Command to a walker: a velocity in the world frame.
    ///
    /// The walker reaches it at its own acceleration.
    Walk {
        /// Along world x.
        x_mps: f64,
        /// Along world y.
        y_mps: f64,
    },
    /// Moves any body of the kinematic plant to a pose in the next `advance`.
    ///
    /// The body moves and turns evenly, as a recorded motion does, without regard to
    /// its engine and tyres. It rests until the next glide command and accepts no
    /// other command. It passes through other gliding bodies.
    Glide {
        /// Pose of the front bumper at the end.
        to: Pose,
    },
    /// Moves any body, on either plant, to a pose in the next `advance`.
    ///
    /// This models a test target on a platform. The body moves and turns evenly,
    /// without regard to its engine and tyres, and rests until the next carry
    /// command. It accepts no [`BodyCommand::Drive`] and no [`BodyCommand::Walk`],
    /// and its contacts are detected.
    Carry {
        /// Pose of the front bumper at the end.
        to: Pose,
    },
    /// Puts any body, on either plant, at a pose, where it rests in the next `advance`.
    ///
    /// It touches nothing on the way there. From then on it is a carried body.
    Jump {
        /// Pose of the front bumper.
        to: Pose,
    },
}

impl BodyCommand {
    /// Returns acceleration and curvature, or `None` for a command not for vehicles.
    fn drive(self) -> Option<(f64, f64)> {
        match self {
            BodyCommand::Drive {
                accel_mps2,
                curvature_per_m,
            } => Some((accel_mps2, curvature_per_m)),
            _ => None,
        }
    }
}

/// Kind of command that a body accepts.
///
/// Code above the plants needs to know nothing else about a body's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyControl {
    /// [`BodyCommand::Drive`].
    Drive,
    /// [`BodyCommand::Walk`].
    Walk,
}

/// First contact of two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Bodies in contact, lower number first.
    pub pair: (BodyId, BodyId),
    /// Time since the beginning of the `advance` that reports the contact.
    pub after_s: f64,
    /// Approach speed along the contact normal, ≥ 0.
    pub closing_speed_mps: f64,
    /// Contact point in the world frame.
    pub point_m: [f64; 3],
    /// Contact normal on the ground.
    ///
    /// A unit vector from the first body of the pair to the second, perpendicular to
    /// the touched face.
    pub normal: [f64; 2],
}

/// Collision of two bodies after the first contact, as the physics resolved it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collision {
    /// Bodies that collided, lower number first.
    pub pair: (BodyId, BodyId),
    /// Time since [`Plant::collide`] at which the first force acted.
    pub after_s: f64,
    /// Time from the first to the last force between the two.
    pub duration_s: f64,
    /// Change of the velocity of each centre of mass, along world x and y.
    ///
    /// It includes the forces of other bodies that acted in the same steps.
    pub delta_v_mps: [[f64; 2]; 2],
}

/// Plant: bodies on the ground, stepped together.
///
/// Equal calls give equal bits, on a fork and on any thread as well.
pub trait Plant: Send {
    /// Returns the kind of the plant.
    fn kind(&self) -> PlantKind;
    /// Removes all bodies and lays new ground. Time restarts at 0.
    fn clear(&mut self, ground: Ground);
    /// Replaces the plane by a surface, until [`Plant::clear`]. `None` is the plane.
    ///
    /// Bodies spawn on it. The kinematic plant has no surface and ignores it.
    fn lay(&mut self, _surface: Option<&GroundSurface>) {}
    /// Changes the ground under the bodies, from the next `advance` on.
    fn set_ground(&mut self, ground: Ground);
    /// Puts a body on the ground, moving along its heading.
    ///
    /// The body coasts (a walker keeps walking) until its first command. It must be
    /// valid (see [`Body::validate`]). A walker or cyclist starts at most at its top
    /// speed, and a cyclist never backwards.
    fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) -> BodyId;
    /// Lets bodies pass through each other from now on.
    ///
    /// `advance` detects no contact any more and changes nothing else. The mode
    /// survives [`Plant::clear`].
    fn pass_through(&mut self);
    /// Lets bodies collide from now on, instead of ending the motion at a contact.
    ///
    /// `touching` are the bodies in contact. They, and every body that collides
    /// later, let go of their controls: vehicles roll freely, and others move as
    /// the collision throws them. `advance` returns no contact any more. Returns
    /// false on a plant that resolves no collisions, and changes nothing there:
    /// [`Rigid::taking_over`] does it instead.
    fn collide(&mut self, _touching: (BodyId, BodyId)) -> bool {
        false
    }
    /// Returns the collisions since [`Plant::collide`], in the order of time.
    ///
    /// A collision that still lasts counts as ended.
    fn collisions(&mut self) -> Vec<Collision> {
        Vec::new()
    }
    /// Sets the command of a body.
    ///
    /// A command that is not finite, or not of the body's kind, is ignored and makes
    /// the plant unsound until it is cleared.
    fn command(&mut self, id: BodyId, command: BodyCommand);
    /// Sets the external acceleration of a body, [`Push::NONE`] after its spawn.
    ///
    /// It adds to the net acceleration that tyres and engine give. At rest the brakes
    /// hold, unless the command accelerates. Walkers and carried bodies ignore it. The
    /// kinematic plant has no side motion and ignores the part to the left. A push that
    /// is not finite makes the plant unsound until it is cleared.
    fn push(&mut self, id: BodyId, push: Push);
    /// Advances by `dt_s` in `substeps` equal steps, up to the first contact.
    ///
    /// Returns the earliest contact within the step, if any. Every body then rests
    /// at its pose of that instant. The plant does not move on while two bodies
    /// touch and approach each other, but reports the contact again after 0 s.
    /// Bodies that overlap are in contact even if they move apart.
    fn advance(&mut self, dt_s: f64, substeps: u32) -> Option<Contact>;
    /// Returns the state of a body.
    fn state(&self, id: BodyId) -> BodyState;
    /// Returns the centre and orientation of a body.
    fn placement(&self, id: BodyId) -> Placement;
    /// Returns the clearance between two bodies' upright boxes, 0 if they touch.
    fn gap_m(&self, a: BodyId, b: BodyId) -> f64;
    /// Returns the steps of rapier's pipeline since the last [`Plant::clear`].
    ///
    /// 0 on a plant without rapier.
    fn rapier_steps(&self) -> u64 {
        0
    }
    /// Returns true if all states are finite and bounded and all commands valid.
    ///
    /// The bounds are 1000 km from the origin, and 200 m/s on the rigid plant.
    fn sound(&self) -> bool;
    /// Returns an independent copy that continues bit for bit.
    fn fork(&self) -> Box<dyn Plant>;
}
