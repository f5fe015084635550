//! Worlds, rulebook and test bench: what holds for every world and every run.

#[path = "worlds/after_contact.rs"]
mod after_contact;
#[path = "worlds/aftermath.rs"]
mod aftermath;
#[path = "worlds/authoring.rs"]
mod authoring;
#[path = "worlds/carrying.rs"]
mod carrying;
#[path = "worlds/composed.rs"]
mod composed;
#[path = "worlds/conformance.rs"]
mod conformance;
#[path = "worlds/counting.rs"]
mod counting;
#[path = "worlds/crests.rs"]
mod crests;
#[path = "worlds/cyclists.rs"]
mod cyclists;
#[path = "worlds/drawn_roads.rs"]
mod drawn_roads;
#[path = "worlds/driving.rs"]
mod driving;
#[path = "worlds/environment.rs"]
mod environment;
#[path = "worlds/errors.rs"]
mod errors;
#[path = "worlds/families.rs"]
mod families;
#[path = "worlds/goals.rs"]
mod goals;
#[path = "worlds/imports.rs"]
mod imports;
#[path = "worlds/including.rs"]
mod including;
#[path = "worlds/judging.rs"]
mod judging;
#[path = "worlds/learned.rs"]
mod learned;
#[path = "worlds/lemmas.rs"]
mod lemmas;
#[path = "worlds/naming.rs"]
mod naming;
#[path = "worlds/nested.rs"]
mod nested;
#[path = "worlds/open_drive.rs"]
mod open_drive;
#[path = "worlds/plan_speeds.rs"]
mod plan_speeds;
#[path = "worlds/plans.rs"]
mod plans;
#[path = "worlds/process.rs"]
mod process;
#[path = "worlds/protocols.rs"]
mod protocols;
#[path = "worlds/rapier_steps.rs"]
mod rapier_steps;
#[path = "worlds/recorded.rs"]
mod recorded;
#[path = "worlds/rivals.rs"]
mod rivals;
#[path = "worlds/road_ado.rs"]
mod road_ado;
#[path = "worlds/roads.rs"]
mod roads;
#[path = "worlds/sealing.rs"]
mod sealing;
#[path = "worlds/searching.rs"]
mod searching;
#[path = "worlds/slope_and_wind.rs"]
mod slope_and_wind;
#[path = "worlds/structures.rs"]
mod structures;
#[path = "worlds/trained.rs"]
mod trained;
#[path = "worlds/vector_env.rs"]
mod vector_env;
#[path = "worlds/warnings.rs"]
mod warnings;
#[path = "worlds/weather.rs"]
mod weather;

use std::path::PathBuf;

use brakecheck::world::Scenario;

/// All shipped worlds by file name.
fn shipped() -> Vec<(String, Scenario)> {
    let dir = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("worlds");
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir)
        .expect("the worlds")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|e| e == "ron"))
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let name = path
                .file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned();
            let world = Scenario::load(&path).unwrap_or_else(|error| panic!("{error}"));
            (name, world)
        })
        .collect()
}

/// The ACC world.
fn acc() -> Scenario {
    Scenario::parse("acc.ron", include_str!("../worlds/acc.ron")).expect("a sound world")
}
