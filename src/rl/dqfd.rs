//! Deep Q-learning from demonstrations: what a search of the training starts
//! found is shown before the first episode, and every success after it is kept.
//!
//! - Hester et al., "Deep Q-learning from Demonstrations", AAAI 2018.
//!
//! What exploration alone meets once in ten thousand episodes, a search of a few
//! hundred starts finds in seconds; what a search cannot do, act on a new start
//! at once, is what is learned. All numbers that are not named here are those of
//! [`super::dqn`].

use serde::{Deserialize, Serialize};

use super::Spaces;
use super::bundle::Bundle;
use super::demonstrations::Imitation;
use super::dqn::{self, Dqn, DqnSettings};
use super::kind::{Built, Kind, Shaped};
use super::learner::{ConfigError, Learner, within};
use super::seeding::Seeding;

/// The kind of a checkpoint; policies are those of [`super::dqn`].
const CHECKPOINT: &str = "brakecheck dqfd checkpoint 1";
const KINDS: [&str; 2] = [dqn::POLICY, CHECKPOINT];

/// Settings of deep Q-learning from demonstrations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "DqfdConfig", deny_unknown_fields, default)]
pub struct DqfdSettings {
    /// Decisions to train for (160000).
    pub decisions: u64,
    /// How many times that it may take where it has not learned its world by then
    /// (2); `--decisions` sets it to 1.
    pub longest: f64,
    /// Widths of the hidden ReLU layers ([96, 96, 96]): narrower ones blur the
    /// sharp edges between starts.
    pub hidden: Vec<usize>,
    /// What is done with successes.
    pub imitation: Imitation,
    /// How the first ones are found.
    pub seeding: Seeding,
}

impl Default for DqfdSettings {
    fn default() -> Self {
        DqfdSettings {
            decisions: 160_000,
            longest: 2.0,
            hidden: vec![96, 96, 96],
            imitation: Imitation::default(),
            seeding: Seeding::default(),
        }
    }
}

impl DqfdSettings {
    fn dqn(&self) -> DqnSettings {
        DqnSettings {
            decisions: self.decisions,
            hidden: self.hidden.clone(),
            ..DqnSettings::default()
        }
    }

    fn around(&self, dqn: Dqn) -> Dqn {
        dqn.learning_from(&self.imitation, KINDS)
    }
}

impl Kind for DqfdSettings {
    fn bundles(&self) -> [&'static str; 2] {
        KINDS
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.dqn().check()?;
        self.imitation.check()?;
        within("longest", self.longest, 1.0, 100.0)?;
        within("starts", self.seeding.starts as f64, 0.0, 1e6)?;
        within("simulations", self.seeding.simulations as f64, 0.0, 1e12)
    }

    fn discount(&self) -> f64 {
        self.dqn().discount
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        Box::new(self.around(Dqn::new(&self.dqn(), spaces, seed)))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &Bundle) -> Built {
        let dqn = Dqn::from_policy(&self.dqn(), spaces, seed, policy)?;
        Ok(Box::new(self.around(dqn)))
    }

    fn restore(&self, spaces: &Spaces, checkpoint: &Bundle) -> Built {
        let dqn = Dqn::restored(&self.dqn(), spaces, checkpoint)?;
        Ok(Box::new(self.around(dqn).with_shown(checkpoint)?))
    }

    fn seeding(&self) -> Option<&Seeding> {
        Some(&self.seeding)
    }

    fn longest(&self) -> f64 {
        self.longest
    }

    fn fix(&mut self) {
        self.longest = 1.0;
    }

    fn load(&self, policy: &Bundle) -> Shaped {
        DqnSettings::default().load(policy)
    }
}
