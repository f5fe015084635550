//! Terminal output: stdout for data, stderr for messages, and Ctrl-C.
//!
//! Architecture Invariant: this program writes to a terminal only through this module.
//! Foreign text is escaped ([`crate::visible`]).

use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use miette::GraphicalTheme;

use super::Failure;
use crate::testbench::FaultLog;
use crate::visible::{visible, visible_json};

/// Set once Ctrl-C was pressed.
static STOP: AtomicBool = AtomicBool::new(false);

/// Log of the faults in all episodes of this command.
static FAULTS: OnceLock<FaultLog> = OnceLock::new();

/// Allows a share of the episodes of a row to be invalid.
pub(super) fn allow_faults(share: f64) {
    // Set once, before anything is played.
    let _ = FAULTS.set(FaultLog::allowing(share));
}

/// The log of faults of this command.
pub(super) fn faults() -> FaultLog {
    FAULTS.get_or_init(FaultLog::default).clone()
}

/// Returns the flag that Ctrl-C sets.
pub(super) fn stop() -> &'static AtomicBool {
    &STOP
}

/// Returns whether Ctrl-C was pressed.
pub(super) fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// The first Ctrl-C asks to stop and save, the second one ends at once.
pub(super) fn listen_for_interrupts() {
    // Without a handler the program still works: Ctrl-C then ends it at once.
    let _ = ctrlc::set_handler(|| {
        // The second Ctrl-C is for work that does not stop soon.
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        let _ = writeln!(io::stderr(), "\nstopping and saving (again to end at once)");
    });
}

/// Talk on stderr, its control characters escaped.
pub fn say(text: &str) {
    say_rendered(&visible(text));
}

/// Prints a message on stderr whose foreign parts are escaped already.
///
/// It may contain colours of this program.
pub(super) fn say_rendered(text: &str) {
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

/// Prints a JSON text on stdout. Its strings contain no raw control characters.
pub fn json(text: &str) -> Result<(), Failure> {
    write_data(&visible_json(text))
}

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

/// Colours on a terminal, plain text elsewhere.
pub(super) fn theme() -> GraphicalTheme {
    // The convention of no-color.org.
    let plain = std::env::var_os("NO_COLOR").is_some();
    if io::stderr().is_terminal() && !plain {
        GraphicalTheme::unicode()
    } else {
        super::plain_theme()
    }
}

/// Columns for messages.
pub(super) fn width() -> usize {
    100
}
