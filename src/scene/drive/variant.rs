//! What can change from episode to episode without assembling a world anew.

use std::sync::Arc;

use serde::Serialize;

use super::layout::Layout;
use super::sensors::Sensors;
use super::spec::EgoController;
use super::world::DriveWorld;
use crate::ego::{Actuated, ControllerSpec};
use crate::sim::PlantKind;

/// A stock ego as one is met: its controller and sensors, the road, the plant.
///
/// None of them changes signals, observations or starts. Families have one as
/// their nominal ego and make one of every member.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EgoVariant {
    /// The ego's controller and actuator.
    pub controller: Actuated<ControllerSpec>,
    /// The ego's sensors.
    pub sensors: Sensors,
    /// The road's coefficient of friction.
    pub friction: f64,
    /// Which physics.
    pub plant: PlantKind,
}

impl DriveWorld {
    /// The same world with this ego; nothing is bound anew, so it is cheap.
    pub fn with_variant(&self, variant: &EgoVariant) -> DriveWorld {
        let mut layout = Layout::clone(&self.0);
        let spec = Arc::make_mut(&mut layout.spec);
        spec.ego = variant.controller.clone().map(EgoController::Stock);
        spec.sensors = variant.sensors;
        spec.road.set_friction(variant.friction);
        spec.plant = variant.plant;
        DriveWorld(Arc::new(layout))
    }
}
