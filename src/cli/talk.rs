//! Talking to a person: stdout for data, stderr for talk, and Ctrl-C.
//!
//! Architecture Invariant: nothing of this program writes to a terminal but
//! through here. What was written by others is escaped ([`crate::visible`]).

use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use miette::GraphicalTheme;

use super::Failure;
use crate::testbench::FaultLog;
use crate::visible::{visible, visible_json};

/// Set once Ctrl-C was pressed.
static STOP: AtomicBool = AtomicBool::new(false);

/// What every episode of this command tells of its faults.
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

/// What is set once Ctrl-C was pressed.
pub(super) fn stop() -> &'static AtomicBool {
    &STOP
}

/// Whether Ctrl-C was pressed.
pub(super) fn stopped() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// The first Ctrl-C asks to stop and save, the second one ends at once.
pub(super) fn listen_for_interrupts() {
    // Without a handler the program still works: Ctrl-C then ends it at once.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        let _ = writeln!(io::stderr(), "\nstopping and saving (again to end at once)");
    });
}

/// Talk on stderr, its control characters escaped.
pub(super) fn say(text: &str) {
    say_rendered(&visible(text));
}

/// Talk on stderr that holds nothing from outside but what is escaped, and
/// colours of our own.
pub(super) fn say_rendered(text: &str) {
    let _ = writeln!(stderr(), "{text}");
}

#[cfg(not(test))]
use io::{stderr, stdout};

/// Unit tests carry out verbs for their files: nobody reads what they print.
#[cfg(test)]
use io::{sink as stdout, sink as stderr};

/// Data on stdout, its control characters escaped.
///
/// A closed pipe is the reader's choice, not an error.
pub(super) fn data(text: &str) -> Result<(), Failure> {
    write_data(&visible(text))
}

/// A JSON text on stdout; nothing in its strings is for a terminal to obey.
pub(super) fn json(text: &str) -> Result<(), Failure> {
    write_data(&visible_json(text))
}

fn write_data(text: &str) -> Result<(), Failure> {
    let mut stdout = stdout();
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
