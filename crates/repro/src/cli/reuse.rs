//! One trained ado on changed egos, beside honest baselines.

use brakecheck::cli::terminal::{Common, bar};
use serde_json::json;

use super::{Failure, Made, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{ReuseError, ReuseStudy, ReuseStudyConfig, reuse_markdown};
use brakecheck::experiment::EgoUnderTest;
use brakecheck::world::Scenario;

/// The worlds that name a family.
const FAMILIES: [&str; 3] = ["acc", "merge", "yellow_light"];
/// The world that `all` evaluates, because a family takes long to train.
const USUAL: [&str; 1] = ["acc"];

/// Runs per start of the ado that may explore.
const TRIES: u64 = 30;

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let runs = study.runs();
    let config = ReuseStudyConfig {
        seeds: study.seeds(),
        starts: study.starts(),
        tries: TRIES,
        runs: &runs,
    };
    let (mut studies, mut rows) = (Vec::new(), Vec::new());
    let worlds = study.worlds_or(USUAL);
    // `all --world` names worlds for every study, and some of them have no family.
    for name in worlds
        .iter()
        .filter(|name| FAMILIES.contains(&name.as_str()))
    {
        let scenario = study.world(name)?;
        let mut depends = DigestProbe::of_training(name);
        depends.insert(DigestProbe::Family(name.clone()));
        depends.insert(DigestProbe::Egos(name.clone()));
        // Trainings come first, because all egos share them.
        let Some(begun) = begin(&study.args.common, name, &scenario, config)? else {
            return Ok(None);
        };
        let (mut results, mut cpu_s) = (Vec::new(), 0.0);
        // `all` begins with the nominal ego, which `conclude` requires.
        for ego in &EgoUnderTest::find(&scenario, "all")? {
            let own = json!({ "starts": config.starts, "tries": config.tries });
            // One piece per ego, so that an interruption costs a single ego.
            let piece = format!("{name}, reuse on {}", ego.name());
            let settings = study.settings(own);
            let made = study.once(&piece, &scenario, &depends, settings, |watch| {
                Ok(begun.evaluate(ego, watch)?)
            })?;
            let Some(made) = made else {
                return Ok(None);
            };
            cpu_s += made.cpu_s;
            results.push(made.made);
        }
        let report = begun.conclude(results);
        // All egos share the trainings, so no piece has their cost.
        let trained_s: f64 = report.train_cpu_s.iter().map(|(_, cpu_s)| cpu_s).sum();
        cpu_s += trained_s * report.seeds as f64;
        let only = format!(" --world {name}");
        rows.push(study.row(name, &only, depends, cpu_s, &report.blocks()));
        studies.push(report);
    }
    Ok(Some(Made {
        rows,
        markdown: format!("With {}.\n\n{}", config.seeds, reuse_markdown(&studies)),
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
