//! Pieces of road that an ado lays during an episode.
//!
//! A laid piece extends the road in the scene's own layout, so that commands, signals,
//! pictures and the ego have the same road.

use std::sync::Arc;

use super::layout::DriveLayout;
use super::motion::DriveScene;
use super::road_ado::piece_of;
use super::spec::DriveSpec;
use super::world::DriveWorld;
use crate::road::{CourseError, Piece};
use crate::trace::Trace;

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
        layout.network = Arc::new(spec.network()?);
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
        // The road must reach beyond every road user, and not beyond the ego
        // alone.
        let fronts_m = self.state.on_road.iter().map(|at| at.s_m);
        let foremost_m = fronts_m.fold(f64::NEG_INFINITY, f64::max);
        if foremost_m + ado.ahead_m <= course.end_s_m() {
            return Ok(());
        }
        let piece = ado.piece(course, self.state.next_curvature_per_m);
        let layout = Arc::new(self.layout.with_piece(piece)?);
        self.state.change_roads(&layout.spec, &layout.network);
        // An ego knows the road by its briefing, so a new piece needs a new
        // one.
        self.controller.brief(&layout.briefing());
        self.layout = layout;
        Ok(())
    }
}

impl DriveWorld {
    /// Returns the world with the road of a recorded trace.
    ///
    /// Without a road that an ado lays, it is this world.
    pub fn along(&self, trace: &Trace) -> DriveWorld {
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
            // The column repeats its count until another piece is laid.
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
