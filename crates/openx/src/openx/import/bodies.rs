//! Bodies from the vehicles and pedestrians of scenario files.
//!
//! A file states boxes and axles. Masses and springs that it omits get typical
//! values.

use crate::opendrive::error::{At, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::ron_file::read::parse;
use crate::sim::Body;

/// Greatest height of the centre of mass of a narrow body, as a multiple of its track.
const MOST_COM_HEIGHT: f64 = 1.7;

/// Fix of a body that no world has.
const SIZES: &str = "give it sizes and axles of a road user";

/// Greatest length in metres of a body.
const MOST_LENGTH_M: f64 = 30.0;

/// Body in the form of a world file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImportedBody {
    pub name: String,
    pub body: Body,
    pub length_m: f64,
    pub width_m: f64,
    /// Distance from the reference point to the front, in metres.
    pub front_m: f64,
    pub on_foot: bool,
    /// Greatest speed, in m/s.
    pub most_mps: f64,
    /// Greatest acceleration and deceleration.
    pub most_accel_mps2: f64,
    pub most_decel_mps2: f64,
    /// Place of the body in the files.
    pub at: At,
}

impl ImportedBody {
    pub(super) fn of(
        entity: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<ImportedBody, ImportError> {
        let name = scope.text(entity, "name")?;
        let bounds = entity.inner("BoundingBox")?;
        let size = bounds.inner("Dimensions")?;
        let sizes_m = 0.0..=1000.0;
        let length_m = scope.number_in(size, "length", sizes_m.clone())?;
        let width_m = scope.number_in(size, "width", sizes_m.clone())?;
        let height_m = scope.number_in(size, "height", sizes_m)?;
        let centre_m = scope.number(bounds.inner("Center")?, "x")?;
        let front_m = centre_m + 0.5 * length_m;
        let mass_kg = scope.number_or_zero(entity, "mass")?;
        if length_m > MOST_LENGTH_M {
            let what = format!("a body of {length_m} m");
            let help = "split it into parts of 30 m at most, or leave it out";
            return Err(bounds.refused(what, help));
        }
        let on_foot = entity.name == "Pedestrian";
        let sizes = format!("length_m: {length_m}, width_m: {width_m}, height_m: {height_m}");
        let on_wheels = |centre_m: f64, wheelbase_m: f64, wheel_m: f64, track_m: f64| {
            let front_m = centre_m + 0.5 * length_m;
            vehicle(ImportedVehicle {
                name: &name,
                sizes: &sizes,
                mass_kg,
                width_m,
                height_m,
                centre_m,
                front_m,
                // Files give small bodies the axles of a car. The motion only depends
                // on the rear axle.
                wheelbase_m: wheelbase_m.min(front_m).min(length_m),
                wheel_m,
                track_m,
            })
        };
        let ron = match entity.name.as_str() {
            "Pedestrian" => {
                // A pedestrian without a mass gets a typical mass: physics
                // needs a positive value.
                let mass_kg = if mass_kg > 0.0 { mass_kg } else { 75.0 };
                format!(
                    // A plan carries the pedestrian, whatever these limits are.
                    "(name: {name:?}, kind: Walker(max_speed_mps: 10.0, accel_mps2: 10.0), \
                     {sizes}, mass_kg: {mass_kg}, com_height_m: {})",
                    0.5 * height_m
                )
            }
            "Vehicle" if is_bicycle(entity, scope, length_m)? => {
                bicycle(entity, scope, &sizes, height_m, mass_kg, front_m)?
            }
            "Vehicle" => {
                let axles = entity.inner("Axles")?;
                if axles.child("FrontAxle").is_none() {
                    let help = "leave it out: the car in front of it is read alone";
                    return Err(axles.refused("a trailer is not read", help));
                }
                let front = axles.inner("FrontAxle")?;
                let wheelbase_m = scope.number(front, "positionX")?;
                if front_m <= 0.0 || wheelbase_m <= 0.0 {
                    let what = "its front is behind its rear axle";
                    return Err(bounds.refused(what, "move its box or its axles"));
                }
                let wheel_m = 0.5 * scope.number(front, "wheelDiameter")?;
                let track_m = scope.number(front, "trackWidth")?;
                on_wheels(centre_m, wheelbase_m, wheel_m, track_m)
            }
            // A `MiscObject` has no axles. Proportions of its box replace them.
            "MiscObject" => {
                // At 0.3 of the length, both axles are equally far inside the box.
                let centre_m = centre_m.max(0.3 * length_m);
                on_wheels(centre_m, 0.6 * length_m, 0.1 * height_m, 0.8 * width_m)
            }
            other => {
                let help = "write a Vehicle, a Pedestrian or a MiscObject";
                return Err(entity.refused(format!("a `{other}` is not read"), help));
            }
        };
        let most = |name: &str| match entity.child("Performance") {
            // Some files write the greatest number there is.
            Some(performance) if performance.raw(name).is_some() => {
                scope.number_in(performance, name, 0.0..=f64::MAX)
            }
            // Without a stated limit, any speed profile of the file is
            // possible.
            _ => Ok(f64::INFINITY),
        };
        Ok(ImportedBody {
            most_mps: most("maxSpeed")?,
            most_accel_mps2: most("maxAcceleration")?,
            most_decel_mps2: most("maxDeceleration")?,
            name: name.to_lowercase(),
            body: parse(&ron).map_err(|problem| bounds.refused(problem.what, SIZES))?,
            length_m,
            width_m,
            front_m,
            on_foot,
            at: entity.at(),
        })
    }

    /// Returns the body with a name of its own, if another one has its name.
    pub(super) fn beside<'a>(
        mut self,
        others: impl Iterator<Item = &'a ImportedBody> + Clone,
    ) -> ImportedBody {
        let stated = self.name.clone();
        let mut number = 2;
        while let Some(other) = others.clone().find(|it| it.name == self.name) {
            // An equal body is the same entry of the world.
            if other.body == self.body {
                break;
            }
            self.name = format!("{stated} {number}");
            number += 1;
        }
        self
    }
}

/// Returns whether a vehicle is a bicycle with the axles of one.
fn is_bicycle(
    entity: &XmlNode,
    scope: &ParameterScope,
    length_m: f64,
) -> Result<bool, ImportError> {
    if entity.raw("vehicleCategory") != Some("bicycle") {
        return Ok(false);
    }
    let front = entity.inner("Axles")?.inner("FrontAxle")?;
    // Some files give bicycles the axles of a car, farther apart than the box is long.
    Ok(scope.number(front, "positionX")? < length_m)
}

/// Bicyclist of the file's size, with the limits of the stock body.
fn bicycle(
    entity: &XmlNode,
    scope: &ParameterScope,
    sizes: &str,
    height_m: f64,
    mass_kg: f64,
    front_m: f64,
) -> Result<String, ImportError> {
    let stock = Body::shipped("bicyclist").and_then(Result::ok);
    let Some((body, limits)) = stock.as_ref().and_then(|it| Some((it, it.cyclist()?))) else {
        let help = "write the vehicleCategory `car`";
        return Err(entity.refused("a bicycle is not read", help));
    };
    let front = entity.inner("Axles")?.inner("FrontAxle")?;
    let wheelbase_m = scope.number(front, "positionX")?;
    let wheel_m = 0.5 * scope.number(front, "wheelDiameter")?;
    let max_mps = match entity.child("Performance") {
        Some(limit) if limit.raw("maxSpeed").is_some() => scope.number(limit, "maxSpeed")?,
        _ => limits.max_speed_mps,
    };
    let mass_kg = if mass_kg > 0.0 { mass_kg } else { body.mass_kg };
    Ok(format!(
        "(name: {:?}, kind: Cyclist(wheelbase_m: {wheelbase_m}, front_overhang_m: {}, \
         wheel_radius_m: {}, max_speed_mps: {}, accel_mps2: {}, power_w: {}, brake_mps2: {}, \
         max_lateral_mps2: {}, lean_rate_mps3: {}, balance_mps: {}), {sizes}, \
         mass_kg: {mass_kg}, com_height_m: {})",
        scope.text(entity, "name")?,
        tidy(front_m - wheelbase_m),
        wheel_m.max(0.06),
        // Files of cars often state a speed that no bicycle reaches.
        max_mps.clamp(0.1, 40.0),
        limits.accel_mps2,
        limits.power_w,
        limits.brake_mps2,
        limits.max_lateral_mps2,
        limits.lean_rate_mps3,
        limits.balance_mps,
        tidy(body.com_height_m / body.height_m * height_m),
    ))
}

/// Rounds to 1 nm: binary fractions add digits that the file did not state.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

struct ImportedVehicle<'a> {
    name: &'a str,
    sizes: &'a str,
    mass_kg: f64,
    width_m: f64,
    height_m: f64,
    centre_m: f64,
    front_m: f64,
    wheelbase_m: f64,
    wheel_m: f64,
    track_m: f64,
}

fn vehicle(it: ImportedVehicle<'_>) -> String {
    // Same width as the limit of two-wheelers in exported files.
    let narrow = it.width_m < 1.1;
    let usual_kg = match (narrow, it.width_m > 2.2) {
        (true, _) => 100.0,
        (_, true) => 12_000.0,
        _ => 1_500.0,
    };
    let mass_kg = if it.mass_kg > 0.0 {
        it.mass_kg
    } else {
        usual_kg
    };
    // Files give two-wheelers no track, and a narrow body needs stiff springs
    // to stay upright.
    let track_m = if it.track_m > 0.1 && it.track_m <= it.width_m {
        it.track_m
    } else {
        0.8 * it.width_m
    };
    let suspension_hz = if narrow { 3.9 } else { 1.56 };
    let com_height_m = if narrow {
        // Higher, a narrow body would tip over on its springs.
        (0.3 * it.height_m).min(MOST_COM_HEIGHT * track_m)
    } else {
        0.4 * it.height_m
    };
    // A body requires a wheel radius of at least 0.05 m.
    let wheel_m = it.wheel_m.max(0.06);
    format!(
        "(name: {:?}, kind: Vehicle(wheelbase_m: {}, track_m: {track_m}, front_overhang_m: {}, \
         wheel_radius_m: {wheel_m}, power_w: {}, suspension_hz: {suspension_hz}), {}, \
         mass_kg: {mass_kg}, com_height_m: {}, com_ahead_m: {})",
        it.name,
        it.wheelbase_m,
        tidy(it.front_m - it.wheelbase_m),
        // Files state no power, and 70 W/kg gives the usual car 105 kW.
        mass_kg * 70.0,
        it.sizes,
        tidy(com_height_m),
        // The centre of mass lies midway between the axles, here relative to
        // the middle of the box.
        tidy(0.5 * it.wheelbase_m - it.centre_m),
    )
}
