//! Collision shape of a body, as data of its file.
//!
//! The rigid plant measures gaps and contacts between these shapes, in 3D. The
//! kinematic plant and everything that places bodies on roads use the bounding
//! box.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body_model::{BodyDimensions, InvalidBody, within};

/// Slack of a part beyond the bounding box, for rounding only.
const SLACK_M: f64 = 1e-6;
/// Greatest number of parts, or of corners of one outline.
const MOST: usize = 32;

/// Collision shape on the rigid plant, inside the bounding box of the body.
///
/// ```
/// use brakecheck_sim::sim::{Body, BodyShape};
/// let compact = Body::shipped("compact").unwrap().unwrap();
/// assert_eq!(compact.shape, BodyShape::Rounded { corner_radius_m: 0.35 });
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum BodyShape {
    /// Bounding box.
    #[default]
    Box,
    /// Bounding box with all edges rounded.
    Rounded {
        /// Radius of the edges, at most half of the least dimension.
        corner_radius_m: f64,
    },
    /// Upright capsule, for bodies as long as they are wide.
    Capsule,
    /// Several convex parts, which together span the bounding box.
    Parts(Vec<BodyPart>),
}

/// Convex part of a [`BodyShape`].
///
/// `ahead_m` and `left_m` count from the middle of the bounding box, `up_m` from
/// the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub enum BodyPart {
    /// Box between two values of each coordinate.
    Box {
        /// From rear to front.
        ahead_m: (f64, f64),
        /// From right to left.
        left_m: (f64, f64),
        /// From bottom to top.
        up_m: (f64, f64),
    },
    /// Upright prism over the convex hull of an outline seen from above.
    Prism {
        /// Corners as `(ahead, left)`, in any order.
        outline_m: Vec<(f64, f64)>,
        /// From bottom to top.
        up_m: (f64, f64),
    },
    /// All points within a radius of a line between two points.
    Capsule {
        /// One end of the line as `(ahead, left, up)`.
        from_m: (f64, f64, f64),
        /// Other end of the line.
        to_m: (f64, f64, f64),
        /// Radius around the line.
        radius_m: f64,
    },
}

/// Least and greatest value along `(ahead, left, up)`.
type Bounds = [(f64, f64); 3];

impl BodyShape {
    /// Returns true for the bounding box itself.
    pub fn is_box(&self) -> bool {
        *self == BodyShape::Box
    }

    /// Checks that the shape has a volume and spans the bounding box.
    ///
    /// # Errors
    /// The first field out of range.
    pub(super) fn validate(&self, size: &BodyDimensions) -> Result<(), InvalidBody> {
        let least_m = size.length_m.min(size.width_m).min(size.height_m);
        match self {
            BodyShape::Box => Ok(()),
            // A larger radius would leave the core of the shape with a
            // negative size.
            BodyShape::Rounded { corner_radius_m } => within(
                "shape.corner_radius_m",
                *corner_radius_m,
                0.001,
                0.5 * least_m,
            ),
            BodyShape::Capsule => {
                // A capsule stands upright, so its footprint is a circle.
                within("width_m", size.width_m, size.length_m, size.length_m)?;
                within("height_m", size.height_m, size.length_m, 6.0)
            }
            BodyShape::Parts(parts) => validate_parts(parts, size),
        }
    }
}

fn validate_parts(parts: &[BodyPart], size: &BodyDimensions) -> Result<(), InvalidBody> {
    within("shape.parts", parts.len() as f64, 1.0, MOST as f64)?;
    // Reversed infinities, so that the first part sets every bound.
    let mut whole: Bounds = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for part in parts {
        let bounds = part.validate()?;
        for (whole, part) in whole.iter_mut().zip(bounds) {
            *whole = (whole.0.min(part.0), whole.1.max(part.1));
        }
    }
    let [ahead, left, up] = whole;
    let ends = [
        ("shape.parts, foremost", ahead.1, 0.5 * size.length_m),
        ("shape.parts, rearmost", ahead.0, -0.5 * size.length_m),
        ("shape.parts, leftmost", left.1, 0.5 * size.width_m),
        ("shape.parts, rightmost", left.0, -0.5 * size.width_m),
        ("shape.parts, topmost", up.1, size.height_m),
    ];
    // Each bumper is named alone, so that the message tells which end is wrong.
    for (field, value, want) in ends {
        if (value - want).abs() > SLACK_M {
            // Gaps count from the bumpers, so a smaller shape would falsify them.
            let want = format!("{want}, as the bounding box has it");
            return Err(InvalidBody { field, value, want });
        }
    }
    // A part may hover above the ground, as a car's body does, but never reach
    // below it.
    within("shape.parts, lowest", up.0, 0.0, size.height_m)
}

impl BodyPart {
    /// Checks the part alone and returns its bounds.
    fn validate(&self) -> Result<Bounds, InvalidBody> {
        match self {
            BodyPart::Box {
                ahead_m,
                left_m,
                up_m,
            } => {
                thick("shape.ahead_m", ahead_m.0, ahead_m.1)?;
                thick("shape.left_m", left_m.0, left_m.1)?;
                thick("shape.up_m", up_m.0, up_m.1)?;
                Ok([*ahead_m, *left_m, *up_m])
            }
            BodyPart::Prism { outline_m, up_m } => {
                thick("shape.up_m", up_m.0, up_m.1)?;
                within("shape.outline_m", outline_m.len() as f64, 3.0, MOST as f64)?;
                let (ahead, left) = outline_bounds(outline_m);
                thick("shape.outline_m, ahead", ahead.0, ahead.1)?;
                thick("shape.outline_m, left", left.0, left.1)?;
                // Points on a slanted line have wide bounds and no area.
                within("shape.outline_m, area", area_m2(outline_m), 1e-4, 1e3)?;
                Ok([ahead, left, *up_m])
            }
            BodyPart::Capsule {
                from_m,
                to_m,
                radius_m,
            } => {
                within("shape.radius_m", *radius_m, 0.001, 3.0)?;
                let span = |a: f64, b: f64| (a.min(b) - radius_m, a.max(b) + radius_m);
                let bounds = [
                    span(from_m.0, to_m.0),
                    span(from_m.1, to_m.1),
                    span(from_m.2, to_m.2),
                ];
                thick("shape.from_m", bounds[0].0, bounds[0].1)?;
                thick("shape.to_m", bounds[1].0, bounds[1].1)?;
                thick("shape.to_m", bounds[2].0, bounds[2].1)?;
                Ok(bounds)
            }
        }
    }
}

/// Checks that a range is finite and at least 1 mm wide.
fn thick(field: &'static str, from: f64, to: f64) -> Result<(), InvalidBody> {
    within(field, from, -30.0, 30.0)?;
    within(field, to, -30.0, 30.0)?;
    if to - from >= 0.001 {
        return Ok(());
    }
    Err(InvalidBody {
        field,
        value: to,
        want: format!("at least 0.001 above its beginning {from}"),
    })
}

fn outline_bounds(outline_m: &[(f64, f64)]) -> ((f64, f64), (f64, f64)) {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    outline_m.iter().fold((none, none), |(ahead, left), at| {
        (
            (ahead.0.min(at.0), ahead.1.max(at.0)),
            (left.0.min(at.1), left.1.max(at.1)),
        )
    })
}

/// Returns a lower bound of the hull's area: the largest triangle on its first corner.
fn area_m2(outline_m: &[(f64, f64)]) -> f64 {
    let Some((first, rest)) = outline_m.split_first() else {
        return 0.0;
    };
    let mut most = 0.0_f64;
    for (index, b) in rest.iter().enumerate() {
        // Any triangle with an area suffices. The outline need not be ordered.
        for c in &rest[index + 1..] {
            let cross = (b.0 - first.0) * (c.1 - first.1) - (b.1 - first.1) * (c.0 - first.0);
            most = most.max(0.5 * cross.abs());
        }
    }
    most
}
