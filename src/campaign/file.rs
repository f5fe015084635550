//! What a campaign file says, before it is checked.

use serde::{Deserialize, Serialize};

use crate::seed::FIRST_SEALED;
use crate::sim::PlantKind;
use crate::world::{Change, Ordered};

/// A campaign file.
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
    /// Where a regulation asks the ego to hold, for the maps of a grid of starts.
    #[serde(default)]
    pub boundary: Option<BoundaryEntry>,
}

fn only_nominal() -> Vec<EgoEntry> {
    vec![EgoEntry::Ego("nominal".to_owned())]
}

fn first_sealed() -> u64 {
    FIRST_SEALED
}

/// A world, by its file or the name of a shipped one.
#[derive(Deserialize)]
#[serde(rename = "World", deny_unknown_fields)]
pub(super) struct WorldEntry {
    pub file: String,
    /// The physics to test in, instead of the world's.
    #[serde(default)]
    pub plant: Option<PlantKind>,
    /// Ados of this world only, before those of the campaign.
    #[serde(default)]
    pub ados: Vec<AdoEntry>,
}

/// Egos under test.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum EgoEntry {
    /// `nominal`, `all`, a name under `reuse`, or a RON file with a `Change`.
    Ego(String),
    /// One parameter over a range: `ego.time_gap_s=0.5..1.5:5`.
    Sweep(String),
    /// Members drawn from the world's family.
    Family {
        members: u64,
        #[serde(default)]
        seed: u64,
    },
    /// A change that is written here.
    Changed { name: String, change: Box<Change> },
}

/// Who plays the ados.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum AdoEntry {
    /// The neutral action all the time.
    Neutral,
    /// Random actions, each held for five decisions.
    Held,
    /// A random action at each decision.
    Random,
    /// One action all the time, as `check` lists it.
    Constant(String),
    /// Actions as `check` lists them, each until a moment; the last one is held.
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
    /// The ado of a run directory.
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

/// Which starts are played.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum StartsEntry {
    /// Test starts, drawn as `eval` and `search` draw them.
    Drawn {
        count: usize,
        #[serde(default)]
        seed: u64,
    },
    /// A grid over some of the ranges, the others at their middle.
    Grid {
        axes: Ordered<(f64, f64, usize)>,
        #[serde(default)]
        seed: u64,
    },
}

/// Where a regulation asks the ego to hold.
#[derive(Deserialize)]
#[serde(rename = "Boundary", deny_unknown_fields)]
pub(super) struct BoundaryEntry {
    pub name: String,
    /// A formula on the first sample of a start.
    pub stl: String,
}

/// What decides the exit code of the merge.
#[derive(Deserialize)]
#[serde(rename = "Gate", deny_unknown_fields)]
pub(super) struct GateEntry {
    /// The ego that the others are compared with.
    pub baseline: String,
    #[serde(default)]
    pub on: GateOn,
}

/// Which newly failing starts hold a change up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum GateOn {
    /// Those that CC_LATCHED or FSM would have survived.
    #[default]
    Preventable,
    /// Any.
    Any,
    /// None: it is only told.
    Never,
}

/// Which starts a plan plays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum StartsAsked {
    /// So many test starts of a stream.
    Drawn {
        /// How many.
        count: usize,
        /// Seed of the stream.
        seed: u64,
    },
    /// Every combination of some values; what is not named is at its middle.
    Grid {
        /// Axes of X_init and the values along them; the last one varies fastest.
        axes: Vec<(String, Vec<f64>)>,
        /// Seed of the noise.
        seed: u64,
    },
}

impl StartsAsked {
    /// Seed of the stream of starts, or of their noise.
    pub fn seed(&self) -> u64 {
        match self {
            StartsAsked::Drawn { seed, .. } | StartsAsked::Grid { seed, .. } => *seed,
        }
    }
}
