//! Another driver takes over at some sample: for asking what would have helped.

use super::{Briefing, Command, Controller, Fault, Percept};

/// One controller up to a sample, another one from it on.
///
/// Both perceive everything from the beginning, so that the second one knows
/// what it would have seen; only one of them is obeyed.
pub struct Takeover {
    first: Box<dyn Controller>,
    second: Box<dyn Controller>,
    /// Commands of the first one that are obeyed.
    after: usize,
    next: usize,
}

impl Takeover {
    /// Obeys `first` for `after` samples, then `second`.
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
        let second = self.second.control(percept)?;
        let own = self.next < self.after;
        self.next += 1;
        match own {
            true => self.first.control(percept),
            false => Ok(second),
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

/// Brakes with all the road gives, without delay: only the car's own lag is
/// between its wish and the deceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FullBrake {
    /// Deceleration that is asked for.
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
