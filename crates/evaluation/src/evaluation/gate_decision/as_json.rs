//! Outcomes, avoidability and reasons of gates as JSON has them.

/// One outcome per start, as a word.
pub(super) mod outcome {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::stats::StartOutcome;

    const ALL: [StartOutcome; 8] = [
        StartOutcome::Solved,
        StartOutcome::Unsolved,
        StartOutcome::Held,
        StartOutcome::RuleViolation,
        StartOutcome::Uncounted,
        StartOutcome::Trivial,
        StartOutcome::Invalid,
        StartOutcome::NotReached,
    ];

    pub(in super::super) fn serialize<S: Serializer>(
        outcome: &StartOutcome,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.serialize_str(outcome.into())
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<StartOutcome, D::Error> {
        of(&String::deserialize(from)?)
    }

    pub(super) fn of<E: Error>(word: &str) -> Result<StartOutcome, E> {
        let mut all = ALL.into_iter();
        let found = all.find(|outcome| <&str>::from(outcome) == word);
        found.ok_or_else(|| E::custom(format!("unknown outcome `{word}`")))
    }
}

/// Outcomes as words.
pub(super) mod outcomes {
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::stats::StartOutcome;

    pub(in super::super) fn serialize<S: Serializer>(
        all: &[StartOutcome],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(all.iter().map(<&'static str>::from))
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<StartOutcome>, D::Error> {
        let words = Vec::<String>::deserialize(from)?;
        words.iter().map(|word| super::outcome::of(word)).collect()
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

/// Reasons that close a gate, as `--on` reads them.
pub(super) mod reasons {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::super::gate_on::GateOn;

    pub(in super::super) fn serialize<S: Serializer>(
        all: &[GateOn],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(all.iter().map(<&'static str>::from))
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<GateOn>, D::Error> {
        let words = Vec::<String>::deserialize(from)?;
        let reason = |word: &String| {
            let unknown = |_| D::Error::custom(format!("unknown reason `{word}`"));
            word.parse().map_err(unknown)
        };
        words.iter().map(reason).collect()
    }
}
