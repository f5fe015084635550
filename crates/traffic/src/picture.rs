//! Pictures of recordings from above, as SVG.

use std::collections::BTreeMap;

use crate::analysis::Analysis;
use crate::crossings::corners_m;
use crate::lane_frame::Carriageway;
use crate::recording::{Class, RoadUserTrack};
use crate::svg::{LINE_PX, SvgCanvas, WIDTH_PX, colour, distance_px, text_px};

/// Margin around the drawing in pixels.
const MARGIN_PX: f64 = 14.0;
/// Height of the title and of the legend in pixels.
const STRIP_PX: f64 = 30.0;
/// Width of an outermost lane's outer half, where no neighbour gives it.
const HALF_LANE_M: f64 = 1.75;
/// Crossings below this time are marked.
const CLOSE_PET_S: f64 = 5.0;

/// Length of the road that the picture of an instant shows, across and along.
const SIGHT_M: [f64; 2] = [120.0, 40.0];
/// Number of road users with a label, the nearest ones.
const MOST_LABELS: usize = 8;
/// Length of the drawn past in seconds.
const PAST_S: f64 = 3.0;

const BORDER: &str = "stroke:#adb5bd;stroke-width:0.8";

/// Draws a recording from above: fitted lanes, all tracks and the closest crossings.
///
/// North is up if the first axis of the recording points to the east.
pub fn svg_overview(analysis: &Analysis) -> String {
    let recording = &analysis.recording;
    let (low_m, high_m) = extent_m(&recording.tracks);
    let wide_px = WIDTH_PX - 2.0 * MARGIN_PX;
    // At most square, and at least a quarter as high as wide.
    let size_m = [0, 1].map(|axis| (high_m[axis] - low_m[axis]).max(1.0));
    let px_per_m = (wide_px / size_m[0]).min(wide_px / size_m[1]);
    let drawn_px = (size_m[1] * px_per_m + 2.0 * MARGIN_PX).max(0.25 * WIDTH_PX);
    let centre_m = [0, 1].map(|axis| 0.5 * (low_m[axis] + high_m[axis]));
    let strips_px = [STRIP_PX, STRIP_PX];
    let mut canvas = SvgCanvas::new(centre_m, 0.0, px_per_m, [WIDTH_PX, drawn_px], strips_px);
    // Borders first, since SVG paints in document order and the tracks belong
    // on top.
    for carriageway in &analysis.frame.carriageways {
        draw_borders(&mut canvas, carriageway);
    }
    // Ordered, so that the legend of equal recordings is equal byte by byte.
    let mut counts: BTreeMap<Class, usize> = BTreeMap::new();
    for track in &recording.tracks {
        *counts.entry(track.class).or_default() += 1;
        let points = track.x_m.iter().zip(&track.y_m).map(|(x, y)| [*x, *y]);
        let colour = colour(track.class);
        // Translucent, so that the density of overlapping tracks is visible.
        let style = format!("stroke:{colour};stroke-width:0.8;stroke-opacity:0.35");
        canvas.line(points, &style);
    }
    let close = analysis
        .crossings
        .iter()
        .filter(|it| it.pet_s() < CLOSE_PET_S);
    let circles = match close.clone().count() {
        0 => String::new(),
        count => format!(", circles: {count} crossings with a PET below {CLOSE_PET_S} s"),
    };
    // After the tracks, which would otherwise hide the circles.
    for crossing in close {
        let style = "fill:none;stroke:#e03131;stroke-width:1.5";
        canvas.circle(crossing.point_m, 5.0, style);
    }
    canvas.scale();
    let legend: Vec<(Class, String)> = counts
        .iter()
        .map(|(class, count)| (*class, format!("{count} {}", class.name())))
        .collect();
    canvas.legend(&legend);
    canvas.finish(&format!(
        "{}: {} road users in {:.0} s{circles}",
        recording.name,
        recording.road_users(),
        recording.duration_s()
    ))
}

/// Draws an instant from above, with a road user in the middle that heads to the right.
///
/// The picture shows 120 m × 40 m of the road with lanes, boxes, the last 3 s and labels
/// of the nearest road users. A label lies outside of the drawing, and its line passes no other box. `sample` counts
/// from the recording's start. Returns `None` if the track has no such sample.
pub fn svg_instant(
    analysis: &Analysis,
    track: usize,
    sample: usize,
    title: &str,
) -> Option<String> {
    let recording = &analysis.recording;
    let own = recording.tracks.get(track)?;
    let at = sample
        .checked_sub(own.first_sample)
        .filter(|at| *at < own.len())?;
    let centre_m = [own.x_m[at], own.y_m[at]];
    let px_per_m = WIDTH_PX / SIGHT_M[0];
    let size_px = [WIDTH_PX, SIGHT_M[1] * px_per_m];
    // Labels are in two rows above and below the drawing.
    let (top_px, bottom_px) = (STRIP_PX + 2.0 * LINE_PX, STRIP_PX + 2.0 * LINE_PX);
    let angle_rad = own.heading_rad[at];
    let mut canvas = SvgCanvas::new(centre_m, angle_rad, px_per_m, size_px, [top_px, bottom_px]);
    // The nearest come first, so that they get the labels when there are too
    // many.
    let mut shown = shown(analysis, centre_m, sample);
    let lower_px = top_px + size_px[1];
    // A box that is cut by the upper or lower edge would reach into the
    // labels.
    shown.retain(|i| {
        let user = &recording.tracks[*i];
        let corners = corners_m(user, sample - user.first_sample).map(|it| canvas.place_px(it));
        let is_level = corners.iter().all(|it| (top_px..lower_px).contains(&it[1]));
        is_level && corners.iter().any(|it| (0.0..WIDTH_PX).contains(&it[0]))
    });
    for carriageway in &analysis.frame.carriageways {
        draw_near_borders(&mut canvas, carriageway, centre_m);
    }
    let mut boxes = Vec::new();
    for i in &shown {
        let user = &recording.tracks[*i];
        draw_past(&mut canvas, user, sample, recording.dt_s);
    }
    // Borders and pasts run beyond the drawing. The cover hides them where the
    // labels are written.
    canvas.cover(top_px, lower_px);
    for i in &shown {
        let user = &recording.tracks[*i];
        let corners = corners_m(user, sample - user.first_sample);
        // Red marks the road user that the caption speaks of.
        let edge = if *i == track { "#e03131" } else { "#212529" };
        let edge_px = if *i == track { 2.0 } else { 0.8 };
        let colour = colour(user.class);
        canvas.polygon(
            &corners,
            &format!("fill:{colour};fill-opacity:0.75;stroke:{edge};stroke-width:{edge_px}"),
        );
        boxes.push(corners.map(|it| canvas.place_px(it)));
    }
    let rows_px = [
        STRIP_PX + LINE_PX - DESCENT_PX,
        STRIP_PX + 2.0 * LINE_PX - DESCENT_PX,
        lower_px + LINE_PX - DESCENT_PX,
        lower_px + 2.0 * LINE_PX - DESCENT_PX,
    ];
    let mut labels = LabelRows::new(&boxes, rows_px);
    for (k, i) in shown.iter().enumerate().take(MOST_LABELS) {
        let user = &recording.tracks[*i];
        // −0 + 0 is 0, which drops the sign.
        let speed_mps = (10.0 * user.speed_mps[sample - user.first_sample]).round() / 10.0 + 0.0;
        let text = format!(
            "{} {}, {speed_mps:.1} m/s",
            user.class.name(),
            short(&user.id)
        );
        labels.place(&mut canvas, k, &text);
    }
    canvas.scale();
    let mut classes: Vec<Class> = shown.iter().map(|i| recording.tracks[*i].class).collect();
    // Sorted first, because `dedup` removes neighbours only.
    classes.sort_unstable();
    classes.dedup();
    let entry = |class: Class| (class, class.name().to_owned());
    let legend: Vec<(Class, String)> = classes.into_iter().map(entry).collect();
    canvas.legend(&legend);
    Some(canvas.finish(title))
}

/// Returns the road users in sight, the nearest first.
fn shown(analysis: &Analysis, centre_m: [f64; 2], sample: usize) -> Vec<usize> {
    let tracks = &analysis.recording.tracks;
    let far_m = |i: usize| {
        let track = &tracks[i];
        let at = sample - track.first_sample;
        libm::hypot(track.x_m[at] - centre_m[0], track.y_m[at] - centre_m[1])
    };
    let is_there = |i: &usize| (tracks[*i].first_sample..tracks[*i].end_sample()).contains(&sample);
    let mut shown: Vec<usize> = (0..tracks.len()).filter(is_there).collect();
    shown.retain(|i| far_m(*i) < 0.5 * SIGHT_M[0]);
    // A stable sort: equal distances keep the order of the tracks.
    shown.sort_by(|a, b| far_m(*a).total_cmp(&far_m(*b)));
    shown
}

/// Returns the end of an identity.
fn short(id: &str) -> String {
    let count = id.chars().count();
    if count <= 8 {
        return id.to_owned();
    }
    let end: String = id.chars().skip(count - 6).collect();
    format!("…{end}")
}

/// Returns the smallest and the largest coordinates of all tracks.
fn extent_m(tracks: &[RoadUserTrack]) -> ([f64; 2], [f64; 2]) {
    let low = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = |values: &[f64]| values.iter().copied().fold(-f64::INFINITY, f64::max);
    let mut extent = ([f64::INFINITY; 2], [-f64::INFINITY; 2]);
    for track in tracks {
        for (axis, values) in [&track.x_m, &track.y_m].into_iter().enumerate() {
            extent.0[axis] = extent.0[axis].min(low(values));
            extent.1[axis] = extent.1[axis].max(high(values));
        }
    }
    // Infinite bounds would write NaN into the SVG.
    if tracks.is_empty() {
        return ([0.0; 2], [1.0; 2]);
    }
    extent
}

/// Returns the offsets of the borders of a carriageway's lanes, from right to left.
fn borders_m(carriageway: &Carriageway) -> Vec<f64> {
    let middles: Vec<f64> = carriageway.lanes.iter().map(|it| it.offset_m).collect();
    let (Some(right), Some(left)) = (middles.first(), middles.last()) else {
        return Vec::new();
    };
    // A border lies halfway between two lanes, as no border is recorded.
    let inner = middles.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    let mut all = vec![right - HALF_LANE_M];
    all.extend(inner);
    all.push(left + HALF_LANE_M);
    all
}

fn draw_borders(canvas: &mut SvgCanvas, carriageway: &Carriageway) {
    for offset_m in borders_m(carriageway) {
        if let Some(border) = carriageway.path.moved(|_| offset_m, 0.1) {
            canvas.line(border.points().map(|(point, _)| point), BORDER);
        }
    }
}

/// Draws the parts of the borders around a place.
fn draw_near_borders(canvas: &mut SvgCanvas, carriageway: &Carriageway, centre_m: [f64; 2]) {
    let far_m = |[x, y]: [f64; 2]| libm::hypot(x - centre_m[0], y - centre_m[1]);
    for offset_m in borders_m(carriageway) {
        let Some(border) = carriageway.path.moved(|_| offset_m, 0.1) else {
            continue;
        };
        let points: Vec<[f64; 2]> = border.points().map(|(point, _)| point).collect();
        let is_near = |it: &[f64; 2]| far_m(*it) < SIGHT_M[0];
        // A bend may leave the surroundings and return, which gives several
        // parts.
        for part in points.chunk_by(|a, b| is_near(a) == is_near(b)) {
            if is_near(&part[0]) {
                canvas.line(part.iter().copied(), BORDER);
            }
        }
    }
}

fn draw_past(canvas: &mut SvgCanvas, user: &RoadUserTrack, sample: usize, dt_s: f64) {
    let at = sample - user.first_sample;
    // A track that begins later than that has a shorter past.
    let from = at.saturating_sub((PAST_S / dt_s).round() as usize);
    let points = (from..=at).map(|i| [user.x_m[i], user.y_m[i]]);
    let colour = colour(user.class);
    let style = format!("stroke:{colour};stroke-dasharray:2 3");
    canvas.line(points, &style);
}

/// Corners of a box or a label in pixels.
type CornersPx = [[f64; 2]; 4];

/// Rows of labels with lines to their boxes.
struct LabelRows<'a> {
    boxes: &'a [CornersPx],
    rows_px: [f64; 4],
    labels: Vec<CornersPx>,
    lines: Vec<[[f64; 2]; 2]>,
}

impl LabelRows<'_> {
    fn new(boxes: &[CornersPx], rows_px: [f64; 4]) -> LabelRows<'_> {
        LabelRows {
            boxes,
            rows_px,
            labels: Vec::new(),
            lines: Vec::new(),
        }
    }

    /// Places a label where its line is shortest, or nowhere if no place is free.
    fn place(&mut self, canvas: &mut SvgCanvas, own: usize, text: &str) {
        let wide_px = text_px(text);
        // Places are 10 px apart, which is fine enough and keeps the search
        // short.
        let most = ((WIDTH_PX - wide_px - 2.0 * MARGIN_PX) / 10.0).max(0.0) as usize;
        let mut best: Option<(f64, CornersPx, [[f64; 2]; 2])> = None;
        for base_px in self.rows_px {
            for left in (0..=most).map(|k| MARGIN_PX + 10.0 * k as f64) {
                let label = label_px([left, base_px], wide_px);
                let Some(line) = self.line(own, &label) else {
                    continue;
                };
                let far = libm::hypot(line[0][0] - line[1][0], line[0][1] - line[1][1]);
                // Strictly nearer, so that the first place wins a tie and
                // pictures are reproducible.
                if best.as_ref().is_none_or(|it| far < it.0) {
                    best = Some((far, label, line));
                }
            }
        }
        let Some((_, label, line)) = best else {
            return;
        };
        canvas.segment(line[0], line[1], "stroke:#495057;stroke-width:0.7");
        canvas.text([label[0][0], label[2][1] - DESCENT_PX], text);
        self.labels.push(label);
        self.lines.push(line);
    }

    /// Returns the line of a label, `None` if it or the label covers anything.
    fn line(&self, own: usize, label: &CornersPx) -> Option<[[f64; 2]; 2]> {
        let (left, right) = (label[0][0], label[1][0]);
        let is_beside = |other: &CornersPx| {
            // Labels of one row share its baseline exactly, so equality is
            // safe here.
            let is_other_row = other[0][1] != label[0][1];
            is_other_row || right + 8.0 < other[0][0] || other[1][0] + 8.0 < left
        };
        if !self.labels.iter().all(is_beside) {
            return None;
        }
        let corners = &self.boxes[own];
        let middle = [0, 1].map(|axis| corners.iter().map(|it| it[axis]).sum::<f64>() / 4.0);
        let is_above = label[2][1] < middle[1];
        let end_y = if is_above { label[2][1] } else { label[0][1] };
        // The nearest point of the label's edge gives the shortest and
        // steepest line.
        let end = [middle[0].clamp(left, right), end_y];
        let line = [edge(corners, middle, end), end];
        let others = self.boxes.iter().enumerate().filter(|(i, _)| *i != own);
        let passes_all = others
            .map(|(_, it)| it)
            .chain(&self.labels)
            .all(|it| !is_over(line, it));
        let is_apart = |it: &[[f64; 2]; 2]| !do_cross(line, *it) && !is_over(*it, label);
        (passes_all && self.lines.iter().all(is_apart)).then_some(line)
    }
}

/// Height of a text's letters below its baseline.
const DESCENT_PX: f64 = 3.0;

/// Returns the corners of a label whose text begins at a pixel, the upper left one first.
fn label_px([left, base]: [f64; 2], wide_px: f64) -> CornersPx {
    let (top, bottom) = (base + DESCENT_PX - LINE_PX, base + DESCENT_PX);
    let right = left + wide_px;
    [[left, top], [right, top], [right, bottom], [left, bottom]]
}

/// Returns true if a line crosses a box, or nearly touches one of its corners.
fn is_over(line: [[f64; 2]; 2], corners: &CornersPx) -> bool {
    (0..4).any(|i| {
        // A line closer than its width and the edge of a box reads as
        // touching.
        let is_near = distance_px(corners[i], line[0], line[1]) < 2.5;
        is_near || do_cross(line, [corners[i], corners[(i + 1) % 4]])
    })
}

/// Returns the point at which a line from the middle of a box to `end` leaves the box.
fn edge(corners: &CornersPx, middle: [f64; 2], end: [f64; 2]) -> [f64; 2] {
    let (dx, dy) = (end[0] - middle[0], end[1] - middle[1]);
    let shares = (0..4).filter_map(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let (ex, ey) = (b[0] - a[0], b[1] - a[1]);
        let cross = dx * ey - dy * ex;
        let (ox, oy) = (a[0] - middle[0], a[1] - middle[1]);
        let (share, along) = ((ox * ey - oy * ex) / cross, (ox * dy - oy * dx) / cross);
        let is_there = (0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&along);
        is_there.then_some(share)
    });
    // Parallel edges give an infinite or NaN share, which the ranges above
    // reject.
    let share = shares.fold(0.0, f64::max);
    [middle[0] + share * dx, middle[1] + share * dy]
}

/// Returns true if two pieces of lines cross.
fn do_cross([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> bool {
    let side = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    // Zero included: a line that ends on another one counts as a crossing.
    side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
}
