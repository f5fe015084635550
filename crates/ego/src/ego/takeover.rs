//! Change of the driver at a sample, to find the actions that would have helped.

use super::{Briefing, Command, Controller, Fault, Percept};

/// A controller up to a sample, and a second controller from then on.
///
/// Both perceive everything from the beginning, so the second knows the past
/// when it takes over. Only the commands of the active controller apply.
pub struct Takeover {
    first: Box<dyn Controller>,
    second: Box<dyn Controller>,
    /// Number of samples in which the first controller is active.
    after: usize,
    next: usize,
}

impl Takeover {
    /// Applies the commands of `first` for `after` samples, then those of `second`.
    pub fn new(first: Box<dyn Controller>, second: Box<dyn Controller>, after: usize) -> Takeover {
        Takeover {
            first,
            second,
            after,
            next: 0,
        }
    }
}

impl Controller for Takeover {
    fn brief(&mut self, briefing: &Briefing) {
        self.first.brief(briefing);
        self.second.brief(briefing);
    }

    fn reset(&mut self, seed: u64) {
        self.next = 0;
        self.first.reset(seed);
        self.second.reset(seed);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        // The second runs in every sample to build up its state. The first is
        // not needed any more after the takeover.
        let second = self.second.control(percept)?;
        let own = self.next < self.after;
        self.next += 1;
        if own {
            self.first.control(percept)
        } else {
            Ok(second)
        }
    }

    fn finish(&mut self) {
        self.first.finish();
        self.second.finish();
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(Takeover {
            first: self.first.fork()?,
            second: self.second.fork()?,
            ..*self
        }))
    }
}

/// Brakes fully and without delay.
///
/// Only the car's own lag lies between its command and the deceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FullBrake {
    /// Commanded deceleration.
    pub brake_mps2: f64,
}

impl Controller for FullBrake {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(-self.brake_mps2))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(*self))
    }
}
