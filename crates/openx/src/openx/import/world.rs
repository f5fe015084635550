//! World of a concrete scenario: its road, its agents and their plans.

use super::agents::{agent, way_name};
use super::concrete::Concrete;
use super::draft::{Draft, RunDuration, tidy};
use super::frame::DELETED;
use super::gaps::place_by_gaps;
use super::plans::number;
use super::run_end::{EgoStart, ends_s, first_leaves_s};
use super::seen::{EntityInFrame, EntityPath, seen};
use super::story::WrittenStory;
use crate::opendrive::error::{At, Blockers, ImportError};
use crate::road::{Bend, Piece, RoadPlace};
use crate::ron_file::{Ordered, ValuePath};
use crate::rulebook::JudgeKind;
use crate::scene::Clock;
use crate::sim::PlantKind;
use crate::world_file::{NumberOrRange, OwnPiece, OwnRoad, RoadFile, ScenarioFile};

/// Time between two samples in seconds.
const SAMPLE_S: f64 = 0.05;
/// Physics steps per sample.
const SUBSTEPS: u32 = 5;
/// Duration in seconds of a run whose end is unknown.
const USUAL_S: f64 = 60.0;
/// Length in metres of a bend ahead of the farthest place of the run.
const AHEAD_M: f64 = 100.0;
/// Least turn of a bend in radians, so that points share a world.
///
/// It is less than a full circle, so the road does not return to its start.
const LEAST_TURN_RAD: f64 = 5.0;
/// Distance in metres by which the front of an ego may swing out.
const SWING_M: f64 = 0.3;
/// Width in metres of a path with corners, and of other ways.
const PATH_M: f64 = 0.0001;
const LANE_M: f64 = 3.5;
/// Step in metres in which a longer bend grows.
const STEP_M: f64 = 100.0;
/// Question of every world.
const QUESTION: &str = "Which points of the protocol does the ego pass?";

/// Scenario in the frame of its ego, and how long its run is.
pub(super) struct SeenScenario<'a> {
    pub all: Vec<EntityInFrame<'a>>,
    ego: usize,
    duration: RunDuration,
}

/// Returns a scenario as its world sees it.
///
/// # Errors
///
/// Returns an error for content that a world file cannot express.
pub(super) fn seen_scenario(concrete: &Concrete) -> Result<SeenScenario<'_>, ImportError> {
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
    // Without a stop time, an expected encounter with a target says how long to look.
    let known_s = ends_s(concrete, &all, start)?;
    // A run lasts at least one second, even if the file ends it earlier.
    let requested_s = known_s.unwrap_or(USUAL_S).max(1.0);
    // Whole samples: rounded up if there is road left, otherwise down.
    let until_s = if requested_s <= leaves_s {
        (requested_s / SAMPLE_S).ceil() * SAMPLE_S
    } else {
        (leaves_s / SAMPLE_S).floor() * SAMPLE_S
    };
    Ok(SeenScenario {
        all,
        ego,
        duration: RunDuration {
            until_s,
            has_end: known_s.is_some(),
            leaves_s,
        },
    })
}

/// Checks that the name of an ado is that of an agent besides the ego.
fn check_ado(concrete: &Concrete, all: &[EntityInFrame], name: &str) -> Result<(), ImportError> {
    let is_named = |it: &&EntityInFrame| it.entity.name == name || it.name == name;
    let what = match all.iter().find(is_named) {
        Some(it) if !it.entity.is_ego => return Ok(()),
        Some(_) => format!("`{name}` is the ego, so it cannot be an ado"),
        None => format!("no agent is called `{name}`"),
    };
    let others = all.iter().filter(|it| !it.entity.is_ego);
    let names: Vec<&str> = others.map(|it| it.entity.name.as_str()).collect();
    let help = if names.is_empty() {
        "leave --ado out: the file has no agent besides the ego".to_owned()
    } else {
        format!("name the ado with --ado: {}", names.join(", "))
    };
    Err(concrete.ego_at.error(what).helped(&help))
}

/// Returns the world of a point.
///
/// # Errors
///
/// Returns an error for content that a world file cannot express.
pub(super) fn draft(
    concrete: &Concrete,
    seen: &SeenScenario<'_>,
    story: Option<WrittenStory>,
    parameters: Vec<(String, f64)>,
    ado: Option<&str>,
) -> Result<Draft, ImportError> {
    let SeenScenario { all, ego, duration } = seen;
    if let Some(name) = ado {
        check_ado(concrete, all, name)?;
    }
    let until_s = duration.until_s;
    let top = ValuePath::top();
    let mut origins = vec![
        (top.to("clock"), concrete.ends_at.clone()),
        (top.to("road"), concrete.road_at()),
        (top.to("ego_spec"), concrete.ego_at.clone()),
    ];
    let mut agents = Vec::new();
    let mut blockers = Blockers::default();
    // The ego comes first, since plans of later agents may refer to it.
    for it in std::iter::once(&all[*ego]).chain(all.iter().filter(|it| !it.entity.is_ego)) {
        let place = top.to("agents").at(agents.len());
        origins.push((place, it.entity.at.clone()));
        agents.extend(blockers.keep(agent(concrete, all, it, ado)));
    }
    blockers.none()?;
    for light in &concrete.lights {
        origins.push((top.to("agents").at(agents.len()), light.at.clone()));
        agents.push(light.agent(until_s));
    }
    let clock = Clock {
        horizon_s: until_s,
        decision_s: SAMPLE_S,
        sample_s: SAMPLE_S,
        substeps: SUBSTEPS,
    };
    let mut file = ScenarioFile::new(
        "",
        QUESTION,
        clock,
        road(concrete, all, until_s),
        agents,
        specification(concrete, all, *ego),
    );
    file.plant = PlantKind::Kinematic;
    file.judge = JudgeKind::UntilContact;
    // Entities that drive off need roads of their own.
    file.roads = ways(all, &mut origins);
    let grades = concrete.grades.iter();
    file.grades = grades
        .map(|it| (rounded(it.from_s_m, 1e3), rounded(it.rise, 1e6).into()))
        .collect();
    for it in all {
        let body = &it.entity.body;
        // Agents may share a body.
        let known = file.bodies.0.insert(body.name.clone(), body.body.clone());
        if known.is_none() {
            origins.push((top.to("bodies").to(&body.name), body.at.clone()));
        }
    }
    // Protocols hide children behind parked cars, which matters for what an ego sees.
    file.sensors.line_of_sight = hides(all);
    let parameters = parameters.into_iter();
    file.parameters = Ordered(
        parameters
            .map(|(name, value)| (name, number(value)))
            .collect(),
    );
    if let Some(WrittenStory {
        board,
        origins: of_story,
    }) = story
    {
        file.storyboard = Some(board);
        origins.extend(of_story);
    }
    let mut draft = Draft::of(file, origins, *duration);
    draft.is_cut = concrete.stop_s.is_some_and(|stop_s| until_s < stop_s);
    Ok(draft)
}

fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}

/// Returns whether a standing vehicle may hide others.
///
/// A single standing vehicle along the road is the target itself.
fn hides(all: &[EntityInFrame]) -> bool {
    let mut standing = all.iter().filter(|it| it.stands());
    let vehicles = standing.clone().filter(|it| !it.entity.body.on_foot);
    vehicles.count() > 1 || standing.any(|it| matches!(it.path, EntityPath::Turned))
}

/// Specification of the ego: clear of all others, or within its lane without others.
fn specification(concrete: &Concrete, all: &[EntityInFrame], ego: usize) -> String {
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
    format!("always ({passed})")
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
    let fastest_mps = all
        .iter()
        .map(|it| it.entity.most_mps())
        .fold(0.0, f64::max);
    let farthest_m = all.iter().map(|it| it.spot.x_m).fold(0.0, f64::max);
    let reach_m = farthest_m + fastest_mps * until_s + AHEAD_M;
    // Infinite without a bend, and then there are no pieces to lay.
    let least_m = LEAST_TURN_RAD / concrete.bend_per_m().abs();
    // Equal lengths for all points keep the texts equal, so they share a world.
    if reach_m <= least_m {
        least_m
    } else {
        (reach_m / STEP_M).ceil() * STEP_M
    }
}

fn road(concrete: &Concrete, all: &[EntityInFrame], until_s: f64) -> OwnRoad {
    let pieces = concrete.pieces(laid_m(concrete, all, until_s));
    // Numbers of the road are the same at all points of a world. A different road makes
    // another world.
    let lanes = concrete.lanes;
    let lane_width_m = NumberOrRange::from(concrete.lane_width_m);
    let friction = number(concrete.friction);
    let speed_limit_mps = concrete.limit_mps.map(tidy);
    if pieces.is_empty() {
        return OwnRoad::Straight {
            lanes,
            lane_width_m,
            friction,
            speed_limit_mps,
        };
    }
    let pieces = bends(&pieces).into_iter().map(|piece| match piece {
        Piece::Line { length_m } => OwnPiece::Line { length_m },
        Piece::Arc { length_m, radius_m } => OwnPiece::Arc {
            length_m,
            radius_m: NumberOrRange::from(radius_m),
        },
    });
    OwnRoad::Curved {
        lanes,
        lane_width_m,
        friction,
        speed_limit_mps,
        pieces: pieces.collect(),
    }
}

/// Ways of entities that leave the road of the ego.
fn ways(all: &[EntityInFrame], origins: &mut Vec<(ValuePath, At)>) -> Ordered<RoadFile> {
    // In the order of the agents, so that equal files give equal texts.
    let mut roads = Ordered::default();
    for it in all {
        let EntityPath::Own(begins, on) = it.path else {
            continue;
        };
        let name = way_name(it);
        let path = ValuePath::top().to("roads").to(&name);
        origins.push((path, it.entity.at.clone()));
        let road = RoadFile {
            at: Some(RoadPlace {
                x_m: tidy(begins.x_m),
                y_m: tidy(begins.y_m),
                heading_rad: begins.heading_rad,
                z_m: 0.0,
            }),
            along: None,
            lanes: 1,
            // The width of a path is below its least radius.
            lane_width_m: (on.way.most_curvature_per_m() * LANE_M > 1.0).then_some(PATH_M),
            // A path without pieces is a straight road.
            pieces: if on.way.piece_count() == 0 {
                Vec::new()
            } else {
                bends(&on.way.bends())
            },
            priority: Default::default(),
            grades: Vec::new(),
            vertical_curve_m: 0.0,
            banks: Vec::new(),
        };
        roads.0.insert(name, road);
    }
    roads
}

/// Pieces in the form of a world file.
fn bends(pieces: &[Bend]) -> Vec<Piece> {
    let pieces = pieces.iter().copied().flat_map(Bend::parts).map(|piece| {
        let length_m = tidy(piece.length_m);
        if piece.per_m == 0.0 {
            Piece::Line { length_m }
        } else {
            let radius_m = tidy(1.0 / piece.per_m);
            Piece::Arc { length_m, radius_m }
        }
    });
    pieces.collect()
}
