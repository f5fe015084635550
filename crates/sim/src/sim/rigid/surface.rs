//! Ground that is no plane: the surface of roads.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use parry3d::query::Ray;
use parry3d_f64::math as f64_math;
use rapier3d::math::{Pose, Vector};
use rapier3d::prelude::SharedShape;

use super::chassis_motion::vector;
use crate::road::SurfaceMesh;
use crate::sim::Placement;
use crate::sim::planar::Rect;

/// Height above the surface from which its height is measured.
const ABOVE_M: f32 = 1.0;

/// Surface under the bodies of a plant. A copy shares the mesh.
#[derive(Clone)]
pub struct GroundSurface {
    pub(super) shape: SharedShape,
    /// Lowest and highest point.
    pub(super) heights_m: (f32, f32),
}

/// Surface below a point of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePoint {
    pub z_m: f64,
    /// Unit vector upwards.
    pub normal: Vector3<f64>,
}

impl GroundSurface {
    /// Builds the surface of a mesh, `None` for a mesh without triangles.
    pub fn of(mesh: &SurfaceMesh) -> Option<GroundSurface> {
        let points: Vec<Vector> = mesh
            .points_m
            .iter()
            .map(|&[x, y, z]| vector(x, y, z))
            .collect();
        let heights = points.iter().map(|point| point.z);
        let heights_m = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), z| {
            (low.min(z), high.max(z))
        });
        // Refused by parry for a mesh without triangles, on which nothing could stand.
        let shape = SharedShape::trimesh(points, mesh.triangles.clone()).ok()?;
        Some(GroundSurface { shape, heights_m })
    }

    /// Returns the surface below a point of the plane, `None` beside the mesh.
    pub(super) fn at(&self, x_m: f64, y_m: f64) -> Option<SurfacePoint> {
        let (low_m, high_m) = self.heights_m;
        // From above the whole surface, so that the ray meets its upper side first.
        let from = Vector::new(x_m as f32, y_m as f32, high_m + ABOVE_M);
        let ray = Ray::new(from, Vector::new(0.0, 0.0, -1.0));
        // The ray ends a metre below the lowest point, so that rounding loses
        // no hit there.
        let most_m = high_m - low_m + 2.0 * ABOVE_M;
        let hit = self
            .shape
            .cast_ray_and_get_normal(&Pose::IDENTITY, &ray, most_m, true)?;
        let [x, y, z] = hit.normal.to_array().map(f64::from);
        Some(SurfacePoint {
            z_m: f64::from(from.z - hit.time_of_impact),
            normal: Vector3::new(x, y, z),
        })
    }
}

impl SurfacePoint {
    /// Returns the orientation of a body on the surface, which keeps its heading.
    pub(super) fn rotation(&self, rect: &Rect) -> UnitQuaternion<f64> {
        let heading = Vector3::new(rect.cos, rect.sin, 0.0);
        // The heading without its part through the surface: a body keeps its direction.
        let ahead = (heading - self.normal * heading.dot(&self.normal)).normalize();
        let left = self.normal.cross(&ahead);
        // Unchecked is sound here: the three vectors are perpendicular unit
        // vectors.
        let basis = Rotation3::from_basis_unchecked(&[ahead, left, self.normal]);
        UnitQuaternion::from_rotation_matrix(&basis)
    }

    /// Returns the pose of a body on the surface.
    pub(super) fn pose(&self, rect: &Rect) -> f64_math::Pose {
        let [x, y, z, w]: [f64; 4] = self.rotation(rect).coords.into();
        f64_math::Pose::from_parts(
            f64_math::Vector::new(rect.x_m, rect.y_m, self.z_m),
            f64_math::Rotation::from_xyzw(x, y, z, w),
        )
    }

    /// Returns the centre and orientation of a body on the surface.
    pub(super) fn placement(&self, rect: &Rect, height_m: f64) -> Placement {
        let rotation = self.rotation(rect);
        // Half the height along the normal, because the box stands on the slope.
        let up = rotation * Vector3::z() * (0.5 * height_m);
        Placement::from_parts(
            [rect.x_m + up.x, rect.y_m + up.y, self.z_m + up.z],
            rotation.coords.into(),
        )
    }

    /// Returns the pose of an upright body on the surface.
    pub(super) fn upright(&self, rect: &Rect) -> f64_math::Pose {
        let plane = SurfacePoint {
            normal: Vector3::z(),
            ..*self
        };
        plane.pose(rect)
    }
}
