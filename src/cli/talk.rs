//! Talking to a person: stdout for data, stderr for talk, bars and Ctrl-C.

use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use miette::GraphicalTheme;

use super::Failure;
use crate::campaign::{Remark, Watch};
use crate::testbench::FaultLog;

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

/// One line of talk on stderr.
pub(super) fn say(line: &str) {
    let _ = writeln!(stderr(), "{line}");
}

#[cfg(not(test))]
use io::{stderr, stdout};

/// Unit tests carry out verbs for their files: nobody reads what they print.
#[cfg(test)]
use io::{sink as stdout, sink as stderr};

/// Data on stdout; a closed pipe is the reader's choice, not an error.
pub(super) fn data(text: &str) -> Result<(), Failure> {
    let mut stdout = stdout();
    match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::fault(
            format!("writing to standard output failed: {error}"),
            Some("check where it is redirected, and the free space there".to_owned()),
        )),
        _ => Ok(()),
    }
}

/// A progress bar on terminals, lines elsewhere; it goes when it is dropped.
pub(super) struct Bar {
    shown: ProgressBar,
    progress: Box<dyn Fn(u64, u64) + Send + Sync>,
    remarks: Box<dyn Fn(Remark<'_>) + Send + Sync>,
}

/// Off a terminal a line of progress now and then, instead of a bar.
#[derive(Default)]
struct Lines {
    /// How many were written of this bar.
    written: AtomicU64,
}

impl Lines {
    /// Seconds between two of them.
    const EVERY_S: u64 = 30;

    fn now_and_then(&self, bar: &ProgressBar) {
        let elapsed_s = bar.elapsed().as_secs();
        let due = elapsed_s / Lines::EVERY_S;
        // Of several threads one writes.
        if self.written.fetch_max(due, Ordering::Relaxed) < due {
            let (done, total) = (bar.position(), bar.length().unwrap_or(0));
            // What comes before the first decisions says nothing of the rest.
            let telling = 0 < done && total <= done.saturating_mul(20);
            let left_s = telling.then(|| elapsed_s * total.saturating_sub(done) / done.max(1));
            let left = left_s.map_or(String::new(), |left_s| format!(", about {left_s} s left"));
            say(&format!(
                "{}: {done} of {total} after {elapsed_s} s{left}",
                bar.message()
            ));
        }
    }
}

/// A bar over work whose amount the work itself tells.
pub(super) fn bar(what: &str) -> Bar {
    let shown = ProgressBar::new(0);
    let style = ProgressStyle::with_template(
        "{msg:<24} {wide_bar} {human_pos}/{human_len}  {elapsed} (eta {eta})",
    );
    if let Ok(style) = style {
        shown.set_style(style);
    }
    shown.set_message(what.to_owned());
    let moved = shown.clone();
    let lines = (!io::stderr().is_terminal()).then(Lines::default);
    let progress = Box::new(move |done, total| {
        moved.set_length(total);
        moved.set_position(done);
        if let Some(lines) = &lines {
            lines.now_and_then(&moved);
        }
    });
    let named = shown.clone();
    let remarks = Box::new(move |remark: Remark<'_>| match remark {
        Remark::Phase(what) => named.set_message(what.to_owned()),
        Remark::Line(line) => named.suspend(|| say(line)),
    });
    Bar {
        shown,
        progress,
        remarks,
    }
}

impl Bar {
    /// Shows progress on this bar; stops at Ctrl-C.
    pub(super) fn watch(&self) -> Watch<'_> {
        Watch {
            progress: &*self.progress,
            remarks: &*self.remarks,
            stop: &STOP,
            faults: faults(),
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.shown.finish_and_clear();
    }
}

/// Colours on a terminal, plain text elsewhere.
pub(super) fn theme() -> GraphicalTheme {
    let plain = std::env::var_os("NO_COLOR").is_some();
    match io::stderr().is_terminal() && !plain {
        true => GraphicalTheme::unicode(),
        false => super::plain_theme(),
    }
}

/// Columns for messages.
pub(super) fn width() -> usize {
    100
}
