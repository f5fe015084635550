//! Actions along the path of an entity: speeds, profiles and distances.

use super::StoryWriter;
use super::numbers::{StatedIn, StoryNumbers};
use super::quantities::coordinate_system;
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::laws::{OWN_APPROACH, keeps_place, unknown_target};
use crate::story::values::{
    Dimension, DistanceOrTime, DynamicLimits, DynamicsShape, Effect, FinalSpeed, FollowingMode,
    LongitudinalDisplacement, SpeedPoint, SpeedTarget, StoryNumber, TransitionDynamics,
};

/// Returns the course of a change.
pub(super) fn dynamics(
    at: StatedIn<'_>,
    numbers: &StoryNumbers,
) -> Result<TransitionDynamics, ImportError> {
    let it = at.node;
    keeps_place(it)?;
    let shape = shape(it)?;
    let step = TransitionDynamics {
        shape: DynamicsShape::Step,
        dimension: Some(Dimension::Time(StoryNumber::Number(0.0))),
    };
    if shape == DynamicsShape::Step {
        return Ok(step);
    }
    let value = at.scope.number_or_zero(it, "value")?;
    // The sign of a rate says nothing.
    // Read only if needed, because each reading may add a parameter to the world.
    let number = || numbers.stated(at, &["value"], value.abs());
    let dimension = match it.raw("dynamicsDimension").unwrap_or_default() {
        "rate" => Dimension::Rate(number()),
        // A change in no time is a step.
        "time" | "distance" if value <= 0.0 => return Ok(step),
        "time" => Dimension::Time(number()),
        "distance" => Dimension::Distance(number()),
        _ => {
            let help = "write a step, or a change by rate, time or distance";
            return Err(it.refused("a change of this dimension is not read", help));
        }
    };
    Ok(TransitionDynamics {
        shape,
        dimension: Some(dimension),
    })
}

/// Returns the shape of a change.
pub(super) fn shape(it: &XmlNode) -> Result<DynamicsShape, ImportError> {
    Ok(match it.raw("dynamicsShape").unwrap_or_default() {
        "linear" => DynamicsShape::Linear,
        "sinusoidal" => DynamicsShape::Sinusoidal,
        "cubic" => DynamicsShape::Cubic,
        "step" => DynamicsShape::Step,
        _ => {
            let help = "write the shape linear, sinusoidal, cubic or step";
            return Err(it.refused("a change of this shape is not read", help));
        }
    })
}

/// Names of entities in a world, by those of the file.
pub(super) type EntityNames<'a> = &'a dyn Fn(&XmlNode, &str) -> Result<String, ImportError>;

/// Reads a speed action of an entity.
pub(super) fn speed(
    at: StatedIn<'_>,
    numbers: &StoryNumbers,
    own: Option<&str>,
    names: EntityNames<'_>,
) -> Result<Effect, ImportError> {
    let it = at.node;
    let target = it.inner("SpeedActionTarget")?.only()?;
    let dynamics = at.at(it.inner("SpeedActionDynamics")?);
    // A rate of 0 never changes the speed.
    let keeps = is_rate_of_zero(dynamics)?;
    Ok(Effect::Speed {
        target: match own.filter(|_| keeps) {
            Some(own) => SpeedTarget::Delta {
                entity: own.to_owned(),
                value_mps: StoryNumber::Number(0.0),
                continuous: false,
            },
            None => speed_target(at.at(target), numbers, own, names)?,
        },
        dynamics: if keeps {
            TransitionDynamics {
                shape: DynamicsShape::Step,
                dimension: Some(Dimension::Time(StoryNumber::Number(0.0))),
            }
        } else {
            self::dynamics(dynamics, numbers)?
        },
    })
}

/// Returns whether a speed action changes no speed.
pub(super) fn keeps_speed(at: StatedIn<'_>) -> Result<bool, ImportError> {
    is_rate_of_zero(at.at(at.node.inner("SpeedActionDynamics")?))
}

fn is_rate_of_zero(at: StatedIn<'_>) -> Result<bool, ImportError> {
    let is_rate = at.node.raw("dynamicsDimension") == Some("rate");
    let steps = at.node.raw("dynamicsShape") == Some("step");
    Ok(is_rate && !steps && at.scope.number_or_zero(at.node, "value")? == 0.0)
}

fn speed_target(
    at: StatedIn<'_>,
    numbers: &StoryNumbers,
    own: Option<&str>,
    names: EntityNames<'_>,
) -> Result<SpeedTarget, ImportError> {
    let target = at.node;
    let value = at.scope.number(target, "value")?;
    match target.name.as_str() {
        "AbsoluteTargetSpeed" => {
            if value < 0.0 {
                let what = format!("a speed of {value} m/s");
                let help = "reversing is not read: a speed is at least 0";
                return Err(target.refused(what, help));
            }
            let value_mps = numbers.of(at, "value", |value| value)?;
            Ok(SpeedTarget::Absolute { value_mps })
        }
        "RelativeTargetSpeed" => {
            let name = at.scope.text(target, "entityRef")?;
            let entity = names(target, &name)?;
            let continuous = at.scope.is_true(at.node, "continuous")?;
            // Both kinds of values have another one that changes nothing.
            let is_factor = target.raw("speedTargetValueType") == Some("factor");
            let is_same = value == if is_factor { 1.0 } else { 0.0 };
            // Players let it grow with the speed that it changes.
            if own == Some(&entity) && continuous && !is_same {
                let help = "write an `AbsoluteTargetSpeed`";
                let what = "this target speed relative to its own is not read";
                return Err(target.refused(what, help));
            }
            let continuous = continuous && own != Some(&entity);
            Ok(match target.raw("speedTargetValueType") {
                Some("factor") => SpeedTarget::Factor {
                    entity,
                    value: numbers.of(at, "value", |value| value)?,
                    continuous,
                },
                Some("delta") | None => SpeedTarget::Delta {
                    entity,
                    value_mps: numbers.of(at, "value", |value| value)?,
                    continuous,
                },
                Some(_) => return Err(unknown_target(target)),
            })
        }
        _ => Err(unknown_target(target)),
    }
}

impl StoryWriter<'_> {
    /// Refuses a speed below that of an entity that keeps its own, and notes a speed
    /// relative to the own one, which players let grow with it.
    pub(super) fn compare_speeds(
        &self,
        at: StatedIn<'_>,
        own: Option<&str>,
    ) -> Result<(), ImportError> {
        let target = at.node.inner("SpeedActionTarget")?.only()?;
        if target.name != "RelativeTargetSpeed" {
            return Ok(());
        }
        let name = at.scope.text(target, "entityRef")?;
        let value = at.scope.number(target, "value")?;
        let is_factor = target.raw("speedTargetValueType") == Some("factor");
        let is_same = value == if is_factor { 1.0 } else { 0.0 };
        let all = self.frame.map_or(&[][..], |frame| frame.all);
        let of = all.iter().find(|it| it.entity.name == name);
        if of.is_some_and(|of| own == Some(&of.name)) && !is_same {
            let kind = "the growth of speeds that are relative to themselves";
            self.ground.catalogs.note(kind, target);
        }
        let steady = of.filter(|of| !of.entity.is_driven());
        let to_mps = steady.map(|of| of.entity.speed_mps + value);
        match to_mps.filter(|to_mps| *to_mps < 0.0 && !is_factor) {
            Some(to_mps) => {
                let what = format!("a speed of {to_mps} m/s");
                let help = "reversing is not read: a speed is at least 0";
                Err(target.refused(what, help))
            }
            None => Ok(()),
        }
    }

    pub(super) fn profile(&self, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        // Entries follow each other, so a refused one leaves the rest unread.
        let mut points = Vec::new();
        for entry in it.all("SpeedProfileEntry") {
            let at = at.at(entry);
            let speed_mps = at.scope.number(entry, "speed")?;
            if speed_mps < 0.0 && it.raw("entityRef").is_none() {
                let help = "reversing is not read: a speed is at least 0";
                return Err(entry.refused(format!("a speed of {speed_mps} m/s"), help));
            }
            points.push(SpeedPoint {
                time_s: match entry.raw("time") {
                    Some(_) => Some(self.numbers.of(at, "time", |value| value)?),
                    None => None,
                },
                speed_mps: self.numbers.of(at, "speed", |value| value)?,
            });
        }
        Ok(Effect::SpeedProfile {
            entity: match it.raw("entityRef") {
                Some(_) => Some(self.entity(it, &at.scope.text(it, "entityRef")?)?),
                None => None,
            },
            points,
            following: following(it.raw("followingMode"), it)?,
            limits: self.limits(at)?,
        })
    }

    /// Returns durations with constant speeds as a profile that changes them at once.
    pub(super) fn legs(&self, at: StatedIn<'_>, legs: &[(f64, f64)], stops: bool) -> Effect {
        let point = |lasts_s: f64, speed_mps: f64| SpeedPoint {
            time_s: Some(match lasts_s {
                // A zero of all points needs no parameter.
                0.0 => StoryNumber::Number(0.0),
                _ => self.numbers.stated(at, &[], lasts_s),
            }),
            speed_mps: match speed_mps {
                0.0 => StoryNumber::Number(0.0),
                _ => self.numbers.stated(at, &[], speed_mps),
            },
        };
        // A jump to the speed of a leg, and then as long as the leg at that speed.
        let driven = legs
            .iter()
            .flat_map(|(lasts_s, speed_mps)| [point(0.0, *speed_mps), point(*lasts_s, *speed_mps)]);
        let mut points: Vec<SpeedPoint> = driven.collect();
        if stops {
            points.push(point(0.0, 0.0));
        }
        Effect::SpeedProfile {
            entity: None,
            points,
            following: FollowingMode::Position,
            limits: DynamicLimits::default(),
        }
    }

    /// Returns the limits of an action.
    pub(super) fn limits(&self, at: StatedIn<'_>) -> Result<DynamicLimits, ImportError> {
        let Some(node) = at.node.child("DynamicConstraints") else {
            return Ok(DynamicLimits::default());
        };
        let mut rates = ["maxAccelerationRate", "maxDecelerationRate"].iter();
        if rates.any(|name| node.raw(name).is_some()) {
            self.ground
                .catalogs
                .note("limits of the rate of acceleration", node);
        }
        let at = at.at(node);
        let limit = |name: &str| {
            // Some files write the greatest number there is.
            let stated = node
                .raw(name)
                .map(|_| at.scope.number_in(node, name, 0.0..=f64::MAX));
            let value = stated.transpose()?.filter(|value| *value < UNLIMITED);
            Ok::<_, ImportError>(value.map(|value| self.numbers.stated(at, &[name], value)))
        };
        Ok(DynamicLimits {
            max_speed_mps: limit("maxSpeed")?,
            max_accel_mps2: limit("maxAcceleration")?,
            max_decel_mps2: limit("maxDeceleration")?,
        })
    }

    pub(super) fn distance_along(&self, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        Ok(Effect::LongitudinalDistance {
            entity: self.entity(it, &at.scope.text(it, "entityRef")?)?,
            distance: match it.raw("timeGap") {
                Some(_) => DistanceOrTime::Seconds(self.numbers.of(at, "timeGap", |it| it)?),
                None => DistanceOrTime::Metres(self.numbers.of(at, "distance", |it| it)?),
            },
            displacement: match it.raw("displacement") {
                Some("any") => LongitudinalDisplacement::Any,
                Some("leadingReferencedEntity") => LongitudinalDisplacement::Leading,
                None | Some("trailingReferencedEntity") => LongitudinalDisplacement::Trailing,
                Some(other) => {
                    let help = "write any, trailingReferencedEntity or leadingReferencedEntity";
                    return Err(it.refused(format!("there is no side `{other}`"), help));
                }
            },
            freespace: at.scope.is_true(at.node, "freespace")?,
            coordinate_system: coordinate_system(it)?,
            continuous: at.scope.is_true(at.node, "continuous")?,
            limits: self.limits(at)?,
        })
    }

    pub(super) fn synchronize(&mut self, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        // Without a last speed its own is even, and in players it changes evenly.
        if it.child("FinalSpeed").is_none() {
            self.ground.catalogs.note(OWN_APPROACH, it);
        }
        let master = self.entity(it, &at.scope.text(it, "masterEntityRef")?)?;
        let end = it.child("FinalSpeed").map(XmlNode::only).transpose()?;
        // Without a steady part the speed is reached at the place itself.
        let steady = end.and_then(|it| it.children.first());
        Ok(Effect::Synchronize {
            master,
            master_position: self.position(at.at(it.inner("TargetPositionMaster")?))?,
            target_position: self.position(at.at(it.inner("TargetPosition")?))?,
            final_speed: end.map(|end| self.final_speed(at.at(end))).transpose()?,
            steady: match steady {
                Some(it) if it.name == "TargetDistanceSteadyState" => {
                    let distance = self.numbers.of(at.at(it), "distance", |it| it)?;
                    Some(DistanceOrTime::Metres(distance))
                }
                Some(it) if it.name == "TargetTimeSteadyState" => {
                    let time = self.numbers.of(at.at(it), "time", |it| it)?;
                    Some(DistanceOrTime::Seconds(time))
                }
                _ => None,
            },
            master_tolerance_m: self.numbers.or(at, "targetToleranceMaster", 0.0)?,
            target_tolerance_m: self.numbers.or(at, "targetTolerance", 0.0)?,
        })
    }

    fn final_speed(&self, at: StatedIn<'_>) -> Result<FinalSpeed, ImportError> {
        let value = self.numbers.of(at, "value", |value| value)?;
        match (at.node.name.as_str(), at.node.raw("speedTargetValueType")) {
            ("AbsoluteSpeed", _) => Ok(FinalSpeed::Absolute(value)),
            (_, Some("factor")) => {
                let help = "write speedTargetValueType=\"delta\", or an `AbsoluteSpeed`";
                let what = "a final speed as a share of another is not read";
                Err(at.node.refused(what, help))
            }
            _ => Ok(FinalSpeed::RelativeToMaster(value)),
        }
    }
}

/// Limit from which on nothing is limited.
pub(super) const UNLIMITED: f64 = 1e6;

/// Returns what of a profile or a trajectory is exact. Without a word it is the place.
pub(super) fn following(word: Option<&str>, it: &XmlNode) -> Result<FollowingMode, ImportError> {
    match word {
        None | Some("position") => Ok(FollowingMode::Position),
        Some("follow") => Ok(FollowingMode::Follow),
        Some(other) => {
            let help = "write position or follow";
            Err(it.refused(format!("there is no followingMode `{other}`"), help))
        }
    }
}
