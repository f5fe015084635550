//! Storyboards whose conditions are formulas, and agents that only a story moves.

use brakecheck_scene::scene::drive::DriveScene;
use brakecheck_scene::scene::{BodySample, Scene, Start};
use brakecheck_world::world::Scenario;

/// Ado that adds to its story.
const STRAYS: &str = "Ado(actions: Deviate(accelerations: [-1.0, 0.0, 1.0],
    lateral_mps: [-0.5, 0.0, 0.5]), neutral: 4, rulebook: [Rule(name: \"near\",
    stl: \"always (other.s - other.planned.s in [-9, 9] and other.planned.speed >= 0
                   and other.lateral - other.planned.lateral in [-9, 9])\")])";
/// The headway of 30 m is 28.87 m after 0.565 s, at 10 m/s against 8 m/s.
const NEAR: &str = "Formula(\"ego.other.headway <= 28.87\")";

#[derive(Clone, Copy)]
struct World<'a> {
    sample_s: f64,
    drive: &'a str,
    more: &'a str,
}

const PLAIN: World = World {
    sample_s: 0.05,
    drive: "Story",
    more: "",
};

impl World<'_> {
    /// Ego at 10 m/s, and another car at 8 m/s in the next lane 30 m ahead.
    fn text(&self, storyboard: &str) -> String {
        let World {
            sample_s,
            drive,
            more,
        } = self;
        let substeps = (sample_s / 0.01_f64).round();
        format!(
            "Scenario(name: \"formulas\", question: \"?\", plant: Kinematic,
            clock: (horizon_s: 8.0, decision_s: 0.5, sample_s: {sample_s}, substeps: {substeps}),
            road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9),
            agents: [
                Vehicle(name: \"ego\", body: \"sedan\", start: At(x_m: 0.0, speed_mps: 10.0),
                    drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))),
                Vehicle(name: \"other\", body: \"sedan\", lane: 1, start: At(x_m: 30.0, speed_mps: 8.0),
                    drive: {drive}),
            ],
            {storyboard}
            {more}
            ego_spec: \"always (ego.other.gap >= 0.01)\")"
        )
    }

    fn scene(&self, storyboard: &str) -> DriveScene {
        let text = self.text(storyboard);
        let scenario = Scenario::parse("formulas.ron", &text).unwrap_or_else(|error| {
            let problems: Vec<_> = error.problems.iter().map(|it| &it.what).collect();
            panic!("{problems:?} in {text}")
        });
        let world = scenario.drive().expect("a driving world").world().clone();
        let mut scene = world.scene();
        scene.reset(&Start(Vec::new()), 0);
        scene
    }

    fn played(&self, storyboard: &str, for_s: f64) -> DriveScene {
        let mut scene = self.scene(storyboard);
        for _ in 0..(for_s / self.sample_s).round() as usize {
            scene.advance();
        }
        scene
    }

    fn mistake(&self, storyboard: &str) -> (String, String) {
        let text = self.text(storyboard);
        let error = Scenario::parse("formulas.ron", &text).expect_err("a mistake");
        let problem = &error.problems[0];
        (problem.what.clone(), text[problem.span.clone()].to_owned())
    }
}

/// Storyboard of one maneuver of the other car.
fn story(events: &str) -> String {
    format!(
        "storyboard: (stories: [(name: \"story\", acts: [(name: \"act\", maneuver_groups: [(
        name: \"group\", actors: [\"other\"], maneuvers: [(name: \"maneuver\", events: [{events}])])])])]),"
    )
}

/// Event that changes the speed at 2 m/s².
fn speed(name: &str, condition: &str, to_mps: f64) -> String {
    format!(
        "(name: \"{name}\", start_trigger: [[({condition})]], actions: [(name: \"{name}_speed\",
        does: Speed(target: Absolute(value_mps: {to_mps:?}), dynamics: (shape: Linear, dimension: Rate(2.0))))])"
    )
}

fn bodies(scene: &dyn Scene) -> Vec<BodySample> {
    let mut bodies = Vec::new();
    scene.bodies(&mut bodies);
    bodies
}

/// Numbers of the first and the second event, each with one action.
const EVENTS: [usize; 2] = [5, 7];

/// Returns the instant of the first change of an element, which is its start.
fn start_s(scene: &DriveScene, element: usize) -> Option<f64> {
    let mut changes = scene.story_changes().iter();
    changes.find(|it| it.element == element).map(|it| it.at_s)
}

/// Signal of the present row.
fn signal(scene: &DriveScene, name: &str) -> f64 {
    let mut row = vec![0.0; scene.schema().len()];
    scene.publish(&mut row);
    row[scene.schema().position(name).expect("published")]
}

#[test]
fn a_formula_triggers_between_two_samples() {
    let cases = [
        (format!("is: {NEAR}"), 0.565),
        (format!("edge: Rising, is: {NEAR}"), 0.565),
        (format!("delay_s: 0.31, is: {NEAR}"), 0.875),
        (
            "edge: Falling, is: Formula(\"ego.other.headway >= 28.87\")".to_owned(),
            0.565,
        ),
    ];
    for (condition, expected_s) in cases {
        let story = story(&speed("e", &condition, 4.0));
        for sample_s in [0.01, 0.05, 0.1] {
            let scene = World { sample_s, ..PLAIN }.played(&story, 4.0);
            let start_s = start_s(&scene, EVENTS[0]);
            assert!(
                start_s.is_some_and(|it| (it - expected_s).abs() < 1e-6),
                "{condition}, {sample_s} s: {start_s:?}, expected {expected_s}"
            );
            // 2 s of even braking, and the rest at 4 m/s.
            let expected_m = 30.0 + 8.0 * expected_s + 12.0 + 4.0 * (2.0 - expected_s);
            let x_m = bodies(&scene)[1].state.pose.x_m;
            assert!((x_m - expected_m).abs() < 1e-5, "{condition}: {x_m}");
        }
    }
}

#[test]
fn a_formula_moves_as_the_step_of_a_script_with_it() {
    let steps = "Script([(when: \"ego.other.headway <= 28.87\", after_s: 0.31,
        does: [Speed(to_mps: 4.0, rate_mps2: 2.0)])])";
    let script = World {
        drive: steps,
        ..PLAIN
    };
    let board = story(&speed("e", &format!("delay_s: 0.31, is: {NEAR}"), 4.0));
    let (mut a, mut b) = (script.scene(""), PLAIN.scene(&board));
    let mut apart = 0;
    for _ in 0..100 {
        a.advance();
        b.advance();
        let [script, story] = [&a, &b].map(|scene| bodies(scene)[1].state);
        let same = (script.pose.x_m - story.pose.x_m).abs() < 1e-6
            && (script.speed_mps - story.speed_mps).abs() < 1e-6;
        apart += usize::from(!same);
    }
    // The body follows its story at the next sample, and a script at its own instant.
    assert!(apart <= 1, "{apart} samples differ");
}

#[test]
fn a_formula_looks_back_to_where_its_event_waits() {
    // The ego was 29.5 m behind at 0.25 s, long before the second event waits.
    let long_ago = "is: Formula(\"once (ego.other.headway >= 29.5)\")";
    let first = speed("first", &format!("is: {NEAR}"), 6.0);
    let waits = speed("again", long_ago, 9.0)
        .replace("(name: \"again\",", "(name: \"again\", priority: Parallel,");
    let at_once = story(&[first.clone(), waits.clone()].join(", "));
    let scene = PLAIN.played(&at_once, 2.0);
    assert_eq!(start_s(&scene, EVENTS[1]), Some(0.0));
    // In an act that begins at 1 s it never holds.
    let later = story(&waits).replace(
        "(name: \"act\",",
        "(name: \"act\", start_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 1.0))]],",
    );
    let scene = PLAIN.played(&later, 4.0);
    assert_eq!(bodies(&scene)[1].state.speed_mps, 8.0);
}

#[test]
fn parameters_of_the_start_are_signals_and_numbers() {
    let more = "parameters: {\"near\": (25.0, 29.0), \"aim\": (2.0, 6.0)},";
    let board = story(&speed(
        "e",
        "is: Formula(\"ego.other.headway <= near\")",
        4.0,
    ))
    .replace("value_mps: 4.0", "value_mps: \"aim\"");
    let world = World { more, ..PLAIN };
    for (near_m, aim_mps) in [(28.0, 3.0), (26.5, 5.0)] {
        let mut scene = world.scene(&board);
        scene.reset(&Start(vec![near_m, aim_mps]), 0);
        for _ in 0..120 {
            scene.advance();
        }
        let start_s = start_s(&scene, EVENTS[0]);
        let expected_s = (30.0 - near_m) / 2.0;
        assert!(
            start_s.is_some_and(|it| (it - expected_s).abs() < 1e-6),
            "{start_s:?}, expected {expected_s}"
        );
        assert_eq!(bodies(&scene)[1].state.speed_mps, aim_mps);
    }
}

#[test]
fn an_ado_without_a_base_deviates_from_its_story() {
    let timed = "is: SimulationTime(rule: GreaterThan, value_s: 0.72)";
    let board = story(&speed("e", timed, 4.0));
    let ado = World {
        drive: STRAYS,
        ..PLAIN
    };
    let play = |action: usize| {
        let mut scene = ado.scene(&board);
        scene.decide(action);
        for _ in 0..40 {
            scene.advance();
        }
        scene
    };
    let (neutral, faster, left) = (play(4), play(5), play(7));
    let planned = PLAIN.played(&board, 2.0);
    assert_eq!(bodies(&neutral)[1].state, bodies(&planned)[1].state);
    let of = |scene: &DriveScene, name: &str| signal(scene, &format!("other.{name}"));
    let apart =
        |scene: &DriveScene, name: &str| of(scene, name) - of(scene, &format!("planned.{name}"));
    // 1 m/s² for 2 s, while the plan stays that of the story.
    assert!((apart(&faster, "s") - 2.0).abs() < 1e-6);
    // 0.5 m/s for 2 s, and the front is to the left of the rear axle.
    assert!((1.0..1.6).contains(&apart(&left, "lateral")));
    for name in ["planned.s", "planned.speed"] {
        assert_eq!(of(&neutral, name), of(&faster, name), "{name}");
    }
    assert!(apart(&neutral, "s").abs() < 1e-5);
}

#[test]
fn a_fork_with_formulas_continues_to_the_bit() {
    let lately = "is: Formula(\"once[0, 0.5] (ego.other.headway <= 28.87)\")";
    let board = story(&speed("e", lately, 4.0));
    for fork_at in [1, 11, 12, 20] {
        let mut straight = PLAIN.played(&board, 0.05 * fork_at as f64);
        let mut forked = straight.fork().expect("a fork");
        for _ in fork_at..60 {
            straight.advance();
            forked.advance();
            assert_eq!(bodies(&straight), bodies(&*forked));
        }
    }
}

#[test]
fn mistakes_have_places() {
    let of = |stl: &str| story(&speed("e", &format!("is: Formula(\"{stl}\")"), 4.0));
    let (what, at) = PLAIN.mistake(&of("eventually (other.s >= 1)"));
    assert!(what.contains("waits for what lies ahead"), "{what}");
    assert_eq!(at, "\"eventually (other.s >= 1)\"");
    let (what, _) = PLAIN.mistake(&of("other.sped >= 1"));
    assert!(what.contains("other.sped"), "{what}");
    let long = format!("other.s >= {}1", " ".repeat(20_000));
    let (what, _) = PLAIN.mistake(&of(&long));
    assert!(what.contains("bytes"), "{what}");
    let (what, at) = PLAIN.mistake("");
    assert_eq!(
        (what.as_str(), at.as_str()),
        ("the world has no storyboard", "Story")
    );
    let (what, at) = PLAIN.mistake("storyboard: (stories: []),");
    let unmoved = "no action of the storyboard moves `other`";
    assert_eq!((what.as_str(), at.as_str()), (unmoved, "Story"));
    let ado = World {
        drive: STRAYS,
        ..PLAIN
    };
    let (what, _) = ado.mistake("");
    assert_eq!(what, "there is no plan from which to deviate");
}
