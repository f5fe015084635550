//! Rule of a rulebook: a rule, or the name of a rule file.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::ron_file::short_or_long;

/// Rule, or the name of a rule file whose rules replace it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum RuleFile {
    /// Name of a rule file. Its rules replace it before anything is checked.
    Included(String),
    /// Rule.
    Rule(WrittenRule),
}

/// Rule: its name and its formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Rule", deny_unknown_fields)]
pub struct WrittenRule {
    /// Name, which results show.
    pub name: String,
    /// Formula that the ado must keep.
    pub stl: String,
    /// Requirement behind the rule, such as a paragraph of a regulation. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// Rank, 0 for the most important. Default: the position in the rulebook.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<usize>,
}

impl RuleFile {
    /// Returns the rule, `None` for the name of a rule file.
    pub fn rule(&self) -> Option<&WrittenRule> {
        match self {
            RuleFile::Included(_) => None,
            RuleFile::Rule(rule) => Some(rule),
        }
    }

    /// Returns the name of a rule file, `None` for a rule.
    pub fn include(&self) -> Option<&str> {
        match self {
            RuleFile::Included(file) => Some(file),
            RuleFile::Rule(_) => None,
        }
    }

    /// Returns the name, empty for a rule file.
    pub fn name(&self) -> &str {
        // Rules replace their files before names are read, so no check meets this.
        self.rule().map_or("", |rule| &rule.name)
    }

    /// Returns the formula, empty for a rule file.
    pub fn stl(&self) -> &str {
        self.rule().map_or("", |rule| &rule.stl)
    }
}

impl From<String> for RuleFile {
    fn from(file: String) -> RuleFile {
        RuleFile::Included(file)
    }
}

impl From<WrittenRule> for RuleFile {
    fn from(rule: WrittenRule) -> RuleFile {
        RuleFile::Rule(rule)
    }
}

// Derived as an untagged enum, it would lose the reason of a mistake in `Rule(…)`.
impl<'de> Deserialize<'de> for RuleFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<RuleFile, D::Error> {
        let forms = "Rule(name: \"…\", stl: \"…\") or a rule file such as \"rules.ron\"";
        short_or_long::<D, String, WrittenRule, RuleFile>(deserializer, forms)
    }
}
