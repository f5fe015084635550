//! Worlds, rulebook and test bench: what holds for every world and every run.

mod after_contact;
mod aftermath;
mod authoring;
mod carrying;
mod composed;
mod conformance;
mod counting;
mod crests;
mod cyclists;
mod drawn_roads;
mod driving;
mod environment;
mod errors;
mod families;
mod goals;
mod imports;
mod including;
mod judging;
mod learned;
mod lemmas;
mod naming;
mod nested;
mod open_drive;
mod plan_speeds;
mod plans;
mod process;
mod protocols;
mod rapier_steps;
mod recorded;
mod rivals;
mod road_ado;
mod roads;
mod sealing;
mod searching;
mod slope_and_wind;
mod structures;
mod trained;
mod vector_env;
mod warnings;
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
    Scenario::parse("acc.ron", include_str!("../../worlds/acc.ron")).expect("a sound world")
}
