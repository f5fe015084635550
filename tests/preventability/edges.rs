//! Contacts at the end of an episode, side by side, and in narrow lanes.

use brakecheck::preventability::{Seat, Struck};
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
