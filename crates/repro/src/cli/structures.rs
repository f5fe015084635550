//! Egos of other structures, one by one.

use std::collections::BTreeSet;

use serde_json::json;

use super::{Failure, Made, StudyPiece, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{
    RUNS, StructureMeans, StructureRow, StructureStudy, other_structures, structures_markdown,
    trained_run,
};
use brakecheck::experiment::Watch;
use brakecheck::run_dir::RunDir;
use brakecheck::world::Scenario;

/// World of ACC whose changed egos have ten structures.
///
/// The same egos are played in every other world, too.
const WORLDS: [&str; 1] = ["acc_structures"];

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let (mut tables, mut studies) = (String::new(), serde_json::Map::new());
    let mut recorded = Vec::new();
    for name in &study.worlds_or(WORLDS) {
        let mut depends = DigestProbe::of_training(name);
        depends.extend([
            DigestProbe::Surrogate,
            // Every world plays the changed egos of this one.
            DigestProbe::Egos("acc_structures".to_owned()),
        ]);
        let Some(StudyPiece { cpu_s, made: rows }) = rows(study, &depends, name)? else {
            return Ok(None);
        };
        tables.push_str(&structures_markdown(name, &rows));
        tables.push('\n');
        let only = format!(" --world {name}");
        let means = StructureMeans::of(name, &rows);
        recorded.push(study.row(name, &only, depends, cpu_s, &means));
        studies.insert(name.clone(), json!(rows));
    }
    Ok(Some(Made {
        rows: recorded,
        markdown: format!("With {}.\n\n{tables}", study.seeds()),
        json: json!({ "structures": studies }),
    }))
}

/// Returns a row for each training and ego of a world, `None` if stopped.
fn rows(
    study: &StudyRun<'_>,
    depends: &BTreeSet<DigestProbe>,
    name: &str,
) -> Result<Option<StudyPiece<Vec<StructureRow>>>, Failure> {
    let scenario = study.world(name)?;
    let egos = other_structures(&scenario)?;
    let (seeds, starts) = (study.seeds(), study.starts());
    let mut rows = StudyPiece {
        cpu_s: 0.0,
        made: Vec::new(),
    };
    for seed in seeds.trainings() {
        for ego in &egos {
            let own = json!({
                "starts": starts, "ego": ego.name(), "training": seed, "runs": RUNS,
            });
            // A piece per training and ego, so that an interruption costs one of them at
            // most.
            let piece = format!("{name} {seed}, {}", ego.name());
            let settings = study.settings(own);
            let made = study.once(&piece, &scenario, depends, settings, |watch| {
                // Inside of the piece, so that a finished piece needs no training.
                let Some(run) = trained(study, &scenario, seed, watch)? else {
                    return Ok(None);
                };
                let study = StructureStudy {
                    run: &run,
                    nominal: &scenario,
                    starts: (starts, seeds.starts),
                };
                Ok(study.evaluate(ego, watch)?)
            })?;
            let Some(made) = made else {
                return Ok(None);
            };
            rows.cpu_s += made.cpu_s;
            rows.made.push(made.made);
        }
    }
    Ok(Some(rows))
}

/// Returns the ado of a seed, and trains it if necessary. `None` if stopped.
fn trained(
    study: &StudyRun<'_>,
    scenario: &Scenario,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<Option<RunDir>, Failure> {
    let (path, _) = trained_run(scenario, seed, &study.runs(), watch)?;
    if watch.stopped() {
        Ok(None)
    } else {
        Ok(Some(RunDir::open(&path)?))
    }
}
