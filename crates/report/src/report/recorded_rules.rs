//! Rules on recorded traffic as JUnit XML.

use brakecheck_driver_model::RuleResult;

use super::junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};

/// Returns JUnit XML: a suite per recording, and a case per rule.
///
/// A case fails if the rule has an episode of a violation.
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
        message: format!("{} episodes of {} vehicles", rule.episodes, rule.vehicles),
        words: in_words(rule),
    };
    TestCase {
        class: recording.to_owned(),
        name: rule.rule.clone(),
        time_s: None,
        requirement: None,
        outcome: match rule.episodes {
            0 => TestOutcome::Passed,
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
        "{:.1} per 1,000 km, {:.4} % of the time, {} episodes left out{worst}",
        rule.per_1000_km(),
        100.0 * rule.share(),
        rule.doubtful
    )
}
