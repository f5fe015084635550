//! Egos of other structures, one by one.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, headed, once, settings, world};
use crate::{
    RUNS, StructureRow, StructureStudy, other_structures, structures_markdown, trained_run,
};
use brakecheck::experiment::Watch;
use brakecheck::run_dir::RunDir;
use brakecheck::seed::Seeds;
use brakecheck::world::Scenario;

/// World of ACC whose changed egos have ten structures.
///
/// The same egos are played in every other world, too.
const WORLDS: [&str; 1] = ["acc_structures"];
/// Trainings per world, at most, and starts: each start is searched with two
/// switches and planned six times.
const MOST_TRAININGS: u64 = 2;
const MOST_STARTS: usize = 100;

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(MOST_TRAININGS);
    let (mut tables, mut studies) = (String::new(), serde_json::Map::new());
    for name in &args.worlds_or(WORLDS) {
        let Some(rows) = rows(args, seeds, name)? else {
            return Ok(None);
        };
        tables.push_str(&structures_markdown(name, &rows));
        tables.push('\n');
        studies.insert(name.clone(), json!(rows));
    }
    Ok(Some(Made {
        name: "structures",
        markdown: headed(seeds, &tables),
        json: json!({ "structures": studies }),
    }))
}

/// Returns a row for each training and ego of a world, `None` if stopped.
fn rows(
    args: &ReproduceArgs,
    seeds: Seeds,
    name: &str,
) -> Result<Option<Vec<StructureRow>>, Failure> {
    let scenario = world(args, name)?;
    let egos = other_structures(&scenario)?;
    let starts = args.starts.min(MOST_STARTS);
    let mut rows = Vec::new();
    for seed in seeds.trainings() {
        for ego in &egos {
            let own = json!({
                "starts": starts, "ego": ego.name(), "training": seed, "runs": RUNS,
            });
            let piece = format!("{name} {seed}, {}", ego.name());
            let made = once(args, &piece, &scenario, settings(seeds, own), |watch| {
                // Inside of the piece, so that a finished piece needs no training.
                let Some(run) = trained(args, &scenario, seed, watch)? else {
                    return Ok(None);
                };
                let study = StructureStudy {
                    run: &run,
                    nominal: &scenario,
                    starts: (starts, seeds.starts),
                };
                Ok(study.evaluate(ego, watch)?)
            })?;
            let Some(row) = made else {
                return Ok(None);
            };
            rows.push(row);
        }
    }
    Ok(Some(rows))
}

/// Returns the ado of a seed, and trains it if necessary. `None` if stopped.
fn trained(
    args: &ReproduceArgs,
    scenario: &Scenario,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<Option<RunDir>, Failure> {
    let (path, _) = trained_run(scenario, seed, &args.output.join("runs"), watch)?;
    if watch.stopped() {
        Ok(None)
    } else {
        Ok(Some(RunDir::open(&path)?))
    }
}
