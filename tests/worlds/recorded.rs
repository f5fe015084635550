//! Worlds from recordings: played without an action, they repeat the recording.

use core::f64::consts::PI;

use brakecheck::recorded_world;
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;
use brakecheck::world_file;
use brakecheck_traffic::{
    Analysis, Class, ColumnMap, RecordedWorld, RecordedWorlds, RecordingColumns, SituationKind,
    SituationPlan, SituationRoad, TrafficRecording, read_csv,
};

/// Course of the road in the recording's frame.
const COURSE_RAD: f64 = 0.6;
const LANE_M: f64 = 3.75;

/// Road user whose motion is known in closed form.
struct Car {
    id: &'static str,
    length_m: f64,
    /// Box centre along the road at the start, and its speed.
    at_m: f64,
    speed_mps: f64,
    /// Times at which it brakes by 2 m/s², and lets go again.
    brakes_s: (f64, f64),
    /// Offset from the right lane, and the begin of a lane change to it, which takes 5 s.
    lateral_m: f64,
    change_s: f64,
}

const CAR: Car = Car {
    id: "",
    length_m: 4.5,
    at_m: 0.0,
    speed_mps: 28.0,
    brakes_s: (1e3, 1e3),
    lateral_m: 0.0,
    change_s: 1e3,
};

impl Car {
    fn along_m(&self, t: f64) -> f64 {
        let (begin, end) = self.brakes_s;
        let within = t.min(end) - begin;
        let lost = match within {
            it if it <= 0.0 => 0.0,
            it => it * it + 2.0 * (end - begin) * (t - end).max(0.0),
        };
        self.at_m + self.speed_mps * t - lost
    }

    fn lateral_m(&self, t: f64) -> f64 {
        let share = ((t - self.change_s) / 5.0).clamp(0.0, 1.0);
        self.lateral_m * 0.5 * (1.0 + (PI * share).cos())
    }
}

/// Recording with 2 cm of noise, and with speeds that are 0.3 % off.
fn recorded(cars: &[Car], seconds: usize) -> Analysis {
    let mut text = "time,id,x,y,heading,speed,length,width\n".to_owned();
    let (sin, cos) = COURSE_RAD.sin_cos();
    let mut noise = 1_u32;
    for i in 0..20 * seconds {
        let t = 0.05 * i as f64;
        for car in cars {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let off_m = 0.04 * (f64::from(noise >> 8) / f64::from(1 << 24) - 0.5);
            let (s, lateral) = (car.along_m(t) + off_m, car.lateral_m(t));
            let (x, y) = (cos * s - sin * lateral, sin * s + cos * lateral);
            let speed = 1.003 * (car.along_m(t + 0.01) - car.along_m(t)) / 0.01;
            let (id, length) = (car.id, car.length_m);
            text += &format!("{t:.2},{id},{x:.3},{y:.3},{COURSE_RAD},{speed:.3},{length},1.8\n");
        }
    }
    let map = ColumnMap::shipped("generic").expect("shipped");
    Analysis::of(read_csv(text.as_bytes(), "tracks.csv", &map).expect("valid rows"))
}

/// A lead that brakes, and its follower, which does so later.
fn following() -> [Car; 2] {
    let lead = Car {
        id: "lead",
        at_m: 80.0,
        brakes_s: (13.0, 15.0),
        ..CAR
    };
    let own = Car {
        id: "own",
        brakes_s: (14.0, 16.0),
        ..CAR
    };
    [lead, own]
}

/// Two cut-ins from the left, and vehicles that stay in the lanes.
fn cut_ins() -> [Car; 10] {
    let cut = |id, at_m, speed_mps, change_s| Car {
        id,
        at_m,
        speed_mps,
        change_s,
        lateral_m: LANE_M,
        ..CAR
    };
    let right = |id, at_m| Car { id, at_m, ..CAR };
    [
        right("own", 0.0),
        Car {
            brakes_s: (9.0, 10.5),
            ..cut("early", 60.0, 26.0, 5.0)
        },
        right("behind", -150.0),
        cut("late", -100.0, 27.0, 7.5),
        cut("left 1", -300.0, 29.0, 1e3),
        cut("left 2", 350.0, 29.0, 1e3),
        right("right 1", 250.0),
        right("right 2", 400.0),
        right("right 3", -300.0),
        right("right 4", -450.0),
    ]
}

fn parsed(world: &RecordedWorld) -> Scenario {
    let commented = recorded_world::world_of(world);
    let text = commented.text().expect("a text");
    let read = world_file::parse("recorded.ron", &text).expect("a world");
    assert_eq!(commented.world, read, "{text}");
    let scenario = Scenario::parse("recorded.ron", &text).unwrap_or_else(|error| {
        let problem = &error.problems[0];
        panic!("{}; {:?}\n{text}", problem.what, problem.help)
    });
    let warnings: Vec<&str> = scenario.warnings().iter().map(|it| &*it.what).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
    scenario
}

/// Plays every situation of a world with one action.
fn played(world: &RecordedWorld, action: usize) -> Vec<Episode> {
    let scenario = parsed(world);
    // A world of one situation has a start without numbers, and no table.
    let only = || vec![Start(Vec::new())];
    let starts = scenario.starts().unwrap_or_else(only);
    assert_eq!(starts.len(), world.situations.len());
    let episodes = starts.iter().map(|start| {
        let mut bench = scenario.bench();
        play(&mut bench, start, 0, &mut Constant(action), Aftermath::Play)
    });
    episodes.collect()
}

fn column<'a>(episode: &'a Episode, name: &str) -> &'a [f64] {
    let values = episode.trace.signal(name);
    values.unwrap_or_else(|| panic!("{name} is not published"))
}

/// Road user of a situation, and that which the ego replaces.
fn pair<'a>(cars: &'a [Car], situation: &SituationPlan) -> [&'a Car; 2] {
    [&situation.planned, &situation.replaced]
        .map(|id| cars.iter().find(|car| car.id == *id).expect("a road user"))
}

/// Checks the start of a situation, and the way along the road in an episode.
#[track_caller]
fn repeats(episode: &Episode, name: &str, cars: &[Car], situation: &SituationPlan) {
    let [car, own] = pair(cars, situation);
    let from_s = situation.time_s;
    let s_m = column(episode, &format!("{name}.s"));
    assert_eq!(s_m.len(), 201);
    // Between rear bumper and front bumper, the recorded gap. The ego's front is at 0.
    let rear_m = s_m[0] - situation.body.length_m;
    let apart_m = 0.5 * (car.length_m + own.length_m);
    let off_m = rear_m + apart_m - (car.along_m(from_s) - own.along_m(from_s));
    assert!(off_m.abs() < 0.1, "the gap is {off_m} m off");
    for (i, s) in s_m.iter().enumerate() {
        let way_m = car.along_m(from_s + 0.05 * i as f64) - car.along_m(from_s);
        let off_m = s - s_m[0] - way_m;
        assert!(off_m.abs() < 0.1, "{}: {off_m} m off at sample {i}", car.id);
    }
    let own_mps = (own.along_m(from_s + 0.01) - own.along_m(from_s)) / 0.01;
    let off_mps = column(episode, "ego.speed")[0] - own_mps;
    assert!(off_mps.abs() < 0.1, "{off_mps} m/s");
}

#[test]
fn a_lead_without_an_action_stays_within_a_decimetre_of_its_recording() {
    let cars = following();
    let recording = [recorded(&cars, 42)];
    let recorded = RecordedWorlds::of("follow", SituationKind::Following, &recording, 24);
    assert_eq!(recorded.worlds.len(), 1);
    let world = &recorded.worlds[0];
    // The hardest window is that of the braking, from 10 s to 20 s.
    assert_eq!(
        (world.situations.len(), world.situations[0].time_s),
        (4, 10.0)
    );
    for (episode, situation) in played(world, 1).iter().zip(&world.situations) {
        repeats(episode, "lead", &cars, situation);
    }
}

#[test]
fn a_cut_in_without_an_action_is_the_recorded_one_along_and_across() {
    let cars = cut_ins();
    let recording = [recorded(&cars, 16)];
    let recorded = RecordedWorlds::of("cut", SituationKind::CutIn, &recording, 24);
    assert_eq!(recorded.worlds.len(), 1, "{recorded:?}");
    let world = &recorded.worlds[0];
    assert_eq!(world.situations.len(), 2);
    for (episode, situation) in played(world, 4).iter().zip(&world.situations) {
        repeats(episode, "ado", &cars, situation);
        let [car, _] = pair(&cars, situation);
        // The begin of the change, up to the sample.
        let begins_s = car.change_s - situation.time_s;
        assert!((begins_s - 2.0).abs() < 0.15, "{begins_s}");
        // Rear bumpers agree, so the recorded centre is half a length ahead of them.
        let behind_m = situation.body.length_m - 0.5 * car.length_m;
        let headings = column(episode, "ado.heading").iter();
        let lateral = column(episode, "ado.lateral").iter().zip(headings);
        for (i, (lateral, heading)) in lateral.enumerate() {
            let centre_m = lateral - behind_m * heading.sin();
            let off_m = centre_m - car.lateral_m(situation.time_s + 0.05 * i as f64);
            assert!(off_m.abs() < 0.1, "{}: {off_m} m off at sample {i}", car.id);
        }
    }
}

#[test]
fn worlds_have_no_recorded_row_and_say_where_their_points_come_from() {
    let cases = [
        (SituationKind::Following, recorded(&following(), 42)),
        (SituationKind::CutIn, recorded(&cut_ins(), 16)),
    ];
    for (kind, recording) in cases {
        let recorded = RecordedWorlds::of("a", kind, &[recording], 24);
        for world in &recorded.worlds {
            let text = recorded_world::world_of(world).text().expect("a text");
            // A speed per decision of 0.5 s, and not per sample of 0.05 s.
            let speeds = text.matches("speed_mps").count() + text.matches("to_mps").count();
            assert!((20..=30).contains(&speeds), "{speeds}");
            let (_, rows) = text.split_once("rows: [").expect("a table");
            let (rows, _) = rows.split_once("],\n    )").expect("its end");
            let numbers = rows.lines().filter(|it| !it.contains("//"));
            let numbers: usize = numbers.map(|it| it.matches(',').count()).sum();
            assert!(numbers < 60 * world.situations.len(), "{rows}");
            let origins = rows.matches("ahead of the ego, which replaces").count();
            assert_eq!(origins, world.situations.len(), "{rows}");
        }
    }
}

#[test]
fn the_ado_may_stray_only_as_far_as_its_rules_allow() {
    let recording = [recorded(&cut_ins(), 16)];
    let recorded = RecordedWorlds::of("cut", SituationKind::CutIn, &recording, 24);
    let world = &recorded.worlds[0];
    let scenario = parsed(world);
    // Braking by 1 m/s² for 10 s is 50 m, and 0.3 m/s aside for 10 s is 3 m.
    for (action, name) in [
        (3, "stays near its recording"),
        (7, "changes lanes within a second of its recording"),
    ] {
        for episode in played(world, action) {
            let Verdict::Foul { rule, .. } = &episode.verdict else {
                panic!("{name}: {:?}", episode.verdict);
            };
            assert_eq!(scenario.rules()[*rule].name, name);
        }
    }
}

/// Place and course of a road user at a time.
type Motion = fn(f64) -> ([f64; 2], f64);

/// Recording of road users on their paths, with 2 cm of noise.
fn on_paths(users: &[(&'static str, Class, [f64; 2], Motion)], seconds: usize) -> Analysis {
    let mut noise = 1_u32;
    let mut off_m = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.04 * (f64::from(noise >> 8) / f64::from(1 << 24) - 0.5)
    };
    let (mut ids, mut times_s, mut classes): (Vec<&str>, Vec<f64>, Vec<Class>) = Default::default();
    let [mut x_m, mut y_m, mut heading_rad, mut length_m, mut width_m]: [Vec<f64>; 5] =
        Default::default();
    for i in 0..20 * seconds {
        let t = 0.05 * i as f64;
        for (id, class, [length, width], motion) in users {
            let ([x, y], course_rad) = motion(t);
            ids.push(id);
            times_s.push(t);
            classes.push(*class);
            x_m.push(x + off_m());
            y_m.push(y + off_m());
            heading_rad.push(course_rad);
            length_m.push(*length);
            width_m.push(*width);
        }
    }
    let mut columns = RecordingColumns::new(&ids, &times_s, &x_m, &y_m);
    columns.heading_rad = Some(&heading_rad);
    columns.size_m = Some((&length_m, &width_m));
    columns.classes = Some(&classes);
    Analysis::of(TrafficRecording::from_columns("arrays", &columns).expect("valid arrays"))
}

/// A car that goes north, 8 m/s.
fn northward(t: f64) -> ([f64; 2], f64) {
    ([0.0, -76.0 + 8.0 * t], 0.5 * PI)
}

/// A bicycle that goes east, and turns left by 0.8 rad with a radius of 20 m, 4 m/s.
fn turning(t: f64) -> ([f64; 2], f64) {
    let s = 4.0 * t - 4.0;
    if s < 0.0 {
        return ([-20.0 + s, -20.0], 0.0);
    }
    let turn_rad = (s / 20.0).min(0.8);
    let (sin, cos) = turn_rad.sin_cos();
    let beyond_m = (s - 20.0 * turn_rad).max(0.0);
    let place = [
        -20.0 + 20.0 * sin + beyond_m * cos,
        20.0 - 20.0 * cos - 20.0 + beyond_m * sin,
    ];
    (place, turn_rad)
}

/// A pedestrian that goes west and waits from 4 s to 6 s, 1.5 m/s.
fn walking(t: f64) -> ([f64; 2], f64) {
    let walked_s = t.min(4.0) + (t - 6.0).max(0.0);
    ([9.0 - 1.5 * walked_s, 0.0], PI)
}

/// A parked car, and one that comes towards the ego.
fn parked(_: f64) -> ([f64; 2], f64) {
    ([4.0, -30.0], 0.5 * PI)
}

fn oncoming(t: f64) -> ([f64; 2], f64) {
    ([-4.0, 60.0 - 9.0 * t], -0.5 * PI)
}

const CAR_M: [f64; 2] = [4.5, 1.8];

/// Checks that an agent of an episode repeats a motion, in the frame of the world.
#[track_caller]
fn repeats_motion(episode: &Episode, name: &str, ahead_m: f64, from_s: f64, motion: Motion) {
    // Frame of the world: the first place and course of the ego, which goes north.
    let [x, y, heading] = ["x", "y", "heading"].map(|it| column(episode, &format!("ego.{it}"))[0]);
    let (own, course_rad) = northward(from_s);
    let turned_rad = heading - course_rad;
    // The box centre of the ego is half a length behind its front.
    let own_m = [x - 2.27 * heading.cos(), y - 2.27 * heading.sin()];
    let (sin, cos) = turned_rad.sin_cos();
    let signals = ["x", "y", "heading"].map(|it| column(episode, &format!("{name}.{it}")));
    for i in 0..signals[0].len() {
        let ([u, v], _) = motion(from_s + 0.05 * i as f64);
        let (dx, dy) = (u - own[0], v - own[1]);
        let expected = [
            own_m[0] + cos * dx - sin * dy,
            own_m[1] + sin * dx + cos * dy,
        ];
        let [front_x, front_y, heading] = signals.map(|it| it[i]);
        let centre = [
            front_x - ahead_m * heading.cos(),
            front_y - ahead_m * heading.sin(),
        ];
        let off_m = (centre[0] - expected[0]).hypot(centre[1] - expected[1]);
        assert!(off_m < 0.25, "{name} is {off_m} m off at sample {i}");
    }
}

#[test]
fn a_bicycle_that_turns_crosses_as_recorded() {
    let bicycle = ("bicycle", Class::Bicycle, [1.75, 0.6], turning as Motion);
    let recording = [on_paths(
        &[("car", Class::Car, CAR_M, northward), bicycle],
        18,
    )];
    let recorded = RecordedWorlds::of("cross", SituationKind::Crossing, &recording, 24);
    let [world] = &recorded.worlds[..] else {
        panic!("{recorded:?}");
    };
    let situation = &world.situations[0];
    assert_eq!(
        (&*situation.planned, &*situation.replaced),
        ("bicycle", "car")
    );
    let SituationRoad::Crossing(roads) = &situation.road else {
        panic!("{situation:?}");
    };
    assert!(roads.ego.is_straight() && !roads.other.is_straight());
    let episodes = played(world, 1);
    repeats_motion(&episodes[0], "ado", 0.875, situation.time_s, turning);
    // Faster and slower, it leaves its recording.
    assert!(matches!(
        played(world, 2)[0].verdict,
        Verdict::Foul { rule: 0, .. } | Verdict::Foul { rule: 1, .. }
    ));
}

#[test]
fn a_pedestrian_that_waits_crosses_as_recorded_among_others() {
    let users = [
        ("car", Class::Car, CAR_M, northward as Motion),
        ("pedestrian", Class::Pedestrian, [0.5, 0.6], walking),
        ("parked", Class::Car, CAR_M, parked),
        ("oncoming", Class::Car, CAR_M, oncoming),
    ];
    let recording = [on_paths(&users, 14)];
    let kind = SituationKind::Crossing;
    let recorded = RecordedWorlds::with_others("cross", kind, &recording, 24, 5);
    let world = &recorded.worlds[0];
    let situation = &world.situations[0];
    assert_eq!(&*situation.planned, "pedestrian", "{recorded:?}");
    let others: Vec<&str> = situation.others.iter().map(|it| &*it.id).collect();
    assert_eq!(others, ["parked", "oncoming"]);
    let episode = &played(world, 1)[0];
    repeats_motion(episode, "ado", 0.25, situation.time_s, walking);
    repeats_motion(episode, "other1", 2.27, situation.time_s, parked);
    repeats_motion(episode, "other2", 2.27, situation.time_s, oncoming);
    let alone = RecordedWorlds::of("cross", kind, &recording, 24);
    assert!(alone.worlds[0].situations[0].others.is_empty());
}

/// Two cars on a bend to the left with a radius of 300 m, the second 40 m behind.
fn on_bend(at_m: f64, t: f64) -> ([f64; 2], f64) {
    // Both brake by 1 m/s² from 5 s to 8 s.
    let lost_m = (t - 5.0).clamp(0.0, 3.0).powi(2) / 2.0 + 3.0 * (t - 8.0).max(0.0);
    let course_rad = (at_m + 25.0 * t - lost_m) / 300.0;
    let (sin, cos) = course_rad.sin_cos();
    ([300.0 * sin, 300.0 - 300.0 * cos], course_rad)
}

#[test]
fn a_following_in_a_bend_has_a_road_with_the_bend() {
    let lead = ("lead", Class::Car, CAR_M, (|t| on_bend(40.0, t)) as Motion);
    let own = ("own", Class::Car, CAR_M, (|t| on_bend(0.0, t)) as Motion);
    let recording = [on_paths(&[lead, own], 11)];
    let recorded = RecordedWorlds::of("bend", SituationKind::Following, &recording, 24);
    let [world] = &recorded.worlds[..] else {
        panic!("{recorded:?}");
    };
    let text = recorded_world::world_of(world).text().expect("a text");
    assert!(text.contains("road: Curved("), "{text}");
    assert!(world.road_m < 0.3, "{}", world.road_m);
    let episode = &played(world, 1)[0];
    let from_s = world.situations[0].time_s;
    // The ego has no plan, but both begin where they were recorded.
    let [x, y] = ["x", "y"].map(|it| column(episode, &format!("lead.{it}")));
    let radius_m = |a: usize, b: usize, c: usize| {
        let side = |i: usize, k: usize| (x[i] - x[k]).hypot(y[i] - y[k]);
        let (p, q, r) = (side(a, b), side(b, c), side(a, c));
        let half = 0.5 * (p + q + r);
        let area = (half * (half - p) * (half - q) * (half - r)).sqrt();
        p * q * r / (4.0 * area)
    };
    let bend_m = radius_m(0, 100, 200);
    assert!((bend_m - 300.0).abs() < 10.0, "{bend_m}");
    let ([x0, y0], _) = on_bend(40.0, from_s);
    for i in 0..x.len() {
        let ([u, v], _) = on_bend(40.0, from_s + 0.05 * i as f64);
        let off_m = (x[i] - x[0]).hypot(y[i] - y[0]) - (u - x0).hypot(v - y0);
        assert!(off_m.abs() < 0.15, "{off_m} m off at sample {i}");
    }
}
