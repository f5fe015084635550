//! First contact of two bodies within one step, decided by parry.
//!
//! Two gates come first: circles, and the separating plane of the step's
//! beginning. Then the bodies advance along the step by as much as their distance
//! allows without a contact (conservative advancement), until parry's distance is
//! at most [`TOUCHING_M`]. No contact is jumped over, however short it is.

use parry3d_f64::math::Pose;

use crate::sim::planar::{ContactGeometry, Extent, Rect, SizedRect, TOUCH_M, far_apart};

use super::motor::Stance;
use super::shape::{CollisionShape, ShapeGap};

/// Distance of two bodies that counts as a contact.
const TOUCHING_M: f64 = 1e-8;
/// Sine of the greatest angle by which a body tilts on a road.
const TILTED: f64 = 0.6;
/// Bound on the rounds of the advancement.
///
/// Only bodies that pass within about 2 µm of each other need as many. They
/// count as touching.
const ROUNDS: u32 = 10_000;

/// Body during one step: its footprint at the beginning and at the end, and its shape.
#[derive(Clone)]
pub(super) struct SweptBody {
    pub before: Rect,
    pub after: Rect,
    pub extent: Extent,
    pub shape: CollisionShape,
    /// Poses of its frame on a surface, at the beginning and at the end.
    ///
    /// On a plane a body counts as upright, even if its chassis pitches.
    pub in_space: Option<[Pose; 2]>,
    /// Greatest displacement of any point of the body.
    pub reach_m: f64,
}

impl SweptBody {
    /// Creates a body at rest.
    pub(super) fn resting(stance: Stance, extent: Extent, shape: CollisionShape) -> SweptBody {
        SweptBody {
            before: stance.rect,
            after: stance.rect,
            extent,
            shape,
            in_space: stance.pose.map(|pose| [pose; 2]),
            reach_m: 0.0,
        }
    }

    /// Rests at a footprint, without a motion.
    pub(super) fn rest(&mut self, stance: Stance) {
        (self.before, self.after, self.reach_m) = (stance.rect, stance.rect, 0.0);
        self.in_space = stance.pose.map(|pose| [pose; 2]);
    }

    /// Moves on to the next step.
    pub(super) fn move_on(&mut self, stance: Stance) {
        self.before = self.after;
        self.after = stance.rect;
        self.in_space = stance.pose.map(|pose| match self.in_space {
            Some([_, before]) => [before, pose],
            // The first pose on a surface has no predecessor and counts as
            // rest.
            None => [pose; 2],
        });
        let (dx, dy) = (
            self.after.x_m - self.before.x_m,
            self.after.y_m - self.before.y_m,
        );
        self.reach_m = (dx * dx + dy * dy).sqrt() + self.swing_m();
        if self.in_space.is_some() {
            // A tilted body reaches beyond its upright footprint.
            self.reach_m += TILTED * self.extent.height_m;
        }
    }

    /// Returns the pose in space at a share of the step.
    fn pose_at(&self, share: f64) -> Option<Pose> {
        let [from, to] = self.in_space?;
        Some(Pose::from_parts(
            from.translation.lerp(to.translation, share),
            from.rotation.lerp(to.rotation, share),
        ))
    }

    /// Returns the footprint at a share of the step.
    pub(super) fn at(&self, share: f64) -> Rect {
        let (a, b) = (&self.before, &self.after);
        let mix = |from: f64, to: f64| from + share * (to - from);
        Rect {
            x_m: mix(a.x_m, b.x_m),
            y_m: mix(a.y_m, b.y_m),
            vx_mps: mix(a.vx_mps, b.vx_mps),
            vy_mps: mix(a.vy_mps, b.vy_mps),
            yaw_rate_rad_per_s: mix(a.yaw_rate_rad_per_s, b.yaw_rate_rad_per_s),
            // Rotate by a share of the turn instead of mixing unit vectors, which would
            // shrink the box.
            ..a.turned(share * self.turn_rad())
        }
    }

    /// Returns the distance to another body after the step, 0 if they touch.
    ///
    /// Between two boxes it is the closed form, which equals parry's distance to
    /// 1e-9 m. Its bits are those that recorded episodes have.
    pub(super) fn gap_m(&self, other: &SweptBody) -> f64 {
        if let (Some([_, mine]), Some([_, theirs])) = (&self.in_space, &other.in_space) {
            let gap = self.shape.gap_at(mine, &other.shape, theirs);
            return gap.gap_m.max(0.0);
        }
        if self.shape.is_box() && other.shape.is_box() {
            return self.sized(&self.after).gap_m(&other.sized(&other.after));
        }
        let gap = self.shape.gap(&self.after, &other.shape, &other.after);
        gap.gap_m.max(0.0)
    }

    fn turn_rad(&self) -> f64 {
        self.before.turn_rad_to(&self.after)
    }

    /// Returns a bound on the displacement of any point by turning.
    fn swing_m(&self) -> f64 {
        if let Some([from, to]) = &self.in_space {
            let half_cos = from.rotation.dot(to.rotation).abs().min(1.0);
            // The chord of the turn, as on the plane, about the origin of the frame.
            let chord = 2.0 * (1.0 - half_cos * half_cos).max(0.0).sqrt();
            let radius_m = self.extent.radius_m + self.extent.height_m;
            return core::f64::consts::FRAC_PI_2 * chord * radius_m;
        }
        let (a, b) = (&self.before, &self.after);
        let (dc, ds) = (b.cos - a.cos, b.sin - a.sin);
        // An arc is at most π/2 times its chord.
        core::f64::consts::FRAC_PI_2 * (dc * dc + ds * ds).sqrt() * self.extent.radius_m
    }

    fn sized<'a>(&'a self, rect: &'a Rect) -> SizedRect<'a> {
        SizedRect {
            rect,
            extent: &self.extent,
        }
    }
}

/// Distance of two bodies at one instant of a step, and the way on to a contact.
#[derive(Clone, Copy)]
struct Clearance {
    gap_m: f64,
    /// Share of the step that passes without a contact from here on.
    free_share: f64,
}

/// Motion of one body relative to another during a whole step.
struct RelativeMotion {
    dx_m: f64,
    dy_m: f64,
    dz_m: f64,
    swing_m: f64,
}

impl RelativeMotion {
    fn of(a: &SweptBody, b: &SweptBody) -> RelativeMotion {
        if let (Some([a0, a1]), Some([b0, b1])) = (&a.in_space, &b.in_space) {
            let by = (a1.translation - a0.translation) - (b1.translation - b0.translation);
            return RelativeMotion {
                dx_m: by.x,
                dy_m: by.y,
                dz_m: by.z,
                swing_m: a.swing_m() + b.swing_m(),
            };
        }
        RelativeMotion {
            dz_m: 0.0,
            dx_m: (a.after.x_m - a.before.x_m) - (b.after.x_m - b.before.x_m),
            dy_m: (a.after.y_m - a.before.y_m) - (b.after.y_m - b.before.y_m),
            swing_m: a.swing_m() + b.swing_m(),
        }
    }

    /// Returns the clearance of two bodies at a share of the step.
    ///
    /// The plane halfway between two convex parts, perpendicular to their closest
    /// points, keeps them apart until the motion along its normal has used up the
    /// gap. Turning moves no point by more than the swing.
    fn clearance(&self, a: &SweptBody, b: &SweptBody, share: f64) -> Clearance {
        if let (Some(pose_a), Some(pose_b)) = (a.pose_at(share), b.pose_at(share)) {
            return self.least(a.shape.gaps_at(&pose_a, &b.shape, &pose_b));
        }
        // The ends of the step have the bits of their footprints.
        if share == 0.0 {
            return self.least(a.shape.gaps(&a.before, &b.shape, &b.before));
        }
        self.least(a.shape.gaps(&a.at(share), &b.shape, &b.at(share)))
    }

    fn least(&self, gaps: impl Iterator<Item = ShapeGap>) -> Clearance {
        let mut least = Clearance {
            gap_m: f64::INFINITY,
            free_share: f64::INFINITY,
        };
        for ShapeGap { gap_m, normal } in gaps {
            least.gap_m = least.gap_m.min(gap_m);
            let level_m = self.dx_m * normal[0] + self.dy_m * normal[1];
            // On a plane nothing moves upwards, and the sum keeps its bits.
            let closing_m = if self.dz_m == 0.0 {
                level_m + self.swing_m
            } else {
                level_m + self.dz_m * normal[2] + self.swing_m
            };
            // Parts that move apart set no limit, however near they are.
            if closing_m > 0.0 {
                least.free_share = least.free_share.min(gap_m / closing_m);
            }
        }
        least
    }
}

/// Returns the first contact of two bodies and the share of the step before.
pub(super) fn touch(a: &SweptBody, b: &SweptBody) -> Option<(f64, ContactGeometry)> {
    let (start_a, start_b) = (a.sized(&a.before), b.sized(&b.before));
    if far_apart(&start_a, &start_b, a.reach_m + b.reach_m) {
        return None;
    }
    let motion = RelativeMotion::of(a, b);
    let start = motion.clearance(a, b, 0.0);
    if start.gap_m <= TOUCHING_M {
        let contact = contact_at(a, &a.before, b, &b.before, 0.0);
        // Bodies that touch may move apart. Bodies that overlap may not.
        let parting = -TOUCH_M <= start.gap_m && contact.closing_speed_mps <= 0.0;
        return (!parting).then_some((0.0, contact));
    }
    let share = advance(a, b, &motion, start)?;
    let contact = contact_at(a, &a.at(share), b, &b.at(share), share);
    Some((share, contact))
}

/// Returns the contact of two bodies with footprints at a share of the step.
fn contact_at(
    a: &SweptBody,
    rect_a: &Rect,
    b: &SweptBody,
    rect_b: &Rect,
    share: f64,
) -> ContactGeometry {
    let (me, it) = (a.sized(rect_a), b.sized(rect_b));
    match (a.pose_at(share), b.pose_at(share)) {
        (Some(pose), Some(its_pose)) => a.shape.contact_at(&me, &pose, &b.shape, &it, &its_pose),
        _ => a.shape.contact_geometry(&me, &b.shape, &it),
    }
}

/// Returns the share of the step at which two bodies begin to touch, if any.
fn advance(a: &SweptBody, b: &SweptBody, motion: &RelativeMotion, start: Clearance) -> Option<f64> {
    let mut share = start.free_share;
    for _ in 0..ROUNDS {
        if share > 1.0 {
            return None;
        }
        let clearance = motion.clearance(a, b, share);
        if clearance.gap_m <= TOUCHING_M {
            return Some(share);
        }
        share += clearance.free_share;
    }
    Some(share.min(1.0))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sim::{Body, BodyPart, BodyShape};

    /// Duration of the step in these tests.
    const STEP_S: f64 = 0.0125;
    /// Greatest error of a contact time.
    const WITHIN_S: f64 = 1e-6;
    /// Instants of a step at which an oracle looks.
    const LOOKS: u32 = 400;

    type Motion = (f64, f64, f64);

    fn stance(x_m: f64, y_m: f64, heading_rad: f64) -> Stance {
        let (sin, cos) = libm::sincos(heading_rad);
        let rect = Rect {
            x_m,
            y_m,
            cos,
            sin,
            ..Rect::default()
        };
        Stance { rect, pose: None }
    }

    fn swept(body: &Body, from: Motion, by: Motion) -> SweptBody {
        let shape = CollisionShape::of(body);
        let start = stance(from.0, from.1, from.2);
        let mut swept = SweptBody::resting(start, Extent::of(body), shape);
        let end = stance(from.0 + by.0, from.1 + by.1, from.2 + by.2);
        swept.move_on(end);
        swept
    }

    fn boxed(length_m: f64, width_m: f64) -> Body {
        let sedan = Body::shipped("sedan").expect("shipped").expect("valid");
        Body {
            length_m,
            width_m,
            ..sedan
        }
    }

    /// A prism over corners on an ellipse, given by their angles.
    fn prism(angles_rad: &[f64], half_length_m: f64, half_width_m: f64) -> Body {
        let corner = |angle: &f64| {
            let (sin, cos) = libm::sincos(*angle);
            (half_length_m * cos, half_width_m * sin)
        };
        let outline_m = angles_rad.iter().map(corner).collect();
        let up_m = (0.0, 1.45);
        Body {
            shape: BodyShape::Parts(vec![BodyPart::Prism { outline_m, up_m }]),
            ..boxed(2.0 * half_length_m, 2.0 * half_width_m)
        }
    }

    /// Clearance of the bounding boxes by the separating axes, ≤ 0 if they overlap.
    fn axes_gap_m(a: &SweptBody, b: &SweptBody, share: f64) -> f64 {
        let (rect_a, rect_b) = (a.at(share), b.at(share));
        a.sized(&rect_a).separation(&b.sized(&rect_b)).gap_m
    }

    /// Compares the contact with the first overlap that an oracle sees.
    ///
    /// The oracle looks at even instants and bisects before the first overlap. It
    /// misses overlaps between two looks, so that an earlier contact must be within
    /// `TOUCHING_M` by the oracle's own measure.
    fn agrees(
        a: &SweptBody,
        b: &SweptBody,
        gap_m: impl Fn(f64) -> f64,
    ) -> Result<(), TestCaseError> {
        let mut shares = (0..=LOOKS).map(|look| f64::from(look) / f64::from(LOOKS));
        let seen = shares.find(|share| gap_m(*share) <= 0.0).map(|share| {
            let (mut low, mut high) = ((share - 1.0 / f64::from(LOOKS)).max(0.0), share);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if gap_m(middle) <= 0.0 {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            high
        });
        match (seen, touch(a, b)) {
            (Some(seen), Some((share, _))) => {
                prop_assert!((share - seen) * STEP_S <= WITHIN_S, "{share} {seen}");
                let early = (seen - share) * STEP_S > WITHIN_S;
                prop_assert!(!early || gap_m(share) <= 2.0 * TOUCHING_M, "{share} {seen}");
            }
            (Some(seen), None) => prop_assert!(false, "missed at {seen}"),
            (None, Some((share, _))) => prop_assert!(gap_m(share) <= 2.0 * TOUCHING_M),
            (None, None) => {}
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn boxes_touch_when_the_separating_axes_say_so(
            x_m in 2.0..5.5, y_m in -2.5..2.5, heading_rad in -3.1..3.1,
            by_a in (-0.2..0.6, -0.3..0.3, -0.05..0.05),
            by_b in (-0.6..0.2, -0.3..0.3, -0.05..0.05),
        ) {
            let a = swept(&boxed(4.54, 1.8), (0.0, 0.0, 0.0), by_a);
            let b = swept(&boxed(2.0, 0.8), (x_m, y_m, heading_rad), by_b);
            if axes_gap_m(&a, &b, 0.0) <= 0.0 { return Ok(()); }
            agrees(&a, &b, |share| axes_gap_m(&a, &b, share))?;
        }

        #[test]
        fn the_gap_of_boxes_is_parrys_distance(
            x_m in -9.0..9.0, y_m in -6.0..6.0, heading_rad in -3.1..3.1,
        ) {
            let a = swept(&boxed(4.54, 1.8), (0.0, 0.0, 0.3), (0.0, 0.0, 0.0));
            let b = swept(&boxed(2.0, 0.8), (x_m, y_m, heading_rad), (0.0, 0.0, 0.0));
            let parrys_m = a.shape.gap(&a.after, &b.shape, &b.after).gap_m.max(0.0);
            prop_assert!((a.gap_m(&b) - parrys_m).abs() < 1e-9, "{} {parrys_m}", a.gap_m(&b));
        }

        #[test]
        fn contacts_of_boxes_have_the_point_and_normal_of_the_closed_form(
            x_m in 2.0..5.5, y_m in -2.5..2.5, heading_rad in -3.1..3.1,
            by_b in (-0.6..-0.2, -0.3..0.3, -0.05..0.05),
        ) {
            let a = swept(&boxed(4.54, 1.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0));
            let b = swept(&boxed(2.0, 0.8), (x_m, y_m, heading_rad), by_b);
            if axes_gap_m(&a, &b, 0.0) <= 0.0 { return Ok(()); }
            let Some((share, contact)) = touch(&a, &b) else { return Ok(()) };
            let (rect_a, rect_b) = (a.at(share), b.at(share));
            let closed = a.sized(&rect_a).contact_geometry(&b.sized(&rect_b));
            // Two corners that meet leave the normal open.
            let axes = a.sized(&rect_a).separations(&b.sized(&rect_b));
            let near = axes.iter().filter(|axis| axis.gap_m > -1e-4).count();
            if near > 1 { return Ok(()); }
            // So do two faces that are nearly, but not quite, aligned.
            let (sin, cos) = libm::sincos(rect_a.turn_rad_to(&rect_b));
            if sin.abs().min(cos.abs()) < 0.05 { return Ok(()); }
            for index in 0..2 {
                prop_assert!((contact.normal[index] - closed.normal[index]).abs() < 1e-6);
                prop_assert!((contact.point_m[index] - closed.point_m[index]).abs() < 0.02,
                    "{:?} {:?}", contact.point_m, closed.point_m);
            }
        }
    }

    /// Corners of a prism at a share of the step, in the world frame.
    fn corners(body: &Body, swept: &SweptBody, share: f64) -> Vec<(f64, f64)> {
        let BodyShape::Parts(parts) = &body.shape else {
            return Vec::new();
        };
        let BodyPart::Prism { outline_m, .. } = &parts[0] else {
            return Vec::new();
        };
        let Rect {
            x_m, y_m, cos, sin, ..
        } = swept.at(share);
        let place = |(l, w): &(f64, f64)| (x_m + l * cos - w * sin, y_m + l * sin + w * cos);
        outline_m.iter().map(place).collect()
    }

    /// Greatest clearance along any edge normal of two convex outlines.
    fn outlines_gap_m(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
        let along = |ring: &[(f64, f64)], other: &[(f64, f64)]| {
            let edges = ring.iter().zip(ring.iter().cycle().skip(1));
            edges
                .map(|(from, to)| {
                    let (ex, ey) = (to.0 - from.0, to.1 - from.1);
                    let length = (ex * ex + ey * ey).sqrt();
                    // Outward, as the corners run counter-clockwise.
                    let (nx, ny) = (ey / length, -ex / length);
                    let reach = |at: &(f64, f64)| (at.0 - from.0) * nx + (at.1 - from.1) * ny;
                    other.iter().map(reach).fold(f64::INFINITY, f64::min)
                })
                .fold(f64::NEG_INFINITY, f64::max)
        };
        along(a, b).max(along(b, a))
    }

    fn angles() -> impl Strategy<Value = Vec<f64>> {
        // One corner in each of five to nine sectors of the circle.
        (5usize..10).prop_flat_map(|count| {
            let sector = core::f64::consts::TAU / count as f64;
            let corner = move |index: usize| {
                (0.1..0.9).prop_map(move |share: f64| sector * (index as f64 + share))
            };
            (0..count).map(corner).collect::<Vec<_>>()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 1_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn convex_shapes_touch_when_a_bisection_says_so(
            ring_a in angles(), ring_b in angles(),
            x_m in 1.0..5.0, y_m in -2.0..2.0, heading_rad in -3.1..3.1,
            by_a in (-0.2..0.6, -0.3..0.3, -0.05..0.05),
            by_b in (-0.6..0.2, -0.3..0.3, -0.05..0.05),
        ) {
            let (body_a, body_b) = (prism(&ring_a, 2.3, 0.9), prism(&ring_b, 1.2, 0.7));
            let a = swept(&body_a, (0.0, 0.0, 0.0), by_a);
            let b = swept(&body_b, (x_m, y_m, heading_rad), by_b);
            let gap_m = |share: f64| {
                outlines_gap_m(&corners(&body_a, &a, share), &corners(&body_b, &b, share))
            };
            if gap_m(0.0) <= 0.0 { return Ok(()); }
            agrees(&a, &b, gap_m)?;
        }
    }

    #[test]
    fn a_corner_that_comes_and_goes_is_touched_the_first_time() {
        let by_a = (
            0.5721336014754205,
            -0.2614993043215511,
            0.009716585101748677,
        );
        let from_b = (3.2101085264534954, 1.5353143826377111, -2.0460214139253434);
        let by_b = (
            -0.2501040872536754,
            0.18438889248162021,
            -0.04847188328985619,
        );
        let a = swept(&boxed(4.54, 1.8), (0.0, 0.0, 0.0), by_a);
        let b = swept(&boxed(2.0, 0.8), from_b, by_b);
        let (share, _) = touch(&a, &b).expect("they touch");
        assert!((0.13..=0.15).contains(&share), "{share}");
    }

    #[test]
    fn aligned_faces_touch_in_the_middle_of_their_common_part() {
        let a = swept(&boxed(4.0, 1.8), (0.0, 0.0, 0.0), (0.3, 0.0, 0.0));
        let b = swept(&boxed(4.0, 1.8), (4.15, 1.2, 0.0), (0.0, 0.0, 0.0));
        let (share, contact) = touch(&a, &b).expect("they touch");
        assert!((share - 0.5).abs() < 1e-6, "{share}");
        // Along y the first spans -0.9 to 0.9, the second 0.3 to 2.1.
        let [x_m, y_m, z_m] = contact.point_m;
        assert!(
            (x_m - 2.15).abs() < 1e-6 && (y_m - 0.6).abs() < 1e-9,
            "{x_m} {y_m}"
        );
        assert_eq!(z_m, 0.725);
        assert_eq!(contact.normal, [1.0, 0.0]);
    }

    #[test]
    fn a_body_that_passes_a_millimetre_away_does_not_touch() {
        let a = swept(&boxed(4.54, 1.8), (0.0, 0.0, 0.0), (0.4, 0.0, 0.0));
        let b = swept(&boxed(4.54, 1.8), (2.0, 1.801, 0.0), (-0.4, 0.0, 0.0));
        assert!(touch(&a, &b).is_none());
    }
}
