//! Rules that the neutral action breaks by itself.

use std::fmt;

use crate::rulebook::Verdict;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Constant, play};
use crate::world::Scenario;

/// Starts that are played.
const PLAYED: u64 = 50;
/// Least number of starts from which a rule is broken. From the others the ego fails
/// before.
const LEAST: usize = 38;

/// Rule that the neutral action breaks from nearly every start, and never keeps.
///
/// An ado then breaks it wherever it does nothing. Hardly any episode is lawful, so a
/// training learns to keep this rule and nothing else.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeutralRule {
    /// Name of the rule that is broken most often.
    pub rule: String,
    /// Starts from which it is broken.
    pub broken: usize,
    /// Number of starts.
    pub starts: usize,
}

impl NeutralRule {
    /// Plays the neutral action from some starts, and returns the rule that it breaks.
    ///
    /// `None`: it keeps all rules from some start, or the ego is a program, which is not
    /// started for this.
    pub fn of(world: &Scenario) -> Option<NeutralRule> {
        let mut bench = world.bench();
        let mut ado = Constant(bench.spaces().neutral);
        let mut broken = vec![0; world.rulebook().rules.len()];
        for index in 0..PLAYED {
            // Calibration starts, because training and test starts stay untouched.
            let key = StartKey {
                purpose: Purpose::Calibration,
                seed: 0,
                index,
            };
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            // A program starts with its first percept, so this beginning runs none.
            if index == 0 {
                bench.begin(&start, noise, Aftermath::Skip);
                bench.fork()?;
            }
            let episode = play(&mut bench, &start, noise, &mut ado, Aftermath::Skip);
            match episode.verdict {
                Verdict::Foul { rule, .. } => broken[rule] += 1,
                // Ados that cross the ego's way keep such rules from few starts only.
                Verdict::Held { .. } => return None,
                // All others end the episode before a rule could break, so they say
                // nothing of it.
                _ => {}
            }
        }
        if broken.iter().sum::<usize>() < LEAST {
            return None;
        }
        let most = (0..broken.len()).max_by_key(|rule| broken[*rule])?;
        Some(NeutralRule {
            rule: world.rulebook().rules[most].name.clone(),
            broken: broken[most],
            starts: PLAYED as usize,
        })
    }

    /// Returns the fix.
    pub fn help(&self) -> &'static str {
        "an ado that does nothing should keep its rules: move the starts, ask for less, or \
         require it only from a later time on"
    }
}

impl fmt::Display for NeutralRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the neutral action breaks the rule `{}` from {} of {} starts",
            self.rule, self.broken, self.starts
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_that_doing_nothing_breaks_is_found_and_others_are_not() {
        let text = include_str!("../../../../worlds/acc.ron");
        let with = |rule: &str| {
            let rules = format!("rulebook: [Rule(name: \"slow\", stl: \"{rule}\"),");
            let text = text.replacen("rulebook: [", &rules, 1);
            let world = Scenario::parse("acc.ron", &text).expect("sound");
            NeutralRule::of(&world)
        };
        let found = with("always[1, T] (ado.speed <= 4.9)").expect("it keeps its speed");
        // From the other starts the ego fails before the rule is broken.
        assert_eq!((&*found.rule, found.starts), ("slow", 50));
        assert!((45..=50).contains(&found.broken), "{found}");
        // From some starts it is slower.
        assert_eq!(with("always[1, T] (ado.speed <= 20)"), None);
        let warned = Scenario::shipped_names().filter(|name| {
            let world = Scenario::shipped(name).expect("shipped").expect("sound");
            NeutralRule::of(&world).is_some()
        });
        assert_eq!(warned.collect::<Vec<_>>(), [""; 0]);
    }
}
