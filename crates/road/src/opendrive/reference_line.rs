//! Reference lines of roads: lines, arcs, spirals and polynomials, as arcs.

use super::curve::{Cubic, CurveArc, ParametricCurve, arcs_of};
use super::error::ImportError;
use super::scope::ParameterScope;
use super::tree::XmlNode;
use super::ways::{Bend, Spiral};
use crate::pose::{Pose, wrapped};

/// Lateral distance in metres up to which lanes stay near their curves.
const LANES_M: f64 = 12.0;
/// Tolerances within which consecutive pieces of a reference line connect.
pub(crate) const MEET_M: f64 = 0.01;
const MEET_RAD: f64 = 1e-3;

/// Piece of a reference line.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceSegment {
    pub s_m: f64,
    pub start: Pose,
    pub length_m: f64,
    pub per_m: f64,
}

impl ReferenceSegment {
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
    pub fn end(&self) -> (f64, Pose) {
        let end = self.start.bent(self.length_m, self.per_m);
        (self.s_m + self.length_m, end)
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
        let length_m = plain.number(geometry, "length")?;
        let before = pieces.last().map(ReferenceSegment::end);
        let s_m = plain.number(geometry, "s")?;
        let start = Pose {
            x_m: plain.number(geometry, "x")?,
            y_m: plain.number(geometry, "y")?,
            heading_rad: plain.number(geometry, "hdg")?,
        };
        let bend = |per_m| chained((s_m, start), vec![Bend { length_m, per_m }]);
        let added = match shape.name.as_str() {
            "line" => bend(0.0),
            "arc" => bend(plain.number(shape, "curvature")?),
            "spiral" => {
                let spiral = Spiral {
                    length_m,
                    from_per_m: plain.number(shape, "curvStart")?,
                    to_per_m: plain.number(shape, "curvEnd")?,
                };
                chained((s_m, start), spiral.arcs(LANES_M))
            }
            "paramPoly3" | "poly3" => {
                let curve = polynomial(shape, start, length_m)?;
                let arcs = arcs_of(&|s_m| curve.at(s_m), length_m, LANES_M);
                arcs.into_iter().map(|arc| segment(s_m, arc)).collect()
            }
            other => {
                let what = format!("a road with a `{other}` is not read");
                refused.get_or_insert_with(|| shape.error(what));
                // The shape is replaced by a line. No entity can be on it.
                bend(0.0)
            }
        };
        // After an unsupported piece, the start of the next piece cannot be
        // checked.
        if refused.is_none() {
            *refused = joins(geometry, before, (s_m, start)).err();
        }
        pieces.extend(added);
    }
    Ok(pieces)
}

/// Pieces one after the other from a station and a place on.
fn chained((mut s_m, mut start): (f64, Pose), bends: Vec<Bend>) -> Vec<ReferenceSegment> {
    let pieces = bends.into_iter().map(|Bend { length_m, per_m }| {
        let piece = ReferenceSegment {
            s_m,
            start,
            length_m,
            per_m,
        };
        (s_m, start) = piece.end();
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
    let is_function = shape.name == "poly3";
    let (ahead, left) = if is_function {
        let along = Cubic {
            from_m: 0.0,
            terms: [0.0, 1.0, 0.0, 0.0],
        };
        (along, cubic(["a", "b", "c", "d"])?)
    } else {
        (
            cubic(["aU", "bU", "cU", "dU"])?,
            cubic(["aV", "bV", "cV", "dV"])?,
        )
    };
    let by_length = is_function || shape.raw("pRange") == Some("arcLength");
    let most = if by_length { length_m } else { 1.0 };
    Ok(ParametricCurve::new(start, (ahead, left), most, length_m))
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
