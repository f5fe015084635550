//! Names that a text declares, even if it is no valid world.

use std::collections::BTreeSet;

use crate::outline::{Scanner, Visit};

/// Fields that contain formulas or signals.
const OF_SIGNALS: [&str; 8] = [
    "stl", "ego_spec", "expr", "observe", "signals", "formulas", "when", "is",
];
/// Fields that name an agent.
const OF_AGENTS: [&str; 6] = [
    "of",
    "relative_to",
    "entity",
    "entities",
    "actors",
    "master",
];

/// Kind of the names that a field contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NameKind {
    /// Signals, constants and words of formulas.
    Signal,
    /// Agents.
    Agent,
    /// Keys of the map of this name.
    KeyOf(&'static str),
}

impl NameKind {
    /// Returns the kind of the names in a field.
    pub fn of_field(field: &str) -> Option<NameKind> {
        match field {
            _ if OF_SIGNALS.contains(&field) => Some(NameKind::Signal),
            _ if OF_AGENTS.contains(&field) => Some(NameKind::Agent),
            "road" => Some(NameKind::KeyOf("roads")),
            "body" | "ego_body" => Some(NameKind::KeyOf("bodies")),
            _ => None,
        }
    }
}

/// Returns the declared names of a kind, each once.
pub fn declared(text: &str, kind: NameKind) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    // A search of the list per name would be quadratic in a text of names alone.
    let mut seen: BTreeSet<&str> = BTreeSet::new();
    let mut scanner = Scanner::new(text);
    loop {
        // Taking a colon may close lists around it, so the depth is that before the
        // lexeme.
        let before = scanner.groups.len();
        let place = {
            let Some(visit) = scanner.next_visit() else {
                return names;
            };
            match visit {
                Visit::Key(name) => is_key_of(text, &scanner, kind, before).then_some(name),
                Visit::Quoted(name) => is_agent(text, &scanner, kind).then_some(name),
                Visit::Other => None,
            }
        };
        if let Some(name) = place.map(|name| &text[name])
            && seen.insert(name)
        {
            names.push(name.to_owned());
        }
    }
}

/// Returns whether a key of the innermost group is a name of a kind.
fn is_key_of(text: &str, scanner: &Scanner<'_>, kind: NameKind, depth: usize) -> bool {
    let maps: &[&str] = match kind {
        NameKind::KeyOf(map) => &[map],
        NameKind::Signal => &["signals", "constants", "formulas", "parameters"],
        NameKind::Agent => &[],
    };
    let Some([.., around, map]) = scanner.groups.get(..depth) else {
        return false;
    };
    let key = around.key.clone().map(|key| &text[key]);
    map.bracket == '{' && key.is_some_and(|key| maps.contains(&key))
}

/// Returns whether a text in quotes is the name of an agent: `agents: [Vehicle(name: "…")]`.
fn is_agent(text: &str, scanner: &Scanner<'_>, kind: NameKind) -> bool {
    let key_of = |key: &Option<std::ops::Range<usize>>| key.clone().map(|key| &text[key]);
    // Exactly this deep: names further inside are those of parts of an agent.
    let [_, list, agent] = &scanner.groups[..] else {
        return false;
    };
    let around = &scanner.groups[0];
    kind == NameKind::Agent
        && list.bracket == '['
        && key_of(&around.key) == Some("agents")
        && key_of(&agent.key) == Some("name")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_that_the_text_declares() {
        let text = r#"Scenario(
            agents: [Vehicle(name: "ego", body: "a"), Light(name: "lamp"), Vehicle(na
            signals: { "gap": "x", "rate": Signal(expr: "y") },
            bodies: { "van": Box(), "bus": Box() },
            learners: { "q": QTable() },
        "#;
        let cases = [
            (NameKind::Agent, vec!["ego", "lamp"]),
            (NameKind::KeyOf("bodies"), vec!["van", "bus"]),
        ];
        // The bracket that is missing hides no name.
        let whole = text.replace(", Vehicle(na", "],");
        for (kind, expect) in cases {
            assert_eq!(declared(&whole, kind), expect, "{kind:?}");
        }
        assert_eq!(declared(&whole, NameKind::Signal), ["gap", "rate"]);
        assert_eq!(declared(text, NameKind::Agent), ["ego", "lamp"]);
        let twice = r#"Scenario(bodies: { "van": Box(), "bus": Box(), "van": Box() })"#;
        assert_eq!(declared(twice, NameKind::KeyOf("bodies")), ["van", "bus"]);
    }
}
