//! Rule of a world file, parsed and not yet bound.

use crate::ron_file::ValuePath;
use crate::stl::Formula;

/// Rule in the form of the file.
#[derive(Clone, Debug)]
pub struct RuleSpec {
    /// Name of the rule.
    pub name: String,
    /// Ado that must keep the rule.
    pub ado: String,
    /// Priority, with 0 as the most important.
    pub priority: usize,
    /// Formula, which is kept if its robustness is above 0.
    pub formula: Formula,
    /// Requirement that it expresses, such as a paragraph of a regulation.
    pub requirement: Option<String>,
    /// Place of the formula in the file.
    pub(super) place: ValuePath,
}
