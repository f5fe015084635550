//! Places in space for the viewer.

use crate::sim::Placement;

/// Place in the viewer's precision, raised by `by_m`.
pub(super) fn lifted(point: [f64; 3], by_m: f64) -> [f32; 3] {
    // The only cast from places to pictures.
    [point[0] as f32, point[1] as f32, (point[2] + by_m) as f32]
}

/// Rotation of a placement in the viewer's precision.
pub(super) fn quaternion(place: &Placement) -> re_sdk_types::datatypes::Quaternion {
    re_sdk_types::datatypes::Quaternion::from_xyzw(
        place.rotation.coords.map(|part| part as f32).into(),
    )
}

pub(super) use crate::scene::ground::distance;
