//! Poses on the ground and placements in space.

use nalgebra::{Point2, Quaternion, UnitComplex, UnitQuaternion, Vector2, Vector3};
use serde::{Deserialize, Serialize, Serializer};

/// Angle below which sine and cosine are the angle and 1, to the last bit: 2⁻²⁸.
const TINY_RAD: f64 = 3.725_290_298_461_914e-9;

/// Pose on the ground. For a body, that of the middle of its front bumper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position along world x.
    pub x_m: f64,
    /// Position along world y (left).
    pub y_m: f64,
    /// Heading, counter-clockwise from world x.
    pub heading_rad: f64,
}

/// Position and orientation of a body's centre, for viewers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Centre of the bounding box in the world frame.
    pub centre_m: [f64; 3],
    /// Rotation from the body's frame to the world frame.
    pub rotation: UnitQuaternion<f64>,
}

impl Serialize for Placement {
    /// Writes the centre x, y, z in metres and the rotation qx, qy, qz, qw.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let ([x, y, z], q) = (self.centre_m, self.rotation.coords);
        [x, y, z, q.x, q.y, q.z, q.w].serialize(serializer)
    }
}

/// Frame on the ground with its x axis along a heading.
///
/// An `Isometry2` adds the origin last. Kept results need the order of
/// [`GroundFrame::to_world`] to keep their last bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundFrame {
    /// Origin of the frame.
    pub origin_m: Point2<f64>,
    pub(crate) rotation: UnitComplex<f64>,
}

/// Returns the rotation by an angle, counter-clockwise.
///
/// `UnitComplex::new` calls the platform's sine, whose last bits differ between
/// machines.
#[inline]
pub fn rotation_by(angle_rad: f64) -> UnitComplex<f64> {
    // What `sincos` returns there, without the call: most cars drive along their road.
    let (sin, cos) = if angle_rad.abs() < TINY_RAD {
        (angle_rad, 1.0)
    } else {
        libm::sincos(angle_rad)
    };
    UnitComplex::from_cos_sin_unchecked(cos, sin)
}

/// Returns the sine of an angle, like [`rotation_by`] without a call for tiny ones.
#[inline]
pub fn sine(angle_rad: f64) -> f64 {
    if angle_rad.abs() < TINY_RAD {
        angle_rad
    } else {
        libm::sin(angle_rad)
    }
}

impl Pose {
    /// Returns the position.
    #[inline]
    pub fn point_m(&self) -> Point2<f64> {
        Point2::new(self.x_m, self.y_m)
    }

    /// Returns the frame of this pose: x ahead, y to the left.
    #[inline]
    pub fn frame(&self) -> GroundFrame {
        GroundFrame {
            origin_m: self.point_m(),
            rotation: rotation_by(self.heading_rad),
        }
    }

    /// Returns the pose at a distance ahead, with the same heading.
    pub fn ahead(&self, by_m: f64) -> Pose {
        let at_m = self.point_m() + self.frame().ahead() * by_m;
        Pose {
            x_m: at_m.x,
            y_m: at_m.y,
            ..*self
        }
    }
}

impl Placement {
    /// Returns the placement of a body without pitch and roll.
    pub fn upright(centre_m: [f64; 3], heading_rad: f64) -> Placement {
        // A unit quaternion has half the angle of its rotation.
        let (sin, cos) = libm::sincos(0.5 * heading_rad);
        Placement::from_parts(centre_m, [0.0, 0.0, sin, cos])
    }

    /// Returns the placement with a unit quaternion (x, y, z, w).
    pub fn from_parts(centre_m: [f64; 3], xyzw: [f64; 4]) -> Placement {
        let rotation = UnitQuaternion::new_unchecked(Quaternion::from(xyzw));
        Placement { centre_m, rotation }
    }

    /// Returns the direction of the body's long axis on the ground, from world x.
    pub fn heading_rad(&self) -> f64 {
        let ahead = self.rotation * Vector3::x();
        libm::atan2(ahead.y, ahead.x)
    }

    /// Returns the angles about the body's axes to the left and to the front.
    ///
    /// Positive angles lower the front and lift the left side (ISO 8855).
    pub fn pitch_roll_rad(&self) -> (f64, f64) {
        // Heights of the ends of the body's axes, of length 1.
        let [ahead_z, left_z, up_z] =
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| (self.rotation * axis).z);
        // Rounding may exceed 1, where the arcsine is no number.
        let pitch_rad = -libm::asin(ahead_z.clamp(-1.0, 1.0));
        (pitch_rad, libm::atan2(left_z, up_z))
    }

    /// Returns the frame on the ground below the centre.
    pub fn ground_frame(&self) -> GroundFrame {
        let [x_m, y_m, _] = self.centre_m;
        GroundFrame {
            origin_m: Point2::new(x_m, y_m),
            rotation: rotation_by(self.heading_rad()),
        }
    }
}

impl GroundFrame {
    /// Returns the unit vector along x.
    pub fn ahead(&self) -> Vector2<f64> {
        Vector2::new(self.rotation.re, self.rotation.im)
    }

    /// Returns the unit vector along y.
    pub fn left(&self) -> Vector2<f64> {
        Vector2::new(-self.rotation.im, self.rotation.re)
    }

    /// Returns the world coordinates of a point in this frame.
    pub fn to_world(self, ahead_m: f64, left_m: f64) -> Point2<f64> {
        self.origin_m + self.ahead() * ahead_m + self.left() * left_m
    }

    /// Returns the coordinates in this frame of a point in the world.
    #[inline]
    pub fn to_local(self, point_m: Point2<f64>) -> Vector2<f64> {
        self.rotation.inverse() * (point_m - self.origin_m)
    }
}

/// Wraps an angle to −π ..= π.
pub fn wrapped(angle_rad: f64) -> f64 {
    libm::remainder(angle_rad, core::f64::consts::TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heading_of_a_placement_is_that_of_its_long_axis() {
        for heading_rad in [-3.0, -0.5, 0.0, 1.0, 3.1] {
            let upright = Placement::upright([1.0, 2.0, 0.5], heading_rad);
            assert!((upright.heading_rad() - heading_rad).abs() < 1e-12);
            let pitch = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.3);
            let pitched = Placement {
                rotation: upright.rotation * pitch,
                ..upright
            };
            assert!((pitched.heading_rad() - heading_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn rotations_by_tiny_angles_keep_the_bits_of_libm() {
        for angle_rad in [0.0, -0.0, 1e-300, -1e-20, 3.7e-9, -3.7e-9, 3.8e-9, TINY_RAD] {
            let (sin, cos) = libm::sincos(angle_rad);
            let rotation = rotation_by(angle_rad);
            assert_eq!(rotation.im.to_bits(), sin.to_bits());
            assert_eq!(rotation.re.to_bits(), cos.to_bits());
            assert_eq!(sine(angle_rad).to_bits(), libm::sin(angle_rad).to_bits());
        }
    }

    #[test]
    fn frames_keep_the_bits_of_the_written_out_sums() {
        for i in 0..1000 {
            let at = |step: f64| 100.0 * libm::sin(step * f64::from(i));
            let (pose, ahead_m, left_m) = (
                Pose {
                    x_m: at(0.7),
                    y_m: at(1.3),
                    heading_rad: at(0.11),
                },
                at(2.3),
                at(3.1),
            );
            let (sin, cos) = libm::sincos(pose.heading_rad);
            let world = pose.frame().to_world(ahead_m, left_m);
            assert_eq!(world.x, pose.x_m + ahead_m * cos - left_m * sin);
            assert_eq!(world.y, pose.y_m + ahead_m * sin + left_m * cos);
            let local = pose.frame().to_local(Point2::new(ahead_m, left_m));
            let (dx, dy) = (ahead_m - pose.x_m, left_m - pose.y_m);
            assert_eq!(
                [local.x, local.y],
                [dx * cos + dy * sin, dy * cos - dx * sin]
            );
            let ahead = pose.ahead(-left_m);
            assert_eq!(ahead.x_m, pose.x_m - left_m * cos);
            assert_eq!(ahead.y_m, pose.y_m - left_m * sin);
        }
    }
}
