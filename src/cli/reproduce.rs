//! `brakecheck reproduce`: the tables of the README, from nothing.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Common, Exit, Failure, print_json, talk};
use crate::campaign::{CaseStudies, Watch, case_studies_markdown, case_study};
use crate::run::write_file;
use crate::scenario::Scenario;

/// The driving worlds of the table, in its order.
const DRIVING_WORLDS: [&str; 1] = ["acc"];

#[derive(Args, Debug)]
pub(super) struct ReproduceArgs {
    /// Which tables.
    #[arg(value_enum)]
    what: What,
    /// Where tables and run directories go.
    #[arg(short, long, value_name = "DIR", default_value = "reproduced")]
    output: PathBuf,
    /// Where the shipped worlds are.
    #[arg(long, value_name = "DIR", default_value = "worlds")]
    worlds: PathBuf,
    /// Training seeds per world.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Test starts per world.
    #[arg(long, value_name = "N", default_value_t = 500)]
    starts: usize,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// The driving worlds: five seeds each, beside baselines and search.
    CaseStudies,
}

pub(super) fn run(args: &ReproduceArgs) -> Result<Exit, Failure> {
    match args.what {
        What::CaseStudies => case_studies(args),
    }
}

fn case_studies(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let request = CaseStudies {
        seeds: args.seeds,
        starts: args.starts,
        runs: &args.output.join("runs"),
    };
    let mut studies = Vec::new();
    for name in DRIVING_WORLDS {
        let scenario = Scenario::load(&args.worlds.join(format!("{name}.ron")))?;
        let bar = talk::bar(name, 0);
        let watch = Watch {
            progress: &|done, total| {
                bar.set_length(total);
                bar.set_position(done);
            },
            stop: talk::stop(),
        };
        let study = case_study(&scenario, &request, &watch)?;
        bar.finish_and_clear();
        let Some(study) = study else {
            talk::say("interrupted: finished trainings are kept; run the same command to go on");
            return Ok(Exit::Interrupted);
        };
        studies.push(study);
    }
    let markdown = case_studies_markdown(&studies);
    let object = json!({ "case_studies": studies });
    save(&args.output, "case-studies.md", markdown.as_bytes())?;
    save(
        &args.output,
        "case-studies.json",
        object.to_string().as_bytes(),
    )?;
    match args.common.json {
        true => print_json(&object),
        false => talk::data(markdown.trim_end()),
    }
    Ok(Exit::Done)
}

fn save(dir: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    Ok(write_file(&dir.join(name), bytes)?)
}
