//! Concrete scenarios as texts of worlds, and points that share a text.
//!
//! A draft is a text with holes for numbers. Points whose texts are equal but
//! for the holes are one world: a number that is the same at all of them stands
//! in it, others become ranges, and `points` has a column for each.

use core::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;

use super::entity::{Entity, Law, Steady, Step, Watch};
use super::error::ImportError;
use super::places::is_along;
use super::roads::Spot;
use super::scenario::Concrete;
use super::ways::{Bend, OnWay, laid};

/// How long a run goes on behind what is expected to happen.
const BEYOND_S: f64 = 5.0;
/// Time between two samples.
const SAMPLE_S: f64 = 0.05;
/// Time between two decisions of who strays.
const DECISION_S: f64 = 0.5;
/// Runs up to so long have that many decisions; longer ones have fewer a second.
const OFTEN_UNTIL_S: f64 = 60.0;
/// What a run lasts if nothing says.
const USUAL_S: f64 = 60.0;
/// The road goes on so far ahead of everybody.
const AHEAD_M: f64 = 400.0;
/// A pedestrian who faces a side within this does.
const SQUARE_RAD: f64 = 0.02;

/// A world that was imported.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedWorld {
    /// Its name.
    pub name: String,
    /// Its text.
    pub text: String,
    /// Which points of the variation file it has, in the order of its table.
    pub points: Vec<usize>,
}

/// A part of a draft.
#[derive(Clone, Debug, PartialEq)]
enum Part {
    Text(String),
    /// A number that may differ from point to point: the axis that its range is,
    /// and by how much more the axis is than what is written.
    Hole {
        axis: String,
        value: f64,
        more: f64,
    },
    /// The greatest of all points.
    Most(f64),
}

/// A text with holes.
#[derive(Clone, Debug, Default)]
pub(super) struct Draft(Vec<Part>);

impl Draft {
    fn text(&mut self, text: &str) {
        match self.0.last_mut() {
            Some(Part::Text(before)) => before.push_str(text),
            _ => self.0.push(Part::Text(text.to_owned())),
        }
    }

    fn hole(&mut self, axis: &str, value: f64) {
        self.beside(axis, value, 0.0);
    }

    fn beside(&mut self, axis: &str, value: f64, more: f64) {
        self.0.push(Part::Hole {
            axis: axis.to_owned(),
            // Sums of measured numbers have dust that nobody means.
            value: tidy(value),
            more,
        });
    }

    fn is_like(&self, other: &Draft) -> bool {
        let alike = |pair: (&Part, &Part)| match pair {
            (Part::Text(a), Part::Text(b)) => a == b,
            (
                Part::Hole {
                    axis: a, more: m, ..
                },
                Part::Hole {
                    axis: b, more: n, ..
                },
            ) => a == b && m == n,
            (Part::Most(_), Part::Most(_)) => true,
            _ => false,
        };
        self.0.len() == other.0.len() && self.0.iter().zip(&other.0).all(alike)
    }
}

fn tidy(value: f64) -> f64 {
    let tidy = (value * 1e9).round() / 1e9;
    tidy + 0.0
}

/// `ObstructionVehicle_Large` as `obstruction_vehicle_large`.
fn named(name: &str) -> String {
    let mut named = String::new();
    let mut before = '_';
    for c in name.chars() {
        if c.is_uppercase() && before != '_' && !before.is_uppercase() {
            named.push('_');
        }
        named.extend(
            c.to_lowercase()
                .filter(|c| c.is_alphanumeric() || *c == '_'),
        );
        before = c;
    }
    named
}

/// Somebody in the frame of the ego's road.
struct Seen<'a> {
    entity: &'a Entity,
    name: String,
    /// The point that a scenario moves.
    spot: Spot,
    path: Path<'a>,
}

/// On what somebody moves.
enum Path<'a> {
    /// The ego's road, with it or against it.
    With,
    Against,
    /// Across it on foot: to the left or to the right.
    Left,
    Right,
    /// A way of its own: where that begins, and where it is on it.
    Own(Spot, &'a OnWay),
    /// It stands, turned from the road.
    Turned,
}

impl Seen<'_> {
    /// From the moved point to the front, along the road.
    fn front_along_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            Path::With => front_m,
            Path::Against => -front_m,
            Path::Own(..) => front_m,
            Path::Left | Path::Right | Path::Turned => 0.0,
        }
    }

    fn front_left_m(&self) -> f64 {
        let front_m = self.entity.body.front_m;
        match self.path {
            Path::Left => front_m,
            Path::Right => -front_m,
            _ => 0.0,
        }
    }

    fn stands(&self) -> bool {
        let entity = self.entity;
        entity.speed_mps == 0.0 && entity.steps.is_empty() && entity.meets.is_none()
    }

    /// How much of it lies behind its front, along the ego's road.
    fn rear_m(&self) -> f64 {
        let body = &self.entity.body;
        match self.path {
            Path::With => body.length_m,
            Path::Left | Path::Right => 0.5 * body.width_m,
            _ => 0.0,
        }
    }
}

fn seen<'a>(concrete: &Concrete, entity: &'a Entity) -> Result<Seen<'a>, ImportError> {
    let spot = concrete.in_frame(&entity.placed)?;
    let refused = |what: String| concrete.at.error(format!("`{}`: {what}", entity.name));
    let moves = entity.speed_mps != 0.0 || !entity.steps.is_empty() || entity.meets.is_some();
    // On foot it goes where its way leads, whatever it looks at.
    let heading_rad = match (&entity.placed.way, entity.body.on_foot) {
        (Some(on), true) => {
            let placed = super::places::Placed {
                spot: on.way.begins,
                ..entity.placed.clone()
            };
            concrete.in_frame(&placed)?.heading_rad
        }
        _ => spot.heading_rad,
    };
    // A road that turns off is nobody's but who keeps to that very way.
    let shares_road = concrete.is_on_road(&entity.placed);
    let near = |direction_rad: f64| (heading_rad - direction_rad).abs() < SQUARE_RAD;
    let path = match entity.body.on_foot {
        true if !shares_road => {
            return Err(refused(
                "nobody on foot is read beside a way that bends".to_owned(),
            ));
        }
        true if near(FRAC_PI_2) => Path::Left,
        true if near(-FRAC_PI_2) => Path::Right,
        true if near(0.0) => Path::With,
        true if near(PI) || near(-PI) => Path::Against,
        true => {
            return Err(refused(
                "on foot one faces along the road or across it".to_owned(),
            ));
        }
        false if shares_road && is_along(heading_rad, 0.0) => Path::With,
        false if shares_road && is_along(heading_rad, PI) => Path::Against,
        false => match (&entity.placed.way, moves) {
            (Some(on), true) => {
                let placed = super::places::Placed {
                    spot: on.way.begins,
                    ..entity.placed.clone()
                };
                Path::Own(concrete.in_frame(&placed)?, on)
            }
            (None, true) => {
                return Err(refused(
                    "it moves across the ego's road on no way of its own".to_owned(),
                ));
            }
            (_, false) => Path::Turned,
        },
    };
    Ok(Seen {
        entity,
        name: named(&entity.name),
        spot,
        path,
    })
}

/// The world of a point as a text with holes.
pub(super) fn draft(concrete: &Concrete, ado: Option<&str>) -> Result<Draft, ImportError> {
    let all = concrete
        .entities
        .iter()
        .map(|entity| seen(concrete, entity));
    let mut all = all.collect::<Result<Vec<Seen>, ImportError>>()?;
    let ego = all.iter().position(|it| it.entity.is_ego);
    let ego = ego.ok_or_else(|| concrete.at.error("nobody is called `Ego`"))?;
    // A gap to the ego is what it says, wherever the file puts somebody first.
    let (ego_front_m, ego_mps) = (
        all[ego].spot.x_m + all[ego].entity.body.front_m,
        all[ego].entity.speed_mps,
    );
    let scale = 1.0 - concrete.bend_per_m() * all[ego].spot.y_m;
    for it in &mut all {
        if let Some(gap_m) = it.entity.gap_m {
            let body = &it.entity.body;
            let way_m = (gap_m + body.length_m) / scale;
            it.spot.x_m = ego_front_m + way_m - body.front_m;
        }
    }
    let mut draft = Draft::default();
    let until_s = ends_s(concrete, &all, (ego_front_m, ego_mps))?;
    draft.text("    clock: (horizon_s: ");
    draft
        .0
        .push(Part::Most((until_s / SAMPLE_S).ceil() * SAMPLE_S));
    draft.text(", decision_s: ");
    draft.0.push(Part::Most(
        DECISION_S * (until_s / OFTEN_UNTIL_S).ceil().max(1.0),
    ));
    draft.text(&format!(
        ", sample_s: {SAMPLE_S}, substeps: 5),\n    plant: Kinematic,\n    \
         judge: UntilContact,\n"
    ));
    road(&mut draft, concrete, &all);
    bodies(&mut draft, &all);
    draft.text("    agents: [\n");
    let hides = all
        .iter()
        .any(|it| it.stands() && matches!(it.path, Path::Turned));
    let hides = hides
        || all
            .iter()
            .filter(|it| it.stands() && !it.entity.body.on_foot)
            .count()
            > 1;
    let mut trigger = None;
    // Who is placed first is known to those behind in the file.
    for it in std::iter::once(&all[ego]).chain(all.iter().filter(|it| !it.entity.is_ego)) {
        agent(&mut draft, concrete, &all, it, ado, &mut trigger)?;
    }
    draft.text("    ],\n");
    if hides {
        draft.text("    sensors: (line_of_sight: true),\n");
    }
    if let Some((name, value)) = trigger {
        draft.text(&format!("    parameters: {{ \"{name}\": "));
        draft.hole(&name, value);
        draft.text(" },\n");
    }
    let others = all.iter().filter(|it| !it.entity.is_ego);
    let clear: Vec<String> = others
        .map(|it| format!("{}.{}.gap >= 0.01", all[ego].name, it.name))
        .collect();
    let passed = match clear.is_empty() {
        true => within_lane(concrete, &all[ego]),
        false => clear.join(" and "),
    };
    draft.text(&format!("    ego_spec: \"always ({passed})\",\n"));
    Ok(draft)
}

/// What is asked of an ego that is alone: its sides stay within its lane.
fn within_lane(concrete: &Concrete, ego: &Seen) -> String {
    let middle_m = concrete.lane_width_m * concrete.lane_at(ego.spot.y_m);
    let room_m = 0.5 * (concrete.lane_width_m - ego.entity.body.width_m);
    format!(
        "{}.lateral in [{}, {}]",
        ego.name,
        tidy(middle_m - room_m),
        tidy(middle_m + room_m)
    )
}

/// When all that is expected has happened.
fn ends_s(
    concrete: &Concrete,
    all: &[Seen],
    (ego_front_m, ego_mps): (f64, f64),
) -> Result<f64, ImportError> {
    let mut until_s: Option<f64> = None;
    for it in all.iter().filter(|it| !it.entity.is_ego) {
        let met_s = match &it.entity.meets {
            Some(meets) => {
                let ego = concrete.in_frame(&meets.ego)?;
                (ego.x_m + ego_body_m(all) - ego_front_m) / ego_mps
            }
            None => {
                let way_m = it.spot.x_m - ego_front_m;
                let away_mps = match it.path {
                    Path::With => it.entity.speed_mps,
                    Path::Against => -it.entity.speed_mps,
                    _ => 0.0,
                };
                match way_m / (ego_mps - away_mps) {
                    met_s if it.entity.steps.is_empty() => met_s,
                    _ => continue,
                }
            }
        };
        if met_s.is_finite() && 0.0 < met_s {
            until_s = Some(until_s.unwrap_or(0.0).max(met_s + BEYOND_S));
        }
    }
    Ok(concrete.stop_s.or(until_s).unwrap_or(USUAL_S).max(1.0))
}

fn ego_body_m(all: &[Seen]) -> f64 {
    let ego = all.iter().find(|it| it.entity.is_ego);
    ego.map_or(0.0, |it| it.entity.body.front_m)
}

fn road(draft: &mut Draft, concrete: &Concrete, all: &[Seen]) {
    let farthest_m = all.iter().map(|it| it.spot.x_m).fold(0.0, f64::max);
    // A bend goes on as it is; where bends follow one another all are driven.
    let pieces = match concrete.bends_change() {
        true => concrete.pieces(f64::INFINITY),
        false => concrete.pieces(farthest_m + AHEAD_M),
    };
    let lanes = format!(
        "lanes: {}, lane_width_m: {}, friction: 1.0",
        concrete.lanes, concrete.lane_width_m
    );
    match pieces.is_empty() {
        true => draft.text(&format!("    road: Straight({lanes}),\n")),
        false => {
            draft.text(&format!(
                "    road: Curved({lanes}, pieces: [{}]),\n",
                bends(&pieces)
            ));
        }
    }
    let ways = all.iter().filter_map(|it| match it.path {
        Path::Own(begins, on) => Some((it, begins, on)),
        _ => None,
    });
    let ways: Vec<String> = ways
        .map(|(it, begins, on)| {
            let pieces = match on.way.pieces.is_empty() {
                true => String::new(),
                false => format!(", pieces: [{}]", bends(&on.way.pieces)),
            };
            format!(
                "        \"{}_way\": (at: (x_m: {}, y_m: {}, heading_rad: {}){pieces}),\n",
                it.name,
                tidy(begins.x_m),
                tidy(begins.y_m),
                begins.heading_rad
            )
        })
        .collect();
    if !ways.is_empty() {
        draft.text(&format!("    roads: {{\n{}    }},\n", ways.concat()));
    }
}

/// Pieces as a world file has them.
fn bends(pieces: &[Bend]) -> String {
    let pieces = pieces.iter().copied().flat_map(laid);
    let pieces = pieces.map(|piece| match piece.per_m == 0.0 {
        true => format!("Line(length_m: {})", tidy(piece.length_m)),
        false => format!(
            "Arc(length_m: {}, radius_m: {})",
            tidy(piece.length_m),
            tidy(1.0 / piece.per_m)
        ),
    });
    pieces.collect::<Vec<_>>().join(", ")
}

fn bodies(draft: &mut Draft, all: &[Seen]) {
    let mut known: Vec<&str> = Vec::new();
    draft.text("    bodies: {\n");
    for it in all {
        let body = &it.entity.body;
        if !known.contains(&body.name.as_str()) {
            known.push(&body.name);
            draft.text(&format!("        \"{}\": {},\n", body.name, body.ron));
        }
    }
    draft.text("    },\n");
}

fn agent(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[Seen],
    it: &Seen,
    ado: Option<&str>,
    trigger: &mut Option<(String, f64)>,
) -> Result<(), ImportError> {
    let (name, body) = (&it.name, &it.entity.body);
    let (x, lateral, speed) = (
        format!("{name}.x"),
        format!("{name}.lateral"),
        format!("{name}.speed"),
    );
    let front_m = match it.path {
        Path::Own(_, on) => on.along_m + it.front_along_m(),
        _ => it.spot.x_m + it.front_along_m(),
    };
    let left_m = it.spot.y_m + it.front_left_m();
    if let Path::Turned = it.path {
        return obstacle(draft, concrete, all, it);
    }
    match body.on_foot {
        true => {
            let facing = match it.path {
                Path::Left => "Left",
                Path::Right => "Right",
                Path::Against => "Back",
                _ => "Ahead",
            };
            draft.text(&format!(
                "        Pedestrian(\n            name: \"{name}\", body: \"{}\", facing: {facing}, \
                 lateral_m: ",
                body.name
            ));
            draft.hole(&lateral, left_m);
        }
        false => {
            draft.text(&format!(
                "        Vehicle(\n            name: \"{name}\", body: \"{}\"",
                body.name
            ));
            match it.path {
                Path::Own(..) => draft.text(&format!(", road: \"{name}_way\"")),
                _ => {
                    let width_m = concrete.lane_width_m;
                    let lane = concrete.lane_at(left_m);
                    draft.text(&format!(", lane: {lane}"));
                    // In bends a protocol's rear axle keeps the line.
                    if it.entity.is_ego && concrete.bends() {
                        draft.text(", lane_keeping: RearAxle");
                    }
                    if let Path::Against = it.path {
                        draft.text(", direction: Against");
                    }
                    draft.text(", offset_m: ");
                    let middle_m = lane * width_m;
                    draft.beside(&lateral, left_m - middle_m, middle_m);
                }
            }
        }
    }
    draft.text(",\n            start: At(x_m: ");
    draft.hole(&x, front_m);
    draft.text(", speed_mps: ");
    match it.entity.meets {
        Some(_) => draft.text("0.0"),
        None => draft.hole(&speed, it.entity.speed_mps),
    }
    draft.text("),\n            drive: ");
    if it.entity.is_ego {
        draft.text("Ego(Coast(accel_mps2: 0.0, lag_s: 0.0)),\n        ),\n");
        return Ok(());
    }
    let is_ado = ado == Some(it.entity.name.as_str()) || ado == Some(name.as_str());
    if is_ado {
        draft.text("Ado(\n                base: ");
    }
    plan(draft, concrete, all, it, trigger)?;
    if is_ado {
        draft.text(&format!(
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

/// Somebody who stands, on the straight road beside whose middle it is nearest.
fn obstacle(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[Seen],
    it: &Seen,
) -> Result<(), ImportError> {
    let (name, body) = (&it.name, &it.entity.body);
    let front = it.spot.moved(body.front_m, 0.0);
    let shares_road = concrete.is_on_road(&it.entity.placed);
    let mut nearest = shares_road.then(|| (String::new(), front));
    for other in all {
        match other.path {
            Path::Own(begins, on) if on.way.pieces.is_empty() => {
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
        let what = format!("`{}` stands beside no straight way", it.entity.name);
        return Err(concrete.at.error(what));
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

/// The plan of somebody, as `drive` or as `base`.
fn plan(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[Seen],
    it: &Seen,
    trigger: &mut Option<(String, f64)>,
) -> Result<(), ImportError> {
    let name = &it.name;
    if let Some(meets) = &it.entity.meets {
        let ego = concrete.in_frame(&meets.ego)?;
        let here = concrete.in_frame(&meets.here)?;
        let here_m = match it.path {
            Path::Left | Path::Right => here.y_m + it.front_left_m(),
            Path::Own(begins, on) => {
                let along_m = match &meets.here.way {
                    Some(here) if here.way == on.way && !on.way.pieces.is_empty() => here.along_m,
                    _ => begins.sees(&here).x_m,
                };
                along_m + it.front_along_m()
            }
            _ => here.x_m + it.front_along_m(),
        };
        draft.text("Meet(ego_at_m: ");
        draft.hole(&format!("{name}.meet.ego_at"), ego.x_m + ego_body_m(all));
        draft.text(", here_at_m: ");
        draft.hole(&format!("{name}.meet.here_at"), here_m);
        draft.text(", speed_mps: ");
        draft.hole(&format!("{name}.meet.speed"), meets.speed_mps);
        let (kind, value) = match meets.steady {
            Steady::Metres(value) => ("Metres", value),
            Steady::Seconds(value) => ("Seconds", value),
        };
        draft.text(&format!(", steady: {kind}("));
        draft.hole(&format!("{name}.meet.steady"), value);
        draft.text("))");
        return Ok(());
    }
    draft.text("Script([");
    for (step, number) in it.entity.steps.iter().zip(1..) {
        step_of(draft, concrete, all, it, (step, number), trigger)?;
    }
    draft.text(match it.entity.steps.is_empty() {
        true => "])",
        false => "\n            ])",
    });
    Ok(())
}

fn step_of(
    draft: &mut Draft,
    concrete: &Concrete,
    all: &[Seen],
    it: &Seen,
    (step, number): (&Step, usize),
    trigger: &mut Option<(String, f64)>,
) -> Result<(), ImportError> {
    let axis = |what: &str| format!("{}.step{number}.{what}", it.name);
    draft.text("\n                (");
    if let Some(watch) = &step.when {
        let parameter = format!("{}_trigger", it.name);
        if trigger.is_some() {
            return Err(concrete
                .at
                .error("several steps that wait for somebody are not read"));
        }
        *trigger = Some((parameter.clone(), watch.value));
        let formula = formula(concrete, all, watch, &parameter)?;
        draft.text(&format!("when: \"{formula}\", "));
    }
    if step.after_s != 0.0 {
        draft.text("after_s: ");
        draft.hole(&axis("after"), step.after_s);
        draft.text(", ");
    }
    draft.text("does: [");
    for (i, law) in step.laws.iter().enumerate() {
        if 0 < i {
            draft.text(", ");
        }
        law_of(draft, concrete, it, law, &axis);
    }
    draft.text("]),");
    Ok(())
}

fn law_of(
    draft: &mut Draft,
    concrete: &Concrete,
    it: &Seen,
    law: &Law,
    axis: &impl Fn(&str) -> String,
) {
    match law {
        Law::Speed {
            to_mps,
            relative_to,
            rate_mps2,
        } => {
            draft.text("Speed(to_mps: ");
            draft.hole(&axis("speed.to"), *to_mps);
            if let Some(other) = relative_to {
                draft.text(&format!(", relative_to: \"{}\"", named(other)));
            }
            if let Some(rate_mps2) = rate_mps2 {
                draft.text(", rate_mps2: ");
                draft.hole(&axis("speed.rate"), *rate_mps2);
            }
            draft.text(")");
        }
        Law::LaneChange { by_m, rate_mps } => {
            draft.text("LaneChange(by_m: ");
            draft.hole(&axis("lane_change.by"), *by_m);
            draft.text(", rate_mps: ");
            draft.hole(&axis("lane_change.rate"), *rate_mps);
            draft.text(")");
        }
        Law::Beside {
            t_m,
            most_lateral_mps2,
        } => {
            let width_m = concrete.lane_width_m;
            let middle_m = concrete.lane_at(it.spot.y_m) * width_m;
            draft.text("LaneOffset(to_m: ");
            draft.hole(&axis("lane_offset.to"), t_m - concrete.zero_m() - middle_m);
            draft.text(", most_lateral_mps2: ");
            draft.hole(&axis("lane_offset.most_lateral"), *most_lateral_mps2);
            draft.text(")");
        }
        Law::Walk { speed_mps, way_m } => {
            draft.text("Walk(speed_mps: ");
            draft.hole(&axis("walk.speed"), *speed_mps);
            draft.text(", way_m: ");
            draft.hole(&axis("walk.way"), *way_m);
            draft.text(")");
        }
    }
}

/// A clearance along the road below or above a parameter.
fn formula(
    concrete: &Concrete,
    all: &[Seen],
    watch: &Watch,
    parameter: &str,
) -> Result<String, ImportError> {
    let find = |name: &str| {
        let found = all.iter().find(|it| it.entity.name == name);
        found.ok_or_else(|| {
            concrete
                .at
                .error(format!("there is nobody called `{name}`"))
        })
    };
    let (who, whom) = (find(&watch.who)?, find(&watch.whom)?);
    let headway = format!("{}.{}.headway", who.name, whom.name);
    let clearance = match who.spot.x_m <= whom.spot.x_m {
        true => format!("{headway} - {}", tidy(whom.rear_m())),
        false => format!("-{headway} - {}", tidy(who.rear_m())),
    };
    let bound = match watch.is_time {
        true => format!("{parameter} * {}.speed", who.name),
        false => parameter.to_owned(),
    };
    // Strictly: who touches is not nearer than 0 m.
    Ok(match watch.is_below {
        true => format!("max({clearance}, 0) + 0.000001 <= {bound}"),
        false => format!("{clearance} >= {bound} + 0.000001"),
    })
}

/// Worlds of drafts, each with the points that share it.
pub(super) fn worlds(name: &str, source: &str, drafts: Vec<(usize, Draft)>) -> Vec<ImportedWorld> {
    let mut groups: Vec<Vec<(usize, Draft)>> = Vec::new();
    for (index, draft) in drafts {
        let group = groups.iter_mut().find(|it| it[0].1.is_like(&draft));
        match group {
            Some(group) => group.push((index, draft)),
            None => groups.push(vec![(index, draft)]),
        }
    }
    let several = 1 < groups.len();
    let worlds = groups.iter().zip(1..).map(|(group, number)| {
        let name = match several {
            true => format!("{name}_{number}"),
            false => name.to_owned(),
        };
        ImportedWorld {
            text: written(&name, source, group),
            points: group.iter().map(|(index, _)| *index).collect(),
            name,
        }
    });
    worlds.collect()
}

/// The text of a world; `group` are its points.
fn written(name: &str, source: &str, group: &[(usize, Draft)]) -> String {
    let mut text = format!(
        "// Imported by `brakecheck new --from`.\n\
         // The ego coasts as the protocol assumes: put yours in its place, or use --ego.\n\
         Scenario(\n    name: {name:?},\n    question: \"Which points of the protocol does the \
         ego pass?\",\n    source: {source:?},\n"
    );
    let mut axes: Vec<(String, Vec<f64>)> = Vec::new();
    for (i, part) in group[0].1.0.iter().enumerate() {
        let values = group.iter().filter_map(|(_, draft)| match draft.0[i] {
            Part::Hole { value, .. } | Part::Most(value) => Some(value),
            Part::Text(_) => None,
        });
        let (least, most) = values.clone().fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(least, most), value| (least.min(value), most.max(value)),
        );
        let _ = match part {
            Part::Text(part) => write!(text, "{part}"),
            Part::Most(_) => write!(text, "{}", decimal(tidy(most))),
            Part::Hole { .. } if least == most => write!(text, "{}", decimal(least)),
            Part::Hole { axis, more, .. } => {
                let column = values.map(|value| value + more);
                axes.push((axis.clone(), column.collect()));
                write!(text, "({}, {})", decimal(least), decimal(most))
            }
        };
    }
    if !axes.is_empty() {
        let names: Vec<String> = axes.iter().map(|(name, _)| format!("{name:?}")).collect();
        let _ = write!(
            text,
            "    points: (\n        axes: [{}],\n        rows: [\n",
            names.join(", ")
        );
        for row in 0..group.len() {
            let row: Vec<String> = axes
                .iter()
                .map(|(_, column)| decimal(column[row]))
                .collect();
            let _ = writeln!(text, "            [{}],", row.join(", "));
        }
        text.push_str("        ],\n    ),\n");
    }
    text.push_str(")\n");
    text
}

/// A number with a point, as RON files here have them.
fn decimal(value: f64) -> String {
    format!("{value:?}")
}
