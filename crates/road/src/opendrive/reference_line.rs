//! Reference lines of roads: lines, arcs, spirals and polynomials, as arcs.

use super::curve::{Cubic, CubicPair, CurveArc, ParametricCurve, PlaneCurve, arcs_of};
use super::error::ImportError;
use super::scope::ParameterScope;
use super::tree::XmlNode;
use super::ways::{Spiral, WINDS};
use crate::pose::{Pose, wrapped};
use crate::road::Bend;

/// Lateral distance in metres up to which lanes stay near their curves.
const LANES_M: f64 = 12.0;
/// Tolerances within which consecutive pieces of a reference line connect.
pub(crate) const MEET_M: f64 = 0.01;
const MEET_RAD: f64 = 1e-3;
/// Greatest length of a road, and greatest distance of its places from the origin.
pub(crate) const MOST_ROAD_M: f64 = 100_000.0;
const MOST_PLACE_M: f64 = 1e8;
/// Greatest heading in radians and curvature in 1/m.
const MOST_HEADING_RAD: f64 = 1e4;
const MOST_PER_M: f64 = 1e3;

/// Piece of a reference line.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceSegment {
    pub s_m: f64,
    pub start: Pose,
    pub length_m: f64,
    pub per_m: f64,
}

/// Place on a reference line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReferencePlace {
    pub(super) s_m: f64,
    pose: Pose,
}

impl ReferenceSegment {
    pub(super) fn bend(&self) -> Bend {
        Bend {
            length_m: self.length_m,
            per_m: self.per_m,
        }
    }

    /// Distance along the piece that is nearest to a place, and the distance to its
    /// left.
    pub fn sees(&self, spot: &Pose) -> (f64, f64) {
        let seen = self.start.sees(spot);
        if self.per_m == 0.0 {
            return (seen.x_m, seen.y_m);
        }
        // From the centre of the circle, scaled by the curvature.
        let (across, towards) = (self.per_m * seen.x_m, 1.0 - self.per_m * seen.y_m);
        let along_m = libm::atan2(across, towards) / self.per_m;
        (along_m, (1.0 - libm::hypot(across, towards)) / self.per_m)
    }

    /// Station and place of its end.
    pub(crate) fn end(&self) -> ReferencePlace {
        ReferencePlace {
            s_m: self.s_m + self.length_m,
            pose: self.start.bent(self.length_m, self.per_m),
        }
    }
}

/// Reads the pieces of a planView. The first problem is kept in `refused`.
pub(crate) fn pieces_of(
    plan_view: &XmlNode,
    refused: &mut Option<ImportError>,
) -> Result<Vec<ReferenceSegment>, ImportError> {
    let plain = ParameterScope::default();
    let mut pieces: Vec<ReferenceSegment> = Vec::new();
    for geometry in plan_view.all("geometry") {
        let shape = geometry.only()?;
        let length_m = plain.number_in(geometry, "length", 0.0..=MOST_ROAD_M)?;
        let before = pieces.last().map(ReferenceSegment::end);
        // Files round, so the first station may lie just below 0.
        let s_m = plain.number_in(geometry, "s", -MEET_M..=MOST_ROAD_M)?;
        let place = |name: &str, most: f64| plain.number_in(geometry, name, -most..=most);
        let start = Pose {
            x_m: place("x", MOST_PLACE_M)?,
            y_m: place("y", MOST_PLACE_M)?,
            heading_rad: place("hdg", MOST_HEADING_RAD)?,
        };
        let from = ReferencePlace { s_m, pose: start };
        let curvature = |name: &str| plain.number_in(shape, name, -MOST_PER_M..=MOST_PER_M);
        let winds = |what: String| shape.refused(what, WINDS);
        let bend = |per_m| chained(from, vec![Bend { length_m, per_m }]);
        let added = match shape.name.as_str() {
            "line" => bend(0.0),
            "arc" => {
                let per_m = curvature("curvature")?;
                let arc = Spiral {
                    length_m,
                    from_per_m: per_m,
                    to_per_m: per_m,
                };
                chained(from, arc.arcs(LANES_M).map_err(winds)?)
            }
            "spiral" => {
                let spiral = Spiral {
                    length_m,
                    from_per_m: curvature("curvStart")?,
                    to_per_m: curvature("curvEnd")?,
                };
                chained(from, spiral.arcs(LANES_M).map_err(winds)?)
            }
            // A piece without a length has no curve.
            "paramPoly3" | "poly3" if length_m == 0.0 => bend(0.0),
            "paramPoly3" | "poly3" => {
                let curve = polynomial(shape, start, length_m)?;
                let at = |s_m: f64| curve.at(s_m);
                let arcs = arcs_of(PlaneCurve { at: &at, length_m }, LANES_M).map_err(winds)?;
                arcs.into_iter().map(|arc| segment(s_m, arc)).collect()
            }
            other => {
                let what = format!("a road with a `{other}` is not read");
                let help = "write a line, an arc, a spiral or a paramPoly3";
                refused.get_or_insert_with(|| shape.refused(what, help));
                // The shape is replaced by a line. No entity can be on it.
                bend(0.0)
            }
        };
        // After an unsupported piece, the start of the next piece cannot be
        // checked.
        if refused.is_none() {
            *refused = joins(geometry, before, from).err();
        }
        pieces.extend(added);
    }
    // A piece without a length has no place on it, and a world refuses it.
    let first = pieces.first().copied();
    pieces.retain(|piece| piece.length_m > 0.0);
    if pieces.is_empty() {
        pieces.extend(first);
    }
    Ok(pieces)
}

/// Pieces one after the other from a station and a place on.
fn chained(from: ReferencePlace, bends: Vec<Bend>) -> Vec<ReferenceSegment> {
    let mut next = from;
    let pieces = bends.into_iter().map(|Bend { length_m, per_m }| {
        let piece = ReferenceSegment {
            s_m: next.s_m,
            start: next.pose,
            length_m,
            per_m,
        };
        next = piece.end();
        piece
    });
    pieces.collect()
}

/// Segment of an arc of a curve that begins at a station.
fn segment(s_m: f64, arc: CurveArc) -> ReferenceSegment {
    let CurveArc {
        from_m,
        covers_m,
        start,
        bend,
    } = arc;
    ReferenceSegment {
        s_m: s_m + from_m,
        start,
        length_m: covers_m,
        // The same turn on the length that the file states.
        per_m: bend.per_m * bend.length_m / covers_m,
    }
}

/// Curve of a `paramPoly3` or a `poly3`.
fn polynomial(shape: &XmlNode, start: Pose, length_m: f64) -> Result<ParametricCurve, ImportError> {
    let plain = ParameterScope::default();
    let cubic = |names: [&str; 4]| {
        let terms = names.map(|name| plain.number_or_zero(shape, name));
        let [a, b, c, d] = terms;
        Ok::<Cubic, ImportError>(Cubic {
            from_m: 0.0,
            terms: [a?, b?, c?, d?],
        })
    };
    let refused = |what: String| shape.refused(what, "check its coefficients");
    if shape.name == "poly3" {
        let left = cubic(["a", "b", "c", "d"])?;
        return ParametricCurve::of_function(start, left, length_m).map_err(refused);
    }
    let ahead = cubic(["aU", "bU", "cU", "dU"])?;
    let left = cubic(["aV", "bV", "cV", "dV"])?;
    let by_length = shape.raw("pRange") == Some("arcLength");
    let pair = CubicPair {
        ahead,
        left,
        most: if by_length { length_m } else { 1.0 },
    };
    ParametricCurve::new(start, pair, length_m).map_err(refused)
}

/// Refuses a piece that does not start at the end of the previous piece.
fn joins(
    geometry: &XmlNode,
    before: Option<ReferencePlace>,
    from: ReferencePlace,
) -> Result<(), ImportError> {
    let (s_m, start) = (from.s_m, from.pose);
    let (ends_m, end) = before.map_or((0.0, start), |it| (it.s_m, it.pose));
    let off_m = libm::hypot(start.x_m - end.x_m, start.y_m - end.y_m);
    let turned_rad = wrapped(start.heading_rad - end.heading_rad).abs();
    // Only what is off is named, or two numbers that look alike would be compared.
    let misfits = [
        ((s_m - ends_m).abs() > MEET_M)
            .then(|| format!("at s = {s_m:.3} m instead of {ends_m:.3} m")),
        (off_m > MEET_M).then(|| format!("{off_m:.3} m off the end of the piece before it")),
        (turned_rad > MEET_RAD)
            .then(|| format!("turned by {turned_rad:.4} rad against the piece before it")),
    ];
    let misfits: Vec<String> = misfits.into_iter().flatten().collect();
    if misfits.is_empty() {
        return Ok(());
    }
    let help = "make the pieces of the planView meet";
    Err(geometry.refused(format!("it begins {}", misfits.join(", ")), help))
}
