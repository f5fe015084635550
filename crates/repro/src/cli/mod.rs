//! The program `repro`: arguments in, tables and figures out.

mod case_studies;
mod crashes;
mod figures;
mod grids;
mod letter;
mod near;
mod paper;
mod reuse;
mod structures;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use brakecheck::cli::program::{self, CommandLine};
use brakecheck::cli::terminal::{self, Common, OutputArgs, start_count};
use brakecheck::cli::{Exit, Failure};
use clap::{Parser, ValueEnum};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use brakecheck::experiment::Watch;
use brakecheck::run_dir::{RunError, write_file};
use brakecheck::seed::{FIRST_SEALED, Seeds};
use brakecheck::world::Scenario;
use brakecheck_experiment::run_dir::cached_result::CachedResult;
use brakecheck_files::run_files::disk::make_dir;

/// Trainings per world, at most.
const MOST_SEEDS: u64 = 100;
/// Seeds are named in files: no more than nine digits.
const MOST_SEED: u64 = 999_999_999;

/// Where an example is and what it is about, after all options.
const EXAMPLE: &str = "Example:\n  cargo run --release -p brakecheck-repro -- case-studies --world acc -o reproduced\n\nDocuments: docs/background/results.md";

/// Make the paper's tables and figures again, from nothing.
#[derive(Parser, Debug)]
#[command(name = "repro", version, after_help = EXAMPLE)]
struct ReproduceArgs {
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
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    display: OutputArgs,
}

impl ReproduceArgs {
    /// The worlds asked for, by default those of a table.
    fn worlds_or<'a>(&self, usual: impl IntoIterator<Item = &'a str>) -> Vec<String> {
        if self.world.is_empty() {
            usual.into_iter().map(str::to_owned).collect()
        } else {
            self.world.clone()
        }
    }

    /// Returns true if a world of a table is asked for.
    fn wants(&self, world: &str) -> bool {
        self.world.is_empty() || self.world.iter().any(|name| name == world)
    }

    /// The trainings and test starts asked for, at most `most` trainings.
    fn seeds_within(&self, most: u64) -> Seeds {
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
    /// The paper's Figs. 2, 3 and 5, found by search in the shipped worlds.
    Figures,
    /// Everything, one after the other.
    All,
}

/// Runs the program on the process's arguments.
pub fn main() -> ExitCode {
    program::main::<ReproduceArgs>()
}

impl CommandLine for ReproduceArgs {
    fn common(&self) -> Common {
        self.common.clone()
    }

    fn output(&self) -> OutputArgs {
        self.display
    }

    fn saves_when_interrupted(&self) -> bool {
        true
    }

    fn carry_out(self) -> Result<Exit, Failure> {
        run(&self)
    }
}

fn run(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let mut results = serde_json::Map::new();
    for part in args.what.parts() {
        let Some(made) = part(args)? else {
            terminal::note("interrupted: what is finished is kept; run the same command to go on");
            return Ok(Exit::Interrupted);
        };
        // Saved before it is printed, so a broken pipe does not cost the part.
        made.save(&args.output)?;
        if !args.common.json {
            terminal::data(made.markdown.trim_end())?;
        }
        if let Value::Object(part) = made.json {
            results.extend(part);
        }
    }
    if args.common.json {
        terminal::json(&Value::Object(results).to_string())?;
    }
    Ok(Exit::Done)
}

impl What {
    fn parts(self) -> &'static [Part] {
        match self {
            What::Table1 => &[grids::run],
            What::CaseStudies => &[case_studies::run],
            What::PaperRows => &[paper::run],
            What::Letter => &[letter::run],
            What::Reuse => &[reuse::run],
            What::NearStarts => &[near::run],
            What::Crashes => &[crashes::run],
            What::Structures => &[structures::run],
            What::Figures => &[figures::run],
            What::All => &[
                grids::run,
                case_studies::run,
                paper::run,
                letter::run,
                reuse::run,
                near::run,
                crashes::run,
                structures::run,
                figures::run,
            ],
        }
    }
}

/// Function that makes a part of the tables, and returns `None` if interrupted.
type Part = fn(&ReproduceArgs) -> Result<Option<Made>, Failure>;

/// A finished table.
struct Made {
    /// Its files are called so.
    name: &'static str,
    markdown: String,
    /// JSON object, whose keys differ from those of other parts.
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

/// Makes a piece of a part, or reads the piece that an earlier command kept.
///
/// Returns `None` if interrupted.
fn once<T: Serialize + DeserializeOwned>(
    args: &ReproduceArgs,
    piece: &str,
    scenario: &Scenario,
    settings: Value,
    make: impl FnOnce(&Watch<'_>) -> Result<Option<T>, Failure>,
) -> Result<Option<T>, Failure> {
    let kept = CachedResult::new(&args.output.join("parts"), piece, scenario, settings);
    match kept.read() {
        Ok(None) => {}
        Ok(made) => return Ok(made),
        // A damaged piece is only lost time, unlike a damaged run.
        Err(error @ RunError::Damaged { .. }) => {
            terminal::note(&format!("{error}; it is made anew"))
        }
        Err(error) => return Err(error.into()),
    }
    let bar = terminal::bar(&args.common, piece);
    let made = make(&bar.watch())?;
    // An interrupted piece is not kept, because it would look finished.
    if let Some(made) = &made {
        kept.write(made)?;
    }
    Ok(made)
}

/// Returns the settings of a piece: its own and the seeds.
///
/// Pieces from before the choice of seeds have trainings from 1 on and test starts of
/// seed 0. Their settings do not contain the seeds.
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

/// Returns a table with a line above it that states its seeds.
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
        None => {
            let known: Vec<&str> = Scenario::shipped_names()
                .chain(Scenario::protocol_names())
                .collect();
            Err(Failure::input(
                format!("no shipped world is called `{name}`"),
                format!("known: {}", known.join(", ")),
            ))
        }
    }
}

fn save(dir: &Path, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    make_dir(dir)?;
    Ok(write_file(&dir.join(name), bytes)?)
}

#[cfg(test)]
mod tests {
    use clap::error::ErrorKind;

    use super::*;

    const RUN: &str = "cargo run --release -p brakecheck-repro -- ";

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    fn read(page: &Path) -> String {
        std::fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
    }

    /// The pages that may name a command of this program.
    fn pages() -> Vec<PathBuf> {
        let names = ["README.md", "ARCHITECTURE.md", "crates/repro/README.md"];
        let mut pages: Vec<PathBuf> = names.iter().map(|name| root().join(name)).collect();
        for directory in [
            "docs",
            "docs/guide",
            "docs/reference",
            "docs/background",
            "docs/readers",
        ] {
            let entries = std::fs::read_dir(root().join(directory)).expect("a directory");
            let files = entries.map(|entry| entry.expect("an entry").path());
            pages.extend(files.filter(|file| file.extension().is_some_and(|it| it == "md")));
        }
        pages
    }

    /// Commands in lines and spans of code, without the program and without remarks.
    fn commands(text: &str) -> Vec<&str> {
        let lines = text.split("```").skip(1).step_by(2).flat_map(str::lines);
        let outside = text.split("```").step_by(2);
        let spans = outside.flat_map(|part| part.split('`').skip(1).step_by(2));
        let named = lines.chain(spans).filter_map(|code| {
            let code = code.split('#').next()?.trim();
            code.strip_prefix(RUN).or(code.strip_prefix("repro "))
        });
        named.collect()
    }

    /// Whether the program takes a command.
    fn takes(command: &str) -> bool {
        let words = std::iter::once("repro").chain(command.split_whitespace());
        match ReproduceArgs::try_parse_from(words) {
            Ok(_) => true,
            Err(error) => error.kind() == ErrorKind::DisplayHelp,
        }
    }

    #[test]
    fn commands_on_pages_are_taken() {
        let mut seen = 0;
        for page in pages() {
            for command in commands(&read(&page)) {
                assert!(takes(command), "{}: {command}", page.display());
                seen += 1;
            }
        }
        assert!(seen > 30, "{seen} commands");
        let example = EXAMPLE.split(RUN).nth(1).and_then(|it| it.lines().next());
        assert!(example.is_some_and(takes), "{EXAMPLE}");
    }

    #[test]
    fn a_command_of_nothing_is_seen() {
        let page =
            format!("`{RUN}table2` or `repro letter --sees 1`\n```sh\n{RUN}structures # all\n```");
        let found = commands(&page);
        assert_eq!(found, ["structures", "table2", "letter --sees 1"]);
        let taken = found.iter().map(|command| takes(command));
        assert_eq!(taken.collect::<Vec<bool>>(), [true, false, false]);
    }

    #[test]
    fn every_table_and_figure_has_its_command_in_the_readme() {
        let readme = read(&root().join("crates/repro/README.md"));
        let commands = commands(&readme);
        for what in What::value_variants() {
            let value = what.to_possible_value().expect("a name");
            assert!(commands.contains(&value.get_name()), "{}", value.get_name());
        }
    }
}
