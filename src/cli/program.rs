//! A program from its command line to its exit code.
//!
//! The module is hidden because only the programs of this repository use it. It may
//! change in any version.

use std::ffi::OsString;
use std::process::ExitCode;
use std::time::Instant;

use super::command_line::{self, Ended};
use super::failure::{Exit, Failure};
use super::last_resort;
use super::terminal::{
    Common, complain, detail, listen_for_interrupts, refuse, stopped, was_torn, with_jobs,
};

pub use super::command_line::CommandLine;

/// Runs a program on the process's arguments.
pub fn main<P: CommandLine>() -> ExitCode {
    last_resort::speak_plainly(complain);
    // Parsing is guarded, too, because every panic is a fault of this program.
    let exit = last_resort::guarded(|| main_of::<P>(std::env::args_os()));
    ExitCode::from(exit as u8)
}

/// Runs a program on `arguments`, its own name first.
pub(super) fn main_of<P: CommandLine>(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    let began = Instant::now();
    let line = match command_line::read::<P>(arguments) {
        Ok(line) => line,
        Err(Ended::Printed(exit)) => return exit,
        Err(Ended::Refused(failure)) => return refuse(&failure),
    };
    let program = line.program;
    program.output().obey();
    // After the output options are obeyed, because only `--verbose` prints these lines.
    for origin in &line.origins {
        detail(origin);
    }
    // Without a handler the operating system ends the program at once.
    if program.saves_when_interrupted() {
        listen_for_interrupts();
    }
    // `carry_out` consumes the program, and faults are settled after it.
    let common = program.common();
    let result = with_jobs(&common, move || program.carry_out());
    let settled = |exit| settled(&common, exit);
    let exit = result
        .and_then(settled)
        .unwrap_or_else(|failure| refuse(&failure));
    detail(&format!("took {:.2} s", began.elapsed().as_secs_f64()));
    exit
}

/// Returns the exit code of a verb, or its failure because of faults.
///
/// If more episodes are invalid than allowed, the output is no verdict on the ego.
fn settled(common: &Common, exit: Exit) -> Result<Exit, Failure> {
    // After Ctrl-C a stream ends early by request, which is no failure of it.
    if was_torn() && !stopped() {
        return Err(Failure::fault(
            "the recording of `--rerun` is not whole".to_owned(),
            Some("check the free space there, or leave it out".to_owned()),
        ));
    }
    match common.faults().complaint() {
        // An interruption has an exit code of its own, which takes precedence.
        Some(complaint) if !stopped() => Err(complaint.into()),
        _ => Ok(exit),
    }
}
