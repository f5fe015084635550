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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// Unit of velocities, by default the unit of lengths per second.
    #[serde(default)]
    pub speed_unit: SpeedUnit,
    /// Separator of the fields, by default `,`, `;` or a tab as in the header.
    #[serde(default)]
    pub delimiter: Option<char>,
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
    /// Length and width of the box, by default those of the class.
    #[serde(default)]
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
    /// Microseconds since any instant.
    Microseconds(String),
    /// Nanoseconds since any instant.
    Nanoseconds(String),
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
            | TimeColumn::Microseconds(column)
            | TimeColumn::Nanoseconds(column)
            | TimeColumn::Iso(column)
            | TimeColumn::Frames { column, .. } => column,
        }
    }

    /// Returns the seconds in the unit of the numbers, `None` for dates.
    pub(crate) fn unit_s(&self) -> Option<f64> {
        Some(match self {
            TimeColumn::Seconds(_) => 1.0,
            TimeColumn::Milliseconds(_) => 1e-3,
            TimeColumn::Microseconds(_) => 1e-6,
            TimeColumn::Nanoseconds(_) => 1e-9,
            TimeColumn::Frames { rate_hz, .. } => 1.0 / rate_hz,
            TimeColumn::Iso(_) => return None,
        })
    }

    /// Returns the column and its notation in words.
    fn in_words(&self) -> String {
        let column = self.column();
        match self {
            TimeColumn::Seconds(_) => format!("time `{column}` in s"),
            TimeColumn::Milliseconds(_) => format!("time `{column}` in ms"),
            TimeColumn::Microseconds(_) => format!("time `{column}` in µs"),
            TimeColumn::Nanoseconds(_) => format!("time `{column}` in ns"),
            TimeColumn::Iso(_) => format!("time `{column}` as a date"),
            TimeColumn::Frames { rate_hz, .. } => format!("frames `{column}` at {rate_hz} Hz"),
        }
    }
}

impl Default for TimeColumn {
    fn default() -> TimeColumn {
        TimeColumn::Seconds("time".to_owned())
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

/// Unit of velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpeedUnit {
    /// Unit of lengths per second: m/s or ft/s.
    #[default]
    LengthUnit,
    /// m/s.
    MetresPerSecond,
    /// km/h.
    KilometresPerHour,
    /// Miles of 1,609.344 m per hour.
    MilesPerHour,
    /// Feet per second.
    FeetPerSecond,
}

impl SpeedUnit {
    /// Returns the m/s in a unit.
    pub fn mps(self, lengths: LengthUnit) -> f64 {
        match self {
            SpeedUnit::LengthUnit => lengths.metres(),
            SpeedUnit::MetresPerSecond => 1.0,
            // 1 km/h is 1,000 m in 3,600 s.
            SpeedUnit::KilometresPerHour => 1.0 / 3.6,
            SpeedUnit::MilesPerHour => 1609.344 / 3600.0,
            SpeedUnit::FeetPerSecond => FOOT_M,
        }
    }

    fn name(self, lengths: LengthUnit) -> &'static str {
        match (self, lengths) {
            (SpeedUnit::LengthUnit, LengthUnit::Feet) | (SpeedUnit::FeetPerSecond, _) => "ft/s",
            (SpeedUnit::LengthUnit, LengthUnit::Metres) | (SpeedUnit::MetresPerSecond, _) => "m/s",
            (SpeedUnit::KilometresPerHour, _) => "km/h",
            (SpeedUnit::MilesPerHour, _) => "mph",
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
    /// Degrees clockwise from the second axis, which points north.
    CompassDegrees,
    /// Radians clockwise from the second axis, which points north.
    CompassRadians,
}

impl AngleUnit {
    /// Returns the heading in radians of a value. `flip` is −1 if y points to the right.
    pub(crate) fn heading_rad(self, value: f64, flip: f64) -> f64 {
        let north_rad = std::f64::consts::FRAC_PI_2;
        match self {
            AngleUnit::Degrees => flip * value.to_radians(),
            AngleUnit::Radians => flip * value,
            // A compass counts clockwise from north, which is a quarter turn
            // left of the first axis.
            AngleUnit::CompassDegrees => flip * (north_rad - value.to_radians()),
            AngleUnit::CompassRadians => flip * (north_rad - value),
        }
    }

    fn name(self) -> &'static str {
        match self {
            AngleUnit::Degrees => "degrees",
            AngleUnit::Radians => "rad",
            AngleUnit::CompassDegrees => "degrees of a compass",
            AngleUnit::CompassRadians => "radians of a compass",
        }
    }
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum SizeColumns {
    /// The usual size of the class.
    #[default]
    ByClass,
    /// Two columns, in the length unit of the file. Where either is 0 or empty, the size
    /// is that of the class.
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
        /// Class of road users without a size, by default a car.
        #[serde(default)]
        without_size: Class,
    },
    /// A column of words, such as `car`, `bus` or `pedestrian/bicycle`.
    Words(String),
}

impl ClassColumns {
    /// Returns the classes by the usual length of trucks.
    pub(crate) fn by_length() -> ClassColumns {
        ClassColumns::ByLength {
            truck_from_m: 7.5,
            without_size: Class::Car,
        }
    }
}

impl Default for ClassColumns {
    fn default() -> ClassColumns {
        ClassColumns::Fixed(Class::Car)
    }
}

/// Names and texts of the shipped column maps.
const SHIPPED: [(&str, &str); 8] = [
    ("dlr", include_str!("../maps/dlr.ron")),
    ("highd", include_str!("../maps/highd.ron")),
    ("ind", include_str!("../maps/ind.ron")),
    ("ngsim", include_str!("../maps/ngsim.ron")),
    ("sumo", include_str!("../maps/sumo.ron")),
    ("interaction", include_str!("../maps/interaction.ron")),
    (
        "interaction_pedestrians",
        include_str!("../maps/interaction_pedestrians.ron"),
    ),
    // Last, because its few plain names may also occur in files that a map
    // above describes fully.
    ("generic", include_str!("../maps/generic.ron")),
];

impl ColumnMap {
    /// Returns the names of the shipped maps.
    pub fn shipped_names() -> [&'static str; 8] {
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
    ///
    /// Capital and small letters are alike, since the same data has both.
    pub fn guess(header: &[String]) -> Option<&'static str> {
        let fits = |name: &&'static str| {
            let map = ColumnMap::shipped(name);
            let has = |column: &&str| header.iter().any(|it| it.eq_ignore_ascii_case(column));
            map.is_some_and(|map| map.columns().iter().all(has))
        };
        ColumnMap::shipped_names().into_iter().find(fits)
    }

    /// Returns the columns, units and reference point in words.
    pub fn in_words(&self) -> String {
        let unit = match self.length_unit {
            LengthUnit::Metres => "m",
            LengthUnit::Feet => "ft",
        };
        let point = match self.reference {
            Reference::Centre => "box centre",
            Reference::Corner => "box corner",
            Reference::Front => "front bumper",
        };
        let side = match self.y_axis {
            YAxis::Left => "",
            YAxis::Right => ", y to the right",
        };
        let time = self.time.in_words();
        let mut text = format!("{time}; {point} `{}`, `{}` in {unit}{side}", self.x, self.y);
        match &self.heading {
            Some(angle) => {
                text += &format!("; heading `{}` in {}", angle.column, angle.unit.name())
            }
            None => text += "; heading of the motion",
        }
        let unit = self.speed_unit.name(self.length_unit);
        match &self.velocity {
            VectorColumns::Derived => text += "; speed of the positions",
            VectorColumns::Components(x, y) => {
                text += &format!("; velocity `{x}`, `{y}` in {unit}")
            }
            VectorColumns::Magnitude(along) => text += &format!("; speed `{along}` in {unit}"),
        }
        text
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
            ClassColumns::Codes { column, .. } | ClassColumns::Words(column) => all.push(column),
        }
        // The marker is required too: without it, rows made up by the recorder
        // would count as measured.
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
            let map = ColumnMap::shipped(name).unwrap_or_else(|| panic!("{name} does not parse"));
            let header: Vec<String> = map.columns().iter().map(|it| (*it).to_owned()).collect();
            assert_eq!(ColumnMap::guess(&header), Some(name));
            assert_eq!(ColumnMap::guess(&header[1..]), None, "{name}");
        }
    }
}
