//! The command line: arguments in, rows and files out; no logic of its own.
//!
//! stdout is data, stderr is talk and progress bars. Exit codes: [`Exit`].

mod campaign;
mod check;
mod crashes;
mod eval;
mod examples;
mod excerpt;
mod export;
mod failure;
mod gate_and_sweep;
mod gone;
mod keep;
mod kept;
mod last_resort;
mod new;
mod number_args;
mod points;
mod progress;
mod report;
mod reproduce;
mod search;
mod serve;
mod stl;
mod table;
mod talk;
mod theorems;
mod train;
mod view;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use miette::GraphicalTheme;
use serde_json::json;
use strum::{EnumMessage, VariantArray};

pub use failure::{Exit, Failure, Note};

use crate::run_dir::{Row, RunDir, RunError};
use crate::visible::visible;
use crate::world::Scenario;

/// Can a car that keeps every rule still make yours crash?
#[derive(Parser, Debug)]
#[command(name = "brakecheck", version, max_term_width = 100)]
#[command(after_help = examples::ALL)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

/// What every verb takes that plays episodes.
#[derive(Args, Clone, Debug, Default)]
struct Common {
    /// Print one JSON object on stdout instead of tables.
    #[arg(long, global = true)]
    json: bool,
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
    /// Write a small world of your own, with remarks.
    #[command(after_help = examples::NEW)]
    New(new::NewArgs),
    /// Validate a world; list its signals, rules, actions, egos and starts.
    #[command(after_help = examples::CHECK)]
    Check(check::CheckArgs),
    /// Train an ado in a world and keep it in a run directory.
    #[command(after_help = examples::TRAIN)]
    Train(train::TrainArgs),
    /// Measure a trained ado and baselines on test starts and egos.
    #[command(after_help = examples::EVAL)]
    Eval(eval::EvalArgs),
    /// Search action sequences per start: what an adversary can do at all.
    #[command(after_help = examples::SEARCH)]
    Search(search::SearchArgs),
    /// As earlier versions fitted a family's parameters to an ego.
    #[command(hide = true, after_help = examples::IDENTIFY)]
    Identify(gone::GoneArgs),
    /// Play kept counterexamples again, bit for bit or against a changed ego.
    #[command(after_help = examples::REPLAY)]
    Replay(kept::ReplayArgs),
    /// Measure a formula of Signal Temporal Logic on a trace in CSV.
    #[command(after_help = examples::STL)]
    Stl(stl::StlArgs),
    /// Write one page, and JUnit XML, about a run.
    #[command(after_help = examples::REPORT)]
    Report(report::ReportArgs),
    /// Make the paper's tables and figures again, from nothing.
    #[command(hide = true, after_help = examples::REPRODUCE)]
    Reproduce(reproduce::ReproduceArgs),
    /// Play many worlds, egos, ados and starts in pieces that can die.
    #[command(after_help = examples::CAMPAIGN)]
    Campaign(campaign::CampaignArgs),
    /// Write an episode as a recording for the rerun viewer, or as a picture.
    #[command(after_help = examples::VIEW)]
    View(view::ViewArgs),
    /// Write kept counterexamples as OpenSCENARIO and OpenDRIVE files.
    #[command(after_help = examples::EXPORT)]
    Export(export::ExportArgs),
    /// Let another simulator ask a trained ado what to do, in JSON lines.
    #[command(after_help = examples::SERVE)]
    Serve(serve::ServeArgs),
}

impl Verb {
    fn common(&self) -> Common {
        match self {
            Verb::New(args) => args.common(),
            Verb::Check(args) => args.common(),
            Verb::Train(args) => args.common.clone(),
            Verb::Eval(args) => args.common.clone(),
            Verb::Search(args) => args.common.clone(),
            Verb::Identify(_) => Common::default(),
            Verb::Replay(args) => args.common.clone(),
            Verb::Stl(args) => args.common(),
            Verb::Report(args) => args.common.clone(),
            Verb::Reproduce(args) => args.common.clone(),
            Verb::Campaign(args) => args.common().clone(),
            Verb::View(args) => args.common(),
            Verb::Export(args) => args.common(),
            Verb::Serve(args) => args.common(),
        }
    }

    /// Whether Ctrl-C asks it to stop and keep what it has; others just end.
    fn saves_when_interrupted(&self) -> bool {
        matches!(
            self,
            Verb::Train(_)
                | Verb::Eval(_)
                | Verb::Search(_)
                | Verb::Report(_)
                | Verb::Reproduce(_)
                | Verb::Campaign(_)
        )
    }
}

/// Runs the program on the process's arguments.
pub fn main() -> ExitCode {
    last_resort::speak_plainly();
    let exit = last_resort::guarded(|| main_of(std::env::args_os()));
    ExitCode::from(exit as u8)
}

/// Runs the program on `arguments`, its own name first, once per process.
///
/// Help, and what is no command line, ends the process.
pub fn main_of(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    let cli = match read_line(arguments) {
        Ok(cli) => cli,
        Err(error) => return refused(&error),
    };
    if cli.verb.saves_when_interrupted() {
        talk::listen_for_interrupts();
    }
    talk::allow_faults(cli.verb.common().allow_invalid);
    let result = carry_out(cli.verb);
    result.and_then(settled).unwrap_or_else(|failure| {
        talk::say_rendered(failure.render(talk::theme(), talk::width()).trim_end());
        failure.exit
    })
}

/// What is no command line, and help; neither comes back where it may be coloured.
fn refused(error: &clap::Error) -> Exit {
    let text = error.render().to_string();
    if visible(&text) == text {
        error.exit()
    } else {
        // What was typed would be obeyed by a terminal.
        talk::say(text.trim_end())
    }
    Exit::Input
}

/// The command line; a negative number is a value, however wrong, and no option.
fn read_line(arguments: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
    let line = Cli::command().mut_subcommands(|verb| {
        verb.mut_args(|argument| {
            if argument.get_action().takes_values() {
                argument.allow_negative_numbers(true)
            } else {
                argument
            }
        })
    });
    Cli::from_arg_matches(&line.try_get_matches_from(arguments)?)
}

fn carry_out(verb: Verb) -> Result<Exit, Failure> {
    let common = verb.common();
    with_jobs(&common, move || match verb {
        Verb::New(args) => new::run(&args),
        Verb::Check(args) => check::run(&args),
        Verb::Train(args) => train::run(&args),
        Verb::Eval(args) => eval::run(&args),
        Verb::Search(args) => search::run(&args),
        Verb::Identify(args) => Err(gone::identify(&args)),
        Verb::Replay(args) => kept::replay(&args),
        Verb::Stl(args) => stl::run(&args),
        Verb::Report(args) => report::run(&args),
        Verb::Reproduce(args) => reproduce::run(&args),
        Verb::Campaign(args) => campaign::run(&args),
        Verb::View(args) => view::run(&args),
        Verb::Export(args) => export::run(&args),
        Verb::Serve(args) => serve::run(&args),
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
    Ok(Scenario::find(path)?.allow_programs(common.allow_programs))
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

/// Values of an argument: the words of a list of the library, explained by its
/// documentation.
fn one_of<T>() -> impl TypedValueParser<Value = T>
where
    T: VariantArray + FromStr + EnumMessage + Clone + Send + Sync,
    &'static str: for<'a> From<&'a T>,
{
    let values = T::VARIANTS.iter().map(|value| {
        let about = value.get_documentation().unwrap_or_default();
        PossibleValue::new(<&'static str>::from(value)).help(about.trim_end_matches('.'))
    });
    // Invariant: the words are those that are read.
    PossibleValuesParser::new(values).try_map(|word| word.parse().map_err(|_| word))
}

/// A plain table with a header.
fn table_of<const N: usize>(
    header: [&str; N],
    lines: impl IntoIterator<Item = [String; N]>,
) -> String {
    let mut table = table::table(&header);
    for line in lines {
        table.add_row(line);
    }
    table.to_string()
}

/// JSON has no infinities: they are the words "inf" and "-inf".
fn finite_or_word(value: f64) -> serde_json::Value {
    if value.is_finite() {
        value.into()
    } else {
        if 0.0 < value { "inf" } else { "-inf" }.into()
    }
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

/// How a verb ends that printed rows.
fn exit_of(rows: &[Row], fail_on_counterexample: bool) -> Exit {
    // What is left out for a point's own ego is a failure of that ego all the same.
    let alone = |row: &Row| {
        row.fails_alone
            .is_some_and(|it| it.left_out && 0 < it.starts)
    };
    let found = rows.iter().any(|row| 0 < row.successes || alone(row));
    if talk::stopped() {
        talk::say("interrupted: the rows cover the starts that were finished");
        return Exit::Interrupted;
    }
    if found && fail_on_counterexample {
        Exit::Counterexample
    } else {
        Exit::Done
    }
}

/// How a verb ends that may have been interrupted.
fn finished(otherwise: Exit) -> Exit {
    if talk::stopped() {
        Exit::Interrupted
    } else {
        otherwise
    }
}

/// Prints one JSON object on stdout.
fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    talk::json(&value.to_string())
}

/// Renders failures without colour, for tests and logs.
pub fn plain_theme() -> GraphicalTheme {
    GraphicalTheme::unicode_nocolor()
}
