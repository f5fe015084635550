//! First contact of two bodies on known paths.

use super::mover::Mover;
use super::path::BodyPath;
use crate::sim::planar::{ContactGeometry, Separation, TOUCH_M, far_apart};

/// Clearance at which an approach counts as a contact.
const TOLERANCE_M: f64 = 1e-9;
/// Evaluations after which a grazing approach counts as a contact.
const MAX_EVALUATIONS: u32 = 1000;

/// Returns the first contact of two moving bodies before `horizon_s`.
///
/// Conservative advancement (Mirtich 1996): at each instant the best separating
/// axis gives a time during which the two cannot touch, for any motion within
/// their bounds.
///
/// Invariant: time never passes the first contact, since each step is a time
/// without possible contact. The first gap of 0 that is seen is therefore the
/// first that exists. Sampling or root finding alone would not guarantee that.
pub(super) fn meet(
    a: &Mover,
    path_a: &BodyPath,
    b: &Mover,
    path_b: &BodyPath,
    horizon_s: f64,
) -> Option<(f64, ContactGeometry)> {
    let (mut rect_a, mut rect_b) = (a.rect(&path_a.start), b.rect(&path_b.start));
    // The bounds hold for any point, so circles decide most pairs without an
    // axis.
    let reach_m = (path_a.speed_bound_mps + path_b.speed_bound_mps) * horizon_s;
    if far_apart(&a.shape(&rect_a), &b.shape(&rect_b), reach_m) {
        return None;
    }
    let bound_mps2 = path_a.accel_bound_mps2 + path_b.accel_bound_mps2;
    let mut after_s = 0.0;
    for evaluation in 0..MAX_EVALUATIONS {
        let (shape_a, shape_b) = (a.shape(&rect_a), b.shape(&rect_b));
        let gap_m = shape_a.separation(&shape_b).gap_m;
        if gap_m <= TOLERANCE_M {
            let contact_geometry = shape_a.contact_geometry(&shape_b);
            // Bodies that touch at the start may move apart. Bodies that overlap may not.
            let parting =
                evaluation == 0 && -TOUCH_M <= gap_m && contact_geometry.closing_speed_mps <= 0.0;
            return (!parting).then_some((after_s, contact_geometry));
        }
        // Turning moves no point faster than ω times the radius, towards any axis.
        let spin_mps = rect_a.yaw_rate_rad_per_s.abs() * a.extent.radius_m
            + rect_b.yaw_rate_rad_per_s.abs() * b.extent.radius_m;
        let safe = |axis: Separation| {
            let Separation { gap_m, nx, ny } = axis;
            let (vx, vy) = (rect_a.vx_mps - rect_b.vx_mps, rect_a.vy_mps - rect_b.vy_mps);
            // With half the tolerance as the aim, the gap falls below the tolerance
            // after a few steps. With an aim of 0 it would only converge.
            safe_s(
                gap_m - 0.5 * TOLERANCE_M,
                vx * nx + vy * ny + spin_mps,
                bound_mps2,
            )
        };
        // A single separating axis is enough, so the best axis counts.
        after_s += shape_a
            .separations(&shape_b)
            .into_iter()
            .map(safe)
            .fold(0.0, f64::max);
        // A contact at the very end belongs to the next `advance`, which
        // begins there.
        if horizon_s <= after_s {
            return None;
        }
        rect_a = a.rect(&path_a.at(after_s));
        rect_b = b.rect(&path_b.at(after_s));
    }
    // An approach this slow counts as a contact: less than 1e-7 m is left.
    Some((
        after_s,
        a.shape(&rect_a).contact_geometry(&b.shape(&rect_b)),
    ))
}

/// Returns the time in which a gap cannot close under bounded acceleration.
///
/// This is the positive root of v t + ½ a t² = gap. Each branch uses the form
/// that adds numbers of one sign. No digits cancel, and a = 0 needs no division
/// by it while the gap closes.
fn safe_s(gap_m: f64, closing_mps: f64, bound_mps2: f64) -> f64 {
    if gap_m <= 0.0 {
        return 0.0;
    }
    let root = (closing_mps * closing_mps + 2.0 * bound_mps2 * gap_m).sqrt();
    if closing_mps >= 0.0 {
        let sum = closing_mps + root;
        return if sum == 0.0 {
            f64::INFINITY
        } else {
            2.0 * gap_m / sum
        };
    }
    if bound_mps2 == 0.0 {
        f64::INFINITY
    } else {
        (root - closing_mps) / bound_mps2
    }
}
