//! Canvas of the pictures: from metres to pixels, and elements of SVG.

use brakecheck_xml::xml::XmlElement;

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
    body: Vec<XmlElement>,
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
            body: Vec::new(),
        }
    }

    /// Returns the place of a point of the world in pixels.
    pub(crate) fn place_px(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x - self.centre_m[0], y - self.centre_m[1]);
        let [cos, sin] = self.right;
        [
            self.middle_px[0] + self.px_per_m * (cos * dx + sin * dy),
            // The y of SVG points downwards.
            self.middle_px[1] - self.px_per_m * (cos * dy - sin * dx),
        ]
    }

    /// Draws a line through points of the world, to a quarter of a pixel.
    ///
    /// A style is CSS, here and below.
    pub(crate) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points: Vec<[f64; 2]> = points.into_iter().map(|it| self.place_px(it)).collect();
        let line = XmlElement::new("polyline").text("points", listed(&simplified(&points)));
        self.body
            .push(line.text("fill", "none").text("style", style));
    }

    /// Covers everything above and below the drawing that is drawn so far.
    pub(crate) fn cover(&mut self, top_px: f64, bottom_px: f64) {
        for (y, height) in [(0.0, top_px), (bottom_px, self.height_px - bottom_px)] {
            let strip = rectangle([0.0, y], [WIDTH_PX, height], "#fff");
            self.body.push(strip);
        }
    }

    /// Draws a closed polygon of the world.
    pub(crate) fn polygon(&mut self, points: &[[f64; 2]], style: &str) {
        let points: Vec<[f64; 2]> = points.iter().map(|it| self.place_px(*it)).collect();
        let polygon = XmlElement::new("polygon").text("points", listed(&points));
        self.body.push(polygon.text("style", style));
    }

    /// Draws a circle around a point of the world.
    pub(crate) fn circle(&mut self, point: [f64; 2], radius_px: f64, style: &str) {
        let [x, y] = self.place_px(point).map(px);
        let circle = XmlElement::new("circle").text("cx", x).text("cy", y);
        self.body
            .push(circle.number("r", radius_px).text("style", style));
    }

    /// Draws a line between pixels.
    pub(crate) fn segment(&mut self, from: [f64; 2], to: [f64; 2], style: &str) {
        let ([x1, y1], [x2, y2]) = (from.map(px), to.map(px));
        let line = XmlElement::new("line").text("x1", x1).text("y1", y1);
        self.body
            .push(line.text("x2", x2).text("y2", y2).text("style", style));
    }

    /// Writes a text whose baseline begins at a pixel.
    pub(crate) fn text(&mut self, at: [f64; 2], text: &str) {
        self.body.push(words(at, text));
    }

    /// Draws a scale of a round length in the lower right corner.
    pub(crate) fn scale(&mut self) {
        let length_m = round_length_m(0.2 * WIDTH_PX / self.px_per_m);
        let (right, y) = (WIDTH_PX - 14.0, self.height_px - 12.0);
        let left = right - length_m * self.px_per_m;
        let style = "stroke:#222;stroke-width:2";
        self.segment([left, y], [right, y], style);
        for x in [left, right] {
            self.segment([x, y - 4.0], [x, y + 4.0], style);
        }
        let length = words([left - 6.0, y + 4.0], &format!("{length_m} m"));
        self.body.push(length.text("text-anchor", "end"));
    }

    /// Writes a legend of classes in the lower left corner.
    pub(crate) fn legend(&mut self, classes: &[(Class, String)]) {
        let y = self.height_px - 12.0;
        let mut x = 14.0;
        for (class, text) in classes {
            let field = rectangle([x, y - 5.0], [10.0; 2], colour(*class));
            self.body.push(field);
            self.text([x + 14.0, y + 4.0], text);
            x += 26.0 + text_px(text);
        }
    }

    /// Returns the picture under its title.
    pub(crate) fn finish(self, title: &str) -> String {
        let height_px = self.height_px;
        let headline = words([14.0, 20.0], title)
            .text("font-size", "14")
            .text("font-weight", "bold");
        let picture = XmlElement::new("svg")
            .text("xmlns", "http://www.w3.org/2000/svg")
            .text("viewBox", format!("0 0 {WIDTH_PX} {height_px:.0}"))
            .text("font-family", "sans-serif")
            .text("font-size", "11")
            .text("role", "img")
            // The name that a screen reader reads, before any drawing.
            .child(XmlElement::new("title").words(title))
            // A background, because the texts are dark and the page of a
            // viewer may be, too.
            .child(rectangle([0.0; 2], [WIDTH_PX, height_px], "#fff"))
            .children(self.body)
            .child(headline);
        // Invariant: memory takes any document.
        picture.document().unwrap_or_default()
    }
}

/// Returns a pixel with one decimal.
fn px(value: f64) -> String {
    // A tenth of a pixel is invisible, and short numbers make small files.
    format!("{value:.1}")
}

fn listed(points: &[[f64; 2]]) -> String {
    let points = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
    points.collect::<Vec<_>>().join(" ")
}

fn rectangle(corner: [f64; 2], size: [f64; 2], fill: &str) -> XmlElement {
    let ([x, y], [width, height]) = (corner.map(px), size.map(px));
    let rectangle = XmlElement::new("rect").text("x", x).text("y", y);
    let sized = rectangle.text("width", width).text("height", height);
    sized.text("fill", fill)
}

fn words(at: [f64; 2], text: &str) -> XmlElement {
    let [x, y] = at.map(px);
    XmlElement::new("text")
        .text("x", x)
        .text("y", y)
        .words(text)
}

/// Drops points that the line through the others misses by less than a quarter of a pixel.
fn simplified(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = vec![false; points.len()];
    // A stack instead of recursion: a track has any number of points.
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
    // Two equal points are a piece without a direction.
    let share = if square == 0.0 {
        0.0
    } else {
        (((x - a[0]) * dx + (y - a[1]) * dy) / square).clamp(0.0, 1.0)
    };
    libm::hypot(x - a[0] - share * dx, y - a[1] - share * dy)
}

/// Returns an estimate of the width of a text.
pub(crate) fn text_px(text: &str) -> f64 {
    // The mean advance of 11 px letters, since no font is loaded.
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
