//! Changes of an ego between episodes without assembling a world anew.

use std::sync::Arc;

use serde::Serialize;

use super::environment::EnvironmentQuantity;
use super::layout::DriveLayout;
use super::sensors::Sensors;
use super::world::DriveWorld;
use crate::ego::{Actuated, ControllerSpec};
use crate::sim::PlantKind;

/// A variant of a stock ego: its controller and sensors, the road, the plant.
///
/// None of them changes signals, observations or starts. Families have a
/// variant as their nominal ego and create one for every member.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EgoVariant {
    /// The ego's controller and actuator.
    pub controller: Actuated<ControllerSpec>,
    /// The ego's sensors.
    pub sensors: Sensors,
    /// The road's coefficient of friction.
    pub friction: f64,
    /// Physics engine.
    pub plant: PlantKind,
}

impl DriveWorld {
    /// Returns the same world with this ego. Cheap, because nothing is bound anew.
    pub fn with_variant(&self, variant: &EgoVariant) -> DriveWorld {
        let mut layout = DriveLayout::clone(&self.0);
        // Neither the network nor any bound expression depends on these fields,
        // so the rest of the layout stays valid.
        let spec = Arc::make_mut(&mut layout.spec);
        // Values that differ from the world's own replace those of the starts.
        spec.fix_environment(|it| {
            let Sensors {
                delay_s,
                position_sd_m,
                speed_sd_mps,
                range_m,
                line_of_sight: _,
            } = variant.sensors;
            let value = match it.quantity {
                EnvironmentQuantity::Friction => variant.friction,
                EnvironmentQuantity::SensorDelay => delay_s,
                EnvironmentQuantity::PositionNoise => position_sd_m,
                EnvironmentQuantity::SpeedNoise => speed_sd_mps,
                EnvironmentQuantity::SensorRange => range_m.unwrap_or(f64::INFINITY),
                // No variant has another road or other weather.
                EnvironmentQuantity::LaneWidth
                | EnvironmentQuantity::ArcRadius { .. }
                | EnvironmentQuantity::Rise { .. }
                | EnvironmentQuantity::WindSpeed
                | EnvironmentQuantity::GustPeak
                | EnvironmentQuantity::GustBegin
                | EnvironmentQuantity::Visibility => {
                    return false;
                }
            };
            value != it.nominal
        });
        spec.ego = variant.controller.clone().into();
        spec.sensors = variant.sensors;
        spec.road.set_friction(variant.friction);
        spec.plant = variant.plant;
        DriveWorld(Arc::new(layout))
    }
}
