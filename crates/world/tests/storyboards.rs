//! Storyboards move the agents of a world, at instants that no sample time changes.

use brakecheck_scene::scene::drive::DriveScene;
use brakecheck_scene::scene::{BodySample, Scene, Start};
use brakecheck_world::world::Scenario;

/// Ego that accelerates, and another car 60 m ahead in the middle lane.
fn world(sample_s: f64, drive: &str, storyboard: &str) -> String {
    let substeps = (sample_s / 0.01_f64).round();
    format!(
        "Scenario(name: \"story\", question: \"?\", plant: Kinematic,
        clock: (horizon_s: 10.0, decision_s: 0.5, sample_s: {sample_s}, substeps: {substeps}),
        road: Straight(lanes: 3, lane_width_m: 3.5, friction: 0.9),
        agents: [
            Vehicle(name: \"ego\", body: \"sedan\", start: At(x_m: 0.0, speed_mps: 20.0),
                drive: Ego(Coast(accel_mps2: 0.4, lag_s: 0.0))),
            Vehicle(name: \"other\", body: \"sedan\", lane: 1, start: At(x_m: 60.0, speed_mps: 10.0),
                drive: {drive}),
        ],
        {storyboard}
        ego_spec: \"always (ego.other.gap >= 0.01)\")"
    )
}

/// Storyboard of one maneuver of the other car.
fn story(events: &str) -> String {
    format!(
        "storyboard: (stories: [(name: \"story\", acts: [(name: \"act\", maneuver_groups: [(
        name: \"group\", actors: [\"other\"], maneuvers: [(name: \"maneuver\", events: [{events}])])])])]),"
    )
}

/// A slow-down by headway, a lane change by its state, and a speed by the change's end.
fn cascade() -> String {
    story(
        "(name: \"brakes\", start_trigger: [[(edge: Rising, is: ByEntity(entities: [\"ego\"],
            condition: TimeHeadway(entity: \"other\", freespace: true, rule: LessThan, value_s: 1.5)))]],
          actions: [(name: \"speed\", does: Speed(target: Absolute(value_mps: 13.0),
            dynamics: (shape: Sinusoidal, dimension: Rate(3.0))))]),
        (name: \"leaves\", priority: Parallel, start_trigger: [[(delay_s: 0.33,
            is: StoryboardElementState(element: \"brakes\", state: StartTransition))]],
          actions: [(name: \"change\", does: LaneChange(target: Relative(entity: \"other\", lanes: 1),
            dynamics: (shape: Cubic, dimension: Time(2.2))))]),
        (name: \"ends\", start_trigger: [[(is: StoryboardElementState(element: \"change\", state: CompleteState))]],
          actions: [(name: \"speed\", does: Speed(target: Delta(entity: \"ego\", value_mps: 2.0),
            dynamics: (shape: Linear, dimension: Distance(15.0))))])",
    )
}

fn scene(text: &str) -> DriveScene {
    let scenario = Scenario::parse("story.ron", text).unwrap_or_else(|error| {
        let problems: Vec<_> = error.problems.iter().map(|it| &it.what).collect();
        panic!("{problems:?} in {text}")
    });
    let world = scenario.drive().expect("a driving world").world().clone();
    let mut scene = world.scene();
    scene.reset(&Start(Vec::new()), 0);
    scene
}

fn bodies(scene: &dyn Scene) -> Vec<BodySample> {
    let mut bodies = Vec::new();
    scene.bodies(&mut bodies);
    bodies
}

fn played(text: &str, samples: usize) -> DriveScene {
    let mut scene = scene(text);
    for _ in 0..samples {
        scene.advance();
    }
    scene
}

#[test]
fn the_instants_of_a_story_are_those_of_every_sample_time() {
    let all = [0.01, 0.05, 0.1, 0.025].map(|sample_s| {
        let text = world(sample_s, "Script([])", &cascade());
        let scene = played(&text, (9.0_f64 / sample_s).round() as usize);
        let changes: Vec<_> = scene.story_changes().to_vec();
        let state = bodies(&scene)[1].state;
        (changes, state)
    });
    let (fine, end) = &all[0];
    assert!(fine.len() >= 18, "{fine:?}");
    for (coarse, coarse_end) in &all[1..] {
        assert_eq!(fine.len(), coarse.len(), "{fine:?} {coarse:?}");
        for (a, b) in fine.iter().zip(coarse) {
            assert_eq!((a.element, a.transition), (b.element, b.transition));
            assert!((a.at_s - b.at_s).abs() < 1e-3, "{a:?} {b:?}");
        }
        assert!((end.pose.y_m - coarse_end.pose.y_m).abs() < 1e-3);
        assert!(
            (end.pose.x_m - coarse_end.pose.x_m).abs() < 0.02,
            "{end:?} {coarse_end:?}"
        );
        assert!((end.speed_mps - coarse_end.speed_mps).abs() < 1e-2);
    }
}

#[test]
fn a_timed_story_moves_as_a_script_of_the_same_laws() {
    let steps = "Script([Step(after_s: 1.02, does: [Speed(to_mps: 14.0, rate_mps2: 2.0)]), \
                 Step(after_s: 0.5, does: [LaneChange(by_m: 3.5, rate_mps: 1.7)])])";
    let events = story(
        "(name: \"faster\", start_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 1.02))]],
          actions: [(name: \"speed\", does: Speed(target: Absolute(value_mps: 14.0),
            dynamics: (shape: Linear, dimension: Rate(2.0))))]),
        (name: \"left\", start_trigger: [[(delay_s: 0.5, is: StoryboardElementState(element: \"faster\", state: EndTransition))]],
          actions: [(name: \"change\", does: LaneChange(target: Absolute(lane: 2),
            dynamics: (shape: Sinusoidal, dimension: Rate(1.7))))])",
    );
    let script = played(&world(0.05, steps, ""), 160);
    let story = played(&world(0.05, "Script([])", &events), 160);
    let [a, b] = [&script, &story].map(|scene| bodies(scene)[1].state);
    assert!((a.pose.x_m - b.pose.x_m).abs() < 1e-6, "{a:?} {b:?}");
    assert!((a.pose.y_m - b.pose.y_m).abs() < 1e-6, "{a:?} {b:?}");
    assert!((a.speed_mps - 14.0).abs() < 1e-9 && a.speed_mps == b.speed_mps);
}

#[test]
fn a_fork_continues_to_the_bit() {
    let text = world(0.05, "Script([])", &cascade());
    for fork_at in [1, 40, 71, 90] {
        let mut straight = played(&text, fork_at);
        let mut forked = straight.fork().expect("a fork");
        for _ in fork_at..180 {
            straight.advance();
            forked.advance();
            assert_eq!(bodies(&straight), bodies(&*forked));
        }
        assert_eq!(bodies(&straight), bodies(&played(&text, 180)));
    }
}

#[test]
fn a_scene_begins_its_story_anew() {
    let text = world(0.05, "Script([])", &cascade());
    let mut scene = played(&text, 180);
    let before = scene.story_changes().to_vec();
    scene.reset(&Start(Vec::new()), 0);
    for _ in 0..180 {
        scene.advance();
    }
    assert_eq!(scene.story_changes(), before);
}

#[test]
fn an_ado_deviates_from_its_story() {
    let drive = "Ado(base: Script([]), actions: Deviate(accelerations: [-1.0, 0.0, 1.0], \
                 lateral_mps: [-0.5, 0.0, 0.5]), neutral: 4, rulebook: [])";
    let text = world(0.05, drive, &cascade());
    let play = |action: usize| {
        let mut scene = scene(&text);
        scene.decide(action);
        for _ in 0..60 {
            scene.advance();
        }
        bodies(&scene)[1].state
    };
    let story = played(&world(0.05, "Script([])", &cascade()), 60);
    let (neutral, faster) = (play(4), play(5));
    assert_eq!(neutral, bodies(&story)[1].state);
    assert!(
        faster.pose.x_m > neutral.pose.x_m + 3.0,
        "{faster:?} {neutral:?}"
    );
}

#[test]
fn a_stopped_story_lets_the_body_keep_its_speed() {
    let stops = cascade().replace(
        "(name: \"act\",",
        "(name: \"act\", stop_trigger: [[(is: ByEntity(entities: [\"other\"],
            condition: Speed(rule: GreaterThan, value_mps: 11.5)))]],",
    );
    let scene = played(&world(0.05, "Script([])", &stops), 180);
    let state = bodies(&scene)[1].state;
    assert!((state.speed_mps - 11.5).abs() < 1e-3, "{state:?}");
}

#[test]
fn mistakes_have_places() {
    let problem = |drive: &str, storyboard: &str| {
        let text = world(0.05, drive, storyboard);
        let error = Scenario::parse("story.ron", &text).expect_err("a mistake");
        let problem = &error.problems[0];
        (problem.what.clone(), text[problem.span.clone()].to_owned())
    };
    let (what, at) = problem("Scripted(ConstantSpeed)", &cascade());
    assert_eq!(
        (what.as_str(), at.as_str()),
        ("`other` cannot act in a story", "\"other\"")
    );
    let wrong = cascade().replace("element: \"brakes\"", "element: \"breaks\"");
    let (what, at) = problem("Script([])", &wrong);
    assert_eq!(
        (what.as_str(), at.as_str()),
        ("no element `breaks`", "\"breaks\"")
    );
}
