//! Cost of a training, a search or an evaluation.

use serde::{Deserialize, Serialize};

use crate::run_dir::Manifest;

/// Cost of some work, once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Episodes run.
    pub simulations: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
}

impl Cost {
    /// Returns the cost of a run's training, with the searches that belong to it.
    pub fn of_training(manifest: &Manifest) -> Cost {
        Cost {
            simulations: manifest.episodes
                + manifest.sought.map_or(0, |sought| sought.simulations)
                + manifest
                    .calibration
                    .map_or(0, |calibration| calibration.simulations),
            // The steps of the search are among those of the manifest already.
            physics_steps: manifest.physics_steps,
            cpu_s: manifest.cpu_s,
        }
    }
}
