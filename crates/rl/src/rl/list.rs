//! List of learners, with their names, configuration, building and loading.
//!
//! A new learner is one module beside this one, whose settings implement
//! `learner::LearnerKind`, and one line in the list.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bundle::{BundleError, TensorFile};
use super::learner::{
    Built, ConfigError, Learner, LearnerKind, Seeding, Shaped, expect_kind, expect_sizes, within,
};
use super::{
    DqfdSettings, DqnSettings, PartSpaces, Policy, PpoSettings, QTableSettings, Spaces,
    TrafficSettings,
};

// A macro, so that a learner is one line and no match below can forget it.
macro_rules! learners {
    ($($(#[doc = $doc:literal])+ $(#[cfg($when:meta)])? $name:ident($settings:ty),)+) => {
        /// Settings of a learner as written, to be checked by [`LearnerConfig::new`].
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub enum LearnerSettings {
            $($(#[doc = $doc])+ $(#[cfg($when)])? $name($settings),)+
        }

        $($(#[cfg($when)])? impl From<$settings> for LearnerSettings {
            fn from(settings: $settings) -> LearnerSettings {
                LearnerSettings::$name(settings)
            }
        })+

        impl LearnerSettings {
            /// Returns every learner with its defaults.
            pub fn all() -> Vec<LearnerSettings> {
                [$($(#[cfg($when)])? <$settings>::default().into(),)+].into()
            }

            /// Returns the name of the learner, as in a world file.
            pub fn name(&self) -> &'static str {
                match self {
                    $($(#[cfg($when)])? LearnerSettings::$name(_) => stringify!($name),)+
                }
            }

            pub(super) fn kind(&self) -> &dyn LearnerKind {
                match self {
                    $($(#[cfg($when)])? LearnerSettings::$name(settings) => settings,)+
                }
            }

            pub(super) fn kind_mut(&mut self) -> &mut dyn LearnerKind {
                match self {
                    $($(#[cfg($when)])? LearnerSettings::$name(settings) => settings,)+
                }
            }

            fn decisions(&self) -> u64 {
                match self {
                    $($(#[cfg($when)])? LearnerSettings::$name(own) => own.decisions,)+
                }
            }

            /// Sets exactly this number of decisions, without extensions.
            pub(super) fn fix(&mut self, decisions: u64) {
                match self {
                    $($(#[cfg($when)])? LearnerSettings::$name(own) => {
                        own.decisions = decisions;
                        own.fix();
                    })+
                }
            }
        }
    };
}

learners! {
    /// Deep Q-learning that starts from the results of a search, the default.
    Dqfd(DqfdSettings),
    /// Deep Q-learning without demonstrations.
    Dqn(DqnSettings),
    /// Tabular Q-learning, for small or binned worlds.
    QTable(QTableSettings),
    /// Proximal policy optimisation.
    Ppo(PpoSettings),
    /// A learner per ado, for worlds with several.
    PerAdo(PerAdoSettings),
    /// The traffic that fails the ego, as `train --traffic` trains it.
    Traffic(TrafficSettings),
    /// Example learner that repeats the most rewarded action.
    #[cfg(test)]
    Paid(super::example_learner::PaidSettings),
}

/// Which ados learn from an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum PerAdoTraining {
    /// All of them, each from its own reward.
    #[default]
    Independent,
    /// One at a time, in turn: a best response to the others.
    Alternating {
        /// Turns of each ado.
        rounds: u32,
    },
}

/// Signals that each ado observes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum PerAdoObservation {
    /// Those of all ados, as a common learner.
    #[default]
    Shared,
    /// Those that it lists itself, so that its policy can act without the others.
    Own,
}

/// Settings of a learner per ado.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "PerAdoConfig", deny_unknown_fields, default)]
pub struct PerAdoSettings {
    /// Decisions to train for (160000).
    pub decisions: u64,
    /// Factor on `decisions` up to which an unsuccessful training goes on (4).
    ///
    /// `--decisions` sets it to 1.
    pub longest: f64,
    /// Which ados learn from an episode (all: `Independent`).
    pub training: PerAdoTraining,
    /// Signals that each ado observes (`Shared`).
    pub observe: PerAdoObservation,
    /// Learner of every ado that `ados` leaves out (`Dqfd()`).
    pub learner: Box<LearnerSettings>,
    /// Learners of ados, by name.
    pub ados: BTreeMap<String, LearnerSettings>,
    /// Share of the episodes that begin along a success (0.2).
    pub guided: f64,
    /// Successes kept for guidance (5000).
    pub remembered: usize,
    /// Search for the first successes.
    pub seeding: Seeding,
}

impl Default for PerAdoSettings {
    fn default() -> Self {
        PerAdoSettings {
            decisions: 160_000,
            longest: 4.0,
            training: PerAdoTraining::default(),
            observe: PerAdoObservation::default(),
            learner: Box::new(LearnerSettings::Dqfd(DqfdSettings::default())),
            ados: BTreeMap::new(),
            guided: 0.2,
            remembered: 5000,
            seeding: Seeding::default(),
        }
    }
}

impl PerAdoSettings {
    /// Returns the settings of an ado's learner, for its share of the training.
    ///
    /// Its updates are spaced so that all of `ados` together make as many as a common
    /// learner.
    pub(super) fn learner_of(&self, part: &PartSpaces, ados: usize) -> LearnerSettings {
        let mut own = self.ados.get(&part.name).unwrap_or(&self.learner).clone();
        // Every learner takes part in each decision, so all have the whole number.
        own.fix(self.decisions);
        own.kind_mut().space_updates(ados as u64);
        own
    }

    /// Returns the ados of a world, or one that takes all its actions.
    pub(super) fn parts_of(&self, spaces: &Spaces) -> Vec<PartSpaces> {
        let all: Vec<usize> = (0..spaces.observation).collect();
        let mut parts = spaces.parts.clone();
        if parts.is_empty() {
            parts.push(PartSpaces {
                name: "ado".to_owned(),
                actions: spaces.actions,
                neutral: spaces.neutral,
                observed: all.clone(),
            });
        }
        // `Shared` shows each ado the joint observation, in its order.
        if self.observe == PerAdoObservation::Shared {
            for part in &mut parts {
                part.observed.clone_from(&all);
            }
        }
        parts
    }
}

impl Default for LearnerSettings {
    fn default() -> Self {
        LearnerSettings::Dqfd(DqfdSettings::default())
    }
}

/// Learner with every hyperparameter, each within its bounds.
///
/// ```
/// # use brakecheck_rl as brakecheck;
/// use brakecheck::rl::{DqnSettings, LearnerConfig};
///
/// let learner = LearnerConfig::new(DqnSettings {
///     decisions: 50_000,
///     ..DqnSettings::default()
/// })?;
/// assert_eq!((learner.name(), learner.decisions()), ("Dqn", 50_000));
///
/// let no_layers = DqnSettings { hidden: vec![], ..DqnSettings::default() };
/// let error = LearnerConfig::new(no_layers).unwrap_err();
/// assert_eq!(error.to_string(), "learner field `hidden` is 0; give a number from 1 to 8");
/// # Ok::<(), brakecheck::rl::ConfigError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "LearnerSettings", into = "LearnerSettings")]
pub struct LearnerConfig(LearnerSettings);

impl TryFrom<LearnerSettings> for LearnerConfig {
    type Error = ConfigError;

    fn try_from(settings: LearnerSettings) -> Result<LearnerConfig, ConfigError> {
        // `decisions` is common to all learners, so it is checked here and not by each.
        within("decisions", settings.decisions() as f64, 1.0, 1e12)?;
        settings.kind().check()?;
        Ok(LearnerConfig(settings))
    }
}

impl From<LearnerConfig> for LearnerSettings {
    fn from(config: LearnerConfig) -> LearnerSettings {
        config.0
    }
}

impl LearnerConfig {
    /// Checks every setting of a learner.
    ///
    /// # Errors
    /// The first field out of range, with its valid range.
    pub fn new(settings: impl Into<LearnerSettings>) -> Result<LearnerConfig, ConfigError> {
        settings.into().try_into()
    }

    /// Returns the number of decisions to train for.
    pub fn decisions(&self) -> u64 {
        self.0.decisions()
    }

    /// Returns the number of decisions after which any training ends.
    ///
    /// It exceeds [`LearnerConfig::decisions`] for learners that extend a training
    /// that has not learned its world.
    pub fn longest(&self) -> u64 {
        (self.0.kind().longest() * self.decisions() as f64) as u64
    }

    /// Returns the configuration for exactly this number of decisions.
    ///
    /// # Errors
    /// The number is 0 or above 10¹².
    pub fn with_decisions(mut self, decisions: u64) -> Result<LearnerConfig, ConfigError> {
        // A number that the user gives is exact, without an extension.
        self.0.fix(decisions);
        self.0.try_into()
    }

    /// Returns the name of the learner, as in a world file.
    pub fn name(&self) -> &'static str {
        self.0.name()
    }

    /// Returns whether it learns a policy per ado.
    pub fn is_per_ado(&self) -> bool {
        matches!(self.0, LearnerSettings::PerAdo(_))
    }

    /// Returns the settings of a learner of traffic that fails. `None` for another learner.
    pub fn as_traffic(&self) -> Option<&TrafficSettings> {
        match &self.0 {
            LearnerSettings::Traffic(settings) => Some(settings),
            _ => None,
        }
    }

    /// Discount γ: a reward after t decisions counts γ^t times.
    pub fn discount(&self) -> f64 {
        self.0.kind().discount()
    }

    /// Search for demonstrations before the training, `None` for no search.
    pub fn seeding(&self) -> Option<&Seeding> {
        self.0.kind().seeding()
    }

    /// Creates an untrained learner. Equal seeds learn equally.
    pub fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        self.0.kind().build(spaces, seed)
    }

    /// Creates a learner that starts from a kept policy (fine-tuning).
    ///
    /// # Errors
    /// The policy is of another learner, or has other shapes.
    pub fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        let kind = self.0.kind();
        // Here once, so that no learner has to compare kinds.
        expect_kind(policy, kind.bundles()[0])?;
        kind.build_from(spaces, seed, policy)
    }

    /// Restores a learner from a checkpoint.
    ///
    /// # Errors
    /// The checkpoint is of another learner, or has other shapes.
    pub fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built {
        let kind = self.0.kind();
        expect_kind(checkpoint, kind.bundles()[1])?;
        kind.restore(spaces, checkpoint)
    }
}

/// Creates a learner that fine-tunes a kept policy of deep Q-learning.
///
/// It takes small steps for `decisions` decisions. Returns `None` if the policy
/// is of another learner or has other shapes.
pub fn fine_tuner(
    spaces: &Spaces,
    decisions: u64,
    seed: u64,
    policy: &TensorFile,
) -> Option<Box<dyn Learner>> {
    let settings = DqnSettings::fine_tuning(decisions);
    // Both deep Q-learners keep a network of Q values.
    let kinds = [settings.bundles(), DqfdSettings::default().bundles()];
    let is_of_q = kinds.iter().any(|[kept, _]| *kept == policy.meta());
    let learner = is_of_q.then(|| settings.build_from(spaces, seed, policy));
    learner?.ok()
}

/// Loads the policy of any learner from a bundle.
///
/// [`Learner::policy_bundle`] writes such a bundle.
///
/// # Errors
/// The bundle is not a policy, or its shapes do not fit each other.
pub fn load_policy(bundle: &TensorFile) -> Result<Box<dyn Policy>, BundleError> {
    Ok(load_shaped(bundle)?.0)
}

/// Loads the policy of any learner, for a world with these spaces.
///
/// # Errors
/// The bundle is not a policy, or is for other observations or actions.
pub fn load_policy_for(
    spaces: &Spaces,
    bundle: &TensorFile,
) -> Result<Box<dyn Policy>, BundleError> {
    let (policy, shape) = load_shaped(bundle)?;
    let expected = [spaces.observation, spaces.actions];
    expect_sizes("the policy's observation and actions", &shape, &expected)?;
    Ok(policy)
}

pub(super) fn load_shaped(bundle: &TensorFile) -> Shaped {
    // Of the defaults only the kinds of their bundles are read.
    let all = LearnerSettings::all();
    let policy = |learner: &LearnerSettings| learner.kind().bundles()[0];
    // `Dqfd` and `Dqn` share a kind of policy and its loader, so the first match
    // serves both.
    match all.iter().find(|learner| policy(learner) == bundle.meta()) {
        Some(learner) => learner.kind().load(bundle),
        None => {
            let known: Vec<String> = all.iter().map(|one| format!("`{}`", policy(one))).collect();
            Err(BundleError::Mismatch {
                what: "the kind of the bundle",
                expected: format!("one of {}", known.join(", ")),
                found: format!("`{}`", bundle.meta()),
            })
        }
    }
}
