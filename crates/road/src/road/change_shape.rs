//! Shapes of changes of speed and of lateral position over time.

use core::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Course of a change over time, from no share at 0 to the whole at 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum ChangeShape {
    /// At one rate.
    Linear,
    /// Along half a wave of a cosine.
    Cosine,
    /// Along the cubic curve that begins and ends without a rate.
    Cubic,
}

impl ChangeShape {
    /// Returns the greatest rate as a multiple of the mean rate.
    pub fn peak(self) -> f64 {
        match self {
            ChangeShape::Linear => 1.0,
            ChangeShape::Cosine => 0.5 * PI,
            ChangeShape::Cubic => 1.5,
        }
    }

    /// Returns the changed share at a share of the time.
    pub fn changed(self, share: f64) -> f64 {
        match self {
            ChangeShape::Linear => share,
            ChangeShape::Cosine => 0.5 * (1.0 - libm::cos(PI * share)),
            ChangeShape::Cubic => share * share * (3.0 - 2.0 * share),
        }
    }

    /// Returns the share of the time at which a share is changed, both from 0 to 1.
    pub fn share_of(self, changed: f64) -> f64 {
        match self {
            ChangeShape::Linear => changed,
            // The half angle stays precise near 0, where the cosine is flat.
            ChangeShape::Cosine => 2.0 / PI * libm::asin(changed.clamp(0.0, 1.0).sqrt()),
            // The root of the cubic between 0 and 1, by its trigonometric form.
            ChangeShape::Cubic => {
                0.5 - libm::sin(libm::asin((1.0 - 2.0 * changed).clamp(-1.0, 1.0)) / 3.0)
            }
        }
    }

    /// Returns the rate at a share of the time, as a multiple of the mean rate.
    pub fn rate(self, share: f64) -> f64 {
        match self {
            ChangeShape::Linear => 1.0,
            ChangeShape::Cosine => 0.5 * PI * libm::sin(PI * share),
            ChangeShape::Cubic => 6.0 * share * (1.0 - share),
        }
    }

    /// Returns the integral of the changed share over the share of the time.
    pub fn accumulated(self, share: f64) -> f64 {
        match self {
            ChangeShape::Linear => 0.5 * share * share,
            ChangeShape::Cosine => 0.5 * (share - libm::sin(PI * share) / PI),
            ChangeShape::Cubic => share * share * share * (1.0 - 0.5 * share),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_is_inverted() {
        for shape in [ChangeShape::Linear, ChangeShape::Cosine, ChangeShape::Cubic] {
            for step in 0..=100 {
                let share = f64::from(step) / 100.0;
                let back = shape.share_of(shape.changed(share));
                assert!((back - share).abs() < 1e-7, "{shape:?} {share} {back}");
            }
        }
    }
}
