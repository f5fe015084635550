//! Identity of the adversary of a row.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

/// Adversary of rows, of campaigns and of `--ado`, with all that its player requires.
///
/// Rows are compared by it, never by a caption. `search::PlayerParts` makes its player.
///
/// In JSON it is `adversary`, beside the caption `ado`. A row of an earlier
/// version has the word `ado` only, which is then the name of its adversary.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum AdversaryId {
    /// Policy of a run.
    Trained,
    /// Actions drawn from the policy of a run, several times per start.
    Sampled,
    /// Placed ados of a world, all together.
    Composed,
    /// The same ados, or those of a policy, but for one that plays its neutral action.
    Without {
        /// Caption: `without` and the name of the ado that is left out.
        name: String,
    },
    /// One ado of a policy, while the others play their neutral actions.
    Alone {
        /// Caption: `alone` and the name of the ado that acts.
        name: String,
    },
    /// Planner in a surrogate of the ego.
    Adapted,
    /// Policy trained for the changed ego.
    Retrained,
    /// Random action at each decision.
    Random,
    /// Random action, held for some decisions.
    Hold,
    /// One action throughout.
    Constant {
        /// Joint action.
        action: usize,
        /// Caption: `constant` and the label of the action. Rows leave it out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        name: Option<String>,
    },
    /// Neutral action throughout.
    Neutral,
    /// Constant action that succeeds most often.
    BestConstant,
    /// Acceleration and then braking, with the most successful moment.
    BestSwitch,
    /// Given sequence of actions.
    Script {
        /// Name given by its author.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        /// Joint actions, one per decision, the last one held. Rows leave them out.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        actions: Vec<usize>,
    },
    /// Tuned rule.
    Heuristic,
    /// Nearest stored counterexamples.
    Replays {
        /// Greatest number of replays per start.
        nearest: usize,
    },
    /// Search of every start.
    Search {
        /// Settings of the search. Rows leave them out and have the method in words.
        #[serde(flatten)]
        settings: Option<SearchSettings>,
    },
    /// Search of every start by the policy of a run, which proposes the sequences.
    Guided,
    /// Adversary that only its name identifies.
    Named {
        /// Name given by its author.
        name: String,
    },
}

/// Settings of a search.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct SearchSettings {
    /// Name of the method, as given to `--method`.
    pub method: String,
    /// Largest number of action switches.
    pub switches: usize,
    /// Simulations per start.
    pub budget: u64,
}

/// Beginning of the caption of several ados without one.
const WITHOUT: &str = "without ";
/// Beginning of the caption of one of several ados.
const ALONE: &str = "alone ";
/// Number of replays in rows of earlier versions, which name no number.
const FORMER_REPLAYS: usize = 10;

impl AdversaryId {
    /// Search, as in rows.
    pub const SEARCH: AdversaryId = AdversaryId::Search { settings: None };

    /// Returns whether it is a search of every start.
    pub fn is_search(&self) -> bool {
        matches!(self, AdversaryId::Search { .. })
    }

    /// Returns the caption in tables, pages and messages.
    pub fn caption(&self) -> &str {
        match self {
            AdversaryId::Constant {
                name: Some(name), ..
            }
            | AdversaryId::Script {
                name: Some(name), ..
            }
            | AdversaryId::Named { name }
            | AdversaryId::Without { name }
            | AdversaryId::Alone { name } => name,
            AdversaryId::Trained => "trained",
            AdversaryId::Adapted => "adapted",
            AdversaryId::Retrained => "retrained",
            AdversaryId::Random => "random",
            AdversaryId::Hold => "hold",
            AdversaryId::Constant { .. } | AdversaryId::BestConstant => "constant",
            AdversaryId::Neutral => "neutral",
            AdversaryId::BestSwitch => "switch",
            AdversaryId::Script { .. } => "script",
            AdversaryId::Heuristic => "heuristic",
            // Stored rows have both captions, which are older than the number.
            AdversaryId::Replays { nearest: 1 } => "replay",
            AdversaryId::Replays { .. } => "replays",
            AdversaryId::Search { .. } => "search",
            AdversaryId::Sampled => "sampled",
            AdversaryId::Guided => "guided",
            AdversaryId::Composed => "composed",
        }
    }

    /// Returns the identity of several ados without one.
    pub fn without(ado: &str) -> AdversaryId {
        AdversaryId::Without {
            name: format!("{WITHOUT}{ado}"),
        }
    }

    /// Returns the ado that is left out, if one is.
    pub fn left_out(&self) -> Option<&str> {
        match self {
            AdversaryId::Without { name } => name.strip_prefix(WITHOUT),
            _ => None,
        }
    }
}

impl AdversaryId {
    /// Returns the identity of one of several ados alone.
    pub fn alone(ado: &str) -> AdversaryId {
        AdversaryId::Alone {
            name: format!("{ALONE}{ado}"),
        }
    }

    /// Returns the only ado that acts, if the others do not.
    pub fn only(&self) -> Option<&str> {
        match self {
            AdversaryId::Alone { name } => name.strip_prefix(ALONE),
            _ => None,
        }
    }
}

impl Display for AdversaryId {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // Padding, because tables ask for a width.
        f.pad(self.caption())
    }
}

impl From<&str> for AdversaryId {
    /// Returns the adversary of a name. Other captions do not change the names.
    fn from(name: &str) -> AdversaryId {
        match name {
            "trained" => AdversaryId::Trained,
            "adapted" => AdversaryId::Adapted,
            "sampled" => AdversaryId::Sampled,
            "guided" => AdversaryId::Guided,
            "composed" => AdversaryId::Composed,
            "retrained" => AdversaryId::Retrained,
            "random" => AdversaryId::Random,
            "hold" => AdversaryId::Hold,
            "neutral" => AdversaryId::Neutral,
            // Rows of single constants were never written.
            "constant" => AdversaryId::BestConstant,
            "switch" => AdversaryId::BestSwitch,
            "script" => AdversaryId::Script {
                name: None,
                actions: Vec::new(),
            },
            "heuristic" => AdversaryId::Heuristic,
            "replay" => AdversaryId::Replays { nearest: 1 },
            "replays" => AdversaryId::Replays {
                nearest: FORMER_REPLAYS,
            },
            "search" => AdversaryId::SEARCH,
            other => AdversaryId::Named {
                name: other.to_owned(),
            },
        }
    }
}

/// Keys of a row: the caption `ado` and the id `adversary`.
pub mod keys {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::AdversaryId;

    #[derive(Serialize)]
    struct Written<'a> {
        ado: &'a str,
        adversary: &'a AdversaryId,
    }

    #[derive(Deserialize)]
    struct Read {
        ado: String,
        adversary: Option<AdversaryId>,
    }

    /// Writes the key of an adversary.
    pub fn serialize<S: Serializer>(id: &AdversaryId, to: S) -> Result<S::Ok, S::Error> {
        let ado = id.caption();
        Written { ado, adversary: id }.serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<AdversaryId, D::Error> {
        let Read { ado, adversary } = Read::deserialize(from)?;
        // The caption of a row counts only where an earlier version wrote no id.
        Ok(adversary.unwrap_or_else(|| ado.as_str().into()))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Keys(#[serde(with = "keys")] AdversaryId);

    fn read(keys: Value) -> AdversaryId {
        let Keys(id) = serde_json::from_value(keys).expect("an adversary");
        id
    }

    #[test]
    fn an_adversary_is_read_by_its_id_and_in_earlier_rows_by_its_name() {
        let held = AdversaryId::Constant {
            action: 2,
            name: None,
        };
        let written = serde_json::to_value(Keys(held.clone())).expect("JSON");
        let id = json!({ "kind": "constant", "action": 2 });
        assert_eq!(written, json!({ "ado": "constant", "adversary": id }));
        assert_eq!(
            read(json!({ "ado": "the gentle one", "adversary": id })),
            held
        );
        assert_eq!(
            read(json!({ "ado": "constant" })),
            AdversaryId::BestConstant
        );
        for name in [
            "trained",
            "adapted",
            "retrained",
            "random",
            "hold",
            "neutral",
            "switch",
            "script",
            "heuristic",
            "replay",
            "replays",
            "search",
            "guided",
        ] {
            let id = read(json!({ "ado": name }));
            assert!(!matches!(id, AdversaryId::Named { .. }), "{name}");
            assert_eq!(id.caption(), name);
        }
        let own = read(json!({ "ado": "chaser" }));
        assert_eq!(own, "chaser".into());
    }
}
