//! The ego assumed by test protocols, which does nothing.
//!
//! In a test case of a protocol, all agents are placed so that an ego at
//! constant speed is hit in the prescribed way. This controller shows whether a
//! world does so.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept};

parameters! {
    /// Keeps its acceleration, whatever it perceives.
    pub struct Coast {
        /// The acceleration, 0 to keep the speed, m/s².
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
