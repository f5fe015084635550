//! Places in space, as the viewer takes them.

/// A place as the viewer takes it, raised.
pub(super) fn lifted(point: [f64; 3], by_m: f64) -> [f32; 3] {
    // The one cast from places to pictures.
    [point[0] as f32, point[1] as f32, (point[2] + by_m) as f32]
}

pub(super) use crate::scene::ground::distance;
