//! Error of a training that cannot begin, continue or end.

use super::bank::BankError;
use super::train_loop::TrainError;
use crate::experiment::EgoError;
use crate::risk::{RiskTrafficError, TrafficTrainingError};
use crate::rl::ConfigError;
use crate::ron_file::guessed;
use crate::run_dir::{KeptError, RunError};
use crate::world::ChangeError;

/// Error of a training that cannot begin, continue or end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// World without an ado.
    #[error("no agent of `{world}` is an ado, so there is nothing to train")]
    NoAdo {
        /// Name of the world.
        world: String,
    },
    /// Learner that the world does not name.
    #[error("`{world}` has no learner `{learner}`")]
    NoLearner {
        /// Name of the world.
        world: String,
        /// Requested learner.
        learner: String,
        /// Learners that the world names.
        known: Vec<String>,
    },
    /// World without a family of egos.
    #[error("`{world}` names no family of egos")]
    NoFamily {
        /// Name of the world.
        world: String,
    },
    /// Structure that the family does not have.
    #[error("the family of `{world}` has no structure `{structure}`")]
    NoStructure {
        /// Name of the world.
        world: String,
        /// Requested structure.
        structure: String,
        /// Structures of the family.
        known: Vec<String>,
    },
    /// Options that exclude each other.
    #[error("{0}")]
    Options(OptionClash),
    /// Run against a controller that is in no file.
    #[error("the run was begun against `{ego}`, which is in no file")]
    EgoInNoFile {
        /// Name of the controller.
        ego: String,
    },
    /// Goals that the world cannot have.
    #[error("{}", .0.what)]
    Goals(ChangeError),
    /// Traffic that the world declares and that cannot be read.
    #[error(transparent)]
    Declared(#[from] RiskTrafficError),
    /// Ados that cannot be trained as traffic.
    #[error(transparent)]
    Traffic(#[from] TrafficTrainingError),
    /// Bank of episodes that cannot be used.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// Ego that cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// Run directory that cannot be read, written or resumed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Training that cannot continue.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Settings of a learner out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Counterexamples that cannot be kept.
    #[error(transparent)]
    Kept(#[from] KeptError),
}

/// Options of a training that exclude each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionClash {
    /// Structure to leave out without a family.
    #[error("`--leave-out` requires `--against wide`")]
    LeaveOut,
    /// Family beside one of its egos.
    #[error("`--against` trains on a family of egos, `--ego` on one of them")]
    FamilyAndEgo,
    /// Family beside a learner of the world.
    #[error("`--learner` and `--per-ado` are for training against the nominal ego")]
    FamilyAndLearner,
    /// Family beside a plant.
    #[error("`--plant` is for training against one ego")]
    FamilyAndPlant,
    /// Traffic beside another learner, or beside goals.
    #[error("`--traffic` brings the learner, and a law has no goals")]
    TrafficAndLearner,
    /// Traffic beside a family or a population.
    #[error("`--traffic` trains one ado against one ego")]
    TrafficAndMany,
    /// Temperature without traffic.
    #[error("`--temperature` requires `--traffic`")]
    Temperature,
    /// Power of a law without traffic.
    #[error("`--prior` requires `--traffic`")]
    Prior,
    /// All egos at once.
    #[error("`--ego all` names many egos, and an ado is trained against one")]
    AllEgos,
}

impl OptionClash {
    /// Returns the fix.
    pub fn help(self) -> &'static str {
        match self {
            OptionClash::LeaveOut => "add `--against wide`, or leave out `--leave-out`",
            OptionClash::FamilyAndEgo => "leave out one of the two",
            OptionClash::FamilyAndLearner => "leave it out: a family names its own learner, `wide`",
            OptionClash::FamilyAndPlant => {
                "leave it out: a family names its plants under `train_against`"
            }
            OptionClash::TrafficAndLearner => {
                "leave out `--learner`, `--per-ado` and `--goal`, or `--traffic`"
            }
            OptionClash::TrafficAndMany => {
                "leave out `--against`, `--distinct` and `--league`, or `--traffic`"
            }
            OptionClash::Temperature => {
                "name declared traffic, or draw the actions of an evaluation: `eval --temperature`"
            }
            OptionClash::Prior => "name declared traffic, whose law it weakens",
            OptionClash::AllEgos => "name one of them; `--against wide` trains against a family",
        }
    }
}

impl SessionError {
    /// Returns the fix. `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        let guess = |requested: &str, known: &[String]| {
            guessed(requested, "known", known.iter().map(String::as_str))
        };
        Some(match self {
            SessionError::NoAdo { .. } => {
                "give one agent `drive: Ado(actions: …, rulebook: […])`, or ask `search` which \
                 starts the ego passes"
                    .to_owned()
            }
            SessionError::NoLearner { known, .. } if known.is_empty() => {
                "it names none under `learners`: leave out `--learner`".to_owned()
            }
            SessionError::NoLearner { learner, known, .. } => {
                format!("{}; or leave out `--learner`", guess(learner, known))
            }
            SessionError::NoFamily { .. } => {
                "add `train_against: Family(ego: { … })` to the world: docs/guide/reuse.md"
                    .to_owned()
            }
            SessionError::NoStructure { known, .. } if known.is_empty() => {
                "name some under `structures` of `train_against`: docs/guide/adapting.md".to_owned()
            }
            SessionError::NoStructure {
                structure, known, ..
            } => guess(structure, known),
            SessionError::Options(clash) => clash.help().to_owned(),
            SessionError::EgoInNoFile { .. } => {
                "go on with it from where it was begun, with that controller as the ego".to_owned()
            }
            SessionError::Goals(error) => return error.help.clone(),
            SessionError::Ego(error) => return error.help(),
            SessionError::Traffic(error) => return error.help().map(str::to_owned),
            SessionError::Declared(_)
            | SessionError::Run(_)
            | SessionError::Train(_)
            | SessionError::Config(_)
            | SessionError::Kept(_) => return None,
            SessionError::Bank(error) => return error.help(),
        })
    }
}
