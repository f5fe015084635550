//! Rules that block an adversary, searched if there is no success within the rules.
//!
//! A world without a success is either safe or forbids everything, and the rows of both
//! look the same. A search without a rule shows the difference, rule by rule.
//!
//! Rules are searched only if a second, sampling search within them has no success either.
//! Otherwise a rule would be blamed for the limit of the first search.

use std::fmt;

use serde::Serialize;

use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::counted;
use crate::search::{Adversary, Cem, Search};
use crate::world::Scenario;

/// Most starts that are searched again.
const LOOKED_AT: usize = 12;
/// Simulations per start of the sampling search within the rules.
const SIMULATIONS: u64 = 100;

/// Numbers of starts from which the ego fails without certain rules.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RuleAblation {
    /// Name of the ego.
    pub ego: String,
    /// Number of searched starts.
    pub starts: usize,
    /// Starts that a sampling search solves within all rules.
    ///
    /// If there are any, no rule is to blame, and no rule is left out.
    pub within_rules: usize,
    /// Starts solved without any rule.
    pub(crate) without_all: usize,
    /// Starts solved without a single rule, rule by rule.
    pub without: Vec<(String, usize)>,
    /// Most switches of action in the searched sequences.
    pub switches: usize,
    /// Starts with a violation of the specification within the rules that does not count.
    ///
    /// `None` if every violation counts in this world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncounted: Option<usize>,
}

/// Searches the first of some starts again, without the rules.
///
/// `None`: there are no rules or no starts, or `watch` stopped it.
pub(super) fn in_the_way(
    ego: &EgoUnderTest,
    starts: &TestStarts,
    switches: usize,
    watch: &Watch<'_>,
) -> Option<RuleAblation> {
    let scenario = ego.scenario();
    let rules = &scenario.rulebook().rules;
    // Few starts are enough to find a rule that blocks all of them.
    let few = starts.first(LOOKED_AT);
    if rules.is_empty() || few.starts.is_empty() {
        return None;
    }
    watch.phase("searching without rules, one rule left out at a time");
    let solved_by = |search: Search<'_>, world: Scenario| {
        // Each of several searches would begin the progress of the phase anew.
        let cell = search.play(&ego.in_world(world), &few, &watch.quiet());
        cell.map_or(0, |cell| cell.row.successes)
    };
    // Sampling also reaches sequences with more changes than the first search allows.
    let sampling = Search {
        method: Cem::default().into(),
        budget: SIMULATIONS,
    };
    let within_rules = solved_by(sampling, scenario.clone());
    let solved = |world| solved_by(Search::switches(switches), world);
    // A success within the rules clears all of them, so nothing is left to search.
    let without_all = match within_rules {
        0 => solved(scenario.without_rules(|_| true)),
        _ => 0,
    };
    // If the ego does not fail without all rules, no single rule can be the cause.
    let each = rules.iter().filter(|_| without_all > 0);
    let without = each.map(|rule| {
        let world = scenario.without_rules(|name| name == rule.name);
        (rule.name.clone(), solved(world))
    });
    let counts_all = scenario.rulebook().counts.is_violation();
    let found = RuleAblation {
        switches,
        within_rules,
        uncounted: (!counts_all && within_rules == 0)
            .then(|| solved(scenario.counting_every_violation())),
        ego: ego.name().to_owned(),
        starts: few.starts.len(),
        without_all,
        without: without.collect(),
    };
    // Counts of an interrupted search would be too low.
    (!watch.stopped()).then_some(found)
}

impl fmt::Display for RuleAblation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (starts, all) = (counted(self.starts, "start"), self.without_all);
        let switches = counted(self.switches, "switch");
        write!(f, "{}: ", self.ego)?;
        if self.within_rules > 0 {
            return write!(
                f,
                "no sequence with at most {switches} succeeds, but a search with `--method cem` \
                 and {SIMULATIONS} simulations succeeds on {} of {starts}, with every rule \
                 kept: search further, no rule is in the way",
                self.within_rules
            );
        }
        if all == 0 {
            write!(
                f,
                "no sequence of actions with at most {switches} makes the ego violate its \
                 specification on any of {starts}, with the rules or without them"
            )?;
            return match self.uncounted {
                None | Some(0) => write!(
                    f,
                    "; look at the starts: are agents near enough to the ego to reach it \
                     within the horizon?"
                ),
                Some(some) => write!(
                    f,
                    "; on {some} of them it violates its specification, but not in a way that \
                     this world `counts`"
                ),
            };
        }
        write!(
            f,
            "no sequence with at most {switches} succeeds within the rules; without them the ego \
             violates its specification on {all} of {starts}"
        )?;
        let mut blocking: Vec<&(String, usize)> = self
            .without
            .iter()
            .filter(|(_, solved)| *solved > 0)
            .collect();
        // Stable, so equal rules keep the order of the rulebook.
        blocking.sort_by_key(|(_, solved)| std::cmp::Reverse(*solved));
        if blocking.is_empty() {
            // Two rules may each forbid the same success.
            return write!(f, ", but without any single one of them on none");
        }
        for (nth, (rule, solved)) in blocking.iter().enumerate() {
            let begin = if nth == 0 { "; without" } else { ", without" };
            write!(f, "{begin} “{rule}” alone on {solved}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::test_starts;
    use crate::world::PlantKind;

    /// A lead car that may not brake, for two reasons or for one.
    fn blocked(rules: &str) -> RuleAblation {
        let text =
            include_str!("../../../../worlds/acc.ron").replace("plant: Rigid", "plant: Kinematic");
        let (before, rest) = text.split_once("rulebook: [").expect("rules");
        let (_, after) = rest.split_once("],").expect("their end");
        let text = format!("{before}rulebook: [{rules}],{after}");
        let world = Scenario::parse("acc.ron", &text).expect("a world");
        let watch = Watch::unwatched();
        let starts = test_starts(&world, 3, 3, &watch).expect("starts");
        in_the_way(&EgoUnderTest::nominal(&world), &starts, 1, &watch).expect("looked at")
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
            one.without_all > 0 && words.contains("without “gentle” alone"),
            "{words}"
        );
        assert!(!words.contains("limit"), "{words}");
        let two = blocked(&format!("{gentle}, {also}"));
        assert!(two.to_string().ends_with("on none"), "{two}");
    }

    #[test]
    fn no_rule_is_blamed_if_a_wider_search_succeeds_within_the_rules() {
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(PlantKind::Kinematic);
        let watch = Watch::unwatched();
        let starts = test_starts(&world, 3, 12, &watch).expect("starts");
        let ego = EgoUnderTest::nominal(&world);
        let narrow = in_the_way(&ego, &starts, 0, &watch).expect("looked at");
        assert!(narrow.within_rules > 0 && narrow.without.iter().all(|(_, solved)| *solved == 0));
        let words = narrow.to_string();
        assert!(words.contains("no rule is in the way"), "{words}");
        assert!(!words.contains('“'), "{words}");
    }
}
