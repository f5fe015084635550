//! Repeats of starts: `repeats: 5` plays every start several times.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::ron_file::short_or_long;

/// Greatest number of runs per start.
pub const MAX_REPEATS: u32 = 1000;

/// Number of runs of each start, and of failures that count.
///
/// It serves egos that are not deterministic, with other hardware or threads
/// inside. The notation is `repeats: 5`, where one failure in five runs counts,
/// or `repeats: (runs: 5, gate: 3)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[schemars(from = "RepeatsFile")]
pub struct Repeats {
    /// k: runs of each start, 1 or more.
    pub runs: u32,
    /// m: number of failing runs from which the start is a failure of the ego.
    pub gate: u32,
}

impl Default for Repeats {
    fn default() -> Repeats {
        Repeats { runs: 1, gate: 1 }
    }
}

/// Forms of repeats in a file, for the schema.
#[derive(JsonSchema)]
#[schemars(untagged)]
#[expect(dead_code, reason = "only its schema is used")]
enum RepeatsFile {
    Short(u32),
    Long(Long),
}

/// Repeats with a gate.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "GatedRepeats")]
struct Long {
    /// Runs of each start, 1 or more.
    runs: u32,
    /// Number of failing runs from which the start is a failure of the ego.
    #[serde(default = "one")]
    gate: u32,
}

fn one() -> u32 {
    1
}

impl From<u64> for Repeats {
    fn from(runs: u64) -> Repeats {
        // A number beyond 32 bits is refused like every number above the limit.
        let runs = u32::try_from(runs).unwrap_or(u32::MAX);
        Repeats { runs, gate: 1 }
    }
}

impl From<Long> for Repeats {
    fn from(long: Long) -> Repeats {
        Repeats {
            runs: long.runs,
            gate: long.gate,
        }
    }
}

impl<'de> Deserialize<'de> for Repeats {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Repeats, D::Error> {
        let forms = "a number such as 5, or (runs: 5, gate: 3)";
        short_or_long::<D, u64, Long, Repeats>(deserializer, forms)
    }
}
