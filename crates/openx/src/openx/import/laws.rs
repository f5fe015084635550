//! Actions that shape the start of a run: gaps and meetings.

use super::entity::{Approached, Steady};
use super::places::PositionContext;
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Bumper-to-bumper gap in metres at which an entity is placed ahead of the ego.
pub(super) fn gap_of(
    action: &XmlNode,
    scope: &ParameterScope,
    ego: &str,
    speed_mps: f64,
) -> Result<f64, ImportError> {
    // Without a displacement, the entity trails the other, and with limits it takes its time.
    let fits = !scope.is_true(action, "continuous")?
        && scope.is_true(action, "freespace")?
        && action.raw("displacement") == Some("leadingReferencedEntity")
        && action.child("DynamicConstraints").is_none()
        && matches!(
            action.raw("coordinateSystem"),
            None | Some("entity" | "lane" | "road")
        )
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
pub(super) const OWN_APPROACH: &str = "the approach of a meeting before its steady part";

/// Refuses a change that ends wherever the body takes it.
pub(super) fn keeps_place(dynamics: &XmlNode) -> Result<(), ImportError> {
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

/// Reads a meeting with the ego.
///
/// The way in which it reaches the final speed is that of brakecheck.
pub(super) fn approached(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
    ego_mps: Option<f64>,
) -> Result<Approached, ImportError> {
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
                // Without a kind, a relative speed is a difference.
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
