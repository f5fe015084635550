//! Conditions of entities: speeds, distances, times and places.

use super::StoryWriter;
use super::numbers::StatedIn;
use super::triggers::rule;
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::story::values::{
    ComparisonRule, CoordinateSystem, DistanceType, EntityCondition, StoryNumber,
};

impl StoryWriter<'_> {
    /// Returns the condition of an entity, or `None` for one that a run ends before.
    pub(super) fn quantity(
        &mut self,
        at: StatedIn<'_>,
    ) -> Result<Option<EntityCondition>, ImportError> {
        let it = at.node;
        let value = |name: &str| self.numbers.of(at, name, |value| value);
        // A speed across the heading is none that a plan has.
        let is_along = it.raw("direction").is_none_or(|it| it == "longitudinal");
        Ok(Some(match it.name.as_str() {
            "SpeedCondition" if is_along => EntityCondition::Speed {
                rule: rule(it)?,
                value_mps: value("value")?,
            },
            "RelativeSpeedCondition" if is_along => EntityCondition::RelativeSpeed {
                entity: self.other(at)?,
                rule: rule(it)?,
                value_mps: value("value")?,
            },
            "AccelerationCondition" if is_along => EntityCondition::Acceleration {
                rule: rule(it)?,
                value_mps2: value("value")?,
            },
            "StandStillCondition" => EntityCondition::StandStill {
                duration_s: value("duration")?,
            },
            "OffroadCondition" => EntityCondition::Offroad {
                duration_s: value("duration")?,
            },
            "EndOfRoadCondition" => EntityCondition::EndOfRoad {
                duration_s: value("duration")?,
            },
            "TraveledDistanceCondition" => EntityCondition::TraveledDistance {
                value_m: value("value")?,
            },
            "CollisionCondition" => {
                let other = it.child("EntityRef");
                let Some(other) = other else {
                    self.ground.catalogs.note("what follows a contact", it);
                    return Ok(None);
                };
                let name = at.scope.text(other, "entityRef")?;
                EntityCondition::Collision {
                    entity: self.entity(other, &name)?,
                }
            }
            "RelativeDistanceCondition" => EntityCondition::RelativeDistance {
                entity: self.other(at)?,
                distance_type: distance_type(it)?.unwrap_or(DistanceType::Longitudinal),
                coordinate_system: coordinate_system(it)?,
                freespace: at.scope.is_true(at.node, "freespace")?,
                rule: rule(it)?,
                value_m: value("value")?,
            },
            "TimeHeadwayCondition" => {
                let entity = self.other(at)?;
                let (distance_type, coordinate_system) = time_distance(at)?;
                EntityCondition::TimeHeadway {
                    entity,
                    distance_type,
                    coordinate_system,
                    freespace: at.scope.is_true(at.node, "freespace")?,
                    rule: rule(it)?,
                    value_s: value("value")?,
                }
            }
            "TimeToCollisionCondition" => {
                let (distance_type, coordinate_system) = time_distance(at)?;
                let target = it.inner("TimeToCollisionConditionTarget")?.only()?;
                if target.raw("entityRef").is_none() {
                    return Ok(Some(EntityCondition::TimeToPlace {
                        position: self.position(at.at(target))?,
                        distance_type,
                        coordinate_system,
                        freespace: at.scope.is_true(at.node, "freespace")?,
                        rule: rule(it)?,
                        value_s: value("value")?,
                    }));
                }
                let name = at.scope.text(target, "entityRef")?;
                EntityCondition::TimeToCollision {
                    entity: self.entity(target, &name)?,
                    distance_type,
                    coordinate_system,
                    freespace: at.scope.is_true(at.node, "freespace")?,
                    rule: rule(it)?,
                    value_s: value("value")?,
                }
            }
            "ReachPositionCondition" => {
                let position = it.inner("Position")?;
                match followed(at)? {
                    // A place that goes on with an entity is as far as that entity.
                    Some(name) => EntityCondition::RelativeDistance {
                        entity: self.entity(it, &name)?,
                        distance_type: DistanceType::Euclidean,
                        coordinate_system: CoordinateSystem::Entity,
                        freespace: false,
                        rule: ComparisonRule::LessOrEqual,
                        value_m: value("tolerance")?,
                    },
                    None => EntityCondition::ReachPosition {
                        position: self.position(at.at(position))?,
                        tolerance_m: value("tolerance")?,
                    },
                }
            }
            "DistanceCondition" => self.place_distance(at)?,
            _ => {
                return Err(it.refused(
                    "a condition of this kind is not read",
                    "wait for a distance, a headway, a speed, a travelled distance or a place",
                ));
            }
        }))
    }

    fn place_distance(&mut self, at: StatedIn<'_>) -> Result<EntityCondition, ImportError> {
        let it = at.node;
        let (kind, system) = measured(at)?;
        let value_m: StoryNumber = self.numbers.of(at, "value", |value| value)?;
        let freespace = at.scope.is_true(at.node, "freespace")?;
        // A place at an entity is a point, without the entity's box.
        if let Some(name) = followed(at)?.filter(|_| !freespace) {
            return Ok(EntityCondition::RelativeDistance {
                entity: self.entity(it, &name)?,
                distance_type: kind,
                coordinate_system: system,
                freespace,
                rule: rule(it)?,
                value_m,
            });
        }
        Ok(EntityCondition::Distance {
            position: self.position(at.at(it.inner("Position")?))?,
            freespace,
            distance_type: kind,
            coordinate_system: system,
            rule: rule(it)?,
            value_m,
        })
    }

    fn other(&self, at: StatedIn<'_>) -> Result<String, ImportError> {
        let name = at.scope.text(at.node, "entityRef")?;
        self.entity(at.node, &name)
    }
}

/// Returns the system of a distance. Without one it is that of the entity.
pub(super) fn coordinate_system(it: &XmlNode) -> Result<CoordinateSystem, ImportError> {
    match it.raw("coordinateSystem") {
        Some("entity") => Ok(CoordinateSystem::Entity),
        Some("lane" | "road") => Ok(CoordinateSystem::Road),
        None => Ok(CoordinateSystem::Entity),
        Some(system) => {
            let what = format!("a distance in the coordinate system `{system}` is not read");
            let help = "measure it in the coordinate system of the entity, the lane or the road";
            Err(it.refused(what, help))
        }
    }
}

/// Returns direction and system of a distance. Without both it is a straight line.
fn measured(at: StatedIn<'_>) -> Result<(DistanceType, CoordinateSystem), ImportError> {
    let stated = (distance_type(at.node)?, coordinate_system(at.node)?);
    if is_along_route(at.node, at.scope)? {
        return Ok((DistanceType::Longitudinal, CoordinateSystem::Road));
    }
    Ok((stated.0.unwrap_or(DistanceType::Euclidean), stated.1))
}

/// Returns whether a distance is one along the route, by the older attribute.
pub(super) fn is_along_route(it: &XmlNode, scope: &ParameterScope) -> Result<bool, ImportError> {
    // It is ignored beside the newer ones.
    let mut newer = ["relativeDistanceType", "coordinateSystem"].iter();
    Ok(newer.all(|name| it.raw(name).is_none()) && scope.is_true(it, "alongRoute")?)
}

fn distance_type(it: &XmlNode) -> Result<Option<DistanceType>, ImportError> {
    match it.raw("relativeDistanceType") {
        None => Ok(None),
        Some("longitudinal") => Ok(Some(DistanceType::Longitudinal)),
        Some("lateral") => Ok(Some(DistanceType::Lateral)),
        Some("cartesianDistance" | "euclidianDistance") => Ok(Some(DistanceType::Euclidean)),
        Some(other) => {
            let help = "measure it longitudinally, laterally or as euclidianDistance";
            let what = format!("a distance of the type `{other}` is not read");
            Err(it.refused(what, help))
        }
    }
}

/// Returns how the distance of a headway or of a time to collision is measured.
fn time_distance(at: StatedIn<'_>) -> Result<(DistanceType, CoordinateSystem), ImportError> {
    match measured(at)? {
        (DistanceType::Lateral, _) => {
            let help = "write relativeDistanceType=\"longitudinal\"";
            Err(at.node.refused("a time across the way is not read", help))
        }
        along => Ok(along),
    }
}

/// Entity at the place of a condition, which goes on with the entity.
fn followed(at: StatedIn<'_>) -> Result<Option<String>, ImportError> {
    // Only a place at the entity itself is as far away as the entity.
    let position = at.node.child("Position");
    let place = position.and_then(|it| it.children.first());
    let Some(place) = place.filter(|it| it.raw("entityRef").is_some()) else {
        return Ok(None);
    };
    // Any offset makes it a place of its own beside the entity.
    for name in ["dx", "dy", "ds", "dsLane", "dt", "dLane", "offset"] {
        if at.scope.number_or_zero(place, name)? != 0.0 {
            return Ok(None);
        }
    }
    at.scope.text(place, "entityRef").map(Some)
}
