#![cfg(test)]
//! Tests of courses: coordinates, nearest pieces, corners and mistakes.

use super::*;

#[test]
fn coordinates_there_and_back_agree_on_every_piece() {
    let pieces = [
        Piece::Line { length_m: 50.0 },
        Piece::Arc {
            length_m: 60.0,
            radius_m: 40.0,
        },
        Piece::Arc {
            length_m: 80.0,
            radius_m: -50.0,
        },
        Piece::Line { length_m: 30.0 },
    ];
    let course = Course::of_pieces(&pieces, 7.0).expect("a course");
    let corners = [(0.0, 0.0), (80.0, 0.0), (120.0, 60.0), (200.0, 60.0)];
    let polyline = Course::of_points(&corners, 20.0, 7.0).expect("a course");
    for course in [course, polyline] {
        for s_m in (-20..240).map(f64::from) {
            for lateral_m in [-3.0, 0.0, 5.0] {
                let at = course.locate(&course.pose(s_m, lateral_m));
                assert!((at.s_m - s_m).abs() < 1e-6, "{s_m} {at:?}");
                assert!((at.lateral_m - lateral_m).abs() < 1e-6, "{s_m} {at:?}");
                assert!(at.heading_rad.abs() < 1e-9, "{s_m} {at:?}");
            }
        }
    }
}

/// Pieces that turn to both sides, and slight bends as they are imported.
fn many_pieces() -> Vec<Piece> {
    let bends = (0..60).map(|i| match i % 3 {
        0 => Piece::Line { length_m: 7.0 },
        _ => Piece::Arc {
            length_m: 5.0 + f64::from(i),
            radius_m: if i % 2 == 0 { 40.0 } else { -55.0 },
        },
    });
    let slight = (0..40).map(|i| Piece::Arc {
        length_m: 11.0,
        radius_m: if i % 2 == 0 { -489_806.9 } else { 3e9 },
    });
    bends.chain(slight).collect()
}

#[track_caller]
fn assert_nearest_of_all(course: &Course, pose: Pose) {
    let all = course.legs.iter().map(|leg| leg.locate(&pose));
    let nearest = all.reduce(|best, it| if it.0 < best.0 { it } else { best });
    assert_eq!(Some(course.nearest(&pose)), nearest, "{pose:?}");
}

#[test]
fn on_many_pieces_the_nearest_one_is_found_as_if_all_were_looked_at() {
    let course = Course::of_pieces(&many_pieces(), 7.0).expect("a course");
    for x in (-40..40).map(|i| f64::from(i) * 13.0) {
        for y in (-40..40).map(|i| f64::from(i) * 11.0) {
            let pose = Pose {
                x_m: x,
                y_m: y,
                heading_rad: 0.3,
            };
            assert_nearest_of_all(&course, pose);
        }
    }
}

#[test]
fn beside_many_pieces_and_at_their_joints_the_nearest_one_is_found() {
    let course = Course::of_pieces(&many_pieces(), 7.0).expect("a course");
    let joints = course.pieces().into_iter().map(|piece| piece.from_s_m);
    let between = (0..4000).map(|i| -100.0 + 0.7 * f64::from(i));
    for s_m in joints.chain(between) {
        for lateral_m in [-30.0, -3.0, -1e-9, 0.0, 1e-6, 2.6, 45.0] {
            assert_nearest_of_all(&course, course.pose(s_m, lateral_m));
        }
    }
}

#[test]
fn a_polyline_passes_its_sides() {
    let points = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0)];
    let course = Course::of_points(&points, 20.0, 7.0).expect("a course");
    let corner_m = 20.0 * core::f64::consts::FRAC_PI_2;
    let end = course.pose(80.0 + corner_m + 80.0, 0.0);
    assert!((end.x_m - 100.0).abs() < 1e-9 && (end.y_m - 100.0).abs() < 1e-9);
}

#[test]
fn courses_that_cannot_be_laid_say_why() {
    let tight = [Piece::Arc {
        length_m: 10.0,
        radius_m: -5.0,
    }];
    let error = Course::of_pieces(&tight, 7.0).expect_err("too tight");
    assert_eq!((error.index, error.what.contains("-5")), (Some(0), true));
    let near = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)];
    assert!(Course::of_points(&near, 20.0, 7.0).is_err());
    assert!(Course::of_points(&near[..1], 20.0, 7.0).is_err());
}

#[test]
fn a_road_of_bends_begins_at_its_place_to_the_bit_and_turns_as_far_as_asked() {
    let begins = Pose {
        x_m: 123.4,
        y_m: -56.7,
        heading_rad: 2.3,
    };
    let circle = |turn_rad: f64| Bend {
        length_m: 20.0 * turn_rad,
        per_m: -0.05,
    };
    let course = Course::of_bends(begins, &[circle(5.0)]).expect("a course");
    assert_eq!(course.start(), begins);
    assert_eq!(course.pose(0.0, 0.0), begins);
    // A leg turns by half a circle at most, so that its places have one station.
    assert_eq!(course.piece_count(), 2);
    assert!((course.turned_rad() - 5.0).abs() < 1e-12);
    let there = course.pose(70.0, 1.0);
    assert!((course.locate(&there).s_m - 70.0).abs() < 1e-9);
    // Before its start the road is straight, as behind its end.
    let before = course.pose(-10.0, 0.0);
    assert!((before.ahead(10.0).x_m - begins.x_m).abs() < 1e-9);
    assert_eq!(
        Course::straight_from(begins),
        Course::of_bends(begins, &[]).expect("a course")
    );
    // Each part of a piece takes memory, so that its turn is bounded.
    for length_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        let bend = Bend {
            length_m,
            per_m: -0.05,
        };
        let error = Course::of_bends(begins, &[circle(1.0), bend]).expect_err("no course");
        assert_eq!(error.index, Some(1));
    }
}
