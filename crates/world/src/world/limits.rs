//! Limits of the counts in a world file.
//!
//! The limits are far above the needs of any world. Beyond them a check or a
//! physics step would take minutes, without a hint at the cause.

use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Actions, MotionPlan, Script};
use crate::world_file::{
    AdoFile, AgentFile, DriveFile, LightFile, OwnRoad, PlanFile, RuleFile, ScenarioFile, SignalFile,
};

/// Greatest count of something, with the words for messages.
#[derive(Clone, Copy)]
pub(super) struct Limit {
    pub most: usize,
    /// Owner of the counted items.
    of: &'static str,
    /// Name of the counted items.
    what: &'static str,
}

const fn at_most(most: usize, of: &'static str, what: &'static str) -> Limit {
    Limit { most, of, what }
}

pub(super) const AGENTS: Limit = at_most(100, "a world", "agents");
pub(super) const ROADS: Limit = at_most(100, "a world", "roads");
pub(super) const BODIES: Limit = at_most(1000, "a world", "bodies");
pub(super) const REUSE: Limit = at_most(1000, "a world", "egos under `reuse`");
pub(super) const LEARNERS: Limit = at_most(100, "a world", "learners");
pub(super) const SIGNALS: Limit = at_most(500, "a world", "signals of its own");
pub(super) const FORMULAS: Limit = at_most(500, "a world", "named formulas");
pub(super) const CONSTANTS: Limit = at_most(1000, "a world", "constants");
pub(super) const PARAMETERS: Limit = at_most(100, "a world", "parameters of its starts");
pub(super) const AXES: Limit = at_most(200, "a table of starts", "columns");
pub(super) const STRUCTURES: Limit = at_most(100, "a family", "structures");
pub(super) const PIECES: Limit = at_most(1000, "a road", "pieces");
pub(super) const POINTS: Limit = at_most(2000, "a polyline", "points");
pub(super) const OBSERVED: Limit = at_most(1000, "an ado", "observed signals");
pub(super) const RULES: Limit = at_most(100, "an ado", "rules");
pub(super) const ACTIONS: Limit = at_most(1000, "an ado", "actions");
pub(super) const STEPS: Limit = at_most(1000, "a script", "steps");
pub(super) const STL_BYTES: Limit = at_most(16 * 1024, "a formula", "bytes");
pub(super) const ALLOWED: Limit = at_most(100, "a world", "allowed warnings");

/// Reports a number above its limit at the value under `path`.
pub(super) fn within(problems: &mut Problems, path: &ValuePath, count: usize, limit: Limit) {
    let Limit { most, of, what } = limit;
    if most < count {
        let what = format!("{of} has at most {most} {what}, not {count}");
        problems.add(path, what, "too many", None);
    }
}

/// Reports all counts of a world that exceed their limits.
pub(super) fn check(problems: &mut Problems, file: &ScenarioFile) {
    let top = ValuePath::top();
    let counts = [
        ("agents", file.agents.len(), AGENTS),
        ("roads", file.roads.0.len(), ROADS),
        ("bodies", file.bodies.0.len(), BODIES),
        ("reuse", file.reuse.0.len(), REUSE),
        ("learners", file.learners.0.len(), LEARNERS),
        ("signals", file.signals.0.len(), SIGNALS),
        ("formulas", file.formulas.0.len(), FORMULAS),
        ("constants", file.constants.0.len(), CONSTANTS),
        ("parameters", file.parameters.0.len(), PARAMETERS),
        ("allow", file.allow.len(), ALLOWED),
        ("ego_spec", file.ego_spec.len(), STL_BYTES),
    ];
    for (field, count, limit) in counts {
        within(problems, &top.to(field), count, limit);
    }
    road(problems, &top.to("road"), &file.road);
    // Named roads have pieces only, and no polyline.
    for (name, road) in &file.roads.0 {
        let path = top.to("roads").to(name).to("pieces");
        within(problems, &path, road.pieces.len(), PIECES);
    }
    texts(problems, &file.formulas, &file.signals);
    if let Some(points) = &file.points {
        within(
            problems,
            &top.to("points").to("axes"),
            points.axes.len(),
            AXES,
        );
    }
    if let Some(family) = &file.train_against {
        let path = top.to("train_against").to("structures");
        within(problems, &path, family.structures.0.len(), STRUCTURES);
    }
    // Only agents within the limit are examined, so that the check itself stays
    // short.
    for (i, agent) in file.agents.iter().take(AGENTS.most).enumerate() {
        drive(problems, &top.to("agents").at(i).to("drive"), agent);
    }
}

/// Reports named formulas and signals that are too long.
pub(super) fn texts(
    problems: &mut Problems,
    formulas: &Ordered<String>,
    signals: &Ordered<SignalFile>,
) {
    // Long formulas cost time at every sample, in each of their monitors.
    let formulas = formulas
        .0
        .iter()
        .map(|(name, stl)| ("formulas", name, stl.len()));
    let signals = signals
        .0
        .iter()
        .map(|(name, signal)| ("signals", name, signal.expr().len()));
    for (field, name, bytes) in formulas.chain(signals) {
        let place = ValuePath::top().to(field).to(name);
        within(problems, &place, bytes, STL_BYTES);
    }
}

fn road(problems: &mut Problems, path: &ValuePath, road: &OwnRoad) {
    match road {
        // A file of lanes is written out as pieces first, which are counted then.
        OwnRoad::Straight { .. } | OwnRoad::OpenDrive { .. } => {}
        OwnRoad::Curved { pieces, .. } => {
            within(problems, &path.to("pieces"), pieces.len(), PIECES)
        }
        OwnRoad::Polyline { points_m, .. } => {
            within(problems, &path.to("points_m"), points_m.len(), POINTS);
        }
    }
}

/// Checks the counts of an agent's drive.
fn drive(problems: &mut Problems, path: &ValuePath, agent: &AgentFile) {
    match agent {
        AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } => match drive {
            DriveFile::Ado(file) => ado(problems, path, file),
            DriveFile::Script(steps) => within(problems, &path.at(0), steps.len(), STEPS),
            DriveFile::Scripted(Script::Profile(profile)) => {
                within(problems, &path.at(0), profile.len(), STEPS);
            }
            DriveFile::Scripted(Script::Walk(walk)) => {
                within(problems, &path.at(0), walk.len(), STEPS);
            }
            DriveFile::Ego(_)
            | DriveFile::Trained(_)
            | DriveFile::Scripted(_)
            | DriveFile::Story
            | DriveFile::Meet(_) => {}
        },
        AgentFile::Light { drive, .. } => match drive {
            LightFile::Ado(file) => ado(problems, path, file),
            LightFile::Schedule(schedule) => {
                within(problems, &path.at(0), schedule.0.len(), STEPS);
            }
            LightFile::Trained(_) => {}
        },
        AgentFile::Weather(weather) => ado(problems, path, weather.drive.ado()),
        AgentFile::Road(road) => ado(problems, path, road.drive.ado()),
        AgentFile::Turns { drive, .. } => ado(problems, path, drive.ado()),
        AgentFile::Obstacle { .. } => {}
    }
}

fn ado(problems: &mut Problems, path: &ValuePath, ado: &AdoFile) {
    let observed = ado.observe.as_ref().map_or(0, Vec::len);
    within(problems, &path.to("observe"), observed, OBSERVED);
    within(
        problems,
        &path.to("actions"),
        actions(&ado.actions),
        ACTIONS,
    );
    rules(problems, &path.to("rulebook"), &ado.rulebook);
    if let Some(MotionPlan::Script(steps)) = &ado.base as &Option<PlanFile> {
        within(problems, &path.to("base"), steps.len(), STEPS);
    }
}

/// Checks the number of an ado's rules, and the length of their formulas.
pub(super) fn rules(problems: &mut Problems, path: &ValuePath, rules: &[RuleFile]) {
    within(problems, path, rules.len(), RULES);
    // Rules beyond the limit are one mistake already.
    for (i, rule) in rules.iter().take(RULES.most).enumerate() {
        within(problems, &path.at(i).to("stl"), rule.stl().len(), STL_BYTES);
    }
}

/// Number of actions, without building any of them.
fn actions(actions: &Actions) -> usize {
    match actions {
        Actions::Accelerations(all) => all.len(),
        // Saturating, because the product of two long lists may overflow.
        Actions::Grid(grid) => grid.accelerations.len().saturating_mul(grid.lateral.len()),
        Actions::Walks(all) => all.len(),
        Actions::Phases(all) => all.len(),
        Actions::Rates(all) => all.len(),
        Actions::Curvatures(all) => all.len(),
        Actions::Turns(all) => all.len(),
        Actions::Deviate(added) => {
            let lateral = added.lateral_mps.len();
            added.accelerations.len().saturating_mul(lateral)
        }
    }
}
