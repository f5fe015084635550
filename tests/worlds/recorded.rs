//! Worlds from recordings: played without an action, they repeat the recording.

use core::f64::consts::PI;

use brakecheck::rulebook::Verdict;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;
use brakecheck_traffic::{
    Analysis, ColumnMap, RecordedWorld, RecordedWorlds, SituationKind, SituationPlan, read_csv,
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
    let scenario = Scenario::parse("recorded.ron", &world.text).unwrap_or_else(|error| {
        let problem = &error.problems[0];
        panic!("{}; {:?}\n{}", problem.what, problem.help, world.text)
    });
    let warnings: Vec<&str> = scenario.warnings().iter().map(|it| &*it.what).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
    scenario
}

/// Plays every situation of a world with one action.
fn played(world: &RecordedWorld, action: usize) -> Vec<Episode> {
    let scenario = parsed(world);
    let starts = scenario.starts().expect("a table of starts");
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
