//! Choice of the start of an episode: a fresh start, or a failed start.
//!
//! Failed-start replay repeats the start of a failed episode in a share of the
//! episodes, so that hard starts are trained more often. A start is an episode
//! index, from which the environment always makes the same start.

use super::bundle::{BundleError, TensorFile};
use super::dice::LearnerRng;
use super::replay::check;

/// Start to play.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct EpisodeStart {
    /// Episode index with which to reset the environment.
    pub index: u64,
    /// Number of retries.
    tries: u32,
}

impl EpisodeStart {
    /// Creates a start that is not retried if it fails.
    pub(super) fn once(index: u64) -> EpisodeStart {
        // More tries than any pool allows, so a failure does not put it there.
        let tries = u32::MAX;
        EpisodeStart { index, tries }
    }
}

/// Fresh starts in order, and a pool of failed starts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StartPool {
    restart: f64,
    capacity: usize,
    tries: u32,
    fresh: u64,
    pool: Vec<EpisodeStart>,
}

impl StartPool {
    /// Creates the choice with an empty pool.
    ///
    /// A failed start is chosen with probability `restart`. The pool contains at most
    /// `capacity` starts, each retried at most `tries` times.
    pub(super) fn new(restart: f64, capacity: usize, tries: u32) -> StartPool {
        StartPool {
            restart,
            capacity,
            tries,
            fresh: 0,
            pool: Vec::new(),
        }
    }

    /// Returns the next start, taken out of the pool or fresh.
    pub(super) fn pick(&mut self, dice: &mut LearnerRng) -> EpisodeStart {
        if dice.unit() < self.restart && !self.pool.is_empty() {
            // Not `swap_remove`: the order of the pool is the age of its starts.
            let start = self.pool.remove(dice.below(self.pool.len()));
            return EpisodeStart {
                tries: start.tries.saturating_add(1),
                ..start
            };
        }
        self.fresh += 1;
        EpisodeStart {
            index: self.fresh - 1,
            tries: 0,
        }
    }

    /// Puts a start into the pool, unless its retries are used up.
    ///
    /// A full pool drops its oldest start.
    pub(super) fn failed(&mut self, start: EpisodeStart) {
        if self.tries <= start.tries {
            return;
        }
        if self.pool.len() == self.capacity {
            // The oldest start goes, because the policy has changed most since it failed.
            self.pool.remove(0);
        }
        self.pool.push(start);
    }

    /// Writes the pool into a checkpoint.
    pub(super) fn save(&self, bundle: &mut TensorFile) {
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
    /// A tensor is missing or misshapen, or the pool is too large.
    pub(super) fn restore(&mut self, bundle: &TensorFile) -> Result<(), BundleError> {
        let indices = bundle.rows::<u64>("starts/failed", &[])?;
        let tries = bundle.get::<u32>("starts/tries", &[indices.len()])?;
        // A damaged count would otherwise allocate without a limit.
        check("number of failed starts", indices.len(), self.capacity + 1)?;
        let pairs = indices.iter().zip(tries);
        self.pool = pairs
            .map(|(&index, &tries)| EpisodeStart { index, tries })
            .collect();
        self.fresh = bundle.one("starts/fresh")?;
        Ok(())
    }
}
