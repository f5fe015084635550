//! Labels with names and actions, placed beside the bodies on free space.

use super::camera::Camera;
use super::film_tracks::FilmTracks;
use super::moves::Move;
use super::write::n;
use crate::experiment::ego_of;
use crate::scene::SceneGeometry;

/// Width of a letter, height of a line and padding. play.js uses the same numbers.
const LETTER_PX: f64 = 7.4;
const LINE_PX: f64 = 15.0;
const ROOM_PX: f64 = 6.0;
/// Height at the top that clock and event occupy.
const HEAD_PX: f64 = 28.0;
/// Rings of positions around a body, positions per ring, and distance of two rings.
/// play.js uses the same numbers.
const RINGS: u32 = 14;
const RING_SPOTS: u32 = 16;
const RING_PX: f64 = 14.0;
/// Acceleration in m/s² below which a label mentions no speed change.
const CLEAR_MPS2: f64 = 0.5;

/// Label with its upper left corner and its size.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlacedLabel {
    pub lines: Vec<String>,
    pub at_px: [f64; 2],
    pub size_px: [f64; 2],
    /// Place of the body in the picture, to which the leader line goes.
    pub body_px: [f64; 2],
}

/// Rectangle: left, top, right, bottom.
type PixelRectangle = [f64; 4];

/// Content of the labels: the agents, the film and the moves of the ados.
#[derive(Clone, Copy)]
pub(super) struct LabelContent<'a> {
    pub stage: &'a SceneGeometry,
    pub film: &'a FilmTracks,
    pub moves: &'a [(String, Vec<Move>)],
}

/// Labels of all agents at a sample.
pub(super) fn labels(content: LabelContent<'_>, i: usize, camera: &Camera<'_>) -> Vec<PlacedLabel> {
    let mut over_time = labels_over_time(content, &[i], std::slice::from_ref(camera));
    over_time.pop().map_or(Vec::new(), |(labels, _)| labels)
}

/// Labels of all agents at a sample, and true for each that jumps there.
pub(super) type SampleLabels = (Vec<PlacedLabel>, Vec<bool>);

/// Labels of all agents at each of the samples, and true for each label that jumps there.
///
/// A label keeps its side of the body as long as that is free. Its size fits its
/// longest text, so no later text covers a body.
pub(super) fn labels_over_time(
    content: LabelContent<'_>,
    samples: &[usize],
    cameras: &[Camera<'_>],
) -> Vec<SampleLabels> {
    let stage = content.stage;
    let everybody = 0..stage.agents.len();
    let frames: Vec<LabelFrame> = samples
        .iter()
        .zip(cameras)
        .map(|(i, camera)| LabelFrame::of(content, *i, camera))
        .collect();
    // One size for the whole film, so that a longer text does not make a label jump.
    let sizes: Vec<[f64; 2]> = everybody
        .clone()
        .map(|who| {
            let sizes = frames.iter().map(|frame| size_of(&frame.lines[who]));
            sizes.fold([0.0; 2], |[w, h], [a, b]| [f64::max(w, a), f64::max(h, b)])
        })
        .collect();
    let ego = ego_of(stage);
    let mut sides = vec![0; stage.agents.len()];
    let placed = frames.into_iter().zip(cameras).map(|(frame, camera)| {
        // Bodies are obstacles as well as the labels that are already placed.
        let mut taken = frame.rooms.clone();
        let mut labels = Vec::new();
        let mut jumps = Vec::new();
        for (who, lines) in everybody.clone().zip(frame.lines) {
            // In the order of the cast: earlier labels have the first choice
            // of places.
            let spots = spots(&frame.rooms[who], sizes[who], who == ego, camera);
            // The side of the sample before is tried first, so that labels rest.
            let side = free_side(&spots, sizes[who], sides[who], &taken);
            jumps.push(side != sides[who]);
            sides[who] = side;
            let ([x, y], [w, h]) = (spots[side], sizes[who]);
            taken.push([x, y, x + w, y + h]);
            labels.push(PlacedLabel {
                lines,
                at_px: [x, y],
                size_px: [w, h],
                body_px: middle_in(&frame.rooms[who], camera),
            });
        }
        (labels, jumps)
    });
    placed.collect()
}

/// Rooms of the bodies in the picture at a sample, and the lines of their labels.
struct LabelFrame {
    rooms: Vec<PixelRectangle>,
    lines: Vec<Vec<String>>,
}

impl LabelFrame {
    fn of(content: LabelContent<'_>, i: usize, camera: &Camera<'_>) -> LabelFrame {
        let LabelContent { stage, film, .. } = content;
        let everybody = 0..stage.agents.len();
        let rooms: Vec<PixelRectangle> = everybody
            .clone()
            .map(|who| {
                let track = &film.tracks[who];
                let [x, y] = camera.at(film.turned(track.x_m[i], track.y_m[i]));
                let half = film.half_room(stage.agents[who].size_m, who, i);
                // The box around the turned body, because labels are not
                // turned.
                let [w, h] = half.map(|half_m| half_m * camera.scale);
                [x - w, y - h, x + w, y + h]
            })
            .collect();
        let lines = everybody.map(|who| {
            let inside = is_inside(&rooms[who], camera);
            lines(content, who, i, inside)
        });
        LabelFrame {
            lines: lines.collect(),
            rooms,
        }
    }
}

/// Lines of a label: name and speed, then the chosen or the measured action.
fn lines(content: LabelContent<'_>, who: usize, i: usize, inside: bool) -> Vec<String> {
    let LabelContent { stage, film, moves } = content;
    let name = &stage.agents[who].name;
    // Players of a grid have no speed.
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
        a if a > CLEAR_MPS2 => Some(format!("speeds up +{a:.1} m/s²")),
        _ => None,
    };
    // An ado's choice says more than the acceleration that follows from it.
    std::iter::once(speed).chain(chosen.or(done)).collect()
}

fn is_inside(room: &PixelRectangle, camera: &Camera<'_>) -> bool {
    let [width_px, height_px] = camera.canvas.size_px;
    room[2] > 0.0 && room[0] < width_px && room[3] > 0.0 && room[1] < height_px
}

/// Size of a label with these lines.
pub(super) fn size_of(lines: &[String]) -> [f64; 2] {
    let letters = lines.iter().map(|line| line.chars().count()).max();
    [
        LETTER_PX * letters.unwrap_or(0) as f64 + 2.0 * ROOM_PX,
        LINE_PX * lines.len() as f64 + ROOM_PX,
    ]
}

/// Middle of a body, moved to the edge if the body is outside of the picture.
fn middle_in(room: &PixelRectangle, camera: &Camera<'_>) -> [f64; 2] {
    let [width_px, height_px] = camera.canvas.size_px;
    let [x, y] = [0.5 * (room[0] + room[2]), 0.5 * (room[1] + room[3])];
    [x.clamp(0.0, width_px), y.clamp(0.0, height_px)]
}

/// Possible positions of a label, the preferred ones first.
///
/// The ego's label is preferably below it, and other labels above. Positions on the
/// other side, ahead and behind follow, then one label further out, then rings around
/// the body. The order is the same at every sample.
fn spots(
    body: &PixelRectangle,
    [w, h]: [f64; 2],
    is_ego: bool,
    camera: &Camera<'_>,
) -> Vec<[f64; 2]> {
    let [width_px, height_px] = camera.canvas.size_px;
    let bottom_px = height_px - camera.canvas.foot_px;
    let (x, y) = (0.5 * (body[0] + body[2] - w), 0.5 * (body[1] + body[3] - h));
    let (above, below) = ([x, body[1] - h - ROOM_PX], [x, body[3] + ROOM_PX]);
    let (behind, ahead) = ([body[0] - w - ROOM_PX, y], [body[2] + ROOM_PX, y]);
    let near = if is_ego {
        [below, above, behind, ahead]
    } else {
        [above, below, ahead, behind]
    };
    let far = near.map(|[a, b]| [a, b + (b - y).signum() * (h + ROOM_PX)]);
    let rings = (1..=RINGS).flat_map(|ring| (0..RING_SPOTS).map(move |spot| (ring, spot)));
    let around = rings.map(|(ring, spot)| {
        let out_px = RING_PX * f64::from(ring);
        let turn_rad = std::f64::consts::TAU * f64::from(spot) / f64::from(RING_SPOTS);
        let (sin, cos) = libm::sincos(turn_rad);
        let reach_px = |body_px: f64, own_px: f64| 0.5 * (body_px + own_px) + out_px;
        [
            x + cos * reach_px(body[2] - body[0], w),
            y + sin * reach_px(body[3] - body[1], h),
        ]
    });
    let within = |[a, b]: [f64; 2]| {
        // A tall label in a small picture may leave no room between head and
        // foot.
        let highest = HEAD_PX.min(bottom_px - h);
        [
            a.clamp(4.0, (width_px - w - 4.0).max(4.0)),
            b.clamp(highest, (bottom_px - h).max(highest)),
        ]
    };
    let spots = near.into_iter().chain(far).chain(around);
    spots.map(within).collect()
}

/// Index of the position to take: that of before if it is free, else the first free one.
///
/// Without a free position it is the one that covers least.
fn free_side(
    spots: &[[f64; 2]],
    [w, h]: [f64; 2],
    before: usize,
    taken: &[PixelRectangle],
) -> usize {
    let covered_px2 = |side: usize| -> f64 {
        let [x, y] = spots[side];
        let common = taken.iter().map(|it| {
            let across = (x + w).min(it[2]) - x.max(it[0]);
            let along = (y + h).min(it[3]) - y.max(it[1]);
            across.max(0.0) * along.max(0.0)
        });
        common.sum()
    };
    let mut sides = std::iter::once(before).chain(0..spots.len());
    let free = sides.find(|side| covered_px2(*side) == 0.0);
    // Every place covers something in a crowd, and a missing label would be
    // worse.
    let least = || (0..spots.len()).min_by(|a, b| covered_px2(*a).total_cmp(&covered_px2(*b)));
    free.or_else(least).unwrap_or(before)
}

impl PlacedLabel {
    /// Ends of the leader line: at the body, and at the nearest point of the label.
    pub(super) fn leader_px(&self) -> [[f64; 2]; 2] {
        let nearest = [0, 1].map(|axis| {
            let from_px = self.at_px[axis];
            self.body_px[axis].clamp(from_px, from_px + self.size_px[axis])
        });
        [self.body_px, nearest]
    }
}

/// Label as SVG. play.js moves it and replaces its text.
pub(super) fn drawn(label: &PlacedLabel, class: &str) -> maud::Markup {
    let [x, y] = label.at_px;
    let [w, h] = label.size_px;
    let empty = String::new();
    // Always two elements, because play.js replaces texts and adds none.
    let second = label.lines.get(1).unwrap_or(&empty);
    let [[body_x, body_y], [end_x, end_y]] = label.leader_px();
    maud::html! {
        g class={ "label " (class) } transform=(format!("translate({} {})", n(x, 1), n(y, 1))) {
            line class="leader" x1=(n(body_x - x, 1)) y1=(n(body_y - y, 1)) x2=(n(end_x - x, 1)) y2=(n(end_y - y, 1)) {}
            rect width=(n(w, 1)) height=(n(h, 1)) rx="5" {}
            text class="who" x="6" y="14.5" { (label.lines[0]) }
            text x="6" y="29.5" { (second) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::animation::camera::SCREEN;
    use crate::report::animation::picture::Picture;
    use crate::report::animation::tests::{crash, world};

    /// Camera without a film, which only lends its canvas.
    fn camera() -> Camera<'static> {
        Camera::still(&SCREEN)
    }

    #[test]
    fn a_label_between_bodies_goes_around_all_of_them() {
        // A row of bodies fills all near positions.
        let bodies: Vec<PixelRectangle> = (0..5)
            .map(|nth| {
                let x = 380.0 + 70.0 * f64::from(nth);
                [x, 110.0, x + 66.0, 200.0]
            })
            .collect();
        let size = [150.0, 36.0];
        let places = spots(&bodies[2], size, false, &camera());
        let mut taken = bodies.clone();
        for label in 0..4 {
            let side = free_side(&places, size, 0, &taken);
            let [x, y] = places[side];
            let own = [x, y, x + size[0], y + size[1]];
            for it in &taken {
                let apart =
                    own[2] <= it[0] || it[2] <= own[0] || own[3] <= it[1] || it[3] <= own[1];
                assert!(apart, "label {label} at {own:?} covers {it:?}");
            }
            taken.push(own);
        }
    }

    #[test]
    fn a_label_stays_on_its_side_until_that_is_taken() {
        let body = [500.0, 130.0, 566.0, 160.0];
        let size = [120.0, 36.0];
        let places = spots(&body, size, false, &camera());
        assert_eq!(free_side(&places, size, 1, &[body]), 1);
        let below = [480.0, 165.0, 600.0, 190.0];
        assert_eq!(free_side(&places, size, 1, &[body, below]), 0);
    }

    #[test]
    fn a_leader_goes_from_the_body_to_the_nearest_point_of_the_label() {
        let label = PlacedLabel {
            lines: vec!["ado".to_owned()],
            at_px: [100.0, 20.0],
            size_px: [80.0, 30.0],
            body_px: [60.0, 90.0],
        };
        assert_eq!(label.leader_px(), [[60.0, 90.0], [100.0, 50.0]]);
    }

    #[test]
    fn no_label_covers_a_body_at_any_time() {
        let acc = world(include_str!("../../../../../worlds/acc.ron"));
        let cut_in = world(include_str!("../../../../../worlds/cut_in.ron"));
        let sandwich = world(include_str!("../../../../../worlds/sandwich.ron"));
        for scenario in [acc, cut_in, sandwich] {
            let example = crash(&scenario);
            let picture = Picture::of(&scenario, &example, 0);
            let (stage, film) = (&picture.shown.stage, &picture.film);
            let samples: Vec<usize> = (0..film.times_s.len()).collect();
            let ego = Some(picture.ego());
            let cameras: Vec<Camera<'_>> = samples
                .iter()
                .map(|i| Camera::of(film, *i, ego, &SCREEN))
                .collect();
            let content = LabelContent {
                stage,
                film,
                moves: &picture.moves,
            };
            let placed = labels_over_time(content, &samples, &cameras);
            for ((i, camera), (labels, _)) in samples.iter().zip(&cameras).zip(&placed) {
                let bodies = (0..stage.agents.len()).map(|who| {
                    let track = &film.tracks[who];
                    let [x, y] = camera.at(film.turned(track.x_m[*i], track.y_m[*i]));
                    let half_m = film.half_room(stage.agents[who].size_m, who, *i);
                    let [w, h] = half_m.map(|half_m| half_m * camera.scale);
                    ([x, y], [x - w, y - h, x + w, y + h])
                });
                for (who, (middle_px, body)) in bodies.enumerate() {
                    for label in labels {
                        let ([x, y], [w, h]) = (label.at_px, label.size_px);
                        let apart =
                            x + w <= body[0] || body[2] <= x || y + h <= body[1] || body[3] <= y;
                        assert!(apart, "{} at {i}: {label:?} over {who}", scenario.name());
                    }
                    let [from_px, to_px] = labels[who].leader_px();
                    let inside = (0.0..=SCREEN.size_px[0]).contains(&middle_px[0]);
                    assert!(!inside || (from_px[0] - middle_px[0]).abs() < 1e-6);
                    assert!(to_px[0] >= labels[who].at_px[0]);
                }
            }
        }
    }
}
