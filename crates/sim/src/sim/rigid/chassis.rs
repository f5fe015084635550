//! Rigid body that no other body touches.
//!
//! Up to the first contact every chassis moves alone. Its step is that of rapier's
//! pipeline for one body without colliders and joints, bit for bit: forces, gyroscopic
//! moment, speed limits, then position. The pipeline also looks after islands, broad
//! phase, narrow phase and solver, which have nothing to do here. The tests compare the
//! two.

use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{
    IntegrationParameters, MassProperties, RigidBody, RigidBodyBuilder, RigidBodyMassProps,
    RigidBodyType, RigidBodyVelocity,
};

use super::chassis_motion::{ChassisMotion, vector};
use super::wheels::{Carried, Wheel, reciprocal, roll};
use crate::sim::GRAVITY_MPS2;

/// Greatest rotation per step.
const MAX_TURN_RAD: f32 = core::f32::consts::FRAC_PI_4;

/// Chassis of a world, numbered in the order of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChassisId(pub usize);

/// Chassis of a car, as long as it moves alone.
#[derive(Clone, Debug)]
pub(super) struct Chassis {
    pose: Pose,
    velocity: RigidBodyVelocity<f32>,
    mass: RigidBodyMassProps,
    /// Moments of inertia about the centre of mass.
    inertia: Vector,
    weight_n: Vector,
    force_n: Vector,
    /// False once a number is not finite. The body then stays where it was.
    is_enabled: bool,
}

impl Chassis {
    /// Creates a chassis with its velocity.
    pub(super) fn new(properties: MassProperties, pose: Pose, linear: Vector) -> Chassis {
        // Bodies without colliders have the sum of no mass and their own in rapier.
        let properties = MassProperties::default() + properties;
        let mut mass = RigidBodyMassProps::from(properties);
        mass.update_world_mass_properties(RigidBodyType::Dynamic, &pose);
        let gravity = vector(0.0, 0.0, -GRAVITY_MPS2);
        Chassis {
            pose,
            velocity: RigidBodyVelocity::new(linear, Vector::ZERO),
            inertia: properties.principal_inertia(),
            weight_n: gravity * mass.effective_inv_mass.map(reciprocal),
            force_n: Vector::ZERO,
            is_enabled: true,
            mass,
        }
    }

    /// Returns the same body for rapier's sets.
    pub(super) fn rigid_body(&self) -> RigidBody {
        let mut body = RigidBodyBuilder::dynamic()
            .pose(self.pose)
            .linvel(self.velocity.linvel)
            .angvel(self.velocity.angvel)
            .additional_mass_properties(self.mass.local_mprops)
            .enabled(self.is_enabled)
            .can_sleep(false)
            .build();
        body.add_force(self.force_n, true);
        body
    }

    /// Lets the wheels act for a step.
    pub(super) fn roll(&mut self, wheels: &mut [Wheel; 4], dt_s: f32) {
        roll(wheels, &mut self.carried(), dt_s);
    }

    /// Changes the velocity by an impulse at the centre of mass and an angular impulse.
    pub(super) fn push(&mut self, impulse: Vector, angular: Vector) {
        self.carried().push(impulse, angular);
    }

    /// Sets the external force at the centre of mass.
    pub(super) fn set_force(&mut self, force_n: Vector) {
        // rapier adds it to no force, which gives zeros a positive sign.
        self.force_n = Vector::ZERO + force_n;
    }

    pub(super) fn motion(&self) -> ChassisMotion {
        ChassisMotion {
            pose: self.pose,
            linear: self.velocity.linvel,
            angular: self.velocity.angvel,
        }
    }

    /// Sets the pose and velocity.
    ///
    /// Equal numbers keep their sign of zero, as in rapier.
    pub(super) fn place(&mut self, motion: &ChassisMotion) {
        if self.pose != motion.pose {
            self.pose = motion.pose;
            self.update_mass();
        }
        if self.velocity.linvel != motion.linear {
            self.velocity.linvel = motion.linear;
        }
        if self.velocity.angvel != motion.angular {
            self.velocity.angvel = motion.angular;
        }
    }

    /// Stops moving for good.
    pub(super) fn disable(&mut self) {
        self.velocity = RigidBodyVelocity::zero();
        self.force_n = Vector::ZERO;
        self.is_enabled = false;
    }

    /// Moves for one step.
    pub(super) fn step(&mut self, parameters: &IntegrationParameters) {
        if !self.is_enabled {
            return;
        }
        if !self.velocity.is_finite() {
            self.disable();
            return;
        }
        self.accelerate(parameters);
        let pose = self.moved(parameters.dt);
        if !pose.is_finite() {
            self.disable();
            return;
        }
        self.pose = pose;
        self.update_mass();
    }

    fn accelerate(&mut self, parameters: &IntegrationParameters) {
        let dt_s = parameters.dt;
        let force_n = self.force_n + self.weight_n;
        self.velocity.linvel += force_n * self.mass.effective_inv_mass * dt_s;
        // No moment acts. The sum gives zeros a positive sign.
        self.velocity.angvel += Vector::ZERO;
        self.turn_gyroscopically(dt_s);
        let limit = |velocity: &mut Vector, most: f32| {
            let length = velocity.length();
            if length > most {
                *velocity *= most / length;
            }
        };
        limit(&mut self.velocity.linvel, parameters.max_linear_velocity());
        limit(
            &mut self.velocity.angvel,
            MAX_TURN_RAD * parameters.inv_dt(),
        );
    }

    /// Lets the gyroscopic moment act, which keeps the angular momentum.
    fn turn_gyroscopically(&mut self, dt_s: f32) {
        let properties = &self.mass.local_mprops;
        let axes = self.pose.rotation * properties.principal_inertia_local_frame;
        let turn = axes.inverse() * self.velocity.angvel;
        let momentum = self.inertia * turn;
        let turned = momentum + -turn.cross(momentum) * dt_s;
        let squared = turned.length_squared();
        if squared != 0.0 {
            let kept = turned * (momentum.length_squared() / squared).sqrt();
            self.velocity.angvel = axes * (properties.inv_principal_inertia * kept);
        }
    }

    /// Returns the pose after a time at the present velocity.
    fn moved(&self, dt_s: f32) -> Pose {
        let com = self.mass.local_mprops.local_com;
        let mut pose = self.pose.prepend_translation(com);
        let half_turn = self.velocity.angvel * (dt_s * 0.5);
        let turn = Rotation::from_xyzw(half_turn.x, half_turn.y, half_turn.z, 1.0);
        pose.rotation = (turn * pose.rotation).normalize();
        pose.translation += self.velocity.linvel * dt_s;
        pose.prepend_translation(-com)
    }

    fn update_mass(&mut self) {
        self.mass
            .update_world_mass_properties(RigidBodyType::Dynamic, &self.pose);
    }

    fn carried(&mut self) -> Carried<'_> {
        Carried {
            pose: &self.pose,
            mass: &self.mass,
            velocity: &mut self.velocity,
        }
    }
}
