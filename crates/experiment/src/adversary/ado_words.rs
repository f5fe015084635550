//! Words of `--ado`, each for an adversary or a group of them.

use super::grid_policies::GridPolicy;
use crate::run_dir::{AdversaryId, RunDir};
use crate::world::{Scenario, ScenarioKind};

/// Stored counterexamples replayed per start: one row for each number.
const REPLAYS: [usize; 2] = [1, 10];

/// Word of `--ado`, with the adversaries that it names.
#[derive(Clone, Copy, Debug)]
pub struct AdoWord {
    /// The word.
    pub word: &'static str,
    /// Its meaning, for the help.
    pub about: &'static str,
    ids: fn(&Scenario) -> Vec<AdversaryId>,
}

/// Words of `--ado`, in the order of the help.
pub static ADO_WORDS: [AdoWord; 13] = [
    group("trained", "The trained policy", |_| {
        vec![AdversaryId::Trained]
    }),
    group(
        "without",
        "The trained policy without each of its ados in turn, in worlds with several",
        without_each,
    ),
    group(
        "alone",
        "Each ado of the trained policy alone, in worlds with more than two",
        alone_each,
    ),
    group("random", "A random action at each decision", |_| {
        vec![AdversaryId::Random]
    }),
    group("hold", "A random action, held for five decisions", |_| {
        vec![AdversaryId::Hold]
    }),
    group("constant", "The best of the constant actions", |_| {
        vec![AdversaryId::BestConstant]
    }),
    group(
        "switch",
        "Accelerates for some time, then brakes: the best of six",
        |_| vec![AdversaryId::BestSwitch],
    ),
    group(
        "heuristic",
        "A rule with three zones, tuned on the nominal ego",
        |_| vec![AdversaryId::Heuristic],
    ),
    group(
        "replays",
        "The nearest training counterexample, and then the ten nearest",
        |_| {
            REPLAYS
                .map(|nearest| AdversaryId::Replays { nearest })
                .to_vec()
        },
    ),
    group(
        "retrained",
        "An ado trained anew for each changed ego, kept under RUN/retrained",
        |_| vec![AdversaryId::Retrained],
    ),
    group("optimal", "The exact solution of a grid world", |_| {
        vec![GridPolicy::Optimal.id()]
    }),
    group(
        "chaser",
        "A step towards the ego along the larger axis (grid worlds)",
        |_| vec![GridPolicy::Chaser.id()],
    ),
    group(
        "all",
        "All that apply, where `retrained` takes a training per changed ego",
        all,
    ),
];

const fn group(
    word: &'static str,
    about: &'static str,
    ids: fn(&Scenario) -> Vec<AdversaryId>,
) -> AdoWord {
    AdoWord { word, about, ids }
}

impl AdoWord {
    /// Returns the group of a word. `None`: there is no such word.
    pub fn named(word: &str) -> Option<AdoWord> {
        ADO_WORDS.iter().copied().find(|group| group.word == word)
    }

    /// Returns the adversaries of the group, on a run and its world.
    pub fn ids(&self, run: &RunDir, world: &Scenario) -> Vec<AdversaryId> {
        let mut ids = (self.ids)(world);
        // Only a training against one ego stores counterexamples. Replays that are named
        // without them are an error, which names the run.
        if self.word == "all" && !run.manifest().against.is_nominal() {
            ids.retain(|id| !matches!(id, AdversaryId::Replays { .. }));
        }
        ids
    }
}

/// Returns the adversaries that apply to a world, in the order of its rows.
fn all(world: &Scenario) -> Vec<AdversaryId> {
    let kind: &[&str] = match world.kind() {
        ScenarioKind::Grid(_) => &["optimal", "chaser"],
        ScenarioKind::Drive(_) => &["switch", "heuristic", "replays", "retrained"],
    };
    let words = ["trained", "without", "alone", "hold", "random", "constant"];
    let groups = words.iter().chain(kind).copied().filter_map(AdoWord::named);
    groups.flat_map(|group| (group.ids)(world)).collect()
}

/// Returns the trained ados without each of them: its parts, then the placed ados.
fn without_each(world: &Scenario) -> Vec<AdversaryId> {
    let parts = &world.spaces().parts;
    // A single ado without itself is no adversary.
    let own = parts.iter().filter(|_| parts.len() > 1);
    own.map(|part| part.name.as_str())
        .chain(world.judged_ados())
        .map(AdversaryId::without)
        .collect()
}

/// Returns each ado of the trained policy alone. Of two it is the policy without the other.
fn alone_each(world: &Scenario) -> Vec<AdversaryId> {
    let parts = &world.spaces().parts;
    let own = parts.iter().filter(|_| parts.len() > 2);
    own.map(|part| AdversaryId::alone(&part.name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_found_and_all_has_what_applies_to_a_world() {
        for group in ADO_WORDS {
            let found = AdoWord::named(group.word).expect("a word of the list");
            assert_eq!(found.about, group.about);
        }
        assert!(AdoWord::named("held").is_none());
        let captions = |world: &str| -> Vec<String> {
            let world = Scenario::shipped(world).expect("shipped").expect("sound");
            all(&world).iter().map(ToString::to_string).collect()
        };
        let first = ["trained", "hold", "random", "constant"];
        let grid = ["optimal", "chaser"];
        assert_eq!(captions("grid"), [&first[..], &grid].concat());
        let road = ["switch", "heuristic", "replay", "replays", "retrained"];
        assert_eq!(captions("acc"), [&first[..], &road].concat());
        // In a world with several ados each is left out in turn.
        let several = captions("sandwich");
        assert_eq!(several[0], "trained");
        assert!(several[1].starts_with("without ") && several[2].starts_with("without "));
        // One of two alone is the other left out.
        assert_eq!(several[3], "hold");
        const THREE: &str = include_str!("../../../../worlds/others/three_around.ron");
        let three = Scenario::parse("three_around.ron", THREE).expect("a world");
        let captions = all(&three)
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>();
        assert_eq!(
            captions[4..7]
                .iter()
                .filter(|it| it.starts_with("alone "))
                .count(),
            3
        );
    }
}
