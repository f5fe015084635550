//! Rules on recorded traffic as JUnit XML.

use brakecheck_driver_model::RuleResult;

use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};
use crate::run_dir::counted;

/// Returns JUnit XML: a suite per recording, and a case per rule.
///
/// A case fails if the rule has an episode of a violation. If no row answers it, or if all
/// episodes are left out, it is skipped.
pub fn recorded_rules_junit<'a>(
    recordings: impl Iterator<Item = (&'a str, &'a [RuleResult])>,
) -> String {
    let suites = recordings.map(|(name, rules)| TestSuite {
        name: name.to_owned(),
        time_s: None,
        cases: rules.iter().map(|rule| case_of(name, rule)).collect(),
    });
    junit(&suites.collect::<Vec<_>>())
}

fn case_of(recording: &str, rule: &RuleResult) -> TestCase {
    let violated = TestMessage {
        kind: "rule violation",
        message: format!(
            "{} of {}",
            counted(rule.episodes, "episode"),
            counted(rule.vehicles, "vehicle")
        ),
        words: in_words(rule),
    };
    TestCase {
        class: recording.to_owned(),
        name: rule.rule.clone(),
        time_s: None,
        requirement: None,
        outcome: match (rule.episodes, rule.doubtful) {
            // Nothing was measured, so a pass would be wrong.
            _ if rule.rows == 0 => TestOutcome::Skipped("no row of a motor vehicle".to_owned()),
            (0, 0) if !rule.is_evaluated() => {
                TestOutcome::Skipped("no answer: no recorded row has a vehicle ahead".to_owned())
            }
            (0, 0) => TestOutcome::Passed,
            (0, some) => TestOutcome::Skipped(format!(
                "no answer: without {}, whose rows are interpolated or overlap",
                counted(some, "episode")
            )),
            _ => TestOutcome::Failed(violated),
        },
    }
}

fn in_words(rule: &RuleResult) -> String {
    let worst = rule.worst.as_ref().map_or(String::new(), |it| {
        let name = it.lead.as_ref();
        let lead = name.map_or(String::new(), |name| format!(" behind {name}"));
        format!(
            "\nworst: ρ = {:.3} at {:.2} s, {}{lead}",
            it.robustness, it.time_s, it.id
        )
    });
    format!(
        "{:.1} per 1,000 km, {:.4} % of the time, {} left out{worst}",
        rule.per_1000_km(),
        100.0 * rule.share(),
        counted(rule.doubtful, "episode")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_without_an_answer_does_not_pass() {
        for ([rows, rows_evaluated, episodes, doubtful], attributes) in [
            ([10, 8, 0, 0], r#"tests="1" skipped="0" failures="0""#),
            ([10, 8, 1, 2], r#"tests="1" skipped="0" failures="1""#),
            ([10, 8, 0, 2], r#"tests="1" skipped="1" failures="0""#),
            ([10, 0, 0, 0], r#"tests="1" skipped="1" failures="0""#),
            ([10, 0, 1, 0], r#"tests="1" skipped="0" failures="1""#),
            ([0, 0, 0, 0], r#"tests="1" skipped="1" failures="0""#),
        ] {
            let rule = RuleResult {
                rule: "keeps a gap".to_owned(),
                rows,
                rows_evaluated,
                rows_broken: 0,
                vehicles: episodes,
                episodes,
                doubtful,
                distance_km: 1.0,
                worst: None,
            };
            let text = recorded_rules_junit(std::iter::once(("tracks.csv", &[rule][..])));
            assert!(text.contains(attributes), "{attributes}: {text}");
        }
    }
}
