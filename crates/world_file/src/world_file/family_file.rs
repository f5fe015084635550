//! Content of `train_against` in a world file, for serde.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::default_field::is_default;
use crate::rl::{DqnSettings, LearnerSettings};
use crate::ron_file::Ordered;
use crate::sim::PlantKind;

/// Default probability with which a quantity of a member is nominal.
// Mean recall of a wide ado on 14 egos of `acc`: 0.78, 0.83, 0.87 and 0.86 with 0.2, 0.4, 0.6
// and 0.75.
const NOMINAL: f64 = 0.6;

/// Family of egos of a world file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Family", deny_unknown_fields)]
pub struct FamilyFile {
    /// Ranges of the controller's parameters, by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub ego: Ordered<(f64, f64)>,
    /// Range of the delay of percepts, s. Default: that of the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<(f64, f64)>,
    /// Range of the standard deviation of positions, m. Default: that of the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_sd_m: Option<(f64, f64)>,
    /// Range of the standard deviation of speeds, m/s. Default: that of the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_sd_mps: Option<(f64, f64)>,
    /// Range of the friction. Default: that of the world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<(f64, f64)>,
    /// Egos of other structures, each drawn as often as the world's own.
    ///
    /// Keys are names under `reuse`, and values are ranges over the parameters
    /// of their controllers. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub structures: Ordered<Ordered<(f64, f64)>>,
    /// Weights of the plants, out of the sum of all weights. Default: the world's plant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "plant_weights")]
    pub plants: Option<BTreeMap<PlantName, u32>>,
    /// Probability with which a quantity is nominal. Default: 0.6.
    #[serde(default = "nominal")]
    pub nominal: f64,
    /// Learner against the family. Default: `Dqn` that trains longer than usual.
    #[serde(default = "patient")]
    pub wide: LearnerSettings,
}

/// Plant as a key of a map.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
pub enum PlantName {
    /// 3D rigid bodies on rapier3d.
    Rigid,
    /// 2D, closed form.
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

/// Schema of weights by plant, whose keys schemars would leave open.
fn plant_weights(generator: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": ["object", "null"],
        "propertyNames": generator.subschema_for::<PlantName>(),
        "additionalProperties": generator.subschema_for::<u32>(),
    })
}

fn nominal() -> f64 {
    NOMINAL
}

/// Default learner against a family.
///
/// It trains longer than the default of a single ego, explores for a smaller
/// share of the training, and takes smaller steps.
// Random actions succeed in one of a hundred episodes of `merge`. With exploration in a quarter
// of a training, 0.00, 0.20 and 0.41 of the last episodes succeeded, with 0.05 mostly 0.42 to
// 0.47. Steps of 1e-3 made one of three long trainings collapse.
fn patient() -> LearnerSettings {
    LearnerSettings::Dqn(DqnSettings {
        decisions: 3_000_000,
        exploration_fraction: 0.05,
        learning_rate: 5e-4,
        ..DqnSettings::default()
    })
}
