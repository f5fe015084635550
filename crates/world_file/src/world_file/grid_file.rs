//! World on a grid: the fields of `Grid(…)`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::change_file::GridChange;
use super::default_field::is_default;
use super::rule_file::RuleFile;
use super::signal_file::SignalFile;
use crate::rl::LearnerSettings;
use crate::ron_file::Ordered;
use crate::rulebook::{Counts, JudgeKind, Reward};
use crate::scene::grid::{AtWall, Horizon, Starts};

/// World on a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Grid", deny_unknown_fields)]
pub struct GridFile {
    /// Letters, digits, `_` and `-`. It is part of the key of every start.
    pub name: String,
    /// One sentence, shown in all output.
    pub question: String,
    /// Origin of the world. Default: empty.
    #[serde(default, skip_serializing_if = "is_default")]
    pub source: String,
    /// The map.
    pub map: MapFile,
    /// K: horizon in steps.
    pub horizon: Horizon,
    /// The judged part of a run. Default: `UntilViolation`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub judge: JudgeKind,
    /// The violations that are counterexamples. Default: `Violation`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub counts: Counts,
    /// The ego.
    pub ego: GridEgoFile,
    /// The ado.
    pub ado: GridAdoFile,
    /// X_init. Default: `AllPairs`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub starts: Starts,
    /// Signals derived from others, in order. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub signals: Ordered<SignalFile>,
    /// Named formulas. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub formulas: Ordered<String>,
    /// ψ_ego: the specification that the ego must satisfy.
    pub ego_spec: String,
    /// The requirement behind `ego_spec`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// Numbers by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub constants: Ordered<f64>,
    /// Number per verdict. Default: `Tanh(rho_max: 50.0, …)`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub reward: Reward,
    /// The learner and its settings. Default: `Dqfd(…)`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub learner: LearnerSettings,
    /// Other learners by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub learners: Ordered<LearnerSettings>,
    /// Changed worlds by name. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub reuse: Ordered<GridChange>,
    /// Warnings that you suppress, by the word at the end of each. Default: `[]`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub allow: Vec<String>,
}

/// Map of a grid world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Map", deny_unknown_fields)]
pub struct MapFile {
    /// n: cells along each side.
    pub size: u32,
    /// ε: fine cells along each cell. Default: 1.
    #[serde(default = "one")]
    pub refine: u32,
}

fn one() -> u32 {
    1
}

/// Ego of a grid world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum GridEgoFile {
    /// Moves away from the ado.
    Flees {
        /// k: fine cells per step.
        step: u32,
        /// Behaviour at a wall.
        at_wall: AtWall,
    },
}

/// Ado of a grid world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Ado", deny_unknown_fields)]
// Grid worlds write `Ado(…)`, too, which the schema has to tell apart.
#[schemars(rename = "GridAdo")]
pub struct GridAdoFile {
    /// Its actions: cells to the right and up.
    pub moves: Vec<(i32, i32)>,
    /// The index, from 0, of the action with which the ado does not interfere.
    pub neutral: usize,
    /// The signals that the policy sees.
    pub observe: Vec<String>,
    /// `Rule(name: …, stl: …)`, the most important first.
    pub rulebook: Vec<RuleFile>,
}
