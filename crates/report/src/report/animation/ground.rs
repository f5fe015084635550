//! Static parts of a picture: road and markings, the cells of a grid, and lights.

use maud::{Markup, html};

use super::film_tracks::FilmTracks;
use super::write::n;
use crate::ego::Phase;
use crate::experiment::phase_word;
use crate::scene::ground::{GroundPoint, along, beside, distance, near, reach};
use crate::scene::{Frame, SceneGeometry};

/// Distance in metres beyond the bodies' paths up to which the ground is drawn.
const MARGIN_M: f64 = 120.0;
/// Distance of the posts from the road and from each other, in metres.
const POST_M: f64 = 0.9;
const POSTS_APART_M: f64 = 10.0;
/// Radius of a light's lamp, from which its housing is sized.
const LAMP_M: f64 = 0.42;
/// Width in metres of the stripe at a kerb that does not count as road.
///
/// Two roads side by side share a kerb, which stays.
const KERB_M: f64 = 0.1;
/// Greatest error of a cut in metres.
const STEP_M: f64 = 0.2;

/// Roads with bodies on them, the world's own road on top.
///
/// Kerbs and posts are left out where another road passes, and the lines of a side road
/// where any other road does.
pub(super) fn road<'a>(
    stage: &SceneGeometry,
    frames: impl IntoIterator<Item = &'a Frame>,
) -> Markup {
    let reach = reach(frames, MARGIN_M);
    // The last road is the world's own, which lies on top.
    let roads: Vec<Vec<Vec<GroundPoint>>> = stage
        .side_roads_m
        .iter()
        .chain(std::iter::once(&stage.lane_borders_m))
        .map(|road| near(road, &reach))
        .filter(|road| !road.is_empty())
        .collect();
    html! {
        @for road in &roads { (asphalt(road)) }
        @for nth in 0..roads.len() { (markings(&roads, nth)) }
    }
}

fn asphalt(borders: &[Vec<GroundPoint>]) -> Markup {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return html! {};
    };
    // One closed outline: along the right border and back along the left one.
    let outline: Vec<GroundPoint> = right.iter().chain(left.iter().rev()).copied().collect();
    html! { polygon class="asphalt" points=(points(&outline)) {} }
}

/// Kerbs, lane lines and posts of one of the roads.
fn markings(roads: &[Vec<Vec<GroundPoint>>], own: usize) -> Markup {
    let borders = &roads[own];
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return html! {};
    };
    let others: Vec<&Vec<Vec<GroundPoint>>> = (0..roads.len())
        .filter(|other| *other != own)
        .map(|other| &roads[other])
        .collect();
    let on_other = |place: GroundPoint| others.iter().any(|other| is_on(other, place));
    let last = borders.len() - 1;
    let is_main = own + 1 == roads.len();
    let posts = along(&beside(right, left, -POST_M), POSTS_APART_M);
    html! {
        @for (nth, border) in borders.iter().enumerate() {
            @let is_kerb = nth == 0 || nth == last;
            @if is_main && !is_kerb {
                polyline class="dashes" points=(points(border)) {}
            } @else {
                @for part in parts(border, on_other) {
                    polyline class=(if is_kerb { "edge" } else { "dashes" }) points=(points(&part)) {}
                }
            }
        }
        @for [x, y, z] in posts {
            @if !on_other([x, y, z]) { circle class="post" cx=(n(x, 2)) cy=(n(y, 2)) r="0.18" {} }
        }
    }
}

/// True on the asphalt of a road. Its kerbs themselves are not on it.
///
/// Points of equal index lie across the road from each other, so two neighbouring
/// stations enclose a quadrilateral.
fn is_on(borders: &[Vec<GroundPoint>], [x, y, _]: GroundPoint) -> bool {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return false;
    };
    // Distance to the left of a line, with its sign.
    let left_of_m = |from: GroundPoint, to: GroundPoint| {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        (dx * (y - from[1]) - dy * (x - from[0])) / libm::hypot(dx, dy).max(1e-9)
    };
    right.windows(2).zip(left.windows(2)).any(|(r, l)| {
        // The seam of two stations belongs to both.
        left_of_m(r[0], r[1]) > KERB_M
            && left_of_m(l[0], l[1]) < -KERB_M
            && left_of_m(r[0], l[0]) <= 0.0
            && left_of_m(r[1], l[1]) >= 0.0
    })
}

/// Parts of a line outside of a region, cut to `STEP_M`.
fn parts(line: &[GroundPoint], is_inside: impl Fn(GroundPoint) -> bool) -> Vec<Vec<GroundPoint>> {
    let mut parts = Vec::new();
    let mut part: Vec<GroundPoint> = Vec::new();
    for (nth, pair) in line.windows(2).enumerate() {
        let length_m = distance(pair[0], pair[1]);
        let steps = (length_m / STEP_M).ceil().max(1.0) as usize;
        // The end of a segment is the beginning of the next one.
        let from = usize::from(nth > 0);
        for step in from..=steps {
            let share = step as f64 / steps as f64;
            let place =
                [0, 1, 2].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]));
            // An empty part is dropped below, so stretches within the region
            // cost nothing.
            if is_inside(place) {
                parts.push(std::mem::take(&mut part));
                continue;
            }
            // Points between two corners of the line are not needed.
            let between = part.len() > 1 && step > 1;
            if between {
                part.pop();
            }
            part.push(place);
        }
    }
    parts.push(part);
    // A single point is no line.
    parts.retain(|part| part.len() > 1);
    parts
}

/// Cells of a grid.
pub(super) fn cells(stage: &SceneGeometry) -> Markup {
    let lines = &stage.lane_borders_m;
    let size = lines
        .iter()
        .flatten()
        .map(|point| point[0])
        .fold(0.0, f64::max);
    html! {
        rect class="asphalt" width=(n(size, 2)) height=(n(size, 2)) {}
        @for line in lines { polyline class="cells" points=(points(line)) {} }
        rect class="wall" width=(n(size, 2)) height=(n(size, 2)) {}
    }
}

/// Stop line and lamps of every light, in the given phases.
pub(super) fn lights(stage: &SceneGeometry, phases: &[Phase]) -> Markup {
    html! {
        @for (light, phase) in stage.lights.iter().zip(phases) {
            @let [right, left] = light.stop_line_m;
            @let turn_rad = libm::atan2(left[1] - right[1], left[0] - right[0]) - std::f64::consts::FRAC_PI_2;
            g class={ "light is-" (phase_word(*phase)) } {
                line class="stop" x1=(n(right[0], 2)) y1=(n(right[1], 2)) x2=(n(left[0], 2)) y2=(n(left[1], 2)) {}
                g transform=(format!("translate({} {}) rotate({})", n(left[0], 2), n(left[1], 2), n(turn_rad.to_degrees(), 2))) {
                    rect class="housing" x=(n(-3.6 * LAMP_M, 3)) y="0.35" width=(n(7.2 * LAMP_M, 3)) height=(n(2.6 * LAMP_M, 3)) rx="0.2" {}
                    @for (nth, phase) in [Phase::Red, Phase::Yellow, Phase::Green].into_iter().enumerate() {
                        circle class={ "lit-" (phase_word(phase)) } cx=(n((nth as f64 - 1.0) * 2.3 * LAMP_M, 3)) cy=(n(0.35 + 1.3 * LAMP_M, 3)) r=(n(LAMP_M, 3)) {}
                    }
                }
            }
        }
    }
}

/// Paths of all agents, from the first sample to the last.
pub(super) fn trails(film: &FilmTracks, classes: &[String]) -> Markup {
    html! {
        @for (track, class) in film.tracks.iter().zip(classes) {
            @let way: Vec<GroundPoint> = track.x_m.iter().zip(&track.y_m).step_by(4).map(|(x, y)| [*x, *y, 0.0]).collect();
            polyline class={ "trail " (class) } points=(points(&way)) {}
        }
    }
}

fn points(line: &[GroundPoint]) -> String {
    let points = line
        .iter()
        .map(|[x, y, _]| format!("{},{}", n(*x, 2), n(*y, 2)));
    points.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Borders of a straight road of one lane from one end to the other.
    fn straight(from: [f64; 2], to: [f64; 2], half_m: f64) -> Vec<Vec<GroundPoint>> {
        let length_m = libm::hypot(to[0] - from[0], to[1] - from[1]);
        let left = [-(to[1] - from[1]) / length_m, (to[0] - from[0]) / length_m];
        let border = |side_m: f64| {
            [from, to]
                .map(|[x, y]| [x + side_m * left[0], y + side_m * left[1], 0.0])
                .to_vec()
        };
        vec![border(-half_m), border(half_m)]
    }

    #[test]
    fn a_kerb_ends_at_a_side_road_and_begins_behind_it() {
        let side = straight([50.0, -40.0], [50.0, 40.0], 2.0);
        let main = straight([0.0, 0.0], [100.0, 0.0], 3.0);
        let kept = parts(&main[0], |place| is_on(&side, place));
        assert_eq!(kept.len(), 2);
        let (end, begin) = (kept[0][kept[0].len() - 1], kept[1][0]);
        assert!((end[0] - 48.0).abs() < 0.3 && (begin[0] - 52.0).abs() < 0.3);
        assert_eq!((kept[0][0][0], kept[1][kept[1].len() - 1][0]), (0.0, 100.0));
        // Neither half has needless points.
        assert!(kept.iter().all(|part| part.len() == 2), "{kept:?}");
    }

    #[test]
    fn a_kerb_beside_another_road_stays() {
        let one = straight([0.0, 0.0], [100.0, 0.0], 2.0);
        let other = straight([100.0, 4.0], [0.0, 4.0], 2.0);
        let kept = parts(&one[1], |place| is_on(&other, place));
        assert_eq!(kept, [one[1].clone()]);
        assert!(is_on(&other, [50.0, 4.0, 0.0]) && !is_on(&other, [50.0, 0.0, 0.0]));
    }
}
