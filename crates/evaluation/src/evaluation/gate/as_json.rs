//! Outcomes, avoidability and reasons of gates as JSON has them.

use std::str::FromStr;

use super::gate_on::GateOn;
use crate::stats::StartOutcome;

/// What a word stands for, so that an unknown one is refused by name.
pub(super) trait JsonWord: FromStr {
    const KIND: &str;
}

impl JsonWord for StartOutcome {
    const KIND: &str = "outcome";
}

impl JsonWord for GateOn {
    const KIND: &str = "reason";
}

/// A value as its word.
pub(super) mod word {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::JsonWord;

    pub(in super::super) fn serialize<T, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error>
    where
        for<'a> &'static str: From<&'a T>,
    {
        to.serialize_str(value.into())
    }

    pub(in super::super) fn deserialize<'de, T: JsonWord, D: Deserializer<'de>>(
        from: D,
    ) -> Result<T, D::Error> {
        of(&String::deserialize(from)?)
    }

    pub(super) fn of<T: JsonWord, E: Error>(word: &str) -> Result<T, E> {
        let unknown = |_| E::custom(format!("unknown {} `{word}`", T::KIND));
        word.parse().map_err(unknown)
    }
}

/// Values as their words.
pub(super) mod words {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::JsonWord;

    pub(in super::super) fn serialize<T, S: Serializer>(all: &[T], to: S) -> Result<S::Ok, S::Error>
    where
        for<'a> &'static str: From<&'a T>,
    {
        to.collect_seq(all.iter().map(<&'static str>::from))
    }

    pub(in super::super) fn deserialize<'de, T: JsonWord, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<T>, D::Error> {
        let words = Vec::<String>::deserialize(from)?;
        words.iter().map(|word| super::word::of(word)).collect()
    }
}

/// Avoidability as two flags, which are null if it is unknown.
pub(super) mod avoidability {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::preventability::Avoidability;

    #[derive(Serialize, Deserialize)]
    struct Flags {
        preventable: Option<bool>,
        unavoidable: Option<bool>,
    }

    pub(in super::super) fn serialize<S: Serializer>(
        label: &Avoidability,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        // Stored rows have the same two keys, so consumers read both alike.
        let (preventable, unavoidable) = (label.preventable(), label.unavoidable());
        let flags = Flags {
            preventable,
            unavoidable,
        };
        flags.serialize(to)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Avoidability, D::Error> {
        let Flags {
            preventable,
            unavoidable,
        } = Flags::deserialize(from)?;
        Ok(Avoidability::of_row(preventable, unavoidable))
    }
}
