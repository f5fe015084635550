//! Errors of world files: place, reason and fix.

use std::ops::Range;

/// Mistake in a world file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Statement of the problem with its value.
    pub what: String,
    /// Bytes of the file with the mistake.
    pub span: Range<usize>,
    /// Short label for the place.
    pub label: String,
    /// Fix, if known.
    pub help: Option<String>,
}

/// World file that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioError {
    /// Name of the file, as the user gave it.
    pub file: String,
    /// Text of the file.
    pub text: String,
    /// Mistakes, at least one.
    pub problems: Vec<Problem>,
}

impl ScenarioError {
    /// Returns the line and column (both from 1) of a byte of the text.
    pub fn line_column(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..at.min(self.text.len())];
        let line = before.matches('\n').count() + 1;
        // Columns count characters, as editors do.
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        (line, column)
    }
}

impl std::fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
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

/// Suggestion "did you mean `x`?", if `x` is close to the written name.
pub fn did_you_mean<'a>(written: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(written, known).map(|name| format!("did you mean `{name}`?"))
}

/// Known name that is closest to a written name, if one is close.
pub(super) fn nearest<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let near = |name: &'a str| {
        let distance = strsim::damerau_levenshtein(written, name);
        // A name without its unit, such as `max_brake`, is close as well.
        let begun = written.len() >= 3 && name.starts_with(written);
        // Longer names tolerate more typing errors.
        (begun || distance <= 1 + name.len() / 4).then_some((distance, name))
    };
    known
        .into_iter()
        .filter_map(near)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// List of known names for a help text.
pub fn known_names<'a>(what: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = known.into_iter().collect();
    format!("{what}: {}", names.join(", "))
}

/// List of known names, preceded by the most likely name.
pub fn guessed<'a>(
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

/// Failure to read or use a world file.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("cannot read `{file}`: {source}")]
    Io {
        /// Path of the file.
        file: String,
        /// Underlying error.
        source: std::io::Error,
    },
    /// The file is not a valid world.
    #[error(transparent)]
    Scenario(Box<ScenarioError>),
}
