//! Rows of the tables: a name, edits of the files, and the expectation of their import.

use super::*;

/// Row of a table.
pub struct Case {
    pub name: &'static str,
    pub edits: Vec<Edit>,
    pub expected: Expected,
}

/// Expectation of an import.
#[derive(Debug)]
pub enum Expected {
    /// An entity passes these places.
    Passes(&'static str, Vec<Place>),
    /// The first problem is on a line with a text, the message has these words, and
    /// each problem has an element and a fix.
    Refused {
        says: &'static str,
        line: &'static str,
    },
    /// These kinds are dropped, and no other.
    Drops(Vec<&'static str>),
    /// The road has this friction and this limit in m/s.
    Road {
        friction: f64,
        limit_mps: Option<f64>,
    },
    /// The run ends between two times, and these kinds are dropped.
    Ends {
        from_s: f64,
        to_s: f64,
        drops: Vec<&'static str>,
    },
}

pub fn lead<const N: usize>(places: [Place; N]) -> Expected {
    Expected::Passes("lead", places.to_vec())
}

pub fn ego<const N: usize>(places: [Place; N]) -> Expected {
    Expected::Passes("ego", places.to_vec())
}

/// A refusal on any line.
pub fn says(says: &'static str) -> Expected {
    Expected::Refused { says, line: "" }
}

/// A refusal on a line that has a text.
pub fn on(line: &'static str, says: &'static str) -> Expected {
    Expected::Refused { says, line }
}

pub fn drops<const N: usize>(kinds: [&'static str; N]) -> Expected {
    Expected::Drops(kinds.to_vec())
}

pub fn road(friction: f64, limit_mps: Option<f64>) -> Expected {
    Expected::Road {
        friction,
        limit_mps,
    }
}

pub fn ends<const N: usize>(from_s: f64, to_s: f64, drops: [&'static str; N]) -> Expected {
    let drops = drops.to_vec();
    Expected::Ends {
        from_s,
        to_s,
        drops,
    }
}

/// Checks a table: `"name": [edits] => expectation;` per row.
macro_rules! table {
    ($($name:literal: [$($edits:expr),* $(,)?] => $expected:expr;)*) => {
        $crate::imports::cases::check(vec![$($crate::imports::cases::Case {
            name: $name,
            edits: {
                let all: Vec<Vec<Edit>> = vec![$($edits.into_edits()),*];
                all.concat()
            },
            expected: $expected,
        }),*])
    };
}
pub(super) use table;

/// Asserts that every row holds. All rows that do not are in one message.
pub fn check(cases: Vec<Case>) {
    let wrong: Vec<String> = cases.iter().filter_map(Case::fault).collect();
    let (count, all) = (wrong.len(), cases.len());
    assert!(wrong.is_empty(), "{count} of {all}:\n{}", wrong.join("\n"));
}

impl Case {
    /// Describes what differs from the expectation, with the files that it edits.
    fn fault(&self) -> Option<String> {
        let found = self.difference()?;
        let (name, expected) = (self.name, &self.expected);
        let files = edited_files(&self.edits).join(", ");
        Some(format!("{name} ({files}): {found}; expected: {expected:?}"))
    }

    fn difference(&self) -> Option<String> {
        let files = files(&self.edits);
        let imported = match (import(&files), &self.expected) {
            (Err(error), Expected::Refused { says, line }) => {
                return refusal_differs(&error, &files, says, line);
            }
            (Ok(_), Expected::Refused { .. }) => return Some("it is imported".to_owned()),
            (Err(error), _) => return Some(format!("it is refused: {error}")),
            (Ok(imported), _) => imported,
        };
        match &self.expected {
            Expected::Refused { .. } => None,
            Expected::Passes(name, places) => {
                let episode = run(&world(&imported));
                let off: Vec<String> = places
                    .iter()
                    .filter_map(|place| off(&episode, name, *place))
                    .collect();
                (!off.is_empty()).then(|| off.join(", "))
            }
            Expected::Drops(kinds) => {
                let found = dropped(&imported);
                (found != *kinds).then(|| format!("{found:?}"))
            }
            Expected::Road {
                friction,
                limit_mps,
            } => {
                let world = world(&imported);
                let road = &world.drive().expect("a driving scene").spec().road;
                let found = (road.friction(), road.speed_limit_mps());
                let is_same = match (found.1, *limit_mps) {
                    (Some(a), Some(b)) => (a - b).abs() < 1e-6,
                    (a, b) => a == b,
                };
                let is_right = is_same && (found.0 - friction).abs() < 1e-9;
                (!is_right).then(|| format!("{found:?}"))
            }
            Expected::Ends {
                from_s,
                to_s,
                drops,
            } => {
                let horizon_s = world(&imported).world().clock().horizon_s;
                let found = dropped(&imported);
                let is_right = found == *drops && (*from_s..=*to_s).contains(&horizon_s);
                (!is_right).then(|| format!("{horizon_s} s, {found:?}"))
            }
        }
    }
}

fn refusal_differs(
    error: &ImportError,
    files: &[(&'static str, String)],
    says: &str,
    line: &str,
) -> Option<String> {
    let shown = error.to_string();
    if !shown.contains(says) {
        return Some(format!("it says {shown}"));
    }
    let text = text_of(files, &error.file).unwrap_or_default();
    let number = error.element.as_deref().map_or(0, |(_, line)| *line);
    let named = number.checked_sub(1).and_then(|at| text.lines().nth(at));
    if !named.is_some_and(|named| named.contains(line)) {
        return Some(format!("it names {named:?}"));
    }
    let is_whole = |it: &ImportError| it.element.is_some() && it.help.is_some();
    let mut all = error.all();
    (!all.all(is_whole)).then(|| format!("a problem has no element or no fix: {shown}"))
}

/// Asserts that an import has as many problems, each named once, with an element and a
/// fix, in the order of the files.
pub fn assert_names(error: &ImportError, count: usize, says: &[&str]) {
    let all: Vec<&ImportError> = error.all().collect();
    assert_eq!(all.len(), count, "{error}");
    let shown = error.to_string();
    for says in says {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    for it in &all {
        assert!(it.help.is_some() && it.element.is_some(), "{it:?}");
    }
    let lines: Vec<_> = all
        .iter()
        .map(|it| (&it.file, it.element.as_ref().map(|it| it.1)))
        .collect();
    assert!(lines.is_sorted(), "{lines:?}");
}

#[test]
fn a_wrong_row_names_its_case_its_files_and_its_expectation() {
    let case = |edits: Vec<Edit>, expected| {
        let name = "a row";
        Case {
            name,
            edits,
            expected,
        }
        .fault()
    };
    assert_eq!(case(vec![], lead([(12.0, 228.0, 0.0)])), None);
    let moved = case(vec![on_bend()], lead([(12.0, 228.0, 0.0)])).expect("it bends");
    for word in [
        "a row (base.xosc): ",
        "not (228, 0), at 12 s",
        "Passes(\"lead\"",
    ] {
        assert!(moved.contains(word), "{moved}");
    }
    let wrong = [
        (vec![], says("a cause")),
        (vec![], drops(["routes"])),
        (vec![], road(0.5, None)),
        (vec![], ends(5.0, 6.0, [])),
        (vec![first(time(2.0, "odd", 0.0))], says("a rising edge")),
        (
            vec![first(time(2.0, "odd", 0.0))],
            on("<Act", "no edge `odd`"),
        ),
        (vec![first(time(2.0, "odd", 0.0))], lead([])),
    ];
    for (edits, expected) in wrong {
        assert!(case(edits, expected).is_some());
    }
}
