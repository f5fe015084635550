//! Files of named rules for recorded vehicles, which worlds can include.

use brakecheck_stl::trace::{SchemaError, Signal};
use brakecheck_stl::{Constants, Formula, StlError};
use serde::{Deserialize, Serialize};

/// Named rules for recorded vehicles, written as RON.
///
/// The list of rules has the form of a rulebook in a world file. `vehicle` is the name
/// of each recorded vehicle in turn, and `lead` that of the vehicle ahead in its lane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "RuleFile", deny_unknown_fields)]
pub struct TrafficRuleFile {
    /// Name of the vehicle in the formulas, by default `ego`.
    #[serde(default = "ego")]
    pub vehicle: String,
    /// Name of the vehicle ahead in the formulas, by default `lead`.
    #[serde(default = "lead")]
    pub lead: String,
    /// Constants of the formulas.
    #[serde(default)]
    pub constants: Constants,
    /// Rules, in the order of the report.
    pub rules: Vec<TrafficRule>,
}

/// Rule of a rule file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "Rule", deny_unknown_fields)]
pub struct TrafficRule {
    /// Name in the report.
    pub name: String,
    /// Formula that holds at every sample. An outer `always` may be written.
    pub stl: String,
}

fn ego() -> String {
    "ego".to_owned()
}

fn lead() -> String {
    "lead".to_owned()
}

impl TrafficRule {
    /// Returns the formula under an `always` over the whole trace.
    ///
    /// # Errors
    /// The formula is invalid.
    pub fn always(&self) -> Result<String, StlError> {
        Ok(format!("always ({})", self.per_sample()?))
    }

    /// Returns the formula that holds at every sample, without an outer `always`.
    ///
    /// # Errors
    /// The formula is invalid.
    pub fn per_sample(&self) -> Result<Formula, StlError> {
        Ok(without_always(self.stl.parse()?))
    }
}

/// Error in a rule file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RulesError {
    /// The text is not RON of a rule file.
    #[error("invalid rule file at {0}")]
    Ron(#[from] ron::error::SpannedError),
    /// A formula is invalid, or names an unknown signal.
    #[error("rule `{rule}`: {source}")]
    Formula {
        /// Name of the rule.
        rule: String,
        /// Error in its formula.
        source: Box<StlError>,
    },
    /// There is no rule.
    #[error("there are no rules")]
    Empty,
    /// No vehicle is there to be judged.
    #[error("`{recording}` has no motor vehicle, so no rule was evaluated")]
    NoVehicle {
        /// Name of the recording.
        recording: String,
    },
    /// Two signals have the same name.
    #[error("`vehicle` and `lead` have the same name: {0}")]
    Names(#[from] SchemaError),
}

impl RulesError {
    /// Returns the fix in the imperative.
    pub fn help(&self) -> String {
        match self {
            RulesError::Ron(_) => {
                "write RuleFile(rules: [Rule(name: \"…\", stl: \"…\")])".to_owned()
            }
            RulesError::Formula { source, .. } => match source.help() {
                Some(help) => help.to_owned(),
                None => "`brakecheck stl --help` lists the signals".to_owned(),
            },
            RulesError::Empty => "add a rule".to_owned(),
            RulesError::NoVehicle { .. } => {
                "map the class column, since cars, vans, trucks and motorcycles are evaluated"
                    .to_owned()
            }
            RulesError::Names(_) => "give them different names".to_owned(),
        }
    }
}

impl TrafficRuleFile {
    /// Position of the Boolean that a vehicle is ahead in [`TrafficRuleFile::signals`].
    ///
    /// All signals after it are of that vehicle.
    pub const LEAD_PRESENT: usize = 5;

    /// Creates a file of rules with the vehicles `ego` and `lead`, without constants.
    pub fn of(rules: Vec<TrafficRule>) -> TrafficRuleFile {
        TrafficRuleFile {
            vehicle: ego(),
            lead: lead(),
            constants: Constants::default(),
            rules,
        }
    }

    /// Returns the RON text of the shipped rules for motorways.
    pub fn motorway_text() -> &'static str {
        include_str!("../rules/motorway.ron")
    }

    /// Parses a rule file.
    ///
    /// # Errors
    /// The text is not RON of a rule file.
    pub fn parse(text: &str) -> Result<TrafficRuleFile, RulesError> {
        Ok(ron::from_str(text)?)
    }

    /// Returns the signals of a vehicle, in the order of their columns.
    pub fn signals(&self) -> Vec<Signal> {
        let (own, lead) = (&self.vehicle, &self.lead);
        let real = |name: String, unit: &'static str, about: &str| Signal::real(name, unit, about);
        vec![
            real(format!("{own}.speed"), "m/s", "velocity along the heading"),
            real(
                format!("{own}.accel"),
                "m/s²",
                "acceleration along the heading",
            ),
            real(
                format!("{own}.s"),
                "m",
                "front bumper along the carriageway",
            ),
            real(
                format!("{own}.lateral"),
                "m",
                "offset to the left of the right lane",
            ),
            real(
                format!("{own}.lane"),
                "",
                "lane from the right, −1 outside of all",
            ),
            Signal::boolean(
                format!("{lead}.present"),
                "whether a vehicle is ahead within 120 m",
            ),
            real(
                format!("{lead}.speed"),
                "m/s",
                "its speed, the own speed without a lead",
            ),
            real(
                format!("{own}.{lead}.gap"),
                "m",
                "clearance to it, 120 without a lead",
            ),
            real(
                format!("{own}.{lead}.ttc"),
                "s",
                "clearance over closing speed, at most 100 s",
            ),
            real(
                format!("{own}.{lead}.closing"),
                "m/s",
                "closing speed, 0 without a lead",
            ),
        ]
    }
}

/// Removes an `always` over the whole trace, so that samples are judged one by one.
fn without_always(formula: Formula) -> Formula {
    // The canonical text has fixed brackets, whatever the file writes.
    let text = formula.to_string();
    let body = || {
        let with_bounds = text.strip_prefix("always")?;
        let rest = ["[0, T]", "[0, inf]"]
            .iter()
            .find_map(|bounds| with_bounds.strip_prefix(bounds))
            .unwrap_or(with_bounds);
        let inner = rest.strip_prefix(" (")?.strip_suffix(')')?;
        // Whole only if the first parenthesis closes at the end.
        let mut depth = 0_i32;
        let closes_early = inner.chars().any(|it| {
            depth += match it {
                '(' => 1,
                ')' => -1,
                _ => 0,
            };
            depth < 0
        });
        if closes_early {
            return None;
        }
        // A text that does not parse alone was cut wrongly, and the whole
        // formula is kept.
        inner.parse().ok()
    };
    body().unwrap_or(formula)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signals_of_the_lead_are_the_last() {
        let signals = TrafficRuleFile::of(Vec::new()).signals();
        let names: Vec<&str> = signals.iter().map(|it| &*it.name).collect();
        let (own, lead) = names.split_at(TrafficRuleFile::LEAD_PRESENT);
        assert!(own.iter().all(|name| !name.contains("lead")), "{names:?}");
        assert!(lead.iter().all(|name| name.contains("lead")), "{names:?}");
        assert_eq!(lead[0], "lead.present");
    }

    #[test]
    fn only_an_always_over_the_whole_trace_is_removed() {
        for (text, left) in [
            ("always (x > 1)", "x > 1"),
            ("always[0, T] (x > 1 and y > 2)", "(x > 1) and (y > 2)"),
            ("always[0, 2] (x > 1)", "always[0, 2] (x > 1)"),
            (
                "(always (x > 1)) and (y > 2)",
                "(always (x > 1)) and (y > 2)",
            ),
            ("x > 1", "x > 1"),
        ] {
            let formula: Formula = text.parse().expect(text);
            let expected: Formula = left.parse().expect(left);
            assert_eq!(without_always(formula).to_string(), expected.to_string());
        }
    }
}
