//! Crossing paths whose times are known.

use brakecheck_traffic::{Class, PathCrossing, RecordingColumns, TrafficRecording};

/// Road user on a straight line.
#[derive(Clone, Copy)]
struct Mover {
    class: Class,
    /// Place at 10 s.
    x_m: f64,
    y_m: f64,
    course_deg: f64,
    speed_mps: f64,
    length_m: f64,
    width_m: f64,
}

const CAR: Mover = Mover {
    class: Class::Car,
    x_m: 0.0,
    y_m: 0.0,
    course_deg: 0.0,
    speed_mps: 10.0,
    length_m: 4.0,
    width_m: 2.0,
};

const BICYCLE: Mover = Mover {
    class: Class::Bicycle,
    course_deg: 90.0,
    speed_mps: 5.0,
    length_m: 1.8,
    width_m: 0.6,
    ..CAR
};

impl Mover {
    /// Moves the instant at which the road user is at its place.
    fn later(self, seconds: f64) -> Mover {
        let (sin, cos) = self.course_deg.to_radians().sin_cos();
        let way_m = self.speed_mps * seconds;
        Mover {
            x_m: self.x_m - way_m * cos,
            y_m: self.y_m - way_m * sin,
            ..self
        }
    }

    fn place(&self, time_s: f64) -> [f64; 2] {
        let (sin, cos) = self.course_deg.to_radians().sin_cos();
        let way_m = self.speed_mps * (time_s - 10.0);
        [self.x_m + way_m * cos, self.y_m + way_m * sin]
    }

    fn corners(&self, time_s: f64) -> Vec<[f64; 2]> {
        let (sin, cos) = self.course_deg.to_radians().sin_cos();
        let [x, y] = self.place(time_s);
        let corner = |(l, w): (f64, f64)| {
            let (l, w) = (l * self.length_m, w * self.width_m);
            [x + l * cos - w * sin, y + l * sin + w * cos]
        };
        [(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)]
            .map(corner)
            .to_vec()
    }

    /// Whether the box overlaps the strip that the other one sweeps.
    fn is_in_strip_of(&self, other: &Mover, time_s: f64) -> bool {
        let (sin, cos) = other.course_deg.to_radians().sin_cos();
        let left = |[x, y]: &[f64; 2]| (y - other.y_m) * cos - (x - other.x_m) * sin;
        let lefts: Vec<f64> = self.corners(time_s).iter().map(left).collect();
        let low = lefts.iter().copied().fold(f64::INFINITY, f64::min);
        let high = lefts.iter().copied().fold(-f64::INFINITY, f64::max);
        low < 0.5 * other.width_m && -0.5 * other.width_m < high
    }
}

/// Twenty seconds at 20 Hz.
fn recording(movers: &[Mover]) -> TrafficRecording {
    let (mut ids, mut times, mut x, mut y) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut lengths, mut widths, mut classes) = (Vec::new(), Vec::new(), Vec::new());
    for (id, mover) in movers.iter().enumerate() {
        for i in 0..=400 {
            let time_s = 0.05 * f64::from(i);
            let [px, py] = mover.place(time_s);
            ids.push(id);
            times.push(time_s);
            x.push(px);
            y.push(py);
            lengths.push(mover.length_m);
            widths.push(mover.width_m);
            classes.push(mover.class);
        }
    }
    let mut columns = RecordingColumns::new(&ids, &times, &x, &y);
    columns.size_m = Some((&lengths, &widths));
    columns.classes = Some(&classes);
    TrafficRecording::from_columns("movers", &columns).unwrap_or_else(|it| panic!("{it}"))
}

fn crossings(movers: &[Mover]) -> Vec<PathCrossing> {
    PathCrossing::find(&recording(movers))
}

#[test]
fn the_time_between_two_boxes_is_that_of_a_search_by_hand() {
    for (first, second) in [
        (CAR, BICYCLE.later(3.0)),
        (BICYCLE, CAR.later(2.5)),
        (
            CAR,
            Mover {
                course_deg: 30.0,
                ..BICYCLE
            }
            .later(4.0),
        ),
        (
            CAR,
            Mover {
                course_deg: 140.0,
                ..BICYCLE
            }
            .later(4.0),
        ),
        (
            Mover {
                speed_mps: 1.5,
                class: Class::Pedestrian,
                ..BICYCLE
            }
            .later(-2.0),
            CAR.later(1.5),
        ),
    ] {
        let found = crossings(&[first, second]);
        assert_eq!(found.len(), 1, "{} degrees", second.course_deg);
        let crossing = found[0];
        assert_eq!((crossing.first, crossing.second), (0, 1));
        let steps = || (0..40_000).map(|i| 0.0005 * f64::from(i));
        let leave_s = steps().rfind(|t| first.is_in_strip_of(&second, *t));
        let enter_s = steps().find(|t| second.is_in_strip_of(&first, *t));
        let pairs = [
            (crossing.leave_s, leave_s.expect("it passes")),
            (crossing.enter_s, enter_s.expect("it passes")),
        ];
        for (got, expected) in pairs {
            assert!((got - expected).abs() < 0.01, "{got} and {expected}");
        }
        let turned = (first.course_deg - second.course_deg).abs().to_radians();
        let angle_rad = turned.min(std::f64::consts::PI - turned);
        assert!((crossing.angle_rad - angle_rad).abs() < 1e-6);
        // Relative to the first row, where the first road user is at 0 s.
        let start_m = first.place(0.0);
        for (axis, place_m) in crossing.point_m.iter().enumerate() {
            assert!(
                (place_m + start_m[axis]).abs() < 0.01,
                "{:?}",
                crossing.point_m
            );
        }
        // The clearance of the boxes, from points on their edges.
        let edge = |mover: &Mover, t: f64| -> Vec<[f64; 2]> {
            let corners = mover.corners(t);
            let side = |i: usize| {
                let (a, b) = (corners[i], corners[(i + 1) % 4]);
                (0..24).map(move |k| {
                    let share = f64::from(k) / 24.0;
                    [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
                })
            };
            (0..4).flat_map(side).collect()
        };
        let mut least_m = f64::INFINITY;
        for i in 100..=300 {
            let t = 0.05 * f64::from(i);
            for a in edge(&first, t) {
                for b in edge(&second, t) {
                    least_m = least_m.min((a[0] - b[0]).hypot(a[1] - b[1]));
                }
            }
        }
        let got_m = crossing.least_m.expect("a common instant");
        assert!((got_m - least_m).abs() < 0.06, "{got_m} and {least_m}");
    }
}

#[test]
fn two_road_users_in_one_place_have_no_time_between_them() {
    let found = crossings(&[CAR, BICYCLE]);
    assert_eq!((found[0].pet_s(), found[0].least_m), (0.0, Some(0.0)));
    // Long thin boxes overlap without a corner of one in the other.
    let long = Mover {
        length_m: 12.0,
        width_m: 0.5,
        ..CAR
    };
    let found = crossings(&[
        long,
        Mover {
            course_deg: 90.0,
            ..long
        },
    ]);
    assert_eq!(found[0].least_m, Some(0.0));
}

#[test]
fn followings_lane_changes_and_late_passages_do_not_cross() {
    for other in [
        CAR.later(1.0),
        // At 15°, as in a lane change.
        Mover {
            course_deg: 15.0,
            ..CAR
        }
        .later(2.0),
        // More than 10 s later, here earlier.
        BICYCLE.later(-9.9).later(-1.5),
        // A parallel line.
        Mover { y_m: 3.0, ..CAR },
    ] {
        assert_eq!(crossings(&[CAR, other]), []);
    }
    // A car behind another one, both in steps of a centimetre with jitter across.
    let mut jittery = [CAR, CAR.later(2.0)].map(|it| Mover {
        speed_mps: 1.0,
        ..it
    });
    jittery[1].y_m = 0.02;
    let mut recording = recording(&jittery);
    for (i, y) in recording.tracks[0].y_m.iter_mut().enumerate() {
        *y += if i / 8 % 2 == 0 { 0.1 } else { -0.1 };
    }
    assert_eq!(PathCrossing::find(&recording), []);
}

#[test]
fn the_smallest_time_comes_first() {
    let found = crossings(&[
        CAR,
        BICYCLE.later(6.0),
        BICYCLE.later(2.0),
        BICYCLE.later(4.0),
    ]);
    let others: Vec<usize> = found.iter().map(|it| it.second).collect();
    assert_eq!(others, [2, 3, 1]);
}
