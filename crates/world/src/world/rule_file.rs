//! Rule of a rulebook for serde: a rule, or the name of a rule file.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, Visitor};

/// Rule, or the name of a rule file whose rules replace it.
pub(super) struct RuleFile {
    pub(super) name: String,
    pub(super) stl: String,
    pub(super) requirement: Option<String>,
    pub(super) priority: Option<usize>,
    /// Rule file. Its rules replace it before anything is checked.
    pub(super) include: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename = "Rule", deny_unknown_fields)]
struct WrittenRule {
    name: String,
    stl: String,
    #[serde(default)]
    requirement: Option<String>,
    #[serde(default)]
    priority: Option<usize>,
}

impl<'de> Deserialize<'de> for RuleFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<RuleFile, D::Error> {
        struct RuleVisitor;
        impl<'de> Visitor<'de> for RuleVisitor {
            type Value = RuleFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(
                    f,
                    "Rule(name: \"…\", stl: \"…\") or a rule file such as \"rules.ron\""
                )
            }

            fn visit_str<E: de::Error>(self, v: &str) -> Result<RuleFile, E> {
                // The rules of the file replace this one, so its own fields are empty.
                Ok(RuleFile {
                    name: String::new(),
                    stl: String::new(),
                    requirement: None,
                    priority: None,
                    include: Some(v.to_owned()),
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RuleFile, A::Error> {
                let rule = WrittenRule::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(RuleFile {
                    name: rule.name,
                    stl: rule.stl,
                    requirement: rule.requirement,
                    priority: rule.priority,
                    include: None,
                })
            }
        }
        // A name is a string and a rule a struct, and only this method accepts both.
        deserializer.deserialize_any(RuleVisitor)
    }
}
