//! Assembly of a checked scenario: names are resolved and formulas bound.

use std::collections::HashSet;
use std::sync::Arc;

use super::agents::Agents;
use super::family::TrainingEgos;
use super::language::{Judging, Language, constants, rulebook};
use super::runs::{Assembled, InnerWorld, RunSource, WorldOrigin};
use super::scenario_kind::DriveScenario;
use super::starts::EntryPositions;
use super::warnings::Warnings;
use super::{
    Scenario, check, counts_check, dry_run, environment, family_check, includes, kind_of_world,
    limits, odd_starts, per_ado, plans, points, road_ado, roads, slope_and_wind, starts,
    storyboards, trained, turns, vacuous,
};
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::ron_file::read;
use crate::scene::World;
use crate::scene::drive::{DriveSpec, DriveWorld};
use crate::stl::Names;
use crate::world_file::{AgentFile, ScenarioFile, WindFile, nominal_grades};

/// Returns a checked scenario after trial runs.
pub(super) fn build(
    file: &str,
    runs: &dyn RunSource,
    text: &str,
    parsed: ScenarioFile,
) -> Result<Scenario, Vec<Problem>> {
    let origin = WorldOrigin {
        file,
        runs,
        assemble: within,
    };
    let mut problems = Problems::new(text);
    let top = ValuePath::top();
    // Limits come first: beyond them the checks below would take minutes.
    limits::check(&mut problems, &parsed);
    problems.done()?;
    let mut warnings = Warnings::allowing(&mut problems, &top.to("allow"), &parsed.allow);
    problems.done()?;
    warnings.driving(&parsed);
    // Each stage ends before the next stage, since later checks assume that
    // earlier checks passed.
    let (mut scenario, world) = assemble(origin, text, parsed)?;
    let driving = DriveScenario::new(&scenario, &world);
    check::reuse(&mut problems, &top.to("reuse"), &scenario);
    vacuous::check(&mut problems, &top, driving);
    problems.done()?;
    dry_run::begins_well(&mut problems, &top, &scenario);
    problems.done()?;
    // A rule that no run keeps is an error. Rules that are only never kept to
    // the end give a warning.
    let excluding = dry_run::can_be_kept(&mut problems, &scenario);
    problems.done()?;
    let excluding = excluding.or_else(|| dry_run::kept_to_the_end(&scenario));
    warnings.found(dry_run::tie(&scenario.text, &scenario));
    warnings.found(excluding);
    warnings.found(vacuous::warnings(driving));
    warnings.found(vacuous::decided_at_once(&scenario));
    warnings.bounds(&scenario);
    warnings.unseen(driving);
    warnings.spec_without_ego(driving);
    warnings.found(odd_starts::warnings(driving));
    scenario.warnings = warnings.of(&scenario.text);
    Ok(scenario)
}

/// Assembles the world of a run that a world refers to.
///
/// Trial runs are omitted, because they took place before its training.
fn within(origin: WorldOrigin<'_>, text: &str) -> Assembled {
    let one = |problem| vec![problem];
    Ok(match kind_of_world::kind(text).map_err(one)? {
        kind_of_world::WorldKind::Scenario => {
            let parsed = read::parse(text).map_err(one)?;
            let mut problems = Problems::new(text);
            limits::check(&mut problems, &parsed);
            problems.done()?;
            let (scenario, world) = assemble(origin, text, parsed)?;
            Some(InnerWorld {
                world,
                rules: scenario.rules,
                names: scenario.names,
            })
        }
        kind_of_world::WorldKind::Grid => None,
    })
}

/// Returns whether every agent of a file was read, under a name of its own.
///
/// Formulas may then mention all signals of the world. The signals of weather and of a road
/// that an ado lays depend on their bounds, so a mistake in them leaves a world incomplete.
fn are_complete(agents: &Agents<'_>, file: &ScenarioFile) -> bool {
    let turns = usize::from(agents.turns.is_some());
    let read = agents.entries.len() + agents.light_entries.len() + turns;
    let names: HashSet<&str> = file.agents.iter().map(AgentFile::name).collect();
    let are_named = names.iter().all(|name| check::is_identifier(name));
    agents.ego.is_some() && are_named && [read, names.len()] == [file.agents.len(); 2]
}

/// Assembles a scenario and its world without trial runs.
fn assemble(
    origin: WorldOrigin<'_>,
    text: &str,
    file: ScenarioFile,
) -> Result<(Scenario, DriveWorld), Vec<Problem>> {
    let mut problems = Problems::new(text);
    let top = ValuePath::top();
    check::clock(&mut problems, &top.to("clock"), &file.clock);
    // Formulas of a clock with a mistake have no samples.
    let has_clock = problems.is_empty();
    check::after_contact(&mut problems, &top.to("after_contact_s"), &file);
    check::origin(&mut problems, &top.to("origin"), file.origin.as_ref());
    let (road, sensors) = environment::read(&mut problems, &file);
    slope_and_wind::check(&mut problems, &file);
    let roads = roads::placed(&mut problems, &top.to("roads"), &road, &file.roads);
    check::reward(&mut problems, &top.to("reward"), &file.reward);
    counts_check::check(&mut problems, &top, &file);
    let others = counts_check::others(&file);
    check::repeats(&mut problems, &top.to("repeats"), file.repeats);
    let traffic = includes::traffic(&mut problems, &file);
    let learners = check::learners(&mut problems, &top.to("learners"), &file.learners);
    let constants = constants(
        &mut problems,
        &top.to("constants"),
        file.clock.horizon_s,
        "clock",
        &file.constants,
    );
    let agents = Agents::read(&mut problems, origin, &file, (&road, &roads));
    // Formulas mention agents and parameters. If one is missing, they would have second errors.
    // Otherwise their mistakes are reported with those of the agents.
    if !has_clock || !are_complete(&agents, &file) {
        problems.done()?;
    }
    let Agents {
        agents,
        ego: Some(ego),
        entries,
        lights,
        light_entries,
        weather,
        road_ado,
        turns,
        mut observed,
        observe,
        sees_usual,
        own_observe,
        learners: own_learners,
        mut rules,
        judged,
        written_out,
        ..
    } = agents
    else {
        // Invariant: a missing ego is a problem, and there was none.
        return Err(Vec::new());
    };

    let learner = per_ado::learner(&mut problems, &file, own_learners);
    let taken: Vec<&str> = constants.keys().map(String::as_str).collect();
    let place = top.to("parameters");
    let before = problems.len();
    let parameters = points::parameters(&mut problems, &place, &file.parameters, &taken);
    if problems.len() > before {
        problems.done()?;
    }

    // Signals and formulas are filled in below, since the catalogue depends on
    // the spec.
    let mut spec = DriveSpec {
        world: file.name.clone(),
        clock: file.clock,
        plant: file.plant,
        after_contact_s: file.after_contact_s,
        road: road.clone(),
        roads,
        bodies: file.bodies.0.clone(),
        agents,
        ego,
        story: None,
        lights,
        weather,
        grades: nominal_grades(&file.grades),
        vertical_curve_m: file.vertical_curve_m,
        banks: slope_and_wind::banks_of(&file.banks),
        wind: file.wind.as_ref().map(WindFile::nominal),
        turns: turns.as_ref().map(|(turns, _)| turns.clone()),
        road_ado: road_ado.as_ref().map(|(road, _)| road.clone()),
        sensors,
        extra: Vec::new(),
        derived: Vec::new(),
        constants: constants.clone(),
        observe: Vec::new(),
        own_observe,
        parameters,
        formulas: Names::default(),
        environment: Vec::new(),
        points: Vec::new(),
    };
    let list = top.to("agents");
    let in_list = EntryPositions {
        agents: &entries,
        lights: &light_entries,
    };
    per_ado::names(&mut problems, &learner, &spec);
    let mut family = None;
    // Geometry assumes values within their bounds.
    if problems.is_empty() {
        spec.environment = environment::drawn(&file, &spec);
        if let Some(board) = &file.storyboard {
            spec.story = storyboards::read(&mut problems, &top.to("storyboard"), board, &spec);
            storyboards::check_actors(&mut problems, &list, &file, &spec, &entries);
            counts_check::check_story(&mut problems, &top, &file.counts, spec.story.as_deref());
        }
        starts::check(&mut problems, &list, &spec, &entries);
        starts::on_the_road(&mut problems, &list, &spec, in_list);
        roads::beside_themselves(&mut problems, &top, &spec);
        environment::check_geometry(&mut problems, &spec, &entries);
        if let Some((_, place)) = &road_ado {
            road_ado::check(&mut problems, place, &list, &spec, in_list);
        }
        trained::check(&mut problems, &list, &spec, in_list);
        if let Some((turns, place)) = &turns {
            turns::check(&mut problems, place, turns, &spec);
        }
        let place = top.to("train_against");
        family = file.train_against.and_then(|family| {
            family_check::family(&mut problems, &place, family, &spec, &file.reuse.0)
        });
    }
    // The checks below read a spec that is complete only without a mistake.
    let is_sound = problems.is_empty();

    // Formulas are bound to all available signals first. Then only used signals
    // are published.
    let catalogue = spec.catalogue().into_iter();
    let offers = catalogue.map(|offer| (offer.signal, offer.range));
    let mut language = Language::new(spec.clock.sample_s, offers, constants);
    spec.derived = language.derive(&mut problems, &top.to("signals"), &file.signals)?;
    let (mut names, ego_spec) =
        language.specification(&mut problems, &file.formulas, &file.ego_spec)?;
    if is_sound && !judged.is_empty() {
        // Rules of trained ados are bound to the signals of a world without mistakes.
        problems.done()?;
        for ado in &judged {
            ado.judge(
                &mut problems,
                &mut language,
                &mut names,
                &mut spec,
                &mut rules,
            );
        }
        problems.done()?;
    }
    plans::bind(&mut problems, &mut language, &names, &list, &spec, &entries);
    storyboards::bind(&mut problems, &mut language, &names, &spec);
    for rule in &rules {
        language.bind(&mut problems, &rule.place, &rule.formula, &names);
    }
    let observe = observe.unwrap_or_else(|| list.clone());
    // Default observations come last, so that listed signals keep their order.
    if sees_usual {
        let usual = spec.usual_observation().into_iter();
        observed.extend(usual.map(|name| (name, observe.clone())));
    }
    // A world without actions has no ado that observes.
    if spec.action_sets().next().is_some() {
        spec.observe = language.observe(&mut problems, &observed, &observe);
    }
    if is_sound {
        let place = top.to("points");
        spec.points = points::read(&mut problems, &place, file.points.as_ref(), &spec);
        storyboards::check_points(&mut problems, &place.to("rows"), &spec);
    }
    spec.formulas = names.clone();
    problems.done()?;
    // Invariant: a formula that is missing here is a mistake above.
    let ego_spec = ego_spec.ok_or_else(Vec::new)?;
    spec.extra = language.published();
    let world = DriveWorld::new(spec).map_err(|error| problems.ended(&top, error.to_string()))?;
    // Only the assembled world knows the observations and the joint actions.
    check::laws_fit(
        &mut problems,
        learners.values().chain([&learner]),
        world.spaces(),
    );
    problems.done()?;
    let judging = Judging {
        judge: file.judge,
        counts: file.counts,
        reward: file.reward,
    };
    let rulebook = rulebook(world.schema(), &ego_spec, &rules, &names, judging)
        .map_err(|error| problems.ended_in_stl(&top.to("ego_spec"), &error))?;
    let default_goals = counts_check::default_goals(others, &learner, &rulebook, world.schema());
    let scenario = Scenario {
        name: file.name,
        question: file.question,
        source: file.source,
        requirement: file.requirement,
        origin: file.origin,
        // The text replaces run directories by their content, so it is
        // self-contained.
        text: trained::with_values(text, &written_out),
        ego_spec,
        rules,
        names,
        learner,
        learners,
        learning: None,
        goals: file.goals.unwrap_or(default_goals),
        against: TrainingEgos::Nominal,
        left_out: None,
        family: family.map(Arc::new),
        reuse: file.reuse.0,
        repeats: file.repeats,
        warnings: Vec::new(),
        world: World::Drive(world.clone()),
        rulebook: Arc::new(rulebook),
        // No file consents to a program by itself.
        programs_allowed: false,
        fresh_egos: false,
        traffic,
        laws: file.traffic.map(Arc::new),
    };
    Ok((scenario, world))
}
