//! Roads from OpenDRIVE: lines, arcs and spirals, with lanes of one width.

use std::collections::BTreeMap;

use super::error::ImportError;
use super::scope::Scope;
use super::spot::Spot;
use super::tree::Node;
use super::ways::{Bend, Spiral};

/// Lanes so far beside the reference line are near their spirals, too.
const LANES_M: f64 = 12.0;

/// A piece of a reference line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    pub s_m: f64,
    start: Spot,
    pub length_m: f64,
    pub per_m: f64,
}

/// A road: its reference line, and its lanes from the middle outwards.
#[derive(Clone, Debug)]
pub(super) struct Line {
    node: Node,
    pub length_m: f64,
    pub pieces: Vec<Stretch>,
    /// What cannot be said of it, found when somebody is on it.
    refused: Option<ImportError>,
    offset_m: f64,
    /// Number, width, and whether one drives there.
    lanes: Vec<(i32, f64, bool)>,
}

/// All roads of a file, by their id.
#[derive(Clone, Debug)]
pub(super) struct RoadMap(BTreeMap<String, Line>);

impl RoadMap {
    pub fn of(root: &Node) -> Result<RoadMap, ImportError> {
        let roads = root.all("road").map(|road| {
            let id = road.need("id")?.to_owned();
            Ok((id, Line::of(road)?))
        });
        Ok(RoadMap(roads.collect::<Result<_, ImportError>>()?))
    }

    /// A road by its id.
    pub fn get(&self, id: &str) -> Option<&Line> {
        self.0.get(id)
    }

    /// A road by its id, fit to be driven on; `asks` is who names it.
    pub fn road(&self, asks: &Node, id: &str) -> Result<&Line, ImportError> {
        let road = self.0.get(id);
        let road = road.ok_or_else(|| asks.error(format!("there is no road `{id}`")))?;
        match &road.refused {
            Some(error) => Err(error.clone()),
            None => Ok(road),
        }
    }
}

impl Line {
    fn of(road: &Node) -> Result<Line, ImportError> {
        let plain = Scope::default();
        let mut refused = None;
        let mut pieces = Vec::new();
        for geometry in road.inner("planView")?.all("geometry") {
            let shape = geometry.only()?;
            let length_m = plain.number(geometry, "length")?;
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
                    bend(0.0)
                }
            };
            let mut s_m = plain.number(geometry, "s")?;
            let mut start = Spot {
                x_m: plain.number(geometry, "x")?,
                y_m: plain.number(geometry, "y")?,
                heading_rad: plain.number(geometry, "hdg")?,
            };
            for Bend { length_m, per_m } in bends {
                pieces.push(Stretch {
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
        let lanes = road.inner("lanes")?;
        let mut offset_m = 0.0;
        for offset in lanes.all("laneOffset") {
            offset_m = plain.number_or_zero(offset, "a")?;
            refuse_changes(offset, &mut refused)?;
        }
        let mut sections = lanes.all("laneSection");
        let first = sections.next();
        if let Some(second) = sections.next() {
            let what = "a road whose lanes change along it is not read";
            refused.get_or_insert_with(|| second.error(what));
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
            if let Some(second) = widths.next() {
                let what = "a lane that changes its width is not read";
                refused.get_or_insert_with(|| second.error(what));
            }
            all.push((id, width_m, lane.raw("type") == Some("driving")));
        }
        Ok(Line {
            node: road.clone(),
            length_m: plain.number(road, "length")?,
            pieces,
            refused,
            offset_m,
            lanes: all,
        })
    }

    /// The place at a station, so far to the left of the reference line.
    pub fn at(&self, s_m: f64, t_m: f64) -> Spot {
        let before = self.pieces.iter().rev().find(|it| it.s_m <= s_m);
        let piece = before.unwrap_or(&self.pieces[0]);
        let on = piece.start.bent(s_m - piece.s_m, piece.per_m);
        on.moved(0.0, t_m)
    }

    /// Where the middle of a lane is, from the reference line.
    pub fn middle_m(&self, asks: &Node, lane: i32) -> Result<f64, ImportError> {
        let width_of = |id: i32| {
            let found = self.lanes.iter().find(|(known, ..)| *known == id);
            found.map(|(_, width_m, _)| *width_m).ok_or_else(|| {
                let road = self.node.raw("id").unwrap_or_default();
                asks.error(format!("the road `{road}` has no lane {id}"))
            })
        };
        let mut edge_m = 0.0;
        for id in 1..lane.abs() {
            edge_m += width_of(id * lane.signum())?;
        }
        let middle_m = edge_m + 0.5 * width_of(lane)?;
        Ok(self.offset_m + middle_m * f64::from(lane.signum()))
    }

    /// The lanes on which one drives on the side of another one, the outermost
    /// first, if they lie beside each other and are of one width.
    pub fn driven_beside(&self, lane: i32) -> Vec<(i32, f64)> {
        let side = self.lanes.iter();
        let side = side.filter(|(id, _, drives)| *drives && *id * lane > 0);
        let mut side: Vec<(i32, f64)> = side.map(|(id, width_m, _)| (*id, *width_m)).collect();
        side.sort_by_key(|(id, _)| -id.abs());
        side
    }

    /// Whether it goes straight on.
    pub fn is_straight(&self) -> bool {
        self.pieces.len() == 1 && self.pieces[0].per_m == 0.0
    }
}

fn refuse_changes(width: &Node, refused: &mut Option<ImportError>) -> Result<(), ImportError> {
    for term in ["b", "c", "d"] {
        if Scope::default().number_or_zero(width, term)? != 0.0 {
            refused.get_or_insert_with(|| width.error("a width that changes is not read"));
        }
    }
    Ok(())
}
