//! Which rules keep an adversary from what it could do without them: looked for
//! where a search found nothing lawful.
//!
//! A world in which nothing is found is either safe or forbids everything, and
//! the rows of both look the same. The same search without a rule tells them
//! apart, rule by rule.

use std::fmt;

use serde::Serialize;

use crate::experiment::{TestStarts, Watch};
use crate::search::{SearchRequest, Switches, search};
use crate::world::Scenario;

/// Starts that are looked at, at most.
const LOOKED_AT: usize = 12;

/// From how many starts search makes the ego fail once rules are left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RuleAblation {
    /// The ego.
    pub ego: String,
    /// Starts that were looked at.
    pub starts: usize,
    /// Solved without any rule.
    pub without_all: usize,
    /// Solved without one rule, rule by rule.
    pub without: Vec<(String, usize)>,
    /// Most switches of action of the sequences that were searched.
    pub switches: usize,
    /// Starts on which the ego violates its specification with all rules kept, in
    /// no way that counts; `None`: every violation counts in this world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncounted: Option<usize>,
}

/// Searches the first of some starts again, without the rules.
///
/// `None`: there are no rules or no starts, or `watch` stopped it.
pub(super) fn in_the_way(
    (scenario, ego): (&Scenario, &str),
    starts: &TestStarts,
    switches: usize,
    watch: &Watch<'_>,
) -> Option<RuleAblation> {
    let rules = &scenario.rulebook().rules;
    let few = starts.first(LOOKED_AT);
    if rules.is_empty() || few.starts.is_empty() {
        return None;
    }
    let solved = |world: &Scenario| {
        let request = SearchRequest {
            scenario: world,
            ego,
            method: Switches(switches).into(),
            budget: 0,
            starts: &few,
        };
        search(&request, &watch.quiet()).row.successes
    };
    let without_all = solved(&scenario.without_rules(|_| true));
    // Where nothing is found without any rule, no single one is in the way.
    let each = rules.iter().filter(|_| 0 < without_all);
    let without = each.map(|rule| {
        let world = scenario.without_rules(|name| name == rule.name);
        (rule.name.clone(), solved(&world))
    });
    let counts_all = scenario.rulebook().counts.is_violation();
    let found = RuleAblation {
        switches,
        uncounted: (!counts_all).then(|| solved(&scenario.counting_every_violation())),
        ego: ego.to_owned(),
        starts: few.starts.len(),
        without_all,
        without: without.collect(),
    };
    (!watch.stopped()).then_some(found)
}

fn switches_in_words(switches: usize) -> String {
    match switches {
        1 => "1 switch".to_owned(),
        _ => format!("{switches} switches"),
    }
}

impl fmt::Display for RuleAblation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (starts, all) = (self.starts, self.without_all);
        write!(f, "{}: ", self.ego)?;
        if all == 0 {
            write!(
                f,
                "no sequence of actions with at most {} makes the ego fail from any of {starts} \
                 starts, with the rules or without them",
                switches_in_words(self.switches)
            )?;
            return match self.uncounted {
                None | Some(0) => Ok(()),
                Some(some) => write!(
                    f,
                    "; from {some} of them it violates its specification, but not in a way that \
                     this world `counts`"
                ),
            };
        }
        write!(
            f,
            "search finds nothing that keeps the rules; without them it makes the ego fail from \
             {all} of {starts} starts"
        )?;
        let mut blocking: Vec<&(String, usize)> = self
            .without
            .iter()
            .filter(|(_, solved)| 0 < *solved)
            .collect();
        blocking.sort_by_key(|(_, solved)| std::cmp::Reverse(*solved));
        if blocking.is_empty() {
            return write!(f, ", but without any single one of them from none");
        }
        for (nth, (rule, solved)) in blocking.iter().enumerate() {
            let begin = if nth == 0 { "; without" } else { ", without" };
            write!(f, "{begin} “{rule}” alone from {solved}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::test_starts;

    /// A lead car that may not brake, for two reasons or for one.
    fn blocked(rules: &str) -> RuleAblation {
        let text = include_str!("../../worlds/acc.ron").replace("plant: Rigid", "plant: Kinematic");
        let (before, rest) = text.split_once("rulebook: [").expect("rules");
        let (_, after) = rest.split_once("],").expect("their end");
        let text = format!("{before}rulebook: [{rules}],{after}");
        let world = Scenario::parse("acc.ron", &text).expect("a world");
        let watch = Watch::unwatched();
        let starts = test_starts(&world, 3, 3, &watch).expect("starts");
        in_the_way((&world, "nominal"), &starts, 1, &watch).expect("looked at")
    }

    #[test]
    fn the_rule_that_forbids_everything_is_named() {
        let idle = r#"Rule(name: "limit", stl: "always (ado.speed <= 60)")"#;
        let gentle = r#"Rule(name: "gentle", stl: "always (ado.accel >= -0.5)")"#;
        let also = r#"Rule(name: "far", stl: "always (headway >= 4.8)")"#;
        let one = blocked(&format!("{idle}, {gentle}"));
        assert_eq!(one.without[0], ("limit".to_owned(), 0));
        assert_eq!(one.without[1], ("gentle".to_owned(), one.without_all));
        let words = one.to_string();
        assert!(
            0 < one.without_all && words.contains("without “gentle” alone"),
            "{words}"
        );
        assert!(!words.contains("limit"), "{words}");
        let two = blocked(&format!("{gentle}, {also}"));
        assert!(two.to_string().ends_with("from none"), "{two}");
    }
}
