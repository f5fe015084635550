//! The command line: arguments in, rows and files out; no logic of its own.
//!
//! stdout is data, stderr is talk and progress bars. Exit codes: [`Exit`].

mod check;
mod crashes;
mod eval;
mod failure;
mod identify;
mod keeping;
mod kept;
mod report;
mod reproduce;
mod rivals;
mod search;
mod stl;
mod table;
mod talk;
mod theorems;
mod told;
mod train;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use miette::GraphicalTheme;
use serde_json::json;

pub use failure::{Exit, Failure, Note};

use crate::campaign::{TestStarts, Watch, answers_differ};
use crate::ego::Process;
use crate::run::{RunDir, RunError};
use crate::scenario::{Change, Scenario};
use crate::sim::PlantKind;

/// Can a car that keeps every rule still make yours crash?
#[derive(Parser, Debug)]
#[command(name = "brakecheck", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

/// What every verb takes.
#[derive(Args, Clone, Debug)]
struct Common {
    /// Print one JSON object on stdout instead of tables.
    #[arg(long, global = true)]
    json: bool,
    /// Seed of the training, or of the test starts.
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Threads to use; rows do not depend on it [default: one per core].
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Start the programs that worlds, changes and kept files name as egos.
    #[arg(long, global = true)]
    allow_programs: bool,
    /// Largest share of invalid episodes in a row that is no fault, 0 to 1.
    #[arg(long, global = true, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    allow_invalid: f64,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number from 0 to 1, such as 0.05".to_owned()),
    }
}

#[derive(Subcommand, Debug)]
enum Verb {
    /// Validate a world; list its signals, rules, actions, egos and starts.
    Check(check::CheckArgs),
    /// Train an ado in a world and keep it in a run directory.
    Train(train::TrainArgs),
    /// Measure a trained ado and baselines on test starts and egos.
    Eval(eval::EvalArgs),
    /// Search action sequences per start: what an adversary can do at all.
    Search(search::SearchArgs),
    /// Fit a family's parameters to an ego seen only from outside.
    Identify(identify::IdentifyArgs),
    /// Play kept counterexamples again, bit for bit or against a changed ego.
    Replay(kept::ReplayArgs),
    /// Measure a formula of Signal Temporal Logic on a trace in CSV.
    Stl(stl::StlArgs),
    /// Write one page, and JUnit XML, about a run.
    Report(report::ReportArgs),
    /// Make the tables and figures again, from nothing.
    Reproduce(reproduce::ReproduceArgs),
    /// Write an episode as a recording for the rerun viewer.
    #[cfg(feature = "rerun")]
    View(kept::ViewArgs),
}

impl Verb {
    fn common(&self) -> &Common {
        match self {
            Verb::Check(args) => &args.common,
            Verb::Train(args) => &args.common,
            Verb::Eval(args) => &args.common,
            Verb::Search(args) => &args.common,
            Verb::Identify(args) => &args.common,
            Verb::Replay(args) => &args.common,
            Verb::Stl(args) => &args.common,
            Verb::Report(args) => &args.common,
            Verb::Reproduce(args) => &args.common,
            #[cfg(feature = "rerun")]
            Verb::View(args) => &args.common,
        }
    }

    /// Whether Ctrl-C asks it to stop and keep what it has; others just end.
    fn saves_when_interrupted(&self) -> bool {
        matches!(
            self,
            Verb::Train(_)
                | Verb::Eval(_)
                | Verb::Search(_)
                | Verb::Identify(_)
                | Verb::Report(_)
                | Verb::Reproduce(_)
        )
    }
}

/// A plant, as named on the command line.
#[derive(ValueEnum, Clone, Copy, Debug)]
enum PlantArg {
    /// 3D rigid bodies on rapier3d.
    Rigid,
    /// 2D, closed form.
    Kinematic,
}

impl From<PlantArg> for PlantKind {
    fn from(plant: PlantArg) -> PlantKind {
        match plant {
            PlantArg::Rigid => PlantKind::Rigid,
            PlantArg::Kinematic => PlantKind::Kinematic,
        }
    }
}

/// The same driving world on the plant asked for.
fn on_plant(scenario: &Scenario, plant: PlantArg) -> Result<Scenario, Failure> {
    match scenario.drive() {
        Some(_) => Ok(scenario.on(plant.into())),
        None => Err(Failure::input(
            format!("`{}` runs on no plant", scenario.name),
            "leave out `--plant`: it is for driving worlds",
        )),
    }
}

/// Runs the program on the process's arguments.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    if cli.verb.saves_when_interrupted() {
        talk::listen_for_interrupts();
    }
    talk::allow_faults(cli.verb.common().allow_invalid);
    let result = carry_out(cli.verb);
    let exit = result.and_then(settled).unwrap_or_else(|failure| {
        talk::say(failure.render(talk::theme(), talk::width()).trim_end());
        failure.exit
    });
    ExitCode::from(exit as u8)
}

fn carry_out(verb: Verb) -> Result<Exit, Failure> {
    let common = verb.common().clone();
    with_jobs(&common, move || match verb {
        Verb::Check(args) => check::run(&args),
        Verb::Train(args) => train::run(&args),
        Verb::Eval(args) => eval::run(&args),
        Verb::Search(args) => search::run(&args),
        Verb::Identify(args) => identify::run(&args),
        Verb::Replay(args) => kept::replay(&args),
        Verb::Stl(args) => stl::run(&args),
        Verb::Report(args) => report::run(&args),
        Verb::Reproduce(args) => reproduce::run(&args),
        #[cfg(feature = "rerun")]
        Verb::View(args) => kept::view(&args),
    })
}

/// What a verb came to, once its faults are looked at: where more episodes are
/// invalid than allowed, nothing it printed is a verdict on the ego.
fn settled(exit: Exit) -> Result<Exit, Failure> {
    match talk::faults().complaint() {
        Some(complaint) if !talk::stopped() => Err(complaint.into()),
        _ => Ok(exit),
    }
}

/// Says of an ego that does not answer twice alike what to do about it.
fn say_if_moody(ego: &NamedEgo, starts: &TestStarts, watch: &Watch<'_>) {
    if 1 < ego.scenario.repeats.runs || watch.stopped() {
        return;
    }
    if let Some(at_s) = answers_differ(&ego.scenario, starts, watch) {
        talk::say(&format!(
            "`{}` does not answer twice alike: with the same seed its commands differ from \
             {at_s:.2} s on; give the world `repeats: 5`",
            ego.name
        ));
    }
}

/// Opens a run, with the consent that was typed.
fn open_run(path: &Path, common: &Common) -> Result<RunDir, RunError> {
    let mut run = RunDir::open(path)?;
    if !run.manifest().is_sealed() {
        talk::say(&format!(
            "`{}` is of an earlier version, whose manifests hold no hash: a changed number in it \
             would go unnoticed",
            path.display()
        ));
    }
    run.allow_programs(common.allow_programs);
    Ok(run)
}

/// Reads a world, with the consent that was typed.
fn load_world(path: &Path, common: &Common) -> Result<Scenario, Failure> {
    Ok(Scenario::load(path)?.allow_programs(common.allow_programs))
}

/// Every world that evaluating egos plays: the world's own, for the trivial
/// starts, and theirs.
fn all_played<'a>(
    world: &'a Scenario,
    egos: &'a [NamedEgo],
) -> impl Iterator<Item = (&'a str, &'a Scenario)> {
    let own = std::iter::once(("nominal", world));
    own.chain(egos.iter().map(|ego| (ego.name.as_str(), &ego.scenario)))
}

/// Asks for consent before a program that a file names is started.
fn consent<'a>(egos: impl IntoIterator<Item = (&'a str, &'a Scenario)>) -> Result<(), Failure> {
    let programs = egos
        .into_iter()
        .filter_map(|(name, scenario)| Some((name, scenario.program()?)));
    let named = programs
        .into_iter()
        .find(|(_, program)| !program.is_allowed());
    match named {
        Some((name, program)) => Err(failure::not_allowed(
            &format!("the ego `{name}`"),
            &program.command,
        )),
        None => Ok(()),
    }
}

fn with_jobs<F>(common: &Common, verb: F) -> Result<Exit, Failure>
where
    F: FnOnce() -> Result<Exit, Failure> + Send,
{
    let jobs = usize::from(common.jobs.unwrap_or(0));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
    let pool = pool.map_err(|error| Failure::fault(error.to_string(), None))?;
    pool.install(verb)
}

/// An ego as named on the command line, and how it differs from the world's.
#[derive(Clone)]
struct NamedEgo {
    name: String,
    change: Change,
    scenario: Scenario,
}

impl NamedEgo {
    /// The world's own.
    fn nominal(scenario: &Scenario) -> NamedEgo {
        NamedEgo {
            name: "nominal".to_owned(),
            change: Change::default(),
            scenario: scenario.clone(),
        }
    }
}

/// The egos that a verb was asked for: by name, or a program typed after `--`.
fn egos_or_program(
    scenario: &Scenario,
    asked: &str,
    program: &[String],
) -> Result<Vec<NamedEgo>, Failure> {
    if program.is_empty() {
        return egos(scenario, asked);
    }
    if asked != "nominal" {
        return Err(Failure::input(
            "`--ego` names one ego, and the program after `--` is another",
            "leave out one of the two",
        ));
    }
    let change = Change {
        controller: Some(Process::new(program).into()),
        ..Change::default()
    };
    let changed = scenario.with(&change).map_err(|error| {
        Failure::input(
            error.to_string(),
            "a program drives the ego of a driving world",
        )
    })?;
    Ok(vec![NamedEgo {
        name: program.join(" "),
        change,
        // Whoever types a program means it to be started.
        scenario: changed.allow_programs(true),
    }])
}

/// Resolves `--ego NAME|FILE.ron|all` against a world.
fn egos(scenario: &Scenario, asked: &str) -> Result<Vec<NamedEgo>, Failure> {
    let reused = |name: &String, change: &Change| -> Result<NamedEgo, Failure> {
        let changed = scenario
            .with(change)
            .map_err(|error| Failure::input(error.to_string(), "mend the world's `reuse`"))?;
        Ok(NamedEgo {
            name: name.clone(),
            change: change.clone(),
            scenario: changed,
        })
    };
    if asked == "nominal" {
        return Ok(vec![NamedEgo::nominal(scenario)]);
    }
    if asked == "all" {
        let mut all = vec![NamedEgo::nominal(scenario)];
        for (name, change) in &scenario.reuse {
            all.push(reused(name, change)?);
        }
        return Ok(all);
    }
    if let Some((name, change)) = scenario.reuse.get_key_value(asked) {
        return Ok(vec![reused(name, change)?]);
    }
    let path = PathBuf::from(asked);
    if path.extension().is_some_and(|extension| extension == "ron") {
        let (change, changed) = scenario.changed_by(&path)?;
        return Ok(vec![NamedEgo {
            name: asked.to_owned(),
            change,
            scenario: changed,
        }]);
    }
    let known: Vec<&str> = scenario.reuse.keys().map(String::as_str).collect();
    Err(Failure::input(
        format!("there is no ego `{asked}` in this world"),
        format!(
            "known: nominal, {}; or name a RON file with a `Change`",
            known.join(", ")
        ),
    ))
}

/// A plain table with a header.
fn table_of<const N: usize>(
    header: [&str; N],
    lines: impl IntoIterator<Item = [String; N]>,
) -> String {
    let mut table = comfy_table::Table::new();
    table
        .load_style(comfy_table::presets::UTF8_FULL_CONDENSED)
        .set_header(header);
    for line in lines {
        table.add_row(line);
    }
    table.to_string()
}

/// JSON has no infinities: they are the words "inf" and "-inf".
fn finite_or_word(value: f64) -> serde_json::Value {
    match value.is_finite() {
        true => value.into(),
        false => if 0.0 < value { "inf" } else { "-inf" }.into(),
    }
}

/// How many starts a verb may draw.
fn start_count() -> clap::builder::RangedU64ValueParser<usize> {
    clap::builder::RangedU64ValueParser::new().range(1..=10_000_000)
}

/// Nothing was computed: somebody interrupted it, or the ego did not run.
fn interrupted_early(common: &Common) -> Result<Exit, Failure> {
    if talk::stopped() {
        talk::say("interrupted before anything was evaluated");
        return Ok(Exit::Interrupted);
    }
    if common.json {
        let faults = talk::faults().complaint().map(|complaint| complaint.faults);
        print_json(&json!({ "rows": [], "faults": faults }))?;
    }
    Ok(Exit::Fault)
}

/// How a verb ends that may have been interrupted.
fn finished(otherwise: Exit) -> Exit {
    match talk::stopped() {
        true => Exit::Interrupted,
        false => otherwise,
    }
}

/// Prints one JSON object on stdout.
fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    talk::data(&value.to_string())
}

/// Renders failures without colour, for tests and logs.
pub fn plain_theme() -> GraphicalTheme {
    GraphicalTheme::unicode_nocolor()
}
