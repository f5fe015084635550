//! Limits of engine, tyres and steering, the same for both plants.

use super::body::Body;
use super::vehicle::Vehicle;
use super::{GRAVITY_MPS2, Ground, Push};

/// Density of air at sea level, in kg/m³.
pub(crate) const AIR_KG_PER_M3: f64 = 1.225;

/// Limits of one vehicle on one ground.
#[derive(Clone, Copy, Debug)]
pub(super) struct VehicleLimits {
    /// Greatest acceleration that the tyres transmit: μ·grip·g.
    pub grip_mps2: f64,
    /// Engine power per mass.
    power_w_per_kg: f64,
    /// Curvature at full steering lock.
    lock_per_m: f64,
    /// Air drag per mass and speed squared.
    drag_per_m: f64,
    /// Rolling resistance per mass.
    rolling_mps2: f64,
    /// Factor of the tyres on the ground's friction.
    grip: f64,
    ground: Ground,
    push: Push,
}

/// Motion of a vehicle along its path for one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveStep {
    /// Net acceleration along the heading, resistances included.
    pub net_mps2: f64,
    /// Part of the acceleration that the tyres transmit.
    pub tyre_mps2: f64,
    /// Time until the vehicle comes to rest and stays, infinite if it does not.
    pub rest_after_s: f64,
}

impl DriveStep {
    /// Returns the speed after a time within the step.
    #[inline]
    pub(super) fn speed_mps(&self, start_mps: f64, after_s: f64) -> f64 {
        if self.rest_after_s <= after_s {
            return 0.0;
        }
        start_mps + self.net_mps2 * after_s
    }
}

impl VehicleLimits {
    pub(super) fn new(body: &Body, vehicle: &Vehicle, ground: Ground) -> VehicleLimits {
        VehicleLimits {
            grip_mps2: ground.friction * vehicle.grip * GRAVITY_MPS2,
            power_w_per_kg: vehicle.power_w / body.mass_kg,
            // Curvature of the bicycle model: κ = tan δ / L.
            lock_per_m: libm::tan(vehicle.max_steer_rad) / vehicle.wheelbase_m,
            drag_per_m: 0.5 * AIR_KG_PER_M3 * vehicle.drag_area_m2 / body.mass_kg,
            rolling_mps2: vehicle.rolling_resistance * GRAVITY_MPS2,
            grip: vehicle.grip,
            ground,
            push: Push::NONE,
        }
    }

    /// Changes the ground.
    pub(super) fn set_ground(&mut self, ground: Ground) {
        self.ground = ground;
        self.grip_mps2 = self.slip_friction(ground) * GRAVITY_MPS2 * self.push.load_share;
    }

    /// Changes the external acceleration.
    pub(super) fn set_push(&mut self, push: Push) {
        self.push = push;
        // The ground is set again, because the load share changes the grip.
        self.set_ground(self.ground);
    }

    /// Sets the share of the weight that presses on the ground.
    pub(super) fn set_load_share(&mut self, load_share: f64) {
        self.push.load_share = load_share;
        self.set_ground(self.ground);
    }

    /// Returns the ground.
    pub(super) fn ground(&self) -> Ground {
        self.ground
    }

    /// Returns the external acceleration.
    pub(super) fn push(&self) -> Push {
        self.push
    }

    /// Returns the coefficient of friction of the tyres on a ground.
    pub(super) fn slip_friction(&self, ground: Ground) -> f64 {
        ground.friction * self.grip
    }

    /// Returns the motion under a commanded acceleration during `dt_s`.
    ///
    /// The acceleration is capped by grip and by power. The power cap is such that
    /// the speed at the end of the step is reached at full power:
    /// v₁² = v₀² + 2·P/m·dt.
    #[inline]
    pub(super) fn drive(&self, command_mps2: f64, speed_mps: f64, dt_s: f64) -> DriveStep {
        let tyre_mps2 = self.tyre_mps2(command_mps2, speed_mps, dt_s);
        // Drag of the initial speed for the whole step keeps the motion in closed form.
        let drag_mps2 = self.drag_per_m * speed_mps * speed_mps;
        let resistance_mps2 = drag_mps2 + self.rolling_mps2;
        let push_mps2 = self.push.along_mps2;
        let (net_mps2, stops) = if speed_mps > 0.0 {
            let net_mps2 = tyre_mps2 - resistance_mps2 + push_mps2;
            (net_mps2, net_mps2 < 0.0)
        } else if speed_mps < 0.0 {
            let net_mps2 = tyre_mps2 + resistance_mps2 + push_mps2;
            // Throttle may carry a vehicle that is rolling backwards through zero.
            (net_mps2, net_mps2 > 0.0 && tyre_mps2 <= 0.0)
        } else {
            // At rest the brakes hold, and the throttle must overcome the resistance.
            // A push alone moves nothing.
            let pushed_mps2 = if tyre_mps2 > 0.0 { push_mps2 } else { 0.0 };
            // Resistance alone must not push a standing vehicle backwards.
            ((tyre_mps2 - resistance_mps2 + pushed_mps2).max(0.0), false)
        };
        let rest_after_s = if stops {
            -speed_mps / net_mps2
        } else {
            f64::INFINITY
        };
        DriveStep {
            net_mps2,
            tyre_mps2,
            rest_after_s,
        }
    }

    /// Returns the curvature within the steering lock and the friction circle.
    ///
    /// v²·|κ| ≤ √((μg)² − a²), at the greater of the two speeds of the step. The
    /// acceleration has priority over the curvature.
    #[inline]
    pub(super) fn curvature_per_m(
        &self,
        command_per_m: f64,
        tyre_mps2: f64,
        speed_mps: f64,
    ) -> f64 {
        let locked = self.locked_per_m(command_per_m);
        let speed_squared = speed_mps * speed_mps;
        let lateral_squared = self.grip_mps2 * self.grip_mps2 - tyre_mps2 * tyre_mps2;
        // Compare squares, so that a vehicle at rest needs no division by its speed.
        let demand = locked * speed_squared;
        if demand * demand <= lateral_squared {
            return locked;
        }
        // Tyre use at the limit may round the rest below 0, which has no root.
        let circle = lateral_squared.max(0.0).sqrt() / speed_squared;
        locked.clamp(-circle, circle)
    }

    /// Returns the curvature within the steering lock.
    #[inline]
    pub(super) fn locked_per_m(&self, command_per_m: f64) -> f64 {
        command_per_m.clamp(-self.lock_per_m, self.lock_per_m)
    }

    #[inline]
    fn tyre_mps2(&self, command_mps2: f64, speed_mps: f64, dt_s: f64) -> f64 {
        let wanted = command_mps2.clamp(-self.grip_mps2, self.grip_mps2);
        // Braking needs no engine power. Only motion that gains speed does.
        let (along, before) = if speed_mps < 0.0 {
            (-wanted, -speed_mps)
        } else {
            (wanted, speed_mps)
        };
        let after = before + along * dt_s;
        // Below the power limit no square root is needed.
        if along <= 0.0 || along * after <= self.power_w_per_kg {
            return wanted;
        }
        let reachable = (before * before + 2.0 * self.power_w_per_kg * dt_s).sqrt();
        // Near the limit the mean power of the step allows more than the
        // command wants.
        let powered = ((reachable - before) / dt_s).min(along);
        if speed_mps < 0.0 { -powered } else { powered }
    }
}
