//! Static parts of a picture: road and markings, the cells of a grid, and lights.

use maud::{Markup, html};

use super::episode_frames::EpisodeFrames;
use super::write::n;
use crate::ego::Phase;
use crate::scene::ground::{GroundPoint, along, beside, near, reach};
use crate::scene::{Frame, SceneGeometry};

/// Distance in metres beyond the bodies' paths up to which the ground is drawn.
const MARGIN_M: f64 = 120.0;
/// Distance of the posts from the road and from each other, in metres.
const POST_M: f64 = 0.9;
const POSTS_APART_M: f64 = 10.0;
/// Radius of a light's lamp, from which its housing is sized.
const LAMP_M: f64 = 0.42;

/// Roads with bodies on them, the world's own road on top.
pub(super) fn road<'a>(
    stage: &SceneGeometry,
    frames: impl IntoIterator<Item = &'a Frame>,
) -> Markup {
    let reach = reach(frames, MARGIN_M);
    html! {
        @for side in &stage.side_roads_m { (one_road(&near(side, &reach))) }
        (one_road(&near(&stage.lane_borders_m, &reach)))
    }
}

fn one_road(borders: &[Vec<GroundPoint>]) -> Markup {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return html! {};
    };
    // One closed outline: along the right border and back along the left one.
    let outline: Vec<GroundPoint> = right.iter().chain(left.iter().rev()).copied().collect();
    let last = borders.len() - 1;
    let verge = beside(right, left, -POST_M);
    html! {
        polygon class="asphalt" points=(points(&outline)) {}
        @for (nth, border) in borders.iter().enumerate() {
            polyline class=(if nth == 0 || nth == last { "edge" } else { "dashes" }) points=(points(border)) {}
        }
        @for [x, y, _] in along(&verge, POSTS_APART_M) { circle class="post" cx=(n(x, 2)) cy=(n(y, 2)) r="0.18" {} }
    }
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
pub(super) fn trails(film: &EpisodeFrames, classes: &[String]) -> Markup {
    html! {
        @for (track, class) in film.tracks.iter().zip(classes) {
            @let way: Vec<GroundPoint> = track.x_m.iter().zip(&track.y_m).step_by(4).map(|(x, y)| [*x, *y, 0.0]).collect();
            polyline class={ "trail " (class) } points=(points(&way)) {}
        }
    }
}

/// Word for a phase.
pub(super) fn phase_word(phase: Phase) -> &'static str {
    match phase {
        Phase::Green => "green",
        Phase::Yellow => "yellow",
        Phase::Red => "red",
    }
}

fn points(line: &[GroundPoint]) -> String {
    let points = line
        .iter()
        .map(|[x, y, _]| format!("{},{}", n(*x, 2), n(*y, 2)));
    points.collect::<Vec<_>>().join(" ")
}
