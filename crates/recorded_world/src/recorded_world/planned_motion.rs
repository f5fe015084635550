//! Fitted speeds and roads in the shapes of world files.

use brakecheck_traffic::{FittedRoad, SpeedPlan, StockBody, rounded};

use super::FRICTION;
use crate::pose::Pose;
use crate::road::{Bend, Direction, Piece, Priority, RoadPlace};
use crate::scene::drive::{LaneKeeping, MotionLaw, ScriptStep};
use crate::world_file::{
    AgentFile, DriveFile, Facing, NumberOrRange, OwnRoad, RoadFile, RuleFile, StartFile,
    WrittenRule,
};

/// Step of a script in a world file.
pub(crate) type PlanStep = ScriptStep<NumberOrRange, String>;

/// Returns a step that begins at once.
pub(crate) fn step(does: Vec<MotionLaw<NumberOrRange>>) -> PlanStep {
    ScriptStep {
        when: None,
        after_s: NumberOrRange::default(),
        does,
        overlaps: false,
    }
}

/// Returns a linear change of speed.
pub(crate) fn change_of_speed(
    to_mps: NumberOrRange,
    rate_mps2: NumberOrRange,
) -> MotionLaw<NumberOrRange> {
    MotionLaw::Speed {
        to_mps,
        relative_to: None,
        rate_mps2: Some(rate_mps2),
        shape: None,
    }
}

/// Returns a step per piece of a plan, without ranges.
pub(crate) fn steps_of(speed: &SpeedPlan) -> Vec<PlanStep> {
    let pieces = speed.to_mps.iter().zip(speed.rates_mps2());
    let steps = pieces.map(|(to_mps, rate)| {
        step(vec![change_of_speed(
            (*to_mps).into(),
            rounded(rate).into(),
        )])
    });
    steps.collect()
}

/// Returns the pieces of a fitted road, none if it is straight.
fn pieces(road: &FittedRoad) -> impl Iterator<Item = Piece> {
    let piece = |Bend { length_m, per_m }| match per_m {
        // An exact comparison: the fit sets the curvature of lines to 0.
        0.0 => Piece::Line { length_m },
        _ => Piece::Arc {
            length_m,
            radius_m: rounded(1.0 / per_m),
        },
    };
    road.course.bends().into_iter().map(piece)
}

/// Returns a fitted road as the world's own.
pub(crate) fn own_road(
    road: &FittedRoad,
    lanes: usize,
    lane_width_m: f64,
    speed_limit_mps: Option<f64>,
) -> OwnRoad {
    let (lane_width_m, friction) = (lane_width_m.into(), FRICTION.into());
    if road.is_straight() {
        return OwnRoad::Straight {
            lanes,
            lane_width_m,
            friction,
            speed_limit_mps,
        };
    }
    OwnRoad::Curved {
        lanes,
        lane_width_m,
        friction,
        speed_limit_mps,
        pieces: pieces(road).map(Into::into).collect(),
    }
}

/// Returns a fitted path as a road of one lane for a width, in a world with an origin.
pub(crate) fn path_of(body_width_m: f64, road: &FittedRoad, origin: Pose) -> RoadFile {
    // Roads of a world are placed relative to its own road.
    let start = origin.sees(&road.course.start());
    // A margin of 0.2 m on both sides leaves the body inside its lane. A lane is at least
    // 1 m wide.
    let width_m = (body_width_m + 0.4).max(1.0);
    RoadFile {
        at: Some(RoadPlace {
            x_m: rounded(start.x_m),
            y_m: rounded(start.y_m),
            heading_rad: rounded(start.heading_rad),
            z_m: 0.0,
        }),
        along: None,
        lanes: 1,
        lane_width_m: Some(rounded(width_m)),
        pieces: pieces(road).collect(),
        priority: Priority::default(),
        grades: Vec::new(),
        vertical_curve_m: 0.0,
        banks: Vec::new(),
    }
}

/// Body of a road user by its name.
#[derive(Clone, Copy)]
pub(crate) struct NamedBody<'a> {
    pub(crate) name: &'a str,
    pub(crate) is_on_foot: bool,
}

impl From<StockBody> for NamedBody<'static> {
    fn from(body: StockBody) -> NamedBody<'static> {
        NamedBody {
            name: body.name,
            is_on_foot: body.is_on_foot(),
        }
    }
}

/// Returns a road user in the middle of a named road.
pub(crate) fn on_path(
    name: &str,
    body: NamedBody<'_>,
    road: &str,
    start: StartFile,
    drive: DriveFile,
) -> AgentFile {
    let (name, road) = (name.to_owned(), Some(road.to_owned()));
    if body.is_on_foot {
        return AgentFile::Pedestrian {
            name,
            body: body.name.to_owned(),
            road,
            lateral_m: NumberOrRange::default(),
            facing: Facing::Ahead,
            start,
            drive,
        };
    }
    AgentFile::Vehicle {
        name,
        body: body.name.to_owned(),
        road,
        lane: 0,
        direction: Direction::default(),
        lane_keeping: LaneKeeping::default(),
        offset_m: NumberOrRange::default(),
        start,
        drive,
    }
}

/// Returns a rule without a requirement, ranked by its position.
pub(crate) fn rule(name: &str, stl: String) -> RuleFile {
    RuleFile::Rule(WrittenRule {
        name: name.to_owned(),
        stl,
        requirement: None,
        priority: None,
    })
}
