//! Driving lanes of all roads of an OpenDRIVE file, as lines.

use std::path::Path;

use crate::opendrive::error::ImportError;
use crate::opendrive::files::Files;
use crate::opendrive::roads::{ImportedRoad, RoadMap};
use crate::opendrive::tree::XmlNode;

/// Distance of the points of a line.
const STEP_M: f64 = 2.0;

/// Greatest number of places on the roads of a file.
const MOST_PLACES: usize = 2_000_000;

/// Driving lanes of one direction of a road.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenLanes {
    /// Id of the road.
    pub road: String,
    /// Middle of the right lane as x and y in metres, in the direction of travel.
    pub right_lane_m: Vec<[f64; 2]>,
    /// Distances of the lanes' middles to the left of it, from right to left.
    pub offsets_m: Vec<f64>,
}

/// Reads the driving lanes of all roads of a file.
///
/// # Errors
///
/// Returns an error with file and element for content that is not supported.
pub fn driven_lanes(path: &Path, files: Files<'_>) -> Result<Vec<DrivenLanes>, ImportError> {
    let root = XmlNode::read(path, "OpenDRIVE", files)?;
    let roads = RoadMap::of(&root)?;
    let mut all = Vec::new();
    for node in root.all("road") {
        let id = node.need("id")?;
        let road = roads.road(node, id)?;
        if road.is_left_hand {
            let help = "mirror the road: the driving lanes of a recording have right-hand traffic";
            return Err(node.refused("left-hand traffic is not read here", help));
        }
        // Lanes with negative numbers follow the reference line.
        for side in [-1, 1] {
            all.extend(lanes_of(node, id, road, side)?);
        }
        let points: usize = all
            .iter()
            .map(|it: &DrivenLanes| it.right_lane_m.len())
            .sum();
        // Checked road by road, so that a hostile map stops early.
        few_places(node, points)?;
    }
    Ok(all)
}

/// Place in the middle of a driving lane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceOnLane {
    /// Id of the road.
    pub road: String,
    /// Number of the lane.
    pub lane: i32,
    /// Station along the reference line of the road.
    pub s_m: f64,
    /// Position.
    pub x_m: f64,
    /// Position.
    pub y_m: f64,
}

/// Places on the driving lanes of all roads of a file, at even stations.
///
/// Lanes may change their width, their offset and their number along a road.
///
/// # Errors
///
/// Returns an error with file and element for content that is not supported.
pub fn lane_places(
    path: &Path,
    files: Files<'_>,
    step_m: f64,
) -> Result<Vec<PlaceOnLane>, ImportError> {
    let root = XmlNode::read(path, "OpenDRIVE", files)?;
    let roads = RoadMap::of(&root)?;
    let mut places = Vec::new();
    for node in root.all("road") {
        let id = node.need("id")?;
        let road = roads.road(node, id)?;
        let steps = libm::floor(road.length_m / step_m) as usize;
        for s_m in (0..=steps).map(|step| step as f64 * step_m) {
            // Before each station, because a single road may have millions.
            few_places(node, places.len())?;
            let Some((section, lanes)) = road.lanes.section(s_m) else {
                continue;
            };
            for lane in lanes.lanes.iter().filter(|lane| lane.drives) {
                let Some((t_m, _)) = road.lanes.middle(section, s_m, lane.id) else {
                    continue;
                };
                let at = road.at(s_m, t_m);
                places.push(PlaceOnLane {
                    road: id.to_owned(),
                    lane: lane.id,
                    s_m,
                    x_m: at.x_m,
                    y_m: at.y_m,
                });
            }
        }
    }
    Ok(places)
}

/// Refuses a road with which a file has more places than are read.
fn few_places(road: &XmlNode, places: usize) -> Result<(), ImportError> {
    if places <= MOST_PLACES {
        return Ok(());
    }
    let what = format!("its roads have more than {MOST_PLACES} places so far");
    Err(road.refused(what, "cut out the roads that the recording uses"))
}

fn lanes_of(
    node: &XmlNode,
    id: &str,
    road: &ImportedRoad,
    side: i32,
) -> Result<Option<DrivenLanes>, ImportError> {
    let lanes = road.driven_beside(side, 0.0).into_iter();
    let middles: Vec<f64> = lanes
        .map(|(lane, _)| road.middle_m(node, lane))
        .collect::<Result<_, _>>()?;
    let Some(&right_m) = middles.first() else {
        return Ok(None);
    };
    // Even steps include both ends, which even a short road needs.
    let steps = libm::ceil(road.length_m / STEP_M).max(1.0) as usize;
    let points = (0..=steps).map(|i| {
        let at = road.at(road.length_m * i as f64 / steps as f64, right_m);
        [at.x_m, at.y_m]
    });
    let mut right_lane_m: Vec<[f64; 2]> = points.collect();
    // Lanes on the left are driven against the reference line.
    if side > 0 {
        right_lane_m.reverse();
    }
    // The outermost lane is the right one, and all others lie to its left.
    let offset_m = |middle_m: &f64| (middle_m - right_m).abs();
    Ok(Some(DrivenLanes {
        road: id.to_owned(),
        right_lane_m,
        offsets_m: middles.iter().map(offset_m).collect(),
    }))
}
