//! Entities of a scenario file: bounding boxes, axles and performance limits.

use super::path::reference_behind_front_m;
use crate::scene::drive::{Agent, Drive};
use crate::sim::{Body, BodyKind, Cyclist, GRAVITY_MPS2, Vehicle};
use crate::xml::XmlElement;

/// Lower bound of the `maxSpeed` that files state, in m/s.
const TOP_MPS: f64 = 70.0;
/// Mass in kg from which a vehicle is a truck (European class N2).
const LORRY_KG: f64 = 3500.0;
/// Width in metres up to which a vehicle has two wheels.
const TWO_WHEELED_M: f64 = 1.1;
/// Power in watts up to which a two-wheeler is a bicycle.
const PEDALLED_W: f64 = 1000.0;
/// Category of bicycles.
const BICYCLE: &str = "bicycle";
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
    entity.child(match &agent.body.kind {
        BodyKind::Vehicle(vehicle) => car(&agent.body, vehicle, limits),
        BodyKind::Cyclist(cyclist) => bicycle(&agent.body, cyclist),
        BodyKind::Walker(_) => pedestrian(&agent.body),
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
        // A limit below a recorded speed would contradict the trajectory.
        .number("maxSpeed", limits.fastest_mps.max(TOP_MPS).ceil())
        .number("maxAcceleration", grip_mps2)
        .number("maxDeceleration", grip_mps2);
    let axles = Axles {
        wheelbase_m: vehicle.wheelbase_m,
        wheel_radius_m: vehicle.wheel_radius_m,
        track_m: vehicle.track_m,
        max_steer_rad: vehicle.max_steer_rad,
    };
    on_wheels(body, category(body, vehicle), performance, &axles)
}

fn bicycle(body: &Body, cyclist: &Cyclist) -> XmlElement {
    let performance = XmlElement::new("Performance")
        .number("maxSpeed", cyclist.max_speed_mps)
        .number("maxAcceleration", cyclist.accel_mps2)
        .number("maxDeceleration", cyclist.brake_mps2);
    let axles = Axles {
        wheelbase_m: cyclist.wheelbase_m,
        wheel_radius_m: cyclist.wheel_radius_m,
        // Both wheels roll on one line.
        track_m: 0.0,
        max_steer_rad: cyclist.max_steer_rad(),
    };
    on_wheels(body, BICYCLE, performance, &axles)
}

fn on_wheels(body: &Body, category: &str, performance: XmlElement, axles: &Axles) -> XmlElement {
    XmlElement::new("Vehicle")
        .text("name", &body.name)
        .text("vehicleCategory", category)
        .number("mass", body.mass_kg)
        .child(bounding_box(body))
        .child(performance)
        .child(axles.element())
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
    // OpenSCENARIO counts a box from the rear axle, and the trace from the front bumper.
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

struct Axles {
    wheelbase_m: f64,
    wheel_radius_m: f64,
    track_m: f64,
    max_steer_rad: f64,
}

impl Axles {
    fn element(&self) -> XmlElement {
        // Positions of axles are relative to the rear axle.
        let axle = |name, max_steer_rad, ahead_m| {
            XmlElement::new(name)
                .number("maxSteering", max_steer_rad)
                .number("wheelDiameter", 2.0 * self.wheel_radius_m)
                .number("trackWidth", self.track_m)
                .number("positionX", ahead_m)
                .number("positionZ", self.wheel_radius_m)
        };
        XmlElement::new("Axles")
            .child(axle("FrontAxle", self.max_steer_rad, self.wheelbase_m))
            .child(axle("RearAxle", 0.0, 0.0))
    }
}

/// Returns the vehicle category of a body, `None` for a pedestrian.
pub(crate) fn vehicle_category(body: &Body) -> Option<&'static str> {
    match &body.kind {
        BodyKind::Vehicle(vehicle) => Some(category(body, vehicle)),
        BodyKind::Cyclist(_) => Some(BICYCLE),
        BodyKind::Walker(_) => None,
    }
}

/// Vehicle category that players know, derived from size, mass and power.
///
/// Worlds name bodies freely, so the name carries no category.
fn category(body: &Body, vehicle: &Vehicle) -> &'static str {
    // Width decides first: a heavy motorcycle is still no car.
    if body.width_m <= TWO_WHEELED_M {
        return if vehicle.power_w <= PEDALLED_W {
            BICYCLE
        } else {
            "motorbike"
        };
    }
    match body.mass_kg {
        heavy if heavy > LORRY_KG => "truck",
        _ if body.height_m > VAN_M => "van",
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

    #[test]
    fn a_bicyclist_is_a_vehicle_with_two_wheels_on_one_line() {
        let body = Body::shipped("bicyclist")
            .expect("shipped")
            .expect("a body");
        let text = bicycle(&body, body.cyclist().expect("a cyclist"))
            .document()
            .expect("written");
        for part in [
            "vehicleCategory=\"bicycle\"",
            "maxSpeed=\"10\"",
            "maxDeceleration=\"4\"",
            "trackWidth=\"0\"",
            "positionX=\"1.05\"",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
