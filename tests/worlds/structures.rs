//! Families with controllers of other structures than the world's own.

use brakecheck::run_dir::RunDir;
use brakecheck::training::{TrainRequest, TrainSession};
use brakecheck::world::{Change, Scenario, TrainingEgos};

use super::families::{family, key, quiet};

fn structures() -> Scenario {
    let world = Scenario::shipped("acc_structures").expect("shipped");
    world.expect("sound")
}

#[test]
fn controllers_of_other_structures_are_met_as_often_as_the_worlds_own() {
    let world = structures();
    let family = family(&world);
    let others = family.structures.len();
    assert_eq!(others, 10);
    let count = 11_000;
    let draws: Vec<_> = (0..count).map(|i| family.draw("mine", key(i))).collect();
    let kind = |i: usize| family.variant(&draws[i]).controller.controller.kind();
    for structure in &family.structures {
        let change = &world.reuse()[&structure.name];
        let own = change.controller.as_ref().expect("another controller");
        let met: Vec<usize> = (0..count as usize)
            .filter(|&i| kind(i) == own.controller.kind())
            .collect();
        assert!(
            (850..1150).contains(&met.len()),
            "{}: {}",
            structure.name,
            met.len()
        );
        for i in met {
            let controller = family.variant(&draws[i]).controller;
            let same = Change {
                controller: Some(controller),
                ..Change::default()
            };
            assert!(family.covers(&same), "{}: drawn outside", structure.name);
        }
        assert!(family.covers(change), "{}", structure.name);
        let mut beyond = change.clone();
        let name = own.parameters()[0].name;
        beyond.ego.0.insert(name.to_owned(), 99.0);
        assert!(!family.covers(&beyond), "{}", structure.name);
    }
    // What else is drawn does not depend on the structures.
    let mut alone = family.clone();
    alone.structures.clear();
    for (i, draw) in draws.iter().enumerate().take(200) {
        assert_eq!(alone.draw("mine", key(i as u64)).values, draw.values);
    }
}

#[test]
fn a_structure_that_is_left_out_is_never_met_and_the_run_says_so() {
    let world = structures();
    assert!(world.leaving_out("idmm").is_none());
    let others = world.leaving_out("idm").expect("one of them");
    let family = family(&others);
    for i in 0..2_000 {
        let met = family.variant(&family.draw("mine", key(i))).controller;
        assert_ne!(met.controller.kind(), "Idm");
    }
    assert!(!family.covers(&world.reuse()["idm"]));

    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("run");
    let request = TrainRequest {
        decisions: Some(300),
        against: TrainingEgos::Randomized,
        leave_out: Some("idm"),
        ..TrainRequest::default()
    };
    let mut session = TrainSession::begin(&world, &path, &request).expect("begun");
    session.train(&quiet()).expect("trained");
    drop(session);
    let run = RunDir::open(&path).expect("a run");
    assert_eq!(run.manifest().left_out.as_deref(), Some("idm"));
    let learned = run.world().expect("sound");
    assert_eq!(learned.family().expect("one").structures.len(), 9);
    // Going on leaves the same one out, and refuses to leave out another.
    let begun = TrainSession::resume(&world, &path, &TrainRequest::default());
    assert!(begun.is_ok(), "{:?}", begun.err());
    drop(begun);
    let other = TrainRequest {
        leave_out: Some("gipps"),
        ..request
    };
    let refused = TrainSession::resume(&world, &path, &other)
        .err()
        .expect("another");
    assert!(refused.to_string().contains("left out"), "{refused}");
    for (asked, against) in [
        (Some("idm"), TrainingEgos::Nominal),
        (Some("idmm"), TrainingEgos::Randomized),
    ] {
        let request = TrainRequest {
            against,
            leave_out: asked,
            ..TrainRequest::default()
        };
        let path = dir.path().join("none");
        assert!(TrainSession::begin(&world, &path, &request).is_err());
        assert!(!path.exists());
    }
}

#[test]
fn a_structure_that_is_none_is_refused_at_its_place() {
    let text = include_str!("../../worlds/acc_structures.ron");
    let wrong = [
        (
            "\"idm\": { \"time_gap_s\"",
            "\"idmm\": { \"time_gap_s\"",
            "no ego `idmm` under `reuse`",
        ),
        (
            "\"min_gap_m\": (0.5, 2.0)",
            "\"min_gap\": (0.5, 2.0)",
            "`Idm` has no parameter `min_gap`",
        ),
        (
            "\"min_gap_m\": (0.5, 2.0)",
            "\"min_gap_m\": (2.0, 0.5)",
            "does not rise",
        ),
        (
            "\"min_gap_m\": (0.5, 2.0)",
            "\"min_gap_m\": (0.7, 2.0)",
            "leaves out 0.6",
        ),
    ];
    for (was, is, what) in wrong {
        assert!(text.contains(was), "{was}");
        let refused = Scenario::parse("mine.ron", &text.replace(was, is)).expect_err(what);
        let said = format!("{refused:?} {refused}");
        assert!(said.contains(what), "{what}: {said}");
    }
}
