//! Ray-cast car: from a commanded net acceleration to forces at its wheels.

use parry3d_f64::math::Pose;
use rapier3d::control::{DynamicRayCastVehicleController, WheelTuning};
use rapier3d::math::Vector;

use super::chassis_motion::{ChassisMotion, ComOffset, Impulse, vector};
use super::lag::{BrakeLag, SteeringLag};
use super::motor::Motor;
use super::shape::CollisionShape;
use super::tyre_forces::{TyreDemand, TyreForces};
use super::world::{ChassisId, RapierWorld};
use crate::sim::limits::{DriveStep, VehicleLimits};
use crate::sim::planar::Rect;
use crate::sim::{Body, BodyCommand, GRAVITY_MPS2, Ground, Placement, Push, Vehicle};

/// Direction of the suspensions in the frame of the chassis.
const DOWN: Vector = Vector::new(0.0, 0.0, -1.0);
/// Axles of the wheels. A wheel rolls along normal × axle.
const AXLE: Vector = Vector::new(0.0, -1.0, 0.0);
/// Force above any suspension's need, so that a spring always carries its car.
const MAX_SUSPENSION_FORCE_N: f32 = 1e6;

/// Car in the world, with its current command.
#[derive(Clone, Debug)]
pub(super) struct Car {
    id: ChassisId,
    /// Position of rapier's origin for this car.
    origin_m: (f64, f64),
    /// Wheels of rapier: front left, front right, rear left, rear right.
    carrier: DynamicRayCastVehicleController,
    limits: VehicleLimits,
    com: ComOffset,
    mass_kg: f64,
    wheelbase_m: f64,
    track_m: f64,
    brakes: Option<BrakeLag>,
    steering: Option<SteeringLag>,
    tyres: Option<TyreForces>,
    /// Static share of the weight on each wheel.
    load_shares: [f64; 4],
    /// Speed that the last step should have ended with.
    target_mps: f64,
    accel_mps2: f64,
    curvature_per_m: f64,
    /// Motion at the beginning of the step, then its origin.
    before: ChassisMotion,
    origin_before_m: (f64, f64),
    /// True from the first contact of any two bodies on: the origin is common to all.
    is_joined: bool,
    /// True once this car collided. It then rolls freely.
    is_released: bool,
    /// Direction in which the ground carries the car.
    up: Vector,
    /// True on a surface: grades act by gravity, and the loads of the wheels limit the
    /// grip.
    on_surface: bool,
    /// True once the wheels have acted.
    has_rolled: bool,
}

impl Car {
    /// Puts a car into the world, with its springs in equilibrium.
    pub(super) fn new(
        world: &mut RapierWorld,
        body: &Body,
        shape: &CollisionShape,
        vehicle: &Vehicle,
        ground: Ground,
        rect: &Rect,
    ) -> Car {
        let (id, origin_m) = world.insert(body, shape, rect);
        let omega_per_s = core::f64::consts::TAU * vehicle.suspension_hz;
        // The hub sits where the sagged spring carries the weight, so a spawned car
        // neither drops nor bounces.
        let hub_m = vehicle.suspension_rest_m - vehicle.sag_m() + vehicle.wheel_radius_m;
        let front_share = vehicle.front_load_share(&body.dimensions());
        let load_shares = [
            front_share,
            front_share,
            1.0 - front_share,
            1.0 - front_share,
        ]
        .map(|axle| 0.5 * axle);
        let (front_m, rear_m) = (
            vehicle.front_axle_ahead_m(&body.dimensions()),
            vehicle.rear_axle_ahead_m(&body.dimensions()),
        );
        let mut carrier = world.vehicle(id);
        let mut add_wheel = |ahead_m: f64, left_m: f64, share: f64| {
            // Stiffness follows the load, so that both axles compress alike.
            let stiffness = 0.5 * share * omega_per_s * omega_per_s;
            let damping = 0.5 * share * 2.0 * vehicle.suspension_damping * omega_per_s;
            let tuning = WheelTuning {
                suspension_stiffness: stiffness as f32,
                suspension_compression: damping as f32,
                suspension_damping: damping as f32,
                max_suspension_travel: vehicle.suspension_travel_m as f32,
                side_friction_stiffness: side_stiffness(vehicle, share) as f32,
                friction_slip: (ground.friction * vehicle.grip) as f32,
                max_suspension_force: MAX_SUSPENSION_FORCE_N,
            };
            let hub = vector(ahead_m, left_m, hub_m);
            let (rest_m, radius_m) = (vehicle.suspension_rest_m, vehicle.wheel_radius_m);
            carrier.add_wheel(hub, DOWN, AXLE, rest_m as f32, radius_m as f32, &tuning);
        };
        let half_track_m = 0.5 * vehicle.track_m;
        let rear_share = 1.0 - front_share;
        add_wheel(front_m, half_track_m, front_share);
        add_wheel(front_m, -half_track_m, front_share);
        add_wheel(rear_m, half_track_m, rear_share);
        add_wheel(rear_m, -half_track_m, rear_share);
        Car {
            id,
            origin_m,
            carrier,
            limits: VehicleLimits::new(body, vehicle, ground),
            com: ComOffset::of(body),
            mass_kg: body.mass_kg,
            wheelbase_m: vehicle.wheelbase_m,
            track_m: vehicle.track_m,
            brakes: vehicle
                .brakes
                .as_ref()
                .map(|brakes| BrakeLag::new(brakes, vehicle)),
            steering: vehicle
                .steer_rate_rad_per_s
                .map(|rate_rad_per_s| SteeringLag::new(rate_rad_per_s, vehicle.wheelbase_m)),
            tyres: vehicle.tyres.as_ref().map(|tyres| {
                let loads_n = load_shares.map(|share| share * body.mass_kg * GRAVITY_MPS2);
                TyreForces::new(body, vehicle, tyres, loads_n, ground)
            }),
            load_shares,
            target_mps: rect.along_mps(),
            accel_mps2: 0.0,
            curvature_per_m: 0.0,
            before: world.motion(id),
            origin_before_m: origin_m,
            is_joined: false,
            is_released: false,
            up: world.up_at(rect),
            on_surface: world.has_surface(),
            has_rolled: false,
        }
    }

    /// Returns the acceleration required of the wheels and sets the next target.
    ///
    /// The acceleration takes the car from its speed to the speed it should have
    /// after the step. Tyre and rounding losses of one step are thus recovered in
    /// the next, and a standstill is held by the same law. rapier's brake is not
    /// used, because an engine force would override it.
    fn accelerate(&mut self, drive: &DriveStep, speed_mps: f64, dt_s: f64) -> f64 {
        let next_mps = drive.speed_mps(self.target_mps, dt_s);
        // The push acts by itself, and the wheels give the rest.
        let push_mps2 = self.limits.push().along_mps2;
        let wanted_mps2 = (next_mps - speed_mps) / dt_s - push_mps2;
        // Air drag may exceed the grip, so the net acceleration widens the limit.
        let most_mps2 = self
            .limits
            .grip_mps2
            .max((drive.net_mps2 - push_mps2).abs());
        if wanted_mps2.abs() <= most_mps2 {
            self.target_mps = next_mps;
            return wanted_mps2;
        }
        // The tyres cannot follow, so the target waits for the car. The target keeps
        // its sign, or a brake would become a reverse gear.
        let given_mps2 = wanted_mps2.clamp(-most_mps2, most_mps2);
        self.aim(speed_mps + (given_mps2 + push_mps2) * dt_s);
        given_mps2
    }

    /// Notes the ground under the wheels of the last step: its direction and its load.
    fn feel_ground(&mut self) {
        if !self.on_surface {
            return;
        }
        let wheels = self.carrier.wheels();
        let normals = wheels
            .iter()
            .map(|wheel| wheel.raycast_info())
            .filter(|ray| ray.is_in_contact);
        let sum: Vector = normals.map(|ray| ray.contact_normal_ws).sum();
        // In the air the last direction stays.
        if sum != Vector::ZERO {
            self.up = sum.normalize();
        }
        let load_n: f64 = self.loads_n().iter().sum();
        let weight_n = self.mass_kg * GRAVITY_MPS2;
        self.limits.set_load_share(load_n / weight_n);
    }

    /// Returns the acceleration of a step after the lag of the brakes.
    fn command_mps2(&mut self, dt_s: f64) -> f64 {
        let command_mps2 = self.accel_mps2;
        match &mut self.brakes {
            // A car that rolls backwards does not brake by a negative command.
            Some(brakes) if self.target_mps >= 0.0 => {
                brakes.step(command_mps2, self.limits.grip_mps2, dt_s)
            }
            _ => command_mps2,
        }
    }

    /// Returns the current loads of the wheels.
    fn loads_n(&self) -> [f64; 4] {
        let wheels = self.carrier.wheels();
        let loads_n: [f64; 4] =
            core::array::from_fn(|index| f64::from(wheels[index].wheel_suspension_force));
        // Off a surface, a car may be in the air.
        let in_air = self.on_surface && self.has_rolled;
        if in_air || loads_n.iter().any(|load_n| *load_n > 0.0) {
            return loads_n;
        }
        // In the first step there is no suspension force yet.
        let weight_n = self.mass_kg * GRAVITY_MPS2;
        self.load_shares.map(|share| share * weight_n)
    }

    /// Lets slipping tyres act for one step, if the car has them.
    fn slip(
        &mut self,
        world: &mut RapierWorld,
        rect: &Rect,
        force_n: f64,
        steering_rad: [f64; 4],
        dt_s: f64,
    ) -> bool {
        let loads_n = self.loads_n();
        let Some(tyres) = &self.tyres else {
            return false;
        };
        let demand = TyreDemand {
            force_n,
            steering_rad,
            loads_n,
        };
        let sum = tyres.forces(rect, &demand, dt_s);
        let impulse = Impulse {
            along_n_s: sum.along_n * dt_s,
            across_n_s: sum.across_n * dt_s,
            angular_n_m_s: sum.moments_n_m.map(|moment_n_m| moment_n_m * dt_s),
        };
        world.push(self.id, rect, self.up, &impulse);
        if sum.is_limited {
            // The target waits for the car.
            let along_mps2 = sum.along_n / self.mass_kg + self.limits.push().along_mps2;
            self.aim(rect.along_mps() + along_mps2 * dt_s);
        }
        world.roll(&mut self.carrier, dt_s);
        true
    }

    /// Lets the push act on the chassis from now on, along its present heading.
    fn be_pushed(&self, world: &mut RapierWorld, rect: &Rect) {
        let Push {
            along_mps2,
            left_mps2,
            grade_mps2,
            ..
        } = self.limits.push();
        // A surface lets gravity itself act on a grade.
        let [grade_along_mps2, grade_left_mps2] = if self.on_surface {
            grade_mps2
        } else {
            [0.0; 2]
        };
        let along_n = self.mass_kg * (along_mps2 - grade_along_mps2);
        let left_n = self.mass_kg * (left_mps2 - grade_left_mps2);
        let x_n = along_n * rect.cos - left_n * rect.sin;
        let y_n = along_n * rect.sin + left_n * rect.cos;
        world.set_force(self.id, x_n, y_n);
    }

    /// Rolls freely, with the grip of the wheels to the side.
    fn coast(&mut self, world: &mut RapierWorld, rect: &Rect, dt_s: f64) {
        if self.slip(world, rect, 0.0, [0.0; 4], dt_s) {
            return;
        }
        for wheel in self.carrier.wheels_mut() {
            (wheel.engine_force, wheel.steering) = (0.0, 0.0);
        }
        world.roll(&mut self.carrier, dt_s);
    }

    fn set_slip_friction(&mut self, ground: Ground) {
        // On a plane rapier's wheels carry the whole weight, also on a grade.
        let load_share = if self.on_surface {
            1.0
        } else {
            self.limits.push().load_share
        };
        let friction = self.limits.slip_friction(ground) * load_share;
        for wheel in self.carrier.wheels_mut() {
            wheel.friction_slip = friction as f32;
        }
        if let Some(tyres) = &mut self.tyres {
            tyres.set_ground(Ground {
                friction: ground.friction * load_share,
            });
        }
    }

    fn aim(&mut self, speed_mps: f64) {
        let forwards = self.target_mps >= 0.0;
        // With a strict sign a standing car would count as reversing and never
        // drive off.
        self.target_mps = if forwards {
            speed_mps.max(0.0)
        } else {
            speed_mps.min(0.0)
        };
    }

    /// Returns the steering angle of each wheel.
    ///
    /// Ackermann: each front wheel points perpendicular to the turn's centre.
    /// Parallel wheels would work against each other and lose a tenth of a tight
    /// turn.
    fn steer(&mut self, drive: &DriveStep, speed_mps: f64, dt_s: f64) -> [f64; 4] {
        let top_mps = speed_mps.abs().max(self.target_mps.abs());
        let limited_per_m = if self.tyres.is_some() {
            // These tyres limit the turn themselves.
            self.limits.locked_per_m(self.curvature_per_m)
        } else {
            self.limits
                .curvature_per_m(self.curvature_per_m, drive.tyre_mps2, top_mps)
        };
        let curvature_per_m = match &mut self.steering {
            Some(steering) => steering.step(limited_per_m, dt_s),
            None => limited_per_m,
        };
        if curvature_per_m == 0.0 {
            return [0.0; 4];
        }
        let towards_centre = |left_m: f64| {
            let tangent = self.wheelbase_m * curvature_per_m / (1.0 - curvature_per_m * left_m);
            libm::atan(tangent)
        };
        let left_m = 0.5 * self.track_m;
        [towards_centre(left_m), towards_centre(-left_m), 0.0, 0.0]
    }
}

impl Motor for Car {
    fn command(&mut self, command: BodyCommand) -> bool {
        let Some(drive) = command.drive() else {
            return false;
        };
        (self.accel_mps2, self.curvature_per_m) = drive;
        true
    }

    fn set_ground(&mut self, ground: Ground) {
        self.limits.set_ground(ground);
        self.set_slip_friction(ground);
    }

    fn set_push(&mut self, push: Push) {
        // Wind leaves the load share alone, so only a new slope changes the
        // wheels' friction.
        let is_on_slope = self.limits.push().load_share != push.load_share;
        self.limits.set_push(push);
        if is_on_slope {
            self.set_slip_friction(self.limits.ground());
        }
    }

    fn join(&mut self, world: &mut RapierWorld, origin_m: (f64, f64)) -> Option<ChassisId> {
        world.move_origin(self.id, self.origin_m, origin_m);
        self.origin_m = origin_m;
        self.is_joined = true;
        Some(self.id)
    }

    fn release(&mut self, _: &mut RapierWorld) {
        self.is_released = true;
    }

    fn leave(&mut self, world: &mut RapierWorld) {
        world.remove(self.id);
    }

    /// Sets the wheels and lets them act for one step.
    fn act(&mut self, world: &mut RapierWorld, rect: &Rect, dt_s: f64) {
        self.be_pushed(world, rect);
        if self.is_released {
            return self.coast(world, rect, dt_s);
        }
        // Before the motion is saved: `rewind` mixes two poses of one origin.
        if !self.is_joined {
            world.recentre(self.id, &mut self.origin_m);
        }
        self.before = world.motion(self.id);
        self.origin_before_m = self.origin_m;
        self.feel_ground();
        self.has_rolled = true;
        let speed_mps = rect.along_mps();
        let command_mps2 = self.command_mps2(dt_s);
        let drive = self.limits.drive(command_mps2, self.target_mps, dt_s);
        let force_n = self.mass_kg * self.accelerate(&drive, speed_mps, dt_s);
        let steering_rad = self.steer(&drive, speed_mps, dt_s);
        if self.slip(world, rect, force_n, steering_rad, dt_s) {
            return;
        }

        // Each wheel takes its share of the load, so that no wheel slips first.
        let wheels = self.carrier.wheels_mut();
        let loads_n = wheels
            .iter()
            .map(|wheel| f64::from(wheel.wheel_suspension_force));
        let load_n: f64 = loads_n.sum();
        for (index, wheel) in wheels.iter_mut().enumerate() {
            // In the first step there is no suspension force yet.
            let share = if load_n > 0.0 {
                f64::from(wheel.wheel_suspension_force) / load_n
            } else {
                self.load_shares[index]
            };
            wheel.engine_force = (force_n * share) as f32;
            wheel.steering = steering_rad[index] as f32;
        }
        world.roll(&mut self.carrier, dt_s);
    }

    fn placement(&self, world: &RapierWorld, height_m: f64) -> Placement {
        let motion = world.motion(self.id);
        motion.placement(self.origin_m, height_m)
    }

    fn rect(&self, world: &RapierWorld) -> Rect {
        let motion = world.motion(self.id);
        motion.rect(self.origin_m, &self.com, self.up)
    }

    fn pose(&self, world: &RapierWorld, _: &Rect) -> Pose {
        world.motion(self.id).pose_in_world(self.origin_m)
    }

    /// Corrects the position after rapier's step.
    ///
    /// rapier moves a body by the velocity at the end of a step, which is ½·dt·Δv
    /// too far. The mean velocity makes constant acceleration exact.
    ///
    /// Bodies that may collide keep rapier's positions, which are consistent.
    fn settle(&mut self, world: &mut RapierWorld, dt_s: f64) {
        if self.is_joined {
            return;
        }
        let (gain_x_mps, gain_y_mps) = world.motion(self.id).gain_mps(&self.before);
        if self.on_surface {
            let (x_m, y_m) = (-0.5 * dt_s * gain_x_mps, -0.5 * dt_s * gain_y_mps);
            return world.shift(self.id, x_m, y_m);
        }
        self.origin_m.0 -= 0.5 * dt_s * gain_x_mps;
        self.origin_m.1 -= 0.5 * dt_s * gain_y_mps;
    }

    fn rewind(&mut self, world: &mut RapierWorld, share: f64) {
        let motion = self.before.towards(&world.motion(self.id), share);
        world.place(self.id, &motion);
        let mix = |from_m: f64, to_m: f64| from_m + share * (to_m - from_m);
        self.origin_m = (
            mix(self.origin_before_m.0, self.origin_m.0),
            mix(self.origin_before_m.1, self.origin_m.1),
        );
        let rect = motion.rect(self.origin_m, &self.com, self.up);
        // The old target belonged to the end of the undone step.
        self.aim(rect.along_mps());
        if let Some(brakes) = &mut self.brakes {
            brakes.rewind(share);
        }
        if let Some(steering) = &mut self.steering {
            steering.rewind(share);
        }
    }

    #[cfg(test)]
    fn wheels(&self) -> &[rapier3d::control::Wheel] {
        self.carrier.wheels()
    }

    fn fork(&self) -> Box<dyn Motor> {
        Box::new(self.clone())
    }
}

/// Returns rapier's stiffness of the side grip of an axle.
///
/// It follows the load, so both axles slip alike and steer neutrally. Tyres that slip
/// replace it.
fn side_stiffness(vehicle: &Vehicle, load_share: f64) -> f64 {
    if vehicle.tyres.is_some() {
        return 0.0;
    }
    2.0 * load_share
}
