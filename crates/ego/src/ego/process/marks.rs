//! The mark in the environment of a program and of all that it starts.
//!
//! It finds the processes that left the program's group, on systems that show
//! environments (`/proc`). A process that clears its environment as well escapes
//! and is not waited for.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use rustix::process::{Pid, Signal, kill_process};

/// Environment variable that marks a program and its descendants.
pub(super) const MARK: &str = "BRAKECHECK_EGO";
/// Longest search for marked processes, which may start new ones meanwhile.
const LONGEST_SEARCH: Duration = Duration::from_secs(2);
/// Empty lists in a row that are believed although processes were started meanwhile.
const EMPTY_LISTS: u32 = 4;

/// Returns a value with which no other program has been marked.
pub(super) fn new_mark() -> String {
    static STARTED: AtomicU64 = AtomicU64::new(0);
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let now_ns = since_epoch.map_or(0, |time| time.as_nanos());
    let nth = STARTED.fetch_add(1, Ordering::Relaxed);
    // The process number and the counter separate runs and programs. The time
    // separates processes that reuse a number.
    format!("{}-{now_ns}-{nth}", std::process::id())
}

/// Kills the processes whose environment holds `mark`, and waits for their end.
///
/// A signal takes effect only when its process runs again, which takes a while
/// on a busy machine.
pub(super) fn end_marked(mark: &str) {
    let deadline = Instant::now() + LONGEST_SEARCH;
    let mut pause = Duration::from_micros(200);
    let mut empty_lists = 0;
    loop {
        let newest = newest_process();
        let found = marked(mark);
        empty_lists = if found.is_empty() { empty_lists + 1 } else { 0 };
        // A marked process may fork and end after the list was made, so an empty list
        // proves something only if no process was started meanwhile.
        let is_proof = newest == newest_process() || empty_lists == EMPTY_LISTS;
        // A process that cannot be killed, in a system call for instance, is left behind.
        if found.is_empty() && is_proof || deadline < Instant::now() {
            return;
        }
        for pid in found.into_iter().flatten() {
            let _ = kill_process(pid, Signal::KILL);
        }
        thread::sleep(pause);
        // Most processes end at once, and a busy machine is not kept busy by looking.
        pause = (2 * pause).min(Duration::from_millis(10));
    }
}

/// Returns the number of the process that was started last. `None` without `/proc`.
fn newest_process() -> Option<String> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().last().map(str::to_owned)
}

/// Returns running processes whose environment holds `mark`.
///
/// `None` stands for a process in the middle of an `exec`, whose environment
/// cannot be seen yet. Empty on systems without `/proc`.
fn marked(mark: &str) -> Vec<Option<Pid>> {
    let own = std::process::id();
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let marked = processes.filter_map(|process| {
        // Other entries of `/proc` are no processes.
        let number: u32 = process.file_name().to_str()?.parse().ok()?;
        let pid = Pid::from_raw(i32::try_from(number).ok()?)?;
        // Processes of other users cannot be read, and are not started by an ego.
        let environment = std::fs::read(process.path().join("environ")).ok()?;
        if environment.is_empty() {
            return is_in_exec(&process.path()).then_some(None);
        }
        let mut variables = environment.split(|byte| *byte == 0);
        let is_marked = variables.any(|variable| variable == mark.as_bytes());
        // An ego that runs brakecheck marks that brakecheck too, which must not
        // kill itself.
        (number != own && is_marked).then_some(Some(pid))
    });
    marked.collect()
}

/// Returns whether a process without a visible environment is being replaced.
///
/// Its arguments are then invisible, too. The same holds for threads of the
/// kernel and for processes that have ended, but these have no memory.
fn is_in_exec(process: &Path) -> bool {
    let arguments = std::fs::read(process.join("cmdline"));
    let pages = std::fs::read_to_string(process.join("statm"));
    matches!((arguments, pages), (Ok(arguments), Ok(pages))
        if arguments.is_empty() && !pages.is_empty() && !pages.starts_with("0 "))
}
