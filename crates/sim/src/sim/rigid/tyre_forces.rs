//! Forces of tyres that slip, from the motion of a car and the loads of its wheels.
//!
//! Combined slip: each direction's slip is divided by the slip of its peak, and the
//! magic formula of their hypotenuse is the share of the friction in use. The force has
//! the direction of the slip. At the peak along and across the wheel this is the
//! friction ellipse.

use crate::sim::planar::Rect;
use crate::sim::{Body, Ground, Tyres, Vehicle};

/// Newton steps for the slip that a wanted force needs.
const NEWTON_STEPS: usize = 5;
/// Share of a wheel's sideways motion that one step may take away.
///
/// At low speeds slip angles would otherwise oscillate from step to step.
const STOPPABLE: f64 = 0.8;
/// Share of the tipping arm that side forces use at most. This car cannot roll over.
const SAFE_ARM: f64 = 0.7;

/// Tyres of one car.
#[derive(Clone, Debug)]
pub(super) struct TyreForces {
    tyres: Tyres,
    curve: SlipCurve,
    ground: Ground,
    /// Share of the braking force on the front axle.
    front_share: f64,
    wheels: [TyreWheel; 4],
    com_ahead_m: f64,
    com_height_m: f64,
    /// Arm of the side forces about the centre of mass.
    roll_arm_m: f64,
}

/// Place and load of one wheel at rest.
#[derive(Clone, Copy, Debug)]
struct TyreWheel {
    ahead_m: f64,
    left_m: f64,
    static_n: f64,
    /// Mass that a side force of this wheel moves.
    moved_kg: f64,
    cornering_per_rad: f64,
}

/// Demand on the tyres for one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct TyreDemand {
    /// Wanted force along the heading.
    pub force_n: f64,
    pub steering_rad: [f64; 4],
    pub loads_n: [f64; 4],
}

/// Sum of the forces of all wheels, in the frame of the car.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TyreSum {
    pub along_n: f64,
    pub across_n: f64,
    /// Moments about the centre of mass: roll, pitch and yaw.
    pub moments_n_m: [f64; 3],
    /// True if the tyres could not exert the wanted force.
    pub is_limited: bool,
}

/// Slip of one wheel, divided by the slip of its peak.
#[derive(Clone, Copy, Debug, Default)]
struct WheelSlip {
    cos: f64,
    sin: f64,
    across_mps: f64,
    most_along_n: f64,
    most_across_n: f64,
    across: f64,
    /// Greatest force along the wheel that antilock brakes allow.
    reach_n: f64,
}

impl TyreForces {
    pub(super) fn new(
        body: &Body,
        vehicle: &Vehicle,
        tyres: &Tyres,
        loads_n: [f64; 4],
        ground: Ground,
    ) -> TyreForces {
        let size = body.dimensions();
        let half_track_m = 0.5 * vehicle.track_m;
        let (front, rear) = tyres.cornering_per_rad;
        let yaw_inertia_kg_m2 = body.yaw_inertia_kg_m2();
        let wheel = |ahead_m: f64, left_m: f64, static_n: f64, cornering_per_rad: f64| {
            let arm_m = ahead_m - body.com_ahead_m;
            // A side force at an axle also turns the body, so it moves less than the whole mass.
            let axle_kg = 1.0 / (1.0 / body.mass_kg + arm_m * arm_m / yaw_inertia_kg_m2);
            TyreWheel {
                ahead_m,
                left_m,
                static_n,
                moved_kg: 0.5 * axle_kg,
                cornering_per_rad,
            }
        };
        let front_m = vehicle.front_axle_ahead_m(&size);
        let rear_m = vehicle.rear_axle_ahead_m(&size);
        TyreForces {
            tyres: *tyres,
            curve: SlipCurve::new(tyres.shape),
            ground,
            // Without brakes of its own the car brakes as its weight rests.
            front_share: vehicle
                .brakes
                .map_or(vehicle.front_load_share(&size), |brakes| brakes.front_share),
            wheels: [
                wheel(front_m, half_track_m, loads_n[0], front),
                wheel(front_m, -half_track_m, loads_n[1], front),
                wheel(rear_m, half_track_m, loads_n[2], rear),
                wheel(rear_m, -half_track_m, loads_n[3], rear),
            ],
            com_ahead_m: body.com_ahead_m,
            com_height_m: body.com_height_m,
            // A higher arm would tip the car, which cannot roll over here.
            roll_arm_m: body
                .com_height_m
                .min(SAFE_ARM * half_track_m / tyres.mu_across),
        }
    }

    pub(super) fn set_ground(&mut self, ground: Ground) {
        self.ground = ground;
    }

    /// Returns the forces of one step, from the motion of the middle of the length.
    pub(super) fn forces(&self, rect: &Rect, demand: &TyreDemand, dt_s: f64) -> TyreSum {
        let slips: [WheelSlip; 4] = core::array::from_fn(|index| self.slip(index, rect, demand));
        let wanted_n = self.distribute(demand, &slips);
        let mut sum = TyreSum::default();
        let mut given_n = 0.0;
        for (index, (slip, wheel)) in slips.iter().zip(&self.wheels).enumerate() {
            let (along_n, across_n) = self.wheel_force(slip, wheel, wanted_n[index], dt_s);
            given_n += along_n;
            let x_n = along_n * slip.cos - across_n * slip.sin;
            let y_n = along_n * slip.sin + across_n * slip.cos;
            sum.along_n += x_n;
            sum.across_n += y_n;
            sum.moments_n_m[2] += (wheel.ahead_m - self.com_ahead_m) * y_n - wheel.left_m * x_n;
        }
        sum.moments_n_m[0] = self.roll_arm_m * sum.across_n;
        sum.moments_n_m[1] = -self.com_height_m * sum.along_n;
        // A thousandth less is the end of Newton's steps and no limit of the grip.
        sum.is_limited = given_n.abs() < 0.999 * demand.force_n.abs();
        sum
    }

    /// Returns the slip and the reach of one wheel.
    fn slip(&self, index: usize, rect: &Rect, demand: &TyreDemand) -> WheelSlip {
        let wheel = &self.wheels[index];
        let load_n = demand.loads_n[index];
        let (sin, cos) = libm::sincos(demand.steering_rad[index]);
        let turning = rect.yaw_rate_rad_per_s;
        let x_mps = rect.along_mps() - turning * wheel.left_m;
        let y_mps = rect.across_mps() + turning * wheel.ahead_m;
        let (along_mps, across_mps) = (x_mps * cos + y_mps * sin, y_mps * cos - x_mps * sin);
        let overload = load_n / wheel.static_n - 1.0;
        let friction = self.ground.friction
            * self.tyres.wet_share(self.ground.friction, along_mps)
            // A tenth remains, so that an overload never makes the friction
            // negative.
            * (1.0 - self.tyres.load_loss * overload).max(0.1);
        let mu_across = friction * self.tyres.mu_across;
        // Tangent of the slip angle at the peak: the curve begins with the stiffness.
        let peak = mu_across * self.curve.slope() / wheel.cornering_per_rad;
        // A standing wheel has no slip angle, so the speed is bounded from below.
        let across = across_mps / (peak * along_mps.abs().max(0.01));
        let most_along_n = friction * self.tyres.mu_along * load_n;
        WheelSlip {
            cos,
            sin,
            across_mps,
            most_along_n,
            most_across_n: mu_across * load_n,
            across,
            reach_n: most_along_n * self.curve.share_per_slip(hypot(1.0, across)).0,
        }
    }

    /// Distributes the wanted force among the wheels, within their reach.
    ///
    /// A wheel at its limit leaves the rest of its share to the others.
    fn distribute(&self, demand: &TyreDemand, slips: &[WheelSlip; 4]) -> [f64; 4] {
        let most_n = demand.force_n.abs();
        let mut reach_n = slips.map(|slip| slip.reach_n);
        if demand.force_n < 0.0 {
            // Select low: both rear brakes have the pressure of the wheel with less grip.
            let low_n = reach_n[2].min(reach_n[3]);
            (reach_n[2], reach_n[3]) = (low_n, low_n);
        }
        let [front_n, rear_n] = self.axle_forces_n(demand, most_n);
        let wanted_n = [front_n, front_n, rear_n, rear_n];
        // Equal on both sides: by load, the outer brakes would turn the car out of a bend.
        let first_n: [f64; 4] =
            core::array::from_fn(|index| (0.5 * wanted_n[index]).min(reach_n[index]));
        let missing_n = most_n - first_n.iter().sum::<f64>();
        let spare_n: [f64; 4] =
            core::array::from_fn(|index| (reach_n[index] - first_n[index]).max(0.0));
        let all_spare_n: f64 = spare_n.iter().sum();
        // Without spare grip nothing is missing that a wheel could give.
        let used = (missing_n / all_spare_n.max(1e-9)).clamp(0.0, 1.0);
        core::array::from_fn(|index| {
            (first_n[index] + used * spare_n[index]).copysign(demand.force_n)
        })
    }

    /// Returns the forces of the front and the rear axle below the limits of the wheels.
    ///
    /// The drive follows the loads. The brakes have a fixed distribution, but the rear
    /// ones get no more than the load of the lighter rear wheel allows: an axle that
    /// brakes more than it carries would lose its side grip first.
    fn axle_forces_n(&self, demand: &TyreDemand, most_n: f64) -> [f64; 2] {
        let [left_n, right_n, rear_left_n, rear_right_n] = demand.loads_n;
        let all_n = (left_n + right_n + rear_left_n + rear_right_n).max(1.0);
        let rear_share = if demand.force_n < 0.0 {
            // Braking unloads the rear, whose pressure is limited so that it does not lock
            // first.
            (1.0 - self.front_share).min(2.0 * rear_left_n.min(rear_right_n) / all_n)
        } else {
            (rear_left_n + rear_right_n) / all_n
        };
        [most_n * (1.0 - rear_share), most_n * rear_share]
    }

    /// Returns the forces along and across one wheel.
    fn wheel_force(
        &self,
        slip: &WheelSlip,
        wheel: &TyreWheel,
        wanted_n: f64,
        dt_s: f64,
    ) -> (f64, f64) {
        // A lifted wheel carries nothing, and 0/0 would spread.
        let wanted = wanted_n.abs() / slip.most_along_n.max(1e-9);
        let along = if wanted_n == 0.0 {
            0.0
        } else if wanted_n.abs() < slip.reach_n {
            self.curve.slip_for(wanted, slip.across)
        } else {
            1.0
        };
        let (share, _) = self.curve.share_per_slip(hypot(along, slip.across));
        let along_n = (slip.most_along_n * share * along).copysign(wanted_n);
        let stop_n = STOPPABLE * wheel.moved_kg * slip.across_mps / dt_s;
        let across_n = slip.most_across_n * share * slip.across;
        (along_n, -across_n.abs().min(stop_n.abs()).copysign(stop_n))
    }
}

/// Magic formula without its curvature factor, scaled to a peak of 1 at a slip of 1.
#[derive(Clone, Copy, Debug)]
struct SlipCurve {
    shape: f64,
    stretch: f64,
}

impl SlipCurve {
    fn new(shape: f64) -> SlipCurve {
        SlipCurve {
            shape,
            stretch: libm::tan(0.5 * core::f64::consts::PI / shape),
        }
    }

    /// Returns the slope at slip 0.
    fn slope(&self) -> f64 {
        self.shape * self.stretch
    }

    /// Returns the share of the friction in use per slip, and its derivative.
    fn share_per_slip(&self, slip: f64) -> (f64, f64) {
        // The quotient below would lose its digits.
        if slip < 1e-6 {
            return (self.slope(), 0.0);
        }
        let stretched = self.stretch * slip;
        let (sin, cos) = libm::sincos(self.shape * libm::atan(stretched));
        let ratio = sin / slip;
        let rise = self.slope() * cos / (1.0 + stretched * stretched);
        (ratio, (rise - ratio) / slip)
    }

    /// Returns the slip along the wheel that a share of the friction along it needs.
    ///
    /// The share is concave in the slip up to the peak, so Newton's method approaches
    /// from below. A share beyond the reach gives the peak.
    fn slip_for(&self, wanted: f64, across: f64) -> f64 {
        let mut slip = 0.0;
        for _ in 0..NEWTON_STEPS {
            let all = hypot(slip, across);
            let (ratio, bend) = self.share_per_slip(all);
            // The derivative of the force along the wheel, with the slip across it held.
            let rise = ratio + slip * slip * bend / all.max(1e-6);
            slip = (slip + (wanted - ratio * slip) / rise.max(1e-3)).clamp(0.0, 1.0);
        }
        slip
    }
}

fn hypot(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_peaks_at_one() {
        for shape in [1.1, 1.35, 1.9] {
            let curve = SlipCurve::new(shape);
            let share = |slip: f64| slip * curve.share_per_slip(slip).0;
            assert!((share(1.0) - 1.0).abs() < 1e-12);
            assert!(share(0.9) < 1.0 && share(1.1) < 1.0);
            assert!((share(1e-4) / 1e-4 - curve.slope()).abs() < 1e-3);
        }
    }

    #[test]
    fn the_slip_gives_the_wanted_share_whatever_the_side_slip() {
        let curve = SlipCurve::new(1.35);
        for across in [0.0, 0.1, 0.5, 1.0, 3.0] {
            let share = |along: f64| along * curve.share_per_slip(hypot(along, across)).0;
            let reach = share(1.0);
            for part in [0.1, 0.5, 0.9] {
                let slip = curve.slip_for(part * reach, across);
                let got = share(slip) / reach;
                assert!((got - part).abs() < 0.01, "{across} {part}: {got}");
            }
        }
    }
}
