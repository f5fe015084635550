//! `brakecheck reproduce`: the tables of the README, from nothing.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Common, Exit, Failure, print_json, talk};
use crate::campaign::{
    CaseStudies, Table1, Watch, case_studies_markdown, case_study, table1, table1_markdown,
};
use crate::run::{RunError, write_file};
use crate::scenario::Scenario;

/// The grid worlds of Table I, the headline first.
const GRID_WORLDS: [&str; 2] = ["grid_hard", "grid"];

/// First training seed of Table I: lower ones were used while it was designed.
const FIRST_GRID_SEED: u64 = 10;

/// The driving worlds of the table, in its order.
const DRIVING_WORLDS: [&str; 9] = [
    "acc",
    "merge_fair",
    "merge",
    "yellow_light",
    "yellow_light_fixed",
    "pedestrian",
    "cut_in",
    "sandwich",
    "light_ado",
];

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
    /// Only this driving world, by name; repeat for several.
    #[arg(long, value_name = "NAME")]
    world: Vec<String>,
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
    /// The paper's Table I: RQ1 to RQ5 on both readings of the grid world.
    Table1,
    /// The driving worlds: five seeds each, beside baselines and search.
    CaseStudies,
}

pub(super) fn run(args: &ReproduceArgs) -> Result<Exit, Failure> {
    match args.what {
        What::Table1 => grids(args),
        What::CaseStudies => case_studies(args),
    }
}

fn grids(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let request = Table1 {
        seeds: args.seeds,
        first_seed: FIRST_GRID_SEED + args.common.seed,
    };
    let mut studies = Vec::new();
    for name in GRID_WORLDS {
        let scenario = Scenario::load(&args.worlds.join(format!("{name}.ron")))?;
        let bar = talk::bar(&format!("{name} (decisions)"), 0);
        let watch = Watch {
            progress: &|done, total| {
                bar.set_length(total);
                bar.set_position(done);
            },
            stop: talk::stop(),
        };
        let study = table1(&scenario, &request, &watch)?;
        bar.finish_and_clear();
        let Some(study) = study else {
            talk::say("interrupted: nothing is written");
            return Ok(Exit::Interrupted);
        };
        studies.push(study);
    }
    let markdown = table1_markdown(&studies);
    let object = json!({ "table1": studies });
    save(&args.output, "table1.md", markdown.as_bytes())?;
    save(&args.output, "table1.json", object.to_string().as_bytes())?;
    match args.common.json {
        true => print_json(&object),
        false => talk::data(markdown.trim_end()),
    }?;
    Ok(Exit::Done)
}

fn case_studies(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let request = CaseStudies {
        seeds: args.seeds,
        starts: args.starts,
        runs: &args.output.join("runs"),
    };
    let mut studies = Vec::new();
    let all = DRIVING_WORLDS.map(str::to_owned).to_vec();
    let names = match args.world.is_empty() {
        true => all,
        false => args.world.clone(),
    };
    for name in &names {
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
    }?;
    Ok(Exit::Done)
}

fn save(dir: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::create_dir_all(dir).map_err(|source| RunError::Io {
        verb: "creating",
        path: dir.into(),
        source,
    })?;
    Ok(write_file(&dir.join(name), bytes)?)
}
