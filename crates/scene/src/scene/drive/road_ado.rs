//! A road whose course an ado chooses piece by piece, ahead of all road users.

use super::actions::Actions;
use crate::road::{Course, Piece};

/// Largest angle to its first heading at which a laid piece may end.
///
/// A road within a quarter turn advances all the time, so that it never comes back
/// onto itself.
pub const MAX_HEADING_RAD: f64 = 1.5;

/// The world's own road as an ado. It lays pieces beyond the listed ones.
#[derive(Clone, Debug)]
pub struct RoadAdo {
    /// Name in signals.
    pub name: String,
    /// Length of laid road ahead of the foremost road user. It never changes.
    pub ahead_m: f64,
    /// Length of a piece that it lays.
    pub piece_m: f64,
    /// Number of pieces that the world file lists. They are there at the start.
    pub listed: usize,
    /// Action set: curvatures of the next piece.
    pub actions: Actions,
    /// Action that lays the neutral piece.
    pub neutral: usize,
}

impl RoadAdo {
    /// Returns the next piece of a course for a chosen curvature.
    ///
    /// A piece that would turn the road by more than [`MAX_HEADING_RAD`] from its first
    /// heading turns it by that angle only.
    pub(super) fn piece(&self, course: &Course, curvature_per_m: f64) -> Piece {
        let end_rad = course.pose(course.end_s_m(), 0.0).heading_rad;
        // Within these headings the road always advances, so no piece meets an
        // earlier one.
        let most_per_m = (MAX_HEADING_RAD - end_rad).max(0.0) / self.piece_m;
        let least_per_m = (-MAX_HEADING_RAD - end_rad).min(0.0) / self.piece_m;
        piece_of(self.piece_m, curvature_per_m.clamp(least_per_m, most_per_m))
    }
}

/// Returns a piece of a length and a curvature.
pub(super) fn piece_of(length_m: f64, curvature_per_m: f64) -> Piece {
    // Below a curvature of 1e-9 a piece of 100 m is straight to 5 µm.
    if curvature_per_m.abs() < 1e-9 {
        Piece::Line { length_m }
    } else {
        Piece::Arc {
            length_m,
            radius_m: 1.0 / curvature_per_m,
        }
    }
}
