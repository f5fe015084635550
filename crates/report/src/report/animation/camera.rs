//! Camera: visible part of the world, and its scale.

use super::film_tracks::FilmTracks;

/// Layout of a picture.
pub(super) struct Canvas {
    /// Width and height.
    pub size_px: [f64; 2],
    /// Margins without bodies, at the sides and at top and bottom.
    pub margin_px: [f64; 2],
    /// Height of the overlay at the bottom.
    pub foot_px: f64,
    /// Least length of the ego.
    pub ego_px: f64,
    /// Least visible height in metres.
    pub least_height_m: f64,
}

impl Canvas {
    /// Width and height without the overlay.
    fn room_px(&self) -> [f64; 2] {
        [self.size_px[0], self.size_px[1] - self.foot_px]
    }
}

/// Picture in the page. play.js uses the same numbers.
pub(super) const SCREEN: Canvas = Canvas {
    size_px: [1190.0, 340.0],
    margin_px: [120.0, 62.0],
    foot_px: 36.0,
    ego_px: 66.0,
    least_height_m: 8.5,
};

/// Small still.
pub(super) const THUMB: Canvas = Canvas {
    size_px: [240.0, 120.0],
    margin_px: [14.0, 12.0],
    foot_px: 0.0,
    ego_px: 12.0,
    least_height_m: 8.0,
};

/// Map from places to pixels.
pub(super) struct Camera<'a> {
    pub canvas: &'a Canvas,
    /// Pixels per metre.
    pub scale: f64,
    /// Place in the middle, in the picture's directions.
    pub centre_m: [f64; 2],
    turn_rad: f64,
}

impl<'a> Camera<'a> {
    /// Returns the camera at a sample.
    ///
    /// It shows all relevant agents as long as the ego stays large enough.
    /// Otherwise it shows the ego and the part of the scene in its direction.
    ///
    /// `ego` is the index and the length of the ego. With `None` everything
    /// fits, at any scale.
    pub(super) fn of(
        film: &FilmTracks,
        i: usize,
        ego: Option<(usize, f64)>,
        canvas: &'a Canvas,
    ) -> Camera<'a> {
        let scale = Camera::fitting(film, i, ego, canvas);
        Camera::at_scale(film, i, ego, scale, canvas)
    }

    /// Camera of one pixel per metre, for tests of the canvas alone.
    #[cfg(test)]
    pub(super) fn still(canvas: &'a Canvas) -> Camera<'a> {
        Camera {
            canvas,
            scale: 1.0,
            centre_m: [0.0; 2],
            turn_rad: 0.0,
        }
    }

    /// Pixels per metre at which all relevant agents fit.
    ///
    /// The scale is greater if the ego would otherwise be too small.
    pub(super) fn fitting(
        film: &FilmTracks,
        i: usize,
        ego: Option<(usize, f64)>,
        canvas: &Canvas,
    ) -> f64 {
        let focus = film.focus[i];
        let room_px = canvas.room_px();
        let fits = [0, 1].map(|axis| {
            // A lower bound on the size: a single point would give an infinite
            // scale.
            (room_px[axis] - 2.0 * canvas.margin_px[axis]) / focus.size_m[axis].max(0.1)
        });
        let scale = fits[0].min(fits[1]);
        match ego {
            // The least ego size comes last: it outweighs the number of visible
            // agents.
            Some((_, ego_m)) => scale
                .min(room_px[1] / canvas.least_height_m)
                .max(canvas.ego_px / ego_m),
            None => scale,
        }
    }

    /// Returns the camera at a sample, with the given pixels per metre.
    pub(super) fn at_scale(
        film: &FilmTracks,
        i: usize,
        ego: Option<(usize, f64)>,
        scale: f64,
        canvas: &'a Canvas,
    ) -> Camera<'a> {
        let focus = film.focus[i];
        let room_px = canvas.room_px();
        let centre_m = match ego {
            None => focus.centre_m,
            Some((ego, ego_m)) => {
                let track = &film.tracks[ego];
                let own_m = film.turned(track.x_m[i], track.y_m[i]);
                [0, 1].map(|axis| {
                    // Greatest distance of the ego from the middle, so that it
                    // stays in the picture.
                    let margin_px = canvas.margin_px[axis].min(40.0);
                    let reach_m =
                        ((0.5 * room_px[axis] - margin_px) / scale - 0.5 * ego_m).max(0.0);
                    focus.centre_m[axis].clamp(own_m[axis] - reach_m, own_m[axis] + reach_m)
                })
            }
        };
        Camera {
            canvas,
            scale,
            centre_m,
            turn_rad: film.turn_rad,
        }
    }

    /// Middle of the picture.
    pub(super) fn middle_px(&self) -> [f64; 2] {
        let [width_px, height_px] = self.canvas.size_px;
        [0.5 * width_px, 0.5 * (height_px - self.canvas.foot_px)]
    }

    /// SVG `transform` for elements in metres, with y upward.
    pub(super) fn transform(&self) -> String {
        let [x, y] = self.middle_px();
        let [u, v] = self.centre_m;
        format!(
            "translate({x:.1} {y:.1}) scale({s:.4} {m:.4}) translate({u:.3} {v:.3}) rotate({turn:.3})",
            s = self.scale,
            m = -self.scale,
            u = -u,
            v = -v,
            // The negative y scale mirrors the picture, so the turn changes its
            // sign.
            turn = -self.turn_rad.to_degrees(),
        )
    }

    /// Pixel position of a place that is given in the picture's directions.
    pub(super) fn at(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.middle_px();
        [
            x + (u - self.centre_m[0]) * self.scale,
            y - (v - self.centre_m[1]) * self.scale,
        ]
    }
}
