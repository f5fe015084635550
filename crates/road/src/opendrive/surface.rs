//! Friction and speed limit of a road.

use super::error::ImportError;
use super::lanes::sides_of;
use super::scope::ParameterScope;
use super::tree::XmlNode;

/// Metres per second in one mile per hour.
const MPH_MPS: f64 = 0.44704;

/// Properties of a road as a whole.
///
/// A property that changes along the road or between lanes is an error.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// Friction coefficient μ before the scenario scales it.
    pub friction: Result<f64, ImportError>,
    /// Least coefficient of the driving lanes.
    pub least_friction: f64,
    pub limit_mps: Result<Option<f64>, ImportError>,
}

impl Default for Surface {
    fn default() -> Surface {
        Surface {
            // Without a material, the scenario's scale is the coefficient
            // itself.
            friction: Ok(1.0),
            least_friction: 1.0,
            limit_mps: Ok(None),
        }
    }
}

impl Surface {
    /// Returns the surface of a road with the lanes of one section.
    pub fn of(road: &XmlNode, section: Option<&XmlNode>) -> Result<Surface, ImportError> {
        let sides = section.into_iter().flat_map(sides_of);
        let lanes = sides.flat_map(|side| side.all("lane"));
        // Materials of shoulders and sidewalks do not matter: no vehicle drives
        // there.
        let driven: Vec<&XmlNode> = lanes
            .filter(|lane| lane.raw("type") == Some("driving"))
            .collect();
        Ok(Surface {
            friction: friction(&driven)?,
            least_friction: least_friction(&driven)?,
            limit_mps: limit_mps(road, &driven)?,
        })
    }
}

fn friction(driven: &[&XmlNode]) -> Result<Result<f64, ImportError>, ImportError> {
    let mut known = None;
    for material in driven.iter().flat_map(|lane| lane.all("material")) {
        let value = ParameterScope::default().number_or_zero(material, "friction")?;
        let begins_m = ParameterScope::default().number_or_zero(material, "sOffset")?;
        if begins_m != 0.0 || known.is_some_and(|known| known != value) {
            let what = "friction that changes along the road or from lane to lane is not read";
            let help = "give every driving lane the same `material` from sOffset=\"0\" on";
            return Ok(Err(material.refused(what, help)));
        }
        known = Some(value);
    }
    Ok(Ok(known.unwrap_or(1.0)))
}

fn least_friction(driven: &[&XmlNode]) -> Result<f64, ImportError> {
    let plain = ParameterScope::default();
    let materials = driven.iter().flat_map(|lane| lane.all("material"));
    let mut least = f64::INFINITY;
    for material in materials {
        least = least.min(plain.number_or_zero(material, "friction")?);
    }
    Ok(if least.is_finite() { least } else { 1.0 })
}

/// Speed limit of the lanes. Without a limit, that of the road.
///
/// The outer error is a malformed file, the inner error an unsupported limit.
fn limit_mps(
    road: &XmlNode,
    driven: &[&XmlNode],
) -> Result<Result<Option<f64>, ImportError>, ImportError> {
    let of_road = road
        .all("type")
        .map(|it| (it, "s", it.child("speed").unwrap_or(it)));
    let of_lanes: Vec<_> = driven
        .iter()
        .flat_map(|lane| lane.all("speed"))
        .map(|it| (it, "sOffset", it))
        .collect();
    // Lanes without a limit have that of the road, so both are compared.
    let limited = driven.iter().filter(|lane| lane.child("speed").is_some());
    let is_partly = !of_lanes.is_empty() && limited.count() < driven.len();
    let records: Vec<_> = if of_lanes.is_empty() {
        of_road.collect()
    } else if is_partly {
        of_road.chain(of_lanes).collect()
    } else {
        of_lanes
    };
    // Lanes without any limit have none, which the others must not have either.
    let has_none = is_partly && road.child("type").is_none();
    let mut known = has_none.then_some(None);
    for (record, begins, speed) in records {
        let limit_mps = max_mps(speed)?;
        let begins_late = (ParameterScope::default().number_or_zero(record, begins)? != 0.0)
            && limit_mps.is_some()
            && known.is_none();
        if begins_late || known.is_some_and(|known| known != limit_mps) {
            let what = "a speed limit that changes along the road or from lane to lane is not read";
            let help = "keep one limit for the whole road on which the ego drives";
            return Ok(Err(record.refused(what, help)));
        }
        known = Some(limit_mps);
    }
    Ok(Ok(known.flatten()))
}

/// Limit of a `speed` element.
///
/// OpenDRIVE 1.8 has a number from 0 on, `no limit` or `undefined`. Tools also write 0
/// where they know no limit.
fn max_mps(speed: &XmlNode) -> Result<Option<f64>, ImportError> {
    if matches!(speed.raw("max"), None | Some("no limit" | "undefined")) {
        return Ok(None);
    }
    let value = ParameterScope::default().number(speed, "max")?;
    let per_mps = match speed.raw("unit") {
        None | Some("m/s") => 1.0,
        Some("km/h") => 1.0 / 3.6,
        Some("mph") => MPH_MPS,
        Some(unit) => {
            let what = format!("a speed limit in `{unit}`");
            return Err(speed.refused(what, "use m/s, km/h or mph"));
        }
    };
    if value < 0.0 {
        let what = format!("a speed limit of {value}");
        return Err(speed.refused(what, "write a number from 0 on, `no limit` or `undefined`"));
    }
    Ok((value > 0.0).then_some(value * per_mps))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_speed_limit_is_a_number_from_0_on_or_one_of_two_words() {
        let limit = |attributes: &str| {
            let text = format!("<speed {attributes}/>");
            let speed = XmlNode::parse(Path::new("road.xodr"), &text).expect("XML");
            max_mps(&speed)
        };
        let read = |attributes: &str| limit(attributes).expect(attributes);
        assert_eq!(read(r#"max="20""#), Some(20.0));
        assert_eq!(read(r#"max="36" unit="km/h""#), Some(10.0));
        for none in ["", r#"max="0""#, r#"max="no limit""#, r#"max="undefined""#] {
            assert_eq!(read(none), None, "{none}");
        }
        let error = limit(r#"max="-1""#).expect_err("no limit below 0");
        assert!(error.to_string().contains("a speed limit of -1"), "{error}");
        assert!(format!("{error:?}").contains("`no limit`"), "{error:?}");
    }
}
