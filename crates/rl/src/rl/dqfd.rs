//! Deep Q-learning from demonstrations.
//!
//! - Hester et al., "Deep Q-learning from Demonstrations", AAAI 2018.
//!
//! A search of a few hundred training starts runs before the first episode. It
//! finds in seconds the successes that exploration hits once in ten thousand
//! episodes. Every later success is kept as well. Learning adds the part that a
//! search cannot do, an immediate action on a new start. All hyperparameters not
//! named here are those of [`super::dqn`].

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Spaces;
use super::bundle::TensorFile;
use super::demonstrations::Imitation;
use super::dqn::{self, Dqn, DqnSettings};
use super::learner::{Built, ConfigError, Learner, LearnerKind, Seeding, Shaped, within};

/// Kind of a checkpoint. Policies are of the kind of [`super::dqn`].
const CHECKPOINT: &str = "brakecheck dqfd checkpoint 1";
const KINDS: [&str; 2] = [dqn::POLICY, CHECKPOINT];

/// Settings of deep Q-learning from demonstrations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "DqfdConfig", deny_unknown_fields, default)]
pub struct DqfdSettings {
    /// Decisions to train for (160000).
    pub decisions: u64,
    /// Factor on `decisions` up to which an unsuccessful training goes on (4).
    ///
    /// `--decisions` sets it to 1.
    pub longest: f64,
    /// Widths of the hidden ReLU layers ([96, 96, 96]).
    ///
    /// Narrower layers blur the sharp edges between starts.
    pub hidden: Vec<usize>,
    /// Decisions between updates (2).
    #[serde(skip_serializing_if = "is_default_spacing")]
    pub update_every: u64,
    /// Use of successes.
    pub imitation: Imitation,
    /// Search for the first successes.
    pub seeding: Seeding,
}

/// Leaves the setting out of the text where it changes nothing, as earlier versions did.
// Settings of earlier runs lack the field, and are compared with those of today.
fn is_default_spacing(update_every: &u64) -> bool {
    *update_every == DqnSettings::default().update_every
}

impl Default for DqfdSettings {
    fn default() -> Self {
        DqfdSettings {
            decisions: 160_000,
            longest: 4.0,
            hidden: vec![96, 96, 96],
            update_every: DqnSettings::default().update_every,
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
            update_every: self.update_every,
            ..DqnSettings::default()
        }
    }

    fn around(&self, dqn: Dqn) -> Dqn {
        dqn.learning_from(&self.imitation, KINDS)
    }
}

impl LearnerKind for DqfdSettings {
    fn bundles(&self) -> [&'static str; 2] {
        KINDS
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.dqn().check()?;
        self.imitation.check()?;
        within("longest", self.longest, 1.0, 100.0)?;
        within("starts", self.seeding.starts as f64, 0.0, 1e6)?;
        // Zero of either is allowed: such a learner begins without demonstrations.
        within("simulations", self.seeding.simulations as f64, 0.0, 1e12)
    }

    fn space_updates(&mut self, times: u64) {
        // Saturating, because a file may state any spacing.
        self.update_every = self.update_every.saturating_mul(times);
    }

    fn discount(&self) -> f64 {
        self.dqn().discount
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        Box::new(self.around(Dqn::new(&self.dqn(), spaces, seed)))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        let dqn = Dqn::from_policy(&self.dqn(), spaces, seed, policy)?;
        Ok(Box::new(self.around(dqn)))
    }

    fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built {
        let dqn = Dqn::restored(&self.dqn(), spaces, checkpoint)?;
        // The successes are those of the checkpoint, so a resumed training goes on alike.
        Ok(Box::new(self.around(dqn).with_shown(checkpoint)?))
    }

    fn seeding(&self) -> Option<&Seeding> {
        Some(&self.seeding)
    }

    fn longest(&self) -> f64 {
        self.longest
    }

    // An explicit number of decisions is a budget, so no extension applies.
    fn fix(&mut self) {
        self.longest = 1.0;
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        // Both learners act by the same network, so one reader suffices.
        DqnSettings::default().load(policy)
    }
}
