//! The worked labels of `tests/data/reference`, on the plant itself.

use brakecheck::ego::ReferenceDriver;
use brakecheck::preventability::{DriverOutcome, Struck};
use brakecheck::preventability::{RecordedEpisode, Replayer, Seat};
use brakecheck::scene::{BodySample, ContactEvent, Motion, Start};
use brakecheck::scene::{BodyState, Pose};
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::Scenario;
use serde_json::Value;

/// Shares of the outcomes and of the labels that must be as worked out.
///
/// The worked cases move by v(i+1) dt, a plant by the mean of both speeds: an
/// ego that brakes by Δv comes dt Δv / 2 farther there, and whoever lets go when
/// a danger passes may do so a sample earlier or later. So whoever only just
/// avoids it there need not here.
const OUTCOMES: f64 = 0.95;
const LABELS: f64 = 0.85;

/// The worked cases, one a line.
fn panel() -> String {
    let thinned = format!("{}/tests/data/reference", env!("CARGO_MANIFEST_DIR"));
    let full = std::env::var("BRAKECHECK_REFERENCE_VECTORS");
    let file = format!("{}/panel.jsonl", full.unwrap_or(thinned));
    std::fs::read_to_string(file).expect("the panel")
}

fn number(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("{field}"))
}

/// A road with the cars of a case; the ego's controller is `ego`.
fn world(case: &Value, ego: &str) -> Scenario {
    let of = |field: &str| number(case, field);
    let body = format!(
        "\"car\": (name: \"car\", kind: Vehicle(wheelbase_m: 2.7, track_m: 1.56, \
         front_overhang_m: 0.92, wheel_radius_m: 0.33, power_w: 1e5), length_m: {:?}, \
         width_m: {:?}, height_m: 1.45, mass_kg: 1500.0, com_height_m: 0.55)",
        of("L"),
        of("W")
    );
    let lane = usize::from(number(&case["in"], "y0") != 0.0);
    let text = format!(
        "Scenario(name: \"panel\", question: \"?\", \
         clock: (horizon_s: {:?}, decision_s: {dt:?}, sample_s: {dt:?}, substeps: 5), plant: Kinematic, \
         road: Straight(lanes: 2, lane_width_m: 3.5, friction: {:?}), bodies: {{ {body} }}, \
         agents: [Vehicle(name: \"ego\", body: \"car\", lane: 0, \
         start: At(x_m: 0.0, speed_mps: {:?}), drive: Ego({ego})), \
         Vehicle(name: \"ado\", body: \"car\", lane: {lane}, \
         start: Ahead(of: \"ego\", headway_m: {:?}, speed_mps: {:?}), \
         drive: Ado(actions: Accelerations([0.0]), neutral: 0, observe: [\"ego.speed\"], \
         rulebook: [Rule(name: \"stays\", stl: \"always (ado.speed >= -1)\")]))], \
         ego_spec: \"always (ego.ado.gap >= 0.5)\")",
        of("T"),
        of("mu"),
        number(&case["in"], "v_ego"),
        of("L") + number(&case["in"], "gap"),
        number(&case["in"], "v_ado"),
        dt = of("dt"),
    );
    Scenario::parse("panel.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// The ego at constant speed, and the other as in the case.
fn motion(case: &Value, side: f64) -> Motion {
    let (dt, given) = (number(case, "dt"), &case["in"]);
    let (length_m, of) = (number(case, "L"), |field: &str| number(given, field));
    let sample = |x_m: f64, y_m: f64, speed_mps: f64, lateral_mps: f64, accel_mps2: f64| {
        let pose = Pose {
            x_m: x_m + 0.5 * length_m,
            y_m,
            heading_rad: 0.0,
        };
        let state = BodyState {
            pose,
            speed_mps,
            lateral_mps,
            yaw_rate_rad_per_s: 0.0,
            accel_mps2,
        };
        BodySample {
            state,
            command: None,
        }
    };
    let (mut x_m, mut speed_mps, mut accel_mps2) = (of("gap") + length_m, of("v_ado"), 0.0);
    let mut motion: Option<Motion> = None;
    let samples = (number(case, "T") / dt).round() as usize;
    for i in 0..=samples {
        let t = i as f64 * dt;
        let y_m = of("y0") - of("w") * t;
        let there = y_m <= of("y1");
        let (y_m, w) = if there {
            (of("y1"), 0.0)
        } else {
            (y_m, of("w"))
        };
        let row = [
            sample(of("v_ego") * t, 0.0, of("v_ego"), 0.0, 0.0),
            sample(x_m, side * y_m, speed_mps, -side * w, accel_mps2),
        ];
        match &mut motion {
            Some(motion) => motion.push(&row),
            None => motion = Some(Motion::new(Start(Vec::new()), &row)),
        }
        let next_mps = (speed_mps + of("a_ado") * dt).max(0.0);
        accel_mps2 = (next_mps - speed_mps) / dt;
        speed_mps = next_mps;
        x_m += speed_mps * dt;
    }
    let mut motion = motion.expect("a motion");
    motion.end_s = samples as f64 * dt;
    motion.contact = Some(ContactEvent {
        between: ("ego".to_owned(), "ado".to_owned()),
        time_s: 0.0,
        closing_speed_mps: 0.0,
        point_m: [0.0; 3],
        impact: None,
    });
    motion
}

/// How the drivers of the panel fare on the plant.
fn outcomes(replayer: &mut Replayer, case: &RecordedEpisode) -> Vec<(&'static str, DriverOutcome)> {
    let mut outcomes = Vec::new();
    for name in ["CC", "CC_LANE", "CC_LATCHED", "REG", "RSS", "FSM"] {
        let driver: ReferenceDriver = name.parse().expect("a driver");
        outcomes.push((name, replayer.from_start(case, Seat::Driver(driver), None)));
    }
    if let Some(perfect) = replayer.from_handover(case, ReferenceDriver::Ideal, None) {
        outcomes.push(("IDEAL_TD", perfect));
    }
    let foresight = replayer.from_start(case, Seat::FullBrakes, None);
    outcomes.push(("IDEAL_T0", foresight));
    outcomes
}

/// What must agree whatever the integrator: when a driver reacts, and the gap
/// that braking to a standstill leaves.
fn is_wrong(want: &Value, name: &str, got: &DriverOutcome, slack_m: f64) -> bool {
    let far = |field: &str, got: Option<f64>, slack: f64| match (want[field].as_f64(), got) {
        (Some(want), Some(got)) => slack + 1e-6 < (want - got).abs(),
        (None, None) => false,
        _ => true,
    };
    let both = got.avoided && want["avoided"] == true;
    let brakes_on = name.starts_with("IDEAL") && both;
    (both && far("t_react", got.reacted_s, 0.0))
        || (brakes_on && far("margin", got.margin, slack_m))
}

fn label(avoided: impl Fn(&str) -> bool) -> &'static str {
    if ["CC", "CC_LATCHED", "REG", "RSS", "FSM"]
        .into_iter()
        .all(&avoided)
    {
        "avoided by all"
    } else if avoided("CC_LATCHED") || avoided("FSM") {
        "avoided by a competent driver"
    } else if avoided("IDEAL_TD") {
        "only by a perfect driver"
    } else if avoided("IDEAL_T0") {
        "only by foresight"
    } else {
        "unavoidable by braking"
    }
}

#[test]
fn the_plant_gives_the_labels_that_were_worked_out() {
    let (mut wrong, mut same, mut total) = (Vec::new(), 0_u32, 0_u32);
    let (mut labels, mut cases) = (0_u32, 0_u32);
    // An exact contact is up to a sample before the one that shows it.
    let (mut sides, mut struck_twice) = (0_u32, 0_u32);
    for line in panel().lines() {
        let case: Value = serde_json::from_str(line).expect("a case");
        let mut replayer = world(&case, "RssDriver()")
            .replayer()
            .expect("a driving world");
        let slack_m = 0.5 * number(&case, "dt") * number(&case["in"], "v_ego");
        for side in [1.0, -1.0] {
            let ready = replayer.case(&motion(&case, side));
            let nobody = replayer.from_start(&ready, Seat::Nominal, None);
            assert!(!nobody.avoided, "{case} on {side}: {nobody:?}");
            let outcomes = outcomes(&mut replayer, &ready);
            for (name, got) in &outcomes {
                let want = &case["out"][name];
                same += u32::from(want["avoided"] == got.avoided);
                if let (Some(struck), Some(contact)) = (want["struck"].as_str(), &got.contact) {
                    sides += u32::from((struck == "front") == (contact.struck == Struck::Front));
                    struck_twice += 1;
                }
                total += 1;
                if is_wrong(want, name, got, slack_m) {
                    wrong.push(format!("{} {name}: {want}, not {got:?}", case["id"]));
                }
            }
            let avoided = |name: &str| outcomes.iter().any(|(it, got)| *it == name && got.avoided);
            labels += u32::from(case["out"]["label"] == label(avoided));
            cases += 1;
        }
    }
    let shown = wrong.join("\n");
    assert!(wrong.is_empty(), "{} of {total}:\n{shown}", wrong.len());
    for (what, same, total, least) in [
        ("outcomes", same, total, OUTCOMES),
        ("sides struck", sides, struck_twice, OUTCOMES),
        ("labels", labels, cases, LABELS),
    ] {
        println!("{what}: {same} of {total}");
        assert!(
            least * f64::from(total) <= f64::from(same),
            "{what}: {same} of {total}"
        );
    }
}

/// A car ahead in the ego's lane that keeps its speed.
fn lead(gap: f64, v_ado: f64, dt: f64) -> Value {
    serde_json::json!({
        "id": "lead", "dt": dt, "T": 15.0, "L": 4.54, "W": 1.8, "mu": 0.9,
        "in": {"v_ego": 20.0, "v_ado": v_ado, "a_ado": 0.0, "gap": gap, "y0": 0.0, "y1": 0.0, "w": 0.0},
    })
}

/// With a first-order lag T full braking B makes up for a gap of
/// Δv T + Δv²/(2B) − B T²/2; a commanded sample is early by half of one.
#[test]
fn full_brakes_behind_a_lag_avoid_what_the_equation_says() {
    let (lag_s, full_mps2, dt) = (0.3, 0.9 * 9.81, 0.02);
    let avoided = |gap: f64, closing_mps: f64| {
        let case = lead(gap, 20.0 - closing_mps, dt);
        let world = world(&case, &format!("IdealDriver(lag_s: {lag_s})"));
        let mut replayer = world.replayer().expect("a driving world");
        let ready = replayer.case(&motion(&case, 1.0));
        replayer.from_start(&ready, Seat::FullBrakes, None).avoided
    };
    for closing_mps in [8.0, 12.0, 16.0] {
        let braking_m = closing_mps * closing_mps / (2.0 * full_mps2);
        let bound_m = closing_mps * lag_s + braking_m - 0.5 * full_mps2 * lag_s * lag_s;
        let early_m = 0.5 * dt * closing_mps;
        assert!(avoided(bound_m + 0.1, closing_mps), "{closing_mps}");
        assert!(
            !avoided(bound_m - early_m - 0.1, closing_mps),
            "{closing_mps}"
        );
    }
}

/// As egos they read percepts, and their parameters have defaults.
#[test]
fn every_driver_is_a_stock_ego() {
    let case = lead(45.0, 10.0, 0.05);
    let ends_in_contact = |ego: &str| {
        let world = world(&case, ego);
        let mut bench = world.bench();
        let start = Start(Vec::new());
        let played = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
        played.contact.is_some()
    };
    for ego in [
        "CcDriver",
        "CcLaneDriver",
        "CcLatchedDriver",
        "RegDriver",
        "RssDriver",
        "FsmDriver",
        "IdealDriver",
    ] {
        assert!(!ends_in_contact(&format!("{ego}()")), "{ego}");
        let idle = format!("{ego}(max_brake_mps2: 0.2)");
        assert!(ends_in_contact(&idle), "{idle}");
    }
}
