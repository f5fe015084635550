//! Roads from OpenDRIVE: lines, arcs and spirals, with lanes of constant width.
//!
//! Unsupported content of a road is an error only if an entity is on the road.

use std::collections::{BTreeMap, HashMap};

use super::error::ImportError;
use super::scope::ParameterScope;
use super::surface::Surface;
use super::tree::XmlNode;
use super::ways::{Bend, Spiral};
use crate::sim::{Pose, wrapped};

/// Lateral distance in metres up to which lanes stay near their spirals.
const LANES_M: f64 = 12.0;
/// Tolerances within which consecutive pieces of a reference line connect.
const MEET_M: f64 = 0.01;
const MEET_RAD: f64 = 1e-3;
/// A carriageway without lanes is about as wide as a car.
const LEAST_WIDTH_M: f64 = 2.0;
/// Places of a road that are looked at for whether it meets itself.
const MOST_SAMPLES: f64 = 20_000.0;

/// Piece of a reference line.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferenceSegment {
    pub s_m: f64,
    start: Pose,
    pub length_m: f64,
    pub per_m: f64,
}

/// Road: reference line and lanes.
#[derive(Clone, Debug)]
pub(super) struct ImportedRoad {
    node: XmlNode,
    pub length_m: f64,
    pub pieces: Vec<ReferenceSegment>,
    /// First unsupported content, returned when an entity is on the road.
    refused: Option<ImportError>,
    offset_m: f64,
    /// Number, width in metres, and true for a driving lane.
    lanes: Vec<(i32, f64, bool)>,
    /// Friction and speed limits.
    pub surface: Surface,
}

/// Roads of a file by their id.
#[derive(Clone, Debug)]
pub(super) struct RoadMap(BTreeMap<String, ImportedRoad>);

impl RoadMap {
    pub(super) fn of(root: &XmlNode) -> Result<RoadMap, ImportError> {
        let roads = root.all("road").map(|road| {
            let id = road.need("id")?.to_owned();
            Ok((id, ImportedRoad::of(road)?))
        });
        Ok(RoadMap(roads.collect::<Result<_, ImportError>>()?))
    }

    /// Returns a road by its id.
    pub(super) fn get(&self, id: &str) -> Option<&ImportedRoad> {
        self.0.get(id)
    }

    /// Returns all roads.
    pub(super) fn all(&self) -> impl Iterator<Item = &ImportedRoad> {
        self.0.values()
    }

    /// Friction of a road. Without a road, the common friction of all roads.
    ///
    /// # Errors
    ///
    /// Returns an error if the roads differ.
    pub(super) fn friction(&self, road: Option<&str>) -> Result<f64, ImportError> {
        self.one_of(road, |surface| surface.friction.clone())
    }

    /// Speed limit of a road. Without a road, the common limit of all roads.
    ///
    /// # Errors
    ///
    /// Returns an error if the roads differ.
    pub(super) fn limit_mps(&self, road: Option<&str>) -> Result<Option<f64>, ImportError> {
        self.one_of(road, |surface| surface.limit_mps.clone())
    }

    fn one_of<T: PartialEq>(
        &self,
        road: Option<&str>,
        of: impl Fn(&Surface) -> Result<T, ImportError>,
    ) -> Result<T, ImportError> {
        let is_wanted = |(id, _): &(&String, &ImportedRoad)| road.is_none_or(|road| road == *id);
        let mut roads = self.0.iter().filter(is_wanted).map(|(_, line)| line);
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

    /// Returns a road by its id, if it is supported.
    ///
    /// `asks` is the element that refers to the road.
    pub(super) fn road(&self, asks: &XmlNode, id: &str) -> Result<&ImportedRoad, ImportError> {
        let road = self.0.get(id);
        let road = road.ok_or_else(|| asks.error(format!("there is no road `{id}`")))?;
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
        if road.raw("rule") == Some("LHT") {
            let help = "mirror the road and the scenario: worlds have right-hand traffic";
            refused = Some(road.refused("left-hand traffic is not read", help));
        }
        let length_m = plain.number(road, "length")?;
        let mut pieces: Vec<ReferenceSegment> = Vec::new();
        for geometry in road.inner("planView")?.all("geometry") {
            let shape = geometry.only()?;
            let length_m = plain.number(geometry, "length")?;
            let before = pieces.last().map(ReferenceSegment::end);
            let bend = |per_m| vec![Bend { length_m, per_m }];
            let bends = match shape.name.as_str() {
                "line" => bend(0.0),
                "arc" => bend(plain.number(shape, "curvature")?),
                "spiral" => {
                    let spiral = Spiral {
                        length_m,
                        from_per_m: plain.number(shape, "curvStart")?,
                        to_per_m: plain.number(shape, "curvEnd")?,
                    };
                    spiral.arcs(LANES_M)
                }
                other => {
                    let what =
                        format!("a road with a `{other}`: only lines, arcs and spirals are read");
                    refused.get_or_insert_with(|| shape.error(what));
                    // The shape is replaced by a line. No entity can be on it.
                    bend(0.0)
                }
            };
            let mut s_m = plain.number(geometry, "s")?;
            let mut start = Pose {
                x_m: plain.number(geometry, "x")?,
                y_m: plain.number(geometry, "y")?,
                heading_rad: plain.number(geometry, "hdg")?,
            };
            // After an unsupported piece, the start of the next piece cannot be
            // checked.
            if refused.is_none() {
                refused = joins(geometry, before, (s_m, start)).err();
            }
            for Bend { length_m, per_m } in bends {
                pieces.push(ReferenceSegment {
                    s_m,
                    start,
                    length_m,
                    per_m,
                });
                s_m += length_m;
                start = start.bent(length_m, per_m);
            }
        }
        if pieces.is_empty() {
            return Err(road.error("a road without geometry"));
        }
        // The declared length serves as the end of the road, so it must agree
        // with the pieces.
        let ends_m = pieces.last().map_or(0.0, |piece| piece.end().0);
        if MEET_M < (ends_m - length_m).abs() {
            let what = format!("its length is {length_m} m, that of its geometry {ends_m} m");
            let help = "make both the same";
            refused.get_or_insert_with(|| road.refused(what, help));
        }
        let lanes = road.inner("lanes")?;
        let offset_m = lane_offset_m(lanes, &mut refused)?;
        let mut sections = lanes.all("laneSection");
        let first = sections.next();
        if let Some(second) = sections.next() {
            let what = "a road whose lanes change along it is not read";
            let help = "keep one laneSection: cut the road where its lanes change";
            refused.get_or_insert_with(|| second.refused(what, help));
        }
        let mut all = Vec::new();
        let sides = first.into_iter().flat_map(|it| &it.children);
        for lane in sides.flat_map(|side| side.all("lane")) {
            let id = plain.number(lane, "id")? as i32;
            let mut widths = lane.all("width");
            let mut width_m = 0.0;
            if let Some(width) = widths.next() {
                width_m = plain.number(width, "a")?;
                refuse_changes(width, &mut refused)?;
            }
            if let Some(second) = widths.next().or_else(|| lane.child("border")) {
                let what = "a lane that changes its width is not read";
                let help = "give the lane one `width` with b, c and d of 0";
                refused.get_or_insert_with(|| second.refused(what, help));
            }
            all.push((id, width_m, lane.raw("type") == Some("driving")));
        }
        let mut line = ImportedRoad {
            surface: Surface::of(road, first)?,
            node: road.clone(),
            length_m,
            pieces,
            refused,
            offset_m,
            lanes: all,
        };
        if line.refused.is_none()
            && let Some((s_m, again_m)) = line.crosses_itself()
        {
            let what = format!("it is at s = {again_m:.0} m where it was at s = {s_m:.0} m");
            let help = "cut it into roads that do not overlap: a place has one station on a road";
            line.refused = Some(road.refused(what, help));
        }
        Ok(line)
    }

    /// Two stations whose carriageways overlap, if there are any: the road closes
    /// on itself, or crosses itself.
    fn crosses_itself(&self) -> Option<(f64, f64)> {
        let turns = self.pieces.iter().map(|it| (it.per_m * it.length_m).abs());
        // Nothing comes back that has not turned round.
        if turns.sum::<f64>() <= core::f64::consts::PI {
            return None;
        }
        let side_m = |sign: i32| {
            let lanes = self.lanes.iter().filter(|(id, ..)| *id * sign > 0);
            lanes.map(|(_, width_m, _)| width_m).sum::<f64>()
        };
        let near_m = (side_m(1) + side_m(-1)).max(LEAST_WIDTH_M);
        let apart_m = (self.length_m / MOST_SAMPLES).max(0.25 * near_m);
        let cell = |at_m: f64| (at_m / near_m).floor() as i64;
        let mut seen: HashMap<(i64, i64), Vec<(f64, Pose)>> = HashMap::new();
        let samples = (self.length_m / apart_m).min(MOST_SAMPLES) as usize;
        for s_m in (0..=samples).map(|nth| nth as f64 * apart_m) {
            let here = self.at(s_m, 0.0);
            let (column, row) = (cell(here.x_m), cell(here.y_m));
            let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy)));
            for (dx, dy) in around {
                let there = seen.get(&(column + dx, row + dy)).into_iter().flatten();
                // A bend is near itself for a while: half a turn at its tightest.
                let mut others = there.filter(|(other_m, _)| other_m + 4.0 * near_m < s_m);
                let touches = |spot: &Pose| {
                    libm::hypot(spot.x_m - here.x_m, spot.y_m - here.y_m) < 0.9 * near_m
                };
                if let Some((other_m, _)) = others.find(|(_, spot)| touches(spot)) {
                    return Some((*other_m, s_m));
                }
            }
            seen.entry((column, row)).or_default().push((s_m, here));
        }
        None
    }

    /// Returns whether the reference line is straight between two stations.
    pub(super) fn is_straight_between(&self, from_m: f64, to_m: f64) -> bool {
        let (from_m, to_m) = (from_m.min(to_m), from_m.max(to_m));
        let between = |it: &&ReferenceSegment| it.s_m < to_m && from_m < it.s_m + it.length_m;
        let mut pieces = self.pieces.iter().filter(between);
        pieces.all(|it| it.per_m == 0.0)
    }

    /// Place at a station, `t_m` to the left of the reference line.
    pub(super) fn at(&self, s_m: f64, t_m: f64) -> Pose {
        // A station on a joint belongs to the later piece.
        let before = self.pieces.iter().rev().find(|it| it.s_m <= s_m);
        let piece = before.unwrap_or(&self.pieces[0]);
        let on = piece.start.bent(s_m - piece.s_m, piece.per_m);
        on.moved(0.0, t_m)
    }

    /// Length of the parallel to the reference line between two stations, in metres.
    pub(super) fn way_m(&self, from_m: f64, to_m: f64, t_m: f64) -> f64 {
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
    /// Returns an error for an unknown lane.
    pub(super) fn middle_m(&self, asks: &XmlNode, lane: i32) -> Result<f64, ImportError> {
        let width_of = |id: i32| {
            let found = self.lanes.iter().find(|(known, ..)| *known == id);
            found.map(|(_, width_m, _)| *width_m).ok_or_else(|| {
                let road = self.node.raw("id").unwrap_or_default();
                asks.error(format!("the road `{road}` has no lane {id}"))
            })
        };
        // All lanes between the reference line and the lane add up, driven or
        // not.
        let mut edge_m = 0.0;
        for id in 1..lane.abs() {
            edge_m += width_of(id * lane.signum())?;
        }
        let middle_m = edge_m + 0.5 * width_of(lane)?;
        Ok(self.offset_m + middle_m * f64::from(lane.signum()))
    }

    /// Driving lanes on the side of a lane with their widths, the outermost first.
    pub(super) fn driven_beside(&self, lane: i32) -> Vec<(i32, f64)> {
        let side = self.lanes.iter();
        let side = side.filter(|(id, _, drives)| *drives && *id * lane > 0);
        let mut side: Vec<(i32, f64)> = side.map(|(id, width_m, _)| (*id, *width_m)).collect();
        side.sort_by_key(|(id, _)| -id.abs());
        side
    }

    /// Returns true for a single straight piece.
    pub(super) fn is_straight(&self) -> bool {
        self.pieces.len() == 1 && self.pieces[0].per_m == 0.0
    }
}

impl ReferenceSegment {
    /// Station and place of its end.
    fn end(&self) -> (f64, Pose) {
        let end = self.start.bent(self.length_m, self.per_m);
        (self.s_m + self.length_m, end)
    }
}

/// Refuses a piece that does not start at the end of the previous piece.
fn joins(
    geometry: &XmlNode,
    before: Option<(f64, Pose)>,
    (s_m, start): (f64, Pose),
) -> Result<(), ImportError> {
    let (ends_m, end) = before.unwrap_or((0.0, start));
    let off_m = libm::hypot(start.x_m - end.x_m, start.y_m - end.y_m);
    let turned_rad = wrapped(start.heading_rad - end.heading_rad).abs();
    let fits = (s_m - ends_m).abs() <= MEET_M && off_m <= MEET_M && turned_rad <= MEET_RAD;
    if fits {
        Ok(())
    } else {
        let what = format!(
            "it begins {off_m:.3} m and {turned_rad:.4} rad off the end of the piece before \
                 it, at s = {s_m} m instead of {ends_m} m"
        );
        let help = "make the pieces of the planView meet";
        Err(geometry.refused(what, help))
    }
}

/// Lateral offset of all lanes in metres.
fn lane_offset_m(lanes: &XmlNode, refused: &mut Option<ImportError>) -> Result<f64, ImportError> {
    let plain = ParameterScope::default();
    let mut offset_m = 0.0;
    for (i, offset) in lanes.all("laneOffset").enumerate() {
        let before_m = offset_m;
        offset_m = plain.number_or_zero(offset, "a")?;
        let begins_m = plain.number(offset, "s")?;
        // A repeated offset changes nothing and is accepted.
        if offset_m != before_m && (0 < i || begins_m != 0.0) {
            let what = "lanes whose offset changes along the road are not read";
            let help = "keep one laneOffset from s = 0 on: cut the road where it changes";
            refused.get_or_insert_with(|| offset.refused(what, help));
        }
        refuse_changes(offset, refused)?;
    }
    Ok(offset_m)
}

fn refuse_changes(width: &XmlNode, refused: &mut Option<ImportError>) -> Result<(), ImportError> {
    let plain = ParameterScope::default();
    for term in ["b", "c", "d"] {
        if plain.number_or_zero(width, term)? != 0.0 {
            let help = "only a may differ from 0";
            let what = "a width that changes is not read";
            refused.get_or_insert_with(|| width.refused(what, help));
        }
    }
    if width.raw("sOffset").is_some() && plain.number(width, "sOffset")? != 0.0 {
        let what = "a width that begins on the way is not read";
        refused.get_or_insert_with(|| width.refused(what, "begin it at sOffset=\"0\""));
    }
    Ok(())
}
