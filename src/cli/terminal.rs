//! Command line parts and terminal output for programs built on this library: stdout
//! for data, stderr for messages, and Ctrl-C.
//!
//! The module is hidden because only the programs of this repository use it. It may
//! change in any version.
//!
//! Architecture Invariant: this program writes to a terminal only through this module
//! and the progress bar. Foreign text is escaped (`crate::visible`).

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use clap::Args;

use super::defaults::JOBS;
use super::display::{is_quiet, is_verbose, message_columns, theme};
use super::failure::{Exit, Failure};
use super::headings::{OUTPUT, RUNNING};
use super::number_args::job_count;
use crate::ego::stop_waiting;
use crate::testbench::FaultLog;
use crate::visible::{visible, visible_json};

pub use super::display::OutputArgs;
pub use super::number_args::start_count;
pub use super::progress::{Bar, bar};

/// Options of every command that plays episodes.
#[derive(Args, Clone, Debug, Default)]
pub struct Common {
    /// Print one JSON object on stdout instead of tables.
    #[arg(long, global = true, help_heading = OUTPUT)]
    pub json: bool,
    /// Threads to use, on which no row depends [default: one per core].
    #[arg(
        short,
        long,
        global = true,
        env = JOBS,
        hide_env_values = true,
        value_name = "N",
        help_heading = RUNNING,
        value_parser = job_count()
    )]
    pub jobs: Option<u16>,
    /// Start the programs that worlds, changes and kept files name as egos.
    #[arg(long, global = true, help_heading = RUNNING)]
    pub allow_programs: bool,
    /// Start programs anew for every episode, so that they keep no state.
    #[arg(long, global = true, help_heading = RUNNING)]
    pub fresh: bool,
    /// Share of invalid episodes to tolerate in each table row, 0 to 1.
    #[arg(
        long,
        global = true,
        value_name = "SHARE",
        default_value_t = 0.0,
        help_heading = RUNNING,
        value_parser = share
    )]
    pub allow_invalid: f64,
    /// Episodes per line of a training's `progress.jsonl`.
    #[arg(long, global = true, hide = true, value_name = "EPISODES", value_parser = clap::value_parser!(u64).range(1..))]
    pub report_every: Option<u64>,
    /// Decisions between two checkpoints of a training.
    #[arg(long, global = true, hide = true, value_name = "DECISIONS", value_parser = clap::value_parser!(u64).range(1..))]
    pub checkpoint_every: Option<u64>,
    /// Log of the faults in all episodes of the command, shared by clones.
    #[arg(skip)]
    pub(super) faults: Arc<OnceLock<FaultLog>>,
}

impl Common {
    /// Returns the log of the faults in all episodes of the command.
    pub(super) fn faults(&self) -> FaultLog {
        // Created late, because the allowed share is known only after parsing.
        let log = || FaultLog::allowing(self.allow_invalid);
        self.faults.get_or_init(log).clone()
    }

    /// Returns whether a row with this share of invalid starts is no result.
    pub(super) fn refuses(&self, invalid_share: f64) -> bool {
        // A row without a valid start is none, whatever share is allowed.
        invalid_share > self.allow_invalid || invalid_share >= 1.0
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        // A range contains no NaN, with which every comparison of shares would be false.
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("a share is a number from 0 to 1, such as 0.05".to_owned()),
    }
}

/// Prints a failure, and returns its exit code.
pub(super) fn refuse(failure: &Failure) -> Exit {
    write_message(failure.render(theme(), message_columns()).trim_end());
    failure.exit
}

/// Carries out a command in a thread pool of the size asked for.
pub(super) fn with_jobs<F>(common: &Common, verb: F) -> Result<Exit, Failure>
where
    F: FnOnce() -> Result<Exit, Failure> + Send,
{
    // 0 lets rayon take one thread per core.
    let jobs = usize::from(common.jobs.unwrap_or(0));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| Failure::fault(error.to_string(), None))?;
    // A pool of its own limits all parallel loops of the verb.
    pool.install(verb)
}

/// Set once Ctrl-C was pressed: a signal of the process, not of a command.
static STOP: AtomicBool = AtomicBool::new(false);

/// Returns the flag that Ctrl-C sets.
pub(super) fn stop() -> &'static AtomicBool {
    &STOP
}

/// Returns whether Ctrl-C was pressed.
pub(super) fn stopped() -> bool {
    // The flag guards no other data, so no ordering is needed.
    STOP.load(Ordering::Relaxed)
}

/// Set once a stream could not be written to its end.
static TORN: AtomicBool = AtomicBool::new(false);

/// Notes that a stream could not be written to its end, which is a failure.
#[cfg_attr(not(feature = "rerun"), allow(dead_code))]
pub(super) fn note_torn() {
    TORN.store(true, Ordering::Relaxed);
}

/// Returns whether a stream of the verb that has ended could not be written to its end.
pub(super) fn was_torn() -> bool {
    // Python runs several commands in one process, and each has streams of its own.
    TORN.swap(false, Ordering::Relaxed)
}

/// The first Ctrl-C asks to stop and save, the second one ends at once.
pub(super) fn listen_for_interrupts() {
    // Without a handler the program still works: Ctrl-C then ends it at once.
    let _ = ctrlc::set_handler(|| {
        // The second Ctrl-C is for work that does not stop soon.
        if STOP.swap(true, Ordering::Relaxed) {
            // 128 + 2: the code by which shells report the end by SIGINT.
            std::process::exit(130);
        }
        // A program that hangs would delay the end by its timeout.
        stop_waiting();
        // A user who pressed Ctrl-C waits for a sign, in spite of `--quiet`.
        let _ = writeln!(io::stderr(), "\nstopping and saving (again to end at once)");
    });
}

/// Prints a message on stderr, its control characters escaped. `--quiet` leaves it out.
pub fn note(text: &str) {
    note_rendered(&visible(text));
}

/// Prints a message on stderr if `--verbose` is given, its control characters escaped.
pub(super) fn detail(text: &str) {
    if is_verbose() {
        note(text);
    }
}

/// Prints a message on stderr whose foreign parts are escaped already.
///
/// It may contain colours of this program. `--quiet` leaves it out.
pub(super) fn note_rendered(text: &str) {
    if !is_quiet() {
        write_message(text);
    }
}

/// Prints an error on stderr, its control characters escaped, in spite of `--quiet`.
pub(super) fn complain(text: &str) {
    write_message(&visible(text));
}

fn write_message(text: &str) {
    // A closed stderr must not end the work.
    let _ = writeln!(stderr(), "{text}");
}

#[cfg(not(test))]
use io::{stderr, stdout};

/// Unit tests run verbs for their files, so their output is discarded.
#[cfg(test)]
use io::{sink as stdout, sink as stderr};

/// Data on stdout, its control characters escaped.
///
/// A closed pipe is the reader's choice, not an error.
pub fn data(text: &str) -> Result<(), Failure> {
    write_data(&visible(text))
}

/// Returns stdout for a stream of bytes. `None`: it is a terminal, where a person reads.
#[allow(clippy::disallowed_methods, reason = "bytes for a pipe or a file")]
pub(super) fn stdout_for_bytes() -> Option<io::Stdout> {
    let stdout = io::stdout();
    (!stdout.is_terminal()).then_some(stdout)
}

/// Prints a JSON text on stdout. Its strings contain no raw control characters.
pub fn json(text: &str) -> Result<(), Failure> {
    write_data(&visible_json(text))
}

#[allow(
    clippy::disallowed_methods,
    reason = "the text is escaped by the callers"
)]
fn write_data(text: &str) -> Result<(), Failure> {
    let mut stdout = stdout();
    // Flushed at once, because a full disk must be an error before the exit.
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::fault(
            format!("writing to standard output failed: {error}"),
            Some("check where it is redirected, and the free space there".to_owned()),
        )),
        _ => Ok(()),
    }
}
