//! Storyboards move agents across their path, on curves, on other roads and to places.

use brakecheck_scene::scene::drive::DriveScene;
use brakecheck_scene::scene::{BodySample, BodyState, Pose, Scene, Start, StepOutcome};
use brakecheck_world::world::Scenario;

/// Distance from the rear axle of a sedan to its front bumper.
const FRONT_M: f64 = 3.62;

/// Ego far behind, another car at x = 0 in the middle lane, and a third one.
struct World {
    sample_s: f64,
    ego: &'static str,
    other_mps: f64,
    drive: &'static str,
    rest: &'static str,
    light: &'static str,
}

const PLAIN: World = World {
    sample_s: 0.05,
    ego: "lane: 0, start: At(x_m: -500.0, speed_mps: 0.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))",
    other_mps: 10.0,
    drive: "Script([])",
    rest: "",
    light: "",
};

impl World {
    fn text(&self, events: &str) -> String {
        let World {
            sample_s,
            ego,
            other_mps,
            drive,
            rest,
            light,
        } = self;
        let substeps = (sample_s / 0.01_f64).round();
        format!(
            "Scenario(name: \"story\", question: \"?\", plant: Kinematic,
            clock: (horizon_s: 20.0, decision_s: 0.5, sample_s: {sample_s}, substeps: {substeps}),
            road: Straight(lanes: 3, lane_width_m: 3.5, friction: 0.9),
            {rest}
            agents: [
                Vehicle(name: \"ego\", body: \"sedan\", {ego}),
                Vehicle(name: \"other\", body: \"sedan\", lane: 1,
                    start: At(x_m: {FRONT_M}, speed_mps: {other_mps}), drive: {drive}),
                Vehicle(name: \"third\", body: \"sedan\", lane: 2,
                    start: At(x_m: 200.0, speed_mps: 10.0), drive: Script([])),
                {light}
            ],
            storyboard: (stories: [(name: \"story\", acts: [(name: \"act\", maneuver_groups: [
                (name: \"group\", actors: [\"other\"], maneuvers: [(name: \"maneuver\", events: [{events}])]),
                (name: \"thirds\", actors: [\"third\"], maneuvers: [(name: \"maneuver\", events: [
                    (name: \"moves\", start_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: 3.0))]],
                     actions: [(name: \"left\", does: LaneChange(target: Absolute(lane: 0),
                        dynamics: (shape: Sinusoidal, dimension: Time(4.0))))])])]),
            ])])]),
            ego_spec: \"always (ego.other.gap >= 0.01)\")"
        )
    }

    fn played(&self, events: &str, until_s: f64) -> DriveScene {
        let mut scene = scene(&self.text(events));
        for _ in 0..(until_s / self.sample_s).round() as usize {
            scene.advance();
        }
        scene
    }

    /// State of the other car at an instant.
    fn other(&self, events: &str, until_s: f64) -> BodyState {
        bodies(&self.played(events, until_s))[1].state
    }
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

/// Event that begins at an instant.
fn event(at_s: f64, does: &str) -> String {
    format!(
        "(name: \"event{at_s}\", start_trigger: [[(is: SimulationTime(rule: GreaterThan, value_s: {at_s}))]],
          actions: [(name: \"action{at_s}\", does: {does})]),"
    )
}

fn axle(state: &BodyState) -> Pose {
    state.pose.ahead(-FRONT_M)
}

fn close(is: f64, expected: f64, within: f64, what: &str) {
    assert!(
        (is - expected).abs() <= within,
        "{what}: {is}, expected {expected}"
    );
}

/// A curve to the left and back that begins 20 m ahead, 30 m from its end.
const CORNERS: &str = "FollowTrajectory(trajectory: Polyline([(x_m: 20.0, y_m: 3.5),
    (x_m: 40.0, y_m: 3.5), (x_m: 40.0, y_m: 33.5)]))";

#[test]
fn a_trajectory_without_times_moves_only_across() {
    // It begins where the car is, after 20 m at 10 m/s.
    let events = event(2.0, CORNERS);
    for (at_s, x_m, y_m) in [(3.0, 30.0, 3.5), (5.0, 40.0, 13.5), (6.5, 40.0, 28.5)] {
        let at = axle(&PLAIN.other(&events, at_s));
        close(at.x_m, x_m, 1e-6, "x");
        close(at.y_m, y_m, 1e-6, "y");
    }
    let before = PLAIN.other(&events, 5.0);
    close(before.speed_mps, 10.0, 1e-9, "speed");
    close(
        before.pose.heading_rad,
        core::f64::consts::FRAC_PI_2,
        1e-9,
        "heading",
    );
    // No lane leads on, so it goes straight on.
    let beyond = axle(&PLAIN.other(&events, 10.0));
    close(beyond.x_m, 40.0, 1e-6, "x beyond");
    close(beyond.y_m, 63.5, 1e-6, "y beyond");
}

#[test]
fn the_end_of_a_trajectory_is_that_of_every_sample_time() {
    let events = event(2.02, CORNERS)
        + "(name: \"after\", start_trigger: [[(is: StoryboardElementState(element: \"action2.02\", state: EndTransition))]],
            actions: [(name: \"stops\", does: Speed(target: Absolute(value_mps: 0.0), dynamics: (shape: Linear, dimension: Rate(5.0))))])";
    let all = [0.01, 0.05, 0.1, 0.025].map(|sample_s| {
        let world = World { sample_s, ..PLAIN };
        let scene = world.played(&events, 12.0);
        (scene.story_changes().to_vec(), bodies(&scene)[1].state)
    });
    let (fine, end) = &all[0];
    close(end.speed_mps, 0.0, 1e-9, "it stands");
    // 50 m of the curve, and 10 m to stop.
    close(axle(end).y_m, 33.5 + 10.0, 1e-6, "y");
    for (coarse, coarse_end) in &all[1..] {
        assert_eq!(fine.len(), coarse.len(), "{fine:?} {coarse:?}");
        for (a, b) in fine.iter().zip(coarse) {
            assert_eq!((a.element, a.transition), (b.element, b.transition));
            close(a.at_s, b.at_s, 1e-3, "instant");
        }
        close(end.pose.y_m, coarse_end.pose.y_m, 1e-3, "y");
        close(end.pose.x_m, coarse_end.pose.x_m, 1e-3, "x");
    }
}

#[test]
fn a_trajectory_ends_on_the_lanes_of_its_road() {
    let events = event(
        1.0,
        "FollowTrajectory(trajectory: Polyline([(x_m: 10.0, y_m: 3.5), (x_m: 50.0, y_m: 7.0)]))",
    );
    let at = PLAIN.other(&events, 12.0);
    // It keeps its place across the road from there on.
    close(axle(&at).y_m, 7.0, 1e-3, "y");
    close(at.pose.heading_rad, 0.0, 1e-3, "heading");
    let lasts = (40f64 * 40.0 + 3.5 * 3.5).sqrt();
    close(axle(&at).x_m, 50.0 + 110.0 - lasts, 0.2, "x");
}

const TIMED: &str = "(x_m: 20.0, y_m: 3.5, time_s: 0.0), (x_m: 40.0, y_m: 3.5, time_s: 1.0),
    (x_m: 40.0, y_m: 3.5, time_s: 3.0), (x_m: 70.0, y_m: 3.5, time_s: 5.0)";

fn timed(timing: &str, following: &str) -> String {
    format!(
        "FollowTrajectory(trajectory: Polyline([{TIMED}]), timing: {timing}, following: {following})"
    )
}

#[test]
fn a_timed_trajectory_is_at_its_points_at_their_times() {
    let events = event(
        2.0,
        &timed("Relative(scale: 1.0, offset_s: 0.0)", "Position"),
    );
    for (at_s, x_m, mps) in [
        (2.5, 30.0, 20.0),
        (4.0, 40.0, 0.0),
        (6.0, 55.0, 15.0),
        (8.0, 85.0, 15.0),
    ] {
        let state = PLAIN.other(&events, at_s);
        close(axle(&state).x_m, x_m, 1e-6, "x");
        close(state.speed_mps, mps, 1e-9, "speed");
    }
    // Twice as slow and half a second later, and cut by 10 m.
    let late = timed("Relative(scale: 2.0, offset_s: 0.5)", "Position");
    let cut = late.replace("following", "initial_distance_m: 10.0, following");
    for (does, at_s, x_m) in [
        (&late, 4.5, 40.0),
        (&late, 2.4, 20.0),
        (&cut, 3.5, 40.0),
        (&cut, 2.3, 30.0),
    ] {
        let state = PLAIN.other(&event(2.0, does), at_s);
        close(axle(&state).x_m, x_m, 1e-6, "x");
    }
    // Times of the run, of which a second has passed.
    let events = event(
        3.5,
        &timed("Absolute(scale: 1.0, offset_s: 2.0)", "Position"),
    );
    close(
        axle(&PLAIN.other(&events, 4.0)).x_m,
        40.0,
        1e-6,
        "x of the run",
    );
    close(
        axle(&PLAIN.other(&events, 6.0)).x_m,
        55.0,
        1e-6,
        "x of the run",
    );
}

#[test]
fn a_followed_trajectory_changes_its_speed_evenly() {
    let events = event(2.0, &timed("Relative(scale: 1.0, offset_s: 0.0)", "Follow"));
    // 20 m in 1 s from 10 m/s: 30 m/s at the end. Then it stands, and leaves from rest.
    let state = PLAIN.other(&events, 2.5);
    close(state.speed_mps, 20.0, 1e-6, "speed");
    close(axle(&state).x_m, 27.5, 1e-6, "x");
    close(PLAIN.other(&events, 4.0).speed_mps, 0.0, 1e-9, "speed");
    let state = PLAIN.other(&events, 6.0);
    close(state.speed_mps, 15.0, 1e-6, "speed");
    close(axle(&state).x_m, 47.5, 1e-6, "x");
    close(
        PLAIN.other(&events, 7.5).speed_mps,
        30.0,
        1e-6,
        "speed at the end",
    );
}

#[test]
fn clothoids_and_nurbs_lead_a_body() {
    let clothoid = "FollowTrajectory(trajectory: Clothoid(x_m: 20.0, y_m: 3.5, heading_rad: 0.0, pieces: [
        (length_m: 40.0, from_per_m: 0.0, to_per_m: 0.02), (length_m: 20.0, from_per_m: 0.02, to_per_m: 0.02)]))";
    let at = PLAIN.other(&event(2.0, clothoid), 7.0);
    // Heading of the spiral, and of 10 m of the arc.
    close(at.pose.heading_rad, 0.4 + 0.2, 1e-6, "heading");
    close(at.speed_mps, 10.0, 1e-9, "speed");
    let nurbs = "FollowTrajectory(trajectory: Nurbs(order: 3, knots: [0, 0, 0, 1, 1, 1], control_points: [
        (x_m: 20.0, y_m: 3.5), (x_m: 70.0, y_m: 3.5, weight: 0.7071067811865476), (x_m: 70.0, y_m: 53.5)]))";
    let at = axle(&PLAIN.other(&event(2.0, nurbs), 6.0));
    // 40 m of a circle of 50 m.
    close(at.x_m, 20.0 + 50.0 * 0.8f64.sin(), 5e-3, "x");
    close(at.y_m, 3.5 + 50.0 * (1.0 - 0.8f64.cos()), 5e-3, "y");
    close(at.heading_rad, 0.8, 1e-3, "heading");
}

#[test]
fn a_body_may_reverse_along_a_trajectory() {
    let does = "FollowTrajectory(trajectory: Polyline([(x_m: 20.0, y_m: 3.5, heading_rad: 0.0, time_s: 0.0),
        (x_m: 10.0, y_m: 3.5, heading_rad: 0.0, time_s: 2.0)]), timing: Relative(scale: 1.0, offset_s: 0.0))";
    let at = PLAIN.other(&event(2.0, does), 3.0);
    close(axle(&at).x_m, 15.0, 1e-6, "x");
    close(at.pose.heading_rad, 0.0, 1e-9, "heading");
    close(at.speed_mps, -5.0, 1e-9, "speed");
}

#[test]
fn a_speed_action_drives_along_a_trajectory() {
    let brakes = event(
        3.0,
        "Speed(target: Absolute(value_mps: 4.0), dynamics: (shape: Linear, dimension: Rate(3.0)))",
    )
    .replace("start_trigger", "priority: Parallel, start_trigger");
    let events = event(2.0, CORNERS) + &brakes;
    let at = PLAIN.other(&events, 6.0);
    // 10 m, 14 m while it brakes, and 4 m.
    close(axle(&at).y_m, 3.5 + 8.0, 1e-6, "y");
    close(at.speed_mps, 4.0, 1e-9, "speed");
}

#[test]
fn an_ado_deviates_on_a_trajectory() {
    let drive = "Ado(base: Script([]), actions: Deviate(accelerations: [-1.0, 0.0, 1.0],
                 lateral_mps: [-0.5, 0.0, 0.5]), neutral: 4, rulebook: [])";
    let world = World { drive, ..PLAIN };
    let events = event(2.0, CORNERS);
    let play = |action: usize| {
        let mut scene = scene(&world.text(&events));
        for step in 0..110 {
            scene.decide(if step < 80 { 4 } else { action });
            scene.advance();
        }
        bodies(&scene)[1].state
    };
    let (neutral, faster, left) = (play(4), play(5), play(7));
    assert_eq!(neutral, PLAIN.other(&events, 5.5));
    close(axle(&faster).y_m - axle(&neutral).y_m, 1.125, 1e-6, "ahead");
    // To the left of the curve, which leads along y.
    close(left.pose.x_m - neutral.pose.x_m, -0.75, 0.3, "left");
}

#[test]
fn a_route_leads_onto_another_road() {
    let rest = "roads: {\"exit\": (at: (x_m: 0.0, y_m: 3.5, heading_rad: 0.0), lanes: 1,
        pieces: [Line(length_m: 60.0), Arc(length_m: 100.0, radius_m: -100.0)])},";
    let world = World { rest, ..PLAIN };
    let events = event(2.0, "AssignRoute(road: \"exit\")");
    let at = world.other(&events, 11.0);
    // 50 m of the arc to the right.
    close(axle(&at).y_m, 3.5 - 100.0 * (1.0 - 0.5f64.cos()), 1e-6, "y");
    close(axle(&at).x_m, 60.0 + 100.0 * 0.5f64.sin(), 1e-6, "x");
    let events = events + &event(12.0, "AssignRoute()");
    let back = world.other(&events, 13.0);
    assert!(back.speed_mps > 9.9, "{back:?}");
}

#[test]
fn a_teleport_touches_nothing_on_its_way() {
    let ego = "lane: 1, start: At(x_m: 40.0, speed_mps: 0.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))";
    let world = World { ego, ..PLAIN };
    let events = event(
        2.0,
        "Teleport(position: World(x_m: 100.0, y_m: 0.0, heading_rad: 0.0))",
    );
    let scene = world.played(&events, 4.0);
    let at = axle(&bodies(&scene)[1].state);
    close(at.x_m, 120.0, 1e-6, "x");
    close(at.y_m, 0.0, 1e-9, "y");
    // Without it, it touches the ego.
    let mut scene = scene_of(&world, "");
    let mut touches = false;
    for _ in 0..120 {
        touches |= matches!(scene.advance(), StepOutcome::Contact(_));
    }
    assert!(touches);
    let onto = event(
        2.0,
        "Teleport(position: RelativeObject(entity: \"ego\", dx_m: 1.0, dy_m: 0.0))",
    );
    let mut scene = scene_of(&world, &onto);
    let contact = (0..50).find(|_| matches!(scene.advance(), StepOutcome::Contact(_)));
    // The sample after the one in which it is due.
    assert_eq!(contact, Some(41));
}

fn scene_of(world: &World, events: &str) -> DriveScene {
    // An act needs an event.
    let waits = event(
        19.0,
        "Speed(target: Absolute(value_mps: 1.0), dynamics: (shape: Step))",
    );
    scene(&world.text(&(events.to_owned() + &waits)))
}

#[test]
fn an_agent_vanishes_and_appears() {
    let ego = "lane: 1, start: At(x_m: 40.0, speed_mps: 0.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0))";
    let world = World { ego, ..PLAIN };
    let events = event(2.0, "Delete(entity: \"other\")")
        + &event(
            3.0,
            "Speed(target: Absolute(value_mps: 20.0), dynamics: (shape: Step))",
        )
        + &event(
            6.0,
            "Add(entity: \"other\", position: Road(s_m: 100.0, t_m: 3.5))",
        );
    let gone = world.other(&events, 5.0);
    assert!(
        gone.pose.x_m < -8_000.0 && gone.speed_mps == 0.0,
        "{gone:?}"
    );
    let back = world.other(&events, 7.0);
    close(axle(&back).x_m, 100.0, 1e-6, "x");
    close(back.speed_mps, 0.0, 1e-9, "speed");
}

#[test]
fn friction_and_lights_change() {
    let ego = "lane: 0, start: At(x_m: -500.0, speed_mps: 40.0), drive: Ego(CurveSpeed(desired_speed_mps: 0.1, cruise_gain_per_s: 20.0, max_accel_mps2: 5.0, max_brake_mps2: 9.0,
        side_accel_mps2: 1000.0, plan_brake_mps2: 0.0, preview_s: 0.0, lag_s: 0.0))";
    let light = "Light(name: \"light\", line_m: 100.0, phase: Red,
        drive: Schedule([(0.5, Green), (3.0, Yellow)])),";
    let world = World {
        ego,
        light,
        ..PLAIN
    };
    let events = event(1.0, "Friction(value: 0.2)")
        + &event(2.0, "TrafficSignal(name: \"light\", state: Red)");
    let mps = |at_s: f64, events: &str| bodies(&world.played(events, at_s))[0].state.speed_mps;
    let waits = event(19.0, "Friction(value: 0.5)");
    let (dry, wet) = (mps(1.5, &waits), mps(1.5, &events));
    // 0.9 g bounds it at first, and 0.2 g from the sample after the change.
    close(wet - dry, 0.45 * 0.7 * 9.81, 1e-6, "gained");
    for (at_s, events, expected) in [
        (1.5, &events, "Green"),
        (2.5, &events, "Red"),
        (4.0, &events, "Red"),
        (4.0, &waits, "Yellow"),
    ] {
        let scene = world.played(events, at_s);
        assert_eq!(format!("{:?}", scene.frame().phases[0]), expected);
    }
}

#[test]
fn a_lateral_distance_is_kept() {
    let kept = |rest: &str| {
        format!("LateralDistance(entity: \"third\", distance_m: 3.0, freespace: true{rest})")
    };
    // At once: 3 m between boxes of 1.8 m, to the right of a car at 7 m.
    let once = event(1.0, &kept(", displacement: RightTo"));
    close(axle(&PLAIN.other(&once, 2.0)).y_m, 2.2, 1e-6, "once");
    close(
        axle(&PLAIN.other(&once, 9.0)).y_m,
        2.2,
        1e-6,
        "it does not follow",
    );
    let lasting = event(1.0, &kept(", displacement: RightTo, continuous: true"));
    for sample_s in [0.01, 0.05, 0.1] {
        let world = World { sample_s, ..PLAIN };
        for at_s in [2.0, 4.0, 5.0, 6.0, 9.0] {
            let scene = world.played(&lasting, at_s);
            let [other, third] = [1, 2].map(|i| axle(&bodies(&scene)[i].state));
            close(third.y_m - other.y_m, 4.8, 0.3 * sample_s, "lasting");
        }
    }
    let limits = ", displacement: LeftTo, continuous: true,
        limits: (max_speed_mps: 2.0, max_accel_mps2: 1.0, max_decel_mps2: 1.0)";
    let smooth = event(1.0, &kept(limits));
    let all = [0.01, 0.05, 0.1].map(|sample_s| {
        let world = World { sample_s, ..PLAIN };
        let midway = axle(&world.other(&smooth, 3.0)).y_m;
        let scene = world.played(&smooth, 16.0);
        let [other, third] = [1, 2].map(|i| axle(&bodies(&scene)[i].state));
        close(other.y_m - third.y_m, 4.8, 0.05, "smooth");
        midway
    });
    // 2 s at 1 m/s² from rest.
    close(all[0], 3.5 + 2.0, 0.03, "midway");
    close(all[1], all[0], 0.03, "of samples");
    close(all[2], all[0], 0.03, "of samples");
}

#[test]
fn a_lane_offset_may_be_relative_and_last() {
    let offset = |rest: &str| {
        format!(
            "LaneOffset(target: Relative(entity: \"third\", value_m: -1.0), max_lateral_acc_mps2: 2.0{rest})"
        )
    };
    let once = PLAIN.other(&event(1.0, &offset("")), 15.0);
    close(axle(&once).y_m, 6.0, 1e-6, "once");
    let lasting = PLAIN.other(&event(1.0, &offset(", continuous: true")), 15.0);
    close(axle(&lasting).y_m, -1.0, 0.02, "lasting");
    let changes = |events: &str| {
        let scene = PLAIN.played(events, 15.0);
        let all = scene.story_changes().iter();
        let ends = all.filter(|it| format!("{:?}", it.transition) == "EndTransition");
        ends.count()
    };
    // The lasting action never ends, so its event, maneuver and group do not either.
    let (once, lasting) = (
        changes(&event(1.0, &offset(""))),
        changes(&event(1.0, &offset(", continuous: true"))),
    );
    assert_eq!(once, lasting + 6, "{once} {lasting}");
}

#[test]
fn a_fork_on_a_trajectory_continues_to_the_bit() {
    let events = event(2.0, CORNERS) + &event(9.0, "Teleport(position: Road(s_m: 10.0, t_m: 0.0))");
    for fork_at in [20, 45, 90, 181] {
        let mut straight = PLAIN.played(&events, f64::from(fork_at) * 0.05);
        let mut forked = straight.fork().expect("a fork");
        for _ in fork_at..220 {
            straight.advance();
            forked.advance();
            assert_eq!(bodies(&straight), bodies(&*forked));
        }
        assert_eq!(bodies(&straight), bodies(&PLAIN.played(&events, 11.0)));
    }
}

#[test]
fn mistakes_have_places() {
    let problem = |does: &str| {
        let text = PLAIN.text(&event(1.0, does));
        let error = Scenario::parse("story.ron", &text).expect_err("a mistake");
        let problem = &error.problems[0];
        (problem.what.clone(), text[problem.span.clone()].to_owned())
    };
    let untimed = CORNERS.replace("]))", "]), timing: Relative(scale: 1.0, offset_s: 0.0))");
    assert_eq!(
        problem(&untimed).0,
        "a timing of a trajectory without times"
    );
    let (what, at) = problem(
        "FollowTrajectory(trajectory: Polyline([(x_m: 1.0, y_m: 0.0, time_s: 1.0), (x_m: 2.0, y_m: 0.0, time_s: 1.0)]), timing: Relative(scale: 1.0, offset_s: 0.0))",
    );
    assert_eq!(what, "a time of 1 s after one of 1 s");
    assert_eq!(at, "(x_m: 2.0, y_m: 0.0, time_s: 1.0)");
    let (what, at) = problem("AssignRoute(road: \"exit\")");
    assert_eq!((what.as_str(), at.as_str()), ("no road `exit`", "\"exit\""));
    assert_eq!(
        problem("Delete(entity: \"ego\")").0,
        "`ego` cannot act in a story"
    );
    let knots = "FollowTrajectory(trajectory: Nurbs(order: 3, knots: [0, 1], control_points: [(x_m: 0, y_m: 0), (x_m: 1, y_m: 0), (x_m: 2, y_m: 0)]))";
    assert_eq!(problem(knots).0, "2 knots");
}
