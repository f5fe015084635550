//! Gaps and contacts: when, where, how fast, and between whom.

use super::*;

/// Two sedans on one line; returns the contact and the time at its sample's start.
fn chase(
    kind: PlantKind,
    gap_m: f64,
    speeds_mps: (f64, f64),
    accels_mps2: (f64, f64),
    start_m: f64,
) -> Option<(f64, Contact, Box<dyn Plant>)> {
    let mut plant = plant(kind, DRY);
    let sedan = body("sedan");
    let behind = plant.spawn(&sedan, at(start_m, 0.0, 0.0), speeds_mps.0);
    let front_m = start_m + sedan.length_m + gap_m;
    let ahead = plant.spawn(&sedan, at(front_m, 0.0, 0.0), speeds_mps.1);
    plant.command(behind, drive(accels_mps2.0, 0.0));
    plant.command(ahead, drive(accels_mps2.1, 0.0));
    for index in 0..400 {
        if let Some(contact) = plant.advance(SAMPLE_S, 4) {
            return Some((f64::from(index) * SAMPLE_S, contact, plant));
        }
    }
    None
}

#[test]
fn contact_time_and_closing_speed_match_the_closed_form() {
    // (gap, speeds, accelerations, time, closing speed)
    let cases = [
        (10.0, (20.0, 0.0), (0.0, 0.0), 0.5, 20.0),
        (10.03, (31.0, 0.0), (0.0, 0.0), 10.03 / 31.0, 31.0),
        (3.0, (12.0, 10.5), (0.0, 0.0), 2.0, 1.5),
        (8.0, (15.0, 15.0), (0.0, -4.0), 2.0, 8.0),
        (5.0, (10.0, 10.0), (1.0, -1.5), 2.0, 5.0),
        // The front car is at rest after 2 s and 10 m: 17 m in all at 10 m/s.
        (7.0, (10.0, 10.0), (0.0, -5.0), 1.7, 8.367),
        (30.0, (10.0, 10.0), (0.0, -5.0), 4.0, 10.0),
        (0.2, (5.0, 4.0), (0.0, 0.0), 0.2, 1.0),
    ];
    for kind in KINDS {
        for (gap_m, speeds, accels, mut want_s, mut want_mps) in cases {
            if gap_m == 7.0 {
                want_s = (2.0 * gap_m / 5.0_f64).sqrt();
                want_mps = 5.0 * want_s;
            }
            for start_m in [0.0, 700.0] {
                let (before_s, contact, plant) =
                    chase(kind, gap_m, speeds, accels, start_m).expect("a contact");
                let what = format!("{kind:?}, gap {gap_m} from {start_m}");
                close(
                    before_s + contact.after_s,
                    want_s,
                    0.001,
                    &format!("time, {what}"),
                );
                close(
                    contact.closing_speed_mps,
                    want_mps,
                    0.02,
                    &format!("closing, {what}"),
                );
                assert_eq!(contact.pair, (BodyId(0), BodyId(1)));
                close(
                    plant.gap_m(BodyId(0), BodyId(1)),
                    0.0,
                    2e-4,
                    &format!("gap, {what}"),
                );
                let front_m = plant.state(BodyId(0)).pose.x_m;
                close(contact.point_m[0], front_m, 1e-3, "between the bumpers");
                close(contact.point_m[1], 0.0, 1e-3, "in the middle of the lane");
            }
        }
    }
}

#[test]
fn contact_comes_exactly_when_the_bumpers_are_a_length_apart() {
    for kind in KINDS {
        let (.., plant) = chase(kind, 6.0, (20.0, 15.0), (2.0, -8.0), 0.0).expect("a contact");
        let headway_m = plant.state(BodyId(1)).pose.x_m - plant.state(BodyId(0)).pose.x_m;
        close(headway_m, 4.54, 2e-4, "headway at contact");
    }
}

#[test]
fn cars_in_adjacent_lanes_pass_without_contact() {
    for kind in KINDS {
        for lateral_m in [3.5, 1.82, 1.801] {
            for (speeds, heading_rad) in [((30.0, 5.0), 0.0), ((25.0, 25.0), core::f64::consts::PI)]
            {
                let mut plant = plant(kind, DRY);
                let sedan = body("sedan");
                plant.spawn(&sedan, at(0.0, 0.0, 0.0), speeds.0);
                plant.spawn(&sedan, at(20.0, lateral_m, heading_rad), speeds.1);
                let mut least_m = f64::INFINITY;
                for _ in 0..60 {
                    assert_eq!(plant.advance(SAMPLE_S, 4), None, "{kind:?} {lateral_m}");
                    least_m = least_m.min(plant.gap_m(BodyId(0), BodyId(1)));
                }
                close(least_m, lateral_m - 1.8, 2e-4, "clearance when abreast");
            }
        }
    }
}

#[test]
fn a_car_that_crosses_is_hit_in_the_flank() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        plant.spawn(&sedan, at(-10.0, 0.0, 0.0), 20.0);
        plant.spawn(&sedan, at(2.0, -5.0, core::f64::consts::FRAC_PI_2), 10.0);
        // The flank at x = 2 − 0.9 is 11.1 m away; by then the other is across.
        let mut elapsed_s = 0.0;
        let contact = loop {
            match plant.advance(SAMPLE_S, 4) {
                Some(contact) => break contact,
                None => elapsed_s += SAMPLE_S,
            }
            assert!(elapsed_s < 1.0, "{kind:?}: no contact");
        };
        close(elapsed_s + contact.after_s, 0.555, 0.002, "time");
        close(contact.closing_speed_mps, 20.0, 0.01, "closing speed");
        close(contact.point_m[0], 1.1, 0.01, "on the flank");
    }
}

#[test]
fn gap_is_the_clearance_of_oriented_boxes() {
    let half_pi = core::f64::consts::FRAC_PI_2;
    let corner_m = (2.0_f64.powi(2) + 3.0_f64.powi(2)).sqrt();
    // (pose of the other front bumper, clearance from a sedan at the origin)
    let cases = [
        (at(14.54, 0.0, 0.0), 10.0),
        (at(-14.54, 0.0, 0.0), 10.0),
        (at(0.0, 3.5, 0.0), 1.7),
        (at(2.0 + 4.54, 1.8 + 3.0, 0.0), corner_m),
        (at(0.0, -3.0, half_pi), 2.1),
        (at(5.0, 0.0, core::f64::consts::PI), 5.0),
        (at(3.0, 0.0, 0.0), 0.0),
        (at(0.0, 0.0, 0.0), 0.0),
    ];
    for kind in KINDS {
        for (pose, want_m) in cases {
            let mut plant = plant(kind, DRY);
            let sedan = body("sedan");
            let (a, b) = (
                plant.spawn(&sedan, Pose::default(), 0.0),
                plant.spawn(&sedan, pose, 0.0),
            );
            close(
                plant.gap_m(a, b),
                want_m,
                1e-5,
                &format!("{kind:?} {pose:?}"),
            );
            assert_eq!(plant.gap_m(a, b), plant.gap_m(b, a));
        }
    }
}

#[test]
fn bodies_that_overlap_are_in_contact_at_once_and_stay() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        let rear = plant.spawn(&sedan, Pose::default(), 5.0);
        plant.spawn(&sedan, at(4.0, 0.0, 0.0), 3.0);
        for _ in 0..2 {
            let contact = plant.advance(SAMPLE_S, 4).expect("overlap is contact");
            assert_eq!(contact.after_s, 0.0);
            close(contact.closing_speed_mps, 2.0, 1e-5, "closing speed");
            close(plant.state(rear).pose.x_m, 0.0, 1e-6, "nobody moves on");
        }
    }
}

#[test]
fn of_eight_cars_the_first_pair_to_touch_is_reported() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        for index in 0..8 {
            plant.spawn(&sedan, at(-12.0 * f64::from(index), 0.0, 0.0), 20.0);
        }
        // Number 3 brakes, so number 4 runs into it; the others keep off.
        plant.command(BodyId(3), drive(-6.0, 0.0));
        let contact = (0..200)
            .find_map(|_| plant.advance(SAMPLE_S, 4))
            .expect("a contact");
        assert_eq!(contact.pair, (BodyId(3), BodyId(4)), "{kind:?}");
        close(
            contact.closing_speed_mps,
            (2.0 * 6.0 * 7.46_f64).sqrt(),
            0.1,
            "closing speed",
        );
    }
}

#[test]
fn a_car_hits_a_pedestrian_who_steps_out() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        plant.spawn(&body("sedan"), at(0.0, 0.0, 0.0), 15.0);
        let walker = plant.spawn(
            &body("pedestrian"),
            at(20.0, -2.0, core::f64::consts::FRAC_PI_2),
            0.0,
        );
        let (x_mps, y_mps) = (0.0, 2.0);
        plant.command(walker, BodyCommand::Walk { x_mps, y_mps });
        let mut elapsed_s = 0.0;
        let contact = loop {
            match plant.advance(SAMPLE_S, 4) {
                Some(contact) => break contact,
                None => elapsed_s += SAMPLE_S,
            }
            assert!(elapsed_s < 3.0, "{kind:?}: no contact");
        };
        // Facing across the lane, the walker is 0.6 m long along it.
        close(
            elapsed_s + contact.after_s,
            (20.0 - 0.3) / 15.0,
            0.002,
            "time",
        );
        close(contact.closing_speed_mps, 15.0, 0.01, "closing speed");
        assert_eq!(contact.pair, (BodyId(0), walker));
    }
}

#[test]
fn a_plant_in_contact_reports_it_again_and_moves_nobody() {
    for kind in KINDS {
        let (.., mut plant) = chase(kind, 1.0, (6.0, 5.0), (0.0, 0.0), 0.0).expect("a contact");
        let before = [BodyId(0), BodyId(1)].map(|id| plant.state(id).pose);
        plant.command(BodyId(0), drive(-9.0, 0.0));
        let again = plant.advance(SAMPLE_S, 4).expect("they are still closing");
        close(again.after_s, 0.0, 1e-4, "at once");
        for (before, id) in before.into_iter().zip([BodyId(0), BodyId(1)]) {
            close(plant.state(id).pose.x_m, before.x_m, 1e-3, "place");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// The step at which boxes first overlap in fine sampling is the contact's.
    #[test]
    fn contacts_are_where_fine_sampling_sees_them(
        x_m in 5.0..15.0, y_m in -6.0..6.0, heading_rad in -3.1..3.1,
        speeds in (5.0..20.0, 0.0..20.0), curvatures in (-0.05..0.05, -0.05..0.05),
    ) {
        for kind in KINDS {
            let sedan = body("sedan");
            let spawned = || {
                let mut plant = plant(kind, DRY);
                plant.spawn(&sedan, Pose::default(), speeds.0);
                plant.spawn(&sedan, at(x_m, y_m, heading_rad), speeds.1);
                plant.command(BodyId(0), drive(0.0, curvatures.0));
                plant.command(BodyId(1), drive(-2.0, curvatures.1));
                plant
            };
            let mut coarse = spawned();
            let Some((before_s, contact)) = (0..40).find_map(|index| {
                let before_s = f64::from(index) * SAMPLE_S;
                coarse.advance(SAMPLE_S, 4).map(|contact| (before_s, contact))
            }) else { continue };
            let when_s = before_s + contact.after_s;
            prop_assert!(coarse.gap_m(BodyId(0), BodyId(1)) < 1e-3);
            prop_assert!(0.0 <= contact.closing_speed_mps && contact.closing_speed_mps <= speeds.0 + speeds.1 + 2.5);
            // The same run, stopped just before: close, but not in contact.
            if 0.002 < when_s {
                let mut fine = spawned();
                let whole = (before_s / SAMPLE_S).round() as usize;
                for _ in 0..whole { prop_assert!(fine.advance(SAMPLE_S, 4).is_none()); }
                let rest_s = when_s - before_s - 0.001;
                if 0.0 < rest_s {
                    prop_assert!(fine.advance(rest_s, 4).is_none(), "{kind:?}");
                    prop_assert!(fine.gap_m(BodyId(0), BodyId(1)) < 0.1, "{kind:?}");
                }
            }
        }
    }
}

#[test]
fn bodies_that_pass_through_each_other_move_as_if_alone() {
    for kind in KINDS {
        let sedan = body("sedan");
        let drives = |fronts_m: &[f64]| -> Box<dyn Plant> {
            let mut plant = plant(kind, DRY);
            plant.pass_through();
            // A plant that is used again still lets them through.
            plant.clear(DRY);
            for front_m in fronts_m {
                plant.spawn(&sedan, at(*front_m, 0.0, 0.0), 20.0 - front_m);
            }
            for _ in 0..40 {
                assert_eq!(plant.advance(SAMPLE_S, 4), None, "{kind:?}");
            }
            plant
        };
        let both = drives(&[0.0, 10.0]);
        for (body, front_m) in [0.0, 10.0].into_iter().enumerate() {
            let alone = drives(&[front_m]);
            assert_eq!(both.state(BodyId(body)), alone.state(BodyId(0)));
        }
        // Who was behind is ahead now.
        let front_m = |body: usize| both.state(BodyId(body)).pose.x_m;
        assert!(front_m(1) + 5.0 < front_m(0), "{kind:?}");
    }
}

#[test]
fn a_jump_touches_nothing_on_its_way() {
    for kind in KINDS {
        let mut plant = plant(kind, DRY);
        let sedan = body("sedan");
        let jumping = plant.spawn(&sedan, at(0.0, 0.0, 0.0), 10.0);
        let standing = plant.spawn(&sedan, at(20.0, 0.0, 0.0), 0.0);
        plant.command(standing, drive(-1.0, 0.0));
        plant.command(
            jumping,
            BodyCommand::Jump {
                to: at(60.0, 1.0, 0.5),
            },
        );
        assert_eq!(plant.advance(SAMPLE_S, 4), None, "{kind:?}");
        let pose = plant.state(jumping).pose;
        close(pose.x_m, 60.0, 1e-9, "jumped");
        close(pose.heading_rad, 0.5, 1e-9, "turned");
        assert!(plant.fork().gap_m(jumping, standing) > 30.0);
        // Carried on from there, and with contacts again.
        let (sin, cos) = libm::sincos(0.5);
        let to = at(60.0 + cos, 1.0 + sin, 0.5);
        plant.command(jumping, BodyCommand::Carry { to });
        assert_eq!(plant.advance(SAMPLE_S, 4), None, "{kind:?}");
        close(plant.state(jumping).speed_mps, 20.0, 1e-6, "carried on");
        plant.command(
            jumping,
            BodyCommand::Jump {
                to: at(21.0, 0.5, 0.0),
            },
        );
        let contact = plant.advance(SAMPLE_S, 4).expect("on the other body");
        assert_eq!(contact.pair, (jumping, standing), "{kind:?}");
        assert!(plant.sound());
    }
}
