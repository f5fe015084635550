//! Canvas of the pictures: from metres to pixels, and elements of SVG.

use std::fmt::Write;

use crate::recording::Class;

/// Width of a picture in pixels.
pub(crate) const WIDTH_PX: f64 = 900.0;

/// Height of a line of text in pixels.
pub(crate) const LINE_PX: f64 = 15.0;

/// Picture in the making, with the frame of its drawing.
pub(crate) struct SvgCanvas {
    /// Point of the world in the middle of the drawing.
    centre_m: [f64; 2],
    /// Direction of the world that points to the right.
    right: [f64; 2],
    pub(crate) px_per_m: f64,
    middle_px: [f64; 2],
    height_px: f64,
    body: String,
}

impl SvgCanvas {
    /// Creates a canvas whose drawing of `size_px` begins `top_px` below the upper edge.
    pub(crate) fn new(
        centre_m: [f64; 2],
        angle_rad: f64,
        px_per_m: f64,
        [width_px, drawn_px]: [f64; 2],
        [top_px, bottom_px]: [f64; 2],
    ) -> SvgCanvas {
        let (sin, cos) = libm::sincos(angle_rad);
        SvgCanvas {
            centre_m,
            right: [cos, sin],
            px_per_m,
            middle_px: [0.5 * width_px, top_px + 0.5 * drawn_px],
            height_px: top_px + drawn_px + bottom_px,
            body: String::new(),
        }
    }

    /// Returns the place of a point of the world in pixels.
    pub(crate) fn place_px(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x - self.centre_m[0], y - self.centre_m[1]);
        let [cos, sin] = self.right;
        [
            self.middle_px[0] + self.px_per_m * (cos * dx + sin * dy),
            self.middle_px[1] - self.px_per_m * (cos * dy - sin * dx),
        ]
    }

    /// Draws a line through points of the world, to a quarter of a pixel.
    pub(crate) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points: Vec<[f64; 2]> = points.into_iter().map(|it| self.place_px(it)).collect();
        let points: Vec<String> = simplified(&points)
            .into_iter()
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        let points = points.join(" ");
        let _ = writeln!(
            self.body,
            "<polyline points=\"{points}\" fill=\"none\" {style}/>"
        );
    }

    /// Covers everything above and below the drawing that is drawn so far.
    pub(crate) fn cover(&mut self, top_px: f64, bottom_px: f64) {
        for (y, height) in [(0.0, top_px), (bottom_px, self.height_px - bottom_px)] {
            let _ = writeln!(
                self.body,
                "<rect y=\"{y:.1}\" width=\"{WIDTH_PX}\" height=\"{height:.1}\" fill=\"#fff\"/>"
            );
        }
    }

    /// Draws a closed polygon of the world.
    pub(crate) fn polygon(&mut self, points: &[[f64; 2]], style: &str) {
        let points: Vec<String> = points
            .iter()
            .map(|it| self.place_px(*it))
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        let points = points.join(" ");
        let _ = writeln!(self.body, "<polygon points=\"{points}\" {style}/>");
    }

    /// Draws a circle around a point of the world.
    pub(crate) fn circle(&mut self, point: [f64; 2], radius_px: f64, style: &str) {
        let [x, y] = self.place_px(point);
        let _ = writeln!(
            self.body,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px}\" {style}/>"
        );
    }

    /// Draws a line between pixels.
    pub(crate) fn segment(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], style: &str) {
        let _ = writeln!(
            self.body,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}/>"
        );
    }

    /// Writes a text whose baseline begins at a pixel.
    pub(crate) fn text(&mut self, [x, y]: [f64; 2], style: &str, text: &str) {
        let text = escaped(text);
        let _ = writeln!(
            self.body,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{text}</text>"
        );
    }

    /// Draws a scale of a round length in the lower right corner.
    pub(crate) fn scale(&mut self) {
        let length_m = round_length_m(0.2 * WIDTH_PX / self.px_per_m);
        let (right, y) = (WIDTH_PX - 14.0, self.height_px - 12.0);
        let left = right - length_m * self.px_per_m;
        let style = "stroke=\"#222\" stroke-width=\"2\"";
        self.segment([left, y], [right, y], style);
        for x in [left, right] {
            self.segment([x, y - 4.0], [x, y + 4.0], style);
        }
        self.text(
            [left - 6.0, y + 4.0],
            "text-anchor=\"end\"",
            &format!("{length_m} m"),
        );
    }

    /// Writes a legend of classes in the lower left corner.
    pub(crate) fn legend(&mut self, classes: &[(Class, String)]) {
        let y = self.height_px - 12.0;
        let mut x = 14.0;
        for (class, text) in classes {
            let _ = writeln!(
                self.body,
                "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"10\" height=\"10\" fill=\"{}\"/>",
                y - 5.0,
                colour(*class)
            );
            self.text([x + 14.0, y + 4.0], "", text);
            x += 26.0 + text_px(text);
        }
    }

    /// Returns the picture under its title.
    pub(crate) fn finish(self, title: &str) -> String {
        let (title, height_px, body) = (escaped(title), self.height_px, self.body);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH_PX} {height_px:.0}\" \
             font-family=\"sans-serif\" font-size=\"11\" role=\"img\">\n\
             <title>{title}</title>\n\
             <rect width=\"{WIDTH_PX}\" height=\"{height_px:.0}\" fill=\"#fff\"/>\n\
             {body}\
             <text x=\"14\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{title}</text>\n\
             </svg>\n"
        )
    }
}

/// Drops points that the line through the others misses by less than a quarter of a pixel.
fn simplified(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = vec![false; points.len()];
    let mut open = vec![(0, points.len().saturating_sub(1))];
    while let Some((from, to)) = open.pop() {
        for end in [from, to] {
            if let Some(end) = kept.get_mut(end) {
                *end = true;
            }
        }
        let off = |i: &usize| distance_px(points[*i], points[from], points[to]);
        let worst = (from + 1..to).max_by(|a, b| off(a).total_cmp(&off(b)));
        if let Some(worst) = worst.filter(|it| off(it) > 0.25) {
            open.extend([(from, worst), (worst, to)]);
        }
    }
    let pairs = points.iter().zip(kept);
    pairs
        .filter_map(|(point, is_kept)| is_kept.then_some(*point))
        .collect()
}

/// Returns the distance of a point to a piece of a line.
pub(crate) fn distance_px([x, y]: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let square = dx * dx + dy * dy;
    let share = if square == 0.0 {
        0.0
    } else {
        (((x - a[0]) * dx + (y - a[1]) * dy) / square).clamp(0.0, 1.0)
    };
    libm::hypot(x - a[0] - share * dx, y - a[1] - share * dy)
}

/// Returns an estimate of the width of a text.
pub(crate) fn text_px(text: &str) -> f64 {
    6.2 * text.chars().count() as f64
}

/// Returns the colour of a class.
pub(crate) fn colour(class: Class) -> &'static str {
    match class {
        Class::Pedestrian => "#d9480f",
        Class::Bicycle => "#2b8a3e",
        Class::Motorcycle => "#862e9c",
        Class::Car => "#1971c2",
        Class::Van => "#0b7285",
        Class::Truck => "#8d5524",
        Class::Trailer => "#b08968",
        Class::Other => "#868e96",
    }
}

/// Returns 1, 2 or 5 times a power of ten, at most the length.
fn round_length_m(most_m: f64) -> f64 {
    let power = libm::exp10(libm::floor(libm::log10(most_m)));
    let fits = |it: &f64| it * power <= most_m;
    [5.0, 2.0, 1.0].into_iter().find(fits).unwrap_or(1.0) * power
}

/// Escapes what XML reads as markup, and drops control characters, which it forbids.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for it in text.chars().filter(|it| !it.is_control()) {
        match it {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            // Two code points that XML forbids in any form.
            '\u{fffe}' | '\u{ffff}' => {}
            it => safe.push(it),
        }
    }
    safe
}
