//! Rules on recorded traffic as JUnit XML.

use brakecheck_driver_model::RuleResult;
use maud::{PreEscaped, html};

use crate::visible::visible_markup;

/// Returns JUnit XML: a suite per recording, and a case per rule.
///
/// A case fails if the rule has an episode of a violation.
pub fn recorded_rules_junit<'a>(
    recordings: impl Iterator<Item = (&'a str, &'a [RuleResult])>,
) -> String {
    let recordings: Vec<_> = recordings.collect();
    let failures = |rules: &[RuleResult]| rules.iter().filter(|it| it.episodes > 0).count();
    let tests: usize = recordings.iter().map(|(_, rules)| rules.len()).sum();
    let failed: usize = recordings.iter().map(|(_, rules)| failures(rules)).sum();
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failed) errors="0" {
            @for (name, rules) in &recordings {
                testsuite name=(name) tests=(rules.len()) failures=(failures(rules)) errors="0" {
                    @for rule in *rules {
                        testcase classname=(name) name=(rule.rule) {
                            @if rule.episodes > 0 {
                                failure type="rule violation" message=(format!("{} episodes of {} vehicles", rule.episodes, rule.vehicles)) {
                                    (in_words(rule))
                                }
                            }
                        }
                    }
                }
            }
        }
    };
    visible_markup(&page.into_string()).into_owned()
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
