//! Parameters with their values, and texts that refer to them.

use core::ops::RangeInclusive;
use std::collections::BTreeMap;

use super::error::ImportError;
use super::expression::evaluate;
use super::tree::XmlNode;

/// Greatest size of a number in a file, whose products stay finite.
const MOST: f64 = 1e12;
/// Greatest number of a lane.
const MOST_LANE: f64 = 1000.0;

/// Values of the parameters that a part of a file may use.
#[derive(Clone, Debug, Default)]
pub struct ParameterScope(BTreeMap<String, String>);

impl ParameterScope {
    /// Returns the parameters of an element, in addition to the outer parameters.
    ///
    /// Values are evaluated in the order of their declarations. `set` overrides
    /// declared values and ignores undeclared names.
    ///
    /// # Errors
    ///
    /// Returns an error for an invalid expression or an unknown parameter.
    pub fn declared(
        node: Option<&XmlNode>,
        outer: &ParameterScope,
        set: &[(String, String)],
    ) -> Result<ParameterScope, ImportError> {
        // Inner declarations hide outer ones without a change of these.
        let mut scope = outer.clone();
        let declarations = node
            .into_iter()
            .flat_map(|it| it.all("ParameterDeclaration"));
        for declaration in declarations {
            // Some writers put the sign of a reference into the name.
            let name = declaration.need("name")?.trim_start_matches('$');
            // The last assignment of a name counts.
            let given = set.iter().rev().find(|(known, _)| known == name);
            let value = match given {
                // Set values may contain expressions of parameters that are
                // declared earlier.
                Some((_, value)) => scope.resolve_text(declaration, value)?,
                None => scope.text(declaration, "value")?,
            };
            scope.0.insert(name.to_owned(), value);
        }
        Ok(scope)
    }

    /// Returns the value of a parameter.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    /// Returns a required attribute, evaluated.
    pub fn text(&self, node: &XmlNode, name: &str) -> Result<String, ImportError> {
        self.resolve_text(node, node.need(name)?)
    }

    /// Returns a required attribute as a number.
    pub fn number(&self, node: &XmlNode, name: &str) -> Result<f64, ImportError> {
        self.number_in(node, name, -MOST..=MOST)
    }

    /// Returns a required attribute as a number of a range.
    ///
    /// # Errors
    ///
    /// Returns an error for a text that is no number, and for one outside of the range.
    pub fn number_in(
        &self,
        node: &XmlNode,
        name: &str,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ImportError> {
        let text = self.text(node, name)?;
        let within = format!(
            "write a number from {} to {}",
            short(*range.start()),
            short(*range.end())
        );
        let value = number(&text).ok_or_else(|| {
            let what = format!("`{name}` is `{text}`, which is no number");
            node.refused(what, &within)
        })?;
        if range.contains(&value) {
            Ok(value)
        } else {
            Err(node.refused(format!("`{name}` is {text}"), &within))
        }
    }

    /// Returns a required attribute as the number of a lane, or of lanes.
    ///
    /// # Errors
    ///
    /// Returns an error for a fraction, and for a number beyond all lanes.
    pub fn lane(&self, node: &XmlNode, name: &str) -> Result<i32, ImportError> {
        let value = self.number(node, name)?;
        // A comparison of the fraction with 0 excludes NaN as well.
        if value.fract() == 0.0 && value.abs() <= MOST_LANE {
            // A whole number of this size has the same value as an integer.
            return Ok(value as i32);
        }
        let what = format!("`{name}` is {value}, which is no number of a lane");
        let help = format!("write a whole number from -{MOST_LANE} to {MOST_LANE}");
        Err(node.refused(what, &help))
    }

    /// Returns an attribute as a number, or 0 if it is missing.
    pub fn number_or_zero(&self, node: &XmlNode, name: &str) -> Result<f64, ImportError> {
        match node.raw(name) {
            Some(_) => self.number(node, name),
            None => Ok(0.0),
        }
    }

    /// Returns an attribute of truth, which is false if it is missing.
    ///
    /// # Errors
    ///
    /// Returns an error for other words than those of truth.
    pub fn is_true(&self, node: &XmlNode, name: &str) -> Result<bool, ImportError> {
        if node.raw(name).is_none() {
            return Ok(false);
        }
        match self.text(node, name)?.as_str() {
            "true" | "1" => Ok(true),
            "false" | "0" => Ok(false),
            other => {
                let what = format!("`{name}` is `{other}`, which is neither true nor false");
                Err(node.refused(what, "write true or false"))
            }
        }
    }

    /// Evaluates a text.
    pub fn resolve_text(&self, node: &XmlNode, text: &str) -> Result<String, ImportError> {
        // Only complete texts are expressions or references. OpenSCENARIO has
        // no interpolation.
        let trimmed = text.trim();
        if let Some(inner) = trimmed
            .strip_prefix("${")
            .and_then(|it| it.strip_suffix('}'))
        {
            let value = |name: &str| {
                let known = self
                    .get(name)
                    .ok_or_else(|| format!("there is no parameter `{name}`"))?;
                number(known).ok_or_else(|| format!("`{name}` is `{known}`, which is no number"))
            };
            let value = evaluate(inner, &value);
            return match value {
                // The shortest text that reads back bit for bit keeps the value
                // exact.
                Ok(value) => Ok(value.to_string()),
                Err(why) => {
                    let help = "use numbers, declared parameters, + - * / ( ) and functions such \
                                as pow, sqrt, min and max";
                    Err(node.refused(format!("the expression `{trimmed}`: {why}"), help))
                }
            };
        }
        match trimmed.strip_prefix('$') {
            Some(name) => match self.get(name) {
                Some(value) => Ok(value.to_owned()),
                None => {
                    let what = format!("there is no parameter `{name}`");
                    let help = "declare it in the `ParameterDeclarations`";
                    Err(node.refused(what, help))
                }
            },
            None => Ok(text.to_owned()),
        }
    }

    /// Returns the first declaration whose constraints its value breaks.
    ///
    /// One constraint group must hold, with all its constraints.
    pub fn broken<'a>(
        &self,
        node: Option<&'a XmlNode>,
    ) -> Result<Option<&'a XmlNode>, ImportError> {
        let declarations = node
            .into_iter()
            .flat_map(|it| it.all("ParameterDeclaration"));
        for declaration in declarations {
            let value = self
                .get(declaration.need("name")?.trim_start_matches('$'))
                .unwrap_or_default();
            let mut groups = declaration.all("ConstraintGroup").peekable();
            let mut holds = groups.peek().is_none();
            for group in groups {
                let mut all = true;
                for constraint in group.all("ValueConstraint") {
                    let other = self.text(constraint, "value")?;
                    let rule = constraint.need("rule")?;
                    let kept = compared(value, rule, &other);
                    all &= kept.ok_or_else(|| {
                        constraint.refused(format!("the rule `{rule}` is not understood"), RULES)
                    })?;
                }
                holds |= all;
            }
            if !holds {
                return Ok(Some(declaration));
            }
        }
        Ok(None)
    }
}

/// Number with few digits, also if it is large.
fn short(value: f64) -> String {
    if value.abs() < 1e6 {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Help about the rules of comparisons.
pub const RULES: &str =
    "write equalTo, notEqualTo, lessThan, lessOrEqual, greaterThan or greaterOrEqual";

/// Parses a finite number.
pub fn number(text: &str) -> Option<f64> {
    let value: f64 = text.trim().parse().ok()?;
    // Rust parses `inf` and `nan`, which no file of these formats may contain.
    value.is_finite().then_some(value)
}

/// Evaluates a rule between two values. Returns `None` for an unknown rule.
pub fn compared(a: &str, rule: &str, b: &str) -> Option<bool> {
    // Numbers are compared as numbers, since `1` equals `1.0`. Other values are
    // compared as texts.
    let equal = match (number(a), number(b)) {
        (Some(a), Some(b)) => a == b,
        _ => a == b,
    };
    let less = match (number(a), number(b)) {
        (Some(a), Some(b)) => a < b,
        _ => a < b,
    };
    Some(match rule {
        "equalTo" => equal,
        "notEqualTo" => !equal,
        "lessThan" => less,
        "lessOrEqual" => less || equal,
        "greaterThan" => !less && !equal,
        "greaterOrEqual" => !less || equal,
        _ => return None,
    })
}
