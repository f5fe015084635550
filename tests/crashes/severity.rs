//! Contacts by hand: two boxes, their speeds, and what that does to the ego.

use brakecheck::scene::ContactEvent;
use brakecheck::scene::{BodyState, Pose};
use brakecheck::scene::{CrashKind, Impact, RiskCurve, Side};
use brakecheck::world::PlantKind;
use brakecheck_sim::severity::Party;
use brakecheck_sim::sim::{Body, Ground, plant};
use std::f64::consts::{FRAC_PI_2, PI};

use super::near;

fn body(name: &str) -> Body {
    Body::shipped(name).expect("shipped").expect("a body")
}

fn at(x_m: f64, y_m: f64, heading_rad: f64, speed_mps: f64) -> BodyState {
    BodyState {
        pose: Pose {
            x_m,
            y_m,
            heading_rad,
        },
        speed_mps,
        ..BodyState::default()
    }
}

fn impact(
    (ego, state): (&str, BodyState),
    (other, its): (&str, BodyState),
    normal: [f64; 2],
    closing_mps: f64,
) -> Impact {
    let (ego, other) = (body(ego), body(other));
    let party = |body, state| Party { body, state };
    let (ego, other) = (party(&ego, state), party(&other, its));
    Impact::of(ego, other, normal, closing_mps)
}

/// A sedan is 4.54 m long and 1.8 m wide and has 1500 kg; a van has 2800 kg, a
/// truck 12 000 kg, somebody on foot 75 kg.
#[test]
fn the_bodies_are_those_of_the_numbers_below() {
    let sedan = body("sedan");
    assert_eq!(
        (sedan.length_m, sedan.width_m, sedan.mass_kg),
        (4.54, 1.8, 1500.0)
    );
    let masses = ["van", "truck", "pedestrian"].map(|name| body(name).mass_kg);
    assert_eq!(masses, [2800.0, 12_000.0, 75.0]);
}

#[test]
fn the_ego_runs_into_a_rear() {
    let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
    let ahead = ("sedan", at(4.54, 0.9, 0.0, 10.0));
    let it = impact(ego, ahead, [1.0, 0.0], 10.0);
    assert_eq!(it.kind, CrashKind::RearEnd);
    assert_eq!((it.ego_side, it.other_side), (Side::Front, Side::Rear));
    // Half a width beside each other.
    near(it.overlap.expect("lengthwise"), 0.5);
    assert_eq!((it.ego_speed_mps, it.other_speed_mps), (20.0, 10.0));
    // Equal masses share the closing speed.
    assert_eq!((it.ego_delta_v_mps, it.other_delta_v_mps), (5.0, 5.0));
    assert!(!it.is_struck_from_behind());
    let risk = it.injury_risk().expect("a curve");
    assert_eq!(risk.curve, RiskCurve::OccupantMais3);
    // 1 / (1 + e^(4.457 − 0.177 · 5)) = 1 / (1 + e^3.572).
    near(risk.probability, 1.0 / (1.0 + 3.572_f64.exp()));
}

#[test]
fn somebody_runs_into_the_egos_rear() {
    let ego = ("sedan", at(0.0, 0.0, 0.0, 5.0));
    let behind = ("van", at(-4.54, 0.0, 0.0, 9.0));
    let it = impact(ego, behind, [-1.0, 0.0], 4.0);
    assert_eq!(it.kind, CrashKind::RearEnd);
    assert_eq!((it.ego_side, it.other_side), (Side::Rear, Side::Front));
    assert!(it.is_struck_from_behind());
    near(it.overlap.expect("lengthwise"), 1.0);
    near(it.ego_delta_v_mps, 2800.0 / 4300.0 * 4.0);
    near(it.other_delta_v_mps, 1500.0 / 4300.0 * 4.0);
    let exponent = 4.457 - 0.177 * it.ego_delta_v_mps + 0.431;
    let risk = it.injury_risk().expect("a curve");
    near(risk.probability, 1.0 / (1.0 + exponent.exp()));
}

#[test]
fn head_on() {
    let ego = ("sedan", at(0.0, 0.0, 0.0, 15.0));
    let oncoming = ("sedan", at(0.0, -0.45, PI, 10.0));
    let it = impact(ego, oncoming, [1.0, 0.0], 25.0);
    assert_eq!(it.kind, CrashKind::HeadOn);
    assert_eq!((it.ego_side, it.other_side), (Side::Front, Side::Front));
    near(it.overlap.expect("lengthwise"), 0.75);
    assert_eq!(it.ego_delta_v_mps, 12.5);
    near(it.turned_rad.abs(), PI);
}

#[test]
fn a_side_swipe_in_either_direction() {
    for (heading_rad, other_side) in [(-0.1, Side::Right), (PI - 0.1, Side::Left)] {
        let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
        let beside = ("sedan", at(0.0, 1.9, heading_rad, 19.0));
        let it = impact(ego, beside, [0.0, 1.0], 1.5);
        assert_eq!(it.kind, CrashKind::SideSwipe);
        assert_eq!((it.ego_side, it.other_side), (Side::Left, other_side));
        assert_eq!(it.overlap, None);
        assert_eq!(it.ego_delta_v_mps, 0.75);
    }
}

#[test]
fn a_front_in_a_flank_is_crossing_whosever_it_is() {
    let crossing = ("sedan", at(4.0, 2.0, FRAC_PI_2, 8.0));
    let ego = ("sedan", at(3.0, 0.0, 0.0, 12.0));
    let into = impact(ego, crossing, [1.0, 0.0], 12.0);
    assert_eq!(into.kind, CrashKind::Crossing);
    assert_eq!((into.ego_side, into.other_side), (Side::Front, Side::Left));
    // It comes from the right and hits the ego's right flank.
    let from_the_right = ("sedan", at(-2.0, -0.9, FRAC_PI_2, 8.0));
    let it = impact(
        ("sedan", at(0.0, 0.0, 0.0, 12.0)),
        from_the_right,
        [0.0, -1.0],
        8.0,
    );
    assert_eq!(it.kind, CrashKind::Crossing);
    assert_eq!((it.ego_side, it.other_side), (Side::Right, Side::Front));
    let exponent = 4.457 - 0.177 * 4.0 - 0.244;
    near(
        it.injury_risk().expect("a curve").probability,
        1.0 / (1.0 + f64::exp(exponent)),
    );
}

#[test]
fn a_pedestrian_before_the_front_and_beside_the_flank() {
    let walks = ("pedestrian", at(0.2, 0.0, FRAC_PI_2, 1.5));
    let hit = impact(("sedan", at(0.0, 0.0, 0.0, 12.5)), walks, [1.0, 0.0], 12.5);
    assert_eq!(
        (hit.kind, hit.ego_side),
        (CrashKind::Pedestrian, Side::Front)
    );
    // 12.5 m/s are 45 km/h: e^(6.9 − 4.05).
    let risk = hit.injury_risk().expect("a curve");
    assert_eq!(risk.curve, RiskCurve::PedestrianFatality);
    near(risk.probability, 1.0 / (1.0 + f64::exp(6.9 - 4.05)));
    near(hit.ego_delta_v_mps, 75.0 / 1575.0 * 12.5);
    // Who walks into a flank is in no curve.
    let beside = impact(("sedan", at(0.0, 0.0, 0.0, 12.5)), walks, [0.0, 1.0], 1.5);
    assert_eq!(beside.kind, CrashKind::Pedestrian);
    assert_eq!(beside.injury_risk(), None);
}

/// "The fatality risk at 50 km/h is more than twice as high as the risk at
/// 40 km/h and more than five times higher than the risk at 30 km/h": the
/// abstract of Rosén and Sander (2009).
#[test]
fn the_pedestrian_curve_is_as_its_abstract_says() {
    let risk = |kmh: f64| {
        let walks = ("pedestrian", at(0.2, 0.0, 0.0, 0.0));
        let ego = ("sedan", at(0.0, 0.0, 0.0, kmh / 3.6));
        let it = impact(ego, walks, [1.0, 0.0], kmh / 3.6);
        it.injury_risk().expect("a curve").probability
    };
    assert!(2.0 * risk(40.0) < risk(50.0) && 5.0 * risk(30.0) < risk(50.0));
    assert!(risk(50.0) < 0.1);
}

#[test]
fn a_truck_has_no_curve() {
    let ego = ("truck", at(0.0, 0.0, 0.0, 20.0));
    let it = impact(ego, ("sedan", at(4.54, 0.0, 0.0, 10.0)), [1.0, 0.0], 10.0);
    assert_eq!(it.injury_risk(), None);
}

/// Sides change at 45° and 135° from the heading, whatever the heading is.
#[test]
fn a_side_is_where_the_normal_points() {
    let sides = [
        (0.0, Side::Front),
        (44.0, Side::Front),
        (-44.0, Side::Front),
        (46.0, Side::Left),
        (-46.0, Side::Right),
        (134.0, Side::Left),
        (-134.0, Side::Right),
        (136.0, Side::Rear),
        (-136.0, Side::Rear),
        (180.0, Side::Rear),
    ];
    for (degrees, side) in sides {
        for heading_rad in [0.0, 2.0, -3.0] {
            let out_rad = heading_rad + f64::to_radians(degrees);
            let normal = [out_rad.cos(), out_rad.sin()];
            let ego = ("sedan", at(0.0, 0.0, heading_rad, 20.0));
            let far = 4.0;
            // The other has the ego's heading, so the opposite side of it is touched.
            let its = at(far * normal[0], far * normal[1], heading_rad, 10.0);
            let it = impact(ego, ("sedan", its), normal, 5.0);
            let opposite = match side {
                Side::Front => Side::Rear,
                Side::Rear => Side::Front,
                Side::Left => Side::Right,
                Side::Right => Side::Left,
            };
            assert_eq!((it.ego_side, it.other_side), (side, opposite), "{degrees}");
            near(it.turned_rad, 0.0);
        }
    }
}

/// Exactly at 45° and 135° a flank is touched, and straight ahead and back no flank.
#[test]
fn a_corner_belongs_to_the_flank() {
    for (normal, side) in [
        ([0.5, 0.5], Side::Left),
        ([0.5, -0.5], Side::Right),
        ([-0.5, 0.5], Side::Left),
        ([-0.5, -0.5], Side::Right),
        ([1.0, -0.0], Side::Front),
        ([-1.0, -0.0], Side::Rear),
    ] {
        let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
        let it = impact(ego, ("sedan", at(4.0, 0.0, 0.0, 10.0)), normal, 5.0);
        assert_eq!(it.ego_side, side, "{normal:?}");
    }
}

/// The kind for two headings, with the normal out of the ego's front, left or rear.
#[test]
fn a_kind_is_decided_by_both_sides_and_the_headings() {
    let kinds = [
        // Two fronts are head-on beyond 135° only.
        ([1.0, 0.0], 179.0, CrashKind::HeadOn),
        ([1.0, 0.0], 136.0, CrashKind::HeadOn),
        ([1.0, 0.0], -136.0, CrashKind::HeadOn),
        ([0.9397, -0.342], 135.0, CrashKind::Crossing),
        // At 134° the other's flank is touched.
        ([1.0, 0.0], 134.0, CrashKind::Crossing),
        ([1.0, 0.0], 44.0, CrashKind::RearEnd),
        ([1.0, 0.0], 46.0, CrashKind::Crossing),
        // Two rears: one of them reverses.
        ([-1.0, 0.0], 180.0, CrashKind::RearEnd),
        ([-1.0, 0.0], 0.0, CrashKind::RearEnd),
        ([-1.0, 0.0], 90.0, CrashKind::Crossing),
        // Flanks are a side-swipe within 45° of parallel, in either direction.
        ([0.0, 1.0], 44.0, CrashKind::SideSwipe),
        ([0.0, 1.0], -44.0, CrashKind::SideSwipe),
        ([0.0, 1.0], 46.0, CrashKind::Crossing),
        ([0.0, 1.0], 134.0, CrashKind::Crossing),
        ([0.0, 1.0], 136.0, CrashKind::SideSwipe),
        ([0.0, -1.0], 180.0, CrashKind::SideSwipe),
        // Two flanks that are not parallel, at the corner of one.
        ([0.6947, 0.7193], -40.0, CrashKind::SideSwipe),
        ([0.6947, 0.7193], -60.0, CrashKind::Crossing),
    ];
    for (normal, degrees, kind) in kinds {
        let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
        let its = at(4.0, 0.0, f64::to_radians(degrees), 10.0);
        let it = impact(ego, ("sedan", its), normal, 5.0);
        assert_eq!(it.kind, kind, "{normal:?} {degrees}: {it}");
        let lengthwise = matches!(kind, CrashKind::RearEnd | CrashKind::HeadOn);
        assert_eq!(it.overlap.is_some(), lengthwise, "{it}");
    }
    // The fronts of two cars at right angles, each with its corner.
    let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
    let corner = 0.5_f64.sqrt() * 1.0001;
    let its = ("sedan", at(0.5, 0.5, -FRAC_PI_2 - 0.05, 10.0));
    let it = impact(ego, its, [corner + 0.01, corner - 0.01], 5.0);
    assert_eq!((it.ego_side, it.other_side), (Side::Front, Side::Front));
    assert_eq!((it.kind, it.overlap), (CrashKind::Crossing, None));
}

/// Faces are seen along the ego's heading: a turned face is narrower, and a rear lies a
/// length behind its front bumper.
#[test]
fn overlap_is_the_common_share_of_the_narrower_width() {
    let overlap = |ego: BodyState, (other, its): (&str, BodyState), normal| {
        let it = impact(("sedan", ego), (other, its), normal, 5.0);
        it.overlap.expect("lengthwise")
    };
    let ego = at(0.0, 0.0, 0.0, 20.0);
    let ahead = |y_m: f64| ("sedan", at(4.54, y_m, 0.0, 10.0));
    let share = |y_m: f64| overlap(ego, ahead(y_m), [1.0, 0.0]);
    near(share(0.0), 1.0);
    near(share(0.3), 1.5 / 1.8);
    near(share(-0.3), 1.5 / 1.8);
    // Beside each other nothing is in common.
    near(share(2.0), 0.0);
    // The narrower of a sedan and a truck is the sedan.
    let truck = body("truck");
    let y_m = 0.5 * truck.width_m;
    let its = at(truck.length_m, y_m, 0.0, 10.0);
    near(overlap(ego, ("truck", its), [1.0, 0.0]), 0.5);
    // Turned by 0.2 rad about its front, the rear of 4.54 m is 0.902 m to the side.
    let turned = at(4.54 * 0.2_f64.cos(), 0.0, -0.2, 10.0);
    let rear_m = 4.54 * 0.2_f64.sin();
    let half_m = 0.9 * 0.2_f64.cos();
    let common_m = 0.9_f64.min(rear_m + half_m) - (-0.9_f64).max(rear_m - half_m);
    near(overlap(ego, ("sedan", turned), [1.0, 0.0]), common_m / 1.8);
    // All of it turns with the ego.
    let rotated = |state: BodyState| {
        let Pose {
            x_m,
            y_m,
            heading_rad,
        } = state.pose;
        at(-y_m, x_m, heading_rad + FRAC_PI_2, state.speed_mps)
    };
    let its = ("sedan", rotated(turned));
    near(overlap(rotated(ego), its, [0.0, 1.0]), common_m / 1.8);
}

/// Speeds are over ground, and a contact concerns an ego that moves and is not struck
/// from behind.
#[test]
fn a_contact_concerns_who_moves_into_it() {
    let moving = |ahead_mps: f64, left_mps: f64| BodyState {
        lateral_mps: left_mps,
        ..at(0.0, 0.0, 0.0, ahead_mps)
    };
    let front = |ego: BodyState| {
        impact(
            ("sedan", ego),
            ("sedan", at(4.54, 0.0, 0.0, 0.0)),
            [1.0, 0.0],
            1.0,
        )
    };
    near(front(moving(3.0, 4.0)).ego_speed_mps, 5.0);
    near(front(moving(-3.0, 0.0)).ego_speed_mps, 3.0);
    assert!(front(moving(0.6, 0.0)).concerns_ego());
    assert!(front(moving(0.0, -0.6)).concerns_ego());
    assert!(!front(moving(0.5, 0.0)).concerns_ego());
    let behind = ("sedan", at(-4.54, 0.0, 0.0, 9.0));
    let struck = impact(("sedan", moving(5.0, 0.0)), behind, [-1.0, 0.0], 4.0);
    assert!(!struck.concerns_ego() && struck.is_struck_from_behind());
    // A flank that is run into is no rear.
    let flank = impact(
        ("sedan", moving(5.0, 0.0)),
        ("sedan", at(-2.0, 2.0, -FRAC_PI_2, 8.0)),
        [0.0, 1.0],
        4.0,
    );
    assert!(flank.concerns_ego() && !flank.is_struck_from_behind());
}

/// The curves are of cars from 500 to 4000 kg, as the ego. The other may be anything.
#[test]
fn a_curve_is_of_light_vehicles() {
    let sedan = body("sedan");
    let of_mass = |mass_kg: f64| Body {
        mass_kg,
        ..sedan.clone()
    };
    let risk = |ego: &Body, other: &Body| {
        let ego = Party {
            body: ego,
            state: at(0.0, 0.0, 0.0, 20.0),
        };
        let other = Party {
            body: other,
            state: at(4.54, 0.0, 0.0, 10.0),
        };
        Impact::of(ego, other, [1.0, 0.0], 10.0).injury_risk()
    };
    for (mass_kg, known) in [
        (499.0, false),
        (500.0, true),
        (4000.0, true),
        (4001.0, false),
    ] {
        assert_eq!(
            risk(&of_mass(mass_kg), &sedan).is_some(),
            known,
            "{mass_kg}"
        );
        assert!(risk(&sedan, &of_mass(mass_kg)).is_some());
    }
    let walker = body("pedestrian");
    let heavy = Body {
        mass_kg: 600.0,
        ..walker
    };
    assert_eq!(risk(&heavy, &sedan), None);
}

#[test]
fn a_line_names_kind_sides_and_speeds() {
    let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
    let rear = impact(ego, ("van", at(5.5, 0.45, 0.0, 12.0)), [1.0, 0.0], 8.0);
    let words = rear.to_string();
    assert!(
        words.starts_with("rear-end: the ego's front against the other's rear, overlap "),
        "{words}"
    );
    assert!(
        words.ends_with(" %, ego 20.0 m/s, other 12.0 m/s, Δv of the ego 5.2 m/s"),
        "{words}"
    );
    let walks = ("pedestrian", at(0.2, 0.0, FRAC_PI_2, 1.5));
    let words = impact(ego, walks, [1.0, 0.0], 20.0).to_string();
    assert!(
        words.starts_with("pedestrian: the ego's front against a pedestrian, ego 20.0 m/s"),
        "{words}"
    );
    let risk = rear.injury_risk().expect("a curve");
    let percent = 100.0 * risk.probability;
    assert_eq!(
        risk.to_string(),
        format!("{percent:.1} % (MAIS 3+ of the ego's occupants)")
    );
}

#[test]
fn mirrored_scenes_are_mirrored() {
    let scenes = [
        (at(4.54, 0.7, 0.2, 10.0), [1.0, 0.0], 10.0),
        (at(-4.54, 0.4, -0.1, 25.0), [-1.0, 0.0], 5.0),
        (at(0.0, 1.9, -0.1, 19.0), [0.0, 1.0], 1.5),
        (at(1.0, 2.0, -FRAC_PI_2, 8.0), [0.0, 1.0], 8.0),
        (at(0.0, 0.5, PI - 0.3, 10.0), [1.0, 0.0], 25.0),
    ];
    for (other, normal, closing_mps) in scenes {
        let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
        let it = impact(ego, ("van", other), normal, closing_mps);
        let Pose {
            x_m,
            y_m,
            heading_rad,
        } = other.pose;
        let mirrored = ("van", at(x_m, -y_m, -heading_rad, other.speed_mps));
        let other = impact(ego, mirrored, [normal[0], -normal[1]], closing_mps);
        let swapped = |side: Side| match side {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
            side => side,
        };
        let expected = Impact {
            ego_side: swapped(it.ego_side),
            other_side: swapped(it.other_side),
            turned_rad: -it.turned_rad,
            ..it
        };
        assert_eq!(other, expected);
    }
}

/// The normal that both plants report makes of a real collision the same thing.
#[test]
fn both_plants_report_the_face_that_is_touched() {
    let sedan = body("sedan");
    for kind in [PlantKind::Rigid, PlantKind::Kinematic] {
        let mut plant = plant(kind, Ground { friction: 0.9 });
        let ego = plant.spawn(&sedan, Pose::default(), 20.0);
        let across = Pose {
            x_m: 6.0,
            y_m: 3.0,
            heading_rad: FRAC_PI_2,
        };
        let other = plant.spawn(&sedan, across, 0.0);
        let contact = (0..40)
            .find_map(|_| plant.advance(0.05, 4))
            .expect("a contact");
        assert_eq!(contact.pair, (ego, other));
        near(contact.normal[0], 1.0);
        let party = |id| Party {
            body: &sedan,
            state: plant.state(id),
        };
        let it = Impact::of(
            party(ego),
            party(other),
            contact.normal,
            contact.closing_speed_mps,
        );
        assert_eq!(it.kind, CrashKind::Crossing, "{kind:?}");
        assert_eq!((it.ego_side, it.other_side), (Side::Front, Side::Left));
        assert!(
            (it.ego_delta_v_mps - 10.0).abs() < 0.05,
            "{}",
            it.ego_delta_v_mps
        );
    }
}

#[test]
fn a_contact_of_an_earlier_version_is_compared_as_far_as_it_says() {
    let ego = ("sedan", at(0.0, 0.0, 0.0, 20.0));
    let now = ContactEvent {
        between: ("ego".to_owned(), "ado".to_owned()),
        time_s: 3.0,
        closing_speed_mps: 10.0,
        point_m: [0.0, 0.0, 0.7],
        impact: Some(impact(
            ego,
            ("sedan", at(4.54, 0.0, 0.0, 10.0)),
            [1.0, 0.0],
            10.0,
        )),
    };
    let of_old = ContactEvent {
        impact: None,
        ..now.clone()
    };
    assert!(now.is_as_recorded(&of_old) && now.is_as_recorded(&now));
    assert!(!of_old.is_as_recorded(&now));
    let later = ContactEvent {
        time_s: 3.1,
        ..of_old.clone()
    };
    assert!(!now.is_as_recorded(&later));
}
