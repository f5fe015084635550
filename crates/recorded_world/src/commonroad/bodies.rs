//! Bodies of obstacles: stock bodies with the lengths and widths of the file.

use super::obstacles::ObstacleBox;
use crate::sim::{Body, BodyKind};
use crate::traffic::{Class, StockBody, rounded};

/// Greatest speed in m/s of a body on foot, which its recording exceeds nowhere.
const WALKER_MPS: f64 = 10.0;

/// Returns the stock body of a class with the box of an obstacle.
///
/// Returns `None` for a box that no body has.
pub(super) fn body(class: Class, bounds: &ObstacleBox) -> Option<Body> {
    let stock = StockBody::nearest(class, bounds.length_m);
    let mut body = Body::shipped(stock.name)?.ok()?;
    let (along, across) = (
        bounds.length_m / body.length_m,
        bounds.width_m / body.width_m,
    );
    match &mut body.kind {
        BodyKind::Vehicle(vehicle) => {
            vehicle.wheelbase_m = rounded(vehicle.wheelbase_m * along);
            vehicle.front_overhang_m = rounded(vehicle.front_overhang_m * along);
            vehicle.track_m = rounded(vehicle.track_m * across);
        }
        BodyKind::Cyclist(cyclist) => {
            cyclist.wheelbase_m = rounded(cyclist.wheelbase_m * along);
            cyclist.front_overhang_m = rounded(cyclist.front_overhang_m * along);
        }
        BodyKind::Walker(walker) => walker.max_speed_mps = WALKER_MPS,
    }
    body.com_ahead_m = rounded(body.com_ahead_m * along);
    body.length_m = rounded(bounds.length_m);
    body.width_m = rounded(bounds.width_m);
    // The shape of the stock body would keep its old size.
    body.shape = Default::default();
    // Boxes that differ by less than a millimetre share a body.
    let mm = |value: f64| (1000.0 * value).round();
    body.name = format!(
        "{} {:.0} x {:.0} mm",
        class.name(),
        mm(bounds.length_m),
        mm(bounds.width_m)
    );
    // An extreme box gives a wheelbase that the physics refuses.
    body.validate().is_ok().then_some(body)
}

/// Returns the distance from the point that plans move to the front.
pub(super) fn lever_m(body: &Body) -> f64 {
    if body.is_on_foot() {
        body.half_length_m()
    } else {
        body.lever_m()
    }
}
