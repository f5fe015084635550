//! Changes of worlds: content of `reuse` and `--ego FILE`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ego::{Actuated, ControllerSpec};
use crate::ron_file::Patch;
use crate::scene::drive::Sensors;
use crate::scene::grid::{AtWall, Horizon, Starts};
use crate::sim::PlantKind;

/// Change of a world: content of `reuse` and `--ego FILE`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Change", deny_unknown_fields, default)]
pub struct Change {
    /// Parameters of the ego's controller by name.
    pub ego: Patch,
    /// Other controller, with its actuator.
    pub controller: Option<Actuated<ControllerSpec>>,
    /// Other body of the ego.
    pub ego_body: Option<String>,
    /// Other road surface.
    pub friction: Option<f64>,
    /// Other plant.
    pub plant: Option<PlantKind>,
    /// Other sensors of the ego.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensors: Option<Sensors>,
    /// Other map. Grid worlds accept no other change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridChange>,
}

/// Change of a grid world, as in its `reuse`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Change", deny_unknown_fields, default)]
// Both kinds of worlds write `Change(…)`, and a schema needs two names for them.
#[schemars(rename = "GridChange")]
pub struct GridChange {
    /// n: cells along each side.
    pub size: Option<u32>,
    /// ε: fine cells along each cell.
    pub refine: Option<u32>,
    /// k: fine cells per step of the ego.
    pub ego_step: Option<u32>,
    /// Behaviour of the ego at a wall.
    pub at_wall: Option<AtWall>,
    /// K: horizon in steps.
    pub horizon: Option<Horizon>,
    /// X_init.
    pub starts: Option<Starts>,
}

impl From<GridChange> for Change {
    fn from(grid: GridChange) -> Change {
        Change {
            grid: Some(grid),
            ..Change::default()
        }
    }
}
