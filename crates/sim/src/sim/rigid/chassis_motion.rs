//! Motion of a chassis, and its footprint on the ground.

use parry3d_f64::math as f64_math;
use rapier3d::math::{Pose, Vector};

use crate::sim::planar::Rect;
use crate::sim::{Body, Placement};

/// Squared horizontal part of a heading below which a body stands on its nose.
const UPENDED: f64 = 1e-4;

/// Pose and velocity of a chassis at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ChassisMotion {
    pub pose: Pose,
    pub linear: Vector,
    pub angular: Vector,
}

impl ChassisMotion {
    /// Returns the upright footprint.
    ///
    /// It is placed by the centre of mass, about which the chassis pitches and rolls on
    /// its springs. `up` is the direction in which the ground carries the body.
    pub(super) fn rect(&self, origin_m: (f64, f64), body: &ComOffset, up: Vector) -> Rect {
        let ahead = self.pose.rotation * Vector::X;
        let (mut ahead_x, mut ahead_y) = (f64::from(ahead.x), f64::from(ahead.y));
        // A body that a collision stood on its nose has the heading of its sides.
        if ahead_x * ahead_x + ahead_y * ahead_y < UPENDED {
            // The side is still level, and a quarter turn to the right of it
            // lies the heading.
            let left = self.pose.rotation * Vector::Y;
            (ahead_x, ahead_y) = (f64::from(left.y), -f64::from(left.x));
        }
        // Pitch shortens the horizontal part of the heading, so normalise it.
        let scale = 1.0 / (ahead_x * ahead_x + ahead_y * ahead_y).sqrt();
        let (cos, sin) = (ahead_x * scale, ahead_y * scale);
        // Below the centre of mass, on the ground. On a plane this changes no bit.
        let com = self.pose * body.local - Vector::new(up.x, up.y, 0.0) * body.local.z;
        let yaw_rate_rad_per_s = f64::from(self.angular.z);
        Rect {
            x_m: origin_m.0 + f64::from(com.x) - body.ahead_m * cos,
            y_m: origin_m.1 + f64::from(com.y) - body.ahead_m * sin,
            cos,
            sin,
            // From the centre of mass to the centre of the box, which swings in a turn.
            vx_mps: f64::from(self.linear.x) + yaw_rate_rad_per_s * body.ahead_m * sin,
            vy_mps: f64::from(self.linear.y) - yaw_rate_rad_per_s * body.ahead_m * cos,
            yaw_rate_rad_per_s,
        }
    }

    /// Returns the centre of the bounding box, with pitch and roll.
    pub(super) fn placement(&self, origin_m: (f64, f64), height_m: f64) -> Placement {
        let centre = self.pose * vector(0.0, 0.0, 0.5 * height_m);
        let (x_m, y_m) = (f64::from(centre.x), f64::from(centre.y));
        let rotation = self.pose.rotation;
        Placement::from_parts(
            [origin_m.0 + x_m, origin_m.1 + y_m, f64::from(centre.z)],
            [rotation.x, rotation.y, rotation.z, rotation.w].map(f64::from),
        )
    }

    /// Returns the pose of the frame of the chassis in the world.
    pub(super) fn pose_in_world(&self, origin_m: (f64, f64)) -> f64_math::Pose {
        let [x, y, z] = self.pose.translation.to_array().map(f64::from);
        let [qx, qy, qz, qw] = self.pose.rotation.to_array().map(f64::from);
        f64_math::Pose::from_parts(
            f64_math::Vector::new(origin_m.0 + x, origin_m.1 + y, z),
            f64_math::Rotation::from_xyzw(qx, qy, qz, qw).normalize(),
        )
    }

    /// Returns the velocity gained since an earlier instant, along world x and y.
    pub(super) fn gain_mps(&self, before: &ChassisMotion) -> (f64, f64) {
        let gain = self.linear - before.linear;
        (f64::from(gain.x), f64::from(gain.y))
    }

    /// Interpolates towards another motion by a share.
    pub(super) fn towards(&self, end: &ChassisMotion, share: f64) -> ChassisMotion {
        let share = share as f32;
        ChassisMotion {
            pose: Pose::from_parts(
                self.pose.translation.lerp(end.pose.translation, share),
                // Over the small turn of one step a linear mix suffices and
                // needs no sine.
                self.pose.rotation.lerp(end.pose.rotation, share),
            ),
            linear: self.linear.lerp(end.linear, share),
            angular: self.angular.lerp(end.angular, share),
        }
    }
}

/// Impulse at the centre of mass of a body, and an angular impulse about it.
///
/// Both are in the frame of the body's heading and of the ground's normal.
pub(super) struct Impulse {
    pub along_n_s: f64,
    /// To the left.
    pub across_n_s: f64,
    /// About the axes ahead, to the left and up.
    pub angular_n_m_s: [f64; 3],
}

/// Position of the centre of mass in the frame of the chassis.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComOffset {
    local: Vector,
    ahead_m: f64,
}

impl ComOffset {
    pub(super) fn of(body: &Body) -> ComOffset {
        let local = vector(body.com_ahead_m, 0.0, body.com_height_m);
        ComOffset {
            local,
            ahead_m: body.com_ahead_m,
        }
    }
}

/// Converts to rapier's f32 vector.
pub(super) fn vector(x: f64, y: f64, z: f64) -> Vector {
    Vector::new(x as f32, y as f32, z as f32)
}
