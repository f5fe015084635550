//! A driver as the ego of a world, and the same one in the panel.

use brakecheck::ego::ReferenceDriver;
use brakecheck::preventability::DriverOutcome;
use brakecheck::preventability::Seat;
use brakecheck::testbench::{Aftermath, Episode, Replay, motion_of, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use ron::extensions::Extensions;

use super::{WORLDS, contacts, world};

/// Every driver of the panel, and what a world calls it as its ego.
const DRIVERS: [(ReferenceDriver, &str); 6] = [
    (ReferenceDriver::Cc, "CcDriver"),
    (ReferenceDriver::CcLane, "CcLaneDriver"),
    (ReferenceDriver::CcLatched, "CcLatchedDriver"),
    (ReferenceDriver::Reg, "RegDriver"),
    (ReferenceDriver::Rss, "RssDriver"),
    (ReferenceDriver::Fsm, "FsmDriver"),
];

/// A lead car uncovers a truck that stands; `sensors` are the ego's.
fn cut_out(plant: &str, sensors: &str) -> Scenario {
    let speeds = ["(22.0, 26.0)", "(24.0, 26.0)"];
    uncovered(plant, sensors, speeds, ["(25.0, 45.0)", "(150.0, 200.0)"])
}

/// The same at motorway speeds, at which it takes more than the distance to the
/// lead car to stop.
fn fast_cut_out(sensors: &str) -> Scenario {
    let speeds = ["(34.0, 36.0)", "(35.0, 36.0)"];
    uncovered(
        "Kinematic",
        sensors,
        speeds,
        ["(45.0, 55.0)", "(260.0, 300.0)"],
    )
}

/// Speeds of the ego and of the lead car, headways of the lead car and of the truck.
fn uncovered(
    plant: &str,
    sensors: &str,
    [ego_mps, lead_mps]: [&str; 2],
    [lead_m, truck_m]: [&str; 2],
) -> Scenario {
    let text = format!(
        "Scenario(name: \"cut_out\", question: \"?\", \
         clock: (horizon_s: 16.0, decision_s: 0.5, sample_s: 0.05, substeps: 4), \
         plant: {plant}, judge: UntilContact, \
         road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9), \
         agents: [Vehicle(name: \"ego\", body: \"sedan\", lane: 0, \
         start: At(x_m: 0.0, speed_mps: {ego_mps}), \
         drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.3))), \
         Vehicle(name: \"lead\", body: \"sedan\", lane: 0, \
         start: Ahead(of: \"ego\", headway_m: {lead_m}, speed_mps: {lead_mps}), \
         drive: Ado(actions: Grid(accelerations: [0.0], lateral: [Hold, Left], lateral_mps: 1.5), \
         neutral: 0, observe: [\"ego.speed\"], \
         rulebook: [Rule(name: \"drives on\", stl: \"always (lead.speed >= 1)\")])), \
         Vehicle(name: \"truck\", body: \"truck\", lane: 0, \
         start: Ahead(of: \"ego\", headway_m: {truck_m}, speed_mps: 0.0), \
         drive: Scripted(Stand))], sensors: ({sensors}), \
         ego_spec: \"always (ego.truck.gap >= 0.2)\")"
    );
    Scenario::parse("cut_out.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// The world with a driver as its ego, behind brakes that build up once: in the
/// model, or else in the car.
fn driven_by(world: &Scenario, driver: ReferenceDriver, name: &str) -> Scenario {
    let lag_s = if driver.has_build_up() {
        0.0
    } else {
        world.ego().expect("a driving world").lag_s
    };
    let change = format!("Change(controller: {name}(lag_s: {lag_s:?}))");
    let extensions = Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES;
    let options = ron::Options::default().with_default_extension(extensions);
    let change: Change = options.from_str(&change).expect("a change");
    world.with(&change).expect("an ego")
}

/// The same start and actions again.
fn again(world: &Scenario, episode: &Episode) -> Episode {
    let mut bench = world.bench();
    let mut ado = Replay::then(&episode.actions, bench.spaces().neutral);
    play(
        &mut bench,
        &episode.start,
        episode.noise,
        &mut ado,
        Aftermath::Play,
    )
}

/// What the panel says of a driver from the start of an episode on, and until
/// when there is a record of the others.
fn in_panel(world: &Scenario, episode: &Episode, driver: ReferenceDriver) -> (DriverOutcome, f64) {
    let motion = motion_of(&mut world.bench(), episode).expect("bodies");
    let mut replayer = world.replayer().expect("a driving world");
    let case = replayer.case(&motion);
    let outcome = replayer.from_start(&case, Seat::Driver(driver), None);
    (outcome, motion.end_s)
}

/// How far apart two ends are: in time and in closing speed; `None`: only one of
/// them is a contact.
fn apart(episode: &Episode, outcome: &DriverOutcome) -> Option<(f64, f64)> {
    match (&episode.contact, &outcome.contact) {
        (Some(touch), Some(contact)) => Some((
            (touch.time_s - contact.time_s).abs(),
            (touch.closing_speed_mps - contact.closing_speed_mps).abs(),
        )),
        (None, None) => Some((0.0, 0.0)),
        _ => None,
    }
}

/// Among the motions of its own run a driver in the panel does what it did as
/// the ego: it sees the same and answers alike.
#[test]
fn a_driver_as_the_ego_and_in_the_panel_are_one() {
    let (mut contact, mut held) = (0, 0);
    for name in WORLDS {
        let world = world(name, PlantKind::Kinematic);
        for (episode, _) in contacts(&world, 3) {
            for (driver, ego) in DRIVERS {
                let world = driven_by(&world, driver, ego);
                let run = again(&world, &episode);
                let of_ego = run.contact.as_ref().map(|it| &it.between);
                if of_ego.is_some_and(|(one, other)| one != "ego" && other != "ego") {
                    continue;
                }
                let (outcome, end_s) = in_panel(&world, &run, driver);
                let later = |time_s: f64| run.contact.is_none() && end_s < time_s;
                if outcome.contact.as_ref().is_some_and(|it| later(it.time_s)) {
                    continue;
                }
                let apart = apart(&run, &outcome);
                assert!(
                    apart.is_some_and(|(s, mps)| s < 1e-6 && mps < 1e-6),
                    "{name} {ego}: {:?}, {outcome:?}",
                    run.contact
                );
                match run.contact {
                    Some(_) => contact += 1,
                    None => held += 1,
                }
            }
        }
    }
    assert!(
        contact >= 10 && held >= 10,
        "{contact} contacts, {held} held"
    );
}

/// The runs of `drivers` as egos that end otherwise than the panel says of them
/// from the record of an ego that brakes for nobody.
fn disagreeing(panel: &Scenario, egos: &Scenario) -> Vec<String> {
    let mut found = Vec::new();
    let mut bench = panel.bench();
    let mut compared = 0;
    for index in 0..6 {
        let key = brakecheck::seed::StartKey {
            purpose: brakecheck::seed::Purpose::Test,
            seed: 11,
            index,
        };
        let start = bench.draw(key);
        // It leaves the lane after one to four seconds.
        let mut actions = vec![0; 2 + index as usize];
        actions.extend([1; 5]);
        let mut ado = Replay::then(&actions, 0);
        let record = play(&mut bench, &start, index, &mut ado, Aftermath::Play);
        // Where it leaves too late it hits the truck itself.
        let touch = record.contact.as_ref().expect("a contact");
        if touch.between.0 != "ego" {
            continue;
        }
        compared += 1;
        for (driver, ego) in DRIVERS {
            let (outcome, _) = in_panel(panel, &record, driver);
            let run = again(&driven_by(egos, driver, ego), &record);
            let apart = apart(&run, &outcome);
            if !apart.is_some_and(|(s, mps)| s < 0.05 && mps < 0.3) {
                found.push(format!("{index} {ego}: {:?}, {outcome:?}", run.contact));
            }
        }
    }
    assert!(compared > 2, "{compared} records");
    found
}

/// From the record of a rigid ego, too, and past its end: a driver is as fast as
/// it is, not as the recorded ego was, and sees nobody through others.
#[test]
fn the_panel_and_the_ego_agree_about_a_truck_that_is_uncovered() {
    for sensors in ["", "line_of_sight: true"] {
        for plant in ["Kinematic", "Rigid"] {
            let world = cut_out(plant, sensors);
            let found = disagreeing(&world, &world);
            assert!(
                found.is_empty(),
                "{plant}, {sensors}:\n{}",
                found.join("\n")
            );
        }
    }
    // Other sensors are another story, and the comparison sees that.
    let open = cut_out("Kinematic", "");
    let late = cut_out("Kinematic", "delay_s: 0.3");
    assert!(!disagreeing(&open, &late).is_empty());
}

/// Records in which a coasting ego hits the truck, and the lead car left its lane
/// as late as it could.
fn late_records(world: &Scenario) -> Vec<Episode> {
    let mut bench = world.bench();
    let late = |index: u64| {
        let key = brakecheck::seed::StartKey {
            purpose: brakecheck::seed::Purpose::Test,
            seed: 11,
            index,
        };
        let start = bench.draw(key);
        let mut latest = None;
        for held in 0..32 {
            let mut actions = vec![0; held];
            actions.extend([1; 5]);
            let mut ado = Replay::then(&actions, 0);
            let record = play(&mut bench, &start, index, &mut ado, Aftermath::Play);
            let touch = record.contact.as_ref().expect("a contact");
            if (&*touch.between.0, &*touch.between.1) == ("ego", "truck") {
                latest = Some(record);
            }
        }
        latest
    };
    (0..6).filter_map(late).collect()
}

/// Who avoids the truck among the drivers: in the panel from the handover and
/// from the start on, and as the ego.
fn avoiding(world: &Scenario, record: &Episode) -> [Vec<&'static str>; 3] {
    let motion = motion_of(&mut world.bench(), record).expect("bodies");
    let mut replayer = world.replayer().expect("a driving world");
    let case = replayer.case(&motion);
    let mut found = [Vec::new(), Vec::new(), Vec::new()];
    for (driver, ego) in DRIVERS {
        let handover = replayer.from_handover(&case, driver, None);
        let start = replayer.from_start(&case, Seat::Driver(driver), None);
        let run = again(&driven_by(world, driver, ego), record);
        let avoids = [
            handover.is_some_and(|outcome| outcome.avoided),
            start.avoided,
            run.contact.is_none(),
        ];
        for (names, avoids) in found.iter_mut().zip(avoids) {
            names.extend(avoids.then_some(ego));
        }
    }
    found
}

/// Sight decides: drivers who look through the lead car avoid a truck that those
/// who do not see it in time hit, as the ego and in the panel alike.
#[test]
fn who_looks_through_others_avoids_what_is_uncovered_late() {
    let (open, hidden) = (fast_cut_out(""), fast_cut_out("line_of_sight: true"));
    let records = late_records(&open);
    assert!(records.len() > 3, "{} records", records.len());
    let both: Vec<[[Vec<&str>; 3]; 2]> = records
        .iter()
        .map(|record| {
            let both = [avoiding(&open, record), avoiding(&hidden, record)];
            for [_, in_panel, as_ego] in &both {
                assert_eq!(in_panel, as_ego);
            }
            both
        })
        .collect();
    // Records in which a driver avoids the truck by looking through the lead car:
    // a panel that ignored sight would say so of the hidden world as well.
    let by_sight = |seat: usize, driver: &str| {
        let avoids = |names: &[Vec<&str>; 3]| names[seat].contains(&driver);
        let differ = both
            .iter()
            .filter(|[open, hidden]| avoids(open) && !avoids(hidden));
        differ.count()
    };
    for seat in 0..3 {
        assert!(by_sight(seat, "RssDriver") > 3, "{seat}: {both:?}");
    }
    assert!(by_sight(0, "FsmDriver") > 1, "{both:?}");
}
