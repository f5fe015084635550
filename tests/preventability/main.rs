//! Replays with somebody else in the ego's place.

mod by_hand;
mod edges;
mod panel;
mod reference_controllers;

use brakecheck::crashes::Regressions;
use brakecheck::ego::ReferenceDriver;
use brakecheck::preventability::Seat;
use brakecheck::preventability::{HUMAN_MODELS, Label, NotApplicable, PANEL, Preventability};
use brakecheck::scene::{ContactEvent, Motion};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Episode, HeldRandom, motion_of, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use brakecheck_scene::testbench::actors::HOLD_DECISIONS;

const WORLDS: [&str; 6] = [
    "acc_plain",
    "cut_in",
    "merge_plain",
    "bend",
    "sandwich",
    "acc",
];
/// How far a rigid contact may be from that of a kinematic ego at its speeds.
const RIGID_S: f64 = 0.002;
const RIGID_MPS: f64 = 0.2;

fn world(name: &str, plant: PlantKind) -> Scenario {
    let path = format!("{}/worlds/{name}.ron", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).expect("a world");
    let change = Change {
        plant: Some(plant),
        ..Change::default()
    };
    let world = Scenario::parse(&path, &text).expect("a world");
    world.with(&change).expect("a change")
}

/// Episodes of random ados that end in a contact of the ego's.
fn contacts(world: &Scenario, most: usize) -> Vec<(Episode, Motion)> {
    let mut bench = world.bench();
    let actions = bench.spaces().actions;
    let mut found = Vec::new();
    for index in 0..400 {
        let key = StartKey {
            purpose: Purpose::Train,
            seed: 7,
            index,
        };
        let start = bench.draw(key);
        let mut ado = HeldRandom::new(actions, HOLD_DECISIONS);
        let episode = play(&mut bench, &start, index, &mut ado, Aftermath::Play);
        let is_egos = |it: &ContactEvent| it.between.0 == "ego" || it.between.1 == "ego";
        if !episode.contact.as_ref().is_some_and(is_egos) {
            continue;
        }
        let motion = motion_of(&mut bench, &episode).expect("bodies");
        assert_eq!(motion.contact, episode.contact);
        found.push((episode, motion));
        if found.len() == most {
            break;
        }
    }
    found
}

fn identity(world: &Scenario, motion: &Motion) -> Option<(f64, f64)> {
    let mut replayer = world.replayer().expect("a driving world");
    let case = replayer.case(motion);
    let outcome = replayer.from_start(&case, Seat::Recorded, None);
    let contact = outcome.contact?;
    Some((contact.time_s, contact.closing_speed_mps))
}

#[test]
fn the_recorded_ego_meets_the_recorded_contact_bit_for_bit() {
    let mut met = 0;
    for name in WORLDS {
        let world = world(name, PlantKind::Kinematic);
        for (episode, motion) in contacts(&world, 5) {
            let touch = episode.contact.expect("a contact");
            let want = (touch.time_s, touch.closing_speed_mps);
            assert_eq!(identity(&world, &motion), Some(want), "{name}");
            met += 1;
        }
    }
    assert!(met >= 10, "{met} contacts");
}

#[test]
fn a_rigid_ego_meets_it_nearly_so() {
    let mut met = 0;
    for name in ["acc_plain", "cut_in"] {
        let world = world(name, PlantKind::Rigid);
        for (episode, motion) in contacts(&world, 3) {
            let touch = episode.contact.expect("a contact");
            let (time_s, closing_mps) = identity(&world, &motion).expect("a contact");
            assert!((time_s - touch.time_s).abs() < RIGID_S, "{name}");
            assert!(
                (closing_mps - touch.closing_speed_mps).abs() < RIGID_MPS,
                "{name}"
            );
            met += 1;
        }
    }
    assert!(met >= 4, "{met} contacts");
}

/// What an assessment says of one driver is what asking for that driver says,
/// and a label is what its drivers make it.
#[test]
fn an_assessment_agrees_with_itself() {
    let mut seen = Vec::new();
    for name in WORLDS {
        let world = world(name, PlantKind::Kinematic);
        let mut replayer = world.replayer().expect("a driving world");
        for (episode, motion) in contacts(&world, 4) {
            let assessed = world.preventability(&episode);
            for driver in PANEL.into_iter().chain([ReferenceDriver::Ideal]) {
                let avoided = assessed.is_avoided_by(driver);
                assert_eq!(
                    replayer
                        .is_avoided_by_any(&motion, &[driver])
                        .unwrap_or(false),
                    avoided,
                    "{name} {driver:?}"
                );
            }
            // Both questions about several drivers take fewer replays.
            let humans = world.is_avoided_by_any(&episode, &HUMAN_MODELS);
            assert_eq!(humans, assessed.human_model_avoids(), "{name}");
            let applies = assessed.label != Label::NotApplicable;
            let any = PANEL.iter().any(|driver| assessed.is_avoided_by(*driver));
            let found = world.is_avoided_by_any(&episode, &PANEL);
            assert_eq!(found, applies.then_some(any));
            let json = serde_json::to_string(&assessed).expect("JSON");
            let ron = ron::to_string(&assessed).expect("RON");
            assert_eq!(
                serde_json::from_str::<Preventability>(&json).expect("read"),
                assessed
            );
            assert_eq!(
                ron::from_str::<Preventability>(&ron).expect("read"),
                assessed
            );
            seen.push(assessed.label);
        }
    }
    assert!(
        seen.iter().any(|label| *label != Label::NotApplicable),
        "{seen:?}"
    );
}

/// Without a contact nothing is said, and nothing of somebody who walks.
#[test]
fn somebody_on_foot_is_beyond_these_drivers() {
    let kept = Regressions::load(format!(
        "{}/tests/regressions/pedestrian-nominal-0001.ron",
        env!("CARGO_MANIFEST_DIR")
    ))
    .expect("a kept file");
    let replayed = kept.replay_recorded().expect("replayed").remove(0);
    let (world, episode) = (&replayed.scenario, &replayed.episode);
    let why = |assessed: Preventability| assessed.not_applicable;
    assert_eq!(
        why(world.preventability(episode)),
        Some(NotApplicable::NoContact)
    );
    let mut motion = motion_of(&mut world.bench(), episode).expect("bodies");
    motion.contact = Some(ContactEvent {
        between: ("ego".to_owned(), "ado".to_owned()),
        time_s: 1.0,
        closing_speed_mps: 1.0,
        point_m: [0.0; 3],
        impact: None,
    });
    let mut replayer = world.replayer().expect("a driving world");
    let assessed = replayer.assess(&motion, None);
    assert_eq!(why(assessed), Some(NotApplicable::OnFoot));
    assert_eq!(
        replayer.is_avoided_by_any(&motion, &[ReferenceDriver::Ideal]),
        None
    );
}

/// Who sees danger at the first sample does the same whether it takes over
/// there or drives from the start.
#[test]
fn a_handover_at_the_start_is_the_start() {
    let mut same = 0;
    for name in ["acc", "acc_plain"] {
        let world = world(name, PlantKind::Kinematic);
        for (episode, _) in contacts(&world, 6) {
            let assessed = world.preventability(&episode);
            for (driver, from_handover) in &assessed.handover {
                let from_start = &assessed.t0[driver];
                if assessed.handover_s == Some(0.0) && from_start.reacted_s == Some(0.0) {
                    assert_eq!(from_handover, from_start, "{name} {driver:?}");
                    same += 1;
                }
            }
        }
    }
    assert!(same >= 4, "{same}");
}
