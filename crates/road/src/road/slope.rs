//! Grades of roads.

use serde::{Deserialize, Serialize};

/// Greatest rise of a road per length.
pub const MAX_RISE: f64 = 0.3;

/// Grade of a road from a station on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grade {
    /// Station at which it begins.
    pub from_s_m: f64,
    /// Rise per length along the ground, positive uphill towards greater s.
    pub rise: f64,
}

impl Grade {
    /// Returns the sine and the cosine of the slope.
    pub fn direction(self) -> (f64, f64) {
        let length = (1.0 + self.rise * self.rise).sqrt();
        (self.rise / length, 1.0 / length)
    }
}

/// Returns the grade at a station, flat without grades.
///
/// Before its station the first grade holds.
pub fn grade_at(grades: &[Grade], s_m: f64) -> Grade {
    let begun = grades.iter().rev().find(|grade| grade.from_s_m <= s_m);
    let grade = begun.or(grades.first()).copied();
    grade.unwrap_or(Grade {
        from_s_m: 0.0,
        rise: 0.0,
    })
}
