//! Road of a world along the lanes of an OpenDRIVE file.

use std::path::Path;

use super::error::{At, ImportError};
use super::lane_drive::{LaneFollower, LaneRoute};
use super::roads::{OnLane, RoadMap};
use super::tree::XmlNode;
use crate::pose::Pose;
use crate::road::{Bank, Grade, Piece};

/// Greatest length in metres of a way along lanes.
const MOST_M: f64 = 5_000.0;

/// Start on a lane, and the way from there.
#[derive(Clone, Debug)]
pub struct LaneStart<'a> {
    /// Id of the road.
    pub road: &'a str,
    /// Id of the lane.
    pub lane: i32,
    /// Station of the start on the reference line.
    pub s_m: f64,
    /// Roads that the way visits, which decide at junctions.
    pub via: &'a [String],
    /// Length of the way.
    pub length_m: f64,
}

/// Way along lanes in the form of a road.
#[derive(Clone, Debug)]
pub struct LaneRoad {
    /// Start of the middle of its lane 0, in the plane of the file.
    pub begins: Pose,
    /// Number of lanes.
    pub lanes: usize,
    /// Width of each lane.
    pub lane_width_m: f64,
    /// Pieces of the course.
    pub pieces: Vec<Piece>,
    /// Grades along the course.
    pub grades: Vec<Grade>,
    /// Banks along the course.
    pub banks: Vec<Bank>,
    /// Height of the start in the file.
    pub begins_z_m: f64,
    /// Signals along it with their stations.
    pub signals: Vec<(String, f64)>,
}

/// Reads the way along lanes from a start.
///
/// All lanes on the right of it belong to the road, if they have one width and go
/// on beside it. Otherwise the road is the lane alone.
///
/// # Errors
///
/// Returns an error for an unknown road or lane, and for unsupported content.
pub fn lane_road(path: &Path, text: &str, from: &LaneStart) -> Result<LaneRoad, ImportError> {
    let root = XmlNode::parse(path, text.trim_start_matches('\u{feff}'))?;
    let roads = RoadMap::of(&root)?;
    let line = roads.road(&root, from.road)?;
    if !(0.0..=line.length_m).contains(&from.s_m) {
        let what = format!(
            "`s_m` is {}, and road `{}` has {} m",
            from.s_m, from.road, line.length_m
        );
        let help = "begin the way on the road";
        return Err(line.node.refused(what, help));
    }
    if from.length_m.is_nan() || from.length_m <= 0.0 {
        let what = format!("`length_m` is {}", from.length_m);
        return Err(At::file(path).error(what).helped("write a length above 0"));
    }
    let at = OnLane {
        road: from.road.to_owned(),
        lane: from.lane,
        s_m: from.s_m,
        t_m: line.middle_at(&root, from.s_m, from.lane)?.0,
        forward: line.leads_forward(from.lane),
    };
    let drive = roads.lane_drive(
        &root,
        &at,
        LaneRoute {
            via: from.via,
            reach_m: from.length_m.min(MOST_M),
        },
    )?;
    if let Some(missing) = from
        .via
        .iter()
        .find(|id| !drive.iter().any(|it| it.road == **id))
    {
        let what = format!(
            "the way from road `{}` does not lead to road `{missing}`",
            from.road
        );
        let help =
            "list the roads in the order of the way, one before and one behind each junction";
        return Err(At::file(path).error(what).helped(help));
    }
    let lane_width_m = line.lanes.width_m(from.s_m, from.lane).unwrap_or(0.0);
    // Lane 0 of a world is the rightmost, so the road begins that many lanes to the right.
    let right = roads.lanes_beside(&drive, lane_width_m);
    let beside_m = -(right as f64) * lane_width_m;
    let on = roads.lane_way(
        &root,
        &drive,
        LaneFollower {
            left_m: beside_m,
            slowest_mps: 0.0,
            may_end: false,
        },
    )?;
    Ok(LaneRoad {
        begins: on.way.start(),
        lanes: right + 1,
        lane_width_m,
        pieces: on.way.bends().into_iter().map(Piece::from).collect(),
        grades: roads.lane_grades(&root, &drive, beside_m)?,
        banks: roads.lane_banks(&root, &drive, beside_m)?,
        begins_z_m: line.height_m(from.s_m, at.t_m + f64::from(at.side()) * beside_m),
        signals: roads.lane_signals(&root, &drive, beside_m)?,
    })
}

impl LaneRoad {
    /// Start of another road, seen from the start of this one.
    pub fn sees(&self, other: &LaneRoad) -> Pose {
        self.begins.sees(&other.begins)
    }
}
