//! The driving worlds: several training seeds each, beside baselines.

use serde_json::json;

use super::{Failure, MOST_SEEDS, Made, ReproduceArgs, headed, once, settings, world};
use crate::{CaseStudies, case_studies_markdown, case_study};

/// The driving worlds of the table, in its order.
const WORLDS: [&str; 10] = [
    "acc",
    "merge_fair",
    "merge",
    "yellow_light",
    "yellow_light_fixed",
    "pedestrian",
    "cut_in",
    "sandwich",
    "light_ado",
    "bend",
];

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
        // The piece is a file name, so an interrupted table resumes by world.
        let piece = format!("{name}, case study");
        let made = once(args, &piece, &scenario, settings, |watch| {
            Ok(case_study(&scenario, &request, watch)?)
        })?;
        let Some(study) = made else {
            return Ok(None);
        };
        // Intervals follow from the rows, so a kept piece gets those of this version.
        studies.push(study.with_intervals());
    }
    Ok(Some(Made {
        name: "case-studies",
        markdown: headed(request.seeds, &case_studies_markdown(&studies)),
        json: json!({ "case_studies": studies }),
    }))
}
