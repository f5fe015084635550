//! Collision shapes of parry, in f64, and the distance between two of them.
//!
//! A shape is a list of convex parts. A part is a core of parry with a radius
//! around it. The distance between two rounded parts is the distance between
//! their cores less both radii, so rounding costs no accuracy.

use std::sync::Arc;

use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::{
    ClosestPoints, ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher,
    QueryDispatcher,
};
use parry3d_f64::shape::{Segment, SharedShape};
use rapier3d::math as rapier;
use rapier3d::prelude::SharedShape as RapierShape;

use crate::sim::planar::{ContactGeometry, Rect, SizedRect, TOUCH_M};
use crate::sim::{Body, BodyPart, BodyShape};

/// Distance of two cores below which their difference gives no direction.
const COINCIDENT_M: f64 = 1e-9;

/// Collision shape of a body.
///
/// Its frame lies on the ground below the middle of the bounding box: x ahead,
/// y left, z up. A copy shares the parts.
#[derive(Clone)]
pub(super) struct CollisionShape {
    parts: Arc<[ConvexPart]>,
    is_box: bool,
}

struct ConvexPart {
    core: SharedShape,
    /// Middle of the core in the frame of the shape.
    middle: Vector,
    radius_m: f64,
    /// Lowest and highest point above the ground.
    up_m: (f64, f64),
}

/// Signed distance of two shapes, negative if they overlap.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShapeGap {
    pub gap_m: f64,
    /// Unit vector from the first shape to the second, in the world frame.
    pub normal: [f64; 3],
}

impl ShapeGap {
    /// Returns the least of some distances.
    fn least(gaps: impl Iterator<Item = ShapeGap>) -> ShapeGap {
        let none = ShapeGap {
            gap_m: f64::INFINITY,
            normal: [1.0, 0.0, 0.0],
        };
        // Strictly less, so that the first of equally near pairs gives the normal.
        gaps.fold(
            none,
            |best, next| if next.gap_m < best.gap_m { next } else { best },
        )
    }
}

/// Signed distance of two parts, in the frame of the first part's shape.
struct PartGap {
    gap_m: f64,
    /// Unit vector to the second part.
    normal: Vector,
    /// Point of the first part that is closest to the second.
    point: Vector,
}

impl CollisionShape {
    /// Builds the shape of a valid body.
    pub(super) fn of(body: &Body) -> CollisionShape {
        let (l, w, h) = (body.length_m, body.width_m, body.height_m);
        let whole = [(-0.5 * l, 0.5 * l), (-0.5 * w, 0.5 * w), (0.0, h)];
        let parts = match &body.shape {
            BodyShape::Box => vec![ConvexPart::cuboid(whole, 0.0)],
            BodyShape::Rounded { corner_radius_m } => {
                vec![ConvexPart::cuboid(whole, *corner_radius_m)]
            }
            BodyShape::Capsule => {
                let radius_m = 0.5 * l;
                // Half a sphere lies beyond each end of the axis.
                let (low, high) = (radius_m, h - radius_m);
                vec![ConvexPart::capsule(
                    (0.0, 0.0, low),
                    (0.0, 0.0, high),
                    radius_m,
                )]
            }
            BodyShape::Parts(parts) => parts.iter().map(ConvexPart::of).collect(),
        };
        CollisionShape {
            parts: parts.into(),
            is_box: body.shape.is_box(),
        }
    }

    /// Returns the parts for rapier, with their middles in the frame of the shape.
    ///
    /// They begin at a height above the ground, so that wheels carry a vehicle.
    pub(super) fn colliders(&self, clearance_m: f64) -> Vec<(rapier::Vector, RapierShape)> {
        let parts = self.parts.iter();
        parts.map(|part| part.collider(clearance_m)).collect()
    }

    /// Returns true for the bounding box itself.
    pub(super) fn is_box(&self) -> bool {
        self.is_box
    }

    /// Returns the signed distance of each pair of parts of two shapes.
    pub(super) fn gaps<'a>(
        &'a self,
        rect: &Rect,
        other: &'a CollisionShape,
        other_rect: &Rect,
    ) -> impl Iterator<Item = ShapeGap> + 'a {
        let pose = relative(rect, other_rect);
        let (cos, sin) = (rect.cos, rect.sin);
        self.pairs(other).map(move |(mine, theirs)| {
            let PartGap { gap_m, normal, .. } = mine.gap(theirs, &pose);
            ShapeGap {
                gap_m,
                normal: [
                    normal.x * cos - normal.y * sin,
                    normal.x * sin + normal.y * cos,
                    normal.z,
                ],
            }
        })
    }

    /// Returns the signed distance of each pair of parts of two shapes at poses in space.
    pub(super) fn gaps_at<'a>(
        &'a self,
        pose: &Pose,
        other: &'a CollisionShape,
        other_pose: &Pose,
    ) -> impl Iterator<Item = ShapeGap> + 'a {
        let relative = pose.inverse() * *other_pose;
        let rotation = pose.rotation;
        self.pairs(other).map(move |(mine, theirs)| {
            let PartGap { gap_m, normal, .. } = mine.gap(theirs, &relative);
            ShapeGap {
                gap_m,
                normal: (rotation * normal).to_array(),
            }
        })
    }

    /// Returns the signed distance of two shapes: that of their nearest parts.
    pub(super) fn gap(&self, rect: &Rect, other: &CollisionShape, other_rect: &Rect) -> ShapeGap {
        ShapeGap::least(self.gaps(rect, other, other_rect))
    }

    /// Returns the signed distance of two shapes at poses in space.
    pub(super) fn gap_at(
        &self,
        pose: &Pose,
        other: &CollisionShape,
        other_pose: &Pose,
    ) -> ShapeGap {
        ShapeGap::least(self.gaps_at(pose, other, other_pose))
    }

    /// Returns the contact of two touching shapes at poses in space.
    ///
    /// The point is the middle of parry's contact manifold, and the normal is that on the
    /// ground.
    pub(super) fn contact_at(
        &self,
        me: &SizedRect,
        pose: &Pose,
        other_shape: &Self,
        other: &SizedRect,
        other_pose: &Pose,
    ) -> ContactGeometry {
        let nearest = self.gap_at(pose, other_shape, other_pose);
        let relative = pose.inverse() * *other_pose;
        let Rect {
            x_m, y_m, cos, sin, ..
        } = *me.rect;
        // In the plane of the footprint, whose origin has no height.
        let levelled = |point: Vector| {
            let at = *pose * point;
            let (dx, dy) = (at.x - x_m, at.y - y_m);
            Vector::new(dx * cos + dy * sin, dy * cos - dx * sin, at.z)
        };
        let mut points = Vec::new();
        for (mine, theirs) in self.pairs(other_shape) {
            let gap = mine.gap(theirs, &relative);
            // Parts that merely come near carry no force.
            if gap.gap_m > nearest.gap_m + TOUCH_M {
                continue;
            }
            points.push(levelled(gap.point));
            points.extend(mine.manifold(theirs, &relative).into_iter().map(levelled));
        }
        let normal = level(nearest.normal, me.rect, other.rect);
        ContactGeometry::new(me, other, middle(&points, me.rect, normal), normal)
    }

    /// Returns the contact point, normal and closing speed of two touching shapes.
    ///
    /// The point is the middle of parry's contact manifold: of the common part of two
    /// faces, or the touching corner. Its height is the middle of the common height of
    /// the touching parts, because all walls are upright.
    pub(super) fn contact_geometry(
        &self,
        me: &SizedRect,
        other_shape: &Self,
        other: &SizedRect,
    ) -> ContactGeometry {
        let ShapeGap {
            gap_m: nearest_m,
            normal,
        } = self.gap(me.rect, other_shape, other.rect);
        let pose = relative(me.rect, other.rect);
        let mut points = Vec::new();
        for (mine, theirs) in self.pairs(other_shape) {
            let gap = mine.gap(theirs, &pose);
            // Only the parts that touch, not those that merely come near.
            if gap.gap_m > nearest_m + TOUCH_M {
                continue;
            }
            let up_m = 0.5 * (mine.up_m.0.max(theirs.up_m.0) + mine.up_m.1.min(theirs.up_m.1));
            let at_height = |point: Vector| Vector::new(point.x, point.y, up_m);
            // parry's manifold may be empty where a corner touches.
            points.push(at_height(gap.point));
            points.extend(mine.manifold(theirs, &pose).into_iter().map(at_height));
        }
        let normal = level(normal, me.rect, other.rect);
        let point = middle(&points, me.rect, normal);
        ContactGeometry::new(me, other, point, normal)
    }

    fn pairs<'a>(
        &'a self,
        other: &'a CollisionShape,
    ) -> impl Iterator<Item = (&'a ConvexPart, &'a ConvexPart)> {
        let pair = |mine| other.parts.iter().map(move |theirs| (mine, theirs));
        self.parts.iter().flat_map(pair)
    }
}

impl ConvexPart {
    fn of(part: &BodyPart) -> ConvexPart {
        match part {
            BodyPart::Box {
                ahead_m,
                left_m,
                up_m,
            } => ConvexPart::cuboid([*ahead_m, *left_m, *up_m], 0.0),
            BodyPart::Prism { outline_m, up_m } => ConvexPart::prism(outline_m, *up_m),
            BodyPart::Capsule {
                from_m,
                to_m,
                radius_m,
            } => ConvexPart::capsule(*from_m, *to_m, *radius_m),
        }
    }

    fn cuboid(axes_m: [(f64, f64); 3], radius_m: f64) -> ConvexPart {
        // The radius is added around the core, so the core is smaller by it.
        let half_m = axes_m.map(|(from, to)| 0.5 * (to - from) - radius_m);
        let middle_m = axes_m.map(|(from, to)| 0.5 * (from + to));
        ConvexPart {
            core: SharedShape::cuboid(half_m[0], half_m[1], half_m[2]),
            middle: Vector::from(middle_m),
            radius_m,
            up_m: axes_m[2],
        }
    }

    fn prism(outline_m: &[(f64, f64)], up_m: (f64, f64)) -> ConvexPart {
        let half_m = 0.5 * (up_m.1 - up_m.0);
        let corner = |up_m: f64| move |(x, y): &(f64, f64)| Vector::new(*x, *y, up_m);
        let bottom = outline_m.iter().map(corner(-half_m));
        let corners: Vec<Vector> = bottom.chain(outline_m.iter().map(corner(half_m))).collect();
        // A valid outline has an area, so its prism has a hull.
        let hull = SharedShape::convex_hull(&corners);
        ConvexPart {
            // A stand-in that valid bodies never reach, because library code
            // does not panic.
            core: hull.unwrap_or_else(|| SharedShape::ball(half_m)),
            middle: Vector::new(0.0, 0.0, 0.5 * (up_m.0 + up_m.1)),
            radius_m: 0.0,
            up_m,
        }
    }

    fn capsule(from_m: (f64, f64, f64), to_m: (f64, f64, f64), radius_m: f64) -> ConvexPart {
        let [from, to] = [from_m, to_m].map(|(x, y, z)| Vector::new(x, y, z));
        let middle = 0.5 * (from + to);
        ConvexPart {
            core: SharedShape::new(Segment::new(from - middle, to - middle)),
            middle,
            radius_m,
            up_m: (from.z.min(to.z) - radius_m, from.z.max(to.z) + radius_m),
        }
    }

    /// Returns the part for rapier, above a clearance.
    fn collider(&self, clearance_m: f64) -> (rapier::Vector, RapierShape) {
        let vector = |at: Vector| rapier::Vector::new(at.x as f32, at.y as f32, at.z as f32);
        let radius = self.radius_m as f32;
        if let Some(segment) = self.core.as_segment() {
            let (a, b) = (vector(segment.a), vector(segment.b));
            return (vector(self.middle), RapierShape::capsule(a, b, radius));
        }
        // A part that lies below the clearance as a whole keeps a thin slice.
        let (low_m, high_m) = self.up_m;
        let low_m = low_m.max(clearance_m).min(high_m - 0.01);
        let middle = Vector::new(self.middle.x, self.middle.y, 0.5 * (low_m + high_m));
        // A rounded box as flat as its radius keeps a core.
        let half_m = (0.5 * (high_m - low_m) - self.radius_m).max(0.005);
        // The points of a prism lie above or below its middle, so their sign tells which
        // end moves.
        if let Some(hull) = self.core.as_convex_polyhedron() {
            let raised = hull
                .points()
                .iter()
                .map(|at| vector(Vector::new(at.x, at.y, half_m.copysign(at.z))));
            let corners: Vec<rapier::Vector> = raised.collect();
            if let Some(hull) = RapierShape::convex_hull(&corners) {
                return (vector(middle), hull);
            }
        }
        let half = self
            .core
            .as_cuboid()
            .map(|cuboid| cuboid.half_extents)
            .unwrap_or(Vector::new(half_m, half_m, half_m));
        let (l, w, h) = (half.x as f32, half.y as f32, half_m as f32);
        let shape = if radius > 0.0 {
            RapierShape::round_cuboid(l, w, h, radius)
        } else {
            RapierShape::cuboid(l, w, h)
        };
        (vector(middle), shape)
    }

    /// Returns the pose of another part relative to this one.
    fn pose_of(&self, other: &ConvexPart, pose: &Pose) -> Pose {
        let middle = *pose * other.middle - self.middle;
        Pose::from_parts(middle, pose.rotation)
    }

    fn gap(&self, other: &ConvexPart, pose: &Pose) -> PartGap {
        let pose = self.pose_of(other, pose);
        let (a, b) = (&*self.core, &*other.core);
        let of_cores = |distance_m: f64, normal: Vector, point: Vector| PartGap {
            gap_m: distance_m - self.radius_m - other.radius_m,
            normal,
            point: self.middle + point + normal * self.radius_m,
        };
        let points = DefaultQueryDispatcher.closest_points(&pose, a, b, f64::MAX);
        if let Ok(ClosestPoints::WithinMargin(mine, theirs)) = points {
            let way = pose * theirs - mine;
            let distance_m = way.length();
            // Nearer points have no direction, and neither have cores that overlap.
            if distance_m > COINCIDENT_M {
                return of_cores(distance_m, way / distance_m, mine);
            }
        }
        match DefaultQueryDispatcher.contact(&pose, a, b, TOUCH_M) {
            Ok(Some(contact)) => of_cores(contact.dist, contact.normal1, contact.point1),
            // Without an answer of parry the cores count as touching.
            _ => of_cores(0.0, Vector::X, Vector::ZERO),
        }
    }

    /// Returns the points of contact within [`TOUCH_M`], in the frame of the shape.
    fn manifold(&self, other: &ConvexPart, pose: &Pose) -> Vec<Vector> {
        let pose = self.pose_of(other, pose);
        // Manifolds are those of the cores, which the radii keep apart.
        let reach_m = self.radius_m + other.radius_m + TOUCH_M;
        let mut manifolds: Vec<ContactManifold<(), ()>> = Vec::new();
        let done = DefaultQueryDispatcher.contact_manifolds(
            &pose,
            &*self.core,
            &*other.core,
            reach_m,
            &mut manifolds,
            &mut None,
        );
        // Without a manifold the closest point alone gives the contact.
        if done.is_err() {
            return Vec::new();
        }
        let of_manifold = |manifold: &ContactManifold<(), ()>| -> Vec<Vector> {
            let shift = self.middle + manifold.local_n1 * self.radius_m;
            let near = manifold.points.iter().filter(|point| point.dist <= reach_m);
            near.map(|point| point.local_p1 + shift).collect()
        };
        manifolds.iter().flat_map(of_manifold).collect()
    }
}

/// Returns the pose of a footprint in the frame of another.
fn relative(rect: &Rect, other: &Rect) -> Pose {
    let (dx, dy) = (other.x_m - rect.x_m, other.y_m - rect.y_m);
    let at = Vector::new(
        dx * rect.cos + dy * rect.sin,
        dy * rect.cos - dx * rect.sin,
        0.0,
    );
    // A unit quaternion has half the angle of its rotation.
    let (sin, cos) = libm::sincos(0.5 * rect.turn_rad_to(other));
    Pose::from_parts(at, Rotation::from_xyzw(0.0, 0.0, sin, cos))
}

/// Returns the middle of some points along the normal, the tangent and upwards.
///
/// The points are in the frame of `rect`, the middle is in the world frame. Without
/// points it is the middle of `rect`.
fn middle(points: &[Vector], rect: &Rect, [nx, ny]: [f64; 2]) -> [f64; 3] {
    let Rect {
        x_m, y_m, cos, sin, ..
    } = *rect;
    // Normal in the frame of the points.
    let (ahead, left) = (nx * cos + ny * sin, ny * cos - nx * sin);
    let middle = |value: &dyn Fn(&Vector) -> f64| {
        let values = points.iter().map(value);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        // Without a point the bounds are still reversed infinities.
        if low <= high { 0.5 * (low + high) } else { 0.0 }
    };
    let along = middle(&|at| at.x * ahead + at.y * left);
    let across = middle(&|at| at.y * ahead - at.x * left);
    let up = middle(&|at| at.z);
    [
        x_m + along * nx - across * ny,
        y_m + along * ny + across * nx,
        up,
    ]
}

/// Returns the normal on the ground, as a unit vector.
///
/// A part on top of another gives no direction on the ground. The direction
/// between the two middles stands in.
fn level([x, y, _]: [f64; 3], rect: &Rect, other: &Rect) -> [f64; 2] {
    let unit = |x: f64, y: f64| {
        let length = (x * x + y * y).sqrt();
        (length > COINCIDENT_M).then(|| [x / length, y / length])
    };
    unit(x, y)
        .or_else(|| unit(other.x_m - rect.x_m, other.y_m - rect.y_m))
        .unwrap_or([rect.cos, rect.sin])
}
