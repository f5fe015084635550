//! Entities of a scenario file: bounding boxes, axles and performance limits.

use super::path::reference_behind_front_m;
use super::xml::XmlElement;
use crate::scene::drive::{Agent, Drive};
use crate::sim::{Body, GRAVITY_MPS2, Vehicle};

/// Lower bound of the `maxSpeed` that files state, in m/s.
const TOP_MPS: f64 = 70.0;
/// Mass in kg from which a vehicle is a truck (European class N2).
const LORRY_KG: f64 = 3500.0;
/// Width in metres up to which a vehicle has two wheels.
const TWO_WHEELED_M: f64 = 1.1;
/// Power in watts up to which a two-wheeler is a bicycle.
const PEDALLED_W: f64 = 1000.0;
/// Height in metres above which a car is a van.
const VAN_M: f64 = 1.8;

/// Performance limits that apply to every vehicle of a scenario.
#[derive(Clone, Copy, Debug)]
pub(super) struct PerformanceLimits {
    pub friction: f64,
    /// Greatest speed that any agent reaches, in m/s.
    pub fastest_mps: f64,
}

/// Returns the `ScenarioObject` of an agent, under the agent's name.
pub(super) fn entity(agent: &Agent, limits: PerformanceLimits) -> XmlElement {
    let entity = XmlElement::new("ScenarioObject").text("name", &agent.name);
    entity.child(match agent.body.vehicle() {
        Some(vehicle) => car(&agent.body, vehicle, limits),
        None => pedestrian(&agent.body),
    })
}

/// Returns true for the system under test.
pub(super) fn is_ego(agent: &Agent) -> bool {
    matches!(agent.drive, Drive::Ego)
}

fn car(body: &Body, vehicle: &Vehicle, limits: PerformanceLimits) -> XmlElement {
    // Grip is the upper bound in both directions. Engine power may bound
    // acceleration further.
    let grip_mps2 = limits.friction * vehicle.grip * GRAVITY_MPS2;
    let performance = XmlElement::new("Performance")
        .number("maxSpeed", limits.fastest_mps.max(TOP_MPS).ceil())
        .number("maxAcceleration", grip_mps2)
        .number("maxDeceleration", grip_mps2);
    XmlElement::new("Vehicle")
        .text("name", &body.name)
        .text("vehicleCategory", category(body, vehicle))
        .number("mass", body.mass_kg)
        .child(bounding_box(body))
        .child(performance)
        .child(axles(vehicle))
}

fn pedestrian(body: &Body) -> XmlElement {
    XmlElement::new("Pedestrian")
        .text("name", &body.name)
        .text("pedestrianCategory", "pedestrian")
        .number("mass", body.mass_kg)
        .child(bounding_box(body))
}

/// Bounding box, with its centre relative to the reference point.
fn bounding_box(body: &Body) -> XmlElement {
    let ahead_m = reference_behind_front_m(body) - body.half_length_m();
    let centre = XmlElement::new("Center")
        .number("x", ahead_m)
        .number("y", 0.0)
        .number("z", 0.5 * body.height_m);
    let dimensions = XmlElement::new("Dimensions")
        .number("width", body.width_m)
        .number("length", body.length_m)
        .number("height", body.height_m);
    let bounds = XmlElement::new("BoundingBox");
    bounds.child(centre).child(dimensions)
}

fn axles(vehicle: &Vehicle) -> XmlElement {
    // Positions of axles are relative to the rear axle.
    let axle = |name, max_steer_rad, ahead_m| {
        XmlElement::new(name)
            .number("maxSteering", max_steer_rad)
            .number("wheelDiameter", 2.0 * vehicle.wheel_radius_m)
            .number("trackWidth", vehicle.track_m)
            .number("positionX", ahead_m)
            .number("positionZ", vehicle.wheel_radius_m)
    };
    XmlElement::new("Axles")
        .child(axle(
            "FrontAxle",
            vehicle.max_steer_rad,
            vehicle.wheelbase_m,
        ))
        .child(axle("RearAxle", 0.0, 0.0))
}

/// Vehicle category that players know, derived from size, mass and power.
///
/// Worlds name bodies freely, so the name carries no category.
fn category(body: &Body, vehicle: &Vehicle) -> &'static str {
    // Width decides first: a heavy motorcycle is still no car.
    if body.width_m <= TWO_WHEELED_M {
        return if vehicle.power_w <= PEDALLED_W {
            "bicycle"
        } else {
            "motorbike"
        };
    }
    match body.mass_kg {
        heavy if LORRY_KG < heavy => "truck",
        _ if VAN_M < body.height_m => "van",
        _ => "car",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_bodies_are_told_apart() {
        let named = |name: &str| {
            let body = Body::shipped(name).expect("shipped").expect("a body");
            let vehicle = body.vehicle().expect("a vehicle").clone();
            category(&body, &vehicle)
        };
        let kinds = ["sedan", "van", "truck", "motorcycle"].map(named);
        assert_eq!(kinds, ["car", "van", "truck", "motorbike"]);
    }
}
