//! The wheel and the pedals: an ego that does as your keys say.

use std::sync::{Arc, Mutex, PoisonError};

use crate::ego::{Command, Controller, Fault, Percept};
use crate::scene::drive::ControllerFactory;

/// Command that the keys give, shared with the ego that obeys it.
#[derive(Clone, Debug, Default)]
pub(super) struct Hand(Arc<Mutex<Command>>);

impl Hand {
    /// Sets the command of the next sample.
    pub(super) fn set(&self, command: Command) {
        // A command is whole whatever happened to the thread that wrote the last one.
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = command;
    }

    fn get(&self) -> Command {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the maker of egos that obey this hand.
    pub(super) fn factory(&self) -> ControllerFactory {
        let hand = self.clone();
        Arc::new(move || Box::new(HandEgo(hand.clone())))
    }
}

/// Ego that obeys a hand.
struct HandEgo(Hand);

impl Controller for HandEgo {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(self.0.get())
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        // A copy would obey keys that are meant for the other.
        None
    }
}
