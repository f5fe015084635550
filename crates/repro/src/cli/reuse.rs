//! One trained ado on changed egos, beside honest baselines.

use brakecheck::cli::terminal::{Common, bar};
use serde_json::json;

use super::{Failure, Made, ReproduceArgs, headed, once, settings, world};
use crate::{ReuseError, ReuseStudy, ReuseStudyConfig, reuse_markdown};
use brakecheck::experiment::EgoUnderTest;
use brakecheck::world::Scenario;

/// The worlds that name a family.
const WORLDS: [&str; 3] = ["acc", "merge", "yellow_light"];

/// Runs per start of the ado that may explore.
const TRIES: u64 = 30;
/// Training seeds, at most: six trainings per world.
const SEEDS: u64 = 3;

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let runs = args.output.join("runs");
    let config = ReuseStudyConfig {
        seeds: args.seeds_within(SEEDS),
        starts: args.starts,
        tries: TRIES,
        runs: &runs,
    };
    let mut studies = Vec::new();
    for name in WORLDS.iter().filter(|name| args.wants(name)) {
        let scenario = world(args, name)?;
        // Trainings come first, because all egos share them.
        let Some(study) = begin(&args.common, name, &scenario, config)? else {
            return Ok(None);
        };
        let mut results = Vec::new();
        for ego in &EgoUnderTest::find(&scenario, "all")? {
            let own = json!({ "starts": config.starts, "tries": config.tries });
            let settings = settings(config.seeds, own);
            // One piece per ego, so that an interruption costs a single ego.
            let piece = format!("{name}, reuse on {}", ego.name());
            let made = once(args, &piece, &scenario, settings, |watch| {
                Ok(study.evaluate(ego, watch)?)
            })?;
            let Some(made) = made else {
                return Ok(None);
            };
            results.push(made);
        }
        studies.push(study.conclude(results));
    }
    Ok(Some(Made {
        name: "reuse",
        markdown: headed(config.seeds, &reuse_markdown(&studies)),
        json: json!({ "reuse": studies }),
    }))
}

/// Trains the ados that are not trained yet.
fn begin<'a>(
    common: &Common,
    name: &str,
    scenario: &'a Scenario,
    config: ReuseStudyConfig<'a>,
) -> Result<Option<ReuseStudy<'a>>, Failure> {
    let shown = bar(common, name);
    Ok(ReuseStudy::begin(scenario, config, &shown.watch())?)
}

impl From<ReuseError> for Failure {
    fn from(error: ReuseError) -> Failure {
        match error {
            ReuseError::Train(error) => error.into(),
            ReuseError::Run(error) => error.into(),
            ReuseError::NoFamily { .. } => Failure::input(
                error.to_string(),
                "add `train_against: Family(…)` to the world: docs/guide/reuse.md",
            ),
        }
    }
}
