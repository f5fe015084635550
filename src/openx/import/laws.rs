//! Laws of motion, as actions of a storyboard say them.

use super::entity::{Approached, Law, Steady};
use super::error::ImportError;
use super::places::Ground;
use super::scope::Scope;
use super::tree::Node;
use super::ways::OnWay;

/// How far before the ego somebody is put, bumper to bumper.
pub(super) fn gap_of(action: &Node, scope: &Scope, speed_mps: f64) -> Result<f64, ImportError> {
    let is = |name: &str, value: &str| action.raw(name).is_none_or(|it| it == value);
    let fits = is("continuous", "false")
        && is("freespace", "true")
        && is("displacement", "leadingReferencedEntity")
        && is("entityRef", "Ego");
    if !fits {
        let what = "only a clear gap before the ego is read, taken once";
        return Err(action.error(what));
    }
    match action.raw("timeGap") {
        Some(_) => Ok(scope.number(action, "timeGap")? * speed_mps),
        None => scope.number(action, "distance"),
    }
}

/// Rates are those of the file, but no body does more than its `Performance` says.
pub(super) fn speed(
    it: &Node,
    scope: &Scope,
    (now_mps, most_mps2): (f64, (f64, f64)),
) -> Result<Law, ImportError> {
    let target = it.inner("SpeedActionTarget")?.only()?;
    let to_mps = scope.number(target, "value")?;
    let relative_to = match target.name.as_str() {
        "AbsoluteTargetSpeed" => None,
        "RelativeTargetSpeed"
            if target.raw("continuous").is_none_or(|it| it == "false")
                && target
                    .raw("speedTargetValueType")
                    .is_none_or(|it| it == "delta") =>
        {
            Some(scope.text(target, "entityRef")?)
        }
        _ => return Err(target.error("a target speed of this kind is not read")),
    };
    let dynamics = it.inner("SpeedActionDynamics")?;
    let value = scope.number_or_zero(dynamics, "value")?;
    let shape = dynamics.raw("dynamicsShape").unwrap_or_default();
    let rate_mps2 = match (shape, dynamics.raw("dynamicsDimension").unwrap_or_default()) {
        ("step", _) => None,
        ("linear", "rate") => Some(value.abs()),
        ("linear", "time") if relative_to.is_none() => match 0.0 < value {
            true => Some((to_mps - now_mps).abs() / value),
            false => None,
        },
        _ => return Err(dynamics.error("a speed that changes in this way is not read")),
    };
    let gains = now_mps <= to_mps;
    let most_mps2 = match (&relative_to, gains) {
        (Some(_), _) => most_mps2.0.min(most_mps2.1),
        (None, true) => most_mps2.0,
        (None, false) => most_mps2.1,
    };
    let rate_mps2 = rate_mps2.map(|rate| rate.min(most_mps2));
    // A rate of 0 never gets anywhere: the speed stays.
    Ok(match rate_mps2 == Some(0.0) {
        true => Law::Speed {
            to_mps: now_mps,
            relative_to: None,
            rate_mps2: None,
        },
        false => Law::Speed {
            to_mps,
            relative_to,
            rate_mps2,
        },
    })
}

/// The rate of a change along a cosine.
pub(super) fn dynamics(it: &Node, scope: &Scope, dimension: &str) -> Result<f64, ImportError> {
    let fits = it.raw("dynamicsShape") == Some("sinusoidal")
        && it.raw("dynamicsDimension") == Some(dimension);
    match fits {
        true => scope.number(it, "value"),
        false => Err(it.error(format!("only sinusoidal changes by {dimension} are read"))),
    }
}

/// A meeting with the ego.
pub(super) fn approached(
    it: &Node,
    scope: &Scope,
    ground: Ground<'_>,
) -> Result<Approached, ImportError> {
    if scope.text(it, "masterEntityRef")? != "Ego" {
        return Err(it.error("only meetings with the ego are read"));
    }
    let end = it.inner("FinalSpeed")?.inner("AbsoluteSpeed")?;
    let steady = match end.children.first() {
        Some(it) if it.name == "TargetDistanceSteadyState" => {
            Steady::Metres(scope.number(it, "distance")?)
        }
        Some(it) if it.name == "TargetTimeSteadyState" => {
            Steady::Seconds(scope.number(it, "time")?)
        }
        _ => Steady::Metres(0.0),
    };
    Ok(Approached {
        ego: ground.place(it.inner("TargetPositionMaster")?, scope)?,
        here: ground.place(it.inner("TargetPosition")?, scope)?,
        speed_mps: scope.number(end, "value")?,
        steady,
    })
}

/// A straight way that is walked in the time that its vertices give.
pub(super) fn walked(
    it: &Node,
    scope: &Scope,
    ground: Ground<'_>,
) -> Result<(OnWay, Law), ImportError> {
    let (trajectory, own) = ground.trajectory(it.inner("TrajectoryRef")?, scope)?;
    let on = ground.way(&trajectory, &own)?;
    let shape = trajectory.inner("Shape")?.only()?;
    let vertices: Vec<&Node> = shape.all("Vertex").collect();
    let (Some(first), Some(last)) = (vertices.first(), vertices.last()) else {
        return Err(shape.error("a way without places"));
    };
    let end = ground.place(last.inner("Position")?, &own)?;
    let way_m = on.way.begins.sees(&end.spot).x_m;
    let lasts_s = own.number(last, "time")? - own.number(first, "time")?;
    let is_straight = on.way.pieces.is_empty();
    if !is_straight || vertices.len() != 2 || lasts_s <= 0.0 {
        return Err(shape.error("only a way between two times is read"));
    }
    Ok((
        on,
        Law::Walk {
            speed_mps: way_m / lasts_s,
            way_m,
        },
    ))
}
