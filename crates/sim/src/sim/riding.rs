//! Motion of a cyclist within the limits of legs, brakes, grip and lean.
//!
//! The rear wheel follows the path, as with a vehicle. The lateral acceleration
//! grows at a bounded rate, because a bicycle turns only as far as it leans.

use super::body::Body;
use super::cyclist::{Cyclist, LOCK_PER_M};
use super::limits::DriveStep;
use super::{GRAVITY_MPS2, Ground, Push};

/// Greatest curvature of the path below the balance speed.
const SLOW_PER_M: f64 = 0.1;
/// Longest step of the integration.
const STEP_S: f64 = 0.01;

/// State of a cyclist's rear axle in the world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ride {
    pub at_m: (f64, f64),
    pub heading_rad: f64,
    /// Cosine and sine of the heading.
    pub direction: (f64, f64),
    pub speed_mps: f64,
    /// Curvature of the path. The lateral acceleration is v²·κ.
    pub curvature_per_m: f64,
}

/// Limits of one cyclist on one ground.
#[derive(Clone, Debug)]
pub(super) struct CyclistLimits {
    cyclist: Cyclist,
    power_w_per_kg: f64,
    /// Greatest acceleration that the tyres transmit: μ·g.
    grip_mps2: f64,
    friction: f64,
    /// Share of the weight that the wheels carry.
    load_share: f64,
    /// External acceleration along the heading.
    push_mps2: f64,
}

/// Command within the limits for one `advance`, and the limits in force.
#[derive(Clone, Copy, Debug)]
pub(super) struct RideStep {
    pub drive: DriveStep,
    curvature_per_m: f64,
    /// Greatest lateral acceleration besides the acceleration along the heading.
    lateral_mps2: f64,
    lean_rate_mps3: f64,
    balance_mps: f64,
    /// Length of one step of the integration.
    step_s: f64,
}

/// Bounds on the motion of any point of a body during one `advance`.
pub(super) struct RideBounds {
    pub speed_mps: f64,
    pub accel_mps2: f64,
}

impl CyclistLimits {
    pub(super) fn new(body: &Body, cyclist: &Cyclist, ground: Ground) -> CyclistLimits {
        CyclistLimits {
            cyclist: cyclist.clone(),
            power_w_per_kg: cyclist.power_w / body.mass_kg,
            grip_mps2: ground.friction * GRAVITY_MPS2,
            friction: ground.friction,
            load_share: Push::NONE.load_share,
            push_mps2: 0.0,
        }
    }

    /// Changes the ground under the wheels.
    pub(super) fn set_ground(&mut self, ground: Ground) {
        self.friction = ground.friction;
        self.grip_mps2 = self.friction * GRAVITY_MPS2 * self.load_share;
    }

    /// Changes the external acceleration. Wind from the side is balanced by the lean.
    pub(super) fn set_push(&mut self, push: Push) {
        self.push_mps2 = push.along_mps2;
        // Wheels lose load on a slope, so the grip is recomputed from the
        // friction.
        self.load_share = push.load_share;
        self.grip_mps2 = self.friction * GRAVITY_MPS2 * self.load_share;
    }

    /// Returns the speed at which a cyclist can start.
    pub(super) fn within_limit(&self, speed_mps: f64) -> f64 {
        self.cyclist.within_limit(speed_mps)
    }

    /// Returns the motion under a command for the next `dt_s`.
    pub(super) fn step(
        &self,
        accel_mps2: f64,
        curvature_per_m: f64,
        speed_mps: f64,
        dt_s: f64,
    ) -> RideStep {
        let tyre_mps2 = self.net_mps2(accel_mps2, speed_mps, dt_s);
        let net_mps2 = self.pushed_mps2(tyre_mps2, speed_mps, dt_s);
        let rest_after_s = if net_mps2 < 0.0 {
            speed_mps / -net_mps2
        } else {
            f64::INFINITY
        };
        let circle = self.grip_mps2 * self.grip_mps2 - tyre_mps2 * tyre_mps2;
        // Equal steps that fill `dt_s` exactly, so that no short step is left
        // at the end.
        let steps = libm::ceil(dt_s / STEP_S).max(1.0);
        RideStep {
            drive: DriveStep {
                net_mps2,
                tyre_mps2,
                rest_after_s,
            },
            curvature_per_m,
            // The acceleration along the heading has priority, as with
            // vehicles.
            lateral_mps2: self.cyclist.max_lateral_mps2.min(circle.max(0.0).sqrt()),
            lean_rate_mps3: self.cyclist.lean_rate_mps3,
            balance_mps: self.cyclist.balance_mps,
            step_s: dt_s / steps,
        }
    }

    /// Returns the net acceleration with the external one.
    ///
    /// The rider brakes to keep the top speed, and stands on a foot at rest.
    fn pushed_mps2(&self, tyre_mps2: f64, speed_mps: f64, dt_s: f64) -> f64 {
        // Without a push the acceleration keeps its exact bits.
        if self.push_mps2 == 0.0 || dt_s <= 0.0 {
            return tyre_mps2;
        }
        let net_mps2 = tyre_mps2 + self.push_mps2;
        if speed_mps <= 0.0 {
            // The push must not roll a standing rider backwards.
            return if tyre_mps2 > 0.0 {
                net_mps2.max(0.0)
            } else {
                0.0
            };
        }
        net_mps2.min((self.cyclist.max_speed_mps - speed_mps) / dt_s)
    }

    /// Returns the acceleration within grip, brakes, legs and top speed.
    ///
    /// At full power the speed after the step obeys v₁² = v₀² + 2·P/m·dt.
    fn net_mps2(&self, command_mps2: f64, speed_mps: f64, dt_s: f64) -> f64 {
        let most_mps2 = self.cyclist.accel_mps2.min(self.grip_mps2);
        let brake_mps2 = self.cyclist.brake_mps2.min(self.grip_mps2);
        let wanted_mps2 = command_mps2.clamp(-brake_mps2, most_mps2);
        // A step of 0 s gains no speed, and must not divide by it.
        if dt_s <= 0.0 || wanted_mps2 == 0.0 {
            return 0.0;
        }
        if wanted_mps2 < 0.0 {
            // At rest the rider stands on a foot, and the brakes hold.
            return if speed_mps > 0.0 { wanted_mps2 } else { 0.0 };
        }
        let powered_mps = (speed_mps * speed_mps + 2.0 * self.power_w_per_kg * dt_s).sqrt();
        let reachable_mps = powered_mps.min(self.cyclist.max_speed_mps);
        wanted_mps2.min((reachable_mps - speed_mps).max(0.0) / dt_s)
    }
}

impl RideStep {
    /// Returns a state with the curvature that these limits allow at its speed.
    pub(super) fn begin(&self, ride: Ride) -> Ride {
        let most_per_m = self.most_per_m(ride.speed_mps);
        Ride {
            // After braking or a change of the ground the old curvature may be
            // out of reach.
            curvature_per_m: ride.curvature_per_m.clamp(-most_per_m, most_per_m),
            ..ride
        }
    }

    /// Returns the state after a time within the `advance` that began at `start`.
    pub(super) fn after(&self, start: &Ride, after_s: f64) -> Ride {
        let (mut ride, mut from_s) = (*start, 0.0);
        let mut steps = 0.0;
        while from_s < after_s {
            steps += 1.0;
            // A product instead of a sum, so that rounding does not
            // accumulate.
            let to_s = (steps * self.step_s).min(after_s);
            ride = self.integrate(start.speed_mps, &ride, from_s, to_s);
            from_s = to_s;
        }
        ride
    }

    /// Returns bounds from a state on. No point is farther than `arm_m` from the axle.
    pub(super) fn bounds(&self, start: &Ride, arm_m: f64, dt_s: f64) -> RideBounds {
        let (v0, v1) = (start.speed_mps, self.drive.speed_mps(start.speed_mps, dt_s));
        let top_mps = v0.max(v1);
        // Below the balance speed the lean counts as at that speed, as in
        // `leaned`.
        let least_mps = v0.min(v1).max(self.balance_mps);
        let (now, wanted) = (
            start.curvature_per_m.abs() * self.square(v0),
            self.curvature_per_m.abs() * self.square(top_mps),
        );
        let lean_mps2 = now.max(wanted.min(now + self.lean_rate_mps3 * dt_s));
        let curvature_per_m = (lean_mps2 / (least_mps * least_mps)).min(LOCK_PER_M);
        let net_mps2 = self.drive.net_mps2.abs();
        let turn = curvature_per_m * arm_m;
        // |d(v·κ)/dt|: the lean changes, and the speed changes under one lean or at
        // one limit of the curvature.
        let spin = if curvature_per_m == 0.0 {
            0.0
        } else {
            let limit = (LOCK_PER_M - SLOW_PER_M) * top_mps / self.balance_mps;
            self.lean_rate_mps3 / least_mps + net_mps2 * (3.0 * curvature_per_m + limit)
        };
        let centripetal_mps2 = top_mps * top_mps * curvature_per_m * (1.0 + turn);
        RideBounds {
            speed_mps: top_mps * (1.0 + turn),
            accel_mps2: net_mps2 + centripetal_mps2 + arm_m * spin,
        }
    }

    /// Integrates one step between two times of the `advance`.
    fn integrate(&self, start_mps: f64, ride: &Ride, from_s: f64, to_s: f64) -> Ride {
        let speed_mps = self.drive.speed_mps(start_mps, to_s);
        // The cyclist may come to rest within this step, and then moves no
        // farther.
        let moving_s = to_s.min(self.drive.rest_after_s) - from_s.min(self.drive.rest_after_s);
        let length_m = 0.5 * (ride.speed_mps + speed_mps) * moving_s;
        let curvature_per_m = self.leaned(ride, speed_mps, to_s - from_s);
        // The yaw rate changes nearly evenly within a step.
        let yaw_rates = ride.speed_mps * ride.curvature_per_m + speed_mps * curvature_per_m;
        let turn_rad = 0.5 * yaw_rates * moving_s;
        let moved = Ride {
            speed_mps,
            curvature_per_m,
            ..*ride
        };
        // Without a turn the heading keeps its exact bits.
        if turn_rad == 0.0 {
            let (cos, sin) = ride.direction;
            return Ride {
                at_m: ride.ahead_m(cos, sin, length_m),
                ..moved
            };
        }
        // The chord of an arc points halfway between both headings.
        let (cos, sin) = direction(ride.heading_rad + 0.5 * turn_rad);
        let heading_rad = ride.heading_rad + turn_rad;
        Ride {
            at_m: ride.ahead_m(cos, sin, length_m),
            heading_rad,
            direction: direction(heading_rad),
            ..moved
        }
    }

    /// Returns the curvature after the lean changed for a time.
    ///
    /// Below the balance speed the lean counts as at that speed, so that the
    /// curvature changes at a bounded rate there.
    fn leaned(&self, ride: &Ride, speed_mps: f64, for_s: f64) -> f64 {
        let most_per_m = self.most_per_m(speed_mps);
        let wanted_per_m = self.curvature_per_m.clamp(-most_per_m, most_per_m);
        let square = self.square(speed_mps);
        let lean_mps2 = ride.curvature_per_m * self.square(ride.speed_mps);
        let change_mps2 = self.lean_rate_mps3 * for_s;
        let next_mps2 =
            (wanted_per_m * square).clamp(lean_mps2 - change_mps2, lean_mps2 + change_mps2);
        (next_mps2 / square).clamp(-most_per_m, most_per_m)
    }

    fn square(&self, speed_mps: f64) -> f64 {
        let balanced_mps = speed_mps.max(self.balance_mps);
        balanced_mps * balanced_mps
    }

    /// Returns the greatest curvature at a speed, by balance, lock, lean and grip.
    fn most_per_m(&self, speed_mps: f64) -> f64 {
        let balanced = (speed_mps / self.balance_mps - 1.0).clamp(0.0, 1.0);
        let lock_per_m = SLOW_PER_M + balanced * (LOCK_PER_M - SLOW_PER_M);
        let square = speed_mps * speed_mps;
        // Compare products, so that a cyclist at rest needs no division by the speed.
        if lock_per_m * square <= self.lateral_mps2 {
            lock_per_m
        } else {
            self.lateral_mps2 / square
        }
    }
}

impl Ride {
    /// Returns the point at a distance in the direction of a cosine and a sine.
    fn ahead_m(&self, cos: f64, sin: f64, length_m: f64) -> (f64, f64) {
        let (x_m, y_m) = self.at_m;
        (x_m + length_m * cos, y_m + length_m * sin)
    }
}

fn direction(heading_rad: f64) -> (f64, f64) {
    let (sin, cos) = libm::sincos(heading_rad);
    (cos, sin)
}
