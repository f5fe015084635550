//! Reading of a road that an ado lays: its pieces and the agents on it.

use super::check::within;
use super::starts::{self, EntryPositions};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Actions, DriveSpec, MAX_HEADING_RAD, RoadAdo};
use crate::world_file::{OwnRoad, RangePoint, RoadAgentFile, ScenarioFile};

/// Bounds of the length of laid road ahead, in metres.
///
/// The least one is farther than any agent drives in a sample.
const AHEAD_M: (f64, f64) = (20.0, 1_000.0);
/// Bounds of the length of a piece, in metres.
///
/// A piece per sample keeps up with any agent.
const PIECE_M: (f64, f64) = (10.0, 200.0);

/// Reads a road that an ado lays and reports its mistakes.
///
/// `path` is its place among the agents.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    file: &ScenarioFile,
    entry: &RoadAgentFile,
) -> RoadAdo {
    within(
        problems,
        &path.to("ahead_m"),
        entry.ahead_m,
        AHEAD_M.0,
        AHEAD_M.1,
    );
    within(
        problems,
        &path.to("piece_m"),
        entry.piece_m,
        PIECE_M.0,
        PIECE_M.1,
    );
    let listed = match &file.road {
        OwnRoad::Curved { pieces, .. } => pieces.len(),
        OwnRoad::Straight { .. } | OwnRoad::Polyline { .. } | OwnRoad::OpenDrive { .. } => {
            let what = "an ado lays pieces behind those of a `Curved` road";
            let help = "write road: Curved(…, pieces: [Line(length_m: 100.0)])";
            let place = ValuePath::top().to("road");
            problems.add(&place, what, "has no pieces", Some(help.to_owned()));
            0
        }
    };
    let actions = &entry.drive.ado().actions;
    if let Actions::Curvatures(list) = actions {
        // The widest road of all starts.
        let road = file.road.at(RangePoint::Greatest);
        let reach_m = road.lanes() as f64 * road.lane_width_m();
        let place = path.to("drive").to("actions").at(0);
        for (i, &curvature_per_m) in list.iter().enumerate() {
            curvature(
                problems,
                &place.at(i),
                curvature_per_m,
                reach_m,
                entry.piece_m,
            );
        }
    }
    RoadAdo {
        name: entry.name.clone(),
        ahead_m: entry.ahead_m,
        piece_m: entry.piece_m,
        listed,
        actions: actions.clone(),
        neutral: entry.drive.ado().neutral,
    }
}

/// Checks a curvature: the lanes must not fold over, nor a piece turn too far.
fn curvature(
    problems: &mut Problems,
    place: &ValuePath,
    curvature_per_m: f64,
    reach_m: f64,
    piece_m: f64,
) {
    // At the radius of the road its inner border would be a point, and an arc
    // turns by half a circle at most.
    let most_per_m = (0.99 / reach_m).min(core::f64::consts::PI / piece_m);
    if !(0.0..=most_per_m).contains(&curvature_per_m.abs()) {
        let what = format!("a curvature of {curvature_per_m:?} per metre");
        let help = format!(
            "it is 1 / radius, positive to the left: at most {most_per_m:.4} with lanes of \
             {reach_m} m and pieces of {piece_m} m"
        );
        problems.add(place, what, "folds the road", Some(help));
    }
}

/// Refuses worlds whose other parts depend on pieces that are not laid yet.
///
/// `place` is the place of the road among the agents.
pub(super) fn check(
    problems: &mut Problems,
    place: &ValuePath,
    list: &ValuePath,
    spec: &DriveSpec,
    entries: EntryPositions<'_>,
) {
    let Some(ado) = &spec.road_ado else {
        return;
    };
    if !spec.roads.is_empty() {
        let what = "named roads cross a road that is not laid yet";
        let help = "leave `roads` out, or this agent";
        problems.add(place, what, "crosses them", Some(help.to_owned()));
    }
    // A road that cannot be laid is reported elsewhere.
    let Ok(course) = spec.road.course() else {
        return;
    };
    turned_too_far(problems, spec, &ado.name);
    let end_m = course.end_s_m();
    let beyond = |problems: &mut Problems, place: &ValuePath, name: &str, at_m: f64| {
        let what = format!("`{name}` is at {at_m} m, beyond the listed road of {end_m} m");
        let help = format!(
            "move it back, or list longer pieces: `{}` lays the rest",
            ado.name
        );
        problems.add(place, what, "not laid yet", Some(help));
    };
    for (i, agent) in spec.agents.iter().enumerate() {
        let place = list.at(entries.agents[i]);
        // The furthest start counts, since every start of the range may be drawn.
        let front_m = starts::front(spec, i).hi;
        if end_m < front_m {
            beyond(problems, &place, &agent.name, front_m);
        }
        if agent.plan().is_some() {
            let what = format!(
                "the plan of `{}` needs a road that is not laid yet",
                agent.name
            );
            let help = "write `Scripted(…)` or `Ado(…)` without `base`";
            problems.add(&place.to("drive"), what, "a plan", Some(help.to_owned()));
        }
    }
    for (light, entry) in spec.lights.iter().zip(entries.lights) {
        if end_m < light.line_m {
            beyond(
                problems,
                &list.at(*entry).to("line_m"),
                &light.name,
                light.line_m,
            );
        }
    }
}

/// Refuses listed pieces that turn beyond the headings of the pieces to come.
fn turned_too_far(problems: &mut Problems, spec: &DriveSpec, ado: &str) {
    // A road with ranges turns furthest at an end of them.
    let roads = core::iter::once(spec.clone()).chain(spec.extreme_roads());
    for course in roads.filter_map(|spec| spec.road.course().ok()) {
        let mut heading_rad = 0.0_f64;
        for (i, piece) in course.pieces().iter().enumerate() {
            heading_rad += piece.length_m * piece.curvature_per_m;
            if heading_rad.abs() > MAX_HEADING_RAD {
                let what = format!("the listed pieces turn the road by {heading_rad:.2} rad");
                let help = format!(
                    "`{ado}` lays a road that never comes back: turn by {MAX_HEADING_RAD} rad at most"
                );
                let pieces = ValuePath::top().to("road").to("pieces");
                problems.add(&pieces.at(i), what, "too far", Some(help));
                // At the other ends the same pieces turn too far, which would be no
                // news.
                return;
            }
        }
    }
}

/// Reports a second road.
pub(super) fn second(problems: &mut Problems, path: &ValuePath) {
    let help = Some("let one agent have the actions of both".to_owned());
    problems.add(path, "one ado lays the road of a world", "second one", help);
}
