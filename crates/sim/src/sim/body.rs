//! Bodies of road users, as data.
//!
//! A [`Body`] is read from a RON file such as `assets/vehicles/sedan.ron`. Some
//! bodies are built into the binary ([`Body::shipped`]). Every length describes
//! the body at rest on flat ground.

use brakecheck_assets::VEHICLES;
use ron::extensions::Extensions;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::BodyControl;
use super::body_model::{BodyDimensions, BodyModel, InvalidBody, within};
use super::body_shape::BodyShape;
use super::cyclist::Cyclist;
use super::vehicle::Vehicle;
use super::walker::Walker;

/// Kind of road user: its box, its mass and its way of moving.
///
/// ```
/// use brakecheck_sim::sim::Body;
/// let sedan = Body::shipped("sedan").unwrap().unwrap();
/// assert_eq!(sedan.length_m, 4.54);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Common name of the body.
    pub name: String,
    /// Way of moving.
    pub kind: BodyKind,
    /// Distance from the front bumper to the rear bumper.
    pub length_m: f64,
    /// Distance from side to side.
    pub width_m: f64,
    /// Distance from the ground to the roof.
    pub height_m: f64,
    /// Total mass.
    pub mass_kg: f64,
    /// Height of the centre of mass above the ground.
    pub com_height_m: f64,
    /// Distance of the centre of mass ahead of the middle of the length.
    #[serde(default)]
    pub com_ahead_m: f64,
    /// Collision shape on the rigid plant.
    #[serde(default, skip_serializing_if = "BodyShape::is_box")]
    pub shape: BodyShape,
    /// Coefficient of restitution in collisions, 0 (plastic) to 1 (elastic).
    ///
    /// Two bodies collide with the mean of both coefficients.
    #[serde(default = "restitution", skip_serializing_if = "is_restitution")]
    pub restitution: f64,
    /// Coefficient of friction between this body and others in collisions.
    #[serde(default = "body_friction", skip_serializing_if = "is_body_friction")]
    pub body_friction: f64,
    /// Colour in pictures, 0 to 255 for red, green and blue.
    #[serde(default = "grey")]
    pub color_rgb: [u8; 3],
}

/// Way of moving, with one file per kind and one match in each plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum BodyKind {
    /// Wheeled body, commanded by [`super::BodyCommand::Drive`].
    Vehicle(Vehicle),
    /// Bicycle with its rider, commanded by [`super::BodyCommand::Drive`].
    Cyclist(Cyclist),
    /// Body on foot, commanded by [`super::BodyCommand::Walk`].
    Walker(Walker),
}

/// Failure to read a body from text.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BodyError {
    /// The text is not RON, or lacks the fields of a body.
    #[error("{0}")]
    Syntax(#[from] ron::error::SpannedError),
    /// A value is out of range.
    #[error(transparent)]
    Invalid(#[from] InvalidBody),
}

impl Body {
    /// Returns the built-in body of a name such as `"sedan"`, if any.
    ///
    /// # Errors
    /// The built-in files are tested to parse, so do not expect `Some(Err(_))`.
    pub fn shipped(name: &str) -> Option<Result<Body, BodyError>> {
        let (_, text) = VEHICLES.iter().find(|(shipped, _)| *shipped == name)?;
        Some(Body::parse(text))
    }

    /// Returns the names that [`Body::shipped`] accepts.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        VEHICLES.iter().map(|(name, _)| *name)
    }

    /// Reads a body from RON and checks its values.
    ///
    /// # Errors
    /// The first syntax error with its position, or the first value out of range.
    pub fn parse(text: &str) -> Result<Body, BodyError> {
        // With these extensions a body file writes optional fields without
        // `Some`.
        let extensions = Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES;
        let options = ron::Options::default().with_default_extension(extensions);
        let body: Body = options.from_str(text)?;
        body.validate()?;
        Ok(body)
    }

    /// Checks that every value is finite and that the plants can simulate it.
    ///
    /// # Errors
    /// The first field out of range.
    pub fn validate(&self) -> Result<(), InvalidBody> {
        // From a ball on the road to a road train. The bounds catch lengths in other units.
        within("length_m", self.length_m, 0.1, 30.0)?;
        within("width_m", self.width_m, 0.1, 5.0)?;
        within("height_m", self.height_m, 0.1, 6.0)?;
        within("mass_kg", self.mass_kg, 1.0, 100_000.0)?;
        // A centre of mass on the ground would transfer no load.
        within("com_height_m", self.com_height_m, 0.01, self.height_m)?;
        let half_length_m = 0.5 * self.length_m;
        within(
            "com_ahead_m",
            self.com_ahead_m,
            -half_length_m,
            half_length_m,
        )?;
        within("restitution", self.restitution, 0.0, 1.0)?;
        within("body_friction", self.body_friction, 0.0, 2.0)?;
        // The whole has to be sound before its parts are measured against it.
        self.shape.validate(&self.dimensions())?;
        self.kind.answers().validate(&self.dimensions())
    }

    /// Returns the box and the centre of mass.
    pub fn dimensions(&self) -> BodyDimensions {
        BodyDimensions {
            length_m: self.length_m,
            width_m: self.width_m,
            height_m: self.height_m,
            com_height_m: self.com_height_m,
            com_ahead_m: self.com_ahead_m,
        }
    }

    /// Returns the distance from the middle of the length to the front bumper.
    pub fn half_length_m(&self) -> f64 {
        0.5 * self.length_m
    }

    /// Returns the vehicle's data, or `None` for cyclists and walkers.
    pub fn vehicle(&self) -> Option<&Vehicle> {
        match &self.kind {
            BodyKind::Vehicle(vehicle) => Some(vehicle),
            _ => None,
        }
    }

    /// Returns the cyclist's data, or `None` for other kinds.
    pub fn cyclist(&self) -> Option<&Cyclist> {
        match &self.kind {
            BodyKind::Cyclist(cyclist) => Some(cyclist),
            _ => None,
        }
    }

    /// Returns the moment of inertia about the vertical, by default that of a uniform box.
    pub(super) fn yaw_inertia_kg_m2(&self) -> f64 {
        let stated = self.vehicle().and_then(|vehicle| vehicle.yaw_inertia_kg_m2);
        let (l, w) = (self.length_m, self.width_m);
        // An even box of the footprint.
        stated.unwrap_or_else(|| self.mass_kg / 12.0 * (l * l + w * w))
    }

    /// Returns the kind of command that the body accepts.
    pub fn control(&self) -> BodyControl {
        self.kind.answers().control()
    }

    /// Returns true for a walker, false for a vehicle or a cyclist.
    pub fn is_on_foot(&self) -> bool {
        self.control() == BodyControl::Walk
    }

    /// Returns the road space that the body occupies, along and across the road.
    pub fn room_m(&self) -> (f64, f64) {
        self.kind.answers().room_m(&self.dimensions())
    }

    /// Distance from the point steered along a path to the front bumper.
    pub fn lever_m(&self) -> f64 {
        self.kind.answers().lever_m()
    }

    /// Distance from the reference point of OpenSCENARIO files to the front bumper.
    ///
    /// The point is the middle of the rear axle, or that of a walker.
    pub fn front_m(&self) -> f64 {
        if self.is_on_foot() {
            self.half_length_m()
        } else {
            self.lever_m()
        }
    }
}

impl BodyKind {
    /// Returns the kind's data. Only the plants match on the kind elsewhere.
    fn answers(&self) -> &dyn BodyModel {
        match self {
            BodyKind::Vehicle(vehicle) => vehicle,
            BodyKind::Cyclist(cyclist) => cyclist,
            BodyKind::Walker(walker) => walker,
        }
    }
}

/// Restitution of bodies that deform, at the speeds of road traffic.
fn restitution() -> f64 {
    0.1
}

fn is_restitution(value: &f64) -> bool {
    // Exact equality, so that a written body omits the field only if it reads
    // back alike.
    *value == restitution()
}

/// Friction between sheet metal, as reconstructions of accidents use it.
fn body_friction() -> f64 {
    0.5
}

fn is_body_friction(value: &f64) -> bool {
    *value == body_friction()
}

fn grey() -> [u8; 3] {
    [160, 160, 160]
}
