//! Crashes that reference drivers avoid, world by world.

use serde_json::json;

use super::{Failure, MOST_SEEDS, Made, ReproduceArgs, headed, once, settings, world};
use crate::{CaseStudies, CrashStudyError, crash_study, crashes_markdown};

/// The worlds whose crashes are worth acting on.
const WORLDS: [&str; 4] = ["acc_iso", "cut_in_clear", "merge_r157", "pedestrian_hit"];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let request = CaseStudies {
        seeds: args.seeds_within(MOST_SEEDS),
        starts: args.starts,
        runs: &args.output.join("runs"),
    };
    let mut studies = Vec::new();
    for name in &args.worlds_or(WORLDS) {
        let scenario = world(args, name)?;
        let settings = settings(request.seeds, json!({ "starts": args.starts }));
        let piece = format!("{name}, crashes");
        let made = once(args, &piece, &scenario, settings, |watch| {
            let study = crash_study(&scenario, &request, watch);
            study.map_err(|error| match error {
                CrashStudyError::Train(error) => error.into(),
                CrashStudyError::Change(error) => {
                    Failure::input(error.to_string(), "use a world with a vehicle as its ego")
                }
            })
        })?;
        let Some(study) = made else {
            return Ok(None);
        };
        studies.push(study);
    }
    Ok(Some(Made {
        name: "crashes",
        markdown: headed(request.seeds, &crashes_markdown(&studies)),
        json: json!({ "crashes": studies }),
    }))
}
