//! Pictures as SVG: curves, heat maps and histograms, coloured by CSS classes.
//!
//! All pictures are drawn on a small canvas and scaled, so that letters stay
//! readable on a phone. The style of the page sets the colours, light or dark.

use maud::{Markup, html};

use super::canvas::{BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, px, svg};
use super::words::Words;

/// Wanted number of ticks on an axis.
const TICKS: f64 = 5.0;
/// Greatest number of drawn points of a curve.
const MAX_POINTS: usize = 400;

/// Points joined by a line, with a name and a colour.
pub(super) struct Curve {
    /// Name in the legend. Empty for a curve that the legend omits.
    pub name: String,
    /// CSS class of its colour, such as `c-ego` or `c-1`.
    pub class: String,
    /// Points in order.
    pub points: Vec<(f64, f64)>,
    /// Points of it with a dot, such as one per second.
    pub dots: Vec<(f64, f64)>,
}

/// Line across the picture with a word.
pub(super) struct Mark {
    /// Position on the axis that it crosses, in the unit of that axis.
    pub at: f64,
    /// Word beside the line.
    pub word: String,
}

/// Estimate with its interval, which a slider may choose.
pub(super) struct Estimate {
    /// Position along x.
    pub at: f64,
    /// Estimate. `None` is unknown.
    pub value: Option<f64>,
    /// Interval of the estimate.
    pub interval: (f64, f64),
    /// Tooltip.
    pub about: String,
}

/// Shaded rectangle in the units of the axes.
pub(super) struct Region {
    /// Range along x.
    pub x: (f64, f64),
    /// Range along y.
    pub y: (f64, f64),
    /// Word inside the rectangle.
    pub word: String,
}

/// Curves over common axes.
#[derive(Default)]
pub(super) struct Chart {
    /// Title above the picture.
    pub title: String,
    /// Label under the picture.
    pub x_label: String,
    /// Quantity and unit of the curves.
    pub y_label: String,
    /// Curves of the chart.
    pub curves: Vec<Curve>,
    /// Vertical lines at instants.
    pub at_x: Vec<Mark>,
    /// Horizontal lines.
    pub at_y: Vec<Mark>,
    /// Shaded regions.
    pub regions: Vec<Region>,
    /// Estimates with their intervals.
    pub estimates: Vec<Estimate>,
    /// Least span of y.
    pub y_span: Option<(f64, f64)>,
}

/// Map from numbers to the canvas, along one axis.
struct PlotAxis {
    lo: f64,
    hi: f64,
    from: f64,
    to: f64,
}

impl PlotAxis {
    fn at(&self, value: f64) -> f64 {
        let share = (value - self.lo) / (self.hi - self.lo);
        // Values outside of the axis stay just beyond the frame.
        self.from + share.clamp(-0.02, 1.02) * (self.to - self.from)
    }

    /// Round numbers within the axis, and their decimal places.
    fn ticks(&self) -> (Vec<f64>, usize) {
        let rough = (self.hi - self.lo) / TICKS;
        let power = libm::pow(10.0, libm::floor(libm::log10(rough)));
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|m| m * power)
            .into_iter()
            // The next round step above, so that there are never more ticks
            // than wanted.
            .find(|s| rough <= *s)
            .unwrap_or(rough);
        // As many decimals as the step has, which tell neighbouring ticks
        // apart.
        let places = (-libm::floor(libm::log10(step))).max(0.0) as usize;
        // The tolerance keeps a tick that rounding puts just outside the axis.
        let first = libm::ceil(self.lo / step - 1e-9) as i64;
        let last = libm::floor(self.hi / step + 1e-9) as i64;
        ((first..=last).map(|i| i as f64 * step).collect(), places)
    }
}

/// Least and greatest of some numbers, never equal.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (lo, hi) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(v), hi.max(v))
        });
    // An axis without an extent would divide by 0.
    if lo < hi {
        (lo, hi)
    } else if lo.is_finite() {
        (lo - 0.5, lo + 0.5)
    } else {
        (0.0, 1.0)
    }
}

fn frame(x: (f64, f64), y: (f64, f64)) -> (PlotAxis, PlotAxis) {
    let x = PlotAxis {
        lo: x.0,
        hi: x.1,
        from: LEFT,
        to: WIDTH - RIGHT,
    };
    let y = PlotAxis {
        lo: y.0,
        hi: y.1,
        from: HEIGHT - BOTTOM,
        to: TOP,
    };
    (x, y)
}

/// Picture of a chart.
pub(super) fn chart(chart: &Chart) -> Markup {
    let points = || chart.curves.iter().flat_map(|curve| &curve.points);
    let xs = points()
        .map(|p| p.0)
        .chain(chart.estimates.iter().map(|it| it.at));
    let at_y = chart.at_y.iter().map(|mark| mark.at);
    // Part of the span and no limit, so that no curve leaves the frame.
    let wanted = chart.y_span.into_iter().flat_map(|(lo, hi)| [lo, hi]);
    let ys = span(points().map(|p| p.1).chain(at_y).chain(wanted));
    // A small margin keeps curves off the frame.
    let pad = 0.04 * (ys.1 - ys.0);
    let (x, y) = frame(span(xs), (ys.0 - pad, ys.1 + pad));
    let words = words(chart, &x, &y);
    svg(
        &chart.title,
        html! {
            @for region in &chart.regions { (shaded(region, &x, &y)) }
            (grid(&x, &y, &chart.x_label, &chart.y_label))
            @for mark in &chart.at_y {
                line class="rule" x1=(px(LEFT)) x2=(px(WIDTH - RIGHT)) y1=(px(y.at(mark.at))) y2=(px(y.at(mark.at))) {}
            }
            @for mark in &chart.at_x {
                line class="rule" x1=(px(x.at(mark.at))) x2=(px(x.at(mark.at))) y1=(px(TOP)) y2=(px(HEIGHT - BOTTOM)) {}
            }
            @for curve in &chart.curves {
                polyline class={ "curve " (curve.class) } points=(path(&curve.points, &x, &y)) {}
                @for (at_x, at_y) in &curve.dots { circle class={ "dot " (curve.class) } cx=(px(x.at(*at_x))) cy=(px(y.at(*at_y))) r="2.4" {} }
            }
            @for (nth, it) in chart.estimates.iter().enumerate() { (estimate(nth, it, &x, &y)) }
            @for it in &words.placed { text class=(it.class) x=(px(it.x)) y=(px(it.y)) { (it.word) } }
            (legend(&chart.curves))
        },
    )
}

fn estimate(nth: usize, it: &Estimate, x: &PlotAxis, y: &PlotAxis) -> Markup {
    let (middle, low, high) = (x.at(it.at), y.at(it.interval.0), y.at(it.interval.1));
    html! {
        g class="estimate" data-cell=(nth) {
            title { (it.about) }
            @match it.value {
                Some(value) => {
                    path d=(format!("M{0} {1}V{2}M{3} {1}h8M{3} {2}h8", px(middle), px(low), px(high), px(middle - 4.0))) {}
                    circle class="dot c-ego" cx=(px(middle)) cy=(px(y.at(value))) r="3" {}
                }
                None => { text class="unknown" x=(px(middle)) y=(px(0.5 * (low + high))) text-anchor="middle" { "?" } }
            }
        }
    }
}

/// Words in the picture, placed clear of its curves.
fn words(chart: &Chart, x: &PlotAxis, y: &PlotAxis) -> Words {
    let mut words = Words::default();
    for curve in &chart.curves {
        let finite = curve
            .points
            .iter()
            .filter(|(a, b)| a.is_finite() && b.is_finite());
        let curve: Vec<(f64, f64)> = finite.map(|(a, b)| (x.at(*a), y.at(*b))).collect();
        words.avoid(&curve);
    }
    // Earlier words have the first choice of places, and regions have the
    // fewest.
    for region in &chart.regions {
        words.within(rectangle(region, x, y), &region.word);
    }
    for mark in &chart.at_x {
        words.beside(x.at(mark.at), &mark.word);
    }
    for mark in &chart.at_y {
        words.along(y.at(mark.at), &mark.word);
    }
    words
}

fn path(points: &[(f64, f64)], x: &PlotAxis, y: &PlotAxis) -> String {
    // Long curves are thinned, since the picture has fewer pixels. The last
    // point always stays.
    let every = points.len().div_ceil(MAX_POINTS).max(1);
    let last = points.len().saturating_sub(1);
    let kept = points
        .iter()
        .enumerate()
        .filter(|(i, p)| (i % every == 0 || *i == last) && p.0.is_finite() && p.1.is_finite());
    let places = kept.map(|(_, p)| format!("{},{}", px(x.at(p.0)), px(y.at(p.1))));
    places.collect::<Vec<_>>().join(" ")
}

fn shaded(region: &Region, x: &PlotAxis, y: &PlotAxis) -> Markup {
    let [left, top, right, bottom] = rectangle(region, x, y);
    html! {
        rect class="region" x=(px(left)) y=(px(top)) width=(px(right - left)) height=(px(bottom - top)) {}
    }
}

/// Left, top, right and bottom of a region on the canvas.
fn rectangle(region: &Region, x: &PlotAxis, y: &PlotAxis) -> [f64; 4] {
    // Clipped exactly, unlike curves: a rectangle must not reach over the
    // frame.
    let clip = |value: f64, axis: &PlotAxis| axis.at(value.clamp(axis.lo, axis.hi));
    [
        clip(region.x.0, x),
        clip(region.y.1, y),
        clip(region.x.1, x),
        clip(region.y.0, y),
    ]
}

fn grid(x: &PlotAxis, y: &PlotAxis, x_label: &str, y_label: &str) -> Markup {
    let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    let (x_ticks, x_places) = x.ticks();
    let (y_ticks, y_places) = y.ticks();
    html! {
        @for tick in &y_ticks {
            line class="grid" x1=(px(LEFT)) x2=(px(right)) y1=(px(y.at(*tick))) y2=(px(y.at(*tick))) {}
            text class="tick" x=(px(LEFT - 5.0)) y=(px(y.at(*tick) + 3.5)) text-anchor="end" { (format!("{tick:.y_places$}")) }
        }
        @for tick in &x_ticks {
            line class="grid" x1=(px(x.at(*tick))) x2=(px(x.at(*tick))) y1=(px(TOP)) y2=(px(bottom)) {}
            text class="tick" x=(px(x.at(*tick))) y=(px(bottom + 13.0)) text-anchor="middle" { (format!("{tick:.x_places$}")) }
        }
        line class="axis" x1=(px(LEFT)) x2=(px(right)) y1=(px(bottom)) y2=(px(bottom)) {}
        line class="axis" x1=(px(LEFT)) x2=(px(LEFT)) y1=(px(TOP)) y2=(px(bottom)) {}
        text class="label" x=(px((LEFT + right) / 2.0)) y=(px(bottom + 28.0)) text-anchor="middle" { (x_label) }
        text class="label" transform=(format!("translate(12 {}) rotate(-90)", px((TOP + bottom) / 2.0))) text-anchor="middle" { (y_label) }
    }
}

/// Names of the curves, in a row under the picture.
fn legend(curves: &[Curve]) -> Markup {
    let named: Vec<&Curve> = curves.iter().filter(|c| !c.name.is_empty()).collect();
    let mut left = LEFT;
    let places: Vec<(f64, &Curve)> = named
        .into_iter()
        .map(|curve| {
            let at = left;
            // Text has no measured width here: 5.8 units per letter is a
            // generous estimate.
            left += 26.0 + 5.8 * curve.name.chars().count() as f64;
            (at, curve)
        })
        .collect();
    let y = HEIGHT - 9.0;
    html! {
        @for (at, curve) in places {
            line class={ "curve " (curve.class) } x1=(px(at)) x2=(px(at + 14.0)) y1=(px(y)) y2=(px(y)) {}
            text class="word" x=(px(at + 18.0)) y=(px(y + 3.5)) { (curve.name) }
        }
    }
}

/// Cell of a heat map.
pub(super) struct HeatMapCell {
    /// Column and row, from the lower left.
    pub at: (usize, usize),
    /// Share shown by colour, in 0 ..= 1. `None` is unknown.
    pub share: Option<f64>,
    /// Second share, shown as a ring.
    pub dot: f64,
    /// Tooltip, and words of a slider.
    pub about: String,
    /// Words in a table.
    pub short: String,
}

/// Shares over two quantities.
pub(super) struct HeatMap {
    /// Title above the picture.
    pub title: String,
    /// Name, unit and range of the horizontal quantity.
    pub x: (String, f64, f64),
    /// Name, unit and range of the vertical quantity.
    pub y: (String, f64, f64),
    /// Numbers of columns and rows.
    pub size: (usize, usize),
    /// All cells.
    pub cells: Vec<HeatMapCell>,
    /// Meaning of the colour, and of a ring of 25 %.
    pub shares: (String, String),
}

/// Picture of a heat map.
pub(super) fn heat_map(map: &HeatMap) -> Markup {
    let (x, y) = frame((map.x.1, map.x.2), (map.y.1, map.y.2));
    let width = (x.to - x.from) / map.size.0 as f64;
    let height = (y.from - y.to) / map.size.1 as f64;
    svg(
        &map.title,
        html! {
            rect class="empty" x=(px(LEFT)) y=(px(TOP)) width=(px(x.to - x.from)) height=(px(y.from - y.to)) {}
            (grid(&x, &y, &map.x.0, &map.y.0))
            @for cell in &map.cells {
                @let (left, top) = (x.from + width * cell.at.0 as f64, y.from - height * (cell.at.1 + 1) as f64);
                g data-cell=(format!("{},{}", cell.at.0, cell.at.1)) {
                    title { (cell.about) }
                    rect class=(if cell.share.is_some() { "held" } else { "empty" }) x=(px(left)) y=(px(top)) width=(px(width - 0.6)) height=(px(height - 0.6)) {}
                    @match cell.share {
                        Some(share) => { rect class="hot" x=(px(left)) y=(px(top)) width=(px(width - 0.6)) height=(px(height - 0.6)) fill-opacity=(format!("{share:.2}")) {} }
                        None => { text class="unknown" x=(px(left + width / 2.0)) y=(px(top + height / 2.0 + 3.5)) text-anchor="middle" { "?" } }
                    }
                    // The area is the share, so the radius is its root.
                    @if cell.dot > 0.0 {
                        circle class="foul" cx=(px(left + width / 2.0)) cy=(px(top + height / 2.0)) r=(px(0.45 * width.min(height) * cell.dot.sqrt())) {}
                    }
                }
            }
            (scale(&map.shares, 0.45 * width.min(height)))
        },
    )
}

/// Legend of a heat map's colours and rings.
///
/// A ring of 100 % has the radius `whole`, and its area is the share.
fn scale((hot, ring): &(String, String), whole: f64) -> Markup {
    // Swatches follow the estimated width of the word before them.
    let y = HEIGHT - 16.0;
    let swatch = |nth: usize| LEFT + 5.4 * hot.chars().count() as f64 + 6.0 + 34.0 * nth as f64;
    let after = swatch(5) + 20.0;
    html! {
        text class="word" x=(px(LEFT)) y=(px(y + 9.5)) { (hot) }
        @for nth in 0..5 {
            rect class="held" x=(px(swatch(nth))) y=(px(y)) width="34" height="13" {}
            rect class="hot" x=(px(swatch(nth))) y=(px(y)) width="34" height="13" fill-opacity=(format!("{:.2}", 0.25 * nth as f64)) {}
            text class=(if nth < 3 { "number" } else { "number on-hot" }) x=(px(swatch(nth) + 17.0)) y=(px(y + 9.5)) text-anchor="middle" { (25 * nth) " %" }
        }
        circle class="foul" cx=(px(after)) cy=(px(y + 6.5)) r=(px(0.5 * whole)) {}
        text class="word" x=(px(after + 0.5 * whole + 4.0)) y=(px(y + 9.5)) { (ring) }
    }
}

/// Distribution of values.
pub(super) struct Histogram {
    /// Title above the picture.
    pub title: String,
    /// Quantity and unit.
    pub x_label: String,
    /// Name of the counted items.
    pub y_label: String,
    /// Values to count.
    pub values: Vec<f64>,
    /// Wanted number of bars.
    pub bars: usize,
}

/// Picture of a histogram. Values below 0 have the colour of failures.
pub(super) fn histogram(histogram: &Histogram) -> Markup {
    let finite = || histogram.values.iter().copied().filter(|v| v.is_finite());
    let (lo, hi) = span(finite());
    // Zero is an edge, so that no bar holds both signs.
    let step = (hi - lo) / histogram.bars.max(1) as f64;
    // Bars are numbered from 0, on both sides of it.
    let (first, last) = (libm::floor(lo / step) as i64, libm::floor(hi / step) as i64);
    let mut counts = vec![0usize; (last - first + 1).max(1) as usize];
    for value in finite() {
        // The clamp is for rounding at the outermost edges.
        let bar = (libm::floor(value / step) as i64 - first).clamp(0, last - first);
        counts[bar as usize] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(1).max(1);
    let ends = (first as f64 * step, (last + 1) as f64 * step);
    // Five percent of room above the tallest bar.
    let (x, y) = frame(ends, (0.0, 1.05 * most as f64));
    let bar = |i: usize| (first + i as i64) as f64 * step;
    svg(
        &histogram.title,
        html! {
            (grid(&x, &y, &histogram.x_label, &histogram.y_label))
            @for (i, count) in counts.iter().enumerate().filter(|(_, count)| 0 < **count) {
                @let (left, right) = (x.at(bar(i)), x.at(bar(i + 1)));
                rect class=(if bar(i) < 0.0 { "bar bad" } else { "bar good" }) x=(px(left)) y=(px(y.at(*count as f64))) width=(px((right - left - 0.5).max(0.5))) height=(px(y.from - y.at(*count as f64))) {
                    title { (format!("{:.3} to {:.3}: {count}", bar(i), bar(i + 1))) }
                }
            }
        },
    )
}
