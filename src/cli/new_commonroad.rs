//! `brakecheck new NAME --from SCENARIO.xml`: a CommonRoad scenario as a world.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::common::print_json;
use super::failure::{Exit, Failure};
use super::new_world;
use super::terminal;
use crate::commonroad::{CommonRoadImport, CommonRoadWorld};
use crate::openx::import::Files;
use crate::run_dir::write_file;
use crate::world::Scenario;

/// Writes the world of a scenario, or nothing if it is refused.
pub(super) fn run(
    request: &CommonRoadImport<'_>,
    named: &Path,
    files: Files<'_>,
    prints_json: bool,
) -> Result<Exit, Failure> {
    let world = request.read(files)?;
    let path = PathBuf::from(format!("{}.ron", named.display()));
    let file = path.display().to_string();
    new_world::refuse_taken(&path)?;
    // A text that brakecheck would refuse must not reach the disk.
    if let Err(error) = Scenario::parse(&file, &world.text) {
        let from = request.scenario.display();
        let notes = new_world::refused(&error, |offset, what| match world.refused(offset, what) {
            Some(error) => error.headline(),
            None => format!("`{from}`: {what}"),
        });
        return Err(Failure::of(Exit::Input, notes));
    }
    write_file(&path, world.text.as_bytes())?;
    if prints_json {
        print_json(&in_json(&world, request.scenario, &file))?;
    } else {
        print(&world, request.scenario, &file)?;
    }
    Ok(Exit::Done)
}

fn in_json(world: &CommonRoadWorld, from: &Path, file: &str) -> serde_json::Value {
    let from = from.display().to_string();
    let dropped = world
        .dropped
        .iter()
        .map(|it| json!({ "kind": it.kind, "file": from, "line": it.line, "count": it.count }));
    json!({
        // A planning problem is a world of its own, with a single start.
        "worlds": [json!({ "file": file, "points": [0] })],
        "broken": 0,
        "dropped": dropped.collect::<Vec<_>>(),
        // The keys are those of every import, so that scripts need one form only.
        "ego_events": [],
    })
}

fn print(world: &CommonRoadWorld, from: &Path, file: &str) -> Result<(), Failure> {
    let from = from.display();
    for it in &world.dropped {
        terminal::note(&format!(
            "dropped: {}, {} in all, the first in {from}, line {}",
            it.kind, it.count, it.line
        ));
    }
    terminal::data(&format!(
        "wrote {file}: its road is within {:.2} m of the lanelets\nnext: `brakecheck eval {file} -- \
         python3 ego.py` lets your program drive, `--ego FILE.ron` a `Change`",
        world.road_m
    ))
}
