//! From a read file to a checked scenario: names resolved, formulas bound.

use std::sync::Arc;

use super::check::{self, Problems};
use super::error::Problem;
use super::file::{AgentFile, DriveFile, NumberOrRange, ScenarioFile, StartFile};
use super::language::{Language, constants, formula, rulebook};
use super::locate::Path;
use super::{RuleSpec, Scenario};
use crate::scene::World;
use crate::scene::drive::{Agent, Drive, DriveSpec, DriveWorld, EgoDrive, Place, Range};
use crate::sim::Body;

pub(super) fn build(text: &str, file: ScenarioFile) -> Result<Scenario, Vec<Problem>> {
    let mut problems = Problems::new(text);
    let top = Path::top();
    check::clock(&mut problems, &top.to("clock"), &file.clock);
    check::road(&mut problems, &top.to("road"), &file.road);
    check::reward(&mut problems, &top.to("reward"), &file.reward);
    check::learner(&mut problems, &top.to("learner"), &file.learner);
    for (name, learner) in &file.learners.0 {
        check::learner(&mut problems, &top.to("learners").to(name), learner);
    }
    let constants = constants(
        &mut problems,
        &top.to("constants"),
        (file.clock.horizon_s, "clock"),
        &file.constants,
    );
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
    let catalogue = spec.catalogue().into_iter();
    let offers = catalogue.map(|offer| (offer.signal, offer.range));
    let mut language = Language::new(spec.clock.sample_s, offers, constants);
    spec.derived = language.derive(&mut problems, &top.to("signals"), &file.signals);
    problems.done()?;
    let names = language.names(&mut problems, &top.to("formulas"), &file.formulas);
    let ego_spec = formula(&mut problems, &top.to("ego_spec"), &file.ego_spec);
    problems.done()?;
    let Some(ego_spec) = ego_spec else {
        return Err(problems.into_list());
    };
    language.bind(&mut problems, &top.to("ego_spec"), &ego_spec, &names);
    for rule in &rules {
        language.bind(&mut problems, &rule.place, &rule.formula, &names);
    }
    spec.observe = language.observe(&mut problems, &observed_names);
    problems.done()?;
    spec.extra = language.published();
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
        learners: file.learners.0,
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
