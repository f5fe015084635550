//! The paper's learning to the letter, and the way from it to the defaults.

use serde_json::json;

use super::{Failure, MOST_SEEDS, Made, ReproduceArgs, headed, once, settings, world};
use crate::{
    CaseStudies, JUDGES, LETTER_PATHS, LetterBaselines, LetterError, LetterPath, LetterRow,
    LetterStudy, LetterStudyError, letter_baselines, letter_markdown, letter_row,
};
use brakecheck::experiment::test_starts;

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(MOST_SEEDS);
    let mut studies = Vec::new();
    for path in LETTER_PATHS.iter().filter(|path| args.wants(path.world)) {
        let letter = world(args, path.world)?;
        let Some(baselines) = baselines(args, path, letter.text())? else {
            return Ok(None);
        };
        let Some(rows) = rows(args, path, letter.text(), &baselines)? else {
            return Ok(None);
        };
        studies.push(LetterStudy {
            world: path.world.to_owned(),
            learner: path.learner.map(str::to_owned),
            switches: path.switches,
            baselines,
            rows,
        });
    }
    Ok(Some(Made {
        name: "letter",
        markdown: headed(seeds, &letter_markdown(&studies)),
        json: json!({ "letter": studies }),
    }))
}

/// Plays a search and untrained ados under both judges, and returns `None` if stopped.
fn baselines(
    args: &ReproduceArgs,
    path: &LetterPath,
    text: &str,
) -> Result<Option<Vec<LetterBaselines>>, Failure> {
    let seeds = args.seeds_within(MOST_SEEDS);
    // Baselines need no learner: paths of one world share them.
    let unlearned = (LetterPath {
        learner: None,
        changes: &[],
        ..*path
    })
    .steps(text)?;
    let mut baselines = Vec::new();
    for judge in JUDGES {
        // Step 0 is the letter itself, without any change.
        let scenario = unlearned[0].judged_by(judge)?;
        let own = json!({ "starts": args.starts, "switches": path.switches });
        let piece = format!("{}, {judge}", path.world);
        let made =
            once(args, &piece, &scenario, settings(seeds, own), |watch| {
                let starts = test_starts(&scenario, seeds.starts, args.starts, watch);
                Ok(starts
                    .and_then(|starts| letter_baselines(&scenario, path.switches, &starts, watch)))
            })?;
        let Some(made) = made else {
            return Ok(None);
        };
        baselines.push(made);
    }
    Ok(Some(baselines))
}

/// A row for each step of a path. `None`: stopped.
fn rows(
    args: &ReproduceArgs,
    path: &LetterPath,
    text: &str,
    baselines: &[LetterBaselines],
) -> Result<Option<Vec<LetterRow>>, Failure> {
    let seeds = args.seeds_within(MOST_SEEDS);
    let learner = path.learner.unwrap_or("dqn");
    let mut rows = Vec::new();
    for (at, step) in path.steps(text)?.iter().enumerate() {
        let scenario = step.scenario()?;
        let own = json!({ "starts": args.starts });
        let piece = format!("{}, {learner}, step {at}", path.world);
        let runs = args.output.join("runs");
        let request = CaseStudies {
            seeds,
            starts: args.starts,
            // Steps of a path train in worlds of the same name, so each needs a
            // directory.
            runs: &runs.join(format!("{learner}-step-{at}")),
        };
        let made = once(args, &piece, &scenario, settings(seeds, own), |watch| {
            Ok(letter_row(step, baselines, &request, watch)?)
        })?;
        let Some(row) = made else {
            return Ok(None);
        };
        rows.push(row);
    }
    Ok(Some(rows))
}

impl From<LetterError> for Failure {
    fn from(error: LetterError) -> Failure {
        match error {
            LetterError::World(error) => error.into(),
            other => Failure::input(
                other.to_string(),
                "use the worlds that came with this version",
            ),
        }
    }
}

impl From<LetterStudyError> for Failure {
    fn from(error: LetterStudyError) -> Failure {
        match error {
            LetterStudyError::Step(error) => error.into(),
            LetterStudyError::Train(error) => error.into(),
        }
    }
}
