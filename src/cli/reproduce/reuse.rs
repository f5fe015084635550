//! One trained ado on changed egos, beside honest baselines.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, talk, world};
use crate::campaign::{ReuseStudy, Watch, reuse_markdown, reuse_study};
use crate::scenario::{Change, Scenario};

/// The worlds that name a family.
const WORLDS: [&str; 2] = ["acc", "yellow_light"];

/// Runs per start of the ado that may explore.
const TRIES: u64 = 30;
/// Training seeds, at most: nine trainings per world.
const SEEDS: u64 = 3;

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let runs = args.output.join("runs");
    let request = ReuseStudy {
        seeds: args.seeds.min(SEEDS),
        starts: args.starts,
        tries: TRIES,
        runs: &runs,
    };
    let mut studies = Vec::new();
    let asked = WORLDS
        .iter()
        .filter(|name| args.world.is_empty() || args.world.iter().any(|world| world == *name));
    for name in asked {
        let scenario = world(args, name)?;
        let egos = changed(&scenario)?;
        let bar = talk::bar(&format!("{name}, reuse"), 0);
        let watch = Watch {
            progress: &|done, total| {
                bar.set_length(total);
                bar.set_position(done);
            },
            stop: talk::stop(),
        };
        let study = reuse_study(&scenario, &egos, &request, &watch)?;
        bar.finish_and_clear();
        let Some(study) = study else {
            talk::say("interrupted: finished trainings are kept; run the same command to go on");
            return Ok(None);
        };
        studies.push(study);
    }
    Ok(Some(Made {
        name: "reuse",
        markdown: reuse_markdown(&studies),
        json: json!({ "reuse": studies }),
    }))
}

/// The world's `reuse`, each ego in its world.
fn changed(scenario: &Scenario) -> Result<Vec<(String, Change, Scenario)>, Failure> {
    let with = |(name, change): (&String, &Change)| {
        let changed = scenario
            .with(change)
            .map_err(|error| Failure::input(error.to_string(), "mend the world's `reuse`"))?;
        Ok((name.clone(), change.clone(), changed))
    };
    scenario.reuse.iter().map(with).collect()
}
