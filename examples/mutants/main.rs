//! How many changes of the library do its tests notice?
//!
//! `cargo run --release --example mutants -- --seed 14 --count 100 -o DIR`
//! lists all small changes ("mutants") of some modules, draws so many by the
//! seed, and compiles a copy of the crate once in which each is a switch of
//! the environment variable `BRAKECHECK_MUTANT`. Every mutant is then run
//! against the suites, the quickest first, up to the first test that fails.
//!
//! - The draw spreads over the files in proportion to their mutants. One that
//!   does not compile is left out, and the next of the draw takes its place.
//!   `--each` draws from every path of `--files` by itself.
//! - The suites run without a mutant first. All must pass; their times make
//!   the limits, and a suite that never meets the place of a mutant is not run
//!   for it: it could not fail.
//! - A suite that takes too long counts as a kill, and is listed as such.
//! - `DIR/results.jsonl` grows with every mutant, and an interrupted run goes
//!   on where it was; changed sources or suites begin anew. `DIR/mutants.json`
//!   and the printed Markdown table hold everything.
//!
//! The copy is compiled in `DIR/target`. To spare compiling the dependencies,
//! copy a release target there first: `cp -a target DIR/target`.

mod compile;
mod find;
mod play;
mod switch;

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{Error, Write};
use std::path::{Path, PathBuf};
use std::slice::from_ref;
use std::sync::Mutex;
use std::time::Instant;

use clap::Parser;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use compile::{Built, Drawn, Fallible, Workshop, digest};
use play::{Stage, Suite, Verdict};

/// The modules whose faults would not be seen by looking at a run.
const FILES: &str = "crates/scene/src/rulebook.rs,crates/scene/src/testbench,crates/rl/src/rl,crates/stats/src/stats/interval,\
    crates/experiment/src/adversary/rollout.rs,crates/experiment/src/search,crates/stl/src/online.rs,crates/stl/src/online";
const SUITES: &str = "lib,rows,learners,stl,grid,worlds,regressions";

/// How many changes of the library do its tests notice?
#[derive(Parser)]
struct Options {
    /// Of the draw
    #[arg(long, default_value_t = 14)]
    seed: u64,
    /// How many mutants are drawn
    #[arg(long, default_value_t = 100)]
    count: usize,
    /// Draw so many from each of the paths, instead of from all of them together
    #[arg(long)]
    each: bool,
    /// Directory for the copy, its target directory and the results
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Files or directories whose mutants are listed
    #[arg(long, value_delimiter = ',', default_value = FILES)]
    files: Vec<String>,
    /// Test targets, `lib` for all unit tests, or a package for its own. `TARGET:TEXT` has
    /// only the tests whose name contains the text; missing targets are told
    #[arg(long, value_delimiter = ',', default_value = SUITES)]
    suites: Vec<String>,
    /// Tests to leave out whose name contains this
    #[arg(long)]
    skip: Vec<String>,
    /// Run only these ids of the draw
    #[arg(long, value_delimiter = ',')]
    only: Vec<u32>,
    /// Mutants that run at once
    #[arg(long, default_value_t = 1)]
    jobs: usize,
    /// Print the draw and stop
    #[arg(long)]
    list: bool,
}

/// A line of `results.jsonl`.
#[derive(Serialize, Deserialize)]
struct Outcome {
    /// Names the sources, suites and skipped tests.
    state: String,
    drawn: Drawn,
    verdict: Verdict,
    seconds: f64,
}

fn main() -> Fallible<()> {
    let options = Options::parse();
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let paths = if options.each { options.files.len() } else { 1 };
    let count = options.count * paths;
    let draw = if options.each {
        let rooms = options
            .files
            .iter()
            .map(|room| Ok(draw(all_mutants(&root, from_ref(room))?, options.seed)));
        in_turn(rooms.collect::<Fallible<_>>()?)
    } else {
        draw(all_mutants(&root, &options.files)?, options.seed)
    };
    if options.list {
        let drawn = draw.iter().take(count);
        drawn.for_each(|it| println!("{}", row(it, "")));
        return Ok(());
    }
    fs::create_dir_all(&options.output)?;
    let output = options.output.canonicalize()?;
    if output.starts_with(&root) && !output.starts_with(root.join("target")) {
        return Err("the copy cannot be inside the crate, except in target".into());
    }
    let workshop = Workshop {
        copy: output.join("crate"),
        target: output.join("target"),
        root,
    };
    let started = Instant::now();
    let key = digest(&[serde_json::to_string(&draw)?]);
    let dropped = output.join(format!("dropped-{key}.json"));
    let built = workshop.build(&draw, count, &options.suites, &dropped)?;
    eprintln!("compiled in {:.0} s", started.elapsed().as_secs_f64());

    let stage = Stage {
        copy: workshop.copy,
        scratch: output.join("scratch"),
        skip: options.skip.clone(),
        only: only_of(&options.suites),
    };
    fs::create_dir_all(&stage.scratch)?;
    let names = built
        .programs
        .keys()
        .chain(&options.suites)
        .chain(&options.skip);
    let parts: Vec<&String> = [&built.fingerprint].into_iter().chain(names).collect();
    let state = digest(&parts);
    let suites = rehearsed(&stage, &built, &output.join(format!("suites-{state}.json")))?;
    let results = output.join("results.jsonl");
    let outcomes = judged(&options, &stage, &built, &suites, &state, &results)?;
    report(&options, &built, &suites, &outcomes, &output)
}

/// The texts of which a test's name has to contain one, by program.
fn only_of(suites: &[String]) -> BTreeMap<String, Vec<String>> {
    let mut only: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (program, text) in suites.iter().filter_map(|suite| suite.split_once(':')) {
        let name = program.replace('-', "_");
        only.entry(name).or_default().push(text.to_owned());
    }
    only
}

/// The mutants of every Rust file at or below these paths, by file.
fn all_mutants(root: &Path, paths: &[String]) -> Fallible<Vec<Vec<Drawn>>> {
    let files = compile::list(root)?;
    if let Some(path) = paths.iter().find(|path| !root.join(path).exists()) {
        return Err(format!("no {path}").into());
    }
    let asked = |file: &&PathBuf| paths.iter().any(|path| file.starts_with(path));
    let mut all = Vec::new();
    // Tests in a file of their own are not the library.
    let asked = |file: &&PathBuf| asked(file) && !file.ends_with("tests.rs");
    for path in files.iter().filter(asked) {
        let file = path.to_string_lossy();
        let mutants = find::mutants(&fs::read_to_string(root.join(path))?)?;
        eprintln!("{:5} {file}", mutants.len());
        let drawn = |mutant| Drawn {
            id: 0,
            file: file.to_string(),
            mutant,
        };
        all.push(mutants.into_iter().map(drawn).collect());
    }
    Ok(all)
}

/// All mutants in the order in which they are drawn.
///
/// The k-th of a file's n, shuffled, stands at (k + u) / n with one u in
/// [0, 1) per file; so any first part of the draw holds every file's share.
fn draw(files: Vec<Vec<Drawn>>, seed: u64) -> Vec<Drawn> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut placed: Vec<(f64, Drawn)> = Vec::new();
    for mut of_file in files {
        of_file.shuffle(&mut rng);
        let (n, u) = (of_file.len() as f64, rng.random::<f64>());
        let places = (0..).map(|k| (f64::from(k) + u) / n);
        placed.extend(places.zip(of_file));
    }
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let numbered = (1..).zip(placed);
    numbered.map(|(id, (_, it))| Drawn { id, ..it }).collect()
}

/// The first of every draw, then the second of every draw, and so on.
fn in_turn(draws: Vec<Vec<Drawn>>) -> Vec<Drawn> {
    let mut turns: Vec<(usize, Drawn)> = draws
        .into_iter()
        .flat_map(|draw| draw.into_iter().enumerate())
        .collect();
    // Stable, so the paths keep their order within a turn.
    turns.sort_by_key(|(turn, _)| *turn);
    let numbered = (1..).zip(turns);
    numbered.map(|(id, (_, it))| Drawn { id, ..it }).collect()
}

/// The suites, quickest first, as timed before if nothing has changed since.
fn rehearsed(stage: &Stage, built: &Built, kept: &Path) -> Fallible<Vec<Suite>> {
    if let Ok(text) = fs::read_to_string(kept) {
        return Ok(serde_json::from_str(&text)?);
    }
    let mut suites = Vec::new();
    for (name, program) in &built.programs {
        let suite = stage.rehearse(name, program)?;
        let met = suite.reached.len();
        eprintln!("{name}: {:.1} s, meets {met} mutants", suite.seconds);
        suites.push(suite);
    }
    suites.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    fs::write(kept, serde_json::to_string_pretty(&suites)?)?;
    Ok(suites)
}

/// The outcomes by id; those that are there already are not made again.
fn judged(
    options: &Options,
    stage: &Stage,
    built: &Built,
    suites: &[Suite],
    state: &str,
    results: &Path,
) -> Fallible<BTreeMap<u32, Outcome>> {
    let text = fs::read_to_string(results).unwrap_or_default();
    // A line that was cut off by an interruption is no outcome.
    let lines = text.lines().filter_map(|l| serde_json::from_str(l).ok());
    let known: BTreeMap<u32, Outcome> = lines
        .filter(|outcome: &Outcome| outcome.state == state)
        .map(|it| (it.drawn.id, it))
        .collect();
    let asked = |it: &&Drawn| options.only.is_empty() || options.only.contains(&it.id);
    let left: Vec<&Drawn> = built
        .mutants
        .iter()
        .filter(asked)
        .filter(|it| !known.contains_key(&it.id))
        .collect();
    let mut file = OpenOptions::new().create(true).append(true).open(results)?;
    if !text.is_empty() && !text.ends_with('\n') {
        writeln!(file)?;
    }
    let queue = Mutex::new(left.into_iter());
    let written = Mutex::new((file, known));
    let work = || -> Result<(), Error> {
        loop {
            let next = queue.lock().map_or(None, |mut queue| queue.next());
            let Some(drawn) = next.cloned() else {
                return Ok(());
            };
            let started = Instant::now();
            let outcome = Outcome {
                state: state.to_string(),
                verdict: stage.judge(drawn.id, suites)?,
                drawn,
                seconds: started.elapsed().as_secs_f64(),
            };
            let line = serde_json::to_string(&outcome)? + "\n";
            eprintln!("{:>6.1} s  {}", outcome.seconds, told(&outcome));
            if let Ok(mut written) = written.lock() {
                written.0.write_all(line.as_bytes())?;
                written.1.insert(outcome.drawn.id, outcome);
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..options.jobs.max(1))
            .map(|_| scope.spawn(work))
            .collect();
        let panicked = |_| Err(Error::other("a panic"));
        let mut ends = workers
            .into_iter()
            .map(|it| it.join().unwrap_or_else(panicked));
        ends.try_for_each(|end| end)
    })?;
    Ok(written.into_inner().map_err(|_| "a panic")?.1)
}

fn report(
    options: &Options,
    built: &Built,
    suites: &[Suite],
    outcomes: &BTreeMap<u32, Outcome>,
    output: &Path,
) -> Fallible<()> {
    println!("| id | place | change | |\n| --- | --- | --- | --- |");
    outcomes.values().for_each(|it| println!("{}", told(it)));
    let survived = |it: &&Outcome| matches!(it.verdict, Verdict::Survived { .. });
    let run = outcomes.len();
    let killed = run - outcomes.values().filter(survived).count();
    for path in options.files.iter().filter(|_| options.each) {
        let of_path = || {
            outcomes
                .values()
                .filter(|it| it.drawn.file.starts_with(path))
        };
        let (all, left) = (of_path().count(), of_path().filter(survived).count());
        println!("{path}: {} of {all} killed", all - left);
    }
    println!(
        "\nSeed {}: {killed} of {run} killed ({:.0} %); {} drawn, {} more do not compile.",
        options.seed,
        100.0 * killed as f64 / run.max(1) as f64,
        built.mutants.len(),
        built.dropped.len(),
    );
    let all = serde_json::json!({
        "seed": options.seed,
        "count": options.count,
        "files": options.files,
        "skip": options.skip,
        "suites": suites,
        "did_not_compile": built.dropped,
        "killed": killed,
        "run": run,
        "mutants": outcomes.values().collect::<Vec<_>>(),
    });
    let text = serde_json::to_string_pretty(&all)?;
    Ok(fs::write(output.join("mutants.json"), text)?)
}

/// The line of an outcome in the table.
fn told(it: &Outcome) -> String {
    let verdict = match &it.verdict {
        Verdict::Killed { suite, test } => format!("{suite}: {test}"),
        Verdict::TimedOut { suite } => format!("{suite}: timed out"),
        Verdict::Survived { reached_by } => match reached_by.join(", ").as_str() {
            "" => "**survived**, not reached".to_string(),
            suites => format!("**survived** {suites}"),
        },
    };
    row(&it.drawn, &verdict)
}

fn row(it: &Drawn, verdict: &str) -> String {
    let change = it.mutant.change.replace('|', "\\|");
    let (id, file, place) = (it.id, &it.file, &it.mutant.place);
    format!("| {id} | {file}:{place} | `{change}` | {verdict} |")
}
