//! Knowledge of worlds for an editor, given by the program.

use std::ops::Range;

use serde_json::Value;

/// Mistake or warning in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorldProblem {
    /// Statement of the problem.
    pub what: String,
    /// Fix, if known.
    pub help: Option<String>,
    /// Bytes of [`CheckedText::text`] with the problem.
    pub span: Range<usize>,
    /// True if the world can be used nevertheless.
    pub is_warning: bool,
}

/// Signal or constant of a world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownName {
    /// Name in formulas.
    pub name: String,
    /// Unit, empty without one.
    pub unit: String,
    /// Meaning.
    pub about: String,
}

/// Result of the check of a text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CheckedText {
    /// Text that was checked, with the content of included files in place of their names.
    pub text: String,
    /// Mistakes and warnings.
    pub problems: Vec<WorldProblem>,
    /// Names for formulas. `None` if the world has a mistake.
    pub names: Option<Vec<KnownName>>,
}

/// Knowledge of world files. No method starts a program.
pub trait WorldLanguage {
    /// Checks a text. `None` if it is no world. `file` is its path or name.
    fn check(&self, file: &str, text: &str) -> Option<CheckedText>;

    /// Returns the JSON Schema of world files, an enum of their first words.
    fn schema(&self) -> &Value;

    /// Returns the names without declaration that a field may contain, such as stock bodies.
    fn stock_names(&self, field: &str) -> Vec<String>;
}
