//! External accelerations of bodies: gravity on a slope, and wind.

/// External acceleration of a body, constant until it is changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Acceleration along the heading.
    pub along_mps2: f64,
    /// Acceleration to the left of the heading.
    pub left_mps2: f64,
    /// Part of both that gravity gives on a grade.
    ///
    /// A plant on a surface leaves this part to the surface.
    pub grade_mps2: [f64; 2],
    /// Share of the weight that presses on the ground, the cosine of the slope.
    pub load_share: f64,
}

impl Push {
    /// Flat ground in still air.
    pub const NONE: Push = Push {
        along_mps2: 0.0,
        left_mps2: 0.0,
        grade_mps2: [0.0; 2],
        load_share: 1.0,
    };

    /// Returns whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        // Each is checked: one NaN would reach every body at the next contact.
        [self.along_mps2, self.left_mps2, self.load_share]
            .iter()
            .chain(&self.grade_mps2)
            .all(|it| it.is_finite())
    }
}

impl Default for Push {
    fn default() -> Push {
        Push::NONE
    }
}
