//! Parameters with their values, and texts that refer to them.

use std::collections::BTreeMap;

use super::error::ImportError;
use super::expression::evaluate;
use super::tree::XmlNode;

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
        let text = self.text(node, name)?;
        number(&text).ok_or_else(|| node.error(format!("`{name}` is `{text}`, which is no number")))
    }

    /// Returns an attribute as a number, or 0 if it is missing.
    pub fn number_or_zero(&self, node: &XmlNode, name: &str) -> Result<f64, ImportError> {
        match node.raw(name) {
            Some(_) => self.number(node, name),
            None => Ok(0.0),
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
                Err(why) => Err(node.error(format!("the expression `{trimmed}`: {why}"))),
            };
        }
        match trimmed.strip_prefix('$') {
            Some(name) => match self.get(name) {
                Some(value) => Ok(value.to_owned()),
                None => Err(node.error(format!("there is no parameter `{name}`"))),
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
            let value = self.get(declaration.need("name")?.trim_start_matches('$'));
            let value = value.unwrap_or_default();
            let mut groups = declaration.all("ConstraintGroup").peekable();
            let mut holds = groups.peek().is_none();
            for group in groups {
                let mut all = true;
                for constraint in group.all("ValueConstraint") {
                    let other = self.text(constraint, "value")?;
                    let rule = constraint.need("rule")?;
                    let kept = compared(value, rule, &other);
                    all &= kept.ok_or_else(|| {
                        constraint.error(format!("the rule `{rule}` is not understood"))
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

/// Parses a finite number.
pub fn number(text: &str) -> Option<f64> {
    let value: f64 = text.trim().parse().ok()?;
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
