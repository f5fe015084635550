//! Content of `train_against` in a world file, for serde.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::rl::{DqnSettings, LearnerSettings};
use crate::ron_file::Ordered;
use crate::sim::PlantKind;

/// Default probability with which a quantity of a member is nominal.
const NOMINAL: f64 = 0.6;

/// Family of egos of a world file.
#[derive(Deserialize)]
#[serde(rename = "Family", deny_unknown_fields)]
pub(super) struct FamilyFile {
    #[serde(default)]
    pub(super) ego: Ordered<(f64, f64)>,
    #[serde(default)]
    pub(super) delay_s: Option<(f64, f64)>,
    #[serde(default)]
    pub(super) position_sd_m: Option<(f64, f64)>,
    #[serde(default)]
    pub(super) speed_sd_mps: Option<(f64, f64)>,
    #[serde(default)]
    pub(super) friction: Option<(f64, f64)>,
    /// Egos of other structures, each drawn as often as the world's own.
    ///
    /// Keys are names under `reuse`, and values are ranges over the parameters
    /// of their controllers.
    #[serde(default)]
    pub(super) structures: Ordered<Ordered<(f64, f64)>>,
    /// Weights of the plants, out of the sum of all weights.
    #[serde(default)]
    pub(super) plants: Option<BTreeMap<PlantName, u32>>,
    /// Probability with which a quantity is nominal.
    #[serde(default = "nominal")]
    pub(super) nominal: f64,
    #[serde(default = "patient")]
    pub(super) wide: LearnerSettings,
}

/// Plant as a key of a map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
pub(super) enum PlantName {
    Rigid,
    Kinematic,
}

impl From<PlantName> for PlantKind {
    fn from(name: PlantName) -> PlantKind {
        match name {
            PlantName::Rigid => PlantKind::Rigid,
            PlantName::Kinematic => PlantKind::Kinematic,
        }
    }
}

fn nominal() -> f64 {
    NOMINAL
}

/// Default learner against a family.
///
/// It trains longer than the default of a single ego, explores for a smaller
/// share of the training, and takes smaller steps.
fn patient() -> LearnerSettings {
    LearnerSettings::Dqn(DqnSettings {
        decisions: 3_000_000,
        exploration_fraction: 0.05,
        learning_rate: 5e-4,
        ..DqnSettings::default()
    })
}
