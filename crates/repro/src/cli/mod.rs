//! The program `repro`: arguments in, tables and figures out.

mod case_studies;
mod crashes;
mod figures;
mod grids;
mod letter;
mod named;
mod near;
mod pages;
mod paper;
mod reuse;
mod structures;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use brakecheck::cli::program::{self, CommandLine};
use brakecheck::cli::terminal::{self, Common, OutputArgs, start_count};
use brakecheck::cli::{Exit, Failure};
use clap::{Parser, ValueEnum};
use cpu_time::ProcessTime;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::record::NewRow;
use crate::record::probe::{DigestProbe, digests};
use brakecheck::experiment::Watch;
use brakecheck::run_dir::{RunError, write_file};
use brakecheck::seed::Seeds;
use brakecheck::world::Scenario;
use brakecheck_experiment::run_dir::cached_result::CachedResult;
use brakecheck_files::run_files::disk::make_dir;
use named::{know_worlds, world};

/// First training and stream of test starts of the recorded rows.
///
/// No version had looked at them before. docs/background/intervals.md lists those that were
/// looked at.
const FIRST_REPORTED: u64 = 1000;
/// Trainings per world, at most.
const MOST_SEEDS: u64 = 100;
/// Seeds are named in files: no more than nine digits.
const MOST_SEED: u64 = 999_999_999;

/// Studies in the order of `all`, with the sizes that take one to two hours of processor
/// time together.
const STUDIES: [StudyPlan; 9] = [
    StudyPlan::new(What::CaseStudies, "case-studies", 3, 200, case_studies::run),
    StudyPlan::new(What::Crashes, "crashes", 2, 100, crashes::run),
    StudyPlan::new(What::NearStarts, "near-starts", 1, 200, near::run),
    StudyPlan::new(What::Table1, "table1", 3, 0, grids::run),
    StudyPlan::new(What::PaperRows, "paper-rows", 2, 200, paper::run),
    StudyPlan::new(What::Letter, "letter", 3, 100, letter::run),
    StudyPlan::new(What::Reuse, "reuse", 1, 60, reuse::run),
    StudyPlan::new(What::Structures, "structures", 1, 30, structures::run),
    StudyPlan::new(What::Figures, "figures", 1, 0, figures::run),
];

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
    /// Record the rows in `results/`, and write the pages again (`all` does).
    #[arg(long, conflicts_with = "worlds")]
    record: bool,
    /// With `page`: write nothing, and fail if a page or a row is of an earlier version.
    #[arg(long)]
    check: bool,
    /// The copy of the repository that has `results/` and the pages.
    #[arg(long, value_name = "DIR", default_value = ".")]
    root: PathBuf,
    /// Take the worlds from this directory instead of those that are built in.
    #[arg(long, value_name = "DIR")]
    worlds: Option<PathBuf>,
    /// Only this driving world, by name; repeat for several.
    #[arg(long, value_name = "NAME")]
    world: Vec<String>,
    /// Training seeds per world, by default as many as the page has.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: Option<u64>,
    /// First training seed. Seeds from 100 on were not tuned on.
    #[arg(long, value_name = "N", default_value_t = FIRST_REPORTED, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    first_seed: u64,
    /// Seed of the test starts. Seeds from 100 on were not tuned on.
    #[arg(long, value_name = "N", default_value_t = FIRST_REPORTED, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    start_seed: u64,
    /// Test starts per world, by default as many as the page has.
    #[arg(long, value_name = "N", value_parser = start_count())]
    starts: Option<usize>,
    /// With `letter`: every step to the defaults, not only the letter and its end.
    #[arg(long)]
    every_step: bool,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    display: OutputArgs,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    /// The paper's Table I: RQ1 to RQ5 on both readings of the grid world.
    Table1,
    /// The driving worlds: several trainings each, beside baselines and search.
    CaseStudies,
    /// The paper's own rows of those: the Q-table, and success by episodes.
    PaperRows,
    /// The paper's learning to the letter, beside the defaults (kinematic plant).
    Letter,
    /// One trained ado on changed egos, beside honest baselines.
    Reuse,
    /// Starts near the paper's failing ones: do they fail too?
    NearStarts,
    /// Crashes that reference drivers avoid: what each ado finds.
    Crashes,
    /// Controllers of structures that no ado met in training, each learned from 100 runs of it.
    Structures,
    /// The paper's Figs. 2, 3 and 5, found by search in the shipped worlds.
    Figures,
    /// Everything, one after the other, recorded in `results/` and on the pages.
    All,
    /// The pages again, from the recorded rows, without running anything.
    Page,
}

/// Study with its sizes, which options replace.
#[derive(Clone, Copy)]
struct StudyPlan {
    what: What,
    /// Its files are called so.
    name: &'static str,
    trainings: u64,
    starts: usize,
    run: Part,
}

/// Function that makes a part of the tables, and returns `None` if interrupted.
type Part = fn(&StudyRun<'_>) -> Result<Option<Made>, Failure>;

impl StudyPlan {
    const fn new(
        what: What,
        name: &'static str,
        trainings: u64,
        starts: usize,
        run: Part,
    ) -> StudyPlan {
        StudyPlan {
            what,
            name,
            trainings,
            starts,
            run,
        }
    }
}

/// Study as the command line requests it.
struct StudyRun<'a> {
    args: &'a ReproduceArgs,
    study: StudyPlan,
}

impl StudyRun<'_> {
    /// The worlds asked for, by default those of a table.
    fn worlds_or<'a>(&self, usual: impl IntoIterator<Item = &'a str>) -> Vec<String> {
        if self.args.world.is_empty() {
            usual.into_iter().map(str::to_owned).collect()
        } else {
            self.args.world.clone()
        }
    }

    /// Returns true if a world of a table is asked for.
    fn wants(&self, world: &str) -> bool {
        self.args.world.is_empty() || self.args.world.iter().any(|name| name == world)
    }

    /// The trainings and test starts.
    fn seeds(&self) -> Seeds {
        Seeds {
            first: self.args.first_seed,
            count: self.args.seeds.unwrap_or(self.study.trainings),
            starts: self.args.start_seed,
        }
    }

    /// The number of test starts.
    fn starts(&self) -> usize {
        self.args.starts.unwrap_or(self.study.starts)
    }

    /// Directory of all run directories.
    fn runs(&self) -> PathBuf {
        self.args.output.join("runs")
    }

    /// Returns the settings of a piece: its own and the seeds.
    fn settings(&self, mut own: Value) -> Value {
        // Seeds decide trainings and starts, so pieces of other seeds answer other
        // questions.
        let seeds = self.seeds();
        own["seeds"] = seeds.count.into();
        own["first_seed"] = seeds.first.into();
        own["start_seed"] = seeds.starts.into();
        own
    }

    /// Makes a piece of a part, or reads the piece that an earlier command kept.
    ///
    /// A piece is kept for the same settings, and as long as its probes give the same
    /// digests. Returns `None` if interrupted.
    fn once<T: Serialize + DeserializeOwned>(
        &self,
        piece: &str,
        scenario: &Scenario,
        depends: &BTreeSet<DigestProbe>,
        mut settings: Value,
        make: impl FnOnce(&Watch<'_>) -> Result<Option<T>, Failure>,
    ) -> Result<Option<StudyPiece<T>>, Failure> {
        // A piece of an earlier state of the program is no answer for this one.
        settings["digests"] = json!(digests(depends));
        let parts = self.args.output.join("parts");
        let kept = CachedResult::new(&parts, piece, scenario, settings);
        match kept.read() {
            Ok(None) => {}
            Ok(made) => return Ok(made),
            // A damaged piece is only lost time, unlike a damaged run.
            Err(error @ RunError::Damaged { .. }) => {
                terminal::note(&format!("{error}; it is made anew"))
            }
            Err(error) => return Err(error.into()),
        }
        // Only here, because a kept piece has nothing to show on a bar.
        let bar = terminal::bar(&self.args.common, piece);
        // A piece works on several threads, so the time is that of the process.
        let clock = ProcessTime::now();
        let made = make(&bar.watch())?.map(|made| StudyPiece {
            cpu_s: clock.elapsed().as_secs_f64(),
            made,
        });
        // An interrupted piece is not kept, because it would look finished.
        if let Some(made) = &made {
            kept.write(made)?;
        }
        Ok(made)
    }

    /// Returns the recorded form of a row.
    ///
    /// `only` are the options that select it.
    fn row(
        &self,
        name: &str,
        only: &str,
        depends: BTreeSet<DigestProbe>,
        cpu_s: f64,
        data: &impl Serialize,
    ) -> NewRow {
        let seeds = self.seeds();
        let mut command = format!(
            "{}{only} --seeds {} --first-seed {}",
            self.study.name, seeds.count, seeds.first
        );
        // Table I plays all starts of its grid, and the figures choose theirs.
        if self.starts() > 0 {
            command.push_str(&format!(
                " --starts {} --start-seed {}",
                self.starts(),
                seeds.starts
            ));
        }
        NewRow {
            name: name.to_owned(),
            command,
            // Pages have no semicolons.
            seeds: seeds.to_string().replace(';', ","),
            depends,
            cpu_s: Some(cpu_s),
            data: json!(data),
        }
    }

    /// A shipped world, or one of that name in the directory that was named.
    fn world(&self, name: &str) -> Result<Scenario, Failure> {
        world(self.args, name)
    }
}

/// Kept piece of a part.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct StudyPiece<T> {
    /// Processor time that it took, s.
    cpu_s: f64,
    made: T,
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
    // Pages are made from recorded rows alone, without a world or a training.
    if args.what == What::Page {
        return pages::write(args);
    }
    know_worlds(args)?;
    let records = args.record || args.what == What::All;
    if records {
        // Before hours of work, of which nothing could be recorded.
        pages::require_root(args)?;
    }
    let mut results = serde_json::Map::new();
    for study in STUDIES {
        if args.what != What::All && args.what != study.what {
            continue;
        }
        let Some(made) = (study.run)(&StudyRun { args, study })? else {
            terminal::note("interrupted: what is finished is kept; run the same command to go on");
            return Ok(Exit::Interrupted);
        };
        // Saved before it is printed, so a broken pipe does not cost the part.
        made.save(&args.output, study.name)?;
        if records {
            pages::record(args, study.name, made.rows)?;
        }
        // JSON is a single document, which is printed after the last study.
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
    // Once and at the end, because a page has rows of all studies.
    if records {
        pages::write(args)
    } else {
        Ok(Exit::Done)
    }
}

/// A finished table.
struct Made {
    /// Rows to be recorded.
    rows: Vec<NewRow>,
    markdown: String,
    /// JSON object, whose keys differ from those of other parts.
    json: Value,
}

impl Made {
    /// Writes the table, for people and for programs.
    fn save(&self, dir: &Path, name: &str) -> Result<(), Failure> {
        save(dir, &format!("{name}.md"), self.markdown.as_bytes())?;
        save(
            dir,
            &format!("{name}.json"),
            self.json.to_string().as_bytes(),
        )
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
        assert!(seen > 15, "{seen} commands");
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
