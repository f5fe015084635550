//! Ways along lanes: through sections, over the links of roads and through
//! junctions.

use core::f64::consts::PI;

use super::curve::{PlaneCurve, arcs_of, pair_of, self_overlap_m};
use super::error::ImportError;
use super::lanes::DirectedLane;
use super::links::RoadLink;
use super::roads::{ImportedRoad, OnLane, RoadMap};
use super::tree::XmlNode;
use super::ways::{OnWay, WINDS, course, cut};
use crate::pose::{Pose, wrapped};
use crate::road::Bend;

/// Length in metres that a lane may lose by slanting, on the whole way.
///
/// Entities advance along the reference line, which is shorter than such a lane. A
/// fast one may be off by less than a step of 0.01 s.
const SLANT_M: f64 = 0.015;
const SLANT_S: f64 = 0.01;
/// Greatest difference in metres between widths that count as equal.
const SAME_WIDTH_M: f64 = 0.001;
/// Greatest gap in metres between parts of a way, and greatest curvature in 1/m.
const GAP_M: f64 = 0.05;
const MOST_PER_M: f64 = 0.5;
/// Width in metres of a way that must not come back to itself, and how far before
/// that it ends.
const ROUND_M: f64 = 8.0;
const BEFORE_M: f64 = 60.0;
/// Least length in metres of a way that ends where its lanes jump or slant.
const LEAST_M: f64 = 20.0;
/// Greatest number of roads and sections of a way.
const MOST_PARTS: usize = 10_000;
/// Curvature in 1/m below which a piece is a line.
const LINE_PER_M: f64 = 1e-9;

/// Part of a way: a lane in one section of a road, in the direction of travel.
#[derive(Clone, Debug, PartialEq)]
pub struct LaneStretch {
    /// Id of the road.
    pub road: String,
    section: usize,
    /// Id of the lane.
    pub lane: i32,
    from_m: f64,
    to_m: f64,
}

/// Choice of a way along lanes.
#[derive(Clone, Copy, Debug)]
pub struct LaneRoute<'a> {
    /// Roads that the way visits, in order.
    pub via: &'a [String],
    /// Greatest length of the way.
    pub reach_m: f64,
}

/// Entity that follows a way along lanes.
#[derive(Clone, Copy, Debug)]
pub struct LaneFollower {
    /// Its offset to the left of the middle of the lanes.
    pub left_m: f64,
    /// Its least speed.
    pub slowest_mps: f64,
    /// True if its way may end where the lanes jump or slant.
    pub may_end: bool,
}

impl RoadMap {
    /// Returns the lanes that are driven from a place on, in order.
    ///
    /// Where a junction offers several ways, the route decides. Without a decision the
    /// way ends there.
    ///
    /// # Errors
    ///
    /// Returns an error for a road with unsupported content.
    pub fn lane_drive(
        &self,
        asks: &XmlNode,
        at: &OnLane,
        along: LaneRoute<'_>,
    ) -> Result<Vec<LaneStretch>, ImportError> {
        let mut all: Vec<LaneStretch> = Vec::new();
        let mut next = Some((at.road.clone(), at.driven(), Some(at.s_m)));
        let mut left_m = along.reach_m;
        let mut parts = 0;
        // The way begins on that road, so a route may name it first.
        let mut route = along.via.iter().skip_while(|id| **id == at.road).peekable();
        while let Some((id, driven, from_m)) = next.take() {
            let road = self.road(asks, &id)?;
            // A road that is named several times in a row is one visit.
            while route.next_if(|wanted| **wanted == id).is_some() {}
            let (stretches, end_lane) = through(road, &id, driven, from_m);
            // Roads without a length, or nearly so, may link to each other in a circle.
            parts += 1 + stretches.len();
            if parts > MOST_PARTS {
                let what = format!(
                    "more than {MOST_PARTS} roads and sections on {:.0} m",
                    along.reach_m
                );
                let help = "link roads of some length, in no circle of shorter ones";
                return Err(road.node.refused(what, help));
            }
            for stretch in stretches {
                let stretch = stretch.cut(left_m);
                left_m -= stretch.length_m();
                all.push(stretch);
                if left_m <= 0.0 {
                    return Ok(all);
                }
            }
            let wanted = route.peek().map(|id| id.as_str());
            if let Some(lane) = end_lane {
                let driven = DirectedLane { lane, ..driven };
                next = self
                    .after(road, &id, driven, wanted)
                    .map(|(id, driven)| (id, driven, None));
            }
        }
        Ok(all)
    }

    /// Returns the road behind the end of a road, with the lane and its direction.
    fn after(
        &self,
        road: &ImportedRoad,
        id: &str,
        driven: DirectedLane,
        wanted: Option<&str>,
    ) -> Option<(String, DirectedLane)> {
        let DirectedLane { lane, forward } = driven;
        let side = usize::from(forward);
        let link = road.links[side].as_ref()?;
        let (over, to) = if link.is_junction {
            let connections = self.junctions.0.get(&link.id)?;
            let possible: Vec<(&RoadLink, i32)> = connections
                .iter()
                .filter(|it| it.from == id)
                .filter_map(|it| {
                    let to = it.lanes.iter().find(|(from, _)| *from == lane);
                    Some((&it.over, to?.1))
                })
                .collect();
            let leads = |over: &&(&RoadLink, i32)| {
                let (link, _) = **over;
                wanted.is_some_and(|wanted| link.id == wanted || self.leads_to(link, wanted))
            };
            match &possible[..] {
                // A single connection needs no route. Several without a
                // fitting one end the way.
                [one] => *one,
                several => *several.iter().find(leads)?,
            }
        } else {
            let section = if side == 1 {
                road.lanes.sections.last()?
            } else {
                road.lanes.sections.first()?
            };
            (link, section.lane(lane)?.links[side]?)
        };
        // A road that is entered at its end is driven against its reference line.
        // With the traffic or against it, the way goes on alike.
        let leads = (
            road.leads_forward(lane),
            self.get(&over.id)?.leads_forward(to),
        );
        let fits = (leads.0 == forward) == (leads.1 != over.at_end);
        let driven = DirectedLane {
            lane: to,
            forward: !over.at_end,
        };
        fits.then(|| (over.id.clone(), driven))
    }

    /// Returns whether a road inside a junction ends at a road.
    fn leads_to(&self, link: &RoadLink, wanted: &str) -> bool {
        let road = self.get(&link.id);
        let end = road.and_then(|road| road.links[usize::from(!link.at_end)].as_ref());
        end.is_some_and(|end| !end.is_junction && end.id == wanted)
    }

    /// Number of lanes to the right of a way, all of a width and on the whole way.
    pub fn lanes_beside(&self, stretches: &[LaneStretch], width_m: f64) -> usize {
        let beside = |it: &LaneStretch| {
            let road = self.get(&it.road)?;
            // Against the traffic, the lanes to the right lead the other way.
            let is_right = !road.is_left_hand && road.leads_forward(it.lane) == it.is_forward();
            is_right.then_some(())?;
            let side = road.driven_beside(it.lane, 0.5 * (it.from_m + it.to_m));
            road.lanes.fixed_m(it.lane)?;
            let is_wide = |(_, other_m): &(i32, f64)| (other_m - width_m).abs() < SAME_WIDTH_M;
            let right = side.iter().position(|(id, _)| *id == it.lane)?;
            side.iter().all(is_wide).then_some(right)
        };
        let beside: Vec<Option<usize>> = stretches.iter().map(beside).collect();
        match beside.first() {
            Some(Some(right)) if beside.iter().all(|it| *it == Some(*right)) => *right,
            _ => 0,
        }
    }

    /// Returns the way along lanes of an entity.
    ///
    /// # Errors
    ///
    /// Returns an error for lanes that jump, or slant more than an entity can follow,
    /// unless its way may end there.
    pub fn lane_way(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        follower: LaneFollower,
    ) -> Result<OnWay, ImportError> {
        let mut begins = None;
        let mut pieces: Vec<Bend> = Vec::new();
        let mut spot = Pose::default();
        let mut lost_m = 0.0;
        let may_end = |pieces: &[Bend]| {
            let length_m: f64 = pieces.iter().map(|it| it.length_m).sum();
            follower.may_end && length_m >= LEAST_M
        };
        'way: for stretch in stretches {
            let road = self.road(asks, &stretch.road)?;
            let length_m = stretch.length_m();
            let at = |along_m: f64| stretch.pose(road, along_m, follower.left_m);
            lost_m += stretch.slant_m(road);
            if SLANT_M.max(SLANT_S * follower.slowest_mps) < lost_m {
                if may_end(&pieces) {
                    break;
                }
                let what = format!("its lane slants, by {lost_m:.2} m of its way");
                let help = "a way along lanes of nearly constant width and offset is read";
                return Err(asks.refused(what, help));
            }
            let curve = PlaneCurve { at: &at, length_m };
            let arcs = arcs_of(curve, 0.0).map_err(|what| road.node.refused(what, WINDS))?;
            for arc in arcs {
                if begins.is_none() {
                    begins = Some(arc.start);
                    spot = arc.start;
                }
                let off = spot.sees(&arc.start);
                if libm::hypot(off.x_m, off.y_m) > GAP_M || arc.bend.per_m.abs() > MOST_PER_M {
                    if may_end(&pieces) {
                        break 'way;
                    }
                    let what = format!("lane {} of road `{}` jumps", stretch.lane, stretch.road);
                    let help = "let widths, offsets and linked roads go on where they end";
                    return Err(asks.refused(what, help));
                }
                // Arcs begin where the way has come to, so that small gaps
                // between roads do not add up.
                let end = at(arc.from_m + arc.covers_m);
                for (_, bend) in pair_of(spot, end) {
                    spot = spot.bent(bend.length_m, bend.per_m);
                    lengthen(&mut pieces, bend);
                }
                spot = end;
            }
        }
        let begins = begins.ok_or_else(|| {
            let help = "place it before the end of its lane, in the direction of the traffic";
            asks.refused("its lane has no length", help)
        })?;
        let way = course(asks, begins, &pieces)?;
        let on_way = |at_m: f64| way.pose(at_m, 0.0);
        let curve = PlaneCurve {
            at: &on_way,
            length_m: way.end_s_m(),
        };
        let on = match self_overlap_m(curve, way.turned_rad(), ROUND_M) {
            None => {
                let ends_m = way.end_s_m();
                OnWay::start(way, ends_m)
            }
            // It ends before it comes back to itself, where a place has two stations.
            Some(overlap_m) => {
                let ends_m = (overlap_m - BEFORE_M).max(0.5 * overlap_m);
                OnWay::start(course(asks, begins, &cut(pieces, ends_m))?, ends_m)
            }
        };
        Ok(OnWay {
            is_lane: true,
            ..on
        })
    }
}

/// Appends a piece, or makes the last one longer that has its curvature.
fn lengthen(pieces: &mut Vec<Bend>, mut bend: Bend) {
    if bend.per_m.abs() < LINE_PER_M {
        bend.per_m = 0.0;
    }
    match pieces.last_mut() {
        _ if bend.length_m <= 0.0 => {}
        Some(last) if (last.per_m - bend.per_m).abs() < LINE_PER_M => {
            last.length_m += bend.length_m;
        }
        _ => pieces.push(bend),
    }
}

/// Stretches of a road from a station on, and the lane at its end.
fn through(
    road: &ImportedRoad,
    id: &str,
    driven: DirectedLane,
    from_m: Option<f64>,
) -> (Vec<LaneStretch>, Option<i32>) {
    let DirectedLane { mut lane, forward } = driven;
    let from_m = from_m.unwrap_or(if forward { 0.0 } else { road.length_m });
    let sections = &road.lanes.sections;
    let mut section = road.lanes.section(from_m).map_or(0, |(section, _)| section);
    let mut stretches = Vec::new();
    let mut at_m = from_m;
    loop {
        let begins_m = sections.get(section).map_or(0.0, |it| it.s_m);
        let ends_m = sections.get(section + 1).map_or(road.length_m, |it| it.s_m);
        let to_m = if forward { ends_m } else { begins_m };
        // Sections of equal stations have nothing between them.
        if at_m != to_m {
            stretches.push(LaneStretch {
                road: id.to_owned(),
                section,
                lane,
                from_m: at_m,
                to_m,
            });
        }
        at_m = to_m;
        let next = if forward {
            Some(section + 1).filter(|next| *next < sections.len())
        } else {
            section.checked_sub(1)
        };
        let Some(next) = next else {
            return (stretches, Some(lane));
        };
        let links = sections[section].lane(lane).map(|it| it.links);
        match links.and_then(|links| links[usize::from(forward)]) {
            Some(linked) if linked * lane > 0 => lane = linked,
            // A lane that ends here.
            _ => return (stretches, None),
        }
        section = next;
    }
}

impl LaneStretch {
    /// Returns whether the stretch is driven along its reference line.
    pub fn is_forward(&self) -> bool {
        self.from_m < self.to_m
    }

    /// Returns the length of the stretch.
    pub fn length_m(&self) -> f64 {
        (self.to_m - self.from_m).abs()
    }

    /// The stretch up to a length.
    fn cut(self, most_m: f64) -> LaneStretch {
        let to_m = self.station_m(self.length_m().min(most_m));
        LaneStretch { to_m, ..self }
    }

    /// Returns the station on the reference line after a driven distance.
    pub fn station_m(&self, along_m: f64) -> f64 {
        if self.is_forward() {
            self.from_m + along_m
        } else {
            self.from_m - along_m
        }
    }

    /// Place on the lane in the direction of travel, `left_m` to its left.
    pub(super) fn pose(&self, road: &ImportedRoad, along_m: f64, left_m: f64) -> Pose {
        let s_m = self.station_m(along_m);
        let middle = road.lanes.middle(self.section, s_m, self.lane);
        let (t_m, slope) = middle.unwrap_or_default();
        let forward = self.is_forward();
        let t_m = if forward { t_m + left_m } else { t_m - left_m };
        let on = road.at(s_m, t_m);
        let slant_rad = libm::atan2(slope, 1.0 - road.per_m(s_m) * t_m);
        let turn_rad = if forward { 0.0 } else { PI };
        Pose {
            heading_rad: wrapped(on.heading_rad + slant_rad + turn_rad),
            ..on
        }
    }

    /// Length in metres by which the lane is longer than its part of the road.
    fn slant_m(&self, road: &ImportedRoad) -> f64 {
        const PARTS: u32 = 20;
        let part_m = self.length_m() / f64::from(PARTS);
        let parts = (0..PARTS).map(|part| {
            let s_m = self.station_m((f64::from(part) + 0.5) * part_m);
            let middle = road.lanes.middle(self.section, s_m, self.lane);
            let slope = middle.map_or(0.0, |(_, slope)| slope);
            // First term of √(1 + slope²) − 1, the extra length per length.
            0.5 * slope * slope * part_m
        });
        parts.sum()
    }
}
