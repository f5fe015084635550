//! Storyboards move agents along their paths, by what other agents do.

use brakecheck_scene::scene::drive::DriveScene;
use brakecheck_scene::scene::{BodySample, Scene, Start};
use brakecheck_sim::sim::BodyState;
use brakecheck_story::run::ElementChange;
use brakecheck_story::values::ElementState;
use brakecheck_world::world::Scenario;

type Checked = Result<(), String>;

/// Straight road.
const STRAIGHT: &str = "Straight(lanes: 3, lane_width_m: 3.5, friction: 0.9)";
/// Road that bends to the left after 40 m.
const BENT: &str = "Curved(lanes: 3, lane_width_m: 3.5, friction: 0.9, pieces: [
    Line(length_m: 40.0), Arc(length_m: 150.0, radius_m: 80.0), Line(length_m: 400.0)])";

/// Ego that accelerates, and two other cars ahead of it.
struct World {
    sample_s: f64,
    road: &'static str,
    ego: &'static str,
    /// Fields of the storyboard before its stories.
    board: &'static str,
    /// Fields of the world.
    more: &'static str,
    events: String,
}

impl World {
    fn of(events: &str) -> World {
        World {
            sample_s: 0.05,
            road: STRAIGHT,
            ego: "Coast(accel_mps2: 0.4, lag_s: 0.0)",
            board: "",
            more: "",
            events: events.to_owned(),
        }
    }

    fn text(&self) -> String {
        let World {
            sample_s,
            road,
            ego,
            board,
            more,
            events,
        } = self;
        let substeps = (sample_s / 0.01_f64).round();
        format!(
            "Scenario(name: \"story\", question: \"?\", plant: Kinematic,
            clock: (horizon_s: 12.0, decision_s: 0.5, sample_s: {sample_s}, substeps: {substeps}),
            road: {road},
            agents: [
                Vehicle(name: \"ego\", body: \"sedan\", start: At(x_m: 0.0, speed_mps: 20.0),
                    drive: Ego({ego})),
                Vehicle(name: \"other\", body: \"sedan\", lane: 1,
                    start: At(x_m: 60.0, speed_mps: 10.0), drive: Script([])),
                Vehicle(name: \"third\", body: \"sedan\", lane: 2,
                    start: At(x_m: 30.0, speed_mps: 15.0), drive: Script([])),
            ],
            {more}
            storyboard: ({board} stories: [(name: \"story\", acts: [(name: \"act\", maneuver_groups: [(
                name: \"group\", actors: [\"other\"], maneuvers: [(name: \"maneuver\",
                events: [{events}])])])])]),
            ego_spec: \"always (ego.other.gap >= 0.01)\")"
        )
    }

    fn scene(&self) -> Result<DriveScene, String> {
        let text = self.text();
        let scenario = Scenario::parse("story.ron", &text).map_err(|error| {
            let problems = error.problems.iter().map(|it| it.what.as_str());
            problems.collect::<Vec<_>>().join("; ")
        })?;
        let drive = scenario.drive().ok_or("a driving world")?;
        let mut scene = drive.world().clone().scene();
        scene.reset(&Start(Vec::new()), 0);
        Ok(scene)
    }

    /// Plays for a time.
    fn play(&self, for_s: f64) -> Result<DriveScene, String> {
        let mut scene = self.scene()?;
        for _ in 0..(for_s / self.sample_s).round() as usize {
            scene.advance();
        }
        Ok(scene)
    }

    /// Asserts that sample times change nothing, and returns the scene of 0.05 s.
    fn alike(self, for_s: f64) -> Result<DriveScene, String> {
        self.alike_within(for_s, [0.02; 2])
    }

    /// Plays with samples of 0.01 s, and of 0.05 and 0.1 s that are `within` of it in m and m/s.
    fn alike_within(mut self, for_s: f64, within: [f64; 2]) -> Result<DriveScene, String> {
        let mut all = Vec::new();
        for sample_s in [0.01, 0.05, 0.1] {
            self.sample_s = sample_s;
            all.push(self.play(for_s)?);
        }
        let [fine, middle, coarse] = <[DriveScene; 3]>::try_from(all).map_err(|_| "three")?;
        for (other, within) in [&middle, &coarse].into_iter().zip(within) {
            let (a, b) = (fine.story_changes(), other.story_changes());
            assert_eq!(a.len(), b.len(), "{a:?}\n{b:?}");
            for (x, y) in a.iter().zip(b) {
                assert_eq!((x.element, x.transition), (y.element, y.transition));
                assert!((x.at_s - y.at_s).abs() < 1e-3, "{x:?} {y:?}");
            }
            // The last sample of a body is a prediction.
            let (x, y) = (state(&fine, 1), state(other, 1));
            assert!((x.pose.x_m - y.pose.x_m).abs() < within, "{x:?} {y:?}");
            assert!((x.pose.y_m - y.pose.y_m).abs() < within, "{x:?} {y:?}");
            assert!((x.speed_mps - y.speed_mps).abs() < within, "{x:?} {y:?}");
        }
        Ok(middle)
    }
}

/// Event with one action that starts at a time.
fn event(name: &str, at_s: f64, does: &str) -> String {
    format!(
        "(name: \"{name}\", priority: Parallel, start_trigger: [[(is: SimulationTime(
        rule: GreaterOrEqual, value_s: {at_s:?}))]], actions: [(name: \"act\", does: {does})]),"
    )
}

fn bodies(scene: &dyn Scene) -> Vec<BodySample> {
    let mut bodies = Vec::new();
    scene.bodies(&mut bodies);
    bodies
}

fn state(scene: &DriveScene, agent: usize) -> BodyState {
    bodies(scene)[agent].state
}

/// Instant of the first end of an element .
fn ended_s(scene: &DriveScene) -> Option<f64> {
    let of = |it: &&ElementChange| it.transition == ElementState::EndTransition;
    scene.story_changes().iter().find(of).map(|it| it.at_s)
}

#[track_caller]
fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() <= within,
        "{found}, expected {expected} ± {within}"
    );
}

#[test]
fn a_lasting_relative_speed_follows_the_other() -> Checked {
    for (target, factor, by_mps) in [
        (
            "Delta(entity: \"ego\", value_mps: -3.0, continuous: true)",
            1.0,
            -3.0,
        ),
        (
            "Factor(entity: \"ego\", value: 0.5, continuous: true)",
            0.5,
            0.0,
        ),
    ] {
        let does =
            format!("Speed(target: {target}, dynamics: (shape: Sinusoidal, dimension: Time(2.0)))");
        let scene = World::of(&event("e", 1.003, &does)).alike(7.0)?;
        let (ego, other) = (state(&scene, 0), state(&scene, 1));
        near(other.speed_mps, factor * ego.speed_mps + by_mps, 1e-6);
        assert_eq!(ended_s(&scene), None);
    }
    Ok(())
}

#[test]
fn a_lasting_relative_speed_may_be_reached_already() -> Checked {
    let does = "Speed(target: Delta(entity: \"third\", value_mps: -5.0, continuous: true),
        dynamics: (shape: Sinusoidal, dimension: Time(2.0)))";
    let scene = World::of(&event("e", 1.0, does)).play(4.0)?;
    near(state(&scene, 1).speed_mps, 10.0, 1e-6);
    near(state(&scene, 1).pose.x_m, 100.0, 0.1);
    Ok(())
}

#[test]
fn a_profile_has_its_legs_and_its_end() -> Checked {
    let does =
        "SpeedProfile(points: [(time_s: 2.0, speed_mps: 14.0), (time_s: 1.0, speed_mps: 14.0),
        (speed_mps: 8.0)], limits: (max_decel_mps2: 3.0))";
    let scene = World::of(&event("e", 1.0, does)).alike(8.0)?;
    near(ended_s(&scene).ok_or("an end")?, 6.0, 1e-6);
    let way_m = 10.0 + 2.0 * 12.0 + 14.0 + 2.0 * 11.0 + 2.0 * 8.0;
    near(state(&scene, 1).pose.x_m, 60.0 + way_m, 1e-6);
    near(state(&scene, 1).speed_mps, 8.0, 1e-9);
    Ok(())
}

#[test]
fn a_profile_may_be_relative_to_the_speed_of_another() -> Checked {
    let does = "SpeedProfile(entity: \"ego\", points: [(time_s: 1.0, speed_mps: -5.0)])";
    let scene = World::of(&event("e", 1.0, does)).alike(4.0)?;
    // The ego drives 20.4 m/s at 1 s.
    near(state(&scene, 1).speed_mps, 15.4, 1e-6);
    Ok(())
}

/// Bodies of sedans are equally long, so fronts are as far apart as reference points.
fn distance(more: &str) -> String {
    format!("LongitudinalDistance(entity: \"ego\", {more})")
}

#[test]
fn a_distance_without_limits_is_kept_at_once() -> Checked {
    for (displacement, sign) in [("Leading", 1.0), ("Trailing", -1.0)] {
        let does = distance(&format!(
            "distance: Metres(25.0), displacement: {displacement}, freespace: false, continuous: true"
        ));
        let scene = World::of(&event("e", 1.003, &does)).alike(5.0)?;
        let (ego, other) = (state(&scene, 0), state(&scene, 1));
        near(other.pose.x_m - ego.pose.x_m, sign * 25.0, 1e-3);
        near(other.speed_mps, ego.speed_mps, 1e-3);
    }
    let once = distance("distance: Metres(25.0), displacement: Leading, freespace: false");
    let scene = World::of(&event("e", 1.0, &once)).alike(3.0)?;
    near(ended_s(&scene).ok_or("an end")?, 1.0, 1e-6);
    // It keeps the ego's speed of that instant.
    near(state(&scene, 1).speed_mps, 20.4, 1e-3);
    near(state(&scene, 1).pose.x_m, 20.2 + 25.0 + 2.0 * 20.4, 1e-2);
    Ok(())
}

#[test]
fn a_distance_with_limits_is_approached_within_them() -> Checked {
    let limits = "limits: (max_speed_mps: 30.0, max_accel_mps2: 3.0, max_decel_mps2: 5.0)";
    for (displacement, sign) in [("Leading", 1.0), ("Trailing", -1.0)] {
        let does = distance(&format!(
            "distance: Metres(20.0), displacement: {displacement}, freespace: true, continuous: true, {limits}"
        ));
        let world = World::of(&event("e", 1.0, &does));
        let mut scene = world.scene()?;
        let mut before_mps = 10.0;
        for _ in 0..220 {
            scene.advance();
            let mps = state(&scene, 1).speed_mps;
            let change_mps2 = (mps - before_mps) / 0.05;
            assert!((-5.2..=3.2).contains(&change_mps2), "{change_mps2}");
            assert!(mps <= 30.0 + 1e-9, "{mps}");
            before_mps = mps;
        }
        let (ego, other) = (state(&scene, 0), state(&scene, 1));
        let length_m = 4.54;
        if sign > 0.0 {
            // A spring lags behind a speed that changes.
            near(other.pose.x_m - ego.pose.x_m - length_m, 20.0, 0.7);
        }
        assert!(sign * (other.pose.x_m - ego.pose.x_m) > 0.0);
        World::of(&event("e", 1.0, &does)).alike(9.0)?;
    }
    Ok(())
}

#[test]
fn a_time_gap_is_kept_by_the_speed_of_the_other() -> Checked {
    let does = distance("distance: Seconds(1.5), freespace: false, continuous: true");
    let scene = World::of(&event("e", 1.0, &does)).alike(6.0)?;
    let (ego, other) = (state(&scene, 0), state(&scene, 1));
    near(ego.pose.x_m - other.pose.x_m, 1.5 * ego.speed_mps, 1e-2);
    // The way grows with the ego's speed.
    near(other.speed_mps, ego.speed_mps - 1.5 * 0.4, 1e-3);
    Ok(())
}

#[test]
fn a_distance_along_a_bend_is_that_of_its_system() -> Checked {
    let of = |system: &str| {
        let does = distance(&format!(
            "distance: Metres(30.0), displacement: Leading, freespace: false, continuous: true,
            coordinate_system: {system}"
        ));
        World {
            road: BENT,
            ego: "Coast(accel_mps2: 0.0, lag_s: 0.0)",
            ..World::of(&event("e", 1.0, &does))
        }
    };
    // The ego steers once per sample, and drives up to 7 cm elsewhere on the bend.
    let within = [0.1, 0.2];
    let scene = of("Road").alike_within(4.0, within)?;
    let own = state(&scene, 1).pose;
    let ego = state(&scene, 0).pose;
    // Chord of 30 m along the course between lanes 80 m and 76.5 m from its centre.
    let straight_m = (own.x_m - ego.x_m).hypot(own.y_m - ego.y_m);
    near(straight_m, 29.55, 0.2);
    let scene = of("Entity").alike_within(4.0, within)?;
    let (own, ego) = (state(&scene, 1).pose, state(&scene, 0).pose);
    let (sin, cos) = own.heading_rad.sin_cos();
    let behind_m = (own.x_m - ego.x_m) * cos + (own.y_m - ego.y_m) * sin;
    // Fronts are 3.62 m ahead of the reference points, along headings 0.38 rad apart.
    near(behind_m, 30.26, 0.1);
    Ok(())
}

#[test]
fn agents_meet_at_their_places() -> Checked {
    for (more, expected_mps) in [("", None), (", final_speed: Absolute(22.0)", Some(22.0))] {
        let does = format!(
            "Synchronize(master: \"ego\", master_position: Road(s_m: 160.0, t_m: 0.0),
            target_position: Road(s_m: 150.0, t_m: 3.5){more})"
        );
        let world = World {
            ego: "Coast(accel_mps2: 0.0, lag_s: 0.0)",
            ..World::of(&event("e", 1.0, &does))
        };
        let scene = world.alike(7.7)?;
        // The ego's rear axle needs 8 s and the way to its front.
        let scene_end = ended_s(&scene);
        assert_eq!(scene_end, None, "{scene_end:?}");
        let world = World {
            ego: "Coast(accel_mps2: 0.0, lag_s: 0.0)",
            ..World::of(&event("e", 1.0, &does))
        };
        let scene = world.alike(9.0)?;
        let end_s = ended_s(&scene).ok_or("an end")?;
        let (ego, other) = (state(&scene, 0), state(&scene, 1));
        let front_m = ego.pose.x_m - 20.0 * (9.0 - end_s) - 160.0;
        near(front_m, 3.6, 0.5);
        let place_m = other.pose.x_m - other.speed_mps * (9.0 - end_s) - 150.0;
        near(place_m, front_m, 0.05);
        if let Some(mps) = expected_mps {
            near(other.speed_mps, mps, 0.1);
        }
    }
    Ok(())
}

#[test]
fn performance_bounds_every_action() -> Checked {
    let does =
        "Speed(target: Absolute(value_mps: 40.0), dynamics: (shape: Linear, dimension: Rate(9.0)))";
    let world = World {
        board: "performance: [(entity: \"other\", limits: (max_speed_mps: 16.0, max_accel_mps2: 2.0))],",
        ..World::of(&event("e", 1.0, does))
    };
    let scene = world.alike(6.0)?;
    near(ended_s(&scene).ok_or("an end")?, 4.0, 1e-6);
    near(state(&scene, 1).speed_mps, 16.0, 1e-9);
    near(state(&scene, 1).pose.x_m, 60.0 + 10.0 + 39.0 + 32.0, 1e-6);
    Ok(())
}

#[test]
fn agents_that_follow_each_other_are_computed() -> Checked {
    let follow = |of: &str| {
        format!(
            "LongitudinalDistance(entity: \"{of}\", distance: Metres(20.0), displacement: Leading, freespace: false,
            continuous: true, limits: (max_accel_mps2: 3.0, max_decel_mps2: 4.0))"
        )
    };
    // `third` is no actor of the group, so it gets a group of its own.
    let both = |first: &str, second: &str| {
        World::of(&format!(
            "{}])]), (name: \"group2\", actors: [\"third\"], maneuvers: [(name: \"m\", events: [{}",
            event("e", 1.0, &follow(first)),
            event("f", 1.0, &follow(second)),
        ))
    };
    let scene = both("third", "ego").alike(9.0)?;
    let [ego, other, third] = [0, 1, 2].map(|agent| state(&scene, agent));
    near(third.pose.x_m - ego.pose.x_m, 20.0, 0.6);
    near(other.pose.x_m - third.pose.x_m, 20.0, 1.5);
    let scene = both("third", "other").play(5.0)?;
    assert!(state(&scene, 1).pose.x_m.is_finite());
    Ok(())
}

#[test]
fn a_fork_continues_to_the_bit() -> Checked {
    let does = distance(
        "distance: Metres(20.0), freespace: true, continuous: true, limits: (max_accel_mps2: 3.0)",
    );
    let world = World::of(&event("e", 1.0, &does));
    for fork_at in [1, 19, 21, 60] {
        let mut straight = world.play(0.05 * f64::from(fork_at))?;
        let mut forked = straight.fork().ok_or("a fork")?;
        for _ in fork_at..120 {
            straight.advance();
            forked.advance();
            assert_eq!(bodies(&straight), bodies(&*forked));
        }
        assert_eq!(bodies(&straight), bodies(&world.play(6.0)?));
    }
    Ok(())
}

#[test]
fn numbers_may_be_parameters_of_each_start() -> Checked {
    let does = "Speed(target: Absolute(value_mps: \"aim\"), dynamics: (shape: Linear, dimension: Rate(\"rate\")))";
    let world = |more: &'static str| World {
        more,
        ..World::of(&event("e", 1.0, does))
    };
    let play = |more: &'static str, start: &[f64]| -> Result<f64, String> {
        let mut scene = world(more).scene()?;
        scene.reset(&Start(start.to_vec()), 0);
        for _ in 0..100 {
            scene.advance();
        }
        Ok(state(&scene, 1).speed_mps)
    };
    let ranges = "parameters: { \"aim\": (12.0, 18.0), \"rate\": 4.0 },";
    near(play(ranges, &[12.0])?, 12.0, 1e-9);
    near(play(ranges, &[17.5])?, 17.5, 1e-9);
    let wrong = world("parameters: { \"aim\": (12.0, 18.0), \"rate\": (0.0, 4.0) },").scene();
    let wrong = wrong.err().unwrap_or_default();
    assert!(
        wrong.contains("0, a value of `rate`, is out of bounds"),
        "{wrong}"
    );
    let unknown = world("parameters: { \"aim\": 3.0 },")
        .scene()
        .err()
        .unwrap_or_default();
    assert!(unknown.contains("no parameter `rate`"), "{unknown}");
    Ok(())
}
