//! Repeats of starts: `repeats: 5` plays every start several times.

use std::fmt;

use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

/// Greatest number of runs per start.
pub const MAX_REPEATS: u32 = 1000;

/// Number of runs of each start, and of failures that count.
///
/// It serves egos that are not deterministic, with other hardware or threads
/// inside. The notation is `repeats: 5`, where one failure in five runs counts,
/// or `repeats: (runs: 5, gate: 3)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Long {
    runs: u32,
    #[serde(default = "one")]
    gate: u32,
}

fn one() -> u32 {
    1
}

impl<'de> Deserialize<'de> for Repeats {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Repeats, D::Error> {
        struct RepeatsVisitor;
        impl<'de> Visitor<'de> for RepeatsVisitor {
            type Value = Repeats;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a number such as 5, or (runs: 5, gate: 3)")
            }

            fn visit_u64<E: de::Error>(self, runs: u64) -> Result<Repeats, E> {
                // A number beyond 32 bits is refused like every number above
                // the limit.
                let runs = u32::try_from(runs).unwrap_or(u32::MAX);
                Ok(Repeats { runs, gate: 1 })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Repeats, A::Error> {
                let long = Long::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(Repeats {
                    runs: long.runs,
                    gate: long.gate,
                })
            }
        }
        deserializer.deserialize_any(RepeatsVisitor)
    }
}
