//! Language of a world's formulas: signals, derived signals, constants and names.
//!
//! It is the same for all kinds of worlds.

use std::collections::HashSet;

use indexmap::IndexMap;

use super::RuleSpec;
use super::check;
use super::scenario::bound_rules;
use crate::ron_file::Ordered;
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::rulebook::{Counts, JudgeKind, Reward, Rulebook};
use crate::scene::{Derived, Observed};
use crate::stl::{Constants, Expr, Formula, Names, Settings, StlError};
use crate::trace::{Schema, Signal};
use crate::world_file::{RuleFile, SignalFile};

/// Names that formulas could not distinguish from the language.
const RESERVED: [&str; 3] = ["T", "inf", "end"];

/// Signals of a world, with those that are used.
pub(super) struct Language {
    sample_s: f64,
    signals: Vec<Signal>,
    ranges: IndexMap<String, (f64, f64)>,
    constants: Constants,
    used: HashSet<String>,
}

impl Language {
    /// Returns the language of all signals of a scene, with ranges, and the constants.
    pub(super) fn new(
        sample_s: f64,
        offers: impl Iterator<Item = (Signal, (f64, f64))>,
        constants: Constants,
    ) -> Language {
        let mut language = Language {
            sample_s,
            signals: Vec::new(),
            ranges: IndexMap::new(),
            constants,
            used: HashSet::new(),
        };
        for (signal, range) in offers {
            language.ranges.insert(signal.name.clone(), range);
            language.signals.push(signal);
        }
        language
    }

    /// Schema of the signals so far. `None` if two clash, which is reported elsewhere.
    fn schema(&self) -> Option<Schema> {
        Schema::new(self.sample_s, self.signals.iter().cloned()).ok()
    }

    /// Adds the derived signals of the file, in order.
    ///
    /// # Errors
    /// There are mistakes so far, and one is the name of a signal.
    pub(super) fn derive(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        file: &Ordered<SignalFile>,
    ) -> Result<Vec<Derived>, Vec<Problem>> {
        let mut all = Vec::new();
        let mut are_named = true;
        for (i, (name, signal)) in file.0.iter().enumerate() {
            // Later names are needed for a helpful error: a signal only uses
            // signals above it.
            let later: Vec<&str> = file.0.keys().skip(i).map(String::as_str).collect();
            let key = path.to(name);
            let before = problems.len();
            check::signal_name(problems, &key, name, self.ranges.contains_key(name));
            are_named &= problems.len() == before;
            let derived = self.derive_one(problems, &key, &later, signal);
            if derived.is_none() && !self.ranges.contains_key(name) {
                // Declared nevertheless, so that formulas with it are no second error.
                self.ranges.insert(name.clone(), usual_range(""));
                self.signals.push(Signal::real(name.as_str(), "", ""));
            }
            all.extend(derived);
        }
        // Formulas with the name that was meant would be second errors.
        if !are_named {
            problems.done()?;
        }
        Ok(all)
    }

    /// Adds the first of `names`, of which the others are declared later.
    fn derive_one(
        &mut self,
        problems: &mut Problems,
        key: &ValuePath,
        names: &[&str],
        signal: &SignalFile,
    ) -> Option<Derived> {
        let (name, later) = names.split_first()?;
        let name = *name;
        let described = signal.described();
        let place = match described {
            Some(_) => key.to("expr"),
            None => key.clone(),
        };
        let expr: Expr = match signal.expr().parse() {
            Ok(expr) => expr,
            Err(error) => {
                problems.stl(&place, &error);
                return None;
            }
        };
        let so_far = self.schema()?;
        if let Err(error) = expr.bind(&so_far, &self.constants) {
            let quoted = signal.expr().get(error.span()).unwrap_or_default();
            // The error may quote the name, which the list below does not.
            let refused = quoted.trim_matches(['"', '`', '\'']);
            if later.contains(&refused) || refused == name {
                problems.too_early(&place, &error, refused, name)
            } else {
                problems.stl(&place, &error)
            }
            return None;
        }
        let mentioned = expr.signals();
        let used = mentioned.iter().map(|name| (*name).to_owned());
        // Signals that a derived signal reads are published with it.
        self.used.extend(used);
        let unit = match described.and_then(|it| it.unit.as_ref()) {
            Some(unit) => unit.clone(),
            None => unit_of(&expr, &so_far),
        };
        // The range only scales observations. Values outside of it are valid.
        let stated = described.and_then(|it| it.range);
        let range = stated.unwrap_or_else(|| usual_range(&unit));
        if range.1 <= range.0 {
            let what = format!("the range ({}, {}) is empty", range.0, range.1);
            problems.add(&key.to("range"), what, "low before high", None);
        }
        self.ranges.insert(name.to_owned(), range);
        let stated = described.and_then(|it| it.about.clone());
        let about = stated.unwrap_or_else(|| signal.expr().to_owned());
        let signal = Signal::real(name, unit, about);
        self.signals.push(signal.clone());
        Some(Derived { signal, expr })
    }

    /// Adds a constant that no formula of the file names.
    pub(super) fn constant(&mut self, name: String, value: f64) {
        self.constants.insert(name, value);
    }

    /// Adds a derived signal that no formula of the file names.
    pub(super) fn add(&mut self, derived: Derived) {
        let name = derived.signal.name.to_string();
        let mentioned = derived.expr.signals().into_iter();
        self.used.extend(mentioned.map(str::to_owned));
        self.ranges.insert(name, usual_range(&derived.signal.unit));
        self.signals.push(derived.signal);
    }

    /// Returns the constants and the named formulas of the file.
    pub(super) fn names(
        &self,
        problems: &mut Problems,
        path: &ValuePath,
        file: &Ordered<String>,
    ) -> Names {
        let top = ValuePath::top();
        let before = problems.len();
        for name in self.constants.keys() {
            let taken = self.ranges.contains_key(name);
            check::free_name(problems, &top.to("constants").to(name), name, taken);
        }
        let mut formulas = IndexMap::new();
        for (name, text) in &file.0 {
            let taken = self.ranges.contains_key(name) || self.constants.contains_key(name);
            check::free_name(problems, &path.to(name), name, taken);
            if let Some(formula) = formula(problems, &path.to(name), text) {
                formulas.insert(name.clone(), formula);
            }
        }
        let names = Names {
            formulas,
            constants: self.constants.clone(),
        };
        // Formulas that are not used must be valid too.
        if let (Some(schema), true) = (self.schema(), problems.len() == before) {
            for (name, formula) in &names.formulas {
                if let Err(error) = formula.bind_with(&schema, &names, &Settings::default()) {
                    problems.stl(&path.to(name), &error);
                }
            }
        }
        names
    }

    /// Binds a formula to all available signals, and records those that it uses.
    pub(super) fn bind(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        formula: &Formula,
        names: &Names,
    ) {
        let Some(schema) = self.schema() else {
            return;
        };
        match formula.bind_with(&schema, names, &Settings::default()) {
            Ok(monitor) => {
                let signals = monitor.signals().into_iter();
                let used = signals.map(|position| schema.signals()[position].name.clone());
                self.used.extend(used);
            }
            Err(error) => problems.stl(path, &error),
        }
    }

    /// Returns the named formulas and the ego's specification, which is bound.
    ///
    /// A specification that is missing is among the mistakes.
    ///
    /// # Errors
    /// There are mistakes so far, and one is in a named formula.
    pub(super) fn specification(
        &mut self,
        problems: &mut Problems,
        formulas: &Ordered<String>,
        ego_spec: &str,
    ) -> Result<(Names, Option<Formula>), Vec<Problem>> {
        let place = ValuePath::top().to("ego_spec");
        let before = problems.len();
        let names = self.names(problems, &ValuePath::top().to("formulas"), formulas);
        let are_sound = problems.len() == before;
        let ego_spec = formula(problems, &place, ego_spec);
        // Every formula that uses a wrong one would be a second error.
        if !are_sound {
            problems.done()?;
        }
        if let Some(ego_spec) = &ego_spec {
            self.bind(problems, &place, ego_spec, &names);
        }
        Ok((names, ego_spec))
    }

    /// Binds a formula that must not look ahead, because a trigger waits for it.
    pub(super) fn bind_past(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        formula: &Formula,
        names: &Names,
    ) {
        let schema = self.schema();
        let bound = schema.map(|schema| formula.bind_with(&schema, names, &Settings::default()));
        if let Some(Ok(monitor)) = bound
            // A horizon of 0 samples reads only the present and the past.
            && monitor.horizon_samples() != Some(0)
        {
            let what = "a trigger waits for what lies ahead";
            let help = "say it of the present and the past: `once`, `historically`, `since`, \
                        `prev` and `rise` look back";
            problems.add(path, what, "looks ahead", Some(help.to_owned()));
        }
        // Bound once more, for the list of used signals and for its own mistakes.
        self.bind(problems, path, formula, names);
    }

    /// Returns the observed signals with their scales, each once.
    ///
    /// `list` is the place of the observations in the file.
    pub(super) fn observe(
        &mut self,
        problems: &mut Problems,
        names: &[(String, ValuePath)],
        list: &ValuePath,
    ) -> Vec<Observed> {
        if names.is_empty() {
            let what = "an ado that observes nothing cannot learn";
            let help = "give `observe` at least one signal, such as \"time_left\"".to_owned();
            problems.add(list, what, "nothing is observed", Some(help));
        }
        let mut observe: Vec<Observed> = Vec::new();
        for (name, path) in names {
            let Some(&(lo, hi)) = self.ranges.get(name) else {
                let known: Vec<&str> = self.ranges.keys().map(String::as_str).collect();
                problems.unknown(path, "signal", name, &known);
                continue;
            };
            self.used.insert(name.clone());
            // A signal that is listed twice counts once, and a warning mentions
            // it.
            if !observe.iter().any(|observed| observed.name == *name) {
                observe.push(Observed {
                    name: name.clone(),
                    mid: (lo + hi) / 2.0,
                    half: (hi - lo) / 2.0,
                });
            }
        }
        observe
    }

    /// Returns the names of all used signals, in order.
    pub(super) fn published(&self) -> Vec<String> {
        let names = self.signals.iter().map(|signal| signal.name.clone());
        names.filter(|name| self.used.contains(name)).collect()
    }
}

/// Settings of a file for the judgement of episodes.
pub(super) struct Judging {
    pub(super) judge: JudgeKind,
    pub(super) counts: Counts,
    pub(super) reward: Reward,
}

/// Binds the specification and all rules to the published signals.
///
/// # Errors
///
/// Returns an error if a formula does not fit the signals.
pub(super) fn rulebook(
    schema: &Schema,
    ego_spec: &Formula,
    rules: &[RuleSpec],
    names: &Names,
    judging: Judging,
) -> Result<Rulebook, StlError> {
    let settings = Settings::default();
    let monitors = rules
        .iter()
        .map(|rule| rule.formula.bind_with(schema, names, &settings))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Rulebook {
        spec: ego_spec.bind_with(schema, names, &settings)?,
        rules: bound_rules(rules, monitors),
        judge: judging.judge,
        counts: judging.counts,
        reward: judging.reward,
    })
}

/// Returns the constants of the file and T.
///
/// `given_by` is the field that determines T.
pub(super) fn constants(
    problems: &mut Problems,
    path: &ValuePath,
    horizon_s: f64,
    given_by: &str,
    file: &Ordered<f64>,
) -> Constants {
    let mut constants = Constants::new();
    constants.insert("T".to_owned(), horizon_s);
    for (name, value) in &file.0 {
        if RESERVED.contains(&name.as_str()) {
            let what = format!("`{name}` is reserved");
            let help = match name.as_str() {
                "T" => format!("`T` is the horizon, given by `{given_by}`"),
                _ => "formulas read it as the end of the run".to_owned(),
            };
            problems.add(&path.to(name), what, "here", Some(help));
        }
        // Inserted even if reserved, so that formulas with it are no second
        // error.
        constants.insert(name.clone(), *value);
    }
    constants
}

/// Unit of a sum or difference of signals of one unit. Otherwise empty.
fn unit_of(expr: &Expr, schema: &Schema) -> String {
    let mentioned = expr.signals().into_iter();
    let mut units = mentioned
        .filter_map(|name| schema.position(name))
        .map(|position| schema.signals()[position].unit.as_ref());
    match units.next() {
        Some(first) if expr.keeps_units() && units.all(|unit| unit == first) => first.to_owned(),
        _ => String::new(),
    }
}

/// Default range by which a derived signal of a unit is observed.
fn usual_range(unit: &str) -> (f64, f64) {
    match unit {
        "m" => (0.0, 100.0),
        "m/s" => (0.0, 30.0),
        "m/s²" => (-5.0, 5.0),
        "s" => (0.0, 20.0),
        _ => (-1.0, 1.0),
    }
}

/// Returns a rule of an ado, or reports the mistakes of its formula.
///
/// Rules without a priority are ranked by `rank`, their position.
pub(super) fn rule_of(
    problems: &mut Problems,
    place: ValuePath,
    file: &RuleFile,
    ado: &str,
    rank: usize,
) -> Option<RuleSpec> {
    // The rules of a file replace its name before, so a name here is a mistake already.
    let rule = file.rule()?;
    Some(RuleSpec {
        name: rule.name.clone(),
        ado: ado.to_owned(),
        priority: rule.priority.unwrap_or(rank),
        formula: formula(problems, &place, &rule.stl)?,
        requirement: rule.requirement.clone(),
        place,
    })
}

/// Parses a formula and reports its mistakes.
pub(super) fn formula(problems: &mut Problems, path: &ValuePath, text: &str) -> Option<Formula> {
    let parsed = text.parse();
    parsed.map_err(|error| problems.stl(path, &error)).ok()
}
