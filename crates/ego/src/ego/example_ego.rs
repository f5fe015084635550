//! An ego that exists in tests only.

use super::parameters::parameters;
use super::{Command, Controller, Fault, Percept};

parameters! {
    /// Brakes, whatever it perceives.
    pub struct Dummy {
        /// Commanded deceleration, m/s².
        brake_mps2, at_least 0.0;
    }
}

impl Controller for Dummy {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(-self.brake_mps2))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
