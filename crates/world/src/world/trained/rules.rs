//! Rules of a trained ado, judged in the world in which it acts.
//!
//! The rules were written in the words of its training world. Here each signal is the
//! one of the agents that take the parts. Derived signals, constants and formulas of the
//! training world get names that begin with the ado's own.

use indexmap::IndexMap;

use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::{DriveSpec, TrainedAdo};
use crate::stl::Names;
use crate::world::language::Language;
use crate::world::rule_spec::RuleSpec;
use crate::world::runs::InnerWorld;

/// Rulebook of a training world, as far as it concerns one ado.
pub(in crate::world) struct HomeRulebook {
    rules: Vec<RuleSpec>,
    names: Names,
}

/// Trained ado of a world whose rules are judged.
pub(in crate::world) struct JudgedAdo {
    pub(in crate::world) name: String,
    /// Place of its drive in the file.
    pub(in crate::world) path: ValuePath,
    pub(in crate::world) trained: TrainedAdo,
    pub(in crate::world) home: HomeRulebook,
}

impl HomeRulebook {
    pub(super) fn of(home: &InnerWorld, part: &str) -> HomeRulebook {
        let rules = home.rules.iter().filter(|rule| rule.ado == part);
        HomeRulebook {
            rules: rules.cloned().collect(),
            names: home.names.clone(),
        }
    }
}

impl JudgedAdo {
    /// Adds its rules to `rules`, and all that they name to the language and the spec.
    pub(in crate::world) fn judge(
        &self,
        problems: &mut Problems,
        language: &mut Language,
        names: &mut Names,
        spec: &mut DriveSpec,
        rules: &mut Vec<RuleSpec>,
    ) {
        let used = self.used();
        let here = match self.trained.signals_in(spec, &self.name, &used) {
            Ok(here) => here,
            Err(error) => {
                let what = format!("its rules cannot be judged here: {error}");
                let help = "map the part with `names`, or write `rules: Unjudged`".to_owned();
                return problems.add(&self.path.to("rules"), what, "judged", Some(help));
            }
        };
        let new = |name: &str| self.new_name(name, &here);
        for (name, value) in &self.home.names.constants {
            if let Some(name) = used.contains(name).then(|| new(name)).flatten() {
                names.constants.insert(name.clone(), *value);
                spec.constants.insert(name.clone(), *value);
                language.constant(name, *value);
            }
        }
        // In the order of their world, since a signal mentions earlier ones only.
        for derived in &self.trained.home.derived {
            if used.iter().any(|used| *used == *derived.signal.name) {
                let derived = derived.renamed(&new);
                language.add(derived.clone());
                spec.derived.push(derived);
            }
        }
        for (name, formula) in &self.home.names.formulas {
            if let Some(name) = used.contains(name).then(|| new(name)).flatten() {
                names.formulas.insert(name, formula.renamed(&new));
            }
        }
        // Lower than every rule of the file, and in their own order.
        let below = rules
            .iter()
            .map(|rule| rule.priority.saturating_add(1))
            .max()
            .unwrap_or(0);
        rules.extend(self.home.rules.iter().map(|rule| RuleSpec {
            ado: self.name.clone(),
            priority: below.saturating_add(rule.priority),
            formula: rule.formula.renamed(&new),
            place: self.path.to("rules"),
            ..rule.clone()
        }));
    }

    /// Returns a name of the training world as it is here, `None` if it is the same.
    fn new_name(&self, name: &str, here: &IndexMap<String, String>) -> Option<String> {
        let derived = &self.trained.home.derived;
        let names = &self.home.names;
        // The horizon is that of this world.
        if name == "T" {
            return None;
        }
        let own = derived.iter().any(|derived| *derived.signal.name == *name)
            || names.constants.contains_key(name)
            || names.formulas.contains_key(name);
        if own {
            return Some(format!("{}.rule.{name}", self.name));
        }
        here.get(name).cloned()
    }

    /// Returns all names that its rules use, also through formulas and derived signals.
    fn used(&self) -> Vec<String> {
        let rules = self.home.rules.iter();
        let mut used: Vec<String> = rules.flat_map(|rule| rule.formula.names()).collect();
        let mut at = 0;
        while at < used.len() {
            let name = used[at].clone();
            if let Some(formula) = self.home.names.formulas.get(&name) {
                used.extend(formula.names());
            }
            let derived = self.trained.home.derived.iter();
            for derived in derived.filter(|derived| *derived.signal.name == *name) {
                used.extend(derived.expr.signals().into_iter().map(str::to_owned));
            }
            at += 1;
            // Each name is followed once, or a long chain would grow without bound.
            let (before, after) = used.split_at(at);
            let mut new: Vec<String> = Vec::new();
            for name in after {
                if !before.contains(name) && !new.contains(name) {
                    new.push(name.clone());
                }
            }
            used.truncate(at);
            used.extend(new);
        }
        used
    }
}
