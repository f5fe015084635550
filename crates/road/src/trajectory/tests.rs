use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

use super::*;

fn point(x: f64, y: f64, time_s: Option<f64>) -> PathPoint {
    PathPoint {
        at_m: [x, y],
        heading_rad: None,
        time_s,
    }
}

fn control(x: f64, y: f64, weight: f64) -> NurbsPoint {
    NurbsPoint {
        at_m: [x, y],
        weight,
        time_s: None,
    }
}

#[test]
fn a_polyline_turns_its_body_at_corners_and_may_stand() {
    let points = [
        point(0.0, 0.0, Some(0.0)),
        point(10.0, 0.0, Some(2.0)),
        point(10.0, 0.0, Some(5.0)),
        point(10.0, 10.0, Some(6.0)),
    ];
    let path = TrajectoryPath::polyline(&points, PolylineTurn::AtCorners).expect("a path");
    assert_eq!(path.length_m, 20.0);
    let stations: Vec<f64> = path.times_s.iter().map(|it| it.s_m).collect();
    assert_eq!(stations, [0.0, 10.0, 10.0, 20.0]);
    let heading_rad = |s_m: f64| path.course.pose(s_m, 0.0).heading_rad + path.turned_rad(s_m);
    for (s_m, expected) in [
        (7.9, 0.0),
        (9.0, 0.25 * FRAC_PI_2),
        (10.0, FRAC_PI_4),
        (11.0, 0.75 * FRAC_PI_2),
        (12.1, FRAC_PI_2),
    ] {
        let is = heading_rad(s_m);
        assert!((is - expected).abs() < 1e-9, "{s_m}: {is}");
    }
    let corner = path.course.pose(15.0, 0.0);
    assert!((corner.x_m - 10.0).abs() < 1e-9 && (corner.y_m - 5.0).abs() < 1e-9);
    let even = TrajectoryPath::polyline(&points, PolylineTurn::AlongLines).expect("a path");
    assert!((even.turned_rad(5.0) - FRAC_PI_4).abs() < 1e-9);
}

#[test]
fn a_straight_polyline_has_no_headings_of_its_own() {
    let points = [
        point(0.0, 0.0, None),
        point(3.0, 4.0, None),
        point(6.0, 8.0, None),
    ];
    let path = TrajectoryPath::polyline(&points, PolylineTurn::AtCorners).expect("a path");
    assert!(path.headings_rad.is_empty() && path.times_s.is_empty());
    let backwards = PathPoint {
        heading_rad: Some(libm::atan2(-4.0, -3.0)),
        ..points[0]
    };
    let all = [backwards, points[2]];
    let path = TrajectoryPath::polyline(&all, PolylineTurn::AtCorners).expect("a path");
    assert!((path.turned_rad(1.0).abs() - core::f64::consts::PI).abs() < 1e-9);
}

#[test]
fn a_nurbs_is_a_circle_to_a_millimetre() {
    // A quarter of a circle of 50 m, exactly.
    let points = [
        control(50.0, 0.0, 1.0),
        control(50.0, 50.0, 1.0 / SQRT_2),
        control(0.0, 50.0, 1.0),
    ];
    let knots = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
    let path = TrajectoryPath::nurbs(3, &knots, &points).expect("a path");
    assert!(
        (path.length_m - 50.0 * FRAC_PI_2).abs() < 1e-3,
        "{}",
        path.length_m
    );
    for step in 0..=20 {
        let at = path
            .course
            .pose(path.length_m * f64::from(step) / 20.0, 0.0);
        let off_m = libm::hypot(at.x_m, at.y_m) - 50.0;
        assert!(off_m.abs() < 2e-3, "{step}: {off_m} m");
        let radial_rad = libm::atan2(at.y_m, at.x_m);
        assert!(wrapped(at.heading_rad - radial_rad - FRAC_PI_2).abs() < 2e-3);
    }
}

#[test]
fn an_unclamped_nurbs_of_many_spans_is_smooth_and_timed() {
    let places = [
        (0.0, 0.0),
        (10.0, 0.0),
        (20.0, 8.0),
        (30.0, 8.0),
        (45.0, 0.0),
        (60.0, 0.0),
    ];
    let mut points: Vec<NurbsPoint> = places.map(|(x, y)| control(x, y, 1.0)).to_vec();
    for (i, point) in points.iter_mut().enumerate() {
        point.time_s = Some(i as f64);
    }
    let clamped = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0];
    let path = TrajectoryPath::nurbs(4, &clamped, &points).expect("a path");
    let ends = [
        path.course.pose(0.0, 0.0),
        path.course.pose(path.length_m, 0.0),
    ];
    assert!(ends[0].x_m.abs() < 1e-6 && ends[1].x_m - 60.0 < 2e-3);
    assert!(ends[0].heading_rad.abs() < 1e-3 && ends[1].y_m.abs() < 2e-3);
    assert_eq!((path.times_s[0].s_m, path.times_s[0].value), (0.0, 0.0));
    assert!((path.times_s[5].s_m - path.length_m).abs() < 1e-2);
    let open: Vec<f64> = (0..10).map(f64::from).collect();
    let path = TrajectoryPath::nurbs(4, &open, &points).expect("a path");
    // A uniform cubic begins at (P0 + 4 P1 + P2) / 6.
    let start = path.course.pose(0.0, 0.0);
    assert!((start.x_m - 10.0).abs() < 1e-9 && (start.y_m - 8.0 / 6.0).abs() < 1e-9);
}

#[test]
fn clothoids_follow_each_other() {
    let spiral = |from_per_m, to_per_m| TimedSpiral {
        spiral: Spiral {
            length_m: 40.0,
            from_per_m,
            to_per_m,
        },
        ends_s: None,
    };
    let pieces = [spiral(0.0, 0.02), spiral(0.02, 0.0)];
    let path = TrajectoryPath::clothoids(Pose::default(), None, &pieces).expect("a path");
    let end = path.course.pose(path.length_m, 0.0);
    // Each turns by half of its length times its greatest curvature.
    assert!((end.heading_rad - 0.8).abs() < 1e-9, "{end:?}");
    assert_eq!(path.length_m, 80.0);
}

#[test]
fn what_is_no_curve_is_refused() {
    let line = |points: &[PathPoint]| TrajectoryPath::polyline(points, PolylineTurn::AtCorners);
    assert!(line(&[point(1.0, 1.0, None)]).is_err());
    assert!(line(&[point(1.0, 1.0, None), point(1.0, 1.0, None)]).is_err());
    let falls = line(&[point(0.0, 0.0, Some(1.0)), point(1.0, 0.0, Some(1.0))]);
    assert_eq!(falls.expect_err("times").index, Some(1));
    let some = line(&[point(0.0, 0.0, Some(1.0)), point(1.0, 0.0, None)]);
    assert_eq!(some.expect_err("times").index, Some(1));
    let ends = line(&[
        point(0.0, 0.0, Some(1.0)),
        point(1.0, 0.0, None),
        point(2.0, 0.0, Some(2.0)),
    ]);
    assert_eq!(ends.expect("times of its ends").times_s.len(), 2);
    assert!(line(&vec![point(0.0, 0.0, None); MOST_POINTS + 1]).is_err());
    let points = [
        control(0.0, 0.0, 1.0),
        control(1.0, 0.0, 1.0),
        control(2.0, 0.0, 1.0),
    ];
    let nurbs = |order, knots: &[f64]| TrajectoryPath::nurbs(order, knots, &points);
    assert!(nurbs(3, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]).is_ok());
    assert!(nurbs(3, &[0.0, 0.0, 0.0, 1.0, 1.0]).is_err());
    assert!(nurbs(4, &[0.0; 7]).is_err());
    assert!(nurbs(3, &[0.0; 6]).is_err());
    assert!(nurbs(3, &[0.0, 0.0, 2.0, 1.0, 1.0, 1.0]).is_err());
    let light = [points[0], control(1.0, 0.0, 0.0), points[2]];
    assert!(TrajectoryPath::nurbs(3, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], &light).is_err());
}
