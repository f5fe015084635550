//! Roads of a world along the lanes of an OpenDRIVE file.

use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::{LoadError, Scenario};

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
        let error = load(&WORLD.replace(from, to), &[("network.xodr", NETWORK)]);
        let error = error.expect_err(what);
        assert!(error.contains(what), "{what}: {error}");
    }
}
