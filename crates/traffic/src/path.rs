//! Lines in the plane, with distances along and offsets to the left.

/// Line through points, with the distance along it at each of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    s_m: Vec<f64>,
}

/// Place of a point beside a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPlace {
    /// Distance along the path in metres, beyond its ends on the straight extension.
    pub s_m: f64,
    /// Offset to the left in metres.
    pub lateral_m: f64,
    /// Index of the nearest piece, the hint for the next point.
    pub piece: usize,
}

impl Path {
    /// Creates a path through points that are at least `step_m` apart.
    ///
    /// Returns `None` if fewer than two points remain.
    pub fn through(points: impl IntoIterator<Item = [f64; 2]>, step_m: f64) -> Option<Path> {
        let (mut x_m, mut y_m, mut s_m): (Vec<f64>, Vec<f64>, Vec<f64>) = Default::default();
        for [x, y] in points {
            let (Some(x0), Some(y0), Some(s0)) = (x_m.last(), y_m.last(), s_m.last()) else {
                x_m.push(x);
                y_m.push(y);
                s_m.push(0.0);
                continue;
            };
            let way_m = libm::hypot(x - x0, y - y0);
            // Points of a standing vehicle would give pieces of noise without
            // a direction.
            if step_m <= way_m {
                let s = s0 + way_m;
                x_m.push(x);
                y_m.push(y);
                s_m.push(s);
            }
        }
        (x_m.len() >= 2).then_some(Path { x_m, y_m, s_m })
    }

    /// Returns the path relative to an origin.
    pub(crate) fn relative_to(mut self, origin_m: [f64; 2]) -> Path {
        self.x_m.iter_mut().for_each(|x| *x -= origin_m[0]);
        self.y_m.iter_mut().for_each(|y| *y -= origin_m[1]);
        self
    }

    /// Returns the length in metres.
    pub fn length_m(&self) -> f64 {
        self.s_m.last().copied().unwrap_or(0.0)
    }

    /// Returns the points with their distances along the path.
    pub fn points(&self) -> impl DoubleEndedIterator<Item = ([f64; 2], f64)> + '_ {
        let places = self.x_m.iter().zip(&self.y_m);
        places.zip(&self.s_m).map(|((x, y), s)| ([*x, *y], *s))
    }

    /// Returns the unit vector along a piece.
    pub fn direction(&self, piece: usize) -> [f64; 2] {
        let way_m = self.s_m[piece + 1] - self.s_m[piece];
        [
            (self.x_m[piece + 1] - self.x_m[piece]) / way_m,
            (self.y_m[piece + 1] - self.y_m[piece]) / way_m,
        ]
    }

    /// Returns the last point, or the first one.
    pub(crate) fn tip(&self, is_end: bool) -> [f64; 2] {
        let at = if is_end { self.x_m.len() - 1 } else { 0 };
        [self.x_m[at], self.y_m[at]]
    }

    /// Returns the number of pieces.
    pub fn pieces(&self) -> usize {
        self.x_m.len() - 1
    }

    /// Returns the place of a point, searched downhill from the piece `hint`.
    pub fn place(&self, point: [f64; 2], hint: usize) -> PathPlace {
        let last = self.pieces() - 1;
        let mut piece = hint.min(last);
        // Back first, then ahead: at a corner both neighbours may claim the point.
        while piece > 0 && self.along(point, piece) < 0.0 {
            piece -= 1;
        }
        while piece < last && self.way(piece) < self.along(point, piece) {
            piece += 1;
        }
        let [ux, uy] = self.direction(piece);
        let (dx, dy) = (point[0] - self.x_m[piece], point[1] - self.y_m[piece]);
        PathPlace {
            s_m: self.s_m[piece] + ux * dx + uy * dy,
            lateral_m: ux * dy - uy * dx,
            piece,
        }
    }

    /// Returns the place of a point, searched from the nearest vertex.
    pub fn place_anywhere(&self, point: [f64; 2]) -> PathPlace {
        // Squares keep the order of the distances and need no root.
        let far = |i: &usize| {
            let (dx, dy) = (point[0] - self.x_m[*i], point[1] - self.y_m[*i]);
            dx * dx + dy * dy
        };
        let nearest = (0..self.x_m.len()).min_by(|a, b| far(a).total_cmp(&far(b)));
        self.place(point, nearest.unwrap_or(0))
    }

    /// Returns the path with each point moved to the left by `offset_m(s)`.
    pub fn moved(&self, offset_m: impl Fn(f64) -> f64, step_m: f64) -> Option<Path> {
        let points: Vec<[f64; 2]> = self
            .points()
            .enumerate()
            .map(|(i, ([x, y], s))| {
                let [ux, uy] = self.direction(i.min(self.pieces() - 1));
                let [vx, vy] = self.direction(i.saturating_sub(1));
                // The mean of both directions, so that a bend has no gap at
                // its joints.
                let norm = libm::hypot(ux + vx, uy + vy);
                let left = offset_m(s);
                [x - left * (uy + vy) / norm, y + left * (ux + vx) / norm]
            })
            .collect();
        // On the inside of a bend points move together, so they are thinned
        // again.
        Path::through(points, step_m)
    }

    fn along(&self, point: [f64; 2], piece: usize) -> f64 {
        let [ux, uy] = self.direction(piece);
        ux * (point[0] - self.x_m[piece]) + uy * (point[1] - self.y_m[piece])
    }

    fn way(&self, piece: usize) -> f64 {
        self.s_m[piece + 1] - self.s_m[piece]
    }
}
