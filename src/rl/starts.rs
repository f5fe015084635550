//! Which start an episode begins from: a fresh one, or one that failed.
//!
//! Failed-start replay: part of the episodes begin again where the last
//! attempt failed, so that hard starts get more than their share. A start is
//! an episode index; the environment makes the same start of it every time.

use super::bundle::{Bundle, BundleError};
use super::dice::Dice;
use super::replay::check;

/// A start to play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Start {
    /// The episode index to reset the environment with.
    pub index: u64,
    /// How often it was tried again.
    tries: u32,
}

impl Start {
    /// One that is not tried again if it fails.
    pub fn once(index: u64) -> Start {
        let tries = u32::MAX;
        Start { index, tries }
    }
}

/// Fresh starts in order, and a pool of those that failed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Starts {
    restart: f64,
    capacity: usize,
    tries: u32,
    fresh: u64,
    pool: Vec<Start>,
}

impl Starts {
    /// With probability `restart` a failed start, out of at most `capacity`,
    /// each tried again at most `tries` times.
    pub fn new(restart: f64, capacity: usize, tries: u32) -> Starts {
        Starts {
            restart,
            capacity,
            tries,
            fresh: 0,
            pool: Vec::new(),
        }
    }

    /// The next start: taken out of the pool, or fresh.
    pub fn pick(&mut self, dice: &mut Dice) -> Start {
        if dice.unit() < self.restart && !self.pool.is_empty() {
            let start = self.pool.remove(dice.below(self.pool.len()));
            return Start {
                tries: start.tries + 1,
                ..start
            };
        }
        self.fresh += 1;
        Start {
            index: self.fresh - 1,
            tries: 0,
        }
    }

    /// Into the pool, unless it had its tries; the oldest makes room.
    pub fn failed(&mut self, start: Start) {
        if self.tries <= start.tries {
            return;
        }
        if self.pool.len() == self.capacity {
            self.pool.remove(0);
        }
        self.pool.push(start);
    }

    /// Writes the pool into a checkpoint.
    pub fn save(&self, bundle: &mut Bundle) {
        let n = self.pool.len();
        bundle.put("starts/fresh", &[1], vec![self.fresh]);
        bundle.put(
            "starts/failed",
            &[n],
            self.pool.iter().map(|s| s.index).collect(),
        );
        bundle.put(
            "starts/tries",
            &[n],
            self.pool.iter().map(|s| s.tries).collect(),
        );
    }

    /// Fills the pool from a checkpoint.
    ///
    /// # Errors
    /// When a tensor is missing or misshapen, or the pool too large.
    pub fn restore(&mut self, bundle: &Bundle) -> Result<(), BundleError> {
        let indices = bundle.rows::<u64>("starts/failed", &[])?;
        let tries = bundle.get::<u32>("starts/tries", &[indices.len()])?;
        check("number of failed starts", indices.len(), self.capacity + 1)?;
        let pairs = indices.iter().zip(tries);
        self.pool = pairs
            .map(|(&index, &tries)| Start { index, tries })
            .collect();
        self.fresh = bundle.one("starts/fresh")?;
        Ok(())
    }
}
