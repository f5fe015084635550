//! The last resort: a fault of this program ends in plain words and exit code 3.

use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::sync::atomic::{AtomicBool, Ordering};

use super::failure::Exit;

/// Set after the first message. If several threads fail, a single message is printed.
static SPOKE: AtomicBool = AtomicBool::new(false);

/// Gives `note` the message of a panic: the fault, the place to report it, the kept work.
pub(super) fn speak_plainly(note: fn(&str)) {
    // Rust's own message has a backtrace, which helps no user.
    panic::set_hook(Box::new(move |fault| {
        if !SPOKE.swap(true, Ordering::Relaxed) {
            note(&in_words(fault));
        }
    }));
}

/// Runs a closure. A panic in it is a fault of this program.
pub(super) fn guarded(act: impl FnOnce() -> Exit) -> Exit {
    // Nothing is used afterwards that a panic could have left half changed.
    panic::catch_unwind(AssertUnwindSafe(act)).unwrap_or(Exit::Fault)
}

fn in_words(fault: &PanicHookInfo<'_>) -> String {
    let what = fault.payload_as_str().unwrap_or("no reason is known");
    let place = fault.location().map(ToString::to_string);
    report(what, place.as_deref().unwrap_or("an unknown place"))
}

fn report(what: &str, place: &str) -> String {
    let (version, arch) = (env!("CARGO_PKG_VERSION"), std::env::consts::ARCH);
    // A panic may quote large values.
    let what: String = what.chars().take(2000).collect();
    format!(
        "brakecheck itself failed: {what}\n  \
         at {place}, version {version}, {arch}-{os}\n  \
         This is a fault of the program, not of your input. Please report it to the project \
         with\n  these lines, the command and the files that it names.\n  \
         What was written before is kept. `train --resume`, `campaign run` and `repro` go \
         on from there.",
        os = std::env::consts::OS,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_in_any_thread_is_a_fault_of_the_program() {
        assert_eq!(guarded(|| Exit::Counterexample), Exit::Counterexample);
        let here = || panic!("planted");
        assert_eq!(guarded(here), Exit::Fault);
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(2)
            .build()
            .expect("a pool");
        let elsewhere = || threads.install(|| -> Exit { panic!("planted") });
        assert_eq!(guarded(elsewhere), Exit::Fault);
    }

    #[test]
    fn it_says_what_where_and_whom_to_tell() {
        let text = report("planted\u{1b}[2K", "src/x.rs:1:2");
        for part in ["planted", "src/x.rs:1:2", "report it", "What was written"] {
            assert!(text.contains(part), "{text}");
        }
    }
}
