//! Bodies as entities: boxes, axles and limits.

use super::path::reference_behind_front_m;
use super::xml::Element;
use crate::scene::drive::{Agent, Drive};
use crate::sim::{Body, GRAVITY_MPS2, Vehicle};

/// The greatest speed of a vehicle as files state it, unless it goes faster.
const TOP_MPS: f64 = 70.0;
/// From this mass on a vehicle is a lorry (the European class N2).
const LORRY_KG: f64 = 3500.0;
/// Up to this width it has two wheels.
const TWO_WHEELED_M: f64 = 1.1;
/// Up to this power, and on two wheels, it is a bicycle.
const PEDALLED_W: f64 = 1000.0;
/// From this height on a car is a van.
const VAN_M: f64 = 1.8;

/// What vehicles are said to be able to do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub friction: f64,
    /// The greatest speed that anybody has.
    pub fastest_mps: f64,
}

/// An agent as an entity of its name.
pub(super) fn entity(agent: &Agent, limits: Limits) -> Element {
    let entity = Element::new("ScenarioObject").text("name", &agent.name);
    entity.child(match agent.body.vehicle() {
        Some(vehicle) => car(&agent.body, vehicle, limits),
        None => pedestrian(&agent.body),
    })
}

/// Whether an agent is the system under test.
pub(super) fn is_ego(agent: &Agent) -> bool {
    matches!(agent.drive, Drive::Ego)
}

fn car(body: &Body, vehicle: &Vehicle, limits: Limits) -> Element {
    let grip_mps2 = limits.friction * vehicle.grip * GRAVITY_MPS2;
    let performance = Element::new("Performance")
        .number("maxSpeed", limits.fastest_mps.max(TOP_MPS).ceil())
        .number("maxAcceleration", grip_mps2)
        .number("maxDeceleration", grip_mps2);
    Element::new("Vehicle")
        .text("name", &body.name)
        .text("vehicleCategory", category(body, vehicle))
        .number("mass", body.mass_kg)
        .child(bounding_box(body))
        .child(performance)
        .child(axles(vehicle))
}

fn pedestrian(body: &Body) -> Element {
    Element::new("Pedestrian")
        .text("name", &body.name)
        .text("pedestrianCategory", "pedestrian")
        .number("mass", body.mass_kg)
        .child(bounding_box(body))
}

/// The box, its middle seen from the reference point.
fn bounding_box(body: &Body) -> Element {
    let ahead_m = reference_behind_front_m(body) - body.half_length_m();
    let centre = Element::new("Center")
        .number("x", ahead_m)
        .number("y", 0.0)
        .number("z", 0.5 * body.height_m);
    let dimensions = Element::new("Dimensions")
        .number("width", body.width_m)
        .number("length", body.length_m)
        .number("height", body.height_m);
    let bounds = Element::new("BoundingBox");
    bounds.child(centre).child(dimensions)
}

fn axles(vehicle: &Vehicle) -> Element {
    let axle = |name, max_steer_rad, ahead_m| {
        Element::new(name)
            .number("maxSteering", max_steer_rad)
            .number("wheelDiameter", 2.0 * vehicle.wheel_radius_m)
            .number("trackWidth", vehicle.track_m)
            .number("positionX", ahead_m)
            .number("positionZ", vehicle.wheel_radius_m)
    };
    Element::new("Axles")
        .child(axle(
            "FrontAxle",
            vehicle.max_steer_rad,
            vehicle.wheelbase_m,
        ))
        .child(axle("RearAxle", 0.0, 0.0))
}

/// Worlds name bodies as they like; players want to know a kind.
fn category(body: &Body, vehicle: &Vehicle) -> &'static str {
    if body.width_m <= TWO_WHEELED_M {
        return match vehicle.power_w <= PEDALLED_W {
            true => "bicycle",
            false => "motorbike",
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
