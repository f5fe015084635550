//! Scripts by laws, meetings with the ego, ados that stray from them, start
//! tables, and worlds in which nobody learns.

use core::f64::consts::PI;

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];

/// An ego that keeps 10 m/s, and others; nobody learns unless they do.
fn text(others: &str, more: &str) -> String {
    format!(
        "Scenario(name: \"plans\", question: \"?\",
        clock: (horizon_s: 8.0, decision_s: 0.5, sample_s: 0.05, substeps: 5),
        judge: UntilContact,
        road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9),
        agents: [
            Vehicle(name: \"ego\", body: \"sedan\",
                start: At(x_m: 0.0, speed_mps: 10.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))),
            {others}
        ],
        ego_spec: \"always (ego.other.gap >= 0.01 and other.s < 1000 and other.lateral < 99 and ego.s >= -1)\",
        {more})"
    )
}

fn other(start: &str, drive: &str) -> String {
    format!("Vehicle(name: \"other\", body: \"van\", lane: 1, start: {start}, drive: {drive}),")
}

fn parsed(text: &str) -> Result<Scenario, String> {
    Scenario::parse("plans.ron", text).map_err(|error| {
        let problem = &error.problems[0];
        let help = problem.help.as_deref().unwrap_or_default();
        format!("{}; {help}", problem.what)
    })
}

fn world(text: &str) -> Scenario {
    parsed(text).unwrap_or_else(|error| panic!("{error}"))
}

fn episode(world: &Scenario, action: usize) -> Episode {
    let mut bench = world.bench();
    let key = StartKey {
        purpose: Purpose::Calibration,
        seed: 1,
        index: 0,
    };
    let start = bench.draw(key);
    play(
        &mut bench,
        &start,
        0,
        &mut Constant(action),
        Aftermath::Play,
    )
}

fn column<'a>(episode: &'a Episode, name: &str) -> &'a [f64] {
    let values = episode.trace.signal(name);
    values.unwrap_or_else(|| panic!("{name} is not published"))
}

/// Sample by sample, what a law says at a time.
fn follows(values: &[f64], law: impl Fn(f64) -> f64, what: &str) {
    assert!(values.len() > 100, "{what}: {} samples", values.len());
    for (sample, value) in values.iter().enumerate() {
        let expected = law(0.05 * sample as f64);
        assert!(
            (value - expected).abs() < 1e-4,
            "{what}, sample {sample}: {value}, not {expected}"
        );
    }
}

#[test]
fn scripts_follow_their_laws_to_a_tenth_of_a_millimetre_on_both_plants() {
    let drive = "Script([
        (after_s: 1.02, does: [LaneOffset(to_m: 0.6, most_lateral_mps2: 0.5)]),
        (after_s: 0.5, does: [Brake(rate_mps2: 4.0)]),
    ])";
    let text = text(&other("At(x_m: 60.0, speed_mps: 8.0)", drive), "");
    let swing_s = PI * (0.6_f64 / (2.0 * 0.5)).sqrt();
    let brake_s = 1.02 + swing_s + 0.5;
    // The rear axle moves by the law, and the body lies along its velocity.
    let van = brakecheck_sim::sim::Body::shipped("van")
        .expect("shipped")
        .expect("a body");
    let lever_m = van.lever_m();
    let share = |t: f64| ((t - 1.02) / swing_s).clamp(0.0, 1.0);
    let slope = |t: f64| {
        if (0.0..1.0).contains(&share(t)) && share(t) > 0.0 {
            (0.3 * PI / swing_s * (PI * share(t)).sin()).atan2(8.0)
        } else {
            0.0
        }
    };
    let way_m = |t: f64| {
        let braking_s = (t - brake_s).clamp(0.0, 2.0);
        60.0 - lever_m + 8.0 * (t.min(brake_s) + braking_s) - 2.0 * braking_s * braking_s
    };
    for plant in PLANTS {
        let world = world(&text).on(plant);
        let episode = episode(&world, 0);
        follows(
            column(&episode, "other.lateral"),
            |t| 3.5 + 0.3 * (1.0 - (PI * share(t)).cos()) + lever_m * slope(t).sin(),
            "lateral",
        );
        follows(
            column(&episode, "other.s"),
            |t| way_m(t) + lever_m * slope(t).cos(),
            "s",
        );
        follows(
            column(&episode, "other.speed"),
            |t| 8.0 - 4.0 * (t - brake_s).clamp(0.0, 2.0),
            "speed",
        );
    }
}

#[test]
fn a_step_that_overlaps_goes_on_across_while_the_next_ones_change_the_speed() {
    let drive = "Script([
        (after_s: 0.52, does: [Speed(to_mps: 9.0, rate_mps2: 2.0), LaneOffset(to_m: -3.5, most_lateral_mps2: 0.5)], overlaps: true),
        (does: [Brake(rate_mps2: 3.0)]),
    ])";
    let text = text(&other("At(x_m: 60.0, speed_mps: 8.0)", drive), "");
    let swing_s = PI * (3.5_f64 / (2.0 * 0.5)).sqrt();
    let van = brakecheck_sim::sim::Body::shipped("van")
        .expect("shipped")
        .expect("a body");
    let speed_mps = |t: f64| {
        let faster = 2.0 * (t - 0.52).clamp(0.0, 0.5);
        8.0 + faster - 3.0 * (t - 1.02).clamp(0.0, 3.0)
    };
    let share = |t: f64| ((t - 0.52) / swing_s).clamp(0.0, 1.0);
    // The van stops after 4.02 s, in the middle of its lane change, which waits. Shortly
    // before, its wheels allow no turn as tight as the law asks.
    let until_s = 3.2;
    let lateral_m = |t: f64| {
        let across_mps = match share(t) {
            it if it > 0.0 && it < 1.0 => -1.75 * PI / swing_s * (PI * it).sin(),
            _ => 0.0,
        };
        let heading_rad = across_mps.atan2(speed_mps(t));
        3.5 - 1.75 * (1.0 - (PI * share(t)).cos()) + van.lever_m() * heading_rad.sin()
    };
    for plant in PLANTS {
        let episode = episode(&world(&text).on(plant), 0);
        let until = (until_s / 0.05) as usize;
        let early = |name: &str| column(&episode, name)[..until].to_vec();
        for (name, law) in [
            ("other.speed", &speed_mps as &dyn Fn(f64) -> f64),
            ("other.lateral", &lateral_m),
        ] {
            for (sample, value) in early(name).iter().enumerate() {
                let expected = law(0.05 * sample as f64);
                assert!(
                    (value - expected).abs() < 1e-4,
                    "{name}, sample {sample}: {value}, not {expected}"
                );
            }
        }
    }
}

#[test]
fn a_step_without_a_lateral_law_overlaps_nothing() {
    let drive = "Script([(does: [Brake(rate_mps2: 3.0)], overlaps: true)])";
    let text = text(&other("At(x_m: 60.0, speed_mps: 8.0)", drive), "");
    let error = parsed(&text).expect_err("nothing overlaps");
    assert!(
        error.contains("`overlaps` without a law across the path"),
        "{error}"
    );
}

#[test]
fn a_lane_change_costs_the_way_that_it_goes_sideways() {
    let drive = "Script([(does: [LaneChange(by_m: -3.5, rate_mps: 2.0)])])";
    let world = world(&text(&other("At(x_m: 60.0, speed_mps: 8.0)", drive), ""));
    let episode = episode(&world.on(PlantKind::Kinematic), 0);
    let lasts_s = PI * 3.5 / 4.0;
    let end = (lasts_s / 0.05).ceil() as usize + 1;
    let (s_m, lateral_m) = (
        column(&episode, "other.s"),
        column(&episode, "other.lateral"),
    );
    assert!(lateral_m[end].abs() < 1e-9, "{}", lateral_m[end]);
    // v stays along the heading: ∫√(64 − y'²) instead of 8·t, by Simpson's rule.
    let y_mps = |t: f64| 2.0 * (PI * t / lasts_s).sin();
    let steps = 2000;
    let h = lasts_s / f64::from(steps);
    let ahead_m: f64 = (0..=steps)
        .map(|i| {
            let weight = match i {
                0 => 1.0,
                i if i == steps => 1.0,
                i if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let y = y_mps(f64::from(i) * h);
            weight * (64.0 - y * y).sqrt() * h / 3.0
        })
        .sum();
    let expected_m = 60.0 + ahead_m + 8.0 * (0.05 * end as f64 - lasts_s);
    assert!(
        (s_m[end] - expected_m).abs() < 2e-3,
        "{} {expected_m}",
        s_m[end]
    );
}

#[test]
fn a_step_begins_when_its_formula_comes_true_not_at_the_next_sample() {
    // At 10 m/s against 8 m/s the headway of 30 m is 28.87 m after 0.565 s.
    let drive = "Script([(when: \"ego.other.headway <= 28.87\", does: [Brake(rate_mps2: 4.0)])])";
    let text = text(&other("At(x_m: 30.0, speed_mps: 8.0)", drive), "");
    for plant in PLANTS {
        let episode = episode(&world(&text).on(plant), 0);
        let speed_mps = column(&episode, "other.speed");
        let expected_mps = 8.0 - 4.0 * (1.0 - 0.565);
        assert!(
            (speed_mps[20] - expected_mps).abs() < 1e-3,
            "{}",
            speed_mps[20]
        );
    }
}

#[test]
fn who_meets_the_ego_is_where_it_says_when_the_ego_is() {
    let walker = "Pedestrian(name: \"other\", facing: Left, lateral_m: -6.0,
        start: At(x_m: 40.0, speed_mps: 0.0),
        drive: Meet(ego_at_m: 39.0, here_at_m: 0.2, speed_mps: 1.5, steady: Metres(3.0))),";
    for plant in PLANTS {
        let episode = episode(&world(&text(walker, "")).on(plant), 0);
        // The walker\'s box is 0.5 m long: its side is at 39.7 m or before.
        let contact = episode.contact.clone().expect("they meet");
        assert!((contact.time_s - 3.95).abs() < 0.06, "{}", contact.time_s);
        let lateral_m = column(&episode, "other.lateral");
        assert!((lateral_m[78] - 0.2).abs() < 1e-6, "{}", lateral_m[78]);
        assert_eq!(lateral_m[0], -6.0);
    }
    let late = walker.replace("ego_at_m: 39.0", "ego_at_m: 10.0");
    let error = parsed(&text(&late, "")).expect_err("too late");
    assert!(error.contains("cannot meet the ego"), "{error}");
}

/// Somebody with a plan who may stray from it.
fn straying(base: &str) -> String {
    format!(
        "Ado(base: {base},
        actions: Deviate(accelerations: [-1.0, 0.0, 1.0], lateral_mps: [-0.3, 0.0, 0.3]), neutral: 4,
        rulebook: [Rule(name: \"near\", stl: \"always (other.lateral - other.planned.lateral in [-0.5, 0.5] and other.s - other.planned.s in [-4, 4] and other.planned.speed >= -1)\")])"
    )
}

#[test]
fn an_ado_strays_from_its_plan_and_its_rules_can_say_by_how_much() {
    let plan = "Script([(after_s: 1.0, does: [Brake(rate_mps2: 3.0)])])";
    let start = "At(x_m: 90.0, speed_mps: 8.0)";
    for plant in PLANTS {
        let alone = world(&text(&other(start, plan), "")).on(plant);
        let ado = world(&text(&other(start, &straying(plan)), "")).on(plant);
        let (planned, neutral) = (episode(&alone, 0), episode(&ado, 4));
        let (a, b) = (column(&planned, "other.s"), column(&neutral, "other.s"));
        assert_eq!(a, b, "{plant:?}");
        let along = column(&neutral, "other.planned.s").iter().zip(a);
        assert!(
            along
                .clone()
                .all(|(planned, is)| (planned - is).abs() < 1e-5)
        );
        // Braking harder and to the left: by the closed forms, until it stands.
        let strayed = episode(&ado, 6);
        let at = 20;
        let s_m = column(&strayed, "other.s")[at] - column(&strayed, "other.planned.s")[at];
        assert!((s_m + 0.5).abs() < 0.02, "{s_m}");
        let planned = column(&strayed, "other.planned.s")[..at].iter().zip(a);
        assert!(
            planned
                .into_iter()
                .all(|(planned, is)| (planned - is).abs() < 1e-5)
        );
        assert!(!strayed.verdict.is_success() && neutral.trace.len() > strayed.judged);
    }
}

#[test]
fn runs_with_plans_fork_and_repeat_bit_for_bit() {
    let plan = "Script([(when: \"once[0, 2] (ego.other.headway <= 20)\", does: [LaneChange(by_m: -3.5, rate_mps: 1.0)])])";
    for plant in PLANTS {
        let text = text(&other("At(x_m: 24.0, speed_mps: 8.0)", &straying(plan)), "");
        let world = world(&text).on(plant);
        let once = episode(&world, 8);
        let mut bench = world.bench();
        bench.begin(&once.start, 0, Aftermath::Play);
        while bench.trace().len() < once.trace.len() {
            // Everything that goes on does so in a copy.
            bench = bench.fork().expect("a stock ego");
            bench.decide(8);
        }
        let (a, b) = (column(&once, "other.y"), bench.trace().signal("other.y"));
        assert_eq!(Some(a), b, "{plant:?}");
        assert_eq!(once.trace, episode(&world, 8).trace, "{plant:?}");
    }
}

#[test]
fn a_table_of_points_is_what_starts_are_drawn_from() {
    let others = other(
        "At(x_m: (30.0, 60.0), speed_mps: (4.0, 8.0))",
        "Script([(after_s: (1.0, 2.0), does: [Brake(rate_mps2: gain)])])",
    )
    .replace("gain", "3.0");
    let points = "parameters: { \"far\": (1.0, 3.0) },
        points: (axes: [\"far\", \"other.speed\", \"other.x\", \"other.step1.after\"],
                 rows: [[1.0, 4.0, 30.0, 1.0], [2.0, 6.0, 45.0, 1.5], [3.0, 8.0, 60.0, 2.0]]),";
    let world = world(&text(&others, points));
    let axes: Vec<String> = world.axes().into_iter().map(|axis| axis.name).collect();
    assert_eq!(axes, ["other.x", "other.speed", "other.step1.after", "far"]);
    let starts = world.starts().expect("a table");
    assert_eq!(starts[1].0, [45.0, 6.0, 1.5, 2.0]);
    let bench = world.bench();
    let drawn: Vec<_> = (0..20)
        .map(|index| {
            bench.draw(StartKey {
                purpose: Purpose::Train,
                seed: 3,
                index,
            })
        })
        .collect();
    assert!(drawn.iter().all(|start| starts.contains(start)));
    assert!(starts.iter().all(|start| drawn.contains(start)));
    // Without the table the ranges are its hull.
    let hull = parsed(&text(&others, "parameters: { \"far\": (1.0, 3.0) },")).expect("a hull");
    assert!(hull.starts().is_none());
    let cases = [
        (
            "\"far\", \"other.speed\"",
            "\"fat\", \"other.speed\"",
            "no range `fat`",
        ),
        ("\"far\", ", "", "say nothing of `far`"),
        (
            "[2.0, 6.0, 45.0, 1.5]",
            "[2.0, 6.0, 45.0]",
            "3 values for 4 axes",
        ),
        (
            "[2.0, 6.0, 45.0, 1.5]",
            "[2.0, 6.0, 75.0, 1.5]",
            "75 is outside of 30 ..= 60",
        ),
        ("\"other.x\"", "\"other.speed\"", "stands there twice"),
    ];
    for (from, to, expected) in cases {
        let error = parsed(&text(&others, &points.replacen(from, to, 1))).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn nobody_needs_to_learn() {
    let drive = "Script([(does: [Brake(rate_mps2: 3.0)])])";
    let world = world(
        &text(&other("At(x_m: 30.0, speed_mps: 8.0)", drive), "").replace("lane: 1", "lane: 0"),
    )
    .on(PlantKind::Kinematic);
    let spaces = world.spaces();
    assert_eq!((spaces.actions, spaces.observation), (1, 0));
    // 8 m/s are gone after 10.7 m: the ego runs into it at 10 m/s.
    let episode = episode(&world, 0);
    assert!(episode.verdict.is_success());
    let contact = episode.contact.clone().expect("a contact");
    assert!((contact.closing_speed_mps - 10.0).abs() < 1e-3);
    // For other tools it is a crash like any other.
    let files = brakecheck_crashes::crashes::export::openx(&world, &episode, "plans", "nominal")
        .expect("exported");
    assert!(files.replay.contains("entityRef=\"other\""));
}

#[test]
fn what_a_plan_may_not_say_is_refused_where_it_stands() {
    let cases = [
        (
            "Script([(when: \"eventually (other.s >= 1)\")])",
            "waits for what lies ahead",
        ),
        ("Script([(when: \"other.sped >= 1\")])", "other.sped"),
        (
            "Script([(does: [Brake(rate_mps2: 0.0)])])",
            "0 is outside of",
        ),
        (
            "Script([(does: [Brake(rate_mps2: 1.0), Speed(to_mps: 1.0)])])",
            "two laws along",
        ),
        (
            "Script([(does: [Walk(speed_mps: 1.0, way_m: 1.0)])])",
            "does not move by this law",
        ),
        (
            "Script([(does: [Speed(to_mps: 1.0, relative_to: \"nobody\")])])",
            "no agent `nobody`",
        ),
        (
            "Script([(does: [Speed(to_mps: -2.0)])])",
            "a target speed of -2 m/s, but no agent moves backwards",
        ),
        (
            "Script([(does: [Speed(to_mps: (-1.0, 3.0), rate_mps2: 1.0)])])",
            "a target speed of -1 m/s, but no agent moves backwards",
        ),
        (
            "Ado(base: Script([(does: [Speed(to_mps: -2.0)])]), actions: Deviate(accelerations: [0.0]), neutral: 0, rulebook: [])",
            "a target speed of -2 m/s, but no agent moves backwards",
        ),
        ("Script([(after_s: -1.0)])", "-1 is outside of"),
        (
            "Meet(ego_at_m: 50.0, here_at_m: 90.0, speed_mps: 8.0, steady: Metres(5.0))",
            "starts at the speed that makes it fit",
        ),
        (
            "Ado(actions: Deviate(accelerations: [0.0]), neutral: 0, rulebook: [])",
            "no plan from which to deviate",
        ),
        (
            "Ado(base: Script([]), actions: Accelerations([0.0]), neutral: 0, rulebook: [])",
            "an ado with a plan deviates",
        ),
    ];
    for (drive, expected) in cases {
        let others = other("At(x_m: 40.0, speed_mps: 8.0)", drive);
        let error = parsed(&text(&others, "")).expect_err(expected);
        assert!(error.contains(expected), "{drive}: {error}");
    }
}
