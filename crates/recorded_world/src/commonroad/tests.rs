//! Tests of the reading of CommonRoad scenarios, with small files in the form of the schema.

use std::fmt::Write as _;
use std::path::Path;

use super::*;
use crate::ego::Phase;
use crate::scene::drive::{MotionLaw, Schedule};
use crate::world_file::{
    AgentFile, DriveFile, LightFile, NumberOrRange, OwnRoad, ScenarioFile, StartFile, WorldFile,
    parse,
};

mod faults;

const FILE: &str = "a.xml";

/// Returns a straight lanelet along x, a point per line.
fn lanelet(id: u32, x: [f64; 2], right_y: f64, more: &str) -> String {
    let bound = |name: &str, y: f64| {
        let points = x.map(|x| format!("<point><x>{x}</x><y>{y}</y></point>\n"));
        format!("<{name}>\n{}</{name}>\n", points.concat())
    };
    let (left, right) = (
        bound("leftBound", right_y + 3.5),
        bound("rightBound", right_y),
    );
    format!(
        "<lanelet id=\"{id}\">\n{left}{right}{more}<laneletType>urban</laneletType>\n</lanelet>\n"
    )
}

/// Returns two lanes of 200 m, each of two lanelets: 1 and 2 on the right, 3 and 4 on the left.
fn network() -> String {
    let beside =
        |to: u32, side: &str| format!("<adjacent{side} ref=\"{to}\" drivingDir=\"same\"/>\n");
    let next = |to: u32| format!("<successor ref=\"{to}\"/>\n");
    [
        lanelet(1, [0.0, 100.0], -1.75, &(next(2) + &beside(3, "Left"))),
        lanelet(2, [100.0, 200.0], -1.75, &beside(4, "Left")),
        lanelet(3, [0.0, 100.0], 1.75, &(next(4) + &beside(1, "Right"))),
        lanelet(4, [100.0, 200.0], 1.75, &beside(2, "Right")),
    ]
    .concat()
}

fn state(name: &str, step: u32, [x, y]: [f64; 2], speed_mps: f64) -> String {
    format!(
        "<{name}>\n<position><point><x>{x}</x><y>{y}</y></point></position>\n\
         <orientation><exact>0.0</exact></orientation>\n<time><exact>{step}</exact></time>\n\
         <velocity><exact>{speed_mps}</exact></velocity>\n</{name}>\n"
    )
}

/// Returns a car of 4 m by 2 m that drives along x for 5 s.
fn car(id: u32, x: f64, y: f64, speed_mps: f64) -> String {
    let at = |step: u32| [x + speed_mps * 0.1 * f64::from(step), y];
    let mut text = format!(
        "<dynamicObstacle id=\"{id}\">\n<type>car</type>\n<shape><rectangle><length>4.0</length>\
         <width>2.0</width></rectangle></shape>\n{}<trajectory>\n",
        state("initialState", 0, at(0), speed_mps)
    );
    for step in 1..=50 {
        text += &state("state", step, at(step), speed_mps);
    }
    text + "</trajectory>\n</dynamicObstacle>\n"
}

const GOAL: &str = "<goalState>\n<time><intervalStart>20</intervalStart><intervalEnd>50</intervalEnd></time>\n\
     <position><lanelet ref=\"2\"/></position>\n\
     <velocity><intervalStart>5</intervalStart><intervalEnd>20</intervalEnd></velocity>\n</goalState>\n";

fn problem(id: u32, goals: &str) -> String {
    format!(
        "<planningProblem id=\"{id}\">\n{}{goals}</planningProblem>\n",
        state("initialState", 0, [20.0, 0.2], 15.0)
    )
}

fn scenario(version: &str, parts: &[&str]) -> String {
    format!(
        "<commonRoad commonRoadVersion=\"{version}\" benchmarkID=\"ZAM_Test-1_1_T-1\" \
         timeStepSize=\"0.1\">\n{}</commonRoad>\n",
        parts.concat()
    )
}

/// Returns a scenario that is read without anything dropped.
fn sound() -> String {
    scenario(
        "2020a",
        &[&network(), &car(31, 60.0, 0.0, 10.0), &problem(800, GOAL)],
    )
}

fn read_as(
    text: &str,
    ego: Option<&str>,
    ado: Option<&str>,
) -> Result<CommonRoadWorld, ImportError> {
    let request = CommonRoadImport {
        scenario: Path::new(FILE),
        name: "w",
        ego,
        ado,
    };
    request.read(&|_| Ok(text.to_owned()))
}

fn world_of(read: &CommonRoadWorld) -> ScenarioFile {
    let world = parse("w.ron", &read.text).unwrap_or_else(|it| panic!("{it:?}\n{}", read.text));
    match world {
        WorldFile::Scenario(world) => *world,
        WorldFile::Grid(_) => panic!("a grid"),
    }
}

fn world(text: &str) -> ScenarioFile {
    let read = read_as(text, None, None).unwrap_or_else(|it| panic!("{it}"));
    world_of(&read)
}

fn refusal(text: &str) -> String {
    match read_as(text, None, None) {
        Err(error) => {
            // A refusal without a fix leaves the user alone.
            assert!(error.all().all(|it| it.help.is_some()), "{error}");
            error.to_string()
        }
        Ok(read) => panic!("it is read:\n{}", read.text),
    }
}

fn number(NumberOrRange(range): NumberOrRange) -> f64 {
    assert_eq!(range.lo, range.hi);
    range.lo
}

fn start_of(agent: &AgentFile) -> [f64; 2] {
    match agent {
        AgentFile::Vehicle {
            start: StartFile::At { x_m, speed_mps },
            ..
        } => [number(*x_m), number(*speed_mps)],
        other => panic!("{other:?}"),
    }
}

#[test]
fn lanes_ego_obstacles_and_goal_become_a_world() {
    let read = read_as(&sound(), None, None).unwrap_or_else(|it| panic!("{it}"));
    assert_eq!(read.dropped, []);
    assert!(read.road_m < 0.01, "{}", read.road_m);
    let world = world_of(&read);
    let OwnRoad::Straight {
        lanes,
        lane_width_m,
        ..
    } = world.road
    else {
        panic!("{:?}", world.road);
    };
    assert_eq!((lanes, number(lane_width_m)), (2, 3.5));
    let [ego, other] = &world.agents[..] else {
        panic!("{:?}", world.agents);
    };
    let AgentFile::Vehicle { lane, offset_m, .. } = ego else {
        panic!("{ego:?}");
    };
    assert_eq!((*lane, number(*offset_m)), (0, 0.2));
    // The road begins at the lanelet, which is exactly 20 m behind the ego's middle.
    let [ego_m, ego_mps] = start_of(ego);
    assert!((ego_m - 20.0 - 0.5 * 4.508).abs() < 0.6, "{ego_m}");
    assert_eq!(ego_mps, 15.0);
    // Front to front, whatever the road's start.
    let [own_m, other_mps] = start_of(other);
    let begins = &world.roads.0["car_31"].at.expect("a place");
    let gap_m = begins.x_m + own_m - ego_m;
    assert!((gap_m - (62.0 - 22.254)).abs() < 1e-3, "{gap_m}");
    assert!((other_mps - 10.0).abs() < 1e-3);
    assert!(begins.y_m.abs() < 1e-3, "{begins:?}");
    let body = &world.bodies.0["car 4000 x 2000 mm"];
    assert_eq!((body.length_m, body.width_m), (4.0, 2.0));
    assert_eq!(world.clock.horizon_s, 5.0);
    assert_eq!(world.ego_spec, "no_contact and goal");
    assert_eq!(
        world.formulas.0["no_contact"],
        "always (ego.car_31.gap >= 0.01)"
    );
    let goal = &world.formulas.0["goal"];
    assert!(
        goal.starts_with("eventually[2.0, 5.0] ((ego.s in ["),
        "{goal}"
    );
    assert!(goal.ends_with("and ego.speed in [5.0, 20.0])"), "{goal}");
    assert!(goal.contains("ego.lateral in [-1.75, 1.75]"), "{goal}");
}

#[test]
fn a_recorded_motion_is_repeated_and_its_end_is_listed() {
    // It brakes from 10 m/s with 2 m/s² to its end after 5 s, and the goal is later.
    let mut states = String::new();
    for step in 0..=50_u32 {
        let t = 0.1 * f64::from(step);
        let name = if step == 0 { "initialState" } else { "state" };
        let at = [60.0 + 10.0 * t - t * t, 0.0];
        states += &state(name, step, at, 10.0 - 2.0 * t);
        if step == 0 {
            states += "<trajectory>\n";
        }
    }
    let car = format!(
        "<dynamicObstacle id=\"7\"><type>car</type><shape><circle><radius>1.5</radius></circle></shape>\n\
         {states}</trajectory></dynamicObstacle>\n"
    );
    let goal = GOAL.replace("<intervalEnd>50<", "<intervalEnd>80<");
    let text = scenario("2020a", &[&network(), &car, &problem(1, &goal)]);
    let read = read_as(&text, None, None).unwrap_or_else(|it| panic!("{it}"));
    let kinds: Vec<&str> = read.dropped.iter().map(|it| it.kind).collect();
    assert_eq!(
        kinds,
        [
            "shapes, in place of which are their boxes",
            "ends of records, after which obstacles drive on"
        ]
    );
    assert_eq!(
        read.dropped[0].line,
        line_of(&text, "dynamicObstacle id=\"7\"")
    );
    let world = world_of(&read);
    let AgentFile::Vehicle {
        drive: DriveFile::Script(steps),
        ..
    } = &world.agents[1]
    else {
        panic!("{:?}", world.agents[1]);
    };
    assert_eq!(steps.len(), 10);
    for (i, step) in steps.iter().enumerate() {
        let [MotionLaw::Speed { to_mps, .. }] = &step.does[..] else {
            panic!("{step:?}");
        };
        let expected = 10.0 - (i + 1) as f64;
        assert!((number(*to_mps) - expected).abs() < 0.05, "{i}: {to_mps:?}");
    }
}

#[test]
fn a_rectangle_is_turned_by_a_number_however_it_is_written() {
    let kinds = |turn: &str| -> Vec<&str> {
        let width = "<width>2.0</width>";
        let turned = format!("{width}<orientation>{turn}</orientation>");
        let text = sound().replacen(width, &turned, 1);
        let read = read_as(&text, None, None).unwrap_or_else(|it| panic!("{it}"));
        read.dropped.iter().map(|it| it.kind).collect()
    };
    for straight in ["0", "0.0", "0.00", "-0.0", "0e0"] {
        assert_eq!(kinds(straight), Vec::<&str>::new(), "{straight}");
    }
    assert_eq!(kinds("0.3"), ["shapes, in place of which are their boxes"]);
}

/// Returns the line of the first mention of a text.
fn line_of(text: &str, part: &str) -> usize {
    let at = text.find(part).expect(part);
    1 + text[..at].matches('\n').count()
}

#[test]
fn version_2018b_has_roles_and_limits_of_lanelets() {
    let car = car(31, 60.0, 0.0, 10.0)
        .replace("dynamicObstacle", "obstacle")
        .replace("<type>", "<role>dynamic</role>\n<type>");
    let parked = "<obstacle id=\"5\"><role>static</role><type>parkedVehicle</type><shape><rectangle>\
        <length>5</length><width>2</width></rectangle></shape><initialState><position><point><x>90</x>\
        <y>-4</y></point></position><orientation><exact>0.5</exact></orientation><time><exact>0</exact>\
        </time></initialState></obstacle>\n";
    let limited = network().replacen("</lanelet>", "<speedLimit>16.0</speedLimit>\n</lanelet>", 2);
    let text = scenario("2018b", &[&limited, &car, parked, &problem(1, GOAL)]);
    let world = world(&text);
    assert_eq!(
        world.formulas.0["speed_limit"],
        "always (ego.speed <= 16.0)"
    );
    assert_eq!(world.ego_spec, "no_contact and speed_limit and goal");
    let obstacle = world.agents.iter().find(|it| it.name() == "car_5");
    let Some(AgentFile::Obstacle {
        s_m,
        lateral_m,
        heading_rad,
        ..
    }) = obstacle
    else {
        panic!("{obstacle:?}");
    };
    let [ego_m, _] = start_of(&world.agents[0]);
    let (sin, cos) = libm::sincos(0.5);
    // Its front is 2.5 m ahead of its middle.
    assert!(
        (number(*s_m) - ego_m - (90.0 + 2.5 * cos - 22.254)).abs() < 1e-3,
        "{s_m:?}"
    );
    assert!(
        (number(*lateral_m) - (2.5 * sin - 4.0)).abs() < 1e-3,
        "{lateral_m:?}"
    );
    assert_eq!(*heading_rad, 0.5);
}

#[test]
fn limits_that_change_hold_from_their_lanelets_on() {
    let limited = network().replacen(
        "<adjacentLeft ref=\"4\"",
        "<trafficSignRef ref=\"9\"/><adjacentLeft ref=\"4\"",
        1,
    );
    let sign = "<trafficSign id=\"9\"><trafficSignElement><trafficSignID>274</trafficSignID>\
        <additionalValue>13.9</additionalValue></trafficSignElement></trafficSign>\n";
    let text = scenario("2020a", &[&limited, sign, &problem(1, GOAL)]);
    let world = world(&text);
    let stl = &world.formulas.0["speed_limit"];
    // The second lanelet begins 77.746 m ahead of the ego's front.
    let [ego_m, _] = start_of(&world.agents[0]);
    let from_m = ((ego_m + 77.746) * 100.0).round() / 100.0;
    let from = format!("(ego.s in [{from_m:?},");
    assert!(
        stl.contains(&from) && stl.contains("implies ego.speed <= 13.9"),
        "{stl}, {from}"
    );
    // An ego that is faster at the limit than it can brake to violates it in any case.
    let near = text.replacen("<x>20</x>", "<x>99</x>", 1);
    let read = read_as(&near, None, None).unwrap_or_else(|it| panic!("{it}"));
    assert_eq!(
        read.dropped[0].kind,
        "speed limits below the speed of the ego's start"
    );
    assert!(!world_of(&read).formulas.0.contains_key("speed_limit"));
}

#[test]
fn stop_signs_and_lights_have_rules_at_their_lines() {
    let lines = "<stopLine><point><x>90</x><y>-1.75</y></point><point><x>90</x><y>1.75</y></point>\
        <lineMarking>solid</lineMarking><trafficSignRef ref=\"9\"/><trafficLightRef ref=\"8\"/></stopLine>\n\
        <successor ref=\"2\"/>";
    let network = network().replacen("<successor ref=\"2\"/>", lines, 1);
    let more = "<trafficSign id=\"9\"><trafficSignElement><trafficSignID>206</trafficSignID>\
        </trafficSignElement></trafficSign>\n<trafficLight id=\"8\"><cycle>\
        <cycleElement><duration>20</duration><color>red</color></cycleElement>\
        <cycleElement><duration>5</duration><color>redYellow</color></cycleElement>\
        <cycleElement><duration>10</duration><color>green</color></cycleElement>\
        <cycleElement><duration>5</duration><color>yellow</color></cycleElement>\
        <timeOffset>30</timeOffset></cycle></trafficLight>\n";
    let text = scenario("2020a", &[&network, more, &problem(1, GOAL)]);
    let world = world(&text);
    let [ego_m, _] = start_of(&world.agents[0]);
    let light = world.agents.iter().find(|it| it.name() == "light_8");
    let Some(AgentFile::Light {
        line_m: Some(line_m),
        phase,
        drive: LightFile::Schedule(Schedule(changes)),
        ..
    }) = light
    else {
        panic!("{light:?}");
    };
    assert!((line_m - ego_m - (90.0 - 22.254)).abs() < 0.01, "{line_m}");
    // At step 0 the cycle of 40 steps is at its step 10.
    assert_eq!(*phase, Phase::Red);
    let expected = [(1.5, Phase::Green), (2.5, Phase::Yellow), (3.0, Phase::Red)];
    assert_eq!(changes[..], expected);
    assert_eq!(world.ego_spec, "stops and no_red_light and goal");
    let red = &world.formulas.0["no_red_light"];
    assert_eq!(
        red,
        "always (not (light_8.red and rise(ego.light_8.line < 0)))"
    );
    let stop = format!("always ((rise(ego.s > {line_m:?}) implies once (ego.speed <= 0.1 and");
    assert!(world.formulas.0["stops"].starts_with(&stop), "{stop}");
}

#[test]
fn several_goals_are_alternatives_and_a_goal_in_the_other_lane_needs_it() {
    let shape = "<goalState><time><intervalStart>0</intervalStart><intervalEnd>40</intervalEnd></time>\
        <position><rectangle><length>10</length><width>3</width><orientation>0.0</orientation><center>\
        <x>150</x><y>3.5</y></center></rectangle></position></goalState>\n";
    let text = scenario(
        "2020a",
        &[&network(), &problem(1, &(GOAL.to_owned() + shape))],
    );
    let world = world(&text);
    let goal = &world.formulas.0["goal"];
    assert_eq!(goal.matches("eventually").count(), 2, "{goal}");
    let [ego_m, _] = start_of(&world.agents[0]);
    // The middle of the ego is in the shape.
    let from = format!("{:.2}", 145.0 - 20.0 + ego_m);
    assert!(
        goal.contains(&from) && goal.contains("ego.lateral in [2.0, 5.0]"),
        "{goal}, {from}"
    );
    // Without a lane beside the ego's there is no way.
    let apart = network()
        .replace("adjacentLeft", "noLane")
        .replace("adjacentRight", "noLane");
    let text = scenario("2020a", &[&apart, &problem(1, shape)]);
    let refused = refusal(&text);
    assert!(
        refused.contains("no way over lanelets leads to the goal"),
        "{refused}"
    );
}

#[test]
fn goals_between_samples_are_rounded_inwards() {
    let text = sound()
        .replacen("timeStepSize=\"0.1\"", "timeStepSize=\"0.04\"", 1)
        // Speeds at the shorter step.
        .replace(
            "<exact>10</exact></velocity>",
            "<exact>25</exact></velocity>",
        )
        .replacen("<intervalStart>20<", "<intervalStart>3<", 1);
    let goal = &world(&text).formulas.0["goal"];
    // From 0.12 s to 2 s.
    assert!(goal.starts_with("eventually[0.15, 2.0] "), "{goal}");
}

#[test]
fn a_bend_is_a_road_of_arcs_near_its_lanelet() {
    // A quarter of a circle with a radius of 30 m in the middle of the lane.
    let mut bounds = [String::new(), String::new()];
    for i in 0..=30 {
        let (sin, cos) = libm::sincos(core::f64::consts::FRAC_PI_2 * f64::from(i) / 30.0);
        for (bound, radius) in bounds.iter_mut().zip([28.25, 31.75]) {
            // Invariant: writing into a string does not fail.
            let _ = write!(
                bound,
                "<point><x>{}</x><y>{}</y></point>",
                radius * sin,
                30.0 - radius * cos
            );
        }
    }
    let [left, right] = bounds;
    let lanelet = format!(
        "<lanelet id=\"1\"><leftBound>{left}</leftBound><rightBound>{right}</rightBound></lanelet>\n"
    );
    let goal = "<goalState><time><intervalStart>0</intervalStart><intervalEnd>60</intervalEnd></time>\
        <position><circle><radius>2</radius><center><x>29.9</x><y>28.0</y></center></circle></position></goalState>";
    let problem = problem(1, goal).replacen("<x>20</x><y>0.2</y>", "<x>1</x><y>0</y>", 1);
    let read = read_as(&scenario("2020a", &[&lanelet, &problem]), None, None);
    let read = read.unwrap_or_else(|it| panic!("{it}"));
    assert!(read.road_m < 0.1, "{}", read.road_m);
    let OwnRoad::Curved { pieces, .. } = world_of(&read).road else {
        panic!("a straight road");
    };
    let way_m: f64 = pieces
        .iter()
        .map(|it| match it {
            crate::world_file::OwnPiece::Line { length_m }
            | crate::world_file::OwnPiece::Arc { length_m, .. } => *length_m,
        })
        .sum();
    assert!((way_m - 47.1).abs() < 1.0, "{way_m}");
}

#[test]
fn an_obstacle_may_become_the_ado() {
    let read = read_as(&sound(), None, Some("31")).unwrap_or_else(|it| panic!("{it}"));
    let world = world_of(&read);
    let AgentFile::Vehicle {
        drive: DriveFile::Ado(ado),
        ..
    } = &world.agents[1]
    else {
        panic!("{:?}", world.agents[1]);
    };
    assert_eq!(ado.rulebook.len(), 2);
    // An ado that brakes keeps the ego from its goal, which is no fault of the ego.
    assert_eq!(world.ego_spec, "no_contact");
    let error = read_as(&sound(), None, Some("32")).expect_err("no obstacle 32");
    assert!(error.to_string().contains("no obstacle `32`"), "{error}");
    assert_eq!(error.help.as_deref(), Some("name one of 31"));
}
