//! A road whose course an ado chooses piece by piece, ahead of all road users.

use std::sync::Arc;

use super::actions::Actions;
use super::course::{Course, CourseError, Piece};
use super::layout::DriveLayout;
use super::motion::DriveScene;
use super::network::RoadNetwork;
use super::spec::DriveSpec;
use super::world::DriveWorld;
use crate::trace::Trace;

/// Largest angle to its first heading at which a laid piece may end.
///
/// A road within a quarter turn advances all the time, so that it never comes back
/// onto itself.
pub(crate) const MAX_HEADING_RAD: f64 = 1.5;

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
    fn piece(&self, course: &Course, curvature_per_m: f64) -> Piece {
        let end_rad = course.pose(course.end_s_m(), 0.0).heading_rad;
        let most_per_m = (MAX_HEADING_RAD - end_rad).max(0.0) / self.piece_m;
        let least_per_m = (-MAX_HEADING_RAD - end_rad).min(0.0) / self.piece_m;
        piece_of(self.piece_m, curvature_per_m.clamp(least_per_m, most_per_m))
    }
}

/// Returns a piece of a length and a curvature.
fn piece_of(length_m: f64, curvature_per_m: f64) -> Piece {
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

impl DriveSpec {
    /// Returns whether its road has pieces that an ado laid.
    pub(super) fn has_laid_pieces(&self) -> bool {
        let listed = self.road_ado.as_ref().map(|ado| ado.listed);
        listed.is_some_and(|listed| listed < self.road.pieces())
    }

    /// Removes the pieces that an ado laid.
    pub(super) fn remove_laid_pieces(&mut self) {
        if let Some(ado) = &self.road_ado {
            self.road.truncate(ado.listed);
        }
    }
}

impl DriveLayout {
    /// Returns the layout with one more piece of road.
    ///
    /// # Errors
    /// The piece cannot be laid.
    fn with_piece(&self, piece: Piece) -> Result<DriveLayout, CourseError> {
        // Signals and formulas do not depend on the course.
        let mut layout = self.clone();
        let spec = Arc::make_mut(&mut layout.spec);
        spec.road.push(piece);
        layout.network = Arc::new(RoadNetwork::new(spec)?);
        Ok(layout)
    }
}

impl DriveScene {
    /// Lays the next piece of road if the laid road ends too near.
    ///
    /// At most one piece per sample, so that a trace holds the curvature of each.
    ///
    /// # Errors
    /// The piece cannot be laid.
    pub(super) fn lay_road(&mut self) -> Result<(), CourseError> {
        let Some(ado) = &self.layout.spec.road_ado else {
            return Ok(());
        };
        let course = self.layout.network.main();
        let fronts_m = self.state.on_road.iter().map(|at| at.s_m);
        let foremost_m = fronts_m.fold(f64::NEG_INFINITY, f64::max);
        if foremost_m + ado.ahead_m <= course.end_s_m() {
            return Ok(());
        }
        let piece = ado.piece(course, self.state.next_curvature_per_m);
        let layout = Arc::new(self.layout.with_piece(piece)?);
        self.state.spec = Arc::clone(&layout.spec);
        self.state.network = Arc::clone(&layout.network);
        self.controller.brief(&layout.briefing());
        self.layout = layout;
        Ok(())
    }
}

impl DriveWorld {
    /// Returns the world with the road of a recorded trace.
    ///
    /// Without a road that an ado lays, it is this world.
    pub(crate) fn along(&self, trace: &Trace) -> DriveWorld {
        let Some(ado) = &self.spec().road_ado else {
            return self.clone();
        };
        let column = |name: &str| trace.signal(&format!("{}.{name}", ado.name));
        let (Some(pieces), Some(curvatures)) = (column("pieces"), column("curvature")) else {
            return self.clone();
        };
        let mut layout = DriveLayout::clone(&self.0);
        Arc::make_mut(&mut layout.spec).remove_laid_pieces();
        let mut laid = ado.listed as f64;
        for (&count, &curvature_per_m) in pieces.iter().zip(curvatures) {
            if count <= laid {
                continue;
            }
            laid = count;
            let piece = piece_of(ado.piece_m, curvature_per_m);
            // Invariant: the episode laid this piece, so it can be laid.
            match layout.with_piece(piece) {
                Ok(longer) => layout = longer,
                Err(_) => break,
            }
        }
        DriveWorld(Arc::new(layout))
    }
}
