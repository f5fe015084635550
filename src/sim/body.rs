//! Bodies: what drives and walks, as data.
//!
//! A [`Body`] is read from a RON file such as `assets/vehicles/sedan.ron`; some
//! are built into the binary ([`Body::shipped`]). Every length is of the body
//! standing still on flat ground.

use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::GRAVITY_MPS2;

/// A kind of road user: its box, its mass and how it moves.
///
/// ```
/// use brakecheck::sim::Body;
/// let sedan = Body::shipped("sedan").unwrap().unwrap();
/// assert_eq!(sedan.length_m, 4.54);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// What people call it.
    pub name: String,
    /// How it moves.
    pub kind: BodyKind,
    /// Front bumper to rear bumper.
    pub length_m: f64,
    /// Side to side.
    pub width_m: f64,
    /// Ground to roof.
    pub height_m: f64,
    /// Total mass.
    pub mass_kg: f64,
    /// Height of the centre of mass above the ground.
    pub com_height_m: f64,
    /// How far the centre of mass lies ahead of the middle of the length.
    #[serde(default)]
    pub com_ahead_m: f64,
    /// Colour in pictures, 0 to 255 for red, green and blue.
    #[serde(default = "grey")]
    pub color_rgb: [u8; 3],
}

/// How a body moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum BodyKind {
    /// On wheels; takes [`super::BodyCommand::Drive`].
    Vehicle(Vehicle),
    /// On foot; takes [`super::BodyCommand::Walk`].
    Walker(Walker),
}

/// Chassis, engine and tyres of a wheeled vehicle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    /// Front axle to rear axle.
    pub wheelbase_m: f64,
    /// Left wheel to right wheel.
    pub track_m: f64,
    /// Front bumper to front axle.
    pub front_overhang_m: f64,
    /// Radius of every wheel.
    pub wheel_radius_m: f64,
    /// Greatest power at the wheels.
    pub power_w: f64,
    /// Factor on the road's friction: 1 for tyres that use all of it.
    #[serde(default = "one")]
    pub grip: f64,
    /// Greatest steering angle of the front wheels.
    #[serde(default = "max_steer")]
    pub max_steer_rad: f64,
    /// Frequency at which the body bounces on its springs.
    #[serde(default = "suspension_hz")]
    pub suspension_hz: f64,
    /// Share of critical damping of the suspension.
    #[serde(default = "suspension_damping")]
    pub suspension_damping: f64,
    /// Length of the unloaded suspension.
    #[serde(default = "suspension_rest")]
    pub suspension_rest_m: f64,
    /// How far the suspension moves from its unloaded length, both ways.
    #[serde(default = "suspension_travel")]
    pub suspension_travel_m: f64,
    /// Drag coefficient times frontal area; 0 means coasting meets no air.
    #[serde(default)]
    pub drag_area_m2: f64,
    /// Rolling resistance as a share of the weight; 0 means wheels roll freely.
    #[serde(default)]
    pub rolling_resistance: f64,
}

/// Limits of a body on foot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Walker {
    /// Greatest speed.
    pub max_speed_mps: f64,
    /// How fast the velocity changes, in any direction.
    pub accel_mps2: f64,
}

/// A field of a body that makes no sense.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("`{field}` is {value}, but it must be {want}")]
pub struct InvalidBody {
    /// The field.
    pub field: &'static str,
    /// What it holds.
    pub value: f64,
    /// What it may hold.
    pub want: String,
}

/// Why a text is not a body.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BodyError {
    /// It is not RON, or not the fields of a body.
    #[error("{0}")]
    Syntax(#[from] ron::error::SpannedError),
    /// A value is out of range.
    #[error(transparent)]
    Invalid(#[from] InvalidBody),
}

impl Body {
    /// The body built in under a name such as `"sedan"`, if there is one.
    ///
    /// # Errors
    /// The built-in files are tested to parse, so `Some(Err(_))` is not expected.
    pub fn shipped(name: &str) -> Option<Result<Body, BodyError>> {
        let (_, text) = SHIPPED.iter().find(|(shipped, _)| *shipped == name)?;
        Some(Body::parse(text))
    }

    /// Names that [`Body::shipped`] knows.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// Reads a body from RON and checks its values.
    ///
    /// # Errors
    /// The first syntax error with its place, or the first value out of range.
    pub fn parse(text: &str) -> Result<Body, BodyError> {
        let extensions = Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES;
        let options = ron::Options::default().with_default_extension(extensions);
        let body: Body = options.from_str(text)?;
        body.validate()?;
        Ok(body)
    }

    /// Checks that every value is finite and within what the plants can simulate.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn validate(&self) -> Result<(), InvalidBody> {
        within("length_m", self.length_m, 0.1, 30.0)?;
        within("width_m", self.width_m, 0.1, 5.0)?;
        within("height_m", self.height_m, 0.1, 6.0)?;
        within("mass_kg", self.mass_kg, 1.0, 100_000.0)?;
        within("com_height_m", self.com_height_m, 0.01, self.height_m)?;
        let half_length_m = 0.5 * self.length_m;
        within(
            "com_ahead_m",
            self.com_ahead_m,
            -half_length_m,
            half_length_m,
        )?;
        match &self.kind {
            BodyKind::Vehicle(vehicle) => vehicle.validate(self),
            BodyKind::Walker(walker) => {
                within("max_speed_mps", walker.max_speed_mps, 0.01, 15.0)?;
                within("accel_mps2", walker.accel_mps2, 0.01, 100.0)
            }
        }
    }

    /// Middle of the front bumper, ahead of the middle of the length.
    pub fn half_length_m(&self) -> f64 {
        0.5 * self.length_m
    }

    /// Whether it walks; everybody else drives.
    pub fn is_on_foot(&self) -> bool {
        self.vehicle().is_none()
    }

    /// The vehicle's data, or `None` for a walker.
    pub fn vehicle(&self) -> Option<&Vehicle> {
        match &self.kind {
            BodyKind::Vehicle(vehicle) => Some(vehicle),
            BodyKind::Walker(_) => None,
        }
    }
}

impl Vehicle {
    /// Front axle, ahead of the middle of the length.
    pub fn front_axle_ahead_m(&self, body: &Body) -> f64 {
        body.half_length_m() - self.front_overhang_m
    }

    /// Rear axle, ahead of the middle of the length (usually negative).
    pub fn rear_axle_ahead_m(&self, body: &Body) -> f64 {
        self.front_axle_ahead_m(body) - self.wheelbase_m
    }

    /// Share of the weight that rests on the front axle.
    pub fn front_load_share(&self, body: &Body) -> f64 {
        (body.com_ahead_m - self.rear_axle_ahead_m(body)) / self.wheelbase_m
    }

    /// How far the suspension gives way under the body's own weight.
    pub fn sag_m(&self) -> f64 {
        let omega_per_s = core::f64::consts::TAU * self.suspension_hz;
        GRAVITY_MPS2 / (omega_per_s * omega_per_s)
    }

    fn validate(&self, body: &Body) -> Result<(), InvalidBody> {
        within("wheelbase_m", self.wheelbase_m, 0.1, body.length_m)?;
        within("track_m", self.track_m, 0.05, body.width_m)?;
        let room_m = body.length_m - self.wheelbase_m;
        within("front_overhang_m", self.front_overhang_m, 0.0, room_m)?;
        within("wheel_radius_m", self.wheel_radius_m, 0.05, body.height_m)?;
        within("power_w", self.power_w, 1.0, 1e7)?;
        within("grip", self.grip, 0.01, 3.0)?;
        // Beyond this the turn's centre would lie under the inner wheel.
        let most_rad = libm::atan(1.6 * self.wheelbase_m / self.track_m).min(1.4);
        within("max_steer_rad", self.max_steer_rad, 0.01, most_rad)?;
        within("suspension_hz", self.suspension_hz, 0.5, 4.0)?;
        within("suspension_damping", self.suspension_damping, 0.05, 2.0)?;
        within("suspension_rest_m", self.suspension_rest_m, 0.01, 2.0)?;
        let least_m = 1.2 * self.sag_m();
        within(
            "suspension_travel_m",
            self.suspension_travel_m,
            least_m,
            2.0,
        )?;
        within("drag_area_m2", self.drag_area_m2, 0.0, 50.0)?;
        within("rolling_resistance", self.rolling_resistance, 0.0, 0.5)?;
        // Narrow and tall on soft springs, it would fall over sideways.
        let (omega_per_s, half_m) = (
            core::f64::consts::TAU * self.suspension_hz,
            0.5 * self.track_m,
        );
        let most_m = 0.5 * (omega_per_s * half_m).powi(2) / GRAVITY_MPS2;
        within("com_height_m", body.com_height_m, 0.01, most_m)?;
        // Both axles must carry weight, or the vehicle tips over its bumper.
        let (rear_m, span_m) = (self.rear_axle_ahead_m(body), self.wheelbase_m);
        let (low_m, high_m) = (rear_m + 0.1 * span_m, rear_m + 0.9 * span_m);
        within("com_ahead_m", body.com_ahead_m, low_m, high_m)
    }
}

fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<(), InvalidBody> {
    if low <= value && value <= high {
        return Ok(());
    }
    let want = format!("between {low} and {high}");
    Err(InvalidBody { field, value, want })
}

/// The bodies built in: a file in `assets/vehicles/`, and its name in the list.
macro_rules! shipped {
    ($($name:literal),*) => {
        const SHIPPED: &[(&str, &str)] = &[$(
            ($name, include_str!(concat!("../../assets/vehicles/", $name, ".ron")))
        ),*];
    };
}

shipped!["sedan", "van", "truck", "motorcycle", "pedestrian"];

fn one() -> f64 {
    1.0
}
fn max_steer() -> f64 {
    0.6
}
fn suspension_hz() -> f64 {
    1.56
}
fn suspension_damping() -> f64 {
    0.5
}
fn suspension_rest() -> f64 {
    0.35
}
fn suspension_travel() -> f64 {
    0.2
}
fn grey() -> [u8; 3] {
    [160, 160, 160]
}
