//! Column maps: the meaning, unit and reference of each column of a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::recording::Class;

/// Metres in an international foot.
const FOOT_M: f64 = 0.3048;

/// Columns of a long CSV: a row per road user and instant.
///
/// Written as RON. Fields that you leave out have the defaults named below.
///
/// ```
/// use brakecheck_traffic::ColumnMap;
///
/// let map: ColumnMap = ron::from_str(r#"ColumnMap(
///     time: Seconds("t"), id: "car", x: "east", y: "north",
///     size: Fixed(length_m: 4.5, width_m: 1.8),
/// )"#)?;
/// assert_eq!(map.columns(), ["t", "car", "east", "north"]);
/// # Ok::<(), ron::error::SpannedError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnMap {
    /// Column of the time, with its notation.
    pub time: TimeColumn,
    /// Column of the road user's identity, any text.
    pub id: String,
    /// Column of the position along the first axis.
    pub x: String,
    /// Column of the position along the second axis.
    pub y: String,
    /// Direction of the second axis, by default to the left of the first.
    #[serde(default)]
    pub y_axis: YAxis,
    /// Unit of positions, sizes, velocities and accelerations, by default metres.
    #[serde(default)]
    pub length_unit: LengthUnit,
    /// Point of the vehicle that has the position, by default the box centre.
    #[serde(default)]
    pub reference: Reference,
    /// Column of the heading, counter-clockwise from the first axis.
    ///
    /// By default it is the direction of motion.
    #[serde(default)]
    pub heading: Option<AngleColumn>,
    /// Columns of the velocity, by default derived from the positions.
    #[serde(default)]
    pub velocity: VectorColumns,
    /// Columns of the acceleration, by default derived from the speed.
    #[serde(default)]
    pub acceleration: VectorColumns,
    /// Length and width of the box.
    pub size: SizeColumns,
    /// Class of the road user, by default a car.
    #[serde(default)]
    pub class: ClassColumns,
    /// Column that marks rows made up by the recorder (`True`, `true` or `1`).
    #[serde(default)]
    pub interpolated: Option<String>,
}

/// Column of the time with its notation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum TimeColumn {
    /// Seconds since any instant.
    Seconds(String),
    /// Milliseconds since any instant.
    Milliseconds(String),
    /// ISO 8601 date and time, such as `2024-10-07 06:00:00.05+00:00`.
    Iso(String),
    /// Frame numbers at a constant rate.
    Frames {
        /// Column of the frame number.
        column: String,
        /// Frames per second.
        rate_hz: f64,
    },
}

impl TimeColumn {
    /// Returns the name of the column.
    pub fn column(&self) -> &str {
        match self {
            TimeColumn::Seconds(column)
            | TimeColumn::Milliseconds(column)
            | TimeColumn::Iso(column)
            | TimeColumn::Frames { column, .. } => column,
        }
    }
}

/// Direction of the second axis of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum YAxis {
    /// To the left of the first axis, as in maps.
    #[default]
    Left,
    /// To the right of the first axis, as in images.
    Right,
}

/// Unit of lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LengthUnit {
    /// Metres.
    #[default]
    Metres,
    /// International feet of 0.3048 m.
    Feet,
}

impl LengthUnit {
    /// Returns the metres in a unit.
    pub fn metres(self) -> f64 {
        match self {
            LengthUnit::Metres => 1.0,
            LengthUnit::Feet => FOOT_M,
        }
    }
}

/// Point of a vehicle's box that has its recorded position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reference {
    /// Centre of the box.
    #[default]
    Centre,
    /// Corner with the smallest coordinates of a box along the file's axes.
    Corner,
    /// Centre of the front bumper.
    Front,
}

/// Unit of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AngleUnit {
    /// Degrees.
    Degrees,
    /// Radians.
    Radians,
}

/// Column of an angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AngleColumn {
    /// Name of the column.
    pub column: String,
    /// Unit of its values.
    pub unit: AngleUnit,
}

/// Columns of a velocity or an acceleration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum VectorColumns {
    /// No columns: the quantity is derived.
    #[default]
    Derived,
    /// Components along both axes of the file.
    Components(String, String),
    /// Signed component along the heading.
    Magnitude(String),
}

/// Source of the size of a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum SizeColumns {
    /// Two columns, in the length unit of the file.
    Columns {
        /// Column of the length along the heading.
        length: String,
        /// Column of the width.
        width: String,
    },
    /// The same size for all road users.
    Fixed {
        /// Length in metres.
        length_m: f64,
        /// Width in metres.
        width_m: f64,
    },
}

/// Source of the class of a road user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ClassColumns {
    /// The same class for all road users.
    Fixed(Class),
    /// A column with a share per class. The largest mean share of an id decides.
    Shares(BTreeMap<String, Class>),
    /// A column of codes. A code that is not listed is `Other`.
    Codes {
        /// Name of the column.
        column: String,
        /// Class per code.
        codes: BTreeMap<String, Class>,
    },
    /// Trucks by their length, all others are cars.
    ByLength {
        /// Length of the shortest truck in metres.
        truck_from_m: f64,
    },
}

impl Default for ClassColumns {
    fn default() -> ClassColumns {
        ClassColumns::Fixed(Class::Car)
    }
}

/// Names and texts of the shipped column maps.
const SHIPPED: [(&str, &str); 5] = [
    ("dlr", include_str!("../maps/dlr.ron")),
    ("highd", include_str!("../maps/highd.ron")),
    ("ind", include_str!("../maps/ind.ron")),
    ("ngsim", include_str!("../maps/ngsim.ron")),
    ("generic", include_str!("../maps/generic.ron")),
];

impl ColumnMap {
    /// Returns the names of the shipped maps.
    pub fn shipped_names() -> [&'static str; 5] {
        SHIPPED.map(|(name, _)| name)
    }

    /// Returns the RON text of a shipped map, to be copied and changed.
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        let found = SHIPPED.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text)
    }

    /// Returns a shipped map.
    pub fn shipped(name: &str) -> Option<ColumnMap> {
        // Invariant: shipped maps parse, which a test checks.
        ron::from_str(ColumnMap::shipped_text(name)?).ok()
    }

    /// Returns the name of the first shipped map whose columns are all in `header`.
    pub fn guess(header: &[String]) -> Option<&'static str> {
        let fits = |name: &&'static str| {
            let map = ColumnMap::shipped(name);
            let has = |column: &&str| header.iter().any(|it| it == column);
            map.is_some_and(|map| map.columns().iter().all(has))
        };
        ColumnMap::shipped_names().into_iter().find(fits)
    }

    /// Returns the names of all columns that the map reads.
    pub fn columns(&self) -> Vec<&str> {
        let mut all = vec![self.time.column(), &*self.id, &*self.x, &*self.y];
        all.extend(self.heading.as_ref().map(|it| &*it.column));
        for vector in [&self.velocity, &self.acceleration] {
            match vector {
                VectorColumns::Derived => {}
                VectorColumns::Components(x, y) => all.extend([&**x, &**y]),
                VectorColumns::Magnitude(along) => all.push(along),
            }
        }
        if let SizeColumns::Columns { length, width } = &self.size {
            all.extend([&**length, &**width]);
        }
        match &self.class {
            ClassColumns::Fixed(_) | ClassColumns::ByLength { .. } => {}
            ClassColumns::Shares(shares) => all.extend(shares.keys().map(|it| &**it)),
            ClassColumns::Codes { column, .. } => all.push(column),
        }
        all.extend(self.interpolated.as_deref());
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_map_parses_and_is_guessed_from_its_own_header() {
        for name in ColumnMap::shipped_names() {
            let map = ColumnMap::shipped(name);
            let map = map.unwrap_or_else(|| panic!("{name} does not parse"));
            let header: Vec<String> = map.columns().iter().map(|it| (*it).to_owned()).collect();
            assert_eq!(ColumnMap::guess(&header), Some(name));
            assert_eq!(ColumnMap::guess(&header[1..]), None, "{name}");
        }
    }
}
