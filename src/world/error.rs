//! What is wrong with a world file: place, reason and cure.

use std::ops::Range;

/// One mistake in a world file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// What is wrong, naming the value.
    pub what: String,
    /// Bytes of the file that are wrong.
    pub span: Range<usize>,
    /// A few words to stand at the place.
    pub label: String,
    /// The cure, where one is known.
    pub help: Option<String>,
}

/// A world file that cannot be used.
///
/// As `Debug` it prints as on the command line.
#[derive(Clone, PartialEq, Eq)]
pub struct ScenarioError {
    /// Name of the file, as the user gave it.
    pub file: String,
    /// Its text.
    pub text: String,
    /// What is wrong, at least one.
    pub problems: Vec<Problem>,
}

impl ScenarioError {
    /// Line and column (both from 1) of a byte of the text.
    pub fn line_column(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..at.min(self.text.len())];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        (line, column)
    }
}

impl std::fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if 0 < i {
                writeln!(f)?;
            }
            let (line, column) = self.line_column(problem.span.start);
            write!(f, "{}:{line}:{column}: {}", self.file, problem.what)?;
            if let Some(help) = &problem.help {
                write!(f, " ({help})")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for ScenarioError {}

/// "did you mean `x`?", when `x` is close to what was written.
pub(crate) fn did_you_mean<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    let near = |name: &'a str| {
        let distance = strsim::damerau_levenshtein(written, name);
        // A name without its unit, such as `max_brake`, is near as well.
        let begun = 3 <= written.len() && name.starts_with(written);
        (begun || distance <= 1 + name.len() / 4).then_some((distance, name))
    };
    known
        .into_iter()
        .filter_map(near)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| format!("did you mean `{name}`?"))
}

/// The known names as a list for a help text.
pub(crate) fn known_names<'a>(what: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = known.into_iter().collect();
    format!("{what}: {}", names.join(", "))
}

/// The known names, behind the one that was most likely meant.
pub(crate) fn guessed<'a>(
    written: &str,
    what: &str,
    known: impl IntoIterator<Item = &'a str, IntoIter: Clone>,
) -> String {
    let known = known.into_iter();
    let list = known_names(what, known.clone());
    match did_you_mean(written, known) {
        Some(guess) => format!("{guess} {list}"),
        None => list,
    }
}

/// A world file could not be read or used.
///
/// As `Debug` it prints as on the command line: a test that returns it says what
/// is wrong, where, and how to mend it.
#[derive(thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("cannot read `{file}`: {source}")]
    Io {
        /// Its path.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not a world.
    #[error(transparent)]
    Scenario(Box<ScenarioError>),
}
