//! One ray-cast car: from a commanded net acceleration to forces at its wheels.

use rapier3d::control::{DynamicRayCastVehicleController, WheelTuning};
use rapier3d::prelude::RigidBodyHandle;

use super::world::{ComOffset, Motion, World, vector};
use crate::sim::limits::Limits;
use crate::sim::planar::Rect;
use crate::sim::{Body, Ground, Vehicle};

/// More than any suspension needs, so that a spring always carries its car.
const MAX_SUSPENSION_FORCE_N: f32 = 1e6;

/// A car in the world, and what it is asked to do.
#[derive(Clone, Debug)]
pub(super) struct Car {
    handle: RigidBodyHandle,
    controller: DynamicRayCastVehicleController,
    limits: Limits,
    com: ComOffset,
    mass_kg: f64,
    wheelbase_m: f64,
    /// Static share of the weight on each wheel.
    load_shares: [f64; 4],
    /// The speed that the last step should have ended with.
    target_mps: f64,
    accel_mps2: f64,
    curvature_per_m: f64,
    /// Motion at the beginning of the step.
    before: Motion,
}

impl Car {
    /// Puts a car into the world, its springs already carrying it.
    pub fn new(
        world: &mut World,
        body: &Body,
        vehicle: &Vehicle,
        ground: Ground,
        rect: &Rect,
    ) -> Car {
        let handle = world.insert(body, rect);
        let mut controller = DynamicRayCastVehicleController::new(handle);
        controller.index_up_axis = 2;
        controller.index_forward_axis = 0;
        let omega_per_s = core::f64::consts::TAU * vehicle.suspension_hz;
        let hub_m = vehicle.suspension_rest_m - vehicle.sag_m() + vehicle.wheel_radius_m;
        let front_share = vehicle.front_load_share(body);
        let (front_m, rear_m) = (
            vehicle.front_axle_ahead_m(body),
            vehicle.rear_axle_ahead_m(body),
        );
        for (ahead_m, share) in [(front_m, front_share), (rear_m, 1.0 - front_share)] {
            // Stiffness follows the load, so that both axles give way alike.
            let stiffness = 0.5 * share * omega_per_s * omega_per_s;
            let damping = 0.5 * share * 2.0 * vehicle.suspension_damping * omega_per_s;
            let tuning = WheelTuning {
                suspension_stiffness: stiffness as f32,
                suspension_compression: damping as f32,
                suspension_damping: damping as f32,
                max_suspension_travel: vehicle.suspension_travel_m as f32,
                side_friction_stiffness: 1.0,
                friction_slip: (ground.friction * vehicle.grip) as f32,
                max_suspension_force: MAX_SUSPENSION_FORCE_N,
            };
            for left_m in [0.5 * vehicle.track_m, -0.5 * vehicle.track_m] {
                controller.add_wheel(
                    vector(ahead_m, left_m, hub_m),
                    vector(0.0, 0.0, -1.0),
                    // rapier rolls a wheel along normal × axle.
                    vector(0.0, -1.0, 0.0),
                    vehicle.suspension_rest_m as f32,
                    vehicle.wheel_radius_m as f32,
                    &tuning,
                );
            }
        }
        Car {
            handle,
            controller,
            limits: Limits::new(body, vehicle, ground),
            com: ComOffset::of(body),
            mass_kg: body.mass_kg,
            wheelbase_m: vehicle.wheelbase_m,
            load_shares: [
                front_share,
                front_share,
                1.0 - front_share,
                1.0 - front_share,
            ]
            .map(|axle| 0.5 * axle),
            target_mps: rect.vx_mps * rect.cos + rect.vy_mps * rect.sin,
            accel_mps2: 0.0,
            curvature_per_m: 0.0,
            before: world.motion(handle),
        }
    }

    /// Sets what the car does from now on.
    pub fn command(&mut self, accel_mps2: f64, curvature_per_m: f64) {
        (self.accel_mps2, self.curvature_per_m) = (accel_mps2, curvature_per_m);
    }

    /// Sets the wheels and lets them act for one step.
    ///
    /// The force is what takes the car from its speed to the speed it should
    /// have after the step, so that what tyres and rounding took away in one
    /// step is given back in the next, and a standstill is held by the same
    /// law. rapier's brake is not used: an engine force would override it.
    pub fn drive(&mut self, world: &mut World, rect: &Rect, dt_s: f64) {
        self.before = world.motion(self.handle);
        let speed_mps = rect.vx_mps * rect.cos + rect.vy_mps * rect.sin;
        let drive = self.limits.drive(self.accel_mps2, self.target_mps, dt_s);
        let wanted_mps2 = (drive.speed_mps(self.target_mps, dt_s) - speed_mps) / dt_s;
        let most_mps2 = self.limits.grip_mps2.max(drive.net_mps2.abs());
        let accel_mps2 = wanted_mps2.clamp(-most_mps2, most_mps2);
        let end_mps = speed_mps + accel_mps2 * dt_s;
        let top_mps = speed_mps.abs().max(end_mps.abs());
        let curvature_per_m =
            self.limits
                .curvature_per_m(self.curvature_per_m, drive.tyre_mps2, top_mps);
        let steering_rad = libm::atan(self.wheelbase_m * curvature_per_m) as f32;
        self.target_mps = end_mps;

        // Each wheel takes its share of the load, so that none slips first.
        let wheels = self.controller.wheels_mut();
        let load_n: f64 = wheels
            .iter()
            .map(|wheel| f64::from(wheel.wheel_suspension_force))
            .sum();
        let force_n = self.mass_kg * accel_mps2;
        for (index, wheel) in wheels.iter_mut().enumerate() {
            let share = if 0.0 < load_n {
                f64::from(wheel.wheel_suspension_force) / load_n
            } else {
                self.load_shares[index]
            };
            wheel.engine_force = (force_n * share) as f32;
            wheel.steering = if index < 2 { steering_rad } else { 0.0 };
        }
        world.roll(&mut self.controller, dt_s);
    }

    /// Pose and velocity now.
    pub fn motion(&self, world: &World) -> Motion {
        world.motion(self.handle)
    }

    /// The footprint now.
    pub fn rect(&self, world: &World) -> Rect {
        self.motion(world).rect(&self.com)
    }

    /// Goes back to a share of the last step.
    pub fn rewind(&mut self, world: &mut World, share: f64) {
        let motion = self.before.towards(&self.motion(world), share);
        world.place(self.handle, &motion);
        let rect = motion.rect(&self.com);
        self.target_mps = rect.vx_mps * rect.cos + rect.vy_mps * rect.sin;
    }
}
