//! First contact of two boxes within one step.
//!
//! Three gates of rising cost: circles, separating axes over the whole step, and
//! parry's nonlinear shape cast. The cast detects that the boxes touch, but its
//! time is accurate only to about a millisecond (25 mm at 25 m/s). The separating
//! axes therefore refine it.

use parry3d::query::{NonlinearRigidMotion, cast_shapes_nonlinear};
use parry3d::shape::Cuboid;
use rapier3d::math::{Pose, Rotation, Vector};

use super::world::vector;
use crate::sim::planar::{ContactGeometry, Extent, Rect, SizedRect, TOUCH_M, far_apart};

/// Clearance to which the time of a contact is refined.
const POLISH_M: f64 = 1e-7;
/// Number of shares of a step at which an earlier contact is looked for.
const LOOKS: u32 = 64;

/// Footprint during one step: at its beginning, at its end, and its size.
#[derive(Clone, Copy, Debug)]
pub(super) struct SweptFootprint {
    pub before: Rect,
    pub after: Rect,
    pub extent: Extent,
    /// Greatest displacement of any point of the body.
    pub reach_m: f64,
}

impl SweptFootprint {
    /// Creates a footprint at rest.
    pub(super) fn resting(rect: Rect, extent: Extent) -> SweptFootprint {
        SweptFootprint {
            before: rect,
            after: rect,
            extent,
            reach_m: 0.0,
        }
    }

    /// Moves on to the next step.
    pub(super) fn move_on(&mut self, after: Rect) {
        self.before = self.after;
        self.after = after;
        let (dx, dy) = (after.x_m - self.before.x_m, after.y_m - self.before.y_m);
        self.reach_m = (dx * dx + dy * dy).sqrt() + self.swing_m();
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

    /// Returns the footprint after the step, as a shape.
    pub(super) fn now(&self) -> SizedRect<'_> {
        self.shape(&self.after)
    }

    fn turn_rad(&self) -> f64 {
        self.before.turn_rad_to(&self.after)
    }

    /// Returns a bound on the displacement of any point by turning.
    fn swing_m(&self) -> f64 {
        let (a, b) = (&self.before, &self.after);
        let (dc, ds) = (b.cos - a.cos, b.sin - a.sin);
        // An arc is at most π/2 times its chord.
        core::f64::consts::FRAC_PI_2 * (dc * dc + ds * ds).sqrt() * self.extent.radius_m
    }

    fn shape<'a>(&'a self, rect: &'a Rect) -> SizedRect<'a> {
        SizedRect {
            rect,
            extent: &self.extent,
        }
    }
}

/// Returns the first contact of two footprints and the share of the step before.
///
/// A corner that grazes for less than a 64th of the step may be missed.
pub(super) fn touch(a: &SweptFootprint, b: &SweptFootprint) -> Option<(f64, ContactGeometry)> {
    let (start_a, start_b) = (a.shape(&a.before), b.shape(&b.before));
    if far_apart(&start_a, &start_b, a.reach_m + b.reach_m) {
        return None;
    }
    let gap_m = start_a.separation(&start_b).gap_m;
    if gap_m <= 0.0 {
        let contact_geometry = start_a.contact_geometry(&start_b);
        // Bodies that touch may move apart. Bodies that overlap may not.
        let parting = -TOUCH_M <= gap_m && contact_geometry.closing_speed_mps <= 0.0;
        return (!parting).then_some((0.0, contact_geometry));
    }
    if stay_apart(a, b) {
        return None;
    }
    // Terminates: each round begins at an earlier look than the last round's end,
    // and there are 64 looks.
    let mut share = polish(a, b, cast(a, b))?;
    while let Some(earlier) = overlap_before(a, b, share) {
        share = polish(a, b, Some(earlier))?;
    }
    let (rect_a, rect_b) = (a.at(share), b.at(share));
    Some((share, a.shape(&rect_a).contact_geometry(&b.shape(&rect_b))))
}

/// Returns true if one face keeps the two apart during the whole step.
///
/// The axis is that of the beginning. A motion apart along it is not credited,
/// since the positions in between count too, hence the lower bound of 0.
fn stay_apart(a: &SweptFootprint, b: &SweptFootprint) -> bool {
    let dx = (a.after.x_m - a.before.x_m) - (b.after.x_m - b.before.x_m);
    let dy = (a.after.y_m - a.before.y_m) - (b.after.y_m - b.before.y_m);
    let swing_m = a.swing_m() + b.swing_m();
    let axes = a.shape(&a.before).separations(&b.shape(&b.before));
    axes.into_iter()
        .any(|axis| (dx * axis.nx + dy * axis.ny).max(0.0) + swing_m < axis.gap_m)
}

/// Returns the share of the step at which parry's cast detects a contact.
fn cast(a: &SweptFootprint, b: &SweptFootprint) -> Option<f64> {
    let boxed = |extent: &Extent| {
        Cuboid::new(vector(
            extent.half_length_m,
            extent.half_width_m,
            0.5 * extent.height_m,
        ))
    };
    // Relative to the first body, so that f32 does not lose digits far from the
    // origin.
    let motion = |sweep: &SweptFootprint| {
        let Rect { x_m, y_m, .. } = sweep.before;
        let start = vector(
            x_m - a.before.x_m,
            y_m - a.before.y_m,
            0.5 * sweep.extent.height_m,
        );
        let heading_rad = libm::atan2(sweep.before.sin, sweep.before.cos);
        let rotation = Rotation::from_scaled_axis(vector(0.0, 0.0, heading_rad));
        let moved = vector(sweep.after.x_m - x_m, sweep.after.y_m - y_m, 0.0);
        let turned = vector(0.0, 0.0, sweep.turn_rad());
        NonlinearRigidMotion::new(
            Pose::from_parts(start, rotation),
            Vector::ZERO,
            moved,
            turned,
        )
    };
    // Time runs from 0 to 1 over the step.
    let hit = cast_shapes_nonlinear(
        &motion(a),
        &boxed(&a.extent),
        &motion(b),
        &boxed(&b.extent),
        0.0,
        1.0,
        true,
    );
    // An error of the cast counts as no hit, and `polish` still checks the end of
    // the step.
    let share = f64::from(hit.ok()??.time_of_impact);
    (0.0..=1.0).contains(&share).then_some(share)
}

/// Returns a share before `share` at which the two overlap, if any.
///
/// The cast may find a later contact than the first, when a corner came and
/// went. The search runs only after a contact was found, and a contact ends the
/// episode anyway.
fn overlap_before(a: &SweptFootprint, b: &SweptFootprint, share: f64) -> Option<f64> {
    let looks = (1..LOOKS).map(|look| f64::from(look) / f64::from(LOOKS));
    looks
        .take_while(|look| *look < share)
        .find(|look| gap_m(a, b, *look) <= 0.0)
}

/// Returns the clearance at a share of the step.
fn gap_m(a: &SweptFootprint, b: &SweptFootprint, share: f64) -> f64 {
    let (rect_a, rect_b) = (a.at(share), b.at(share));
    a.shape(&rect_a).separation(&b.shape(&rect_b)).gap_m
}

/// Returns the contact near a cast's result, to [`POLISH_M`], if any.
///
/// Regula falsi (Illinois) on the clearance, between the beginning of the step
/// and an instant at which the boxes overlap. That instant is the cast's, or the
/// end of the step. If a corner leaves again within the step, it is the deepest
/// instant. A cast without a hit is ignored if the boxes overlap at the end.
fn polish(a: &SweptFootprint, b: &SweptFootprint, cast: Option<f64>) -> Option<f64> {
    let gap_m = |share: f64| gap_m(a, b, share);
    let touching = |share: &f64| gap_m(*share) <= 0.0;
    let mut high = cast
        .filter(touching)
        .or(Some(1.0).filter(touching))
        .or_else(|| cast.map(|share| least(gap_m, share)).filter(touching))?;
    let (mut low, mut low_m, mut high_m) = (0.0, gap_m(0.0), gap_m(high));
    // Bounds the loop on any input. Illinois needs far fewer rounds.
    for _ in 0..60 {
        if high_m.abs() <= POLISH_M {
            break;
        }
        let middle = low + (high - low) * low_m / (low_m - high_m);
        let middle_m = gap_m(middle);
        // Halve the value at the end that stays. Otherwise one end of a convex curve
        // would never move (Dowell, Jarratt 1971). Invariant: apart at `low`,
        // touching at `high`.
        if middle_m <= 0.0 {
            (high, high_m) = (middle, middle_m);
            low_m *= 0.5;
        // Close enough from outside: stop without an overlap.
        } else if middle_m <= POLISH_M {
            return Some(middle);
        } else {
            (low, low_m) = (middle, middle_m);
            high_m *= 0.5;
        }
    }
    // The touching end, so that the reported contact is never a gap.
    Some(high)
}

/// Returns the minimizer of a unimodal function between `from` and 1.
///
/// Ternary search: 60 rounds leave 1e-10 of the step.
fn least(value: impl Fn(f64) -> f64, from: f64) -> f64 {
    let (mut low, mut high) = (from, 1.0);
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if value(low + third) < value(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn rect(x_m: f64, y_m: f64, heading_rad: f64) -> Rect {
        let (sin, cos) = libm::sincos(heading_rad);
        Rect {
            x_m,
            y_m,
            cos,
            sin,
            ..Rect::default()
        }
    }

    fn sweep(from: (f64, f64, f64), by: (f64, f64, f64), half: (f64, f64)) -> SweptFootprint {
        let extent = Extent {
            half_length_m: half.0,
            half_width_m: half.1,
            radius_m: (half.0 * half.0 + half.1 * half.1).sqrt(),
            height_m: 1.5,
        };
        let mut sweep = SweptFootprint::resting(rect(from.0, from.1, from.2), extent);
        sweep.move_on(rect(from.0 + by.0, from.1 + by.1, from.2 + by.2));
        sweep
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() })]

        /// Gates, cast and refinement together agree with brute force.
        #[test]
        fn touches_are_where_dense_sampling_sees_them(
            x_m in 2.0..5.5, y_m in -2.5..2.5, heading_rad in -3.1..3.1,
            by_a in (-0.2..0.6, -0.3..0.3, -0.05..0.05),
            by_b in (-0.6..0.2, -0.3..0.3, -0.05..0.05),
        ) {
            let a = sweep((0.0, 0.0, 0.0), by_a, (2.27, 0.9));
            let b = sweep((x_m, y_m, heading_rad), by_b, (1.0, 0.4));
            if gap_m(&a, &b, 0.0) <= 0.0 { return Ok(()); }
            agrees_with_samples(&a, &b)?;
        }
    }

    /// Deepest graze that may be missed if the bodies move apart again.
    const GRAZE_M: f64 = 1e-3;

    /// Checks a contact against dense samples.
    ///
    /// It lies between the first sample that grazes and the first clearly inside.
    fn agrees_with_samples(a: &SweptFootprint, b: &SweptFootprint) -> Result<(), TestCaseError> {
        let first = |deep_m: f64| {
            let shares = (0..=500).map(|index| f64::from(index) / 500.0);
            shares
                .into_iter()
                .find(|share| gap_m(a, b, *share) <= -deep_m)
        };
        let (grazes, inside) = (first(0.0), first(GRAZE_M));
        match (inside, touch(a, b)) {
            (Some(inside), Some((share, _))) => {
                // A sample may hit the contact itself, which the refinement finds closely.
                prop_assert!(share <= inside + 1e-6, "{share} {inside}");
                prop_assert!(grazes.is_none_or(|grazes| grazes - 0.003 <= share));
                prop_assert!(gap_m(a, b, share).abs() <= 2.0 * POLISH_M);
            }
            (Some(inside), None) => prop_assert!(false, "missed at {inside}"),
            // A graze may fall between two samples.
            (None, Some((share, _))) => prop_assert!(gap_m(a, b, share) <= POLISH_M),
            (None, None) => {}
        }
        Ok(())
    }

    #[test]
    fn a_corner_that_comes_and_goes_is_touched_the_first_time() {
        let a = sweep(
            (0.0, 0.0, 0.0),
            (
                0.5721336014754205,
                -0.2614993043215511,
                0.009716585101748677,
            ),
            (2.27, 0.9),
        );
        let b = sweep(
            (3.2101085264534954, 1.5353143826377111, -2.0460214139253434),
            (
                -0.2501040872536754,
                0.18438889248162021,
                -0.04848187328985619,
            ),
            (1.0, 0.4),
        );
        let (share, _) = touch(&a, &b).expect("they touch");
        assert!((0.13..=0.15).contains(&share), "{share}");
        assert!(agrees_with_samples(&a, &b).is_ok());
    }

    #[test]
    fn parrys_cast_sees_a_head_on_touch() {
        let a = sweep((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (2.27, 0.9));
        let b = sweep((4.6, 0.2, 0.0), (0.0, 0.0, 0.0), (2.27, 0.9));
        let share = cast(&a, &b).expect("a hit");
        assert!((share - 0.2).abs() < 0.02, "{share}");
    }
}
