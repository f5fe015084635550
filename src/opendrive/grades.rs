//! Grades of ways along lanes, from the heights of their roads.

use super::curve::{Cubic, begun, pair_of};
use super::error::ImportError;
use super::lane_drive::LaneStretch;
use super::lanes::cubic;
use super::roads::RoadMap;
use super::tree::XmlNode;
use crate::road::Grade;

/// Length in metres of a part with one rise, and greatest number of parts of a way.
const PART_M: f64 = 2.0;
const MOST_PARTS: f64 = 900.0;
/// Length in metres below which a part has no grade of its own.
const LEAST_M: f64 = 0.01;
/// Greatest difference of rises that count as equal: 0.005 m/s² of acceleration.
const SAME_RISE: f64 = 5e-4;

/// Reads the heights of a road's reference line.
pub(super) fn heights_of(road: &XmlNode) -> Result<Vec<Cubic>, ImportError> {
    let profile = road.child("elevationProfile").into_iter();
    let heights = profile.flat_map(|it| it.all("elevation"));
    heights.map(|it| cubic(it, "s", 0.0)).collect()
}

impl RoadMap {
    /// Returns the grades of a way along lanes, at an offset to the left of their
    /// middle.
    ///
    /// The list is empty for a way without any rise.
    ///
    /// # Errors
    ///
    /// Returns an error for a road with unsupported content.
    pub(crate) fn lane_grades(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        left_m: f64,
    ) -> Result<Vec<Grade>, ImportError> {
        let way_m: f64 = stretches.iter().map(LaneStretch::length_m).sum();
        let part_m = PART_M.max(way_m / MOST_PARTS);
        let mut grades: Vec<Grade> = Vec::new();
        let mut from_s_m = 0.0;
        for stretch in stretches {
            let road = self.road(asks, &stretch.road)?;
            let parts = (stretch.length_m() / part_m).ceil();
            let along_m = |part: f64| stretch.length_m() * part / parts;
            for part in 0..parts as usize {
                let part = part as f64;
                let at = |part| stretch.pose(road, along_m(part), left_m);
                let [first, second] = pair_of(at(part), at(part + 1.0));
                let lane_m = first.1.length_m + second.1.length_m;
                from_s_m += lane_m;
                if lane_m < LEAST_M {
                    continue;
                }
                let middle_m = stretch.station_m(along_m(part + 0.5));
                let slope = begun(&road.heights_m, middle_m).slope(middle_m);
                // A lane on the inside of a bend is shorter and so steeper. Against
                // the road, a rise is a fall.
                let [begins_m, ends_m] =
                    [part, part + 1.0].map(|it| stretch.station_m(along_m(it)));
                let rise = slope * (ends_m - begins_m) / lane_m;
                let goes_on = |last: &Grade| (last.rise - rise).abs() <= SAME_RISE;
                if !grades.last().is_some_and(goes_on) {
                    let from_s_m = from_s_m - lane_m;
                    grades.push(Grade { from_s_m, rise });
                }
            }
        }
        let is_flat = grades.iter().all(|grade| grade.rise == 0.0);
        Ok(if is_flat { Vec::new() } else { grades })
    }
}
