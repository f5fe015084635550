//! Refusal of programs on systems without process groups.

use std::time::Duration;

use super::super::{Fault, FaultKind};

/// A program that cannot exist on this system.
pub(super) enum UnsupportedProgram {}

impl UnsupportedProgram {
    pub(super) fn start(command: &[String]) -> Result<UnsupportedProgram, Fault> {
        Err(Fault::new(
            FaultKind::CannotStart,
            format!(
                "`{}`: programs as egos need a Unix system",
                command.join(" ")
            ),
        ))
    }

    pub(super) fn name(&self) -> &str {
        match *self {}
    }

    pub(super) fn stderr(&mut self) -> String {
        match *self {}
    }

    pub(super) fn ask(
        &mut self,
        _line: &[u8],
        _timeout: Duration,
        _occasion: &dyn Fn() -> String,
        _answer: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        match *self {}
    }

    pub(super) fn close(&mut self, _farewell: &[u8], _grace: Duration) -> bool {
        match *self {}
    }

    pub(super) fn is_silent(&mut self, _for: Duration) -> bool {
        match *self {}
    }
}

/// Returns the beginning of an answer, for messages.
pub(super) fn shown(answer: &[u8]) -> String {
    String::from_utf8_lossy(answer).chars().take(80).collect()
}
