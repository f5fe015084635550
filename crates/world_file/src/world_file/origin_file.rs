//! Pose of a world's origin in a road file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::default_field::is_default;

/// Pose of the world's origin in the road file of another simulator.
///
/// The axes are those of OpenDRIVE: x to the east, y to the north, z up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Origin", deny_unknown_fields)]
pub struct OriginFile {
    /// Road file, as another simulator names it.
    pub file: String,
    /// Position to the east, m.
    pub x_m: f64,
    /// Position to the north, m.
    pub y_m: f64,
    /// Height, m. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub z_m: f64,
    /// Direction of world x, counter-clockwise from the east, rad. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub heading_rad: f64,
}
