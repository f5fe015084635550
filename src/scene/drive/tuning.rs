//! What can change from episode to episode without assembling a world anew.

use std::sync::Arc;

use super::DriveWorld;
use super::layout::Layout;
use super::sensors::Sensors;
use super::spec::{Drive, EgoController};
use crate::ego::{Actuated, ControllerSpec};
use crate::sim::PlantKind;

/// Another ego, other sensors, another road surface, another plant.
///
/// None of them changes signals, observations or starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
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
    /// The same world tuned; nothing is bound anew, so it is cheap.
    pub fn tuned(&self, tuning: &Tuning) -> DriveWorld {
        let mut layout = Layout::clone(&self.0);
        layout.ego_drive = tuning.controller.clone().map(EgoController::Stock);
        let spec = Arc::make_mut(&mut layout.spec);
        if let Drive::Ego(drive) = &mut spec.agents[layout.ego].drive {
            *drive = layout.ego_drive.clone();
        }
        spec.sensors = tuning.sensors;
        spec.road.set_friction(tuning.friction);
        spec.plant = tuning.plant;
        DriveWorld(Arc::new(layout))
    }
}
