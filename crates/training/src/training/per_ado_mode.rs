//! Training of a policy per ado, as an option of a training.

use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::rl::{ConfigError, LearnerConfig, LearnerSettings, PerAdoSettings, PerAdoTraining};
use crate::world::Scenario;

/// Turns of each ado in an alternating training.
const ROUNDS: u32 = 4;

/// Ados that learn from an episode, if each has a policy of its own.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr, EnumMessage,
)]
#[strum(serialize_all = "kebab-case")]
pub enum PerAdoMode {
    /// All of them: to each the others are a part of the world.
    Independent,
    /// One at a time, in turn: a best response to the others.
    Alternating,
}

impl PerAdoMode {
    /// Returns the mode with which a learner per ado is trained.
    ///
    /// `None` for one policy of all ados, and for turns that only a world file states.
    pub fn of(learner: &LearnerConfig) -> Option<PerAdoMode> {
        let LearnerSettings::PerAdo(each) = learner.clone().into() else {
            return None;
        };
        match each.training {
            PerAdoTraining::Independent => Some(PerAdoMode::Independent),
            PerAdoTraining::Alternating { rounds } => {
                // An option always means this number of turns, so it cannot
                // stand for another one.
                (rounds == ROUNDS).then_some(PerAdoMode::Alternating)
            }
        }
    }

    /// Returns the world with a learner per ado, each the world's own.
    pub(super) fn in_world(self, world: &Scenario) -> Result<Scenario, ConfigError> {
        let training = match self {
            PerAdoMode::Independent => PerAdoTraining::Independent,
            PerAdoMode::Alternating => PerAdoTraining::Alternating { rounds: ROUNDS },
        };
        let each = match world.learner.clone().into() {
            // The world may have such learners already, of which only the turns change.
            LearnerSettings::PerAdo(each) => PerAdoSettings { training, ..each },
            learner => PerAdoSettings {
                training,
                decisions: world.learner.decisions(),
                learner: Box::new(learner),
                ..PerAdoSettings::default()
            },
        };
        Ok(world.learning_with(LearnerConfig::new(each)?))
    }
}
