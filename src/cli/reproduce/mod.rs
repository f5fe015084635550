//! `brakecheck reproduce`: the tables and figures, from nothing.

mod crashes;
mod driving;
mod figures;
mod fitted;
mod grids;
mod letter;
mod near;
mod paper;
mod protocols;
mod reuse;
mod structures;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::number_args::start_count;
use super::{Common, Exit, Failure, print_json, progress, talk};
use crate::experiment::Watch;
use crate::run_dir::{CachedResult, RunError, make_dir, write_file};
use crate::seed::{FIRST_SEALED, Seeds};
use crate::world::{Scenario, known_names};

/// Trainings per world, at most.
const MOST_SEEDS: u64 = 100;
/// Seeds are named in files: no more than nine digits.
const MOST_SEED: u64 = 999_999_999;

#[derive(Args, Debug)]
pub(super) struct ReproduceArgs {
    /// Which tables.
    #[arg(value_enum)]
    what: What,
    /// Where tables, run directories and finished pieces go.
    #[arg(short, long, value_name = "DIR", default_value = "reproduced")]
    output: PathBuf,
    /// Take the worlds from this directory instead of those that are built in.
    #[arg(long, value_name = "DIR")]
    worlds: Option<PathBuf>,
    /// Only this driving world, by name; repeat for several.
    #[arg(long, value_name = "NAME")]
    world: Vec<String>,
    /// Only this ego, of `ncap` and `r157`: a name under their `reuse`, or a RON file with a
    /// `Change`; repeat for several.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Vec<String>,
    /// Training seeds per world.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: u64,
    /// The first of them; from 100 on they are sealed: no setting was chosen by them.
    #[arg(long, value_name = "N", default_value_t = FIRST_SEALED, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    first_seed: u64,
    /// Seed of the test starts; sealed from 100 on, too.
    #[arg(long, value_name = "N", default_value_t = FIRST_SEALED, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    start_seed: u64,
    /// Test starts per world, by default as many as the published tables have.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = start_count())]
    starts: usize,
    /// Refused, with what to use instead.
    #[arg(long, hide = true, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    pub(super) common: Common,
}

impl ReproduceArgs {
    /// The trainings and test starts asked for, at most `most` trainings.
    fn asked_seeds(&self, most: u64) -> Seeds {
        Seeds {
            first: self.first_seed,
            count: self.seeds.min(most),
            starts: self.start_seed,
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// The paper's Table I: RQ1 to RQ5 on both readings of the grid world.
    Table1,
    /// The driving worlds: five seeds each, beside baselines and search.
    CaseStudies,
    /// The paper's own rows of those: learners, episodes, the plain reward.
    PaperRows,
    /// The paper's learning to the letter, and from it to the defaults, one change at a time
    /// (kinematic plant).
    Letter,
    /// One trained ado on changed egos, beside honest baselines.
    Reuse,
    /// Starts near the paper's failing ones: do they fail too?
    NearStarts,
    /// Crashes that reference drivers avoid: what each ado finds.
    Crashes,
    /// Controllers of structures that no ado met in training, each learned from 100 runs of it
    /// (at most 2 trainings and 100 starts).
    Structures,
    /// Euro NCAP's frontal collisions of 2026: points each ego passes, and lawful variations of
    /// them that make it fail.
    Ncap,
    /// The same of UN R157's scenarios for lane keeping systems.
    R157,
    /// The paper's Figs. 2, 3 and 5, found by search in the shipped worlds.
    Figures,
    /// Everything, one after the other.
    All,
}

pub(super) fn run(args: &ReproduceArgs) -> Result<Exit, Failure> {
    if args.seed.is_some() {
        return Err(Failure::input(
            "`reproduce` has trainings and test starts, so `--seed` does not say whose",
            "use `--first-seed` or `--start-seed`",
        ));
    }
    if !args.ego.is_empty() && ![What::Ncap, What::R157].contains(&args.what) {
        return Err(Failure::input(
            "`--ego` is of the tables of test protocols",
            "ask for `reproduce ncap` or `reproduce r157`, or leave it out",
        ));
    }
    let mut results = serde_json::Map::new();
    for part in args.what.parts() {
        let Some(made) = part(args)? else {
            talk::say("interrupted: what is finished is kept; run the same command to go on");
            return Ok(Exit::Interrupted);
        };
        made.save(&args.output)?;
        if !args.common.json {
            talk::data(&fitted::fitted(&made.markdown))?;
        }
        if let Value::Object(part) = made.json {
            results.extend(part);
        }
    }
    if args.common.json {
        print_json(&Value::Object(results))?;
    }
    Ok(Exit::Done)
}

impl What {
    fn parts(self) -> &'static [Part] {
        match self {
            What::Table1 => &[grids::run],
            What::CaseStudies => &[driving::run],
            What::PaperRows => &[paper::run],
            What::Letter => &[letter::run],
            What::Reuse => &[reuse::run],
            What::NearStarts => &[near::run],
            What::Crashes => &[crashes::run],
            What::Structures => &[structures::run],
            What::Ncap => &[protocols::ncap],
            What::R157 => &[protocols::r157],
            What::Figures => &[figures::run],
            What::All => &[
                grids::run,
                driving::run,
                paper::run,
                letter::run,
                reuse::run,
                near::run,
                crashes::run,
                structures::run,
                protocols::ncap,
                protocols::r157,
                figures::run,
            ],
        }
    }
}

/// One part of the tables; `None`: interrupted.
type Part = fn(&ReproduceArgs) -> Result<Option<Made>, Failure>;

/// A finished table.
struct Made {
    /// Its files are called so.
    name: &'static str,
    markdown: String,
    /// An object; its keys differ from those of every other part.
    json: Value,
}

impl Made {
    /// Writes the table, for people and for programs.
    fn save(&self, dir: &Path) -> Result<(), Failure> {
        save(dir, &format!("{}.md", self.name), self.markdown.as_bytes())?;
        let json = self.json.to_string();
        save(dir, &format!("{}.json", self.name), json.as_bytes())
    }
}

/// Makes a piece of a part, or takes what an earlier command kept of it.
///
/// `None`: interrupted.
fn once<T: Serialize + DeserializeOwned>(
    args: &ReproduceArgs,
    (piece, scenario): (&str, &Scenario),
    settings: Value,
    make: impl FnOnce(&Watch<'_>) -> Result<Option<T>, Failure>,
) -> Result<Option<T>, Failure> {
    let kept = CachedResult::new(&args.output.join("parts"), piece, scenario, settings);
    match kept.read() {
        Ok(None) => {}
        Ok(made) => return Ok(made),
        Err(error @ RunError::Damaged { .. }) => talk::say(&format!("{error}; it is made anew")),
        Err(error) => return Err(error.into()),
    }
    let bar = progress::bar(piece);
    let made = make(&bar.watch())?;
    if let Some(made) = &made {
        kept.write(made)?;
    }
    Ok(made)
}

/// What a piece was asked for: its own settings and the seeds.
///
/// Pieces that are older than the choice of seeds are of trainings from 1 on and
/// of test starts of seed 0, and do not say so.
fn settings(seeds: Seeds, mut own: Value) -> Value {
    own["seeds"] = seeds.count.into();
    if seeds.first != 1 {
        own["first_seed"] = seeds.first.into();
    }
    if seeds.starts != 0 {
        own["start_seed"] = seeds.starts.into();
    }
    own
}

/// Which seeds a table is of, in a line above it.
fn headed(seeds: Seeds, table: &str) -> String {
    format!("With {seeds}.\n\n{table}")
}

/// A shipped world, or one of that name in the directory that was named.
fn world(args: &ReproduceArgs, name: &str) -> Result<Scenario, Failure> {
    if let Some(dir) = &args.worlds {
        return Ok(Scenario::load(&dir.join(format!("{name}.ron")))?);
    }
    match Scenario::shipped(name) {
        Some(world) => Ok(world?),
        None => Err(Failure::input(
            format!("no shipped world is called `{name}`"),
            known_names(
                "known",
                Scenario::shipped_names().chain(Scenario::protocol_names()),
            ),
        )),
    }
}

fn save(dir: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    make_dir(dir)?;
    Ok(write_file(&dir.join(name), bytes)?)
}
