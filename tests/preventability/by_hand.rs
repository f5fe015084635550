//! Motions made by hand, for each reason, instant and label.

use brakecheck::ego::ReferenceDriver;
use brakecheck::preventability::{Label, NotApplicable, Preventability, Seat, Struck};
use brakecheck::scene::{BodySample, BodyState, ContactEvent, Motion, Pose, Start};
use brakecheck::testbench::motion_of;
use brakecheck::world::{PlantKind, Scenario};
use serde_json::Value;

use super::{contacts, world};

const SAMPLE_S: f64 = 0.05;

/// Two lanes with an ego and two other sedans, which are 4.54 m long and 1.8 m wide.
pub(super) fn lanes(friction: f64) -> Scenario {
    lanes_of(3.5, friction)
}

pub(super) fn lanes_of(width_m: f64, friction: f64) -> Scenario {
    let car = |name: &str, drive: &str| {
        format!(
            "Vehicle(name: \"{name}\", body: \"sedan\", lane: 0, \
             start: At(x_m: 0.0, speed_mps: 20.0), drive: {drive})"
        )
    };
    let ado = "Ado(actions: Accelerations([0.0]), neutral: 0, observe: [\"ego.speed\"], \
               rulebook: [Rule(name: \"stays\", stl: \"always (ado.speed >= -99)\")])";
    let agents = [
        car("ego", "Ego(Coast(accel_mps2: 0.0, lag_s: 0.05))"),
        car("ado", ado).replace("x_m: 0.0", "x_m: 50.0"),
        car("third", "Scripted(Stand)").replace("x_m: 0.0", "x_m: 500.0"),
    ]
    .join(", ")
    .replace(
        "speed_mps: 20.0), drive: Scripted",
        "speed_mps: 0.0), drive: Scripted",
    );
    let text = format!(
        "Scenario(name: \"lanes\", question: \"?\", \
         clock: (horizon_s: 20.0, decision_s: 0.5, sample_s: {SAMPLE_S:?}, substeps: 5), \
         plant: Kinematic, \
         road: Straight(lanes: 2, lane_width_m: {width_m:?}, friction: {friction:?}), \
         agents: [{agents}], ego_spec: \"always (ego.ado.gap >= 0.5)\")"
    );
    Scenario::parse("lanes.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// A car as a function of time: place, heading, speeds and acceleration.
#[derive(Clone, Copy)]
pub(super) struct Car {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) heading_rad: f64,
    pub(super) speed_mps: f64,
    pub(super) lateral_mps: f64,
    pub(super) accel_mps2: f64,
    /// Time from which it accelerates and moves sideways.
    pub(super) from_s: f64,
}

pub(super) const CAR: Car = Car {
    x_m: 0.0,
    y_m: 0.0,
    heading_rad: 0.0,
    speed_mps: 20.0,
    lateral_mps: 0.0,
    accel_mps2: 0.0,
    from_s: 0.0,
};

impl Car {
    fn at(&self, time_s: f64) -> BodySample {
        let active_s = (time_s - self.from_s).max(0.0);
        let is_active = self.from_s <= time_s;
        let gained_mps = self.accel_mps2 * active_s;
        let ahead_m = self.speed_mps * time_s + 0.5 * gained_mps * active_s;
        BodySample {
            state: BodyState {
                pose: Pose {
                    x_m: self.x_m + ahead_m * self.heading_rad.cos(),
                    y_m: self.y_m + ahead_m * self.heading_rad.sin() + self.lateral_mps * active_s,
                    heading_rad: self.heading_rad,
                },
                speed_mps: self.speed_mps + gained_mps,
                lateral_mps: if is_active { self.lateral_mps } else { 0.0 },
                yaw_rate_rad_per_s: 0.0,
                accel_mps2: if is_active { self.accel_mps2 } else { 0.0 },
            },
            command: None,
        }
    }
}

/// Cars up to a contact of two of them.
pub(super) fn motion(cars: [Car; 3], end_s: f64, between: [&str; 2]) -> Motion {
    let row = |sample: usize| cars.map(|car| car.at(sample as f64 * SAMPLE_S));
    let mut motion = Motion::new(Start(Vec::new()), &row(0));
    let samples = (end_s / SAMPLE_S).round() as usize;
    for sample in 1..=samples {
        motion.push(&row(sample));
    }
    motion.end_s = end_s;
    motion.contact = Some(ContactEvent {
        between: (between[0].to_owned(), between[1].to_owned()),
        time_s: end_s,
        closing_speed_mps: 7.0,
        point_m: [0.0; 3],
        impact: None,
    });
    motion
}

pub(super) const FAR: Car = Car {
    x_m: 500.0,
    y_m: 3.5,
    ..CAR
};

/// The assessment of two cars, with the third far away.
fn assessed(ego: Car, ado: Car, end_s: f64) -> Preventability {
    let mut replayer = lanes(0.9).replayer().expect("driven");
    replayer.assess(&motion([ego, ado, FAR], end_s, ["ego", "ado"]), None)
}

pub(super) fn field(known: &Preventability, name: &str) -> Value {
    serde_json::to_value(known).expect("JSON")[name].clone()
}

#[test]
fn the_drivers_judge_others_on_parallel_axes_only() {
    let ahead = |heading_rad: f64, speed_mps: f64| Car {
        x_m: 4.5 + 10.0,
        heading_rad,
        speed_mps,
        ..CAR
    };
    let turned = |degrees: f64| ahead(f64::to_radians(degrees), 15.0);
    let cases = [
        (turned(0.0), None),
        (turned(29.0), None),
        (turned(-29.0), None),
        (turned(31.0), Some(NotApplicable::Crossing)),
        (turned(-90.0), Some(NotApplicable::Crossing)),
        (turned(149.0), Some(NotApplicable::Crossing)),
        (turned(151.0), Some(NotApplicable::Oncoming)),
        (turned(180.0), Some(NotApplicable::Oncoming)),
        (ahead(0.0, -0.6), Some(NotApplicable::Oncoming)),
        (ahead(0.0, -0.4), None),
    ];
    for (ado, reason) in cases {
        let known = assessed(CAR, ado, 0.5);
        assert_eq!(
            known.not_applicable,
            reason,
            "{}",
            ado.heading_rad.to_degrees()
        );
        assert_eq!(known.label == Label::NotApplicable, reason.is_some());
    }
}

#[test]
fn a_contact_from_behind_or_of_two_others_is_not_the_drivers() {
    let at = |x_m: f64, y_m: f64| Car { x_m, y_m, ..CAR };
    // In the lane behind, and beside with the middle behind.
    let behind = assessed(CAR, at(-4.6, 0.0), 1.0);
    assert_eq!(behind.not_applicable, Some(NotApplicable::FromBehind));
    let beside = assessed(CAR, at(-2.0, 1.9), 1.0);
    assert_eq!(beside.not_applicable, Some(NotApplicable::NobodyAhead));
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let cars = [
        CAR,
        Car {
            speed_mps: 5.0,
            ..at(20.0, 0.0)
        },
        at(30.0, 0.0),
    ];
    let mut of = |between| replayer.assess(&motion(cars, 1.0, between), None);
    assert_eq!(
        of(["ado", "third"]).not_applicable,
        Some(NotApplicable::WithoutEgo)
    );
    // The order of the names does not matter.
    let orders = [["ego", "ado"], ["ado", "ego"]].map(of);
    assert_eq!(orders[0], orders[1]);
    assert_eq!(orders[0].not_applicable, None);
    let mut none = motion(cars, 1.0, ["ego", "ado"]);
    none.contact = None;
    let known = replayer.assess(&none, None);
    assert_eq!(known.not_applicable, Some(NotApplicable::NoContact));
    let motion = motion(cars, 1.0, ["ado", "third"]);
    assert!(
        lanes(0.9)
            .replayer()
            .expect("driven")
            .braking(&motion)
            .is_none()
    );
}

#[test]
fn who_stands_or_is_struck_from_behind_in_its_lane_is_not_at_fault() {
    let exonerated = |ego: Car, ado: Car| field(&assessed(ego, ado, 0.5), "exonerated");
    let stands = |speed_mps: f64| Car { speed_mps, ..CAR };
    let ahead = Car {
        x_m: 4.6,
        speed_mps: 0.0,
        ..CAR
    };
    assert_eq!(exonerated(stands(0.5), ahead), "Standing");
    assert_eq!(exonerated(stands(0.6), ahead), Value::Null);
    // The lane is 3.5 m wide and the ego 1.8 m: 0.85 m to either side.
    for (y_m, reason) in [
        (0.0, Value::from("StruckFromBehind")),
        (0.84, Value::from("StruckFromBehind")),
        (-0.84, Value::from("StruckFromBehind")),
        (3.5 - 0.84, Value::from("StruckFromBehind")),
        (0.86, Value::Null),
        (-0.86, Value::Null),
        (1.75, Value::Null),
    ] {
        let ego = Car { y_m, ..CAR };
        assert_eq!(
            exonerated(
                ego,
                Car {
                    x_m: -4.6,
                    y_m,
                    ..CAR
                }
            ),
            reason,
            "{y_m}"
        );
        let front = Car {
            x_m: 4.6,
            y_m,
            ..CAR
        };
        assert_eq!(exonerated(ego, front), Value::Null, "{y_m}");
    }
    // Beside, with more overlap lengthwise than sideways: no rear.
    let beside = Car {
        x_m: -2.0,
        y_m: 1.7,
        ..CAR
    };
    assert_eq!(exonerated(CAR, beside), Value::Null);
}

/// The handover comes with a road user ahead, near, and slower or braking.
#[test]
fn the_handover_is_the_first_reason_to_react() {
    let handover = |ado: Car| assessed(CAR, ado, 3.0).handover_s;
    let ahead = Car { x_m: 60.0, ..CAR };
    assert_eq!(
        handover(Car {
            speed_mps: 19.9,
            ..ahead
        }),
        Some(0.0)
    );
    assert_eq!(handover(ahead), None);
    assert_eq!(
        handover(Car {
            speed_mps: 20.1,
            ..ahead
        }),
        None
    );
    // It brakes while it is still faster.
    let brakes = |accel_mps2: f64| Car {
        speed_mps: 24.0,
        accel_mps2,
        from_s: 1.0,
        ..ahead
    };
    assert_eq!(handover(brakes(-1.1)), Some(1.0));
    assert_eq!(handover(brakes(-0.9)), None);
    assert_eq!(handover(brakes(1.1)), None);
    // In the next lane it wanders, or leaves its lane towards the ego.
    let beside = |y_m: f64| Car {
        y_m,
        speed_mps: 15.0,
        ..ahead
    };
    for (y_m, at_s) in [
        (3.5, None),
        (3.5 - 0.37, None),
        (3.5 - 0.38, Some(0.0)),
        (3.5 + 0.38, None),
        (-3.5 + 0.38, Some(0.0)),
        (-3.5 - 0.38, None),
    ] {
        assert_eq!(handover(beside(y_m)), at_s, "{y_m}");
    }
    // Nobody behind is a reason.
    let known = assessed(
        CAR,
        Car {
            x_m: -2.0,
            y_m: 1.9,
            speed_mps: 15.0,
            ..CAR
        },
        1.0,
    );
    assert_eq!(known.handover_s, None);
}

/// The ideal driver brakes when constant motion leads to a contact within 4 s.
#[test]
fn danger_begins_four_seconds_before_the_contact() {
    // A gap of 30 m closes at 5 m/s: 4 s are left after 2 s.
    let slower = Car {
        x_m: 34.54,
        speed_mps: 15.0,
        ..CAR
    };
    let danger_s = assessed(CAR, slower, 6.0).danger_s.expect("danger");
    assert!((danger_s - 2.0).abs() < 0.051, "{danger_s}");
    let behind = Car {
        x_m: -20.0,
        speed_mps: 25.0,
        y_m: 3.5,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let motion = motion([CAR, slower, behind], 6.0, ["ego", "ado"]);
    assert_eq!(replayer.assess(&motion, None).danger_s, Some(danger_s));
}

/// A car that moves over from the next lane at 1 m/s, 0.3 m inside at 1.15 s.
#[test]
fn a_cut_in_is_judged_when_it_is_0_3_m_inside() {
    // 3.5 m lanes and 1.8 m of width: 2.35 m off the ego's middle.
    let from = |y_m: f64, lateral_mps: f64| Car {
        x_m: 34.54,
        y_m,
        speed_mps: 15.0,
        lateral_mps,
        ..CAR
    };
    let cut_in = |ado: Car| field(&assessed(CAR, ado, 2.5), "cut_in");
    let near = |value: &Value, want: f64| {
        let got = value.as_f64().expect("a number");
        assert!((got - want).abs() < 1e-6, "{got}, not {want}");
    };
    for side in [1.0, -1.0] {
        let it = cut_in(from(side * 3.52, -side));
        near(&it["time_s"], 1.2);
        // 30 m less 6 m at 5 m/s.
        near(&it["ttc_s"], 4.8);
        near(&it["bound_s"], 5.0 / 12.0 + 0.35);
        assert_eq!(it["demands_avoidance"], true);
        assert_eq!(it["constant_speed"], true);
        assert_eq!(it["visible"], true);
    }
    // Seen moving sideways for less than 0.72 s.
    assert_eq!(cut_in(from(2.35 + 0.67, -1.0))["visible"], false);
    assert_eq!(cut_in(from(2.35 + 0.77, -1.0))["visible"], true);
    let late = Car {
        from_s: 0.5,
        ..from(2.35 + 0.67, -1.0)
    };
    assert_eq!(cut_in(late)["visible"], false);
    // So slow that nobody sees it.
    for lateral_mps in [-0.09, -0.1] {
        let slow = cut_in(from(2.35 + 0.12, lateral_mps));
        assert_eq!(slow["visible"], false, "{lateral_mps}");
    }
    assert_eq!(cut_in(from(2.35 + 0.12, -0.11))["visible"], true);
    // It changes its speed before.
    for (accel_mps2, constant) in [(-1.1, false), (1.1, false), (-0.9, true), (0.9, true)] {
        let ado = Car {
            accel_mps2,
            ..from(3.52, -1.0)
        };
        assert_eq!(cut_in(ado)["constant_speed"], constant, "{accel_mps2}");
    }
    // From too near nothing is demanded: the bound is 0.77 s, and 0.6 s are left.
    let near_by = cut_in(Car {
        x_m: 4.54 + 3.0 + 6.0,
        ..from(3.52, -1.0)
    });
    near(&near_by["ttc_s"], 0.6);
    assert_eq!(near_by["demands_avoidance"], false);
    // A gap that opens has no time to collision.
    let faster = cut_in(Car {
        speed_mps: 21.0,
        ..from(3.52, -1.0)
    });
    assert_eq!((&faster, &faster["ttc_s"]), (&Value::Null, &Value::Null));
    // Who is inside from the start did not cut in.
    assert_eq!(cut_in(from(2.3, -1.0)), Value::Null);
    assert_eq!(cut_in(from(0.0, 0.0)), Value::Null);
}

/// A standing car at 20 m/s: full braking with 0.05 s of lag takes 23.7 m, and the drivers
/// react later.
#[test]
fn a_label_names_the_weakest_driver_that_avoids_it() {
    let stands = |gap_m: f64| Car {
        x_m: 4.54 + gap_m,
        speed_mps: 0.0,
        ..CAR
    };
    let label = |gap_m: f64| assessed(CAR, stands(gap_m), gap_m / 20.0);
    let slower = Car {
        x_m: 4.54 + 60.0,
        speed_mps: 12.0,
        ..CAR
    };
    assert_eq!(assessed(CAR, slower, 7.5).label, Label::AvoidedByAll);
    assert_eq!(label(46.0).label, Label::AvoidedBySome);
    let perfect = label(30.0);
    assert_eq!(perfect.label, Label::OnlyByPerfect);
    let words = perfect.who_avoids().expect("judged");
    assert_eq!(
        words,
        "avoided by none of 6 reference drivers; only full braking without delay avoids it"
    );
    let none = label(20.0);
    assert_eq!(none.label, Label::UnavoidableByBraking);
    let words = none.to_string();
    assert!(
        words.contains("from the start does not avoid it either"),
        "{words}"
    );
    assert!(none.perfect.is_some_and(|it| !it.avoided));
    // Cut off without a warning: only who braked before would be behind.
    let cuts = Car {
        x_m: 4.54 + 42.0,
        y_m: 3.5,
        speed_mps: 0.0,
        lateral_mps: -7.0,
        from_s: 1.6,
        ..CAR
    };
    let foresight = assessed(CAR, cuts, 2.05);
    assert_eq!(foresight.label, Label::OnlyByForesight);
    assert!(foresight.foresight.is_some_and(|it| it.avoided));
    // Friction bounds all braking.
    let wet = |gap_m: f64| {
        let mut replayer = lanes(0.4).replayer().expect("driven");
        let motion = motion([CAR, stands(gap_m), FAR], gap_m / 20.0, ["ego", "ado"]);
        replayer.assess(&motion, None).label
    };
    assert_eq!(wet(46.0), Label::UnavoidableByBraking);
}

/// Braking from the start is hit from behind, and so is braking at the danger: a chance
/// between the two counts as foresight.
#[test]
fn every_sample_of_full_braking_is_tried_before_it_is_called_unavoidable() {
    let ado = Car {
        x_m: 4.54 + 72.0,
        y_m: 3.5,
        speed_mps: 0.0,
        lateral_mps: -7.0,
        from_s: 3.1,
        ..CAR
    };
    // It follows at 3 m and leaves the lane after a second.
    let follower = Car {
        x_m: -7.54,
        lateral_mps: 7.0,
        from_s: 1.0,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let motion = motion([CAR, ado, follower], 3.55, ["ego", "ado"]);
    let known = replayer.assess(&motion, None);
    assert!(
        known.foresight.as_ref().is_some_and(|it| !it.avoided),
        "{known:?}"
    );
    assert!(
        known.perfect.as_ref().is_some_and(|it| !it.avoided),
        "{known:?}"
    );
    assert_eq!(known.label, Label::OnlyByForesight);
    let mut braking = replayer.braking(&motion).expect("replays");
    let last = braking.last().expect("a chance");
    assert!(braking.avoids(last) && !braking.avoids(last + 1) && !braking.avoids(0));
    // From the contact on it is too late.
    assert!(!braking.avoids(71) && !braking.avoids(1000));
}

/// The ego speeds up by itself: who keeps the initial speed avoids the car.
#[test]
fn an_ego_that_speeds_up_inflicts_it_on_itself() {
    let ego = Car {
        speed_mps: 10.0,
        accel_mps2: 6.0,
        ..CAR
    };
    // At 2.2 s it has 23.2 m/s and is 36.5 m on.
    let stands = Car {
        x_m: 4.54 + 52.0,
        y_m: 3.5,
        speed_mps: 0.0,
        lateral_mps: -7.0,
        from_s: 2.15,
        ..CAR
    };
    let known = assessed(ego, stands, 2.6);
    assert!(known.self_inflicted, "{known}");
    assert!(known.to_string().ends_with("self-inflicted"), "{known}");
    let t0: Vec<bool> = known.t0.values().map(|it| it.avoided).collect();
    assert!(t0.contains(&true) && known.any_driver().is_some());
    // At a constant speed both are the same, and nothing is its own fault.
    let steady = assessed(
        CAR,
        Car {
            speed_mps: 0.0,
            ..FAR_AHEAD
        },
        1.0,
    );
    assert!(!steady.self_inflicted);
}

const FAR_AHEAD: Car = Car { x_m: 34.54, ..CAR };

/// What an outcome says of its contact follows from the contact.
#[test]
fn an_outcome_compares_its_contact_with_the_recorded_one() {
    let (mut hits, mut avoided, mut sides) = (0, 0, 0);
    for name in ["acc", "cut_in", "merge_plain"] {
        let world = world(name, PlantKind::Kinematic);
        for (episode, motion) in contacts(&world, 5) {
            let known = world.preventability(&episode);
            let recorded_mps = motion
                .contact
                .as_ref()
                .expect("a contact")
                .closing_speed_mps;
            for outcome in known.handover.values().chain(known.t0.values()) {
                assert_eq!(outcome.avoided, outcome.contact.is_none());
                let now_mps = outcome.contact.as_ref().map(|it| it.closing_speed_mps);
                assert_eq!(outcome.saved_mps, recorded_mps - now_mps.unwrap_or(0.0));
                match now_mps {
                    Some(now_mps) => {
                        assert_eq!(outcome.margin, Some(-now_mps));
                        hits += 1;
                    }
                    None => {
                        assert!(outcome.margin.is_none_or(|gap_m| gap_m > 0.0));
                        avoided += 1;
                    }
                }
                if let Some(contact) = &outcome.contact {
                    assert_eq!(contact.with, "ado");
                    sides += usize::from(contact.struck == Struck::Front);
                }
                // The rulebook is judged on the trace of the replay.
                let robustness = outcome.robustness.expect("judged");
                assert!(outcome.avoided || robustness < 0.0 || name == "merge_plain");
                assert!(outcome.rules_kept.is_some());
            }
            // Without a trace nothing is judged.
            let mut replayer = world.replayer().expect("driven");
            let unjudged = replayer.assess(&motion, None);
            assert_eq!(unjudged.label, known.label);
            let outcomes = unjudged.handover.values();
            let unjudged = outcomes.map(|it| (it.rules_kept, it.robustness));
            assert!(unjudged.into_iter().all(|it| it == (None, None)));
        }
    }
    assert!(
        hits > 5 && avoided > 5 && sides > 0,
        "{hits} {avoided} {sides}"
    );
}

/// Replays have the weather and the road of the start, so they say nothing where an ado
/// changes them.
#[test]
fn changing_weather_and_roads_have_no_replays() {
    for (name, reason) in [
        ("wet_bend", NotApplicable::ChangingWeather),
        ("fog_queue", NotApplicable::ChangingWeather),
        ("tightening_bend", NotApplicable::ChangingRoad),
        ("crest_bend", NotApplicable::ChangingRoad),
    ] {
        let world = world(name, PlantKind::Kinematic);
        let mut bench = world.bench();
        let start = bench.draw(brakecheck::seed::StartKey {
            purpose: brakecheck::seed::Purpose::Train,
            seed: 7,
            index: 0,
        });
        let mut ado = brakecheck::testbench::Constant(0);
        let aftermath = brakecheck::testbench::Aftermath::Skip;
        let episode = brakecheck::testbench::play(&mut bench, &start, 0, &mut ado, aftermath);
        let mut motion = motion_of(&mut bench, &episode).expect("bodies");
        motion.contact = Some(ContactEvent {
            between: ("ego".to_owned(), "other".to_owned()),
            time_s: 1.0,
            closing_speed_mps: 1.0,
            point_m: [0.0; 3],
            impact: None,
        });
        let mut replayer = world.replayer().expect("driven");
        let known = replayer.assess(&motion, None);
        assert_eq!(known.not_applicable, Some(reason), "{name}");
        let avoided = replayer.is_avoided_by_any(&motion, &[ReferenceDriver::Ideal]);
        assert_eq!(avoided, None, "{name}");
        assert!(replayer.braking(&motion).is_none());
    }
}

/// Who only keeps the nominal speed, and who drives as recorded, hits as recorded.
#[test]
fn nominal_and_recorded_seats_do_not_brake() {
    let stands = Car {
        x_m: 4.54 + 46.0,
        speed_mps: 0.0,
        ..CAR
    };
    let mut replayer = lanes(0.9).replayer().expect("driven");
    let case = replayer.case(&motion([CAR, stands, FAR], 2.3, ["ego", "ado"]));
    for seat in [Seat::Nominal, Seat::Recorded] {
        let outcome = replayer.from_start(&case, seat, None);
        let contact = outcome.contact.expect("a contact");
        assert!(
            (contact.time_s - 2.3).abs() < 0.051,
            "{seat:?}: {contact:?}"
        );
        assert!(
            (contact.closing_speed_mps - 20.0).abs() < 0.2,
            "{contact:?}"
        );
        assert_eq!((contact.struck, outcome.reacted_s), (Struck::Front, None));
    }
    let full = replayer.from_start(&case, Seat::FullBrakes, None);
    assert_eq!((full.avoided, full.reacted_s), (true, Some(0.0)));
}
