//! Grid worlds: assembly of a checked scenario.

use std::sync::Arc;

use indexmap::IndexMap;

use super::family::TrainingEgos;
use super::language::{Judging, Language, constants, rule_of, rulebook};
use super::warnings::Warnings;
use super::{
    Change, Repeats, RuleSpec, Scenario, check, counts_check, dry_run, includes, limits, vacuous,
};
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::World;
use crate::scene::grid::{Arena, GridSpec, GridWorld, Starts, position};
use crate::world_file::{GridAdoFile, GridEgoFile, GridFile, RuleFile};

/// Greatest side of a map, in fine cells.
const MAX_SIDE: u32 = 200;
/// Greatest number of steps of an episode.
const MAX_STEPS: u32 = 100_000;
/// Greatest number of moves of an ado.
const MAX_MOVES: usize = 100;
/// Greatest number of fine cells of a map whose pairs are listed by `AllPairs`.
const MAX_LISTED_CELLS: usize = 400;

/// Reports all counts above their limits.
///
/// Moves have a limit of their own.
fn too_much(problems: &mut Problems, file: &GridFile) {
    let top = ValuePath::top();
    let counts = [
        ("signals", file.signals.0.len(), limits::SIGNALS),
        ("formulas", file.formulas.0.len(), limits::FORMULAS),
        ("constants", file.constants.0.len(), limits::CONSTANTS),
        ("learners", file.learners.0.len(), limits::LEARNERS),
        ("reuse", file.reuse.0.len(), limits::REUSE),
        ("allow", file.allow.len(), limits::ALLOWED),
        ("ego_spec", file.ego_spec.len(), limits::STL_BYTES),
    ];
    for (field, count, limit) in counts {
        limits::within(problems, &top.to(field), count, limit);
    }
    let ado = top.to("ado");
    let observed = file.ado.observe.len();
    limits::within(problems, &ado.to("observe"), observed, limits::OBSERVED);
    includes::refuse(problems, &ado.to("rulebook"), &file.ado.rulebook);
    limits::rules(problems, &ado.to("rulebook"), &file.ado.rulebook);
    limits::texts(problems, &file.formulas, &file.signals);
}

pub(super) fn build(text: &str, file: GridFile) -> Result<Scenario, Vec<Problem>> {
    let mut problems = Problems::new(text);
    let top = ValuePath::top();
    too_much(&mut problems, &file);
    problems.done()?;
    let mut warnings = Warnings::allowing(&mut problems, &top.to("allow"), &file.allow);
    warnings.question(&file.question);
    warnings.ado(&top.to("ado"), &file.ado.rulebook, &file.ado.observe);
    check::reward(&mut problems, &top.to("reward"), &file.reward);
    counts_check::nothing_touches(&mut problems, &top, file.judge, &file.counts);
    let learner = check::learner(&mut problems, &top.to("learner"), &file.learner);
    let learners = check::learners(&mut problems, &top.to("learners"), &file.learners);
    moves(&mut problems, &top.to("ado"), &file.ado);
    let rules = rules(
        &mut problems,
        &top.to("ado").to("rulebook"),
        &file.ado.rulebook,
    );
    let GridEgoFile::Flees { step, at_wall } = file.ego;
    let mut spec = GridSpec {
        world: file.name.clone(),
        arena: Arena {
            size: file.map.size,
            refine: file.map.refine,
            ego_step: step,
            at_wall,
        },
        horizon: file.horizon,
        moves: file.ado.moves,
        neutral: file.ado.neutral,
        starts: file.starts,
        extra: Vec::new(),
        derived: Vec::new(),
        constants: indexmap::IndexMap::new(),
        observe: Vec::new(),
    };
    // The geometry is checked before anything is bound, since the horizon
    // follows from it.
    if let Err(misfit) = fits(&spec) {
        let place = misfit.in_file(&top);
        problems.add(&place, misfit.what, misfit.label, misfit.help);
    }
    problems.done()?;
    spec.constants = constants(
        &mut problems,
        &top.to("constants"),
        f64::from(spec.steps()),
        "horizon",
        &file.constants,
    );
    let catalogue = spec.catalogue().into_iter();
    let offers = catalogue.map(|offer| (offer.signal, offer.range));
    // The clock of a grid counts steps of 1.
    let mut language = Language::new(1.0, offers, spec.constants.clone());
    spec.derived = language.derive(&mut problems, &top.to("signals"), &file.signals)?;
    let (names, ego_spec) =
        language.specification(&mut problems, &file.formulas, &file.ego_spec)?;
    for rule in &rules {
        language.bind(&mut problems, &rule.place, &rule.formula, &names);
    }
    let observed = file.ado.observe.into_iter().enumerate();
    let observe = top.to("ado").to("observe");
    let observed: Vec<(String, ValuePath)> =
        observed.map(|(i, name)| (name, observe.at(i))).collect();
    spec.observe = language.observe(&mut problems, &observed, &observe);
    problems.done()?;
    // Invariant: a formula that is missing here is a mistake above.
    let ego_spec = ego_spec.ok_or_else(Vec::new)?;
    // Only used signals are published.
    spec.extra = language.published();
    let world = GridWorld::new(spec).map_err(|error| problems.ended(&top, error.to_string()))?;
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
    let reuse: IndexMap<String, Change> = file
        .reuse
        .0
        .into_iter()
        .map(|(name, change)| (name, change.into()))
        .collect();
    let mut scenario = Scenario {
        name: file.name,
        question: file.question,
        source: file.source,
        requirement: file.requirement,
        origin: None,
        text: text.to_owned(),
        ego_spec,
        rules,
        names,
        learner,
        learners,
        learning: None,
        goals: Vec::new(),
        against: TrainingEgos::Nominal,
        left_out: None,
        family: None,
        reuse,
        // The ego of a grid is deterministic, so repeated runs are equal.
        repeats: Repeats::default(),
        warnings: Vec::new(),
        world: World::Grid(world),
        rulebook: Arc::new(rulebook),
        programs_allowed: false,
        fresh_egos: false,
        traffic: Default::default(),
        laws: None,
    };
    check::reuse(&mut problems, &top.to("reuse"), &scenario);
    dry_run::begins_well(&mut problems, &top, &scenario);
    problems.done()?;
    warnings.found(dry_run::tie(text, &scenario));
    warnings.found(vacuous::decided_at_once(&scenario));
    warnings.bounds(&scenario);
    scenario.warnings = warnings.of(text);
    Ok(scenario)
}

fn moves(problems: &mut Problems, path: &ValuePath, ado: &GridAdoFile) {
    let count = ado.moves.len();
    if count == 0 || count > MAX_MOVES {
        let what = format!("an ado with {count} moves");
        let help = format!("give 1 to {MAX_MOVES}, such as (0, 1) for up");
        problems.add(&path.to("moves"), what, "here", Some(help));
        return;
    }
    if count <= ado.neutral {
        let what = format!("neutral action {} of {count} moves", ado.neutral);
        let help = Some("actions count from 0".to_owned());
        problems.add(&path.to("neutral"), what, "no such action", help);
    }
    for (i, step) in ado.moves.iter().enumerate() {
        let place = path.to("moves").at(i);
        // Saturating, because the least integer has no absolute value.
        let far = (MAX_SIDE as i32) < step.0.saturating_abs().max(step.1.saturating_abs());
        if far {
            let what = format!("a move of ({}, {}) cells", step.0, step.1);
            let help = Some(format!("at most {MAX_SIDE} along an axis"));
            problems.add(&place, what, "too far", help);
        }
        // A second of two equal moves would be an action without a meaning of its
        // own.
        if ado.moves[..i].contains(step) {
            let what = format!("the move ({}, {}) is given twice", step.0, step.1);
            problems.add(&place, what, "second time", None);
        }
    }
}

fn rules(problems: &mut Problems, path: &ValuePath, file: &[RuleFile]) -> Vec<RuleSpec> {
    let mut rules: Vec<RuleSpec> = Vec::new();
    for (i, rule) in file.iter().enumerate() {
        let place = path.at(i).to("stl");
        // Without a priority of its own, a rule ranks by its place in the list.
        rules.extend(rule_of(problems, place, rule, "ado", rules.len()));
    }
    rules
}

/// Value that does not fit a grid, with the field of a change.
pub(super) struct Misfit {
    pub(super) field: &'static str,
    pub(super) what: String,
    label: &'static str,
    pub(super) help: Option<String>,
}

impl Misfit {
    /// Returns the place in a world file.
    fn in_file(&self, top: &ValuePath) -> ValuePath {
        match self.field {
            "size" | "refine" => top.to("map").to(self.field),
            "ego_step" => top.to("ego").to("step"),
            other => top.to(other),
        }
    }
}

/// Refuses numbers that make no game.
pub(super) fn fits(spec: &GridSpec) -> Result<(), Misfit> {
    let Arena {
        size,
        refine,
        ego_step,
        ..
    } = spec.arena;
    let misfit = |field, what: String, label, help: String| {
        Err(Misfit {
            field,
            what,
            label,
            help: Some(help),
        })
    };
    if !(2..=MAX_SIDE).contains(&size) {
        let help = format!("give 2 to {MAX_SIDE} cells a side");
        return misfit(
            "size",
            format!("a map of {size} cells a side"),
            "out of range",
            help,
        );
    }
    // The product of both is the side of the map in fine cells, which is
    // limited too.
    if !(1..=MAX_SIDE / size).contains(&refine) {
        let help = format!(
            "a side has at most {MAX_SIDE} fine cells: give 1 to {}",
            MAX_SIDE / size
        );
        return misfit(
            "refine",
            format!("cells cut into {refine}"),
            "out of range",
            help,
        );
    }
    // A longer step would leave every map.
    if ego_step > MAX_SIDE {
        let help = format!("at most {MAX_SIDE}");
        return misfit(
            "ego_step",
            format!("an ego that moves {ego_step} cells"),
            "too far",
            help,
        );
    }
    let steps = spec.steps();
    if !(1..=MAX_STEPS).contains(&steps) {
        let help = format!("give 1 to {MAX_STEPS} steps, such as PerSize(2) for K = 2n");
        return misfit(
            "horizon",
            format!("an episode of {steps} steps"),
            "out of range",
            help,
        );
    }
    if let Starts::Pairs(pairs) = &spec.starts {
        if pairs.is_empty() {
            let what = "an empty list of starts".to_owned();
            let help = "give pairs, such as ((0, 0), (3, 3)), or AllPairs".to_owned();
            return misfit("starts", what, "here", help);
        }
        for pair in pairs {
            // A start in contact would be decided before the first move.
            let both = position(pair.0, pair.1);
            let outside = !(spec.arena.holds(both.ego) && spec.arena.holds(both.ado));
            if outside || spec.arena.touching(both) {
                let what = if outside {
                    format!("the start {pair:?} is not on the map")
                } else {
                    format!("at the start {pair:?} the ego is captured already")
                };
                let last = spec.arena.side() - 1;
                let help = format!("cells count from 0 to {last}, and the two are a cell apart");
                return misfit("starts", what, "here", help);
            }
        }
    }
    // The number of pairs grows with the square of the number of cells.
    if spec.starts == Starts::AllPairs && spec.arena.cells() > MAX_LISTED_CELLS {
        let what = format!("all pairs of {} fine cells", spec.arena.cells());
        let help = format!("above {MAX_LISTED_CELLS} fine cells draw them: `starts: Uniform`");
        return misfit("starts", what, "too many to list", help);
    }
    Ok(())
}
