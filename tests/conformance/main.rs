//! Whatever is shipped keeps the promises of its trait, and whoever does not is
//! caught.

mod faults;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use brakecheck::conformance::{check_controller, check_env, check_policy, check_scene};
use brakecheck::rl::{LearnerConfig, LearnerSettings};
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_rl::rl::list::load_policy_for;

fn shipped() -> Vec<(String, Scenario)> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("worlds");
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir)
        .expect("the worlds")
        .map(|file| file.expect("a file").path())
        .collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "ron"));
    files.sort();
    let load = |file: PathBuf| {
        let world = Scenario::load(&file).unwrap_or_else(|error| panic!("{error}"));
        (world.name().to_owned(), world)
    };
    files.into_iter().map(load).collect()
}

#[test]
fn every_shipped_world_and_its_egos_conform() {
    let mut egos = BTreeSet::new();
    for (name, world) in shipped() {
        if let Err(broken) = check_scene(&|| world.world().scene()) {
            panic!("{name}: {broken}");
        }
        let quick = world.on(PlantKind::Kinematic);
        if let Err(broken) = check_env(&|| Box::new(Gym::new(quick.bench(), Purpose::Train, 4))) {
            panic!("{name}: {broken}");
        }
        let reused = world
            .reuse()
            .values()
            .filter_map(|change| change.controller.clone());
        for driven in world.controller().into_iter().chain(reused) {
            let ego = driven.controller;
            if let Err(broken) = check_controller(&|| ego.build()) {
                panic!("{name}, {}: {broken}", ego.kind());
            }
            egos.insert(ego.kind());
        }
    }
    let stock = [
        "Acc",
        "Aeb",
        "CcDriver",
        "CurveSpeed",
        "FilteredAcc",
        "FsmDriver",
        "Fvdm",
        "Gipps",
        "Idm",
        "IsoAcc",
        "Krauss",
        "Merge",
        "PoliteAcc",
        "PurePursuit",
        "RssDriver",
        "YellowLight",
        "YellowLightFixed",
    ];
    // The other reference drivers are met as drivers: tests/preventability/main.rs.
    assert_eq!(
        Vec::from_iter(egos),
        stock,
        "every stock ego is in some world"
    );
}

#[test]
fn the_policy_of_every_learner_conforms_trained_and_loaded() {
    let (_, world) = shipped().remove(0);
    let world = world.on(PlantKind::Kinematic);
    let spaces = world.spaces();
    for settings in LearnerSettings::all() {
        let name = settings.name();
        let config = LearnerConfig::new(settings).and_then(|config| config.with_decisions(1500));
        let mut learner = config.expect("in range").build(spaces, 2);
        let mut gym = Gym::new(world.bench(), Purpose::Train, 2);
        while !learner.finished() {
            learner.episode(&mut gym);
        }
        let loaded = load_policy_for(spaces, &learner.policy_bundle()).expect("a policy");
        for policy in [learner.policy(), loaded] {
            if let Err(broken) = check_policy(&*policy, spaces) {
                panic!("{name}: {broken}");
            }
        }
    }
}
