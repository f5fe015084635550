//! The road: surface, verges, lane markings and a post every 10 m.

use rerun::{LineStrips3D, Mesh3D};

use super::error::ViewError;
use super::journal::Journal;
use super::palette::{self, Rgb};
use super::space::{distance, lifted};
use super::story::Story;

/// What lies beyond the cars' way by more than this is not drawn.
const MARGIN_M: f64 = 150.0;
/// How far the ground reaches beside the road.
const VERGE_M: f64 = 60.0;
/// How far the posts stand beside the road.
const POST_M: f64 = 0.6;

type Point = [f64; 3];

/// Logs the part of the road on which something happens.
pub(super) fn log(story: &Story<'_>, journal: &mut Journal) -> Result<(), ViewError> {
    let borders = near(&story.stage.lane_borders_m, &reach(story));
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return Ok(());
    };
    let verge = (beside(right, left, -VERGE_M), beside(left, right, -VERGE_M));
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
    for foot in along(&beside(right, left, -POST_M), 10.0) {
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

/// The part of the road within a box: all borders, cut at the same stations.
///
/// Borders have equally many points, those of one number across the road from
/// each other; so have the parts.
fn near(borders: &[Vec<Point>], reach: &[(f64, f64); 2]) -> Vec<Vec<Point>> {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return Vec::new();
    };
    let middle: Vec<Point> = right
        .iter()
        .zip(left)
        .map(|(r, l)| between(*r, *l, 0.5))
        .collect();
    let inside = middle.windows(2).enumerate().filter_map(|(i, pair)| {
        let (from, to) = within(pair[0], pair[1], reach)?;
        Some((i as f64 + from, i as f64 + to))
    });
    let ends = inside.fold(None, |ends: Option<(f64, f64)>, (from, to)| {
        Some((ends.map_or(from, |(first, _)| first), to))
    });
    let Some((from, to)) = ends else {
        return Vec::new();
    };
    let cut = |border: &Vec<Point>| part(border, from, to);
    borders.iter().map(cut).collect()
}

/// Which share of the way from `a` to `b` lies within a box.
fn within(a: Point, b: Point, reach: &[(f64, f64); 2]) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (axis, (least, greatest)) in reach.iter().enumerate() {
        let (start, step) = (a[axis], b[axis] - a[axis]);
        if step != 0.0 {
            let (enter, leave) = ((least - start) / step, (greatest - start) / step);
            from = from.max(enter.min(leave));
            to = to.min(enter.max(leave));
        } else if start < *least || *greatest < start {
            return None;
        }
    }
    (from < to).then_some((from, to))
}

/// A polyline from one station to another; 1.5 is halfway from point 1 to 2.
fn part(line: &[Point], from: f64, to: f64) -> Vec<Point> {
    let at = |station: f64| {
        let i = (station.floor() as usize).min(line.len().saturating_sub(2));
        between(line[i], line[i + 1], station - i as f64)
    };
    let whole = (0..line.len()).filter(|i| from < *i as f64 && (*i as f64) < to);
    let mut part = vec![at(from)];
    part.extend(whole.map(|i| line[i]));
    part.push(at(to));
    part
}

/// A line beside `line`, moved by `by_m` towards `across`.
fn beside(line: &[Point], across: &[Point], by_m: f64) -> Vec<Point> {
    let moved = |(a, b): (&Point, &Point)| between(*a, *b, by_m / distance(*a, *b).max(1e-9));
    line.iter().zip(across).map(moved).collect()
}

fn between(a: Point, b: Point, share: f64) -> Point {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

type Ribbon<'a> = (&'a [Point], &'a [Point], f64, Rgb);

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
fn along(line: &[Point], every_m: f64) -> Vec<Point> {
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

/// Lane markings: `on_m` drawn, `off_m` not.
fn dashes(line: &[Point], on_m: f64, off_m: f64) -> Vec<Vec<[f32; 3]>> {
    let points = along(line, 0.5 * on_m);
    let (on, period) = (2, 2 + (2.0 * off_m / on_m).round() as usize);
    points
        .chunks(period)
        .filter(|chunk| on < chunk.len())
        .map(|chunk| chunk[..=on].iter().map(|at| lifted(*at, 0.02)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: [Point; 2] = [[-100.0, 1.0, 0.0], [900.0, 1.0, 0.0]];

    #[test]
    fn a_road_is_cut_to_where_the_cars_are() {
        let borders = [
            LINE.to_vec(),
            LINE.map(|[x, y, z]| [x, y + 4.0, z]).to_vec(),
        ];
        let part = near(&borders, &[(0.0, 50.0), (-10.0, 10.0)]);
        assert_eq!((part.len(), part[0].len(), part[1].len()), (2, 2, 2));
        assert!((part[0][0][0]).abs() < 1e-9 && (part[0][1][0] - 50.0).abs() < 1e-9);
        assert!(near(&borders, &[(0.0, 50.0), (5.0, 10.0)]).is_empty());
    }

    #[test]
    fn the_borders_of_a_bend_are_cut_across_from_each_other() {
        let arc = |radius_m: f64| -> Vec<Point> {
            let turn = |i: u32| f64::from(i) * 0.05;
            (0..32)
                .map(|i| {
                    [
                        radius_m * turn(i).sin(),
                        radius_m * (1.0 - turn(i).cos()),
                        0.0,
                    ]
                })
                .map(|[x, y, z]| [x, y - radius_m, z])
                .collect()
        };
        let part = near(&[arc(104.0), arc(100.0)], &[(10.0, 60.0), (-200.0, 200.0)]);
        assert_eq!(part[0].len(), part[1].len());
        for (right, left) in part[0].iter().zip(&part[1]) {
            assert!((distance(*right, *left) - 4.0).abs() < 0.05);
        }
        let posts = along(&beside(&part[0], &part[1], -1.0), 10.0);
        let radius_m = |at: &Point| at[0].hypot(at[1]);
        assert!(posts.iter().all(|at| (radius_m(at) - 105.0).abs() < 0.05));
    }

    #[test]
    fn posts_stand_at_whole_multiples() {
        let part = near(
            &[LINE.to_vec(), LINE.to_vec()],
            &[(-7.0, 33.0), (-10.0, 10.0)],
        );
        let posts: Vec<i64> = along(&part[0], 10.0)
            .iter()
            .map(|at| at[0].round() as i64)
            .collect();
        assert_eq!(posts, [0, 10, 20, 30]);
    }
}
