//! Roads as OpenDRIVE, each as long as the episode needs it.
//!
//! The reference line is the course of lane 0, which is the world frame of the
//! trace on a straight road. So t is `lateral`, and s is `s` plus a constant.
//! OpenDRIVE numbers lanes from the reference line to the right, so the lane
//! offset moves the line to the left edge. brakecheck's lane k of n is lane −(n
//! − k). Crossing roads have no junction, because no agent changes from road to
//! road.

use super::elevation::Elevation;
use super::lights;
use super::origin::{AUTHOR, DATE};
use super::stretch::Stretch;
use crate::ego::RoadPiece;
use crate::road::{Course, Road};
use crate::scene::drive::DriveWorld;
use crate::xml::XmlElement;

/// Returns the complete OpenDRIVE document of a world.
pub(super) fn document(
    name: &str,
    world: &DriveWorld,
    stretch: impl Fn(usize) -> Stretch,
) -> XmlElement {
    let spec = world.spec();
    let header = XmlElement::new("header")
        .text("revMajor", "1")
        .text("revMinor", "7")
        .text("name", name)
        .text("version", "1.00")
        .text("date", DATE)
        .text("vendor", AUTHOR);
    // The order is that of `courses`: the world's own road first, then the
    // named ones.
    let own = std::iter::once((&spec.world, &spec.road));
    let named = spec.roads.iter().map(|(name, placed)| (name, &placed.road));
    let elevation = Elevation::of(world);
    let roads = own.chain(named).zip(world.courses()).enumerate().map(
        |(number, ((name, road), course))| {
            let profile = elevation.map(|it| it.profile(number, stretch(number)));
            let laid = element(number, name, road, course, profile, stretch(number));
            if spec.lights_of(number).next().is_some() {
                laid.child(lights::signals(spec, number, stretch(number)))
            } else {
                laid
            }
        },
    );
    XmlElement::new("OpenDRIVE").child(header).children(roads)
}

/// Element of one road. The world's own road has number 0.
fn element(
    number: usize,
    name: &str,
    lanes_of: &Road,
    course: &Course,
    profile: Option<XmlElement>,
    stretch: Stretch,
) -> XmlElement {
    let mut road = XmlElement::new("road")
        .text("name", name)
        .number("length", stretch.to_s_m - stretch.from_s_m)
        .text("id", (number + 1).to_string())
        .text("junction", "-1")
        // Right-hand traffic fits lanes that count to the right, and is the default of
        // the standard.
        .text("rule", "RHT");
    if let Some(limit_mps) = lanes_of.speed_limit_mps() {
        road = road.child(speed_limit(limit_mps));
    }
    road.child(plan_view(course, stretch))
        .children(profile)
        .child(lanes(lanes_of))
}

fn speed_limit(limit_mps: f64) -> XmlElement {
    let speed = XmlElement::new("speed")
        .number("max", limit_mps)
        .text("unit", "m/s");
    let kind = XmlElement::new("type")
        .number("s", 0.0)
        // A speed limit belongs to a road type in OpenDRIVE, and worlds know no type.
        .text("type", "unknown");
    kind.child(speed)
}

/// Reference line of a road, with one geometry per piece.
fn plan_view(course: &Course, stretch: Stretch) -> XmlElement {
    let geometries = geometries(course, stretch).into_iter().map(|piece| {
        // Every geometry states its own start, computed from the course, so
        // errors do not add up along the road.
        let begin = course.pose(piece.from_s_m, 0.0);
        let shape = if piece.curvature_per_m == 0.0 {
            XmlElement::new("line")
        } else {
            XmlElement::new("arc").number("curvature", piece.curvature_per_m)
        };
        XmlElement::new("geometry")
            .number("s", stretch.s_m(piece.from_s_m))
            .number("x", begin.x_m)
            .number("y", begin.y_m)
            .number("hdg", begin.heading_rad)
            .number("length", piece.length_m)
            .child(shape)
    });
    XmlElement::new("planView").children(geometries)
}

/// Pieces of the course between straight ends.
///
/// Neighbours of equal curvature are merged, because tangents agree at every
/// joint.
fn geometries(course: &Course, stretch: Stretch) -> Vec<RoadPiece> {
    let line = |from_s_m: f64, to_s_m: f64| RoadPiece {
        from_s_m,
        length_m: to_s_m - from_s_m,
        curvature_per_m: 0.0,
    };
    let pieces = course.pieces();
    let end_m = |piece: &RoadPiece| piece.from_s_m + piece.length_m;
    // Without pieces the road is a single line, and the second end has no
    // length.
    let begin_s_m = pieces
        .first()
        .map_or(stretch.to_s_m, |first| first.from_s_m);
    let end_s_m = pieces.last().map_or(stretch.to_s_m, end_m);
    let mut all = vec![line(stretch.from_s_m, begin_s_m)];
    all.extend(pieces);
    all.push(line(end_s_m, stretch.to_s_m));
    // The standard refuses a geometry without length.
    all.retain(|piece| piece.length_m > 0.0);
    let mut merged: Vec<RoadPiece> = Vec::with_capacity(all.len());
    for piece in all {
        match merged.last_mut() {
            // Curvatures are copied from the same pieces, so equality is exact.
            Some(last) if last.curvature_per_m == piece.curvature_per_m => {
                last.length_m = end_m(&piece) - last.from_s_m;
            }
            _ => merged.push(piece),
        }
    }
    merged
}

fn lanes(road: &Road) -> XmlElement {
    let (count, width_m) = (road.lanes(), road.lane_width_m());
    // The reference line is the middle of lane 0, the rightmost lane. The left
    // edge of all lanes is half a lane less than their number away.
    let offset = polynomial(XmlElement::new("laneOffset").number("s", 0.0), {
        (count as f64 - 0.5) * width_m
    });
    let centre = lane(0, "none").child(road_mark("solid"));
    let right = (1..=count).map(|number| {
        // Lanes may be changed, and the road may not be left.
        let border = if number == count { "solid" } else { "broken" };
        let width = polynomial(XmlElement::new("width").number("sOffset", 0.0), width_m);
        let lane = lane(-(number as i64), "driving");
        lane.child(width).child(road_mark(border))
    });
    let section = XmlElement::new("laneSection")
        .number("s", 0.0)
        .child(XmlElement::new("center").child(centre))
        .child(XmlElement::new("right").children(right));
    XmlElement::new("lanes").child(offset).child(section)
}

fn lane(id: i64, kind: &str) -> XmlElement {
    let lane = XmlElement::new("lane").text("id", id.to_string());
    lane.text("type", kind).text("level", "false")
}

/// Constant cubic polynomial: `a` is the value, `b`, `c` and `d` are 0.
fn polynomial(element: XmlElement, value: f64) -> XmlElement {
    // The schema requires all four coefficients.
    let constant = element.number("a", value);
    ["b", "c", "d"]
        .into_iter()
        .fold(constant, |element, name| element.number(name, 0.0))
}

fn road_mark(kind: &str) -> XmlElement {
    XmlElement::new("roadMark")
        .number("sOffset", 0.0)
        .text("type", kind)
        .text("weight", "standard")
        .text("color", "standard")
        .number("width", 0.12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Piece;

    fn laid(pieces: Vec<Piece>) -> Vec<(f64, f64, f64)> {
        let road = Road::Curved {
            lanes: 1,
            lane_width_m: 3.5,
            friction: 0.9,
            speed_limit_mps: None,
            pieces,
        };
        let stretch = Stretch {
            from_s_m: -50.0,
            to_s_m: 300.0,
        };
        let course = road.course().expect("a course");
        let laid = geometries(&course, stretch)
            .into_iter()
            .map(|it| (it.from_s_m, it.length_m, it.curvature_per_m));
        laid.collect()
    }

    #[test]
    fn lines_that_touch_are_one() {
        let (line, arc) = (
            Piece::Line { length_m: 40.0 },
            Piece::Arc {
                length_m: 20.0,
                radius_m: 50.0,
            },
        );
        assert_eq!(
            laid(vec![line, line, arc, arc, line]),
            [(-50.0, 130.0, 0.0), (80.0, 40.0, 0.02), (120.0, 180.0, 0.0)]
        );
        assert_eq!(laid(vec![line]), [(-50.0, 350.0, 0.0)]);
    }
}
