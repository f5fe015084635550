//! The ego that test protocols assume: it does nothing at all.
//!
//! At a point of a protocol everybody is set so that an ego at constant speed is
//! hit in the prescribed way. With it a world shows whether that is so.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept};

parameters! {
    /// Keeps its acceleration, whatever it sees.
    pub struct Coast {
        /// The acceleration, m/s²; 0 keeps its speed.
        accel_mps2, at_least 0.0;
    }
}

impl Controller for Coast {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(self.accel_mps2))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
