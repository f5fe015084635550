//! How much a command prints, in which colours and how wide.

use std::io;
use std::sync::atomic::{AtomicU8, Ordering};

use anstream::AutoStream;
use clap::{Args, ColorChoice};
use miette::GraphicalTheme;
use terminal_size::{Width, terminal_size_of};

use super::headings::OUTPUT;

/// Environment variable for `--color`.
pub(super) const COLOR: &str = "BRAKECHECK_COLOR";
/// Columns where there is no terminal.
const USUAL_COLUMNS: usize = 100;
/// Columns below which no text is wrapped.
const LEAST_COLUMNS: usize = 60;

/// Options of every command about its output.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct OutputArgs {
    /// Print the answer and errors only.
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = OUTPUT)]
    quiet: bool,
    /// Print times, the files read and the origin of defaults, too.
    #[arg(short, long, global = true, help_heading = OUTPUT)]
    verbose: bool,
    /// Colours: auto is on in terminals, unless NO_COLOR is set.
    #[arg(
        long,
        global = true,
        env = COLOR,
        hide_env_values = true,
        value_name = "WHEN",
        default_value = "auto",
        help_heading = OUTPUT
    )]
    color: ColorChoice,
}

/// Amount of text that a command prints besides its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
enum Verbosity {
    Quiet,
    Usual,
    Verbose,
}

/// Set once from the command line: a property of the process, as its terminal is.
static VERBOSITY: AtomicU8 = AtomicU8::new(Verbosity::Usual as u8);

impl OutputArgs {
    /// Makes the process print as these options request.
    pub(super) fn obey(self) {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Usual,
        };
        VERBOSITY.store(verbosity as u8, Ordering::Relaxed);
        // Replaces the choice that was guessed before parsing.
        colour(self.color);
    }
}

/// Makes the process print in colours, or not.
pub(super) fn colour(choice: ColorChoice) {
    let choice = match choice {
        ColorChoice::Auto => anstream::ColorChoice::Auto,
        ColorChoice::Always => anstream::ColorChoice::Always,
        ColorChoice::Never => anstream::ColorChoice::Never,
    };
    choice.write_global();
}

/// Returns whether `--quiet` is given.
pub(super) fn is_quiet() -> bool {
    VERBOSITY.load(Ordering::Relaxed) == Verbosity::Quiet as u8
}

/// Returns whether `--verbose` is given.
pub(super) fn is_verbose() -> bool {
    VERBOSITY.load(Ordering::Relaxed) == Verbosity::Verbose as u8
}

/// Colours of messages on stderr, and plain text where colours are unwelcome.
///
/// Conventions: `--color`, then NO_COLOR, CLICOLOR_FORCE and CLICOLOR, then the terminal.
pub(super) fn theme() -> GraphicalTheme {
    // Messages go to stderr, so its terminal decides on their colours.
    match AutoStream::choice(&io::stderr()) {
        anstream::ColorChoice::Never => super::plain_theme(),
        _ => GraphicalTheme::unicode(),
    }
}

/// Returns the columns for messages on stderr.
pub(super) fn message_columns() -> usize {
    columns_of(terminal_size_of(io::stderr()).map(|(Width(columns), _)| columns))
}

/// Returns the columns for tables and text on stdout.
#[allow(clippy::disallowed_methods, reason = "only its width is asked for")]
pub(super) fn stdout_columns() -> usize {
    columns_of(terminal_size_of(io::stdout()).map(|(Width(columns), _)| columns))
}

/// Returns the columns of a terminal, else those of the variable COLUMNS, else 100.
fn columns_of(terminal: Option<u16>) -> usize {
    let named = || {
        let text = std::env::var("COLUMNS").ok()?;
        // A width of 0 stands for an unknown one.
        text.parse::<u16>().ok().filter(|columns| *columns > 0)
    };
    let columns = terminal.or_else(named).map_or(USUAL_COLUMNS, usize::from);
    // In fewer columns a table would wrap nearly every word.
    columns.max(LEAST_COLUMNS)
}
