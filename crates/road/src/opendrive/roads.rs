//! Roads from OpenDRIVE: reference lines with lanes.
//!
//! Unsupported content of a road is an error only if an entity is on the road.

use core::cmp::Ordering;
use core::f64::consts::{FRAC_PI_2, PI};
use std::collections::BTreeMap;

use super::curve::{Cubic, PlaneCurve, begun, self_overlap_m};
use super::error::{Blockers, ImportError};
use super::lanes::{DirectedLane, RoadLanes, few, heights_of};
use super::links::{Junctions, RoadLink, controllers};
use super::reference_line::{MEET_M, MOST_ROAD_M, ReferenceSegment, pieces_of};
use super::scope::ParameterScope;
use super::surface::Surface;
use super::tree::XmlNode;
use crate::pose::{Pose, wrapped};

/// Greatest number of lines and arcs of all roads of a file.
const MOST_PIECES: usize = 200_000;
/// Greatest step of heights in metres that is taken for a rounding of the file.
const STEP_M: f64 = 0.1;
/// Greatest number of signals of a road.
const MOST_SIGNALS: usize = 5_000;

/// Road: reference line and lanes.
#[derive(Clone, Debug)]
pub struct ImportedRoad {
    /// Element of the file.
    pub node: XmlNode,
    /// Length of the reference line.
    pub length_m: f64,
    /// Pieces of the reference line.
    pub pieces: Vec<ReferenceSegment>,
    /// True for a road that closes on itself, or crosses itself.
    pub overlaps_itself: bool,
    /// True for left-hand traffic.
    pub is_left_hand: bool,
    /// First unsupported content, returned when an entity is on the road.
    refused: Option<ImportError>,
    /// Lanes by section.
    pub lanes: RoadLanes,
    /// Heights of its reference line.
    pub heights_m: Vec<Cubic>,
    /// Roads or junctions before and after it.
    pub(crate) links: [Option<RoadLink>; 2],
    /// Friction and speed limits.
    pub(crate) surface: Surface,
}

/// Place by road and lane.
#[derive(Clone, Debug, PartialEq)]
pub struct OnLane {
    /// Id of the road.
    pub road: String,
    /// Number of the lane, or 0 for a place beside all lanes.
    pub lane: i32,
    /// Station on the reference line.
    pub s_m: f64,
    /// Offset to the left of the reference line.
    pub t_m: f64,
    /// True if its entity drives along the reference line, and not against it.
    pub forward: bool,
}

impl OnLane {
    /// Returns 1, or −1 if the left of its entity is the right of the road.
    pub fn side(&self) -> i32 {
        if self.forward { 1 } else { -1 }
    }

    /// Returns its lane with the direction of its entity.
    pub fn driven(&self) -> DirectedLane {
        DirectedLane {
            lane: self.lane,
            forward: self.forward,
        }
    }
}

/// Roads of a file by their id.
#[derive(Clone, Debug, Default)]
pub struct RoadMap {
    roads: BTreeMap<String, ImportedRoad>,
    /// True for a file that another message refuses.
    is_unread: bool,
    pub(crate) junctions: Junctions,
    controllers: BTreeMap<String, Vec<String>>,
}

impl ImportedRoad {
    /// Returns the height at a station and an offset to the left of the reference line.
    pub fn height_m(&self, s_m: f64, t_m: f64) -> f64 {
        // `t_m` is measured in the plane, so the tangent counts and not the
        // sine.
        let bank_rad = begun(&self.lanes.banks, s_m).at(s_m);
        begun(&self.heights_m, s_m).at(s_m) + libm::tan(bank_rad) * t_m
    }
}

impl RoadMap {
    /// Reads the roads of a file.
    pub fn of(root: &XmlNode) -> Result<RoadMap, ImportError> {
        let mut roads: BTreeMap<String, ImportedRoad> = BTreeMap::new();
        let mut pieces = 0;
        let mut blockers = Blockers::default();
        for node in root.all("road") {
            let id = blockers.keep(node.need("id"));
            let road = blockers.keep(ImportedRoad::of(node));
            let Some((id, road)) = id.zip(road) else {
                continue;
            };
            pieces += road.pieces.len();
            // Counted while reading, so that a hostile file stops before its
            // arcs fill the memory.
            if pieces > MOST_PIECES {
                let what = format!("the roads have more than {MOST_PIECES} lines and arcs so far");
                let help = "cut out the roads that the scenario uses";
                return Err(node.refused(what, help));
            }
            if let Some(first) = roads.get(id) {
                let what = format!(
                    "a second road `{id}`, after that of line {}",
                    first.node.line
                );
                blockers.add(node.refused(what, "give each road an id of its own"));
                continue;
            }
            roads.insert(id.to_owned(), road);
        }
        let junctions = blockers.keep(Junctions::of(root));
        let controllers = blockers.keep(controllers(root));
        // All roads are read first, so that one message names their problems.
        blockers.none()?;
        Ok(RoadMap {
            roads,
            is_unread: false,
            junctions: junctions.unwrap_or_default(),
            controllers: controllers.unwrap_or_default(),
        })
    }

    /// Returns the roads of a file that another message refuses: none.
    pub fn unread() -> RoadMap {
        RoadMap {
            is_unread: true,
            ..RoadMap::default()
        }
    }

    /// Returns whether another message refuses the file.
    pub fn is_unread(&self) -> bool {
        self.is_unread
    }

    /// Returns a road by its id.
    pub fn get(&self, id: &str) -> Option<&ImportedRoad> {
        self.roads.get(id)
    }

    /// Returns whether there is no road at all.
    pub fn is_empty(&self) -> bool {
        self.roads.is_empty()
    }

    /// Returns the signals of a controller.
    pub fn controlled(&self, controller: &str) -> &[String] {
        self.controllers.get(controller).map_or(&[], Vec::as_slice)
    }

    /// Returns all roads with their ids.
    pub fn all(&self) -> impl Iterator<Item = (&String, &ImportedRoad)> {
        self.roads.iter()
    }

    /// Friction of a road. Without a road, the common friction of all roads.
    ///
    /// # Errors
    ///
    /// Returns an error if the roads differ.
    pub fn friction(&self, road: Option<&str>) -> Result<f64, ImportError> {
        self.one_of(road, |surface| surface.friction.clone())
    }

    /// Speed limit of a road. Without a road, the common limit of all roads.
    ///
    /// # Errors
    ///
    /// Returns an error if the roads differ.
    pub fn limit_mps(&self, road: Option<&str>) -> Result<Option<f64>, ImportError> {
        self.one_of(road, |surface| surface.limit_mps.clone())
    }

    /// Returns the least friction of a road, or of all roads.
    pub fn least_friction(&self, road: Option<&str>) -> f64 {
        let roads = self.roads.iter();
        let wanted = roads.filter(|(id, _)| road.is_none_or(|road| road == *id));
        let least = wanted.map(|(_, line)| line.surface.least_friction);
        least.reduce(f64::min).unwrap_or(1.0)
    }

    fn one_of<T: PartialEq>(
        &self,
        road: Option<&str>,
        of: impl Fn(&Surface) -> Result<T, ImportError>,
    ) -> Result<T, ImportError> {
        let is_wanted = |(id, _): &(&String, &ImportedRoad)| road.is_none_or(|road| road == *id);
        let mut roads = self.roads.iter().filter(is_wanted).map(|(_, line)| line);
        let Some(first) = roads.next() else {
            // A file without roads has the default surface.
            return of(&Surface::default());
        };
        let value = of(&first.surface)?;
        for line in roads {
            if of(&line.surface)? != value {
                let what = "its friction or speed limit differs from those of other roads";
                let help = "a world has one of each: make all roads alike";
                return Err(line.node.refused(what, help));
            }
        }
        Ok(value)
    }

    /// Returns the driving lane on which a place is, and the direction of its travel.
    ///
    /// Where lanes overlap, as in junctions, the direction of the place decides if
    /// it has one, and then its distance from the middle.
    pub fn nearest_lane(&self, spot: &Pose, is_turned: bool) -> Option<(OnLane, f64)> {
        let on_lane = |id: &String, road: &ImportedRoad| {
            let (s_m, t_m) = road.nearest(spot)?;
            let (section, lanes) = road.lanes.section(s_m)?;
            let here = lanes
                .lanes
                .iter()
                .filter(|lane| lane.drives)
                .filter_map(|lane| {
                    let (middle_m, slope) = road.lanes.middle(section, s_m, lane.id)?;
                    let off_m = (t_m - middle_m).abs();
                    let is_on = off_m <= 0.5 * road.lanes.width_m(s_m, lane.id)?;
                    let turn_rad = if road.leads_forward(lane.id) { 0.0 } else { PI };
                    let slant_rad = libm::atan2(slope, 1.0 - road.per_m(s_m) * t_m);
                    let road_rad = road.at(s_m, 0.0).heading_rad;
                    let along_rad = road_rad + turn_rad + slant_rad;
                    let faces_rad = road_rad + slant_rad;
                    let turned_rad = wrapped(spot.heading_rad - along_rad).abs();
                    // Directions within 0.01 rad rank alike, so that the distance decides between them.
                    let rank = if is_turned {
                        (turned_rad * 100.0).floor()
                    } else {
                        0.0
                    };
                    let at = OnLane {
                        road: id.clone(),
                        lane: lane.id,
                        s_m,
                        t_m,
                        forward: !is_turned
                            || wrapped(spot.heading_rad - road_rad).abs() < FRAC_PI_2,
                    };
                    is_on.then_some(((rank, off_m), (at, wrapped(faces_rad))))
                });
            here.min_by(|(a, _), (b, _)| a.partial_cmp(b).unwrap_or(Ordering::Equal))
        };
        // Refused roads are left out: their geometry is not that of the file.
        let known = self.roads.iter().filter(|(_, road)| road.refused.is_none());
        let found = known
            .filter_map(|(id, road)| on_lane(id, road))
            .min_by(|(a, _), (b, _)| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        found.map(|(_, at)| at)
    }

    /// Returns a road by its id, if it is supported.
    ///
    /// `asks` is the element that refers to the road.
    pub fn road(&self, asks: &XmlNode, id: &str) -> Result<&ImportedRoad, ImportError> {
        let road = self.roads.get(id).ok_or_else(|| {
            let known = self
                .roads
                .keys()
                .take(10)
                .map(String::as_str)
                .collect::<Vec<_>>()
                .join(", ");
            let help = if known.is_empty() {
                "name a road file with a `road`: this one has none".to_owned()
            } else {
                format!("the roads of the file: {known}")
            };
            let error = asks.refused(format!("there is no road `{id}`"), &help);
            error.following(self.is_unread)
        })?;
        match &road.refused {
            Some(error) => Err(error.clone()),
            None => Ok(road),
        }
    }
}

impl ImportedRoad {
    fn of(road: &XmlNode) -> Result<ImportedRoad, ImportError> {
        let plain = ParameterScope::default();
        // The first problem of a road is kept and reading continues: an unused
        // road must not fail the import.
        let mut refused = None;
        let length_m = plain.number_in(road, "length", 0.0..=MOST_ROAD_M)?;
        let pieces = pieces_of(road.inner("planView")?, &mut refused)?;
        if pieces.is_empty() {
            let help = "give its planView a `geometry`, or leave the road out";
            return Err(road.refused("a road without geometry", help));
        }
        // The declared length serves as the end of the road, so it must agree
        // with the pieces.
        let ends_m = pieces.last().map_or(0.0, |piece| piece.end().s_m);
        if (ends_m - length_m).abs() > MEET_M {
            let what = format!("its length is {length_m:.3} m, that of its geometry {ends_m:.3} m");
            let help = "make both the same";
            refused.get_or_insert_with(|| road.refused(what, help));
        }
        let signals = road.all("signals").map(|it| it.children.len()).sum();
        if let Err(error) = few(road, signals, "signal", MOST_SIGNALS) {
            refused.get_or_insert(error);
        }
        let lanes = road.inner("lanes")?;
        let mut line = ImportedRoad {
            overlaps_itself: false,
            surface: Surface::of(road, lanes.child("laneSection"))?,
            node: road.clone(),
            length_m,
            pieces,
            lanes: RoadLanes::of(road, lanes, length_m, &mut refused)?,
            heights_m: heights_of(road)?,
            links: RoadLink::both(road)?,
            is_left_hand: road.raw("rule") == Some("LHT"),
            refused,
        };
        // After the rest, because it needs the widths and the geometry.
        line.overlaps_itself = line.comes_back();
        Ok(line)
    }

    /// Returns whether its heights change along it.
    pub fn rises(&self) -> bool {
        !self.heights_m.iter().all(Cubic::is_constant)
    }

    /// Returns whether its height steps where an elevation begins.
    pub fn has_steps(&self) -> bool {
        let begins = self.heights_m.windows(2).filter(|pair| {
            let from_m = pair[1].from_m;
            // Of several that begin at one place only the last applies.
            pair[0].from_m < from_m && from_m < self.length_m
        });
        let mut steps_m = begins.map(|pair| {
            let from_m = pair[1].from_m;
            pair[1].at(from_m) - pair[0].at(from_m)
        });
        steps_m.any(|step_m| step_m.abs() > STEP_M)
    }

    /// Returns whether the traffic of a lane follows the reference line.
    pub fn leads_forward(&self, lane: i32) -> bool {
        // Lanes with negative numbers lie on the right.
        (lane < 0) != self.is_left_hand
    }

    /// Returns whether its carriageways overlap: it closes on itself, or crosses itself.
    fn comes_back(&self) -> bool {
        let turns = self.pieces.iter().map(|it| it.bend().turn_rad());
        let side_m = |sign: i32| {
            let lanes = self.lanes.sections.iter().take(1).flat_map(|it| &it.lanes);
            let ids = lanes.map(|lane| lane.id).filter(|id| id * sign > 0);
            ids.filter_map(|id| self.lanes.width_m(0.0, id))
                .sum::<f64>()
        };
        let at = |s_m: f64| self.at(s_m, 0.0);
        let curve = PlaneCurve {
            at: &at,
            length_m: self.length_m,
        };
        self_overlap_m(curve, turns.sum(), side_m(1) + side_m(-1)).is_some()
    }

    /// Returns whether the reference line is straight between two stations.
    pub fn is_straight_between(&self, from_m: f64, to_m: f64) -> bool {
        let (from_m, to_m) = (from_m.min(to_m), from_m.max(to_m));
        let between = |it: &&ReferenceSegment| it.s_m < to_m && from_m < it.s_m + it.length_m;
        let mut pieces = self.pieces.iter().filter(between);
        pieces.all(|it| it.per_m == 0.0)
    }

    /// Nearest station to a place and the distance to its left, if it is beside the road.
    fn nearest(&self, spot: &Pose) -> Option<(f64, f64)> {
        let beside = self.pieces.iter().filter_map(|piece| {
            let (along_m, left_m) = piece.sees(spot);
            // The tolerance keeps a place on a joint, which rounding may set
            // between both pieces.
            let is_beside = (-MEET_M..=piece.length_m + MEET_M).contains(&along_m);
            is_beside.then_some((piece.s_m + along_m, left_m))
        });
        beside.min_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))
    }

    /// Place at a station, `t_m` to the left of the reference line.
    pub fn at(&self, s_m: f64, t_m: f64) -> Pose {
        // A station on a joint belongs to the later piece.
        let piece = self.piece(s_m);
        let on = piece.start.bent(s_m - piece.s_m, piece.per_m);
        on.moved(0.0, t_m)
    }

    /// Length of the parallel to the reference line between two stations, in metres.
    pub fn way_m(&self, from_m: f64, to_m: f64, t_m: f64) -> f64 {
        let parts = self.pieces.iter().map(|piece| {
            let ends_m = piece.s_m + piece.length_m;
            let part_m = to_m.min(ends_m) - from_m.max(piece.s_m);
            // On the inside of a bend a parallel is shorter, by the factor 1 −
            // κ·t.
            part_m.max(0.0) * (1.0 - piece.per_m * t_m)
        });
        parts.sum()
    }

    /// Lateral position of the middle of a lane, from the reference line in metres.
    ///
    /// # Errors
    ///
    /// Returns an error for an unknown lane, and for one that moves along the road.
    pub fn middle_m(&self, asks: &XmlNode, lane: i32) -> Result<f64, ImportError> {
        self.middle_at(asks, 0.0, lane)?;
        match self.lanes.fixed_m(lane) {
            Some(fixed_m) => Ok(fixed_m),
            None => {
                let road = self.node.raw("id").unwrap_or_default();
                let what = format!("lane {lane} of road `{road}` changes its place along it");
                Err(asks.refused(what, "keep its widths, its offset and its sections alike"))
            }
        }
    }

    /// Lateral position of the middle of a lane at a station, and its slope.
    ///
    /// # Errors
    ///
    /// Returns an error for a lane that is not there.
    pub fn middle_at(
        &self,
        asks: &XmlNode,
        s_m: f64,
        lane: i32,
    ) -> Result<(f64, f64), ImportError> {
        let section = self.lanes.section(s_m).map_or(0, |(section, _)| section);
        self.lanes.middle(section, s_m, lane).ok_or_else(|| {
            let road = self.node.raw("id").unwrap_or_default();
            let section = self.lanes.section(s_m);
            let lanes: Vec<String> = section
                .into_iter()
                .flat_map(|(_, it)| &it.lanes)
                .map(|it| it.id.to_string())
                .collect();
            let help = format!("its lanes there: {}", lanes.join(", "));
            asks.refused(format!("the road `{road}` has no lane {lane}"), &help)
        })
    }

    /// Driving lanes on the side of a lane with their widths, the outermost first.
    pub fn driven_beside(&self, lane: i32, s_m: f64) -> Vec<(i32, f64)> {
        let section = self.lanes.section(s_m);
        let mut side: Vec<(i32, f64)> = section
            .into_iter()
            .flat_map(|(_, it)| &it.lanes)
            .filter(|it| it.drives && it.id * lane > 0)
            .filter_map(|it| Some((it.id, self.lanes.width_m(s_m, it.id)?)))
            .collect();
        // The outermost lane comes first, as lane 0 of a world does.
        side.sort_by_key(|(id, _)| -id.abs());
        side
    }

    /// Curvature of the reference line at a station.
    pub fn per_m(&self, s_m: f64) -> f64 {
        self.piece(s_m).per_m
    }

    /// Piece that has begun last at a station.
    fn piece(&self, s_m: f64) -> &ReferenceSegment {
        // Pieces that are out of order are refused, so any of them will do.
        let begun = self.pieces.partition_point(|it| it.s_m <= s_m);
        // Before the first station the first piece counts.
        &self.pieces[begun.saturating_sub(1)]
    }

    /// Returns true for a single straight piece.
    pub fn is_straight(&self) -> bool {
        self.pieces.len() == 1 && self.pieces[0].per_m == 0.0
    }
}
