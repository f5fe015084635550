//! An ego that repeats the recorded commands of an episode.

use std::sync::Arc;

use super::{Command, Controller, Fault, Percept};

/// Commands of an episode, repeated once per sample.
///
/// The world's side of an episode is a pure function of these commands,
/// whatever ego gave them. An episode with a non-deterministic ego can
/// therefore be repeated bit for bit.
#[derive(Clone, Debug)]
pub struct RecordedCommands {
    commands: Arc<[Command]>,
    next: usize,
}

impl RecordedCommands {
    /// Creates an ego that repeats `commands`.
    pub fn new(commands: Arc<[Command]>) -> RecordedCommands {
        RecordedCommands { commands, next: 0 }
    }
}

impl Controller for RecordedCommands {
    fn reset(&mut self, _seed: u64) {
        self.next = 0;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let command = self.commands.get(self.next).copied();
        self.next += 1;
        // A fault and not a default command: the episode would silently differ
        // from its record.
        command.ok_or_else(|| {
            Fault::error(format!(
                "the recorded commands of the ego end before {:.3} s",
                percept.time_s
            ))
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
