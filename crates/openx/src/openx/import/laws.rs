//! Laws of motion from the actions of a storyboard.

use super::bodies::MostRates;
use super::entity::{AT_ONCE_MPS, Approached, ImportedLaw, Steady};
use super::places::PositionContext;
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::road::ChangeShape;

/// Bumper-to-bumper gap in metres at which an entity is placed ahead of the ego.
pub(super) fn gap_of(
    action: &XmlNode,
    scope: &ParameterScope,
    ego: &str,
    speed_mps: f64,
) -> Result<f64, ImportError> {
    let is = |name: &str, value: &str| action.raw(name) == Some(value);
    // Without a displacement, the entity trails the other, and with limits it takes its time.
    let fits = is("continuous", "false")
        && is("freespace", "true")
        && is("displacement", "leadingReferencedEntity")
        && action.child("DynamicConstraints").is_none()
        && scope.text(action, "entityRef")? == ego;
    if !fits {
        let what = "only a clear gap before the ego is read, taken once";
        let help = "write freespace=\"true\", continuous=\"false\" and \
                    displacement=\"leadingReferencedEntity\", without limits";
        return Err(action.refused(what, help));
    }
    // A time gap is measured at the entity's own speed.
    match action.raw("timeGap") {
        Some(_) => Ok(scope.number(action, "timeGap")? * speed_mps),
        None => scope.number(action, "distance"),
    }
}

/// What is dropped of a meeting.
const OWN_APPROACH: &str = "the approach of a meeting before its steady part";

/// Speed of an entity as far as it is known before the run.
pub(super) struct Speeds {
    pub name: String,
    pub now_mps: Option<f64>,
    pub most_mps: f64,
    pub most: MostRates,
}

/// Course of a change in the files, without a duration of its own for a step.
pub(super) fn shape_of(dynamics: &XmlNode) -> Result<Option<ChangeShape>, ImportError> {
    Ok(Some(
        match dynamics.raw("dynamicsShape").unwrap_or_default() {
            "linear" => ChangeShape::Linear,
            "sinusoidal" => ChangeShape::Cosine,
            "cubic" => ChangeShape::Cubic,
            "step" => return Ok(None),
            _ => {
                return Err(dynamics.refused(
                    "a change of this shape is not read",
                    "write the shape linear, sinusoidal, cubic or step",
                ));
            }
        },
    ))
}

/// Reads a speed action.
///
/// Rates are those of the file, but no greater than the body's `Performance`.
pub(super) fn speed(
    it: &XmlNode,
    scope: &ParameterScope,
    speeds: &mut Speeds,
    of: impl Fn(&str) -> Option<f64>,
) -> Result<ImportedLaw, ImportError> {
    let target = it.inner("SpeedActionTarget")?.only()?;
    let (to_mps, relative_to) = match target.name.as_str() {
        "AbsoluteTargetSpeed" => (scope.number(target, "value")?, None),
        "RelativeTargetSpeed" if scope.text(target, "entityRef")? == speeds.name => {
            (own_speed(target, scope, speeds.now_mps)?, None)
        }
        "RelativeTargetSpeed" => relative_speed(target, scope, &of)?,
        _ => return Err(unknown_target(target)),
    };
    // The speed that a world adds, as far as it is known before the run.
    let base_mps = relative_to.as_deref().map_or(Some(0.0), of);
    if let Some(to_mps) = base_mps
        .map(|base_mps| base_mps + to_mps)
        .filter(|it| *it < 0.0)
    {
        let what = format!("a speed of {to_mps} m/s");
        return Err(target.refused(what, "reversing is not read: a speed is at least 0"));
    }
    let dynamics = it.inner("SpeedActionDynamics")?;
    keeps_place(dynamics)?;
    let value = scope.number_or_zero(dynamics, "value")?;
    let shape = shape_of(dynamics)?;
    // A target above the greatest speed of the body is never reached.
    let to_mps = match relative_to {
        None => to_mps.min(speeds.most_mps),
        Some(_) => to_mps,
    };
    // A speed relative to an entity depends on the run, and so does the
    // direction of the change.
    let known = speeds.now_mps.filter(|_| relative_to.is_none());
    let dimension = dynamics.raw("dynamicsDimension").unwrap_or_default();
    let rate_mps2 = match (shape, dimension) {
        (None, _) => None,
        (Some(_), "rate") => Some(value.abs()),
        // A change in no time is a step.
        (Some(_), "time" | "distance") if value <= 0.0 => None,
        (Some(shape), "time" | "distance") => {
            let now_mps = known.ok_or_else(|| {
                let help = "state the change by a rate";
                let what = "a change by time is not read where a speed depends on the run";
                dynamics.refused(what, help)
            })?;
            // Every shape has the mean speed of its ends.
            let lasts_s = match dimension {
                "time" => value,
                _ => 2.0 * value / (now_mps + to_mps),
            };
            Some(shape.peak() * (to_mps - now_mps).abs() / lasts_s)
        }
        _ => {
            return Err(dynamics.refused(
                "a speed that changes in this way is not read",
                "write a step, or a change by rate, time or distance",
            ));
        }
    };
    let shape = shape.unwrap_or(ChangeShape::Linear);
    let most_mps2 = match known {
        None => speeds.most.up_mps2.min(speeds.most.down_mps2),
        Some(now_mps) => speeds.most.towards(now_mps, to_mps),
    };
    // With an unknown direction, a rate that only one direction allows is
    // ambiguous.
    let unsure = known.is_none() && speeds.most.up_mps2 != speeds.most.down_mps2;
    if unsure && rate_mps2.is_some_and(|rate| most_mps2 < rate) {
        let what = format!("a rate above {most_mps2} m/s², which its `Performance` may not allow");
        return Err(dynamics.refused(what, "give it a rate that the body can do either way"));
    }
    let rate_mps2 = rate_mps2.map(|rate| rate.min(most_mps2));
    // A rate of 0 never changes the speed.
    if rate_mps2 == Some(0.0) {
        let now_mps = speeds.now_mps.ok_or_else(|| {
            let help = "leave the event out, or give it a rate above 0";
            dynamics.refused("a speed that stays as it is on the way is not read", help)
        })?;
        return Ok(ImportedLaw::Speed {
            to_mps: now_mps,
            relative_to: None,
            rate_mps2: None,
            shape,
        });
    }
    // After a relative speed, the speed is unknown until the run.
    speeds.now_mps = relative_to.is_none().then_some(to_mps);
    Ok(ImportedLaw::Speed {
        to_mps,
        relative_to,
        rate_mps2,
        shape,
    })
}

/// Refuses a change that ends wherever the body takes it.
fn keeps_place(dynamics: &XmlNode) -> Result<(), ImportError> {
    match dynamics.raw("followingMode") {
        None | Some("position") => Ok(()),
        Some(_) => {
            let help = "write followingMode=\"position\"";
            Err(dynamics.refused("a change that is only followed is not read", help))
        }
    }
}

/// Error of a target speed that is neither absolute nor relative.
pub(super) fn unknown_target(target: &XmlNode) -> ImportError {
    let help = "write an `AbsoluteTargetSpeed` or a `RelativeTargetSpeed`";
    target.refused("a target speed of this kind is not read", help)
}

/// Speed relative to another entity's, as a sum, a factor or for ever.
///
/// `of` is the constant speed of the other entity, if it is known. Returns the
/// target, and the entity to whose speed a world adds it.
pub(super) fn relative_speed(
    target: &XmlNode,
    scope: &ParameterScope,
    of: impl Fn(&str) -> Option<f64>,
) -> Result<(f64, Option<String>), ImportError> {
    let value = scope.number(target, "value")?;
    let name = scope.text(target, "entityRef")?;
    let is = |name: &str, value: &str| target.raw(name).is_none_or(|it| it == value);
    if is("continuous", "false") && is("speedTargetValueType", "delta") {
        return Ok((value, Some(name)));
    }
    // Beside a speed that never changes, a factor is a speed, and to keep a speed
    // is to reach it.
    let of_mps = of(&name).ok_or_else(|| {
        let help = "use continuous=\"false\" and speedTargetValueType=\"delta\"";
        let what = format!("a target speed that depends on how `{name}` drives");
        target.refused(what, help)
    })?;
    match target.raw("speedTargetValueType") {
        Some("factor") => Ok((value * of_mps, None)),
        _ => Ok((value + of_mps, None)),
    }
}

/// Speed of an entity in m/s relative to its own, which it keeps.
///
/// Players let any other grow with the speed that it changes.
fn own_speed(
    target: &XmlNode,
    scope: &ParameterScope,
    now_mps: Option<f64>,
) -> Result<f64, ImportError> {
    let value = scope.number(target, "value")?;
    let is_same = match target.raw("speedTargetValueType") {
        Some("factor") => value == 1.0,
        _ => value == 0.0,
    };
    now_mps.filter(|_| is_same).ok_or_else(|| {
        let help = "write an `AbsoluteTargetSpeed`";
        target.refused("this target speed relative to its own is not read", help)
    })
}

/// Reads the change of a lane by a distance, whose greatest lateral speed is computed.
///
/// `speed_mps` is the constant speed of the entity, if it is known.
pub(super) fn lane_change(
    it: &XmlNode,
    scope: &ParameterScope,
    by_m: f64,
    speed_mps: Option<f64>,
) -> Result<ImportedLaw, ImportError> {
    keeps_place(it)?;
    let value = scope.number_or_zero(it, "value")?;
    let Some(shape) = shape_of(it)?.filter(|_| value > 0.0) else {
        return Ok(ImportedLaw::LaneChange {
            by_m,
            rate_mps: AT_ONCE_MPS,
            shape: ChangeShape::Linear,
        });
    };
    let rate_mps = match it.raw("dynamicsDimension").unwrap_or_default() {
        "rate" => value,
        "time" => shape.peak() * by_m.abs() / value,
        "distance" => {
            let speed_mps = speed_mps
                .filter(|speed_mps| *speed_mps > 0.0)
                .ok_or_else(|| {
                    let help = "state the change by a time or a rate";
                    let what = "a change by distance is not read where the speed is not constant";
                    it.refused(what, help)
                })?;
            shape.peak() * by_m.abs() * speed_mps / slanted_m(shape, by_m, value)
        }
        _ => {
            let help = "state it by a rate, a time or a distance";
            return Err(it.refused("a lane change of this dimension is not read", help));
        }
    };
    Ok(ImportedLaw::LaneChange {
        by_m,
        // A change by nothing ends at once at any rate.
        rate_mps: if by_m == 0.0 { 1.0 } else { rate_mps },
        shape,
    })
}

/// Length in metres of the line that moves aside by `by_m` on `way_m` of road.
fn slanted_m(shape: ChangeShape, by_m: f64, way_m: f64) -> f64 {
    const PARTS: u32 = 100;
    let step = 1.0 / f64::from(PARTS);
    let lengths_m = (0..PARTS).map(|part| {
        let share = f64::from(part) * step;
        let aside_m = by_m * (shape.changed(share + step) - shape.changed(share));
        libm::hypot(way_m * step, aside_m)
    });
    lengths_m.sum()
}

/// Reads a meeting with the ego.
///
/// The way in which it reaches the final speed is that of brakecheck, which is noted.
pub(super) fn approached(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
    ego_mps: Option<f64>,
) -> Result<Approached, ImportError> {
    ground.catalogs.note(OWN_APPROACH, it);
    if scope.text(it, "masterEntityRef")? != ground.ego.name {
        return Err(it.refused(
            "only meetings with the ego are read",
            "let the `masterEntityRef` be the ego, which --ego can name",
        ));
    }
    let end = it.inner("FinalSpeed")?.only()?;
    let value = scope.number(end, "value")?;
    let speed_mps = match (end.name.as_str(), end.raw("speedTargetValueType")) {
        ("AbsoluteSpeed", _) => value,
        (_, kind) => {
            let ego_mps = ego_mps.ok_or_else(|| {
                let help = "write an `AbsoluteSpeed`";
                end.refused("a speed relative to an ego whose speed changes", help)
            })?;
            match kind {
                Some("factor") => value * ego_mps,
                _ => value + ego_mps,
            }
        }
    };
    let steady = match end.children.first() {
        Some(it) if it.name == "TargetDistanceSteadyState" => {
            Steady::Metres(scope.number(it, "distance")?)
        }
        Some(it) if it.name == "TargetTimeSteadyState" => {
            Steady::Seconds(scope.number(it, "time")?)
        }
        // Without a steady state, the final speed is reached at the place
        // itself.
        _ => Steady::Metres(0.0),
    };
    Ok(Approached {
        ego: ground.place(it.inner("TargetPositionMaster")?, scope)?,
        here: ground.place(it.inner("TargetPosition")?, scope)?,
        speed_mps,
        steady,
    })
}

/// Reads a profile of speeds that change evenly, as durations and speeds.
///
/// `most` is lowered to the limits of the profile.
pub(super) fn speed_profile(
    it: &XmlNode,
    scope: &ParameterScope,
    most: &mut MostRates,
) -> Result<Vec<(f64, f64)>, ImportError> {
    if let Some(limits) = it.child("DynamicConstraints") {
        for (name, most_mps2) in [
            ("maxAcceleration", &mut most.up_mps2),
            ("maxDeceleration", &mut most.down_mps2),
        ] {
            if limits.raw(name).is_some() {
                *most_mps2 = most_mps2.min(scope.number(limits, name)?);
            }
        }
    }
    if it.raw("entityRef").is_some() {
        let help = "leave out `entityRef`, and state the speeds themselves";
        return Err(it.refused("a profile of relative speeds is not read", help));
    }
    keeps_place(it)?;
    let entries = it
        .all("SpeedProfileEntry")
        .map(|it| Ok((scope.number(it, "time")?, scope.number(it, "speed")?)))
        .collect::<Result<Vec<(f64, f64)>, ImportError>>()?;
    if let Some((_, speed_mps)) = entries.iter().find(|(_, speed_mps)| *speed_mps < 0.0) {
        let help = "reversing is not read: a speed is at least 0";
        return Err(it.refused(format!("a speed of {speed_mps} m/s"), help));
    }
    Ok(entries)
}
