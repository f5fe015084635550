//! The reference drivers against published numbers.
//!
//! `tests/data/reference` holds a thinned set and says what the cases are. The
//! full one is read where `BRAKECHECK_REFERENCE_VECTORS` names its directory.

use std::path::PathBuf;

use brakecheck::ego::ReferenceDriver;
use brakecheck_ego::ego::reference::{
    CcDriver, CcLaneDriver, DriverModel, Encounter, FsmDriver, IdealDriver, LaneBody, Pedal,
    Reflexes, RegDriver, Response, RssDriver, TtcReading,
};
use serde_json::Value;

/// Which way the other comes from; nothing may depend on it.
const SIDES: [f64; 2] = [1.0, -1.0];
/// How far numbers may be off.
const TOLERANCE: f64 = 1e-6;

fn cases(name: &str) -> Vec<Value> {
    let thinned = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/reference");
    let full = std::env::var_os("BRAKECHECK_REFERENCE_VECTORS").map(PathBuf::from);
    let file = full.unwrap_or(thinned).join(format!("{name}.jsonl"));
    let text = std::fs::read_to_string(file).expect("a file of vectors");
    let case = |line: &str| serde_json::from_str(line).expect("a case");
    text.lines().map(case).collect()
}

fn number(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("{field}"))
}

/// The other, sample by sample.
fn motion(case: &Value, side: f64) -> Vec<LaneBody> {
    let (dt, given) = (number(case, "dt"), &case["in"]);
    let (length_m, width_m) = (number(case, "L"), number(case, "W"));
    let of = |field: &str| number(given, field);
    let scenario = case["scenario"].as_str().expect("a scenario");
    let samples = (number(case, "T") / dt).round() as usize + 1;
    let accel = |i: usize| -> f64 {
        let t = i as f64 * dt;
        match scenario {
            "cut_out" => 0.0,
            "weave" => of("a_amp") * (core::f64::consts::TAU * t / of("a_period")).cos(),
            "following" => {
                let since = t - of("t_brake");
                let braking = since >= -1e-9 && since < of("duration") - 1e-9;
                let ramp = if of("jerk") == 0.0 {
                    f64::INFINITY
                } else {
                    of("jerk") * since
                };
                if braking { -of("decel").min(ramp) } else { 0.0 }
            }
            _ => of("a_ado"),
        }
    };
    let across = |i: usize| -> (f64, f64) {
        let t = i as f64 * dt;
        match scenario {
            "weave" => {
                let k = core::f64::consts::TAU / of("period");
                let y = of("y_mid") + of("amp") * (k * t).cos();
                (y, -of("amp") * k * (k * t).sin())
            }
            "cut_in" | "panel" => {
                let y = of("y0") - of("w") * t;
                let there = y <= of("y1");
                if there {
                    (of("y1"), 0.0)
                } else {
                    (y, -of("w"))
                }
            }
            _ => (0.0, 0.0),
        }
    };
    let (mut x_m, mut speed_mps) = match scenario {
        "cut_out" => (of("gap") + of("gap_front") + 2.0 * length_m, of("v_front")),
        _ => (of("gap") + length_m, of("v_ado")),
    };
    let mut accel_mps2 = 0.0;
    let mut motion = Vec::with_capacity(samples);
    for i in 0..samples {
        let (y_m, lateral_mps) = across(i);
        motion.push(LaneBody {
            x_m,
            y_m: side * y_m,
            speed_mps,
            lateral_mps: side * lateral_mps,
            accel_mps2,
            length_m,
            width_m,
        });
        let next_mps = (speed_mps + accel(i) * dt).max(0.0);
        accel_mps2 = (next_mps - speed_mps) / dt;
        speed_mps = next_mps;
        x_m += speed_mps * dt;
    }
    motion
}

/// What came of a case.
#[derive(Default)]
struct Outcome {
    contact: Option<usize>,
    impact_mps: f64,
    struck: &'static str,
    unsafe_at: Option<usize>,
    speeds: Vec<f64>,
    min_gap: Option<f64>,
    /// Largest PFS and CFS.
    satisfaction: (f64, f64),
    large_ttc: Option<usize>,
}

/// Drives the ego through a case with what `drive` answers at each sample.
fn run(
    case: &Value,
    others: &[LaneBody],
    mut drive: impl FnMut(usize, &LaneBody, &LaneBody) -> (Response, bool),
) -> Outcome {
    let dt = number(case, "dt");
    let mut ego = LaneBody {
        speed_mps: number(&case["in"], "v_ego"),
        length_m: number(case, "L"),
        width_m: number(case, "W"),
        ..LaneBody::default()
    };
    let mut outcome = Outcome::default();
    let mut last_mps = ego.speed_mps;
    for (i, other) in others.iter().enumerate() {
        outcome.speeds.push(ego.speed_mps);
        let (dx, dy) = (other.x_m - ego.x_m, (other.y_m - ego.y_m).abs());
        if dy < ego.width_m && dx > 0.0 {
            let gap = dx - ego.length_m;
            outcome.min_gap = Some(outcome.min_gap.map_or(gap, |least| least.min(gap)));
        }
        if dy < ego.width_m && dx.abs() < ego.length_m {
            outcome.contact = Some(i);
            outcome.impact_mps = ego.speed_mps - other.speed_mps;
            outcome.struck = if dx < 0.0 { "side" } else { "front" };
            break;
        }
        if i + 1 == others.len() {
            break;
        }
        let encounter = Encounter {
            ego,
            other: *other,
            accel_mps2: (ego.speed_mps - last_mps) / dt,
            lane_width_m: 0.0,
            ttc: TtcReading::Magnitude,
        };
        if ego.x_m <= other.x_m {
            if encounter.clearance_m() <= 0.0 && encounter.ttc_s() > 2.0 {
                outcome.large_ttc = outcome.large_ttc.or(Some(i));
            }
            let now = FsmDriver::default().satisfaction(&encounter);
            outcome.satisfaction.0 = now.proactive.max(outcome.satisfaction.0);
            outcome.satisfaction.1 = now.critical.max(outcome.satisfaction.1);
        }
        let (response, danger) = drive(i, &ego, other);
        if danger {
            outcome.unsafe_at = outcome.unsafe_at.or(Some(i));
        }
        last_mps = ego.speed_mps;
        if let Response::Brake(brake_mps2) = response {
            ego.speed_mps = (ego.speed_mps - brake_mps2 * dt).max(0.0);
        }
        ego.x_m += ego.speed_mps * dt;
    }
    outcome
}

/// Any model, one that was altered included.
struct Boxed(Box<dyn DriverModel>);

impl DriverModel for Boxed {
    fn pedal(&self) -> Pedal {
        self.0.pedal()
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        self.0.danger(encounter)
    }
}

fn name_of(case: &Value) -> ReferenceDriver {
    let name = case["model"].as_str().expect("a model");
    name.parse().expect("a model")
}

/// A model in the published reading, on a case that is not of the panel.
fn published(case: &Value, side: f64, drives: Box<dyn DriverModel>) -> Outcome {
    let (dt, given) = (number(case, "dt"), &case["in"]);
    let model = name_of(case);
    let lane_width_m = given["lane_width"].as_f64().unwrap_or(3.5);
    let mut driver = Reflexes::new(Boxed(drives), dt, lane_width_m).reading(TtcReading::Magnitude);
    let scenario = case["scenario"].as_str();
    // Where the event itself is the danger, for those that look at cut-ins.
    let event = matches!(scenario, Some("following" | "cut_out"));
    let always = event && !matches!(model, ReferenceDriver::Rss | ReferenceDriver::Fsm);
    run(case, &motion(case, side), |i, ego, other| {
        let uncovered = given["w"].as_f64().map(|w| -w * i as f64 * dt < -0.375);
        if scenario == Some("cut_out") && uncovered == Some(false) {
            return (Response::Nominal, false);
        }
        let response = if always {
            driver.respond(Some(f64::INFINITY))
        } else {
            driver.step(ego, &[*other])
        };
        (response, driver.has_reacted())
    })
}

/// Says how a number differs from the one of the case, if it does.
fn differs(want: &Value, field: &str, got: Option<f64>) -> Option<String> {
    let want = &want[field];
    let same = match (want.as_f64(), got) {
        (None, None) => true,
        (Some(want), Some(got)) => (want - got).abs() <= TOLERANCE,
        _ => false,
    };
    (!same).then(|| format!("{field} {got:?}, not {want}"))
}

/// Everything in which a case of the four scenarios comes out otherwise.
fn differences(case: &Value, side: f64) -> Vec<String> {
    differences_of(case, side, Box::new(name_of(case)))
}

fn differences_of(case: &Value, side: f64, drives: Box<dyn DriverModel>) -> Vec<String> {
    let (dt, want) = (number(case, "dt"), &case["out"]);
    let out = published(case, side, drives);
    let time = |sample: Option<usize>| sample.map(|i| i as f64 * dt);
    let drops: Vec<f64> = out.speeds.windows(2).map(|v| (v[0] - v[1]) / dt).collect();
    let contact = out.contact;
    let mut wrong: Vec<String> = [
        ("t_contact", time(contact)),
        ("impact_speed", contact.map(|_| out.impact_mps)),
        ("t_unsafe", time(out.unsafe_at)),
        ("t_brake", time(drops.iter().position(|drop| *drop > 0.5))),
        ("min_gap", out.min_gap),
        (
            "peak_decel",
            Some(drops.iter().fold(0.0, |a: f64, b| a.max(*b))),
        ),
        ("v_end", out.speeds.last().copied()),
    ]
    .into_iter()
    .filter_map(|(field, got)| differs(want, field, got))
    .collect();
    if want["struck"].as_str() != contact.map(|_| out.struck) {
        wrong.push(format!("struck {}, not {}", out.struck, want["struck"]));
    }
    if want.get("max_cfs").is_some() {
        wrong.extend(differs(want, "max_pfs", Some(out.satisfaction.0)));
        wrong.extend(differs(want, "max_cfs", Some(out.satisfaction.1)));
    }
    if want.get("t_large_ttc").is_some() {
        wrong.extend(differs(want, "t_large_ttc", time(out.large_ttc)));
    }
    if let Some(profile) = want["speed_profile"].as_array() {
        let far = |(a, b): (&f64, &Value)| (a - b.as_f64().unwrap_or(f64::NAN)).abs() > TOLERANCE;
        if profile.len() != out.speeds.len() || out.speeds.iter().zip(profile).any(far) {
            wrong.push("speed_profile".to_owned());
        }
    }
    wrong
}

fn check(name: &str, differences: impl Fn(&Value, f64) -> Vec<String>) {
    let cases = cases(name);
    let mut wrong = Vec::new();
    for case in &cases {
        for side in SIDES {
            let found = differences(case, side);
            if !found.is_empty() {
                wrong.push(format!("{} on {side}: {}", case["id"], found.join("; ")));
            }
        }
    }
    let shown = wrong
        .iter()
        .take(20)
        .cloned()
        .collect::<Vec<_>>()
        .join("\n");
    let (wrong, total) = (wrong.len(), 2 * cases.len());
    assert!(wrong == 0, "{wrong} of {total} differ:\n{shown}");
}

#[test]
fn cut_ins_are_as_published() {
    check("cut_in", differences);
}

#[test]
fn following_is_as_published() {
    check("following", differences);
}

#[test]
fn cut_outs_are_as_published() {
    check("cut_out", differences);
}

#[test]
fn a_car_that_weaves_beside_is_as_published() {
    check("weave", differences);
}

/// The drivers of the panel, in the order in which labels ask for them.
const PANEL: [&str; 8] = [
    "CC",
    "CC_LANE",
    "CC_LATCHED",
    "REG",
    "RSS",
    "FSM",
    "IDEAL_TD",
    "IDEAL_T0",
];

fn of_panel(case: &Value, name: &str, side: f64) -> Outcome {
    let dt = number(case, "dt");
    let lane_width_m = number(&case["in"], "lane_width");
    let full_mps2 = number(case, "mu") * 9.81;
    let others = motion(case, side);
    if name == "IDEAL_T0" {
        return run(case, &others, |_, _, _| (Response::Brake(full_mps2), true));
    }
    if name == "IDEAL_TD" {
        let mut ideal = IdealDriver::default();
        let set = ideal.set("max_brake_mps2", full_mps2);
        set.expect("a parameter");
        let mut driver = Reflexes::new(ideal, dt, lane_width_m);
        return run(case, &others, |_, ego, other| {
            (driver.step(ego, &[*other]), driver.has_reacted())
        });
    }
    let model: ReferenceDriver = name.parse().expect("a model");
    let mut driver = Reflexes::new(model, dt, lane_width_m).reading(TtcReading::Magnitude);
    run(case, &others, |_, ego, other| {
        (driver.step(ego, &[*other]), driver.has_reacted())
    })
}

#[test]
fn the_panel_is_labelled_as_worked_out() {
    check("panel", |case, side| {
        let (dt, want) = (number(case, "dt"), &case["out"]);
        let nobody = run(case, &motion(case, side), |_, _, _| {
            (Response::Nominal, false)
        });
        assert!(nobody.contact.is_some(), "{}", case["id"]);
        let mut wrong = Vec::new();
        let mut avoided = Vec::new();
        for name in PANEL {
            let (out, want) = (of_panel(case, name, side), &want[name]);
            let held = out.contact.is_none();
            avoided.push(held);
            let margin = if held {
                out.min_gap
            } else {
                Some(-out.impact_mps)
            };
            let mut found: Vec<String> = [
                differs(want, "margin", margin),
                differs(want, "t_react", out.unsafe_at.map(|i| i as f64 * dt)),
            ]
            .into_iter()
            .flatten()
            .collect();
            if want["avoided"] != Value::Bool(held) {
                found.push(format!("avoided {held}"));
            }
            if want["struck"].as_str() != out.contact.map(|_| out.struck) {
                found.push(format!("struck {}", out.struck));
            }
            wrong.extend(found.into_iter().map(|found| format!("{name} {found}")));
        }
        let label = if [0, 2, 3, 4, 5].iter().all(|&i| avoided[i]) {
            "avoided by all"
        } else if avoided[2] || avoided[5] {
            "avoided by a competent driver"
        } else if avoided[6] {
            "only by a perfect driver"
        } else if avoided[7] {
            "only by foresight"
        } else {
            "unavoidable by braking"
        };
        if want["label"] != label {
            wrong.push(format!("label {label}, not {}", want["label"]));
        }
        wrong
    });
}

/// The models of the vectors with one parameter off, by 4 % or at least 0.05:
/// the name of the parameter, and whose.
fn altered() -> Vec<(&'static str, ReferenceDriver, Box<dyn DriverModel>)> {
    let mut altered: Vec<(&str, ReferenceDriver, Box<dyn DriverModel>)> = Vec::new();
    macro_rules! alter {
        ($($kind:ident is $name:expr;)*) => {$(
            for parameter in $kind::default().parameters() {
                let mut model = $kind::default();
                let off = (0.04 * parameter.value).max(0.05);
                model.set(parameter.name, parameter.value + off).expect("a parameter");
                altered.push((parameter.name, $name, Box::new(model)));
            }
        )*};
    }
    alter! {
        CcDriver is ReferenceDriver::Cc;
        CcLaneDriver is ReferenceDriver::CcLane;
        RegDriver is ReferenceDriver::Reg;
        RssDriver is ReferenceDriver::Rss;
        FsmDriver is ReferenceDriver::Fsm;
    }
    // It never asks for more than 6 m/s².
    altered.retain(|(name, of, _)| (*name, *of) != ("max_brake_mps2", ReferenceDriver::Fsm));
    altered
}

/// The vectors notice every constant, so that a slip in one is no agreement.
#[test]
fn every_constant_is_held_by_a_case() {
    let files = ["cut_in", "following", "cut_out", "weave"];
    let all: Vec<Value> = files.into_iter().flat_map(cases).collect();
    for count in 0..altered().len() {
        let mut broken = 0;
        let (name, of, _) = &altered()[count];
        for case in all.iter().filter(|case| name_of(case) == *of) {
            let model = altered().swap_remove(count).2;
            broken += usize::from(!differences_of(case, 1.0, model).is_empty());
        }
        println!("{of:?} {name}: {broken}");
        assert!(broken > 0, "{of:?} {name}");
    }
}

/// The event of the following scene, which the published models do not see.
#[test]
fn a_lead_car_that_brakes_hard_is_a_danger_before_the_time_to_collision_is() {
    let body = |x_m: f64, accel_mps2: f64| LaneBody {
        x_m,
        y_m: 0.0,
        speed_mps: 25.0,
        lateral_mps: 0.0,
        accel_mps2,
        length_m: 4.5,
        width_m: 1.8,
    };
    let seen = |gap_m: f64, accel_mps2: f64, across_m: f64, ttc: TtcReading| {
        let mut other = body(gap_m + 4.5, accel_mps2);
        other.y_m = across_m;
        let encounter = Encounter {
            ego: body(0.0, 0.0),
            other,
            accel_mps2: 0.0,
            lane_width_m: 3.5,
            ttc,
        };
        ReferenceDriver::CcLatched.danger(&encounter).is_some()
    };
    let now = TtcReading::Closing;
    // Equal speeds: no time to collision at all.
    assert!(seen(30.0, -6.0, 0.0, now) && seen(49.0, -5.1, 0.5, now));
    assert!(!seen(51.0, -6.0, 0.0, now), "more than 2 s ahead");
    assert!(!seen(30.0, -4.9, 0.0, now), "not hard");
    assert!(!seen(30.0, -6.0, 1.9, now), "in the next lane");
    assert!(!seen(-60.0, -6.0, 0.0, now), "behind");
    assert!(!seen(30.0, -6.0, 0.0, TtcReading::Magnitude));
}
