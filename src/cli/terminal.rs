//! Command line parts for programs built on this library.
//!
//! The module is hidden because only the programs of this repository use it. It may
//! change in any version.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Args, CommandFactory, FromArgMatches};

use super::{Exit, Failure, last_resort, talk};
use crate::visible::visible;

pub use super::number_args::start_count;
pub use super::progress::{Bar, bar};
pub use super::talk::{data, json, say};

/// Options of every command that plays episodes.
#[derive(Args, Clone, Debug, Default)]
pub struct Common {
    /// Print one JSON object on stdout instead of tables.
    #[arg(long, global = true)]
    pub json: bool,
    /// Threads to use; rows do not depend on it [default: one per core].
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Start the programs that worlds, changes and kept files name as egos.
    #[arg(long, global = true)]
    pub allow_programs: bool,
    /// Largest share of invalid episodes in a row that is no fault, 0 to 1.
    #[arg(long, global = true, value_name = "SHARE", default_value_t = 0.0, value_parser = share)]
    pub allow_invalid: f64,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number from 0 to 1, such as 0.05".to_owned()),
    }
}

/// Command line of a program.
pub trait Program: CommandFactory + FromArgMatches + Send {
    /// Returns the options of the command that all commands share.
    fn common(&self) -> Common;

    /// Returns whether Ctrl-C makes it stop and save. Other commands just end.
    fn saves_when_interrupted(&self) -> bool;

    /// Carries out the command in the thread pool of the caller.
    ///
    /// # Errors
    ///
    /// Returns an error if the command cannot be carried out.
    fn carry_out(self) -> Result<Exit, Failure>;
}

/// Runs a program on the process's arguments.
pub fn main<P: Program>() -> ExitCode {
    last_resort::speak_plainly();
    // Parsing is guarded, too, because every panic is a fault of this program.
    let exit = last_resort::guarded(|| main_of::<P>(std::env::args_os()));
    ExitCode::from(exit as u8)
}

/// Runs a program on `arguments`, its own name first, once per process.
///
/// Help, and an invalid command line, end the process.
pub(super) fn main_of<P: Program>(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    let program: P = match read_line(arguments) {
        Ok(program) => program,
        Err(error) => return refused(&error),
    };
    // Without a handler the operating system ends the program at once.
    if program.saves_when_interrupted() {
        talk::listen_for_interrupts();
    }
    let common = program.common();
    // Set before the verb, because the log of faults is made at its first use.
    talk::allow_faults(common.allow_invalid);
    let result = with_jobs(&common, move || program.carry_out());
    result.and_then(settled).unwrap_or_else(|failure| {
        talk::say_rendered(failure.render(talk::theme(), talk::width()).trim_end());
        failure.exit
    })
}

/// Prints help or the error of a command line, without control characters.
fn refused(error: &clap::Error) -> Exit {
    let text = error.render().to_string();
    if visible(&text) == text {
        error.exit()
    } else {
        // A terminal would obey control characters in the arguments.
        talk::say(text.trim_end())
    }
    Exit::Input
}

/// Parses the command line. A negative number is a value, not an option.
fn read_line<P: Program>(arguments: impl IntoIterator<Item = OsString>) -> Result<P, clap::Error> {
    let negative = |argument: clap::Arg| {
        if argument.get_action().takes_values() {
            argument.allow_negative_numbers(true)
        } else {
            argument
        }
    };
    let line = P::command().mut_args(negative);
    let line = line.mut_subcommands(|verb| verb.mut_args(negative));
    P::from_arg_matches(&line.try_get_matches_from(arguments)?)
}

/// Returns the exit code of a verb, or its failure because of faults.
///
/// If more episodes are invalid than allowed, the output is no verdict on the ego.
fn settled(exit: Exit) -> Result<Exit, Failure> {
    match talk::faults().complaint() {
        // An interruption has an exit code of its own, which takes precedence.
        Some(complaint) if !talk::stopped() => Err(complaint.into()),
        _ => Ok(exit),
    }
}

/// Carries out a command in a thread pool of the size asked for.
pub(super) fn with_jobs<F>(common: &Common, verb: F) -> Result<Exit, Failure>
where
    F: FnOnce() -> Result<Exit, Failure> + Send,
{
    // 0 lets rayon take one thread per core.
    let jobs = usize::from(common.jobs.unwrap_or(0));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
    let pool = pool.map_err(|error| Failure::fault(error.to_string(), None))?;
    // A pool of its own limits all parallel loops of the verb.
    pool.install(verb)
}
