//! Numbers of a world file that may be ranges.

use std::fmt;

use schemars::JsonSchema;
use serde::de::{self, Deserializer, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use crate::scene::drive::Range;

/// Number or range: `5.0` or `(5.0, 25.0)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(into = "NumberForm")]
#[schemars(from = "NumberForm")]
pub struct NumberOrRange(pub Range);

/// Number or range, `5.0` or `(5.0, 25.0)`, from which each start draws.
#[derive(Serialize, JsonSchema)]
#[serde(rename = "NumberOrRange", untagged)]
// It serves writing and the schema alone, because reading an untagged enum would lose the
// reason of an error.
enum NumberForm {
    /// Number.
    Number(f64),
    /// Least and greatest value.
    Range(f64, f64),
}

impl From<NumberOrRange> for NumberForm {
    fn from(NumberOrRange(Range { lo, hi }): NumberOrRange) -> NumberForm {
        // The bits, because a range from −0 to 0 would otherwise become a number.
        if lo.to_bits() == hi.to_bits() {
            NumberForm::Number(lo)
        } else {
            NumberForm::Range(lo, hi)
        }
    }
}

impl From<f64> for NumberOrRange {
    fn from(value: f64) -> NumberOrRange {
        NumberOrRange(Range::fixed(value))
    }
}

impl Default for NumberOrRange {
    fn default() -> NumberOrRange {
        // Fields that may be left out are offsets and errors of sensors.
        NumberOrRange::from(0.0)
    }
}

impl<'de> Deserialize<'de> for NumberOrRange {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<NumberOrRange, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = NumberOrRange;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a number such as 5.0 or a range such as (5.0, 25.0)")
            }

            fn visit_f64<E: de::Error>(self, v: f64) -> Result<NumberOrRange, E> {
                Ok(NumberOrRange(Range { lo: v, hi: v }))
            }

            // RON reads `5` as an integer, and files may omit the point.
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<NumberOrRange, E> {
                self.visit_f64(v as f64)
            }

            fn visit_u64<E: de::Error>(self, v: u64) -> Result<NumberOrRange, E> {
                self.visit_f64(v as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<NumberOrRange, A::Error> {
                let missing = || de::Error::custom("a range has two numbers, such as (5.0, 25.0)");
                let lo: f64 = seq.next_element()?.ok_or_else(missing)?;
                let hi: f64 = seq.next_element()?.ok_or_else(missing)?;
                // A third number is refused, since two of three would be a
                // guess.
                if seq.next_element::<f64>()?.is_some() {
                    return Err(missing());
                }
                Ok(NumberOrRange(Range { lo, hi }))
            }
        }
        // The text itself shows whether it has a number or a list, so the value decides.
        deserializer.deserialize_any(Either)
    }
}
