//! Oriented rectangles on the ground, the shapes used for gaps and contacts.
//!
//! Both plants measure between upright boxes on the ground. Two bodies therefore
//! touch exactly when their rectangles do, even if a chassis pitches or rolls on
//! its springs.

use super::body::Body;
use super::{BodyId, Contact, Pose};

/// Overlap up to which two bodies touch without penetrating.
pub(super) const TOUCH_M: f64 = 1e-3;

/// Rectangle on the ground with its motion at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rect {
    pub x_m: f64,
    pub y_m: f64,
    /// Cosine and sine of the heading.
    pub cos: f64,
    pub sin: f64,
    /// Velocity of the centre in the world frame.
    pub vx_mps: f64,
    pub vy_mps: f64,
    pub yaw_rate_rad_per_s: f64,
}

impl Rect {
    /// Returns the speed along the heading.
    pub(super) fn along_mps(&self) -> f64 {
        self.vx_mps * self.cos + self.vy_mps * self.sin
    }

    /// Returns the speed to the left of the heading.
    pub(super) fn across_mps(&self) -> f64 {
        self.vy_mps * self.cos - self.vx_mps * self.sin
    }

    /// Returns the turn to the heading of another rectangle, the shorter way around.
    pub(super) fn turn_rad_to(&self, other: &Rect) -> f64 {
        libm::atan2(
            self.cos * other.sin - self.sin * other.cos,
            self.cos * other.cos + self.sin * other.sin,
        )
    }

    /// Returns the rectangle turned about its centre.
    pub(super) fn turned(&self, turn_rad: f64) -> Rect {
        let (sin, cos) = libm::sincos(turn_rad);
        Rect {
            cos: self.cos * cos - self.sin * sin,
            sin: self.sin * cos + self.cos * sin,
            ..*self
        }
    }
}

/// Constant dimensions of a rectangle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Extent {
    pub half_length_m: f64,
    pub half_width_m: f64,
    /// Distance from the centre to a corner.
    pub radius_m: f64,
    /// Height of the box above the rectangle.
    pub height_m: f64,
}

/// Clearance of two rectangles along one direction, negative if they overlap.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Separation {
    pub gap_m: f64,
    /// Unit vector from the first rectangle to the second.
    pub nx: f64,
    pub ny: f64,
}

/// Geometry of the contact between two touching shapes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactGeometry {
    pub point_m: [f64; 3],
    /// Closing speed along the contact normal, ≥ 0.
    pub closing_speed_mps: f64,
    /// Unit normal from the first shape to the second.
    pub normal: [f64; 2],
}

impl ContactGeometry {
    /// Returns the contact of two shapes at a point, with its closing speed.
    pub(super) fn new(
        a: &SizedRect,
        b: &SizedRect,
        point_m: [f64; 3],
        normal: [f64; 2],
    ) -> ContactGeometry {
        let [x_m, y_m, _] = point_m;
        let [nx, ny] = normal;
        let (ours, theirs) = (a.velocity_at(x_m, y_m), b.velocity_at(x_m, y_m));
        let closing = (ours.0 - theirs.0) * nx + (ours.1 - theirs.1) * ny;
        ContactGeometry {
            point_m,
            // Clamped, because a contact never reports that the bodies move apart.
            closing_speed_mps: closing.max(0.0),
            normal,
        }
    }

    /// Returns the contact to report.
    pub(super) fn contact(&self, pair: (BodyId, BodyId), after_s: f64) -> Contact {
        let ContactGeometry {
            point_m,
            closing_speed_mps,
            normal,
        } = *self;
        Contact {
            pair,
            after_s,
            closing_speed_mps,
            point_m,
            normal,
        }
    }
}

/// Rectangle with its dimensions.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizedRect<'a> {
    pub rect: &'a Rect,
    pub extent: &'a Extent,
}

impl Extent {
    pub(super) fn of(body: &Body) -> Extent {
        let (half_length_m, half_width_m) = (0.5 * body.length_m, 0.5 * body.width_m);
        let radius_m = (half_length_m * half_length_m + half_width_m * half_width_m).sqrt();
        Extent {
            half_length_m,
            half_width_m,
            radius_m,
            height_m: body.height_m,
        }
    }
}

impl SizedRect<'_> {
    fn corners(&self) -> [(f64, f64); 4] {
        let Rect {
            x_m, y_m, cos, sin, ..
        } = *self.rect;
        let (l, w) = (self.extent.half_length_m, self.extent.half_width_m);
        let at = |ahead: f64, left: f64| {
            (
                x_m + ahead * cos - left * sin,
                y_m + ahead * sin + left * cos,
            )
        };
        [at(l, w), at(l, -w), at(-l, w), at(-l, -w)]
    }

    /// Returns the clearance along the four face normals (the separating axes).
    pub(super) fn separations(&self, other: &SizedRect) -> [Separation; 4] {
        let (a, b) = (self.rect, other.rect);
        // Bodies keep sine and cosine of their headings, so no angle is
        // computed here.
        let (dx, dy) = (b.x_m - a.x_m, b.y_m - a.y_m);
        // Relative heading. The projections below need only its absolute values.
        let cos = (a.cos * b.cos + a.sin * b.sin).abs();
        let sin = (a.cos * b.sin - a.sin * b.cos).abs();
        let along = |half_a: f64, half_b: f64, nx: f64, ny: f64| {
            let offset = dx * nx + dy * ny;
            // Coincident centres need a direction too.
            let side = if offset < 0.0 { -1.0 } else { 1.0 };
            Separation {
                gap_m: offset.abs() - half_a - half_b,
                nx: side * nx,
                ny: side * ny,
            }
        };
        let (la, wa) = (self.extent.half_length_m, self.extent.half_width_m);
        let (lb, wb) = (other.extent.half_length_m, other.extent.half_width_m);
        [
            along(la, lb * cos + wb * sin, a.cos, a.sin),
            along(wa, lb * sin + wb * cos, -a.sin, a.cos),
            along(la * cos + wa * sin, lb, b.cos, b.sin),
            along(la * sin + wa * cos, wb, -b.sin, b.cos),
        ]
    }

    /// Returns the greatest of [`SizedRect::separations`], ≤ 0 exactly on contact.
    pub(super) fn separation(&self, other: &SizedRect) -> Separation {
        // The strict comparison keeps the first axis on a tie, so the normal is
        // deterministic.
        let [first, rest @ ..] = self.separations(other);
        rest.into_iter().fold(
            first,
            |best, next| if best.gap_m < next.gap_m { next } else { best },
        )
    }

    /// Returns the Euclidean clearance, 0 if the shapes touch.
    pub(super) fn gap_m(&self, other: &SizedRect) -> f64 {
        // Crossed rectangles may overlap without a corner inside either of them, so
        // overlap is excluded first.
        if self.separation(other).gap_m <= 0.0 {
            return 0.0;
        }
        // The least distance of two disjoint rectangles is at a corner of either.
        let squared = |corners: [(f64, f64); 4], shape: &SizedRect| {
            corners
                .into_iter()
                .map(|(x_m, y_m)| shape.distance_squared(x_m, y_m))
                .fold(f64::INFINITY, f64::min)
        };
        squared(self.corners(), other)
            .min(squared(other.corners(), self))
            .sqrt()
    }

    fn distance_squared(&self, x_m: f64, y_m: f64) -> f64 {
        let Rect { cos, sin, .. } = *self.rect;
        let (dx, dy) = (x_m - self.rect.x_m, y_m - self.rect.y_m);
        let ahead = ((dx * cos + dy * sin).abs() - self.extent.half_length_m).max(0.0);
        let left = ((dy * cos - dx * sin).abs() - self.extent.half_width_m).max(0.0);
        ahead * ahead + left * left
    }

    /// Returns the velocity of a point fixed to the body.
    fn velocity_at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let Rect {
            vx_mps,
            vy_mps,
            yaw_rate_rad_per_s: rate,
            ..
        } = *self.rect;
        (
            vx_mps - rate * (y_m - self.rect.y_m),
            vy_mps + rate * (x_m - self.rect.x_m),
        )
    }

    /// Returns the contact point, normal and closing speed of two touching shapes.
    ///
    /// The point is the middle of the common part of both faces.
    pub(super) fn contact_geometry(&self, other: &SizedRect) -> ContactGeometry {
        let Separation { nx, ny, .. } = self.separation(other);
        let mine = Face::foremost(self.corners(), nx, ny);
        let theirs = Face::foremost(other.corners(), -nx, -ny);
        // Both faces along the same tangent: that of `theirs` points the other way.
        let (low, high) = (mine.low.max(-theirs.high), mine.high.min(-theirs.low));
        let (normal, tangent) = (0.5 * (mine.reach - theirs.reach), 0.5 * (low + high));
        let point = (normal * nx - tangent * ny, normal * ny + tangent * nx);
        let height_m = 0.5 * self.extent.height_m.min(other.extent.height_m);
        let point_m = [point.0, point.1, height_m];
        ContactGeometry::new(self, other, point_m, [nx, ny])
    }
}

/// Side of a rectangle that reaches farthest in a direction.
struct Face {
    reach: f64,
    /// Extent along the direction, turned left by 90°.
    low: f64,
    high: f64,
}

impl Face {
    fn foremost(corners: [(f64, f64); 4], nx: f64, ny: f64) -> Face {
        let reach = corners
            .iter()
            .map(|(x, y)| x * nx + y * ny)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut face = Face {
            reach,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        };
        for (x, y) in corners {
            // A face seen within the touch tolerance counts whole: two corners of a
            // nearly aligned face would otherwise alternate between a point and an edge.
            if reach - TOUCH_M <= x * nx + y * ny {
                let tangent = y * nx - x * ny;
                face.low = face.low.min(tangent);
                face.high = face.high.max(tangent);
            }
        }
        face
    }
}

/// Returns true if two bodies that move by `reach_m` in all cannot touch.
///
/// A cheap test: the circles around both, grown by the reach, do not overlap.
#[inline]
pub(super) fn far_apart(a: &SizedRect, b: &SizedRect, reach_m: f64) -> bool {
    let (dx, dy) = (b.rect.x_m - a.rect.x_m, b.rect.y_m - a.rect.y_m);
    let radii = a.extent.radius_m + b.extent.radius_m + reach_m;
    // Squares are compared, which needs no square root.
    radii * radii < dx * dx + dy * dy
}

/// Body at the pose of the middle of its front bumper.
#[derive(Clone, Copy, Debug)]
pub struct PosedBody<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its pose.
    pub pose: Pose,
}

/// Returns the Euclidean clearance of two bodies on the ground, 0 if they touch.
pub fn body_gap_m(a: PosedBody<'_>, b: PosedBody<'_>) -> f64 {
    let [(rect_a, extent_a), (rect_b, extent_b)] = [a, b].map(|PosedBody { body, pose }| {
        let middle = pose.ahead(-body.half_length_m());
        let (sin, cos) = libm::sincos(pose.heading_rad);
        let rect = Rect {
            x_m: middle.x_m,
            y_m: middle.y_m,
            cos,
            sin,
            ..Rect::default()
        };
        (rect, Extent::of(body))
    });
    let first = SizedRect {
        rect: &rect_a,
        extent: &extent_a,
    };
    first.gap_m(&SizedRect {
        rect: &rect_b,
        extent: &extent_b,
    })
}
