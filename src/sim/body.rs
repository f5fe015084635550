//! Bodies: what drives and walks, as data.
//!
//! A [`Body`] is read from a RON file such as `assets/vehicles/sedan.ron`; some
//! are built into the binary ([`Body::shipped`]). Every length is of the body
//! standing still on flat ground.

use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::BodyControl;
use super::vehicle::Vehicle;
use super::walker::Walker;

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

/// How a body moves: a file of its own for each, and one match in each plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum BodyKind {
    /// On wheels; takes [`super::BodyCommand::Drive`].
    Vehicle(Vehicle),
    /// On foot; takes [`super::BodyCommand::Walk`].
    Walker(Walker),
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
        self.kind.answers().validate(self)
    }

    /// Middle of the front bumper, ahead of the middle of the length.
    pub fn half_length_m(&self) -> f64 {
        0.5 * self.length_m
    }

    /// The vehicle's data, or `None` for a walker.
    pub fn vehicle(&self) -> Option<&Vehicle> {
        match &self.kind {
            BodyKind::Vehicle(vehicle) => Some(vehicle),
            _ => None,
        }
    }

    /// Which commands it takes.
    pub fn control(&self) -> BodyControl {
        self.kind.answers().control()
    }

    /// Whether it walks; everybody else drives.
    pub fn is_on_foot(&self) -> bool {
        self.control() == BodyControl::Walk
    }

    /// What it takes of the road: along it, and across it.
    pub fn room_m(&self) -> (f64, f64) {
        self.kind.answers().room_m(self)
    }

    /// From the point that is steered along a path to the front bumper.
    pub fn lever_m(&self) -> f64 {
        self.kind.answers().lever_m()
    }
}

/// What a kind of body answers for itself; what moves it is asked in the plants.
pub(super) trait Kind {
    /// Checks the values that only this kind has.
    fn validate(&self, body: &Body) -> Result<(), InvalidBody>;
    /// Which commands it takes.
    fn control(&self) -> BodyControl;
    /// What it takes of the road: along it, and across it.
    fn room_m(&self, body: &Body) -> (f64, f64);
    /// From the point that is steered along a path to the front bumper.
    fn lever_m(&self) -> f64;
}

impl BodyKind {
    /// The one place below the plants where kinds are told apart.
    fn answers(&self) -> &dyn Kind {
        match self {
            BodyKind::Vehicle(vehicle) => vehicle,
            BodyKind::Walker(walker) => walker,
        }
    }
}

pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), InvalidBody> {
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

fn grey() -> [u8; 3] {
    [160, 160, 160]
}
