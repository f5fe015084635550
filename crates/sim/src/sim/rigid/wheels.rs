//! Wheels of a car on flat ground.
//!
//! A wheel is a ray with a spring, a damper and a friction circle: the model of rapier's
//! `DynamicRayCastVehicleController`, bit for bit. That controller searches all colliders
//! with each ray. Below a wheel there is only the ground, so here the hit is its closed
//! form. The tests compare the two.

use parry3d::query::{Ray, RayCast};
use parry3d::shape::HalfSpace;
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{RigidBodyMassProps, RigidBodyVelocity};

/// Direction of a suspension in the frame of the chassis.
const DOWN: Vector = Vector::new(0.0, 0.0, -1.0);
/// Axle of a wheel that is not steered. A wheel rolls along normal × axle.
const AXLE: Vector = Vector::new(0.0, -1.0, 0.0);
/// Force above any suspension's need, so that a spring always carries its car.
const MAX_SUSPENSION_FORCE_N: f32 = 1e6;
/// Least sine of the angle between suspension and ground.
const LEAST_SINE: f32 = 0.1;
/// Share of the side slip that the wheels of a car take away per step and unit of grip.
const SIDE_SHARE: f32 = 0.2;
/// Share of a force along the wheel in its friction circle.
const ALONG_SHARE: f32 = 0.5;
/// Share of the height at which side forces act, from the centre of mass to the ground.
const ROLL_SHARE: f32 = 0.1;
/// Value below which rapier takes a reciprocal as 0.
const LEAST_DIVISOR: f32 = 1e-20;

/// Wheel with its suspension and its current command.
#[derive(Clone, Debug)]
pub(super) struct Wheel {
    /// Upper end of the suspension in the frame of the chassis.
    pub hub: Vector,
    pub rest_m: f32,
    pub travel_m: f32,
    pub radius_m: f32,
    /// Stiffness per mass of the car, in both directions of the travel.
    pub stiffness: f32,
    /// Damping per mass of the car.
    pub damping: f32,
    pub side_stiffness: f32,
    pub friction: f32,
    pub engine_n: f32,
    pub steering_rad: f32,
    /// Force of the suspension in the last step.
    pub load_n: f32,
}

/// Directions that all wheels of a car share in a step.
struct Stance {
    /// Direction of the suspensions.
    down: Vector,
    /// Axle without steering.
    axle: Vector,
    /// Directions without steering on the upper side of the ground.
    rolling: Rolling,
}

/// Directions in the plane of the ground, of a wheel.
#[derive(Clone, Copy, Default)]
struct Rolling {
    axle: Vector,
    ahead: Vector,
}

/// Contact of a wheel with the ground.
#[derive(Clone, Copy)]
struct GroundContact {
    point: Vector,
    normal: Vector,
    rolling: Rolling,
}

/// Impulses of the friction on a wheel.
#[derive(Clone, Copy, Default)]
struct WheelImpulse {
    along: f32,
    across: f32,
}

/// Rigid body that wheels carry.
pub(super) struct Carried<'a> {
    pub pose: &'a Pose,
    pub mass: &'a RigidBodyMassProps,
    pub velocity: &'a mut RigidBodyVelocity<f32>,
}

/// Lets the wheels of a car act on its body for a step.
pub(super) fn roll(wheels: &mut [Wheel; 4], body: &mut Carried, dt_s: f32) {
    let stance = Stance::of(body.pose);
    let mass_kg = body.mass.mass();
    let mut contacts = [None; 4];
    for (wheel, contact) in wheels.iter_mut().zip(&mut contacts) {
        *contact = wheel.stand(body, &stance, mass_kg);
    }
    for (wheel, contact) in wheels.iter().zip(&contacts) {
        if let Some(GroundContact { point, normal, .. }) = contact {
            let force_n = wheel.load_n.min(MAX_SUSPENSION_FORCE_N);
            body.push_at(*normal * force_n * dt_s, *point);
        }
    }
    // All side slips are of the same instant, before any friction acts.
    let mut impulses = [WheelImpulse::default(); 4];
    for ((wheel, contact), impulse) in wheels.iter().zip(&contacts).zip(&mut impulses) {
        if let Some(contact) = contact {
            *impulse = wheel.friction(body, contact, dt_s);
        }
    }
    let up = body.pose.rotation * Vector::Z;
    for (contact, impulse) in contacts.iter().zip(&impulses) {
        if let Some(contact) = contact {
            body.apply(contact, impulse, up);
        }
    }
}

impl Stance {
    fn of(pose: &Pose) -> Stance {
        // A steering angle of 0 turns by the identity, which gives zeros a positive sign.
        let axle = Rotation::IDENTITY * (pose.rotation * AXLE);
        Stance {
            down: pose.rotation * DOWN,
            axle,
            rolling: Rolling::of(axle, Vector::Z),
        }
    }
}

impl Rolling {
    fn of(axle: Vector, normal: Vector) -> Rolling {
        let out_of_plane = axle.dot(normal);
        let axle = (axle - normal * out_of_plane).normalize_or_zero();
        Rolling {
            axle,
            ahead: normal.cross(axle).normalize_or_zero(),
        }
    }
}

impl Wheel {
    /// Presses the wheel on the ground, if it reaches it.
    fn stand(&mut self, body: &Carried, stance: &Stance, mass_kg: f32) -> Option<GroundContact> {
        let reach_m = self.rest_m + self.radius_m;
        let (hub, ray) = (*body.pose * self.hub, stance.down * reach_m);
        let Some((share, normal)) = hit_ground(hub, ray, stance.down) else {
            self.load_n = 0.0;
            return None;
        };
        let spring_m = (share * reach_m - self.radius_m)
            .clamp(self.rest_m - self.travel_m, self.rest_m + self.travel_m);
        let point = hub + ray * share;
        let slope = normal.dot(stance.down);
        let away_mps = normal.dot(body.velocity_at(point));
        let (stretch, rate_mps) = if slope >= -LEAST_SINE {
            (1.0 / LEAST_SINE, 0.0)
        } else {
            let stretch = -1.0 / slope;
            (stretch, away_mps * stretch)
        };
        let mut force = self.stiffness * (self.rest_m - spring_m) * stretch;
        force -= self.damping * rate_mps;
        self.load_n = (force * mass_kg).max(0.0);
        Some(GroundContact {
            point,
            normal,
            rolling: self.rolling(body.pose, stance, (share, normal)),
        })
    }

    fn rolling(&self, pose: &Pose, stance: &Stance, (share, normal): (f32, Vector)) -> Rolling {
        if self.steering_rad != 0.0 {
            let steering = Rotation::from_scaled_axis(-stance.down * self.steering_rad);
            return Rolling::of(steering * (pose.rotation * AXLE), normal);
        }
        if share == 0.0 {
            return Rolling::of(stance.axle, normal);
        }
        stance.rolling
    }

    /// Returns the impulses of the friction, within the circle of the wheel.
    fn friction(&self, body: &Carried, contact: &GroundContact, dt_s: f32) -> WheelImpulse {
        let axle = contact.rolling.axle;
        let mut across = body.side_impulse(contact.point, axle) * self.side_stiffness;
        let mut along = if self.engine_n == 0.0 {
            0.0
        } else {
            self.engine_n * dt_s
        };
        let most = self.load_n * dt_s * self.friction;
        let (x, y) = (along * ALONG_SHARE, across);
        let squared = x * x + y * y;
        if squared > most * most {
            let grip = most * reciprocal(squared.sqrt());
            if grip < 1.0 {
                (along, across) = (along * grip, across * grip);
            }
        }
        WheelImpulse { along, across }
    }
}

impl Carried<'_> {
    fn velocity_at(&self, point: Vector) -> Vector {
        self.velocity.velocity_at_point(point, self.mass.world_com)
    }

    /// Changes the velocity by an impulse at a point.
    ///
    /// Without an impulse the velocity keeps the sign of a zero, as rapier has it.
    fn push_at(&mut self, impulse: Vector, point: Vector) {
        let angular = (point - self.mass.world_com).cross(impulse);
        self.push(impulse, angular);
    }

    /// Changes the velocity by an impulse at the centre of mass and an angular impulse.
    pub(super) fn push(&mut self, impulse: Vector, angular: Vector) {
        if impulse != Vector::ZERO {
            self.velocity.apply_impulse(self.mass, impulse);
        }
        if angular != Vector::ZERO {
            self.velocity.apply_torque_impulse(self.mass, angular);
        }
    }

    /// Returns the impulse along an axle that takes away a share of the side slip.
    fn side_impulse(&self, point: Vector, axle: Vector) -> f32 {
        let slip_mps = axle.dot(self.velocity_at(point));
        let arm = (point - self.mass.world_com).cross(axle);
        let turn = self.mass.effective_world_inv_inertia * arm;
        let inverse_mass = self.mass.local_mprops.inv_mass + turn.dot(turn);
        -SIDE_SHARE * slip_mps * reciprocal(inverse_mass)
    }

    fn apply(&mut self, contact: &GroundContact, impulse: &WheelImpulse, up: Vector) {
        let mut point = contact.point;
        if impulse.along != 0.0 {
            self.push_at(contact.rolling.ahead * impulse.along, point);
        }
        if impulse.across != 0.0 {
            // Closer to the height of the centre of mass, so that a car does not roll over.
            let below = up.dot(point - self.mass.world_com);
            point -= up * (below * (1.0 - ROLL_SHARE));
            self.push_at(contact.rolling.axle * impulse.across, point);
        }
    }
}

/// Returns the share of a ray before the ground and the normal there, if it hits.
fn hit_ground(hub: Vector, ray: Vector, down: Vector) -> Option<(f32, Vector)> {
    let share = if hub.z < 0.0 { 0.0 } else { -hub.z / ray.z };
    if !(0.0..1.0).contains(&share) {
        return None;
    }
    if share != 0.0 {
        return Some((share, Vector::Z));
    }
    // The hub is in the ground, so the surface is where the ray backwards leaves it.
    let back = Ray::new(hub + ray, -ray);
    let ground = HalfSpace::new(Vector::Z);
    let hit = ground.cast_ray_and_get_normal(&Pose::IDENTITY, &back, 1.0, false);
    let normal = hit.map_or(Vector::ZERO, |hit| -hit.normal);
    if normal == Vector::ZERO {
        return Some((share, -down));
    }
    Some((share, normal))
}

/// Returns 1 / value, or 0 next to a division by 0.
pub(super) fn reciprocal(value: f32) -> f32 {
    if value.abs() <= LEAST_DIVISOR {
        return 0.0;
    }
    1.0 / value
}
