//! From a read file to a checked scenario: names resolved, formulas bound.

use std::collections::HashSet;
use std::sync::Arc;

use indexmap::IndexMap;

use super::check::{self, Problems};
use super::error::{Problem, did_you_mean, known_names};
use super::file::{AgentFile, DriveFile, NumberOrRange, ScenarioFile, StartFile};
use super::locate::Path;
use super::{RuleSpec, Scenario, bound_rules};
use crate::rulebook::{JudgeKind, Reward, Rulebook};
use crate::scene::drive::{Agent, Drive, DriveSpec, DriveWorld, EgoDrive, Place, Range, schema_of};
use crate::scene::{Derived, Observed, World};
use crate::sim::Body;
use crate::stl::{Constants, Expr, Formula, Names, Settings, StlError};
use crate::trace::{Schema, Signal};

/// Names that formulas could not tell from the language.
const RESERVED: [&str; 3] = ["T", "inf", "end"];

pub(super) fn build(text: &str, file: ScenarioFile) -> Result<Scenario, Vec<Problem>> {
    let mut problems = Problems::new(text);
    let top = Path::top();
    check::clock(&mut problems, &top.to("clock"), &file.clock);
    check::road(&mut problems, &top.to("road"), &file.road);
    check::reward(&mut problems, &top.to("reward"), &file.reward);
    if let Err(error) = file.learner.validate() {
        let place = top.to("learner").to(error.field);
        problems.add(&place, error.to_string(), "here", Some(error.help));
    }
    let constants = constants(&mut problems, &top, &file);
    let mut observed_names: Vec<(String, Path)> = Vec::new();
    let mut rules: Vec<RuleSpec> = Vec::new();
    let agents = agents(&mut problems, &top, &file, &mut observed_names, &mut rules);
    problems.done()?;

    let mut spec = DriveSpec {
        world: file.name.clone(),
        clock: file.clock,
        plant: file.plant,
        road: file.road.clone(),
        agents,
        extra: Vec::new(),
        derived: Vec::new(),
        constants: constants.clone(),
        observe: Vec::new(),
    };
    check::starts(&mut problems, &top.to("agents"), &spec);
    problems.done()?;

    // Bind everything to all signals there are, then publish what is used.
    let catalogue = spec.catalogue();
    spec.extra = catalogue.iter().map(|o| o.signal.name.clone()).collect();
    let mut ranges: IndexMap<String, (f64, f64)> = catalogue
        .iter()
        .map(|offer| (offer.signal.name.clone(), offer.range))
        .collect();
    let mut used: HashSet<String> = HashSet::new();
    derived(
        &mut problems,
        &top,
        &file,
        &mut spec,
        &mut ranges,
        &mut used,
    );
    problems.done()?;
    let everything = match schema_of(&spec) {
        Ok(schema) => schema,
        Err(error) => {
            problems.add(&top.to("signals"), error.to_string(), "here", None);
            return Err(problems.into_list());
        }
    };
    let names = Names {
        formulas: formulas(&mut problems, &top, &file),
        constants,
    };
    let ego_spec = formula(&mut problems, &top.to("ego_spec"), &file.ego_spec);
    problems.done()?;
    let Some(ego_spec) = ego_spec else {
        return Err(problems.into_list());
    };
    let bound = [(&ego_spec, top.to("ego_spec"))]
        .into_iter()
        .chain(rules.iter().map(|rule| (&rule.formula, rule.place.clone())));
    for (formula, path) in bound {
        bind(
            &mut problems,
            &path,
            formula,
            &everything,
            &names,
            &mut used,
        );
    }
    for (name, path) in &observed_names {
        let Some(&(lo, hi)) = ranges.get(name) else {
            let known: Vec<&str> = ranges.keys().map(String::as_str).collect();
            problems.unknown(path, "signal", name, &known);
            continue;
        };
        used.insert(name.clone());
        if !spec.observe.iter().any(|observed| observed.name == *name) {
            spec.observe.push(Observed {
                name: name.clone(),
                mid: (lo + hi) / 2.0,
                half: (hi - lo) / 2.0,
            });
        }
    }
    problems.done()?;
    spec.extra.retain(|name| used.contains(name));
    let world = match DriveWorld::new(spec) {
        Ok(world) => World::Drive(world),
        Err(error) => {
            problems.add(&top, error.to_string(), "here", None);
            return Err(problems.into_list());
        }
    };
    let rulebook = match rulebook(
        world.schema(),
        &ego_spec,
        &rules,
        &names,
        file.judge,
        file.reward,
    ) {
        Ok(rulebook) => Arc::new(rulebook),
        Err(error) => {
            problems.stl(&top.to("ego_spec"), &error);
            return Err(problems.into_list());
        }
    };
    let mut scenario = Scenario {
        name: file.name,
        question: file.question,
        source: file.source,
        text: text.to_owned(),
        ego_spec,
        rules,
        names,
        learner: file.learner,
        reuse: file.reuse.0,
        warnings: Vec::new(),
        world,
        rulebook,
    };
    check::reuse(&mut problems, &top.to("reuse"), &scenario);
    check::begins_well(&mut problems, &top, &scenario);
    problems.done()?;
    scenario.warnings = check::warnings(text, &scenario);
    Ok(scenario)
}

fn rulebook(
    schema: &Schema,
    ego_spec: &Formula,
    rules: &[RuleSpec],
    names: &Names,
    judge: JudgeKind,
    reward: Reward,
) -> Result<Rulebook, StlError> {
    let settings = Settings::default();
    let monitors = rules
        .iter()
        .map(|rule| rule.formula.bind_with(schema, names, &settings))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Rulebook {
        spec: ego_spec.bind_with(schema, names, &settings)?,
        rules: bound_rules(rules, monitors),
        judge,
        reward,
    })
}

fn constants(problems: &mut Problems, top: &Path, file: &ScenarioFile) -> Constants {
    let mut constants = Constants::new();
    constants.insert("T".to_owned(), file.clock.horizon_s);
    for (name, value) in &file.constants.0 {
        if RESERVED.contains(&name.as_str()) {
            let what = format!("`{name}` is reserved");
            let help = "`T` is the horizon in seconds, given by `clock`".to_owned();
            problems.add(&top.to("constants").to(name), what, "here", Some(help));
        }
        constants.insert(name.clone(), *value);
    }
    constants
}

fn agents(
    problems: &mut Problems,
    top: &Path,
    file: &ScenarioFile,
    observed: &mut Vec<(String, Path)>,
    rules: &mut Vec<RuleSpec>,
) -> Vec<Agent> {
    let mut agents: Vec<Agent> = Vec::new();
    let (mut egos, mut ados) = (0, 0);
    for (i, entry) in file.agents.iter().enumerate() {
        let path = top.to("agents").at(i);
        let AgentFile::Vehicle {
            name,
            body,
            lane,
            start,
            drive,
        } = entry;
        check::agent_name(problems, &path.to("name"), name);
        if file.agents[..i].iter().any(|other| other.name() == name) {
            let what = format!("two agents are called `{name}`");
            problems.add(&path.to("name"), what, "second one", None);
        }
        if file.road.lanes() <= *lane {
            let what = format!("lane {lane} on a road of {} lanes", file.road.lanes());
            let help = "lanes count from the right, from 0".to_owned();
            problems.add(&path.to("lane"), what, "no such lane", Some(help));
        }
        let body = find_body(problems, &path.to("body"), file, body);
        let before: Vec<&str> = file.agents[..i].iter().map(AgentFile::name).collect();
        let place = place(problems, &path.to("start"), start, &before);
        let drive_path = path.to("drive");
        let drive = match drive {
            DriveFile::Ego(controller) => {
                egos += 1;
                check::controller(problems, &drive_path.at(0), controller);
                Drive::Ego(EgoDrive::Stock(controller.clone()))
            }
            DriveFile::Scripted(script) => Drive::Scripted(script.clone()),
            DriveFile::Ado {
                actions,
                neutral,
                observe,
                rulebook,
            } => {
                ados += 1;
                check::actions(problems, &drive_path, actions, *neutral);
                for (j, signal) in observe.iter().enumerate() {
                    observed.push((signal.clone(), drive_path.to("observe").at(j)));
                }
                for (j, rule) in rulebook.iter().enumerate() {
                    let stl = drive_path.to("rulebook").at(j).to("stl");
                    let Some(formula) = formula(problems, &stl, &rule.stl) else {
                        continue;
                    };
                    rules.push(RuleSpec {
                        name: rule.name.clone(),
                        ado: name.clone(),
                        priority: rule.priority.unwrap_or(rules.len()),
                        formula,
                        place: stl,
                    });
                }
                Drive::Ado {
                    actions: actions.clone(),
                    neutral: *neutral,
                }
            }
        };
        if let (Some(body), Some(place)) = (body, place) {
            agents.push(Agent {
                name: name.clone(),
                body,
                lane: *lane,
                place,
                drive,
            });
        }
    }
    if egos != 1 {
        let what = format!("a world has exactly one ego, not {egos}");
        let help = "one agent has `drive: Ego(…)`".to_owned();
        problems.add(&top.to("agents"), what, "these agents", Some(help));
    }
    if ados == 0 {
        let what = "there is no ado to train".to_owned();
        let help = "give one agent `drive: Ado(actions: …, rulebook: […])`".to_owned();
        problems.add(&top.to("agents"), what, "these agents", Some(help));
    }
    agents
}

fn find_body(
    problems: &mut Problems,
    path: &Path,
    file: &ScenarioFile,
    name: &str,
) -> Option<Body> {
    if let Some(body) = file.bodies.0.get(name) {
        if let Err(error) = body.validate() {
            let place = Path::top().to("bodies").to(name).to(error.field);
            problems.add(&place, error.to_string(), "here", None);
        }
        return Some(body.clone());
    }
    match Body::shipped(name) {
        Some(Ok(body)) => Some(body),
        Some(Err(error)) => {
            problems.add(path, error.to_string(), "here", None);
            None
        }
        None => {
            let mut known: Vec<&str> = Body::shipped_names().collect();
            known.extend(file.bodies.0.keys().map(String::as_str));
            problems.unknown(path, "body", name, &known);
            None
        }
    }
}

fn place(
    problems: &mut Problems,
    path: &Path,
    start: &StartFile,
    before: &[&str],
) -> Option<Place> {
    let range = |problems: &mut Problems, field: &str, value: &NumberOrRange| -> Range {
        check::range(problems, &path.to(field), value.0);
        value.0
    };
    match start {
        StartFile::At { x_m, speed_mps } => Some(Place::At {
            x_m: range(problems, "x_m", x_m),
            speed_mps: range(problems, "speed_mps", speed_mps),
        }),
        StartFile::Ahead {
            of,
            headway_m,
            speed_mps,
        } => {
            let headway_m = range(problems, "headway_m", headway_m);
            let speed_mps = range(problems, "speed_mps", speed_mps);
            let Some(position) = before.iter().position(|name| name == of) else {
                problems.unknown(&path.to("of"), "agent declared before", of, before);
                return None;
            };
            Some(Place::Ahead {
                of: position,
                headway_m,
                speed_mps,
            })
        }
    }
}

fn derived(
    problems: &mut Problems,
    top: &Path,
    file: &ScenarioFile,
    spec: &mut DriveSpec,
    ranges: &mut IndexMap<String, (f64, f64)>,
    used: &mut HashSet<String>,
) {
    for (name, signal) in &file.signals.0 {
        let key = top.to("signals").to(name);
        let place = if signal.long {
            key.to("expr")
        } else {
            key.clone()
        };
        check::signal_name(problems, &key, name, ranges.contains_key(name));
        let expr: Expr = match signal.expr.parse() {
            Ok(expr) => expr,
            Err(error) => {
                problems.stl(&place, &error);
                continue;
            }
        };
        let Ok(so_far) = schema_of(spec) else {
            continue;
        };
        if let Err(error) = expr.bind(&so_far, &spec.constants) {
            problems.stl(&place, &error);
            continue;
        }
        let mentioned = expr.signals();
        used.extend(mentioned.iter().map(|name| (*name).to_owned()));
        let unit = match &signal.unit {
            Some(unit) => unit.clone(),
            None => unit_of(&signal.expr, &mentioned, &so_far),
        };
        let range = signal.range.unwrap_or_else(|| usual_range(&unit));
        if range.1 <= range.0 {
            let what = format!("the range ({}, {}) is empty", range.0, range.1);
            problems.add(&key.to("range"), what, "low before high", None);
        }
        ranges.insert(name.clone(), range);
        let about = signal.about.clone().unwrap_or_else(|| signal.expr.clone());
        spec.derived.push(Derived {
            signal: Signal::real(name.clone(), unit, about),
            expr,
        });
    }
}

/// The unit of a sum or difference of signals of one unit; else none.
fn unit_of(expr: &str, mentioned: &[impl AsRef<str>], schema: &Schema) -> String {
    let linear = !expr.contains(['*', '/']) && !expr.contains("pow") && !expr.contains("exp");
    let mut units = mentioned
        .iter()
        .filter_map(|name| schema.position(name.as_ref()))
        .map(|position| schema.signals()[position].unit.as_ref());
    match units.next() {
        Some(first) if linear && units.all(|unit| unit == first) => first.to_owned(),
        _ => String::new(),
    }
}

/// The range by which a derived signal of a unit is observed, unless given.
fn usual_range(unit: &str) -> (f64, f64) {
    match unit {
        "m" => (0.0, 100.0),
        "m/s" => (0.0, 30.0),
        "m/s²" => (-5.0, 5.0),
        "s" => (0.0, 20.0),
        _ => (-1.0, 1.0),
    }
}

fn formulas(problems: &mut Problems, top: &Path, file: &ScenarioFile) -> IndexMap<String, Formula> {
    let mut formulas = IndexMap::new();
    for (name, text) in &file.formulas.0 {
        let path = top.to("formulas").to(name);
        if let Some(formula) = formula(problems, &path, text) {
            formulas.insert(name.clone(), formula);
        }
    }
    formulas
}

/// Parses a formula and notes what is wrong with it.
fn formula(problems: &mut Problems, path: &Path, text: &str) -> Option<Formula> {
    let parsed = text.parse();
    parsed.map_err(|error| problems.stl(path, &error)).ok()
}

fn bind(
    problems: &mut Problems,
    path: &Path,
    formula: &Formula,
    schema: &Schema,
    names: &Names,
    used: &mut HashSet<String>,
) {
    match formula.bind_with(schema, names, &Settings::default()) {
        Ok(monitor) => {
            let signals = monitor.signals().into_iter();
            used.extend(signals.map(|position| schema.signals()[position].name.clone()));
        }
        Err(error) => problems.stl(path, &error),
    }
}

impl Problems<'_> {
    /// Notes an unknown name with a guess and what would be right.
    pub(super) fn unknown(&mut self, path: &Path, what: &str, name: &str, known: &[&str]) {
        let list = known_names("known", known.iter().copied());
        let help = match did_you_mean(name, known.iter().copied()) {
            Some(guess) => format!("{guess} — {list}"),
            None => list,
        };
        self.add(path, format!("no {what} `{name}`"), "unknown", Some(help));
    }
}
