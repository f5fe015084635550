//! Roads of a world along the lanes of an OpenDRIVE file.

use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::{LoadError, Scenario};
use brakecheck_sim::sim::{GRAVITY_MPS2, PlantKind};

const NETWORK: &str = include_str!("imports/network.xodr");
/// An ego that drives straight on, a car before it that turns left, and one that
/// comes towards both.
const WORLD: &str = r#"Scenario(
    name: "small", question: "?",
    clock: (horizon_s: 12.0, decision_s: 0.5, sample_s: 0.05, substeps: 5),
    plant: Kinematic,
    judge: UntilContact,
    road: OpenDrive(file: "network.xodr", along: (road: "1", lane: -1, s_m: 20.0, via: ["3"]), friction: 0.8),
    roads: {
        "left": (along: (road: "1", lane: -1, s_m: 20.0, via: ["2"]), priority: Yields),
        "oncoming": (along: (road: "3", lane: 1, s_m: 150.0)),
    },
    agents: [
        Vehicle(name: "ego", body: "sedan", start: At(x_m: 5.0, speed_mps: 5.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))),
        Vehicle(name: "turning", body: "sedan", road: "left", start: At(x_m: 40.0, speed_mps: 10.0), drive: Script([])),
        Vehicle(name: "coming", body: "sedan", road: "oncoming", start: At(x_m: 0.0, speed_mps: 10.0), drive: Script([])),
    ],
    ego_spec: "always (ego.turning.gap >= 0.01)",
)
"#;

fn load(world: &str, files: &[(&str, &str)]) -> Result<Scenario, String> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("a file");
    }
    let path = folder.path().join("small.ron");
    std::fs::write(&path, world).expect("a file");
    Scenario::load(&path).map_err(|error| match error {
        LoadError::Scenario(error) => {
            let what = error.problems.iter().map(|it| it.what.clone());
            what.collect::<Vec<_>>().join("; ")
        }
        other => panic!("{other}"),
    })
}

fn run(world: &Scenario) -> Episode {
    let start = Start(Vec::new());
    play(
        &mut world.bench(),
        &start,
        0,
        &mut Constant(0),
        Aftermath::Play,
    )
}

#[test]
fn roads_lead_along_lanes_and_through_a_junction() {
    let world = load(WORLD, &[("network.xodr", NETWORK)]).expect("a world");
    let road = &world.drive().expect("a driving world").spec().road;
    assert_eq!(
        (road.lanes(), road.lane_width_m(), road.friction()),
        (1, 3.5, 0.8)
    );
    // The world needs its file no more.
    let text = world.text();
    assert!(
        !text.contains("OpenDrive") && !text.contains("along"),
        "{text}"
    );
    assert!(Scenario::parse("small.ron", text).is_ok());
    let episode = run(&world);
    let at = |name: &str, time_s: f64| {
        let of = |what: &str| {
            let signal = episode.trace.signal(&format!("{name}.{what}"));
            *signal
                .expect("there")
                .get((time_s / 0.05).round() as usize)
                .expect("a row")
        };
        (of("x"), of("y"), of("heading"))
    };
    let near = |(x, y, heading): (f64, f64, f64), (x_m, y_m, heading_rad): (f64, f64, f64)| {
        assert!(
            (x - x_m).hypot(y - y_m) < 0.01,
            "({x}, {y}), not ({x_m}, {y_m})"
        );
        assert!((heading - heading_rad).abs() < 1e-3, "{heading}");
    };
    // World x begins 20 m along road 1, in the middle of its lane.
    near(at("ego", 8.0), (45.0, 0.0, 0.0));
    // 80 m to the junction, a quarter of a circle of 21.75 m, and on to the north.
    let arc_m = 21.75 * core::f64::consts::FRAC_PI_2;
    let beyond_m = 40.0 + 100.0 - 80.0 - arc_m;
    let north = core::f64::consts::FRAC_PI_2;
    near(at("turning", 10.0), (101.75, 21.75 + beyond_m, north));
    // Road 3 begins 120 m from there, and the other lane is 3.5 m to the left.
    let (x, y, heading) = at("coming", 10.0);
    near((x, y, heading.abs()), (170.0, 3.5, core::f64::consts::PI));
    // The lane is on the right of the reference line, which begins at the file's origin.
    let origin = world.origin.clone().expect("an origin");
    let place = (origin.x_m, origin.y_m, origin.heading_rad);
    near(place, (20.0, -1.75, 0.0));
    assert_eq!((origin.file.as_str(), origin.z_m), ("network.xodr", 0.0));
    let again = Scenario::parse("small.ron", text).expect("a world");
    assert_eq!(again.origin, Some(origin));
}

#[test]
fn an_origin_is_given_once_and_in_radians() {
    let origin = "origin: (file: \"town.xodr\", x_m: 3.0, y_m: 4.0, heading_rad: 1.5), agents: [";
    let twice = WORLD.replace("agents: [", origin);
    let error = load(&twice, &[("network.xodr", NETWORK)]).expect_err("refused");
    assert!(error.contains("`origin` is that of the lanes"), "{error}");
    let straight = include_str!("../../worlds/acc.ron").replace("agents: [", origin);
    let world = load(&straight, &[]).expect("a world");
    assert_eq!(world.origin.expect("an origin").y_m, 4.0);
    for (from, to, what) in [
        ("heading_rad: 1.5", "heading_rad: 90.0", "90 is outside of"),
        ("x_m: 3.0", "x_m: inf", "`inf` is not a finite number"),
        ("x_m: 3.0", "x_m: 1e9", "1000000000 is outside of"),
    ] {
        let error = load(&straight.replace(from, to), &[]).expect_err(what);
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn ways_that_the_file_does_not_have_are_refused() {
    let cases = [
        ("via: [\"3\"]", "via: [\"7\"]", "does not lead to road `7`"),
        (
            "lane: -1, s_m: 20.0, via: [\"3\"]",
            "lane: -4",
            "has no lane -4",
        ),
        (
            "(road: \"1\", lane: -1, s_m: 20.0, via: [\"3\"])",
            "(road: \"11\", lane: -1)",
            "there is no road `11`",
        ),
        ("\"network.xodr\"", "\"other.xodr\"", "other.xodr"),
        (
            "OpenDrive(file: \"network.xodr\", along: (road: \"1\", lane: -1, s_m: 20.0, via: [\"3\"]), friction: 0.8)",
            "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.8)",
            "road `left` is along lanes, but no file has them",
        ),
        (
            "\"oncoming\": (along: (road: \"3\", lane: 1, s_m: 150.0))",
            "\"oncoming\": (lanes: 1)",
            "nothing says where road `oncoming` begins",
        ),
    ];
    for (from, to, what) in cases {
        assert!(WORLD.contains(from), "{from}");
        let error = load(&WORLD.replace(from, to), &[("network.xodr", NETWORK)]).expect_err(what);
        assert!(error.contains(what), "{what}: {error}");
    }
}

/// The network with content for the roads whose planView ends in these texts.
fn with(edits: &[(&str, &str)]) -> String {
    edits
        .iter()
        .fold(NETWORK.to_owned(), |network, (id, content)| {
            let road = network.find(&format!("id=\"{id}\"")).expect("a road");
            let at = road + network[road..].find("<lanes>").expect("lanes");
            format!("{}{content}{}", &network[..at], &network[at..])
        })
}

#[test]
fn roads_rise_and_fall_with_the_elevations_of_their_files() {
    // Road 3 rises by 5 % over its first 100 m, and is level then. Road 4 is an arc of
    // 20 m, whose outer lane is longer than its reference line.
    let rises = "<elevationProfile><elevation s=\"0\" a=\"0\" b=\"0.05\" c=\"0\" d=\"0\"/>\
                 <elevation s=\"100\" a=\"5\" b=\"0\" c=\"0\" d=\"0\"/></elevationProfile>";
    let network = with(&[("3", rises), ("4", rises)]);
    let text = r#"Scenario(
        name: "small", question: "?",
        clock: (horizon_s: 9.0, decision_s: 0.5, sample_s: 0.05, substeps: 4),
        plant: Kinematic, judge: UntilContact,
        road: OpenDrive(file: "network.xodr", along: (road: "3", lane: -1, s_m: 10.0), friction: 0.8),
        roads: {
            "down": (along: (road: "3", lane: 1, s_m: 150.0)),
            "left": (along: (road: "1", lane: -1, s_m: 20.0, via: ["2"])),
        },
        agents: [
            Vehicle(name: "ego", body: "sedan", start: At(x_m: 10.0, speed_mps: 12.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))),
            Vehicle(name: "ado", body: "sedan", road: "down", start: At(x_m: 0.0, speed_mps: 10.0), drive: Ado(
                actions: Accelerations([0.0, 1.0]), neutral: 0,
                rulebook: [Rule(name: "r", stl: "always (ado.speed <= 99)")],
            )),
        ],
        ego_spec: "always (ego.ado.gap >= 0.1)",
    )"#;
    let world = load(text, &[("network.xodr", &network)]).expect("a world");
    let spec = world.drive().expect("a driving world").spec().clone();
    let near = |a: f64, b: f64| (a - b).abs() < 2e-3;
    let grades = |of: &[brakecheck_road::road::Grade]| -> Vec<(f64, f64)> {
        of.iter().map(|it| (it.from_s_m, it.rise)).collect()
    };
    // The way begins 10 m along the road.
    let own = grades(&spec.grades);
    assert!(
        matches!(own[..], [(a, b), (c, d)] if a == 0.0 && near(b, 0.05) && near(c, 90.0) && near(d, 0.0)),
        "{own:?}"
    );
    let down = grades(&spec.roads["down"].grades);
    assert!(
        matches!(down[..], [(_, b), (c, d), ..] if near(b, 0.0) && near(c, 50.0) && near(d, -0.05)),
        "{down:?}"
    );
    let left = grades(&spec.roads["left"].grades);
    let outer = 0.05 * 20.0 / 21.75;
    assert!(
        matches!(left[..], [(_, b), (c, d), ..] if near(b, 0.0) && near(c, 80.0) && (d - outer).abs() < 1e-4),
        "{left:?}"
    );
    let slope_mps2 = GRAVITY_MPS2 * 0.05 / (1.0_f64 + 0.05 * 0.05).sqrt();
    for plant in [PlantKind::Kinematic, PlantKind::Rigid] {
        let episode = run(&world.on(plant));
        let speed = |name: &str, time_s: f64| {
            let signal = episode.trace.signal(&format!("{name}.speed"));
            signal.expect("there")[(time_s / 0.05_f64).round() as usize]
        };
        // Uphill from the start, and down after 50 level metres.
        let expected_mps = 12.0 - 4.0 * slope_mps2;
        assert!((speed("ego", 4.0) - expected_mps).abs() < 0.05, "{plant:?}");
        assert!((speed("ado", 4.9) - 10.0).abs() < 0.05, "{plant:?}");
        let expected_mps = 10.0 + 3.0 * slope_mps2;
        assert!((speed("ado", 8.0) - expected_mps).abs() < 0.05, "{plant:?}");
    }
    // Grades of the world take precedence.
    let own = text.replace("ego_spec", "grades: [(0.0, -0.02)], ego_spec");
    let world = load(&own, &[("network.xodr", &network)]).expect("a world");
    let spec = world.drive().expect("a driving world").spec().clone();
    assert_eq!(grades(&spec.grades), [(0.0, -0.02)]);
}

const SIGNALS: &str = r#"<signals>
    <signal s="90" t="-3" id="7" dynamic="yes" orientation="+"/>
    <signal s="60" t="3" id="8" dynamic="yes" orientation="-"/>
    <signal s="70" t="-3" id="9" dynamic="yes"><validity fromLane="1" toLane="2"/></signal>
</signals>"#;

/// An ego that stops for lights, with one on its road or on another.
fn lit(light: &str) -> String {
    let follows = "Acc(kp_per_s2: 0.1, kd_per_s: 0.5, standstill_headway_m: 6.0, time_gap_s: 1.0, \
                   max_brake_mps2: 6.0, max_accel_mps2: 1.0, stop_brake_mps2: 4.0, junction_m: 5.0, \
                   yellow_s: 3.0, lag_s: 0.0)";
    let stops = follows.replace("Acc(", "YellowLightFixed(");
    let text = WORLD
        .replace("Coast(accel_mps2: 0.0, lag_s: 0.0)", &stops)
        .replace("speed_mps: 5.0", "speed_mps: 10.0");
    text.replace("agents: [", &format!("agents: [{light},"))
        .replace(
            "ego_spec: \"",
            "ego_spec: \"always (ego.light.line >= -900 and turning.light.line >= -900) and ",
        )
}

#[test]
fn lights_are_at_signals_and_valid_on_their_own_road_only() {
    let network = with(&[("1", SIGNALS)]);
    let at = |episode: &Episode, name: &str, time_s: f64| {
        let signal = episode.trace.signal(name).expect(name);
        signal[(time_s / 0.05).round() as usize]
    };
    let cases = [
        ("signal: \"7\"", true),
        ("line_m: 70.0", true),
        ("road: \"left\", signal: \"7\"", false),
    ];
    for (place, stops) in cases {
        let light = format!("Light(name: \"light\", {place}, drive: Schedule([(0.0, Red)]))");
        let world = load(&lit(&light), &[("network.xodr", &network)]).expect(place);
        assert!(!world.text().contains("OpenDrive"));
        let episode = run(&world);
        // Signal 7 is 70 m along both ways, and the ego starts at 5 m, the other at 40 m.
        assert!(
            (at(&episode, "ego.light.line", 0.0) - 65.0).abs() < 1e-2,
            "{place}"
        );
        assert!(
            (at(&episode, "turning.light.line", 0.0) - 30.0).abs() < 1e-2,
            "{place}"
        );
        let is_still = at(&episode, "ego.speed", 12.0) < 0.1;
        assert_eq!(is_still, stops, "{place}");
    }
    // A line behind the bend counts along the light's own road: 80 m to the junction,
    // a quarter of a circle, and 10 m.
    let along_m = 80.0 + 21.75 * core::f64::consts::FRAC_PI_2 + 10.0;
    let light =
        format!("Light(name: \"light\", road: \"left\", line_m: {along_m}, drive: Schedule([]))");
    let world = load(&lit(&light), &[("network.xodr", &network)]).expect("a world");
    let episode = run(&world);
    let line_m = at(&episode, "turning.light.line", 6.0);
    assert!((line_m - (along_m - 100.0)).abs() < 0.1, "{line_m}");
    // Pictures have it across that lane, 10 m north of the bend.
    let [right, left] = world.bench().stage().lights[0].stop_line_m;
    for (point, x_m) in [(right, 103.5), (left, 100.0)] {
        let off_m = (point[0] - x_m).hypot(point[1] - 31.75);
        assert!(off_m < 0.01, "{point:?}");
    }
}

#[test]
fn signals_of_other_directions_lanes_and_ways_are_refused() {
    let network = with(&[("1", SIGNALS)]);
    let cases = [
        ("signal: \"8\"", "passes no signal `8`"),
        ("signal: \"9\"", "passes no signal `9`"),
        ("road: \"oncoming\", signal: \"7\"", "passes no signal `7`"),
        ("road: \"right\", line_m: 3.0", "right"),
        (
            "phase: Red",
            "nothing says where the stop line of `light` is",
        ),
    ];
    for (place, what) in cases {
        let light = format!("Light(name: \"light\", {place}, drive: Schedule([]))");
        let error = load(&lit(&light), &[("network.xodr", &network)]).expect_err(place);
        assert!(error.contains(what), "{place}: {error}");
    }
}

/// The network at the x axis mirrored, with traffic on the left.
fn mirrored() -> String {
    let mut network = NETWORK.replace("RHT", "LHT");
    for (attribute, values) in [
        ("y", &["20"][..]),
        ("hdg", &["1.5707963267948966"]),
        ("curvature", &["0.05"]),
    ] {
        for value in values {
            let from = format!(" {attribute}=\"{value}\"");
            assert!(network.contains(&from), "{from}");
            network = network.replace(&from, &format!(" {attribute}=\"-{value}\""));
        }
    }
    // Lanes change sides: `1` and `-1` swap, over a third word.
    for attribute in ["lane id", "predecessor id", "successor id", "from", "to"] {
        let of = |value: &str| format!("{attribute}=\"{value}\"");
        network = network.replace(&of("1"), &of("*"));
        network = network.replace(&of("-1"), &of("1"));
        network = network.replace(&of("*"), &of("-1"));
    }
    let network = network.replace("left>", "*>").replace("right>", "left>");
    network.replace("*>", "right>")
}

#[test]
fn left_hand_traffic_drives_as_in_a_mirror() {
    let text = WORLD
        .replace("lane: -1", "lane: *")
        .replace("lane: 1", "lane: -1")
        .replace("lane: *", "lane: 1");
    let world = load(&text, &[("network.xodr", &mirrored())]).expect("a world");
    let (left, right) = (
        run(&world),
        run(&load(WORLD, &[("network.xodr", NETWORK)]).expect("a world")),
    );
    for name in ["ego", "turning", "coming"] {
        let both = |what: &str| {
            let signal = format!("{name}.{what}");
            [&left, &right].map(|it| it.trace.signal(&signal).expect("there").to_vec())
        };
        for (what, sign) in [("x", 1.0), ("y", -1.0)] {
            let [left, right] = both(what);
            assert!(left.len() > 200);
            for (a, b) in left.iter().zip(&right) {
                assert!((a - sign * b).abs() < 1e-6, "{name}.{what}: {a} and {b}");
            }
        }
    }
}
