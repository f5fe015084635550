//! Labels with names and actions, placed beside the bodies on free space.

use super::camera::Camera;
use super::episode_frames::{EpisodeFrames, ego_of};
use super::moves::Move;
use super::write::n;
use crate::scene::SceneGeometry;

/// Width of a letter, height of a line and padding. play.js uses the same numbers.
const LETTER_PX: f64 = 7.4;
const LINE_PX: f64 = 15.0;
const ROOM_PX: f64 = 6.0;
/// Height at the top that clock and event occupy.
const HEAD_PX: f64 = 28.0;
/// Acceleration in m/s² below which a label mentions no speed change.
const CLEAR_MPS2: f64 = 0.5;

/// Label with its upper left corner and its size.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlacedLabel {
    pub lines: Vec<String>,
    pub at_px: [f64; 2],
    pub size_px: [f64; 2],
}

/// Rectangle: left, top, right, bottom.
type PixelRectangle = [f64; 4];

/// Labels of all agents at a sample.
pub(super) fn labels(
    stage: &SceneGeometry,
    film: &EpisodeFrames,
    i: usize,
    (camera, moves): (&Camera<'_>, &[(String, Vec<Move>)]),
) -> Vec<PlacedLabel> {
    let rooms: Vec<PixelRectangle> = (0..stage.agents.len())
        .map(|who| {
            let track = &film.tracks[who];
            let [x, y] = camera.at(film.turned(track.x_m[i], track.y_m[i]));
            let half = film.half_room(stage.agents[who].size_m, who, i);
            let [w, h] = half.map(|half_m| half_m * camera.scale);
            [x - w, y - h, x + w, y + h]
        })
        .collect();
    // Bodies are obstacles as well as the labels that are already placed.
    let mut taken: Vec<PixelRectangle> = rooms.clone();
    let mut labels = Vec::new();
    for (who, room) in rooms.iter().enumerate() {
        let lines = lines(stage, film, (who, i), moves, is_inside(room, camera));
        let label = placed(lines, room, who == ego_of(stage), &taken, camera);
        let ([x, y], [w, h]) = (label.at_px, label.size_px);
        taken.push([x, y, x + w, y + h]);
        labels.push(label);
    }
    labels
}

/// Lines of a label: name and speed, then the chosen or the measured action.
fn lines(
    stage: &SceneGeometry,
    film: &EpisodeFrames,
    (who, i): (usize, usize),
    moves: &[(String, Vec<Move>)],
    inside: bool,
) -> Vec<String> {
    let name = &stage.agents[who].name;
    if stage.agents[who].body == "cell" {
        return vec![name.clone()];
    }
    let track = &film.tracks[who];
    // Outside of the picture, the distance to the ego is the useful number.
    if !inside {
        let own = &film.tracks[ego_of(stage)];
        let apart_m = libm::hypot(own.x_m[i] - track.x_m[i], own.y_m[i] - track.y_m[i]);
        return vec![format!("{name}, {apart_m:.0} m away")];
    }
    let speed = format!("{name} {:.1} m/s", track.speed_mps[i]);
    let chosen = moves.iter().find(|(ado, _)| ado == name);
    let time_s = film.times_s[i];
    let chosen = chosen.and_then(|(_, moves)| {
        // The last move that has begun, with a tolerance for rounded times.
        let now = moves.iter().rev().find(|it| it.from_s < time_s + 1e-9);
        now.map(|it| it.words.clone())
    });
    let accel_mps2 = track.accel_mps2[i];
    let done = match accel_mps2 {
        a if a < -CLEAR_MPS2 => Some(format!("brakes −{:.1} m/s²", -a)),
        a if CLEAR_MPS2 < a => Some(format!("speeds up +{a:.1} m/s²")),
        _ => None,
    };
    std::iter::once(speed).chain(chosen.or(done)).collect()
}

fn is_inside(room: &PixelRectangle, camera: &Camera<'_>) -> bool {
    let [width_px, height_px] = camera.canvas.size_px;
    0.0 < room[2] && room[0] < width_px && 0.0 < room[3] && room[1] < height_px
}

/// Label at the first free position.
///
/// The ego's label is preferably below it, and other labels above. Positions on
/// the other side, ahead and behind follow.
fn placed(
    lines: Vec<String>,
    body: &PixelRectangle,
    is_ego: bool,
    taken: &[PixelRectangle],
    camera: &Camera<'_>,
) -> PlacedLabel {
    let letters = lines.iter().map(|line| line.chars().count()).max();
    let w = LETTER_PX * letters.unwrap_or(0) as f64 + 2.0 * ROOM_PX;
    let h = LINE_PX * lines.len() as f64 + ROOM_PX;
    let [width_px, height_px] = camera.canvas.size_px;
    let bottom_px = height_px - camera.canvas.foot_px;
    let x = 0.5 * (body[0] + body[2] - w);
    let (above, below) = ([x, body[1] - h - ROOM_PX], [x, body[3] + ROOM_PX]);
    let beside = 0.5 * (body[1] + body[3] - h);
    let (behind, ahead) = ([body[0] - w - ROOM_PX, beside], [body[2] + ROOM_PX, beside]);
    let wanted = if is_ego {
        [below, above, behind, ahead]
    } else {
        [above, below, ahead, behind]
    };
    // The second ring of positions lies one label further out.
    let far = wanted.map(|[x, y]| [x, y + (y - beside).signum() * (h + ROOM_PX)]);
    let within = |[x, y]: [f64; 2]| {
        // A tall label in a small picture may leave no room between head and
        // foot.
        let highest = HEAD_PX.min(bottom_px - h);
        [
            x.clamp(4.0, (width_px - w - 4.0).max(4.0)),
            y.clamp(highest, (bottom_px - h).max(highest)),
        ]
    };
    let is_free = |[x, y]: &[f64; 2]| {
        taken
            .iter()
            .all(|it| x + w <= it[0] || it[2] <= *x || y + h <= it[1] || it[3] <= *y)
    };
    let mut places = wanted.into_iter().chain(far).map(within);
    // Without a free position, an overlap at the preferred position is the
    // least confusing.
    let at_px = places.find(is_free).unwrap_or(within(wanted[0]));
    PlacedLabel {
        lines,
        at_px,
        size_px: [w, h],
    }
}

/// Label as SVG. play.js moves it and replaces its text.
pub(super) fn drawn(label: &PlacedLabel, class: &str) -> maud::Markup {
    let [x, y] = label.at_px;
    let [w, h] = label.size_px;
    let empty = String::new();
    let second = label.lines.get(1).unwrap_or(&empty);
    maud::html! {
        g class={ "label " (class) } transform=(format!("translate({} {})", n(x, 1), n(y, 1))) {
            rect width=(n(w, 1)) height=(n(h, 1)) rx="5" {}
            text class="who" x="6" y="14.5" { (label.lines[0]) }
            text x="6" y="29.5" { (second) }
        }
    }
}
