//! Interface of a kind of body, and the data of a body that every kind reads.

use thiserror::Error;

use super::BodyControl;

/// Box of a body, and the position of its centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyDimensions {
    /// Distance from the front bumper to the rear bumper.
    pub length_m: f64,
    /// Distance from side to side.
    pub width_m: f64,
    /// Distance from the ground to the roof.
    pub height_m: f64,
    /// Height of the centre of mass above the ground.
    pub com_height_m: f64,
    /// Distance of the centre of mass ahead of the middle of the length.
    pub com_ahead_m: f64,
}

/// Field of a body with an invalid value.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("`{field}` is {value}, but it must be {want}")]
pub struct InvalidBody {
    /// Name of the field.
    pub field: &'static str,
    /// Value of the field.
    pub value: f64,
    /// Valid range of the field, in words.
    pub want: String,
}

/// Kind-specific answers of a body, except for its motion.
///
/// The plants match on the kind for the motion.
pub(super) trait BodyModel {
    /// Checks the values that only this kind has.
    fn validate(&self, size: &BodyDimensions) -> Result<(), InvalidBody>;
    /// Returns the kind of command that the body accepts.
    fn control(&self) -> BodyControl;
    /// Returns the road space that the body occupies, along and across the road.
    fn room_m(&self, size: &BodyDimensions) -> (f64, f64);
    /// Distance from the point steered along a path to the front bumper.
    fn lever_m(&self) -> f64;
}

/// Checks that a field is finite and in its range.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), InvalidBody> {
    // NaN fails both comparisons, so it is refused as well.
    if low <= value && value <= high {
        return Ok(());
    }
    let want = format!("between {low} and {high}");
    Err(InvalidBody { field, value, want })
}
