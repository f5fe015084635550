//! Roads of a world file: placement of named roads, and the roads of agents.

use core::ops::Range;

use super::check;
use super::slope_and_wind;
use super::starts;
use crate::road::{
    Course, Direction, PlacedRoad, PlacedRoads, Road, RoadPlace, SelfOverlap, SurfaceExtent,
};
use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::DriveSpec;
use crate::world_file::{AgentFile, RoadFile, ScenarioFile};

/// Greatest distance in metres of a road's start from the origin.
const MAX_AWAY_M: f64 = 5_000.0;

/// Least lane width in metres of a named road: that of a path with corners.
const PATH_M: f64 = 0.0001;

/// Reads and checks the named roads.
///
/// They have the surface of the world's own road and, unless stated, its lane
/// width.
pub(super) fn placed(
    problems: &mut Problems,
    path: &ValuePath,
    own: &Road,
    file: &Ordered<RoadFile>,
) -> PlacedRoads {
    let mut all = PlacedRoads::new();
    for (name, road) in &file.0 {
        let path = path.to(name);
        check::agent_name(problems, &path, name);
        let at = path.to("at");
        let start = road.at.unwrap_or_else(|| {
            let help = "write `at: (x_m: …, y_m: …)`, or `along: (road: …, lane: …)` where \
                        `road` is `OpenDrive(…)`";
            let what = format!("nothing says where road `{name}` begins");
            problems.add(&path, what, "without a place", Some(help.to_owned()));
            // Agents refer to roads by their number, so the road stays in the list.
            RoadPlace::default()
        });
        for (field, value) in [("x_m", start.x_m), ("y_m", start.y_m), ("z_m", start.z_m)] {
            check::within(problems, &at.to(field), value, -MAX_AWAY_M, MAX_AWAY_M);
        }
        let turn = core::f64::consts::TAU;
        check::within(
            problems,
            &at.to("heading_rad"),
            start.heading_rad,
            -turn,
            turn,
        );
        let placed = PlacedRoad {
            at: start,
            road: Road::Straight {
                lanes: road.lanes,
                lane_width_m: road.lane_width_m.unwrap_or(own.lane_width_m()),
                // A world has one friction coefficient, which changes and
                // families vary.
                friction: own.friction(),
                // The ego drives on the world's own road only, so other roads
                // need no limit.
                speed_limit_mps: None,
            },
            shares_lane_width: road.lane_width_m.is_none(),
            pieces: road.pieces.clone(),
            priority: road.priority,
            grades: slope_and_wind::placed(problems, &path, road),
            vertical_curve_m: road.vertical_curve_m,
            banks: slope_and_wind::banks_of(&road.banks),
        };
        check::lanes(problems, &path, &placed.road, PATH_M);
        refuse_course(problems, &path, &placed);
        all.insert(name.clone(), placed);
    }
    all
}

/// Refuses roads that cannot be laid, or that come back onto themselves.
pub(super) fn lay(problems: &mut Problems, path: &ValuePath, spec: &DriveSpec) {
    check::road(problems, &path.to("road"), &spec.road);
    for (name, placed) in &spec.roads {
        refuse_course(problems, &path.to("roads").to(name), placed);
    }
    beside_themselves(problems, path, spec);
}

/// Refuses a named road that cannot be laid.
fn refuse_course(problems: &mut Problems, path: &ValuePath, placed: &PlacedRoad) {
    if let Err(error) = placed.course() {
        let list = path.to("pieces");
        let place = error.index.map_or(list.clone(), |index| list.at(index));
        problems.add(&place, error.what, "here", Some(error.help));
    }
}

/// Refuses roads on which a position has two arc lengths.
///
/// `path` is the world. Each road is examined over its pieces, and as far as its
/// agents drive at their least start speeds.
pub(super) fn beside_themselves(problems: &mut Problems, path: &ValuePath, spec: &DriveSpec) {
    let own = match spec.road {
        Road::Polyline { .. } => path.to("road").to("points_m"),
        _ => path.to("road").to("pieces"),
    };
    let mut check = |number: usize, road: &Road, course: Course, place: &ValuePath| {
        // The reference line counts, even where all lanes lie on one side of it.
        let mut borders_m = 0.0_f64..0.0_f64;
        for border_m in road.borders_m() {
            borders_m.start = borders_m.start.min(border_m);
            borders_m.end = borders_m.end.max(border_m);
        }
        let extent = SurfaceExtent {
            stations_m: driven_m(spec, number, &course),
            borders_m,
        };
        if let Some(overlap) = course.self_overlap(&extent) {
            refuse_overlap(problems, place, overlap);
        }
    };
    // Courses that cannot be laid are refused elsewhere.
    if let Ok(course) = spec.road.course() {
        check(0, &spec.road, course, &own);
    }
    for (number, (name, placed)) in spec.roads.iter().enumerate() {
        if let Ok(course) = placed.course() {
            let place = path.to("roads").to(name).to("pieces");
            check(number + 1, &placed.road, course, &place);
        }
    }
}

/// Stations between which a road is driven: its pieces, and the reach of its agents.
fn driven_m(spec: &DriveSpec, road: usize, course: &Course) -> Range<f64> {
    let mut driven_m = 0.0_f64..course.end_s_m();
    let agents = spec.agents.iter().enumerate();
    for (i, agent) in agents.filter(|(_, agent)| agent.road == road) {
        let front = starts::front(spec, i);
        // Faster starts drive farther, but their episodes may end before that.
        let way_m = agent.place.speed_mps().lo * spec.clock.horizon_s;
        // Positions are those of front bumpers, so a body reaches back from there.
        let (behind_m, ahead_m) = match agent.direction {
            Direction::With => (agent.body.length_m, way_m),
            Direction::Against => (way_m, agent.body.length_m),
        };
        driven_m.start = driven_m.start.min(front.lo - behind_m);
        driven_m.end = driven_m.end.max(front.hi + ahead_m);
    }
    driven_m
}

fn refuse_overlap(problems: &mut Problems, place: &ValuePath, overlap: SelfOverlap) {
    let [here, there] = [overlap.here_m, overlap.there_m]
        .map(|(from_m, to_m)| format!("s = {from_m:.0} to {to_m:.0} m"));
    let what = format!("the road comes back onto itself: at {here} it lies on {there}");
    let help = "a position has one `s`: let the turns lead past each other, or end the road \
                before it comes back; it goes straight on before the first and after the last \
                piece";
    problems.add(
        place,
        what,
        "two stretches on one place",
        Some(help.to_owned()),
    );
}

/// Number of the road that an agent names. 0 is the world's own.
pub(super) fn number(
    problems: &mut Problems,
    path: &ValuePath,
    file: &ScenarioFile,
    entry: &AgentFile,
) -> Option<usize> {
    let Some(name) = entry.road() else {
        return Some(0);
    };
    let number = file.roads.0.get_index_of(name);
    if number.is_none() {
        let known: Vec<&str> = file.roads.0.keys().map(String::as_str).collect();
        if known.is_empty() {
            let what = format!("no road `{name}`: this world has only its own");
            let help = "leave `road` out, or place one: \
                            roads: { \"side\": (at: (x_m: 60.0, y_m: 0.0, heading_rad: 1.5708)) }";
            problems.add(&path.to("road"), what, "unknown", Some(help.to_owned()));
        } else {
            problems.unknown(&path.to("road"), "road", name, &known)
        }
    }
    number.map(|number| number + 1)
}

/// Refuses an ego on a named road, or against the world's own road.
///
/// The ego's perception is expressed along that road.
pub(super) fn ego_on_its_own(problems: &mut Problems, path: &ValuePath, entry: &AgentFile) {
    if entry.road().is_some() {
        let what = "the ego drives on the world's own `road`, not on a named one";
        let help = "write its road as `road`, and place the others relative to it";
        problems.add(
            &path.to("road"),
            what,
            "not the ego's",
            Some(help.to_owned()),
        );
    }
    if let AgentFile::Vehicle {
        direction: Direction::Against,
        ..
    } = entry
    {
        let what = "the ego drives with the world's own `road`";
        let help = "turn the road round: who comes towards the ego has `direction: Against`";
        problems.add(
            &path.to("direction"),
            what,
            "not the ego's",
            Some(help.to_owned()),
        );
    }
}
