//! The part of a road on which an episode takes place, for viewers.

use super::Frame;

/// A point on the ground in the world frame, in metres.
pub type GroundPoint = [f64; 3];

/// Bounding box of all bodies, enlarged by a margin.
///
/// Returns (least, greatest) of x and of y. Without any frame, the box is empty
/// (infinite bounds reversed).
pub fn reach<'a>(frames: impl IntoIterator<Item = &'a Frame>, margin_m: f64) -> [(f64, f64); 2] {
    let mut reach = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for placement in frames.into_iter().flat_map(|frame| &frame.placements) {
        for (axis, at) in reach.iter_mut().zip(placement.centre_m) {
            *axis = (axis.0.min(at), axis.1.max(at));
        }
    }
    reach.map(|(least, greatest)| (least - margin_m, greatest + margin_m))
}

/// Returns all borders within a box, cut at the same stations.
///
/// All borders must have equally many points, and points of equal index lie
/// across the road from each other. The result has the same property. It is
/// empty if the road does not enter the box.
pub fn near(borders: &[Vec<GroundPoint>], reach: &[(f64, f64); 2]) -> Vec<Vec<GroundPoint>> {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return Vec::new();
    };
    let middle: Vec<GroundPoint> = right
        .iter()
        .zip(left)
        .map(|(r, l)| between(*r, *l, 0.5))
        .collect();
    let inside = middle.windows(2).enumerate().filter_map(|(i, pair)| {
        let (from, to) = within(pair[0], pair[1], reach)?;
        Some((i as f64 + from, i as f64 + to))
    });
    // A bend may leave and re-enter the box. The part reaches from the first
    // entry to the last exit, so that no border is torn apart.
    let ends = inside.fold(None, |ends: Option<(f64, f64)>, (from, to)| {
        Some((ends.map_or(from, |(first, _)| first), to))
    });
    let Some((from, to)) = ends else {
        return Vec::new();
    };
    let cut = |border: &Vec<GroundPoint>| part(border, from, to);
    borders.iter().map(cut).collect()
}

/// Returns a line beside `line`, moved by `by_m` towards `across`.
pub fn beside(line: &[GroundPoint], across: &[GroundPoint], by_m: f64) -> Vec<GroundPoint> {
    let pairs = line.iter().zip(across);
    // The lower bound avoids 0/0 where the two lines touch.
    let moved = pairs.map(|(a, b)| between(*a, *b, by_m / distance(*a, *b).max(1e-9)));
    moved.collect()
}

/// Returns points every `every_m` along a line.
///
/// On straight roads the points lie at whole multiples of the world's x.
pub fn along(line: &[GroundPoint], every_m: f64) -> Vec<GroundPoint> {
    let mut points = Vec::new();
    // Starting at x and not at 0 keeps posts in place when a view is cut
    // elsewhere.
    let mut done_m = line.first().map_or(0.0, |first| first[0]);
    let mut next_m = (done_m / every_m).ceil() * every_m;
    for pair in line.windows(2) {
        let length_m = distance(pair[0], pair[1]);
        while next_m <= done_m + length_m {
            // Two equal points of a line have no direction.
            let share = if length_m > 0.0 {
                (next_m - done_m) / length_m
            } else {
                0.0
            };
            points.push(between(pair[0], pair[1], share));
            next_m += every_m;
        }
        done_m += length_m;
    }
    points
}

/// Returns the straight-line distance in metres.
pub fn distance(a: GroundPoint, b: GroundPoint) -> f64 {
    let squares = (0..3).map(|i| (b[i] - a[i]) * (b[i] - a[i]));
    squares.sum::<f64>().sqrt()
}

/// Returns the section of a segment inside a box, as shares of its length.
///
/// Clips the segment axis by axis (Liang–Barsky). `None` if it misses the box.
fn within(a: GroundPoint, b: GroundPoint, reach: &[(f64, f64); 2]) -> Option<(f64, f64)> {
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (axis, (least, greatest)) in reach.iter().enumerate() {
        let (start, step) = (a[axis], b[axis] - a[axis]);
        if step != 0.0 {
            let (enter, leave) = ((least - start) / step, (greatest - start) / step);
            from = from.max(enter.min(leave));
            to = to.min(enter.max(leave));
        // A segment parallel to this axis is inside for its whole length or not
        // at all.
        } else if start < *least || *greatest < start {
            return None;
        }
    }
    // A segment that only touches the box has no section inside.
    (from < to).then_some((from, to))
}

/// Returns a polyline between two stations. 1.5 is halfway from point 1 to 2.
fn part(line: &[GroundPoint], from: f64, to: f64) -> Vec<GroundPoint> {
    let at = |station: f64| {
        // The last point has no segment of its own and belongs to the one
        // before it.
        let i = (station.floor() as usize).min(line.len().saturating_sub(2));
        between(line[i], line[i + 1], station - i as f64)
    };
    let whole = (0..line.len()).filter(|i| from < *i as f64 && (*i as f64) < to);
    let mut part = vec![at(from)];
    part.extend(whole.map(|i| line[i]));
    part.push(at(to));
    part
}

/// Returns the point at a share of the way from `a` to `b`.
fn between(a: GroundPoint, b: GroundPoint, share: f64) -> GroundPoint {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: [GroundPoint; 2] = [[-100.0, 1.0, 0.0], [900.0, 1.0, 0.0]];

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
        let arc = |radius_m: f64| -> Vec<GroundPoint> {
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
        let radius_m = |at: &GroundPoint| at[0].hypot(at[1]);
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
