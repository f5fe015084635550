//! Traffic models by name: the shipped one, or a file.

use std::path::Path;
use std::sync::Arc;

use brakecheck_driver_model::{ModelError, TrafficModel};

use crate::natural::motorway;
use crate::ron_file::file_text;
use crate::scene::drive::{Agent, Drive};
use crate::world::Scenario;

/// Name of the shipped traffic model.
const SHIPPED: &str = "motorway";

/// Traffic model that does not fit or cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrafficError {
    /// World in which no ado drives a vehicle.
    #[error("no ado drives a vehicle in `{world}`")]
    NoVehicle {
        /// Name of the world.
        world: String,
    },
    /// File that cannot be read.
    #[error("cannot read the traffic model `{file}`: {source}")]
    Read {
        /// Name of the file.
        file: String,
        /// Underlying error.
        source: std::io::Error,
    },
    /// File that is no traffic model.
    #[error("`{file}`: {source}")]
    Model {
        /// Name of the file.
        file: String,
        /// Underlying error.
        source: Box<ModelError>,
    },
}

impl TrafficError {
    /// Returns the fix.
    pub fn help(&self) -> String {
        match self {
            TrafficError::NoVehicle { .. } => {
                "leave `--traffic` and `--natural` out: traffic models are of vehicles".to_owned()
            }
            TrafficError::Read { .. } => format!(
                "name `{SHIPPED}`, or a file written by `brakecheck log FILE.csv --fit FILE.ron`"
            ),
            TrafficError::Model { source, .. } => source.help().to_owned(),
        }
    }
}

/// Returns the world in a named traffic model, by default its own or the shipped one.
///
/// # Errors
/// No ado drives a vehicle, or the file cannot be read or is no model.
pub fn in_named_traffic(world: &Scenario, name: Option<&str>) -> Result<Scenario, TrafficError> {
    // Before the file is read, because its mistakes do not matter in such a world.
    if !has_driving_ados(world) {
        return Err(TrafficError::NoVehicle {
            world: world.name().to_owned(),
        });
    }
    // A world that declares its traffic knows it better than a default.
    if name.is_none() && world.traffic().is_declared {
        return Ok(world.clone());
    }
    Ok(world.in_traffic(traffic_model(name)?))
}

/// Returns a named traffic model, by default the shipped one.
///
/// # Errors
/// The file cannot be read or is no model.
pub fn traffic_model(name: Option<&str>) -> Result<Arc<TrafficModel>, TrafficError> {
    // A file of the same name must not change what a command means.
    let Some(file) = name.filter(|name| *name != SHIPPED) else {
        return Ok(motorway());
    };
    let text = file_text(Path::new(file)).map_err(|source| TrafficError::Read {
        file: file.to_owned(),
        source,
    })?;
    let model = TrafficModel::parse(&text).map_err(|source| TrafficError::Model {
        file: file.to_owned(),
        source: Box::new(source),
    })?;
    Ok(Arc::new(model))
}

/// Returns whether an ado drives a vehicle.
fn has_driving_ados(world: &Scenario) -> bool {
    let agents = world.drive().map(|driving| &driving.spec().agents);
    agents.is_some_and(|agents| {
        let drives = |it: &Agent| matches!(it.drive, Drive::Ado { .. });
        // The models describe vehicles, so they rate no pedestrian.
        agents.iter().any(|it| drives(it) && !it.body.is_on_foot())
    })
}
