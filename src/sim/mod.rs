//! The plants: what vehicles and walkers do when commanded, and what they hit.
//!
//! One trait, two implementations: [`kinematic`] (2D, closed form) and
//! [`rigid`] (3D, rapier ray-cast cars with parry contacts). The ground is
//! flat and unbounded; roads are a matter of the scene. What they model and
//! what not is in `docs/physics.md`.
//!
//! Frame: x forward, y left, z up (ISO 8855). Poses and states are of the
//! **front bumper's middle**, projected to the ground.
//!
//! ```
//! use brakecheck::sim::{Body, BodyCommand, Ground, PlantKind, Pose, plant};
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
//! does not know who is the ego.

mod body;
pub mod kinematic;
mod limits;
mod planar;
pub mod rigid;
mod vehicle;
mod walker;

use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

pub use body::{Body, BodyError, BodyKind, InvalidBody};
pub use kinematic::Kinematic;
pub use rigid::Rigid;
pub use vehicle::Vehicle;
pub use walker::Walker;

/// Gravity, downwards.
pub const GRAVITY_MPS2: f64 = 9.81;

/// An empty plant of a kind.
pub fn plant(kind: PlantKind, ground: Ground) -> Box<dyn Plant> {
    match kind {
        PlantKind::Rigid => Box::new(Rigid::new(ground)),
        PlantKind::Kinematic => Box::new(Kinematic::new(ground)),
    }
}

/// The command, unless a number in it is not finite.
fn finite(command: BodyCommand) -> Option<BodyCommand> {
    let numbers = match command {
        BodyCommand::Drive {
            accel_mps2,
            curvature_per_m,
        } => [accel_mps2, curvature_per_m, 0.0],
        BodyCommand::Walk { x_mps, y_mps } => [x_mps, y_mps, 0.0],
        BodyCommand::Glide { to } | BodyCommand::Carry { to } => [to.x_m, to.y_m, to.heading_rad],
    };
    numbers.iter().all(|it| it.is_finite()).then_some(command)
}

/// A body in a plant, numbered in the order of spawning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct BodyId(pub usize);

/// The two plants.
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
)]
#[strum(serialize_all = "kebab-case")]
pub enum PlantKind {
    /// 3D rigid bodies on rapier3d.
    Rigid,
    /// 2D, closed form.
    Kinematic,
}

/// The ground all bodies stand on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ground {
    /// Coefficient of friction μ between tyre and road, above 0.
    pub friction: f64,
}

/// A pose of the front bumper's middle on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position along world x.
    pub x_m: f64,
    /// Position along world y (left).
    pub y_m: f64,
    /// Counter-clockwise from world x.
    pub heading_rad: f64,
}

/// What a body does, as a plant reports it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyState {
    /// Where the front bumper is.
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

/// What a body is asked to do until the next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyCommand {
    /// A wheeled vehicle: net acceleration along the heading and path curvature.
    ///
    /// The plant caps the acceleration at ±μg and by engine power; a braking
    /// vehicle stops at speed 0 unless it was already rolling backwards.
    Drive {
        /// Net acceleration.
        accel_mps2: f64,
        /// Curvature of the path, positive to the left.
        curvature_per_m: f64,
    },
    /// A walker: a velocity in the world frame, reached at the walker's acceleration.
    Walk {
        /// Along world x.
        x_mps: f64,
        /// Along world y.
        y_mps: f64,
    },
    /// Any body of the kinematic plant: be there after the next `advance`.
    ///
    /// It moves and turns evenly whatever its engine and tyres could do, as a
    /// recorded motion does, and stands until it is told to glide on. It takes
    /// no other command any more, and passes through others that glide.
    Glide {
        /// Where the front bumper is then.
        to: Pose,
    },
    /// Any body, on either plant: be there after the next `advance`.
    ///
    /// As test targets on platforms are carried: it moves and turns evenly
    /// whatever its engine and tyres could do, stands until it is told to go on,
    /// takes no [`BodyCommand::Drive`] and no [`BodyCommand::Walk`] any more, and
    /// touches whoever is in its way.
    Carry {
        /// Where the front bumper is then.
        to: Pose,
    },
}

/// Which commands a body takes: all that anybody above the plants needs to know
/// of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyControl {
    /// [`BodyCommand::Drive`].
    Drive,
    /// [`BodyCommand::Walk`].
    Walk,
}

/// The first touch of two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The two bodies, lower number first.
    pub pair: (BodyId, BodyId),
    /// Seconds after the beginning of the `advance` that reports it.
    pub after_s: f64,
    /// Speed at which the two approach each other along the contact normal, ≥ 0.
    pub closing_speed_mps: f64,
    /// Where, in the world frame.
    pub point_m: [f64; 3],
    /// The contact normal on the ground: a unit vector from the first body of
    /// the pair to the second, square to the face that is touched.
    pub normal: [f64; 2],
}

/// Position and orientation of a body's centre, for viewers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Centre of the bounding box in the world frame.
    pub centre_m: [f64; 3],
    /// Quaternion (x, y, z, w).
    pub rotation: [f64; 4],
}

/// A plant: bodies on flat ground, stepped together.
///
/// Equal calls give equal bits, also on a fork and on any thread.
pub trait Plant: Send {
    /// Which one it is.
    fn kind(&self) -> PlantKind;
    /// Removes all bodies and lays new ground; time starts at 0.
    fn clear(&mut self, ground: Ground);
    /// Puts a body on the ground, moving along its heading.
    ///
    /// It coasts (a walker keeps walking) until it is commanded. The body must
    /// be valid (see [`Body::validate`]); a walker starts no faster than it can.
    fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) -> BodyId;
    /// From now on bodies pass through each other, cleared or not: `advance`
    /// finds no contact any more, and changes nothing else.
    fn pass_through(&mut self);
    /// Sets what the body does from now on.
    ///
    /// A command that is not finite, or not of the body's kind, is not obeyed
    /// and makes the plant unsound until it is cleared.
    fn command(&mut self, id: BodyId, command: BodyCommand);
    /// Moves on by `dt_s` in `substeps` equal steps; stops at first contact.
    ///
    /// Returns the earliest contact within the step, if any. Every body then is
    /// where it is at that instant, and there it stays: a plant never moves on
    /// while two bodies touch and approach each other, but reports the contact
    /// again after 0 s. Bodies that overlap are in contact even if they part.
    fn advance(&mut self, dt_s: f64, substeps: u32) -> Option<Contact>;
    /// State of a body.
    fn state(&self, id: BodyId) -> BodyState;
    /// Centre and orientation of a body.
    fn placement(&self, id: BodyId) -> Placement;
    /// Clearance between the two bodies' upright boxes, 0 when they touch.
    fn gap_m(&self, a: BodyId, b: BodyId) -> f64;
    /// Whether every state is finite and in bounds, and every command was fit.
    ///
    /// The bounds are 1000 km from the origin, and 200 m/s on the rigid plant.
    fn sound(&self) -> bool;
    /// An independent copy that continues bit for bit.
    fn fork(&self) -> Box<dyn Plant>;
}
