//! Command line: arguments in, rows and files out, without logic of its own.
//!
//! stdout has data. stderr has messages and progress bars. [`Exit`] lists the exit codes.

mod answer;
mod baselines;
mod campaign;
mod check;
mod command_line;
mod common;
mod completions;
mod coverage;
mod crashes;
mod defaults;
mod display;
#[cfg(feature = "drive")]
mod drive;
mod egos_table;
mod eval;
mod eval_args;
mod examples;
mod excerpt;
mod export;
mod failure;
mod gate;
mod harden;
mod harden_text;
mod headings;
mod input;
mod keep;
mod kept_input;
mod last_resort;
mod league;
mod live;
mod log;
mod log_reading;
mod lsp;
mod man;
mod new;
mod new_commonroad;
mod new_from_log;
mod new_world;
mod notices;
mod number_args;
mod output_path;
mod points;
mod population;
#[doc(hidden)]
pub mod program;
mod progress;
mod reference;
mod replay;
mod report;
mod report_args;
mod report_results;
mod report_texts;
mod risk;
mod run_under_test;
mod search;
mod serve;
mod stl;
mod stl_log;
mod sweep;
mod table;
#[doc(hidden)]
pub mod terminal;
mod test_args;
mod theorems;
mod traffic_args;
mod train;
mod training_command;
mod usage_error;
mod verb_groups;
mod verdict;
mod view;
mod world_input;
mod worlds;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Command, Parser, Subcommand};

use eval_args::EvalArgs;
pub use failure::{ErrorReport, Exit, Failure, plain_theme};
use program::CommandLine;
use run_under_test::is_world;
use terminal::{Common, OutputArgs};

/// Can a car that keeps every rule still make yours crash?
#[derive(Parser, Debug)]
#[command(name = "brakecheck", version)]
#[command(after_help = examples::SHORT, after_long_help = examples::all())]
struct Cli {
    #[command(flatten)]
    output: OutputArgs,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand, Debug)]
enum Verb {
    /// Write a small world of your own, with remarks.
    #[command(after_help = examples::NEW)]
    New(new::NewArgs),
    /// Validate a world and list its signals, rules, egos and starts.
    #[command(after_help = examples::CHECK)]
    Check(check::CheckArgs),
    /// List the shipped worlds, print one, or copy it.
    #[command(after_help = examples::WORLDS)]
    Worlds(worlds::WorldsArgs),
    /// Train an ado in a world and keep it in a run directory.
    #[command(after_help = examples::TRAIN)]
    Train(train::TrainArgs),
    /// Measure a trained ado and baselines on test starts and egos.
    #[command(after_help = examples::EVAL)]
    Eval(EvalArgs),
    /// Compare an ego with an earlier one, start by start.
    #[command(after_help = examples::GATE)]
    Gate(gate::GateArgs),
    /// Measure a trained ado over a range of an ego's parameter.
    #[command(after_help = examples::SWEEP)]
    Sweep(sweep::SweepArgs),
    /// Find the smallest change of an ego with which it withstands.
    #[command(after_help = examples::HARDEN)]
    Harden(harden::HardenArgs),
    /// Search every start for actions that make the ego fail.
    #[command(after_help = examples::SEARCH)]
    Search(search::SearchArgs),
    /// Estimate how often an ego fails, in traffic that you declare.
    #[command(after_help = examples::RISK)]
    Risk(risk::RiskArgs),
    /// List rules, formula parts and starts that episodes never covered.
    #[command(after_help = examples::COVERAGE)]
    Coverage(coverage::CoverageArgs),
    /// Play kept counterexamples again, also against a changed ego.
    #[command(after_help = examples::REPLAY)]
    Replay(replay::ReplayArgs),
    /// Measure a formula on a trace, or rules on recorded traffic.
    #[command(after_help = examples::STL)]
    Stl(stl::StlArgs),
    /// Read recorded traffic: lanes, situations and rarity.
    #[command(after_help = examples::LOG)]
    Log(log::LogArgs),
    /// Write a page and JUnit XML about a run, crashes, a gate or a risk.
    #[command(after_help = examples::REPORT)]
    Report(report_args::ReportArgs),
    /// Play many worlds, egos, ados and starts in resumable pieces.
    #[command(after_help = examples::CAMPAIGN)]
    Campaign(campaign::CampaignArgs),
    /// Drive in a world yourself, on a page in the browser.
    #[cfg(feature = "drive")]
    #[command(after_help = examples::DRIVE)]
    Drive(drive::DriveArgs),
    /// Write an episode as a recording for rerun, or as a picture.
    #[command(after_help = examples::VIEW)]
    View(view::ViewArgs),
    /// Write kept counterexamples as OpenSCENARIO and OpenDRIVE files.
    #[command(after_help = examples::EXPORT)]
    Export(export::ExportArgs),
    /// Serve ados to another simulator, in JSON lines.
    #[command(after_help = examples::SERVE)]
    Serve(serve::ServeArgs),
    /// Answer an editor: diagnostics, hover and completion of worlds.
    #[command(after_help = examples::LSP)]
    Lsp(lsp::LspArgs),
    /// Print tables of verbs, signals, `--json`, world files and egos.
    #[command(after_help = examples::REFERENCE)]
    Reference(reference::ReferenceArgs),
    /// Print the completions of a shell.
    #[command(after_help = examples::COMPLETIONS)]
    Completions(completions::CompletionsArgs),
    /// Print the manual page, or write those of all verbs.
    #[command(after_help = examples::MAN)]
    Man(man::ManArgs),
    /// Print the libraries in this program, with their licences.
    #[command(hide = true)]
    Notices(notices::NoticesArgs),
}

impl Verb {
    fn common(&self) -> Common {
        match self {
            Verb::New(args) => args.common(),
            Verb::Check(args) => args.common(),
            Verb::Worlds(args) => args.common(),
            Verb::Train(args) => args.common.clone(),
            Verb::Eval(args) => args.test.common.clone(),
            Verb::Gate(args) => args.test.common.clone(),
            Verb::Sweep(args) => args.test.common.clone(),
            Verb::Harden(args) => args.common.clone(),
            Verb::Search(args) => args.common.clone(),
            Verb::Risk(args) => args.common.clone(),
            Verb::Coverage(args) => args.common.clone(),
            Verb::Replay(args) => args.common.clone(),
            Verb::Stl(args) => args.common(),
            Verb::Log(args) => args.common(),
            Verb::Report(args) => args.common.clone(),
            Verb::Campaign(args) => args.common().clone(),
            #[cfg(feature = "drive")]
            Verb::Drive(args) => args.common(),
            Verb::View(args) => args.common(),
            Verb::Export(args) => args.common(),
            Verb::Serve(args) => args.common(),
            Verb::Lsp(args) => args.common(),
            Verb::Reference(args) => args.common(),
            // They print fixed texts, on which no option has an effect.
            Verb::Completions(_) | Verb::Man(_) | Verb::Notices(_) => Common::default(),
        }
    }

    /// Returns whether Ctrl-C makes it stop and save. Other verbs just end.
    fn saves_when_interrupted(&self) -> bool {
        #[cfg(feature = "drive")]
        // Ctrl-C is the regular end of a drive and of a watched check, with exit code 0.
        if matches!(self, Verb::Drive(_)) {
            return true;
        }
        if let Verb::Check(args) = self {
            return args.is_watching();
        }
        // The other verbs have no finished work to save, so they may end at once.
        matches!(
            self,
            Verb::Train(_)
                | Verb::Eval(_)
                | Verb::Gate(_)
                | Verb::Sweep(_)
                | Verb::Harden(_)
                | Verb::Search(_)
                | Verb::Risk(_)
                | Verb::Coverage(_)
                | Verb::Report(_)
                | Verb::Campaign(_)
        )
    }
}

/// Runs the program on the process's arguments.
pub fn main() -> ExitCode {
    program::main::<Cli>()
}

/// Runs the program on `arguments`, its own name first.
pub fn main_of(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    program::main_of::<Cli>(arguments)
}

impl CommandLine for Cli {
    fn laid_out(command: Command) -> Command {
        verb_groups::grouped(command)
    }

    fn common(&self) -> Common {
        self.verb.common()
    }

    fn output(&self) -> OutputArgs {
        self.output
    }

    fn saves_when_interrupted(&self) -> bool {
        self.verb.saves_when_interrupted()
    }

    fn carry_out(self) -> Result<Exit, Failure> {
        carry_out(self.verb)
    }
}

fn carry_out(verb: Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::New(args) => new::run(&args),
        Verb::Check(args) => check::run(&args),
        Verb::Worlds(args) => worlds::run(&args),
        Verb::Train(args) => train::run(&args),
        Verb::Eval(args) => evaluate(&args),
        Verb::Gate(args) => gate::run(&args),
        Verb::Sweep(args) => sweep::run(&args),
        Verb::Harden(args) => harden::run(&args),
        Verb::Search(args) => search::run(&args),
        Verb::Risk(args) => risk::run(&args),
        Verb::Coverage(args) => coverage::run(&args),
        Verb::Replay(args) => replay::run(&args),
        Verb::Stl(args) => match &args.trace {
            Some(trace) => stl::run(&args, trace),
            // Without a trace, the command line requires a recording.
            None => stl_log::run(&args),
        },
        Verb::Log(args) => log::run(&args),
        Verb::Report(args) => report::run(&args),
        Verb::Campaign(args) => campaign::run(&args),
        #[cfg(feature = "drive")]
        Verb::Drive(args) => drive::run(&args),
        Verb::View(args) => view::run(&args),
        Verb::Export(args) => export::run(&args),
        Verb::Serve(args) => serve::run(&args),
        Verb::Lsp(args) => lsp::run(&args),
        Verb::Reference(args) => reference::run(&args),
        Verb::Completions(args) => completions::run(&args),
        Verb::Man(args) => man::run(&args),
        Verb::Notices(args) => notices::run(&args),
    }
}

/// Plays what `eval` was given: members of a population, a world, or a run.
fn evaluate(args: &EvalArgs) -> Result<Exit, Failure> {
    match args.members {
        Some(members) => population::eval(args, members),
        None if is_world(&args.run) => baselines::run(args),
        None => eval::run(args),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::Command;

    /// clap checks this in debug builds only, and panics there.
    fn assert_unique(command: &Command) {
        let mut seen = BTreeSet::new();
        for argument in command.get_arguments() {
            let names = [
                Some(format!("id {}", argument.get_id())),
                argument.get_long().map(|it| format!("--{it}")),
                argument.get_short().map(|it| format!("-{it}")),
            ];
            for name in names.into_iter().flatten() {
                let is_new = seen.insert(name.clone());
                assert!(is_new, "`{}` has {name} twice", command.get_name());
            }
        }
        command.get_subcommands().for_each(assert_unique);
    }

    #[test]
    fn no_verb_has_an_option_twice() {
        let mut command = super::command_line::command::<super::Cli>(false);
        command.build();
        assert_unique(&command);
        command.debug_assert();
    }
}
