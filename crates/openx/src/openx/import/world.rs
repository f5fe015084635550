//! World of a concrete scenario: its road, its agents and their plans.

use super::concrete::Concrete;
use super::draft::{Draft, tidy};
use super::frame::DELETED;
use super::gaps::place_by_gaps;
use super::journey::to_mps;
use super::places::Placed;
use super::plans::plan;
use super::run_end::{EgoStart, ends_s, first_leaves_s};
use super::seen::{EntityInFrame, EntityPath, seen};
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::grade_list;
use crate::road::Bend;

/// Time between two samples in seconds.
const SAMPLE_S: f64 = 0.05;
/// Time between two decisions of an ado in seconds.
const DECISION_S: f64 = 0.5;
/// Longest run in seconds with decisions at that rate.
///
/// Longer runs decide less often.
const OFTEN_UNTIL_S: f64 = 60.0;
/// Duration in seconds of a run whose end is unknown.
const USUAL_S: f64 = 60.0;
/// Length in metres of a bend ahead of the farthest place of the run.
const AHEAD_M: f64 = 100.0;
/// Least turn of a bend in radians, so that points share a world.
///
/// It is less than a full circle, so the road does not return to its start.
const LEAST_TURN_RAD: f64 = 5.0;
/// Least speed in m/s that a cruise control keeps.
const LEAST_CRUISE_MPS: f64 = 0.1;
/// Distance in metres by which the front of an ego may swing out.
const SWING_M: f64 = 0.3;
/// Width in metres of a path with corners.
const PATH_M: f64 = 0.0001;
/// Step in metres in which a longer bend grows.
const STEP_M: f64 = 100.0;

/// Returns the world of a point as a text with holes.
///
/// # Errors
///
/// Returns an error for content that a world file cannot express.
pub(super) fn draft(concrete: &Concrete, ado: Option<&str>) -> Result<Draft, ImportError> {
    let mut blockers = Blockers::default();
    let mut all: Vec<EntityInFrame> = concrete
        .entities
        .iter()
        .filter_map(|entity| blockers.keep(seen(concrete, entity)))
        .collect();
    blockers.none()?;
    let ego = all
        .iter()
        .position(|it| it.entity.is_ego)
        .ok_or_else(|| concrete.ego_at.error("the ego is deleted").helped(DELETED))?;
    let start = EgoStart {
        front_m: all[ego].spot.x_m + all[ego].entity.body.front_m,
        speed_mps: all[ego].entity.speed_mps,
    };
    // A stated gap to the ego replaces the place in the file.
    place_by_gaps(concrete, &mut all, ego)?;
    // A run ends before an entity that moves as in the file leaves its road.
    let (leaves_s, leaver) = first_leaves_s(concrete, &all, start)?;
    if let Some(leaver) = leaver.filter(|_| leaves_s < SAMPLE_S) {
        let help = "place it farther from the end of its road, or let it drive slower";
        let what = format!("it leaves its road after {:.3} s", leaves_s.max(0.0));
        return Err(leaver.entity.at.error(what).helped(help));
    }
    let known_s = ends_s(concrete, &all, start)?;
    // A run lasts at least one second, even if the file ends it earlier.
    let requested_s = known_s.unwrap_or(USUAL_S).max(1.0);
    // Whole samples: rounded up if there is road left, otherwise down.
    let until_s = if requested_s <= leaves_s {
        (requested_s / SAMPLE_S).ceil() * SAMPLE_S
    } else {
        (leaves_s / SAMPLE_S).floor() * SAMPLE_S
    };
    // With an unknown end, the run ends at the earliest departure of all
    // points. Such points can share a world whatever their durations.
    let mut draft = match known_s {
        Some(_) => Draft::of(until_s, leaves_s.max(until_s)),
        None => Draft::of(0.0, f64::INFINITY),
    };
    draft.is_cut = concrete.stop_s.is_some_and(|stop_s| until_s < stop_s);
    draft.mark(&concrete.ends_at);
    draft.text("    clock: (horizon_s: ");
    match known_s {
        Some(_) => draft.most(until_s),
        None => draft.least(until_s),
    }
    draft.text(", decision_s: ");
    // Longer runs decide less often, so that their search is no larger than
    // that of short runs.
    draft.most(DECISION_S * (until_s / OFTEN_UNTIL_S).ceil().max(1.0));
    draft.text(&format!(
        ", sample_s: {SAMPLE_S}, substeps: 5),\n    plant: Kinematic,\n    \
         judge: UntilContact,\n"
    ));
    draft.mark(&concrete.road_at());
    road(&mut draft, concrete, &all, until_s);
    if !concrete.grades.is_empty() {
        draft.text(&format!("    grades: {},\n", grade_list(&concrete.grades)));
    }
    bodies(&mut draft, &all);
    draft.text("    agents: [\n");
    // Standing vehicles may hide others. A single standing vehicle along the
    // road is the target itself.
    let hides = all
        .iter()
        .any(|it| it.stands() && matches!(it.path, EntityPath::Turned))
        || all
            .iter()
            .filter(|it| it.stands() && !it.entity.body.on_foot)
            .count()
            > 1;
    let mut triggers = Vec::new();
    let mut blockers = Blockers::default();
    // The ego comes first, since plans of later agents may refer to it.
    for it in std::iter::once(&all[ego]).chain(all.iter().filter(|it| !it.entity.is_ego)) {
        blockers.keep(agent(&mut draft, concrete, &all, it, ado, &mut triggers));
    }
    blockers.none()?;
    for light in &concrete.lights {
        draft.mark(&light.at);
        draft.text(&light.text(until_s));
    }
    draft.mark(&concrete.ego_at);
    draft.text("    ],\n");
    if hides {
        draft.text("    sensors: (line_of_sight: true),\n");
    }
    if !triggers.is_empty() {
        draft.text("    parameters: {");
        for (i, (name, value)) in triggers.iter().enumerate() {
            let before = if i == 0 { "" } else { "," };
            draft.text(&format!("{before} \"{name}\": "));
            draft.hole(name, *value);
        }
        draft.text(" },\n");
    }
    let others = all.iter().filter(|it| !it.entity.is_ego);
    let clear: Vec<String> = others
        // 1 cm separates a contact from a near miss despite rounding.
        .map(|it| format!("{}.{}.gap >= 0.01", all[ego].name, it.name))
        .collect();
    let passed = if clear.is_empty() {
        within_lane(concrete, &all[ego])
    } else {
        clear.join(" and ")
    };
    draft.text(&format!("    ego_spec: \"always ({passed})\",\n"));
    Ok(draft)
}

/// Specification of an ego without other agents: its sides stay within its lane.
///
/// Where they begin beside it, they leave it no further.
fn within_lane(concrete: &Concrete, ego: &EntityInFrame) -> String {
    let middle_m = concrete.lane_width_m * concrete.lane_at(ego.spot.y_m);
    // An ego that starts beyond its lane must not leave it further, except for its
    // front in bends.
    let off_m = (ego.spot.y_m - middle_m).abs() + SWING_M;
    let room_m = off_m.max(0.5 * (concrete.lane_width_m - ego.entity.body.width_m));
    format!(
        "{}.lateral in [{}, {}]",
        ego.name,
        tidy(middle_m - room_m),
        tidy(middle_m + room_m)
    )
}

/// Length in metres of the bends, as far as any entity drives.
///
/// Bends that change are complete.
fn laid_m(concrete: &Concrete, all: &[EntityInFrame], until_s: f64) -> f64 {
    // A sequence of bends is driven completely.
    if concrete.bends_change() {
        return f64::INFINITY;
    }
    let ego = all.iter().find(|it| it.entity.is_ego);
    let ego_mps = ego.map_or(0.0, |it| it.entity.speed_mps);
    let speeds = all.iter().flat_map(|it| {
        let laws = it.entity.steps.iter().flat_map(|step| &step.laws);
        let later = laws.filter_map(|law| to_mps(law, ego_mps));
        later.chain([it.entity.speed_mps])
    });
    let fastest_mps = speeds.fold(0.0, f64::max);
    let farthest_m = all.iter().map(|it| it.spot.x_m).fold(0.0, f64::max);
    let reach_m = farthest_m + fastest_mps * until_s + AHEAD_M;
    let least_m = LEAST_TURN_RAD / concrete.bend_per_m().abs();
    // Equal lengths for all points keep the texts equal, so they share a world.
    if reach_m <= least_m {
        least_m
    } else {
        (reach_m / STEP_M).ceil() * STEP_M
    }
}

fn road(draft: &mut Draft, concrete: &Concrete, all: &[EntityInFrame], until_s: f64) {
    let pieces = concrete.pieces(laid_m(concrete, all, until_s));
    // Numbers in the text are the same at all points of a world. A different
    // road makes another world.
    let mut lanes = format!(
        "lanes: {}, lane_width_m: {}, friction: {:?}",
        concrete.lanes,
        concrete.lane_width_m,
        tidy(concrete.friction)
    );
    if let Some(limit_mps) = concrete.limit_mps {
        lanes += &format!(", speed_limit_mps: {:?}", tidy(limit_mps));
    }
    if pieces.is_empty() {
        draft.text(&format!("    road: Straight({lanes}),\n"))
    } else {
        draft.text(&format!(
            "    road: Curved({lanes}, pieces: [{}]),\n",
            bends(&pieces)
        ));
    }
    let ways: Vec<_> = all
        .iter()
        .filter_map(|it| match it.path {
            EntityPath::Own(begins, on) => Some((it, begins, on)),
            _ => None,
        })
        .collect();
    if ways.is_empty() {
        return;
    }
    draft.text("    roads: {\n");
    for (it, begins, on) in ways {
        // The width of a path with corners is below their radius.
        let width = if on.has_corners() {
            format!(", lane_width_m: {PATH_M:?}")
        } else {
            String::new()
        };
        // A path without pieces is a straight road.
        let pieces = if on.way.piece_count() == 0 {
            String::new()
        } else {
            format!(", pieces: [{}]", bends(&on.way.bends()))
        };
        draft.mark(&it.entity.at);
        draft.text(&format!(
            "        \"{}_way\": (at: (x_m: {}, y_m: {}, heading_rad: {}){width}{pieces}),\n",
            it.name,
            tidy(begins.x_m),
            tidy(begins.y_m),
            begins.heading_rad
        ));
    }
    draft.text("    },\n");
}

/// Pieces in the form of a world file.
fn bends(pieces: &[Bend]) -> String {
    let pieces = pieces.iter().copied().flat_map(Bend::parts).map(|piece| {
        if piece.per_m == 0.0 {
            format!("Line(length_m: {})", tidy(piece.length_m))
        } else {
            format!(
                "Arc(length_m: {}, radius_m: {})",
                tidy(piece.length_m),
                tidy(1.0 / piece.per_m)
            )
        }
    });
    pieces.collect::<Vec<_>>().join(", ")
}

fn bodies(draft: &mut Draft, all: &[EntityInFrame]) {
    let mut known: Vec<&str> = Vec::new();
    draft.text("    bodies: {\n");
    for it in all {
        let body = &it.entity.body;
        // Agents may share a body.
        if !known.contains(&body.name.as_str()) {
            known.push(&body.name);
            draft.mark(&body.at);
            draft.text(&format!("        \"{}\": {},\n", body.name, body.ron));
        }
    }
    draft.text("    },\n");
}

fn agent(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
    ado: Option<&str>,
    triggers: &mut Vec<(String, f64)>,
) -> Result<(), ImportError> {
    let (name, body) = (&it.name, &it.entity.body);
    let (x, lateral, speed) = (
        format!("{name}.x"),
        format!("{name}.lateral"),
        format!("{name}.speed"),
    );
    // On a path of its own, the station counts from the start of the path.
    let front_m = match it.path {
        EntityPath::Own(_, on) => on.along_m + it.front_along_m(),
        _ => it.spot.x_m + it.front_along_m(),
    };
    let left_m = it.spot.y_m + it.front_left_m();
    draft.mark(&it.entity.at);
    // An entity that stands askew is an obstacle, which has no lane.
    if let EntityPath::Turned = it.path {
        return obstacle(draft, concrete, all, it);
    }
    if body.on_foot {
        let facing = match it.path {
            EntityPath::Left => "Left",
            EntityPath::Right => "Right",
            EntityPath::Against => "Back",
            _ => "Ahead",
        };
        let (road, left_m) = match it.path {
            EntityPath::Own(..) => (format!(" road: \"{name}_way\","), 0.0),
            _ => (String::new(), left_m),
        };
        draft.text(&format!(
            "        Pedestrian(\n            name: \"{name}\", body: \"{}\",{road} facing: {facing}, \
                 lateral_m: ",
            body.name
        ));
        draft.hole(&lateral, left_m);
    } else {
        draft.text(&format!(
            "        Vehicle(\n            name: \"{name}\", body: \"{}\"",
            body.name
        ));
        match it.path {
            EntityPath::Own(..) => draft.text(&format!(", road: \"{name}_way\"")),
            _ => {
                let width_m = concrete.lane_width_m;
                let lane = concrete.lane_at(left_m);
                draft.text(&format!(", lane: {lane}"));
                // In bends, the rear axle of a protocol's vehicle keeps the
                // line.
                if it.entity.is_ego && concrete.bends() {
                    draft.text(", lane_keeping: RearAxle");
                }
                if let EntityPath::Against = it.path {
                    draft.text(", direction: Against");
                }
                draft.text(", offset_m: ");
                let middle_m = lane * width_m;
                draft.beside(&lateral, left_m - middle_m, middle_m);
            }
        }
    }
    draft.text(",\n            start: At(x_m: ");
    draft.hole(&x, front_m);
    draft.text(", speed_mps: ");
    // A meeting starts from rest.
    match it.entity.approach {
        Some(_) => draft.text("0.0"),
        None => draft.hole(&speed, it.entity.speed_mps),
    }
    draft.text("),\n            drive: ");
    if it.entity.is_ego {
        draft.text(&ego_drive(concrete, it.entity.speed_mps));
        return Ok(());
    }
    // Users may write the name of the file or that of the world.
    let is_ado = ado == Some(it.entity.name.as_str()) || ado == Some(name.as_str());
    if is_ado {
        draft.text("Ado(\n                base: ");
    }
    plan(draft, concrete, all, it, triggers)?;
    if is_ado {
        draft.text(&format!(
            // The default tolerances of the rules are a start, to be replaced
            // by those of the protocol.
            ",\n                actions: Deviate(accelerations: [-1.0, 0.0, 1.0], lateral_mps: \
             [-0.3, 0.0, 0.3]), neutral: 4,\n                rulebook: [\n\
             \x20                   Rule(name: \"keeps its speed\", stl: \"always ({name}.speed - \
             {name}.planned.speed in [-0.5, 0.5])\"),\n\
             \x20                   Rule(name: \"keeps its place\", stl: \"always ({name}.s - \
             {name}.planned.s in [-0.5, 0.5])\"),\n\
             \x20                   Rule(name: \"keeps its line\", stl: \"always ({name}.lateral - \
             {name}.planned.lateral in [-0.3, 0.3])\"),\n                ],\n            )"
        ));
    }
    draft.text(",\n        ),\n");
    Ok(())
}

/// Drive of the ego, which keeps its speed.
fn ego_drive(concrete: &Concrete, speed_mps: f64) -> String {
    // On grades a coasting car gains and loses speed, which a cruise control makes up.
    let drive = if concrete.grades.is_empty() || speed_mps < LEAST_CRUISE_MPS {
        "Coast(accel_mps2: 0.0, lag_s: 0.0)".to_owned()
    } else {
        let speed_mps = tidy(speed_mps);
        format!(
            "CurveSpeed(\n                desired_speed_mps: {speed_mps:?}, cruise_gain_per_s: 20.0, \
             max_accel_mps2: 5.0, max_brake_mps2: 5.0,\n                \
             side_accel_mps2: 1000.0, plan_brake_mps2: 0.0, preview_s: 0.0, lag_s: 0.0,\n            )"
        )
    };
    format!("Ego({drive}),\n        ),\n")
}

/// Writes a standing entity as an obstacle.
///
/// It refers to the straight road whose middle is nearest.
fn obstacle(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
) -> Result<(), ImportError> {
    let (name, body) = (&it.name, &it.entity.body);
    let front = it.spot.moved(body.front_m, 0.0);
    let shares_road = concrete.is_on_road(&it.entity.placed);
    let front = match &it.entity.placed.way {
        Some(on) if on.is_lane && shares_road => {
            let spot = it.entity.placed.spot.moved(body.front_m, 0.0);
            let placed = Placed {
                spot,
                lane: None,
                way: None,
            };
            concrete.station(&placed, &it.entity.at)?
        }
        _ => front,
    };
    // An empty name is the world's own road.
    let mut nearest = shares_road.then(|| (String::new(), front));
    for other in all {
        match other.path {
            EntityPath::Own(begins, on) if on.way.piece_count() == 0 => {
                let seen = begins.sees(&front);
                let best_m = nearest.as_ref().map_or(f64::INFINITY, |it| it.1.y_m.abs());
                if seen.y_m.abs() < best_m {
                    nearest = Some((format!("road: \"{}_way\", ", other.name), seen));
                }
            }
            _ => {}
        }
    }
    let Some((road, at)) = nearest else {
        let what = "it stands beside no straight way";
        let help = "place it along the road of the ego, or leave it out";
        return Err(it.entity.at.error(what).helped(help));
    };
    draft.text(&format!(
        "        Obstacle(name: \"{name}\", body: \"{}\", {road}s_m: ",
        body.name
    ));
    draft.hole(&format!("{name}.x"), at.x_m);
    draft.text(", lateral_m: ");
    draft.hole(&format!("{name}.lateral"), at.y_m);
    draft.text(&format!(", heading_rad: {}),\n", at.heading_rad));
    Ok(())
}
