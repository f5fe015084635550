//! External accelerations of bodies: gravity on a slope, and wind.

/// External acceleration of a body, constant until it is changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Acceleration along the heading.
    pub along_mps2: f64,
    /// Acceleration to the left of the heading.
    pub left_mps2: f64,
    /// Share of the weight that presses on the ground, the cosine of the slope.
    pub load_share: f64,
}

impl Push {
    /// Flat ground in still air.
    pub const NONE: Push = Push {
        along_mps2: 0.0,
        left_mps2: 0.0,
        load_share: 1.0,
    };

    /// Returns whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        [self.along_mps2, self.left_mps2, self.load_share]
            .iter()
            .all(|it| it.is_finite())
    }
}

impl Default for Push {
    fn default() -> Push {
        Push::NONE
    }
}
