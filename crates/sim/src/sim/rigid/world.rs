//! Chassis of the rigid plant, the only place that computes in f32.
//!
//! Up to the first contact nothing collides, and every [`Chassis`] moves alone. From
//! [`RapierWorld::solid`] on rapier's pipeline moves them and resolves collisions. The
//! wheels' rays see only the ground, which is the same everywhere, so each car has an
//! origin of its own, which follows it. f32 positions stay as fine as 1 µm wherever the
//! car drives.

use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{IntegrationParameters, MassProperties};

use super::chassis::{Chassis, ChassisId};
use super::chassis_motion::{ChassisMotion, vector};
use super::collision_world::CollisionWorld;
use super::wheels::Wheel;
use crate::sim::Body;
use crate::sim::planar::Rect;

/// Grid of the cars' origins. Shifts by it are exact in f32.
const GRID_M: f64 = 8.0;

/// All chassis, first alone and later in one world of rapier.
#[derive(Clone)]
pub(super) struct RapierWorld {
    chassis: Vec<Chassis>,
    removed: Vec<ChassisId>,
    parameters: IntegrationParameters,
    /// World in which bodies collide, from the first contact on.
    together: Option<Box<CollisionWorld>>,
}

impl RapierWorld {
    /// Creates flat ground at height 0, without bodies.
    pub(super) fn new() -> RapierWorld {
        RapierWorld {
            chassis: Vec::new(),
            removed: Vec::new(),
            // More solver iterations give a car at rest a phantom velocity.
            parameters: IntegrationParameters {
                num_solver_iterations: 1,
                ..Default::default()
            },
            together: None,
        }
    }

    /// Removes all bodies.
    pub(super) fn clear(&mut self) {
        self.chassis.clear();
        self.removed.clear();
        self.together = None;
    }

    /// Puts a chassis on the ground and returns it with its origin.
    ///
    /// The frame of the chassis lies on the ground, below the middle of the box.
    pub(super) fn insert(&mut self, body: &Body, rect: &Rect) -> (ChassisId, (f64, f64)) {
        let origin_m = origin_near((rect.x_m, rect.y_m));
        (self.insert_at(body, rect, origin_m), origin_m)
    }

    /// Puts a body on the ground, relative to a given origin.
    pub(super) fn insert_at(
        &mut self,
        body: &Body,
        rect: &Rect,
        origin_m: (f64, f64),
    ) -> ChassisId {
        let (l, w, h) = (body.length_m, body.width_m, body.height_m);
        // Moments of inertia of a uniform box.
        let twelfth = body.mass_kg / 12.0;
        let inertia = vector(
            twelfth * (w * w + h * h),
            twelfth * (l * l + h * h),
            body.yaw_inertia_kg_m2(),
        );
        let com = vector(body.com_ahead_m, 0.0, body.com_height_m);
        // Half-angle formulas avoid the platform's sine.
        let half_cos = (0.5 * (1.0 + rect.cos)).max(0.0).sqrt();
        let half_sin = (0.5 * (1.0 - rect.cos)).max(0.0).sqrt().copysign(rect.sin);
        let rotation = Rotation::from_xyzw(0.0, 0.0, half_sin as f32, half_cos as f32).normalize();
        let translation = vector(rect.x_m - origin_m.0, rect.y_m - origin_m.1, 0.0);
        let chassis = Chassis::new(
            MassProperties::new(com, body.mass_kg as f32, inertia),
            Pose::from_parts(translation, rotation),
            vector(rect.vx_mps, rect.vy_mps, 0.0),
        );
        if let Some(together) = &mut self.together {
            return together.insert(&chassis);
        }
        self.chassis.push(chassis);
        ChassisId(self.chassis.len() - 1)
    }

    /// Lets rapier resolve contacts from now on.
    ///
    /// Bodies that slide on the ground have its friction or theirs, whichever is less.
    pub(super) fn solid(&mut self, friction: f64) {
        let (chassis, removed) = (&self.chassis, &self.removed);
        let parameters = self.parameters;
        self.together
            .get_or_insert_with(|| Box::new(CollisionWorld::new(chassis, removed, parameters)))
            .set_friction(friction);
    }

    /// Returns the world in which bodies collide, if they do.
    pub(super) fn together_mut(&mut self) -> Option<&mut CollisionWorld> {
        self.together.as_deref_mut()
    }

    /// Sets the external force at a body's centre of mass, along world x and y.
    pub(super) fn set_force(&mut self, id: ChassisId, (x_n, y_n): (f64, f64)) {
        let force_n = vector(x_n, y_n, 0.0);
        match &mut self.together {
            Some(together) => together.set_force(id, force_n),
            None => self.chassis[id.0].set_force(force_n),
        }
    }

    /// Moves a body to another origin without moving it in the world.
    pub(super) fn move_origin(&mut self, id: ChassisId, from_m: (f64, f64), to_m: (f64, f64)) {
        let mut motion = self.motion(id);
        motion.pose.translation += vector(from_m.0 - to_m.0, from_m.1 - to_m.1, 0.0);
        self.place(id, &motion);
    }

    /// Removes a chassis.
    pub(super) fn remove(&mut self, id: ChassisId) {
        if let Some(together) = &mut self.together {
            return together.remove(id);
        }
        self.chassis[id.0].disable();
        self.removed.push(id);
    }

    /// Lets a car's wheels act on its chassis for a step.
    pub(super) fn roll(&mut self, id: ChassisId, wheels: &mut [Wheel; 4], dt_s: f64) {
        match &mut self.together {
            Some(together) => together.roll(id, wheels, dt_s as f32),
            None => self.chassis[id.0].roll(wheels, dt_s as f32),
        }
    }

    /// Pushes a body on the ground with an impulse at its centre of mass and an angular
    /// impulse about it, both in the frame of its heading.
    pub(super) fn push(
        &mut self,
        id: ChassisId,
        (cos, sin): (f64, f64),
        (along, across): (f64, f64),
        [roll, pitch, yaw]: [f64; 3],
    ) {
        let turned = |x: f64, y: f64, z: f64| vector(x * cos - y * sin, x * sin + y * cos, z);
        let (impulse, angular) = (turned(along, across, 0.0), turned(roll, pitch, yaw));
        match &mut self.together {
            Some(together) => together.push(id, impulse, angular),
            None => self.chassis[id.0].push(impulse, angular),
        }
    }

    /// Moves all bodies for one step.
    pub(super) fn step(&mut self, dt_s: f64) {
        self.parameters.dt = dt_s as f32;
        if let Some(together) = &mut self.together {
            return together.step(dt_s as f32);
        }
        for chassis in &mut self.chassis {
            chassis.step(&self.parameters);
        }
    }

    /// Returns the pose and velocity of a chassis.
    pub(super) fn motion(&self, id: ChassisId) -> ChassisMotion {
        match &self.together {
            Some(together) => together.motion(id),
            None => self.chassis[id.0].motion(),
        }
    }

    /// Moves a car's origin to the car once the car is far from it.
    pub(super) fn recentre(&mut self, id: ChassisId, origin_m: &mut (f64, f64)) {
        let mut motion = self.motion(id);
        let Vector { x, y, .. } = motion.pose.translation;
        // Two grid cells of slack, so that a car near a cell border does not shift
        // at every step.
        if x.abs().max(y.abs()) <= 2.0 * GRID_M as f32 {
            return;
        }
        let (shift_x_m, shift_y_m) = (on_grid(f64::from(x)), on_grid(f64::from(y)));
        motion.pose.translation -= vector(shift_x_m, shift_y_m, 0.0);
        self.place(id, &motion);
        *origin_m = (origin_m.0 + shift_x_m, origin_m.1 + shift_y_m);
    }

    /// Sets the pose and velocity of a chassis.
    pub(super) fn place(&mut self, id: ChassisId, motion: &ChassisMotion) {
        match &mut self.together {
            Some(together) => together.place(id, motion),
            None => self.chassis[id.0].place(motion),
        }
    }
}

/// Returns the grid point next to a position.
pub(super) fn origin_near((x_m, y_m): (f64, f64)) -> (f64, f64) {
    (on_grid(x_m), on_grid(y_m))
}

fn on_grid(value_m: f64) -> f64 {
    libm::round(value_m / GRID_M) * GRID_M
}
