//! The signals of a world as a table: those of many agents by pattern.

use indexmap::{IndexMap, IndexSet};

use super::super::common::table_of;
use crate::world::Scenario;

/// With more agents than this, signals that differ by agents only are one line.
const FEW_AGENTS: usize = 2;

/// Pattern of one or several signal names, with unit and meaning.
type Pattern = (String, String, String);

/// Legend of the columns.
pub(super) const EXPLAINED: &str = "\
in traces: recorded always, or on demand: only where a formula or an ado mentions it";

/// Signals of a world, by pattern.
struct SignalPatterns {
    /// Agents and lights in the names of signals.
    agents: Vec<String>,
    /// True if the agents are `A` and `B` in the patterns.
    many: bool,
    /// Signals of a pattern, each with its presence in traces.
    lines: IndexMap<Pattern, Vec<&'static str>>,
}

impl SignalPatterns {
    /// Returns the patterns, with `A` and `B` if there are more agents than `few`.
    fn of(scenario: &Scenario, few: usize) -> SignalPatterns {
        let stage = scenario.bench().stage();
        let agents = stage.agents.iter().map(|agent| agent.name.clone());
        let lights = stage.lights.iter().map(|light| light.name.clone());
        let agents: Vec<String> = agents.chain(lights).collect();
        let names: Vec<&str> = agents.iter().map(String::as_str).collect();
        // The pairs of many agents would fill pages.
        let many = agents.len() > few;
        // Insertion order is the order of the world, which a hash map would lose.
        let mut lines: IndexMap<Pattern, Vec<&'static str>> = IndexMap::new();
        for (signal, held) in scenario.signals() {
            let (name, about) = if many {
                pattern(&names, &signal.name, &signal.about)
            } else {
                (signal.name, signal.about)
            };
            let line = (name, signal.unit.into_owned(), about);
            lines.entry(line).or_default().push(held.word());
        }
        SignalPatterns {
            agents,
            many,
            lines,
        }
    }
}

/// Returns the names of the signals, with `A` and `B` for any agents.
pub(super) fn names(scenario: &Scenario) -> Vec<String> {
    // Few is 0 here, so every world is listed by pattern, which keeps the list short.
    let patterns = SignalPatterns::of(scenario, 0).lines.into_keys();
    each_once(patterns.map(|(name, ..)| name))
}

/// Returns the names in their order, each where it is first.
fn each_once(names: impl Iterator<Item = String>) -> Vec<String> {
    // Patterns with the same name may have another unit or meaning.
    let once: IndexSet<String> = names.collect();
    once.into_iter().collect()
}

/// Returns a line per signal with its unit and meaning.
pub(super) fn table(scenario: &Scenario) -> String {
    let SignalPatterns {
        agents,
        many,
        lines,
    } = SignalPatterns::of(scenario, FEW_AGENTS);
    let lines = lines.into_iter().map(|((name, unit, about), held)| {
        let first = held[0];
        let same = held.iter().filter(|word| **word == first).count();
        // A pattern may cover signals that are recorded and others on demand.
        let held = if same == held.len() {
            first.to_owned()
        } else {
            format!("{first}: {same} of {}", held.len())
        };
        [name, unit, about, held]
    });
    let table = table_of(["signal", "unit", "meaning", "in traces"], lines);
    if many {
        format!(
            "{table}\nA, B: each of {}; `--json` lists every signal",
            agents.join(", ")
        )
    } else {
        table
    }
}

/// A signal's name and meaning with `A` and `B` for the agents in its name.
fn pattern(agents: &[&str], name: &str, about: &str) -> (String, String) {
    let parts: Vec<&str> = name.split('.').collect();
    let leading = parts.iter().take_while(|part| agents.contains(part));
    // The last part is the quantity.
    // A signal belongs to two agents at most, and there are two letters.
    let owners = leading.count().min(2).min(parts.len() - 1);
    let letters = ["A", "B"];
    let renamed = |word: &str| {
        let owner = parts[..owners].iter().position(|part| *part == word);
        owner.map_or_else(|| word.to_owned(), |i| letters[i].to_owned())
    };
    let (head, tail) = parts.split_at(owners);
    let head = head.iter().map(|part| renamed(part));
    let name: Vec<String> = head
        .chain(tail.iter().map(|part| (*part).to_owned()))
        .collect();
    // Owners appear as words, or as a prefix of another quantity's name.
    let words = about.split(' ').map(|word| {
        let bare = word
            .trim_matches(|c: char| !c.is_alphanumeric() && c != '_' && c != '.')
            .trim_end_matches('.');
        if bare.is_empty() {
            return word.to_owned();
        }
        let owned = bare.split('.').map(renamed).collect::<Vec<_>>().join(".");
        word.replacen(bare, &owned, 1)
    });
    (name.join("."), words.collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_listed_once_wherever_it_comes_again() {
        let names = ["A.x", "A.y", "A.x"].map(str::to_owned);
        assert_eq!(each_once(names.into_iter()), ["A.x", "A.y"]);
    }

    #[test]
    fn signals_of_many_agents_are_one_line() {
        let agents = ["ego", "ado", "lead"];
        let cases = [
            (
                "ado.speed",
                "velocity along the heading",
                "A.speed",
                "velocity along the heading",
            ),
            (
                "ego.lead.gap",
                "clearance between the bodies of ego and lead",
                "A.B.gap",
                "clearance between the bodies of A and B",
            ),
            (
                "lead.ego.headway",
                "distance from lead to ego, front to front",
                "A.B.headway",
                "distance from A to B, front to front",
            ),
            (
                "time_left",
                "time to the horizon",
                "time_left",
                "time to the horizon",
            ),
            (
                "ego.light.line",
                "from ego to the line",
                "A.light.line",
                "from A to the line",
            ),
            ("ado", "of ado", "ado", "of ado"),
        ];
        for (name, about, to_name, to_about) in cases {
            let expect = (to_name.to_owned(), to_about.to_owned());
            assert_eq!(pattern(&agents, name, about), expect);
        }
        let world = Scenario::shipped("sandwich")
            .expect("shipped")
            .expect("sound");
        let table = table(&world);
        assert!(
            table.contains("A.B.gap") && !table.contains("ego.speed"),
            "{table}"
        );
        assert!(table.lines().count() < world.signals().len() / 2, "{table}");
    }
}
