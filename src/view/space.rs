//! The world in space: road, bodies, paths, and the place of contact.

use rerun::{
    Arrows3D, AsComponents, Boxes3D, Cylinders3D, EntityPath, FillMode, LineStrips3D, Mesh3D,
    Points3D, Transform3D,
};

use super::journal::{Journal, clock};
use super::palette::{self, Rgb};
use super::story::Story;
use super::{ViewError, agent_path};
use crate::rulebook::Verdict;
use crate::scene::{Cast, Frame};
use crate::sim::Placement;

/// The entity whose frame the cameras stand in.
pub(super) const FOLLOW: &str = "/follow";
/// What lies beyond the cars' way by more than this is not drawn.
const MARGIN_M: f64 = 150.0;
/// How far the ground reaches beside the road.
const VERGE_M: f64 = 60.0;
/// Bodies shorter than this walk.
const WALKER_M: f32 = 1.2;

/// Logs everything with a place in the world.
pub(super) fn log(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    log_road(story, journal)?;
    for who in 0..story.stage.cast.len() {
        log_body(story, who, journal)?;
        log_motion(story, who, journal)?;
    }
    log_trails(story, journal)?;
    log_follow(story, journal)?;
    log_contact(story, journal)?;
    log_verdict_mark(story, journal)
}

fn log_road(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let borders: Vec<Vec<[f64; 3]>> = story
        .stage
        .lane_borders_m
        .iter()
        .map(|border| near(border, &reach(story)))
        .collect();
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return Ok(());
    };
    let shifted = |border: &[[f64; 3]], by_m: f64| -> Vec<[f64; 3]> {
        border.iter().map(|[x, y, z]| [*x, y + by_m, *z]).collect()
    };
    let verge = (shifted(right, -VERGE_M), shifted(left, VERGE_M));
    let surface = ribbons([
        (&verge.0[..], &verge.1[..], -0.03, palette::GROUND),
        (&right[..], &left[..], 0.0, palette::ROAD),
    ]);
    let (mut strips, mut colours, mut radii_m) = (Vec::new(), Vec::new(), Vec::new());
    let mut draw = |strip: Vec<[f32; 3]>, colour: Rgb, radius_m: f32| {
        strips.push(strip);
        colours.push(colour);
        radii_m.push(radius_m);
    };
    for (i, border) in borders.iter().enumerate() {
        if i == 0 || i + 1 == borders.len() {
            let strip = border.iter().map(|point| lifted(*point, 0.02)).collect();
            draw(strip, palette::MARKING, 0.07);
        } else {
            for dash in dashes(border, 3.0, 6.0) {
                draw(dash, palette::MARKING, 0.07);
            }
        }
    }
    for [x, y, z] in along(right, 10.0) {
        let foot = [x, y - 0.6, z];
        draw(
            vec![lifted(foot, 0.0), lifted(foot, 0.8)],
            palette::POST,
            0.06,
        );
    }
    let lines = LineStrips3D::new(strips)
        .with_colors(colours)
        .with_radii(radii_m);
    journal.always("world/road", &[&surface, &lines])
}

/// Where the cars go, as (least, greatest) x and y.
fn reach(story: &Story<'_>) -> [(f64, f64); 2] {
    let mut reach = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for placement in story.frames.iter().flat_map(|frame| &frame.placements) {
        for (axis, at) in reach.iter_mut().zip(placement.centre_m) {
            *axis = (axis.0.min(at), axis.1.max(at));
        }
    }
    reach.map(|(least, greatest)| (least - MARGIN_M, greatest + MARGIN_M))
}

/// The part of a polyline within a box, cut at its walls.
fn near(line: &[[f64; 3]], reach: &[(f64, f64); 2]) -> Vec<[f64; 3]> {
    let mut part = Vec::new();
    for pair in line.windows(2) {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for (axis, (least, greatest)) in reach.iter().enumerate() {
            let (start, step) = (pair[0][axis], pair[1][axis] - pair[0][axis]);
            if step != 0.0 {
                let (a, b) = ((least - start) / step, (greatest - start) / step);
                from = from.max(a.min(b));
                to = to.min(a.max(b));
            } else if start < *least || *greatest < start {
                to = -1.0;
            }
        }
        if from < to {
            if part.is_empty() {
                part.push(between(pair[0], pair[1], from));
            }
            part.push(between(pair[0], pair[1], to));
        }
    }
    part
}

fn between(a: [f64; 3], b: [f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

fn lifted(point: [f64; 3], by_m: f64) -> [f32; 3] {
    // The one cast from places to pictures.
    [point[0] as f32, point[1] as f32, (point[2] + by_m) as f32]
}

type Ribbon<'a> = (&'a [[f64; 3]], &'a [[f64; 3]], f64, Rgb);

/// Flat surfaces (right edge, left edge, height, colour) as one mesh.
///
/// Both edges of a surface have equally many points.
fn ribbons<'a>(ribbons: impl IntoIterator<Item = Ribbon<'a>>) -> Mesh3D {
    let (mut corners, mut colours, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for (right, left, lift_m, colour) in ribbons {
        for (i, (r, l)) in right.iter().zip(left).enumerate() {
            let at = corners.len() as u32;
            if 0 < i {
                triangles.extend([[at - 2, at, at - 1], [at - 1, at, at + 1]]);
            }
            corners.extend([lifted(*r, lift_m), lifted(*l, lift_m)]);
            colours.extend([colour; 2]);
        }
    }
    Mesh3D::new(corners)
        .with_triangle_indices(triangles)
        .with_vertex_colors(colours)
}

/// Points every `every_m` of the way, at whole multiples of world x on
/// straight roads.
fn along(line: &[[f64; 3]], every_m: f64) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    let mut done_m = line.first().map_or(0.0, |first| first[0]);
    let mut next_m = (done_m / every_m).ceil() * every_m;
    for pair in line.windows(2) {
        let length_m = distance(pair[0], pair[1]);
        while next_m <= done_m + length_m {
            let share = (next_m - done_m) / length_m;
            points.push(between(pair[0], pair[1], share));
            next_m += every_m;
        }
        done_m += length_m;
    }
    points
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let squares = (0..3).map(|i| (b[i] - a[i]) * (b[i] - a[i]));
    squares.sum::<f64>().sqrt()
}

/// Lane markings: `on_m` drawn, `off_m` not.
fn dashes(line: &[[f64; 3]], on_m: f64, off_m: f64) -> Vec<Vec<[f32; 3]>> {
    let points = along(line, 0.5 * on_m);
    let (on, period) = (2, 2 + (2.0 * off_m / on_m).round() as usize);
    points
        .chunks(period)
        .filter(|chunk| on < chunk.len())
        .map(|chunk| chunk[..=on].iter().map(|at| lifted(*at, 0.02)).collect())
        .collect()
}

/// The body, in the frame of its own centre: x forward, y left, z up.
fn log_body(story: &Story<'_>, who: usize, journal: &mut Journal) -> Result<(), ViewError> {
    let cast = &story.stage.cast[who];
    let (mut centres, mut sizes, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    for (centre, size, colour) in parts(cast, story.colour(who)) {
        centres.push(centre);
        sizes.push(size);
        colours.push(colour);
    }
    let body = Boxes3D::from_centers_and_sizes(centres, sizes)
        .with_colors(colours)
        .with_fill_mode(FillMode::Solid)
        .with_show_labels(false);
    let wheels = wheels(cast);
    let name = Points3D::new([[0.0, 0.0, 0.5 * cast.size_m[2] as f32 + 0.7]])
        .with_radii([0.03])
        .with_colors([story.colour(who)])
        .with_labels([cast.name.as_str()]);
    let figure = [&body as &dyn AsComponents, &wheels, &name];
    journal.always(agent_path(&cast.name), &[&figure])
}

type Part = ([f32; 3], [f32; 3], Rgb);

/// Boxes (centre, size, colour) that make a recognisable car, or a walker.
fn parts(cast: &Cast, colour: Rgb) -> Vec<Part> {
    let [l, w, h] = cast.size_m.map(|size| size as f32);
    let place = |x: f32, y: f32, z: f32| [x * l, y * w, (z - 0.5) * h];
    let size = |x: f32, y: f32, z: f32| [x * l, y * w, z * h];
    if l < WALKER_M {
        return vec![
            (
                place(0.0, 0.0, 0.24),
                size(0.6, 0.7, 0.48),
                palette::dimmed(colour, 0.5),
            ),
            (place(0.0, 0.0, 0.65), size(0.8, 1.0, 0.36), colour),
            (
                place(0.1, 0.0, 0.92),
                size(0.5, 0.5, 0.16),
                palette::HEADLIGHT,
            ),
        ];
    }
    // A tall body is a van: its cabin reaches to the rear.
    let (cabin_x, cabin_l) = if h < 1.9 {
        (-0.10, 0.50)
    } else {
        (-0.06, 0.84)
    };
    let windscreen_x = cabin_x + 0.5 * cabin_l;
    let rear_x = cabin_x - 0.5 * cabin_l;
    let mut parts = vec![
        (place(0.0, 0.0, 0.38), size(1.0, 1.0, 0.40), colour),
        (
            place(cabin_x, 0.0, 0.74),
            size(cabin_l, 0.86, 0.36),
            palette::GLASS,
        ),
        (
            place(cabin_x, 0.0, 0.96),
            size(0.9 * cabin_l, 0.84, 0.08),
            colour,
        ),
        // A bright bonnet stripe and lights tell the front from the rear.
        (
            place(0.5 * (0.5 + windscreen_x), 0.0, 0.59),
            size(0.46 - windscreen_x, 0.16, 0.03),
            palette::MARKING,
        ),
    ];
    for x in [windscreen_x - 0.02, rear_x + 0.02] {
        for side in [-0.42, 0.42] {
            parts.push((place(x, side, 0.74), size(0.02, 0.05, 0.40), colour));
        }
    }
    for side in [-0.36, 0.36] {
        parts.push((
            place(0.5, side, 0.44),
            size(0.012, 0.2, 0.12),
            palette::HEADLIGHT,
        ));
        parts.push((
            place(-0.5, side, 0.46),
            size(0.012, 0.2, 0.12),
            palette::TAIL_LIGHT,
        ));
    }
    parts
}

/// Four wheels; a walker has none.
fn wheels(cast: &Cast) -> Cylinders3D {
    let [l, w, h] = cast.size_m.map(|size| size as f32);
    let (radius_m, breadth_m) = (0.07 * l, 0.13 * w);
    let mut centres = Vec::new();
    if WALKER_M <= l {
        for axle in [-0.31, 0.31] {
            for side in [-0.45, 0.45] {
                centres.push([axle * l, side * w, radius_m - 0.5 * h]);
            }
        }
    }
    // A cylinder stands along z: turned by a quarter about x it rolls.
    let quarter = std::f32::consts::FRAC_1_SQRT_2;
    Cylinders3D::from_lengths_and_radii(
        vec![breadth_m; centres.len()],
        vec![radius_m; centres.len()],
    )
    .with_quaternions(vec![
        rerun::Quaternion::from_xyzw([
            quarter, 0.0, 0.0, quarter
        ]);
        centres.len()
    ])
    .with_centers(centres)
    .with_colors([palette::TYRE])
    .with_fill_mode(FillMode::Solid)
}

/// Where it is, sample by sample.
fn log_motion(story: &Story<'_>, who: usize, journal: &mut Journal) -> Result<(), ViewError> {
    let placements = story.frames.iter().map(|frame| frame.placements[who]);
    let entity = agent_path(&story.stage.cast[who].name);
    log_transforms(story, entity, placements, journal)
}

/// A frame that goes with the ego but neither pitches nor rolls: the cameras'.
fn log_follow(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let ego = story.ego();
    let upright = story.frames.iter().map(|frame| {
        let Placement { centre_m, rotation } = frame.placements[ego];
        let ([x, y, _], [_, _, turn, real]) = (centre_m, rotation);
        let norm = (turn * turn + real * real).sqrt().max(1e-9);
        Placement {
            centre_m: [x, y, 0.0],
            rotation: [0.0, 0.0, turn / norm, real / norm],
        }
    });
    log_transforms(story, FOLLOW.into(), upright, journal)
}

fn log_transforms(
    story: &Story<'_>,
    entity: EntityPath,
    placements: impl Iterator<Item = Placement> + Clone,
    journal: &mut Journal,
) -> Result<(), ViewError> {
    let motion = Transform3D::update_fields()
        .with_many_translation(placements.clone().map(|place| lifted(place.centre_m, 0.0)))
        .with_many_quaternion(
            placements
                .map(|place| rerun::Quaternion::from_xyzw(place.rotation.map(|part| part as f32))),
        );
    let columns = motion.columns_of_unit_batches();
    let instants = (0..story.frames.len()).map(|sample| (sample, story.time_s(sample)));
    journal.columns(entity, clock(instants), columns)
}

/// Everybody's whole way, on the ground; narrow ones lie on broad ones.
fn log_trails(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let every = story.frames.len().div_ceil(100).max(1);
    let agents = 0..story.stage.cast.len();
    let strip = |who: usize| -> Vec<[f32; 3]> {
        let sparse = story
            .frames
            .iter()
            .step_by(every)
            .chain(story.frames.last());
        let ground = |frame: &Frame| {
            let [x, y, _] = frame.placements[who].centre_m;
            lifted([x, y, 0.0], 0.03 + 0.01 * who as f64)
        };
        sparse.map(ground).collect()
    };
    let trails = LineStrips3D::new(agents.clone().map(strip))
        .with_radii(agents.clone().map(|who| 0.16 / (1.0 + who as f32)))
        .with_colors(agents.map(|who| palette::dimmed(story.colour(who), 0.8)));
    journal.always("trails", &[&trails])
}

/// A pin at the place of contact and an arrow as long as the way closed in 1 s.
fn log_contact(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let Some(touch) = &story.episode.contact else {
        return Ok(());
    };
    let sample = (touch.time_s / story.episode.trace.dt_s()).ceil() as usize;
    let Some(frame) = story
        .frames
        .get(sample.min(story.frames.len().saturating_sub(1)))
    else {
        return Ok(());
    };
    let centre_of = |name: &str| {
        let who = story.stage.cast.iter().position(|cast| cast.name == name);
        who.map_or(touch.point_m, |who| frame.placements[who].centre_m)
    };
    let (from, to) = (centre_of(&touch.between.0), centre_of(&touch.between.1));
    let apart_m = distance(from, to).max(1e-6);
    let closing = touch.closing_speed_mps;
    let along: [f64; 3] = std::array::from_fn(|i| (to[i] - from[i]) / apart_m * closing);
    let at = touch.point_m;
    let (pin, height_m) = (lifted(at, 0.2), 2.6_f32);
    let back = std::array::from_fn(|i| at[i] - along[i]);
    let arrows = Arrows3D::from_vectors([[0.0, 0.0, pin[2] - height_m], lifted(along, 0.0)])
        .with_origins([[pin[0], pin[1], height_m], lifted(back, 1.2)])
        .with_radii([0.07, 0.07])
        .with_colors([palette::CONTACT])
        .with_labels([
            format!("contact {:.2} s", touch.time_s),
            format!("closing {closing:.1} m/s"),
        ])
        .with_show_labels(false);
    let point = Points3D::new([[pin[0], pin[1] - 1.8, 3.4]])
        .with_radii([0.12])
        .with_colors([palette::CONTACT])
        .with_labels([format!("contact, closing at {closing:.1} m/s")]);
    journal.from((sample, touch.time_s), "contact", &[&arrows, &point])
}

/// A pin where the ego was when the verdict became certain.
fn log_verdict_mark(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let Some(sample) = story.decided else {
        return Ok(());
    };
    let what = match story.episode.verdict {
        Verdict::Counterexample { .. } => "specification violated",
        Verdict::Foul { .. } => "rule broken",
        Verdict::Held { .. } => "held",
        Verdict::Invalid => "fault",
    };
    let [x, y, _] = story.frames[sample].placements[story.ego()].centre_m;
    let top = lifted([x, y + 1.8, 0.0], 4.6);
    let mark = Points3D::new([top])
        .with_radii([0.12])
        .with_colors([palette::DECIDED])
        .with_labels([format!("{what} at {:.2} s", story.time_s(sample))]);
    journal.from((sample, story.time_s(sample)), "verdict/mark", &[&mark])
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: [[f64; 3]; 2] = [[-100.0, 1.0, 0.0], [900.0, 1.0, 0.0]];

    #[test]
    fn a_road_is_cut_to_where_the_cars_are() {
        let part = near(&LINE, &[(0.0, 50.0), (-10.0, 10.0)]);
        assert_eq!(part.len(), 2);
        assert!((part[0][0]).abs() < 1e-9 && (part[1][0] - 50.0).abs() < 1e-9);
        assert!(near(&LINE, &[(0.0, 50.0), (2.0, 10.0)]).is_empty());
    }

    #[test]
    fn posts_stand_at_whole_multiples() {
        let part = near(&LINE, &[(-7.0, 33.0), (-10.0, 10.0)]);
        let posts: Vec<i64> = along(&part, 10.0)
            .iter()
            .map(|at| at[0].round() as i64)
            .collect();
        assert_eq!(posts, [0, 10, 20, 30]);
    }
}
