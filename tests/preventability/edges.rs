//! Contacts at the end of an episode, side by side, and in narrow lanes.

use brakecheck::preventability::{Label, NotApplicable, Seat, Struck};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::Scenario;
use serde_json::Value;

use super::by_hand::{CAR, Car, FAR, field, lanes, lanes_of, motion};

/// Episodes last 20 s. A driver that only delays a contact has not avoided it.
#[test]
fn a_contact_after_the_end_of_the_episode_counts() {
    // The gap of 22 m closes at 1 m/s, and the record ends before.
    let ahead = Car {
        x_m: 4.54 + 22.0,
        speed_mps: 19.0,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let case = replayer.case(&motion([CAR, ahead, FAR], 19.5, ["ego", "ado"]));
    let late = replayer.from_start(&case, Seat::Nominal, None);
    let contact = late.contact.expect("a contact");
    assert!((contact.time_s - 22.0).abs() < 0.051, "{contact:?}");
    // Five seconds after the recorded contact, the replay ends.
    let ahead = Car {
        x_m: 4.54 + 26.0,
        ..ahead
    };
    let case = replayer.case(&motion([CAR, ahead, FAR], 19.5, ["ego", "ado"]));
    let later = replayer.from_start(&case, Seat::Nominal, None);
    assert!(later.avoided, "{later:?}");
}

#[test]
fn an_other_exactly_beside_the_ego_is_in_front_and_not_at_its_side() {
    let stands = Car {
        speed_mps: 0.0,
        ..CAR
    };
    let beside = |x_m: f64| Car {
        x_m,
        y_m: 2.0,
        lateral_mps: -1.0,
        ..stands
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let mut struck = |x_m: f64| {
        let case = replayer.case(&motion([stands, beside(x_m), FAR], 0.5, ["ego", "ado"]));
        let outcome = replayer.from_start(&case, Seat::Recorded, None);
        outcome.contact.expect("a contact").struck
    };
    assert_eq!(struck(0.0), Struck::Front);
    assert_eq!(struck(-0.1), Struck::Side);
}

/// Who is as wide as the lane is inside it in its middle only.
#[test]
fn an_ego_as_wide_as_its_lane_is_in_it_exactly_in_the_middle() {
    let mut replayer = lanes_of(1.8, 0.9).replayer().expect("driven");
    let mut exonerated = |y_m: f64| {
        let ego = Car { y_m, ..CAR };
        let behind = Car {
            x_m: -4.6,
            y_m,
            ..CAR
        };
        let motion = motion([ego, behind, FAR], 0.5, ["ego", "ado"]);
        field(&replayer.assess(&motion, None), "exonerated")
    };
    assert_eq!(exonerated(0.0), "StruckFromBehind");
    assert_eq!(exonerated(0.01), Value::Null);
}

/// A vehicle that reverses towards the ego is on no axis that the drivers judge.
#[test]
fn a_third_car_that_comes_towards_the_ego_is_no_reason_to_react() {
    let ahead = Car { x_m: 60.0, ..CAR };
    let third = |speed_mps: f64| Car {
        x_m: 90.0,
        speed_mps,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let mut known = |speed_mps: f64| {
        replayer.assess(
            &motion([CAR, ahead, third(speed_mps)], 2.0, ["ego", "ado"]),
            None,
        )
    };
    let comes = known(-0.6);
    assert_eq!(comes.not_applicable, Some(NotApplicable::NobodyAhead));
    assert_eq!(comes.handover_s, None);
    // One that stands is in the way.
    assert_eq!(known(-0.4).handover_s, Some(0.0));
}

/// A driver takes over when it sees the other, as the ego does in the replay.
#[test]
fn the_handover_waits_for_the_range_of_the_sensors() {
    // A gap of 50 m that closes at 10 m/s.
    let ahead = Car {
        x_m: 54.54,
        speed_mps: 10.0,
        ..CAR
    };
    let handover_s = |world: &Scenario| {
        let mut replayer = world.replayer().expect("driven");
        let known = replayer.assess(&motion([CAR, ahead, FAR], 4.9, ["ego", "ado"]), None);
        known.handover_s.expect("a handover")
    };
    let far = lanes(0.9);
    assert_eq!(handover_s(&far), 0.0);
    let near = "sensors: (range_m: 30.2), plant: Kinematic";
    let near = far.text().replacen("plant: Kinematic", near, 1);
    let near = Scenario::parse("near.ron", &near).expect("sound");
    // At 2.0 s the gap is 30 m.
    assert!((handover_s(&near) - 2.0).abs() < 1e-9);
}

/// The cut-in is that of the agent that the ego touches, whichever it is.
#[test]
fn a_cut_in_is_that_of_the_car_that_was_hit() {
    let cuts = Car {
        x_m: 34.54,
        y_m: 3.52,
        speed_mps: 15.0,
        lateral_mps: -1.0,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let mut cut_in = |cars: [Car; 3], with: &str| {
        let known = replayer.assess(&motion(cars, 2.5, ["ego", with]), None);
        field(&known, "cut_in")["time_s"].as_f64()
    };
    let near = |found: Option<f64>| found.is_some_and(|it| (it - 1.2).abs() < 1e-6);
    assert!(near(cut_in([CAR, cuts, FAR], "ado")));
    assert!(near(cut_in([CAR, FAR, cuts], "third")));
    assert_eq!(cut_in([CAR, cuts, FAR], "third"), None);
}

/// Tyres with less grip brake as all tyres do on a road with less friction.
#[test]
fn the_grip_of_the_ego_s_tyres_bounds_its_braking() {
    let text = lanes(0.9).text().to_owned();
    let slick = "bodies: { \"slick\": (name: \"slick\", kind: Vehicle(wheelbase_m: 2.7, \
                 track_m: 1.56, front_overhang_m: 0.92, wheel_radius_m: 0.33, power_w: 1e5, \
                 grip: 0.4), length_m: 4.54, width_m: 1.8, height_m: 1.45, mass_kg: 1500.0, \
                 com_height_m: 0.55) }, plant: Kinematic, ";
    let text = text.replacen("plant: Kinematic, ", slick, 1).replacen(
        "body: \"sedan\"",
        "body: \"slick\"",
        1,
    );
    let slick = Scenario::parse("slick.ron", &text).unwrap_or_else(|error| panic!("{error}"));
    let stands = Car {
        x_m: 4.54 + 46.0,
        speed_mps: 0.0,
        ..CAR
    };
    let record = motion([CAR, stands, FAR], 2.3, ["ego", "ado"]);
    let label = |world: &Scenario| {
        let mut replayer = world.replayer().expect("driven");
        replayer.assess(&record, None).label
    };
    assert_eq!(label(&lanes(0.9)), Label::AvoidedBySome);
    assert_eq!(label(&slick), Label::UnavoidableByBraking);
}

/// Rules are judged on each replay, in which the ados drive on as recorded.
#[test]
fn a_replay_keeps_the_rules_if_its_ados_keep_them() {
    // The lead car is at 65 m at the contact, and farther on in replays without one.
    for (most_m, kept_beyond) in [(999.0, true), (70.0, false)] {
        let rule = format!("(ado.x <= {most_m:?})");
        let text = lanes(0.9).text().replace("(ado.speed >= -99)", &rule);
        let ado = "start: At(x_m: 50.0, speed_mps: 20.0)";
        assert!(text.contains(ado), "{text}");
        let text = text.replace(ado, "start: At(x_m: 50.0, speed_mps: 5.0)");
        // The specification is violated before the contact.
        let judge = "plant: Kinematic, judge: UntilContact, ";
        let text = text.replace("plant: Kinematic, ", judge);
        let world = Scenario::parse("rule.ron", &text).unwrap_or_else(|error| panic!("{error}"));
        let mut bench = world.bench();
        let mut ado = Constant(0);
        let start = Start(Vec::new());
        let episode = play(&mut bench, &start, 0, &mut ado, Aftermath::Play);
        assert!(episode.contact.is_some(), "{:?}", episode.verdict);
        let known = world.preventability(&episode);
        let outcomes: Vec<_> = known.handover.values().chain(known.t0.values()).collect();
        assert!(outcomes.iter().any(|it| it.avoided), "{known}");
        for outcome in outcomes {
            let kept = kept_beyond || !outcome.avoided;
            assert_eq!(outcome.rules_kept, Some(kept), "{most_m}: {outcome:?}");
            // ψ_ego wants half a metre more than no contact.
            let robustness = outcome.robustness.expect("judged");
            assert!(outcome.avoided || robustness < 0.0, "{outcome:?}");
            assert!(!outcome.avoided || robustness > -0.5, "{outcome:?}");
        }
    }
}

/// A recorded motion holds no actions, so replays do not have those of the episode.
#[test]
fn a_rule_about_actions_is_not_judged_on_a_replay() {
    let rule = "((ado.speed >= -99) and (ado.action >= -1))";
    let text = lanes(0.9).text().replace("(ado.speed >= -99)", rule);
    let ado = "start: At(x_m: 50.0, speed_mps: 20.0)";
    let text = text.replace(ado, "start: At(x_m: 50.0, speed_mps: 5.0)");
    let judge = "plant: Kinematic, judge: UntilContact, ";
    let text = text.replace("plant: Kinematic, ", judge);
    let world = Scenario::parse("rule.ron", &text).unwrap_or_else(|error| panic!("{error}"));
    let mut bench = world.bench();
    let mut ado = Constant(0);
    let episode = play(&mut bench, &Start(Vec::new()), 0, &mut ado, Aftermath::Play);
    assert!(episode.contact.is_some(), "{:?}", episode.verdict);
    let known = world.preventability(&episode);
    assert!(!known.handover.is_empty(), "{known}");
    for outcome in known.handover.values() {
        assert_eq!(outcome.rules_kept, None, "{outcome:?}");
        assert!(outcome.robustness.is_some(), "{outcome:?}");
    }
}

/// Without danger a driver takes the speed of the recorded ego at once, up to its limit.
#[test]
fn a_driver_without_danger_keeps_up_with_the_recorded_speed() {
    let ego = Car {
        speed_mps: 10.0,
        accel_mps2: 1.0,
        ..CAR
    };
    // It is slower from the start, and 100 m ahead.
    let ahead = Car {
        x_m: 4.54 + 100.0,
        speed_mps: 9.9,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let known = replayer.assess(&motion([ego, ahead, FAR], 14.0, ["ego", "ado"]), None);
    assert_eq!(known.handover_s, Some(0.0));
    // At 10 m/s no driver would ever come near.
    let reacted: Vec<_> = known.handover.values().map(|it| it.reacted_s).collect();
    assert!(
        reacted.iter().any(|it| it.is_some_and(|it| it < 14.0)),
        "{reacted:?}"
    );
}
