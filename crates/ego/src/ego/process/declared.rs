//! Parameters that a program declares in its hello, with their values in an episode.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::ego::{Fault, FaultKind};

/// Most parameters of a program.
const MOST: usize = 100;
/// Most characters of a name.
const MOST_CHARS: usize = 64;

/// Parameter that a program declares in its hello.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct DeclaredParameter {
    /// Name under which `reset` carries its value.
    pub name: String,
    /// Least value, in the parameter's own unit.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
    /// Value unless another is set.
    pub default: f64,
}

impl DeclaredParameter {
    /// Returns a problem of the declaration.
    fn flaw(&self) -> Option<String> {
        let DeclaredParameter {
            name,
            lo,
            hi,
            default,
        } = self;
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let is_name = (1..=MOST_CHARS).contains(&name.len()) && name.chars().all(is_word);
        if !is_name {
            let shown: String = name.chars().take(MOST_CHARS).collect();
            return Some(format!(
                "declares the parameter {shown:?}: a name has 1 to {MOST_CHARS} letters, digits \
                 or `_`"
            ));
        }
        // NaN fails the comparisons as well.
        let is_range = lo < hi && (*lo..=*hi).contains(default) && (hi - lo).is_finite();
        (!is_range).then(|| {
            format!(
                "declares the parameter `{name}` from {lo} to {hi} with the default {default}, \
                 which is no value between two ends"
            )
        })
    }
}

/// Returns the first problem of the parameters in a hello.
pub(super) fn flaw(declared: &[DeclaredParameter]) -> Option<String> {
    // Before the comparison of all names, whose cost grows with the square.
    if declared.len() > MOST {
        let count = declared.len();
        return Some(format!("declares {count} parameters, more than {MOST}"));
    }
    let twice = declared.iter().enumerate().find(|(at, one)| {
        let before = &declared[..*at];
        before.iter().any(|other| other.name == one.name)
    });
    if let Some((_, one)) = twice {
        return Some(format!("declares the parameter `{}` twice", one.name));
    }
    declared.iter().find_map(DeclaredParameter::flaw)
}

/// Returns the value of every declared parameter, where `set` has those that differ.
///
/// # Errors
/// A parameter is set that is not declared, or beyond its range.
pub(super) fn values<'a>(
    program: &str,
    declared: &'a [DeclaredParameter],
    set: &BTreeMap<String, f64>,
) -> Result<BTreeMap<&'a str, f64>, Fault> {
    let fail = |what: String| Fault::new(FaultKind::Protocol, format!("`{program}` {what}"));
    // Every set value is checked, since a misspelt one would silently change
    // nothing.
    for (name, value) in set {
        let Some(one) = declared.iter().find(|one| one.name == *name) else {
            let names: Vec<&str> = declared.iter().map(|one| one.name.as_str()).collect();
            let known = if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            };
            return Err(fail(format!(
                "declares no parameter `{name}` in its hello, which has: {known}"
            )));
        };
        if !(one.lo..=one.hi).contains(value) {
            let DeclaredParameter { lo, hi, .. } = one;
            return Err(fail(format!(
                "declares `{name}` from {lo} to {hi}, and {value} is outside"
            )));
        }
    }
    let value = |one: &'a DeclaredParameter| {
        let value = set.get(&one.name).copied().unwrap_or(one.default);
        (one.name.as_str(), value)
    };
    Ok(declared.iter().map(value).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gap(lo: f64, hi: f64, default: f64) -> DeclaredParameter {
        DeclaredParameter {
            name: "gap_s".to_owned(),
            lo,
            hi,
            default,
        }
    }

    #[test]
    fn declarations_without_a_range_or_a_name_are_refused() {
        assert_eq!(flaw(&[]), None);
        assert_eq!(flaw(&[gap(0.5, 2.0, 0.5)]), None);
        let named = |name: &str| DeclaredParameter {
            name: name.to_owned(),
            ..gap(0.0, 1.0, 0.5)
        };
        let cases = [
            (vec![gap(1.0, 1.0, 1.0)], "no value between"),
            (vec![gap(0.0, 1.0, 2.0)], "no value between"),
            (vec![gap(0.0, f64::NAN, 0.0)], "no value between"),
            (vec![gap(f64::NEG_INFINITY, 1.0, 0.0)], "no value between"),
            (vec![named("")], "a name has"),
            (vec![named("a=b")], "a name has"),
            (vec![gap(0.0, 1.0, 0.5), gap(0.0, 2.0, 0.5)], "twice"),
            (
                (0..101).map(|i| named(&format!("p{i}"))).collect(),
                "more than 100",
            ),
        ];
        for (declared, says) in cases {
            let found = flaw(&declared).expect(says);
            assert!(found.contains(says), "{found}");
        }
    }

    #[test]
    fn every_declared_parameter_has_its_default_or_the_value_that_is_set() {
        let other = DeclaredParameter {
            name: "gain".to_owned(),
            ..gap(0.0, 9.0, 3.0)
        };
        let declared = [gap(0.5, 2.0, 0.8), other];
        let set = |name: &str, value: f64| {
            let set = BTreeMap::from([(name.to_owned(), value)]);
            values("ego", &declared, &set)
        };
        let all = set("gap_s", 1.5).expect("declared");
        assert_eq!(all, BTreeMap::from([("gap_s", 1.5), ("gain", 3.0)]));
        for (name, value, says) in [
            ("gap", 1.0, "which has: gap_s, gain"),
            ("gap_s", 2.5, "and 2.5 is outside"),
            ("gap_s", f64::NAN, "outside"),
        ] {
            let fault = set(name, value).expect_err(says);
            assert!(fault.message.contains(says), "{}", fault.message);
        }
        // A program that declares nothing is sent nothing.
        assert_eq!(values("ego", &[], &BTreeMap::new()), Ok(BTreeMap::new()));
    }
}
