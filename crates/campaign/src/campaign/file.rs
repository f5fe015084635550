//! Content of a campaign file before the check.

use serde::{Deserialize, Serialize};

use crate::evaluation::GateOn;
use crate::ron_file::Ordered;
use crate::seed::FIRST_SEALED;
use crate::sim::PlantKind;
use crate::world::Change;

/// Campaign file.
#[derive(Deserialize)]
#[serde(rename = "Campaign", deny_unknown_fields)]
pub(super) struct CampaignFile {
    pub name: String,
    pub worlds: Vec<WorldEntry>,
    #[serde(default = "only_nominal")]
    pub egos: Vec<EgoEntry>,
    #[serde(default)]
    pub ados: Vec<AdoEntry>,
    pub starts: StartsEntry,
    /// Whether every counterexample is judged by the reference drivers.
    #[serde(default)]
    pub preventability: bool,
    #[serde(default)]
    pub gate: Option<GateEntry>,
    /// Region in which a regulation requires the ego to hold, for maps of a grid.
    #[serde(default)]
    pub boundary: Option<BoundaryEntry>,
}

fn only_nominal() -> Vec<EgoEntry> {
    vec![EgoEntry::Ego("nominal".to_owned())]
}

fn first_sealed() -> u64 {
    // Seeds below chose settings, so a campaign reports on those from here on.
    FIRST_SEALED
}

/// World, by its file or the name of a shipped world.
#[derive(Deserialize)]
#[serde(rename = "World", deny_unknown_fields)]
pub(super) struct WorldEntry {
    pub file: String,
    /// Plant to test on, instead of the world's own.
    #[serde(default)]
    pub plant: Option<PlantKind>,
    /// Ados of this world only, played before those of the campaign.
    #[serde(default)]
    pub ados: Vec<AdoEntry>,
}

/// Egos under test.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum EgoEntry {
    /// `nominal`, `all`, a name under `reuse`, or a RON file with a `Change`.
    Ego(String),
    /// Parameter over a range: `ego.time_gap_s=0.5..1.5:5`.
    Sweep(String),
    /// Members drawn from the world's family.
    Family {
        members: u64,
        #[serde(default)]
        seed: u64,
    },
    /// Change that is written in the campaign file.
    Changed { name: String, change: Box<Change> },
}

/// Ado of a campaign.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum AdoEntry {
    /// Neutral action all the time.
    Neutral,
    /// Random actions, each held for five decisions.
    Held,
    /// Random action at each decision.
    Random,
    /// Constant action, by its label in `check`.
    Constant(String),
    /// Actions by their labels in `check`, each until a time, the last action held.
    Script {
        name: String,
        steps: Vec<(String, f64)>,
        then: String,
    },
    /// Sequences of actions, searched per start.
    Search {
        #[serde(default)]
        method: Option<String>,
        #[serde(default)]
        switches: Option<usize>,
        #[serde(default)]
        budget: Option<u64>,
    },
    /// Trained ado of a run directory.
    Trained(String),
    /// Ados that are trained as pieces of the campaign.
    Training {
        seeds: u64,
        #[serde(default = "first_sealed")]
        first_seed: u64,
        #[serde(default)]
        decisions: Option<u64>,
    },
}

/// Starts of a campaign.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum StartsEntry {
    /// Test starts, drawn as by `eval` and `search`.
    Drawn {
        count: usize,
        #[serde(default)]
        seed: u64,
    },
    /// Grid over some ranges. Every other range is at its middle.
    Grid {
        axes: Ordered<(f64, f64, usize)>,
        #[serde(default)]
        seed: u64,
    },
}

/// Region in which a regulation requires the ego to hold.
#[derive(Deserialize)]
#[serde(rename = "Boundary", deny_unknown_fields)]
pub(super) struct BoundaryEntry {
    pub name: String,
    /// Formula on the first sample of a start.
    pub stl: String,
}

/// Rule that decides the exit code of the merge.
#[derive(Deserialize)]
#[serde(rename = "Gate", deny_unknown_fields)]
pub(super) struct GateEntry {
    /// Ego that every other ego is compared with.
    pub baseline: String,
    /// Newly failing starts that close the gate.
    #[serde(default)]
    pub on: GateOn,
    /// Whether more severe failures close it, too.
    #[serde(default)]
    pub severity: bool,
}

/// Starts of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub(crate) enum RequestedStarts {
    /// Test starts of a stream.
    Drawn {
        /// Number of starts.
        count: usize,
        /// Seed of the stream.
        seed: u64,
    },
    /// Every combination of some values. Other axes are at their middle.
    Grid {
        /// Axes of X_init with their values. The last axis varies fastest.
        axes: Vec<(String, Vec<f64>)>,
        /// Seed of the noise.
        seed: u64,
    },
}

impl RequestedStarts {
    /// Returns the seed of the stream of starts, or of their noise.
    pub fn seed(&self) -> u64 {
        match self {
            RequestedStarts::Drawn { seed, .. } | RequestedStarts::Grid { seed, .. } => *seed,
        }
    }
}
