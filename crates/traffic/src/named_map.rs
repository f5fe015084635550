//! Column maps of own recordings: columns by their usual names and units.

use brakecheck_stl::sampling::{name_words, time_name};

use crate::column_map::{
    AngleColumn, AngleUnit, ClassColumns, ColumnMap, LengthUnit, SizeColumns, SpeedUnit,
    TimeColumn, VectorColumns,
};

const IDS: [&str; 25] = [
    "id",
    "trackid",
    "vehicleid",
    "vehid",
    "objectid",
    "objid",
    "agentid",
    "actorid",
    "carid",
    "entityid",
    "userid",
    "roaduserid",
    "obstacleid",
    "uid",
    "trackingid",
    "targetid",
    "car",
    "vehicle",
    "object",
    "agent",
    "actor",
    "entity",
    "roaduser",
    "track",
    "name",
];
const PLACES: [[&str; 2]; 16] = [
    ["x", "y"],
    ["px", "py"],
    ["posx", "posy"],
    ["positionx", "positiony"],
    ["xpos", "ypos"],
    ["xposition", "yposition"],
    ["xcenter", "ycenter"],
    ["centerx", "centery"],
    ["xcentre", "ycentre"],
    ["centrex", "centrey"],
    ["cx", "cy"],
    ["east", "north"],
    ["easting", "northing"],
    ["utmx", "utmy"],
    ["globalx", "globaly"],
    ["worldx", "worldy"],
];
const VELOCITIES: [[&str; 2]; 6] = [
    ["vx", "vy"],
    ["velx", "vely"],
    ["xvelocity", "yvelocity"],
    ["velocityx", "velocityy"],
    ["xvel", "yvel"],
    ["speedx", "speedy"],
];
const HEADINGS: [&str; 9] = [
    "heading",
    "yaw",
    "psi",
    "theta",
    "hdg",
    "orientation",
    "yawangle",
    "headingangle",
    "h",
];
const SPEEDS: [&str; 7] = [
    "speed",
    "v",
    "velocity",
    "vel",
    "vabs",
    "vehiclespeed",
    "absspeed",
];
const LENGTHS: [&str; 6] = [
    "length",
    "len",
    "l",
    "vehiclelength",
    "dimensionlength",
    "boxlength",
];
const WIDTHS: [&str; 6] = [
    "width",
    "wid",
    "w",
    "vehiclewidth",
    "dimensionwidth",
    "boxwidth",
];
const CLASSES: [&str; 9] = [
    "class",
    "type",
    "category",
    "agenttype",
    "vehicletype",
    "objecttype",
    "vehicleclass",
    "objectclass",
    "label",
];

/// Column with its unit.
struct NamedColumn<'a> {
    header: &'a str,
    /// Name in small letters without separators and unit.
    name: String,
    unit: Option<ColumnUnit>,
}

#[derive(Clone, Copy, PartialEq)]
enum ColumnUnit {
    Metres,
    Feet,
    Speed(SpeedUnit),
    Degrees,
    Radians,
    /// Unit of lengths that is not read, and so refused.
    Unread,
}

impl ColumnMap {
    /// Returns a map of the columns whose names and units are usual ones.
    ///
    /// The columns are a time, an identity, x and y, and as far as they are there a
    /// heading, a speed or velocity, a size and a class. Without a unit in the name they
    /// are in seconds, metres, radians and m/s. `time` names another time column.
    pub fn by_names(header: &[String], time: Option<&str>) -> Option<ColumnMap> {
        let columns: Vec<NamedColumn<'_>> = header.iter().map(|it| column(it)).collect();
        let find = |names: &[&str]| {
            let at = |name: &&str| columns.iter().find(|it| it.name == **name);
            names.iter().find_map(at)
        };
        let pair =
            |pairs: &[[&str; 2]]| pairs.iter().find_map(|[a, b]| find(&[*a]).zip(find(&[*b])));
        // In pairs, so that `x` is never combined with the `y` of another
        // notation.
        let (x, y) = pair(&PLACES)?;
        let speed = find(&SPEEDS);
        let velocity = pair(&VELOCITIES);
        let heading = find(&HEADINGS);
        let size = find(&LENGTHS).zip(find(&WIDTHS));
        let class = find(&CLASSES);
        Some(ColumnMap {
            time: time_column(header, time)?,
            id: find(&IDS)?.header.to_owned(),
            x: x.header.to_owned(),
            y: y.header.to_owned(),
            // `unread_unit` refuses a y in another unit.
            length_unit: match x.unit {
                Some(ColumnUnit::Feet) => LengthUnit::Feet,
                _ => LengthUnit::Metres,
            },
            speed_unit: match velocity.map(|it| it.0).or(speed).and_then(|it| it.unit) {
                Some(ColumnUnit::Speed(unit)) => unit,
                _ => SpeedUnit::MetresPerSecond,
            },
            heading: heading.map(|it| AngleColumn {
                column: it.header.to_owned(),
                unit: match it.unit {
                    Some(ColumnUnit::Degrees) => AngleUnit::Degrees,
                    _ => AngleUnit::Radians,
                },
            }),
            velocity: match (velocity, speed) {
                // Components are preferred, because they do not depend on a
                // heading.
                (Some((x, y)), _) => {
                    VectorColumns::Components(x.header.to_owned(), y.header.to_owned())
                }
                (None, Some(speed)) => VectorColumns::Magnitude(speed.header.to_owned()),
                (None, None) => VectorColumns::Derived,
            },
            size: size.map_or(SizeColumns::ByClass, |(length, width)| {
                SizeColumns::Columns {
                    length: length.header.to_owned(),
                    width: width.header.to_owned(),
                }
            }),
            class: match (class, size) {
                (Some(class), _) => ClassColumns::Words(class.header.to_owned()),
                // Without a class column the length is the only sign of a
                // truck.
                (None, Some(_)) => ClassColumns::by_length(),
                (None, None) => ClassColumns::default(),
            },
            ..ColumnMap::default()
        })
    }

    /// Reads the class from a column of a usual name, if there is one.
    pub(crate) fn read_class(&mut self, header: &[String]) {
        let called = |name: &&str| header.iter().find(|it| column(it).name == **name);
        if let Some(class) = CLASSES.iter().find_map(called) {
            self.class = ClassColumns::Words(class.clone());
        }
    }
}

/// Returns a column of a map by names whose unit is unknown or another than the map has.
pub(crate) fn unread_unit(map: &ColumnMap) -> Option<&str> {
    let is_length = |unit: ColumnUnit| match unit {
        ColumnUnit::Metres => map.length_unit == LengthUnit::Metres,
        ColumnUnit::Feet => map.length_unit == LengthUnit::Feet,
        _ => false,
    };
    let is_speed = |unit: ColumnUnit| unit == ColumnUnit::Speed(map.speed_unit);
    let is_angle = |unit: ColumnUnit| matches!(unit, ColumnUnit::Degrees | ColumnUnit::Radians);
    let mut columns: Vec<(&str, &dyn Fn(ColumnUnit) -> bool)> =
        vec![(&map.x, &is_length), (&map.y, &is_length)];
    if let SizeColumns::Columns { length, width } = &map.size {
        columns.extend([(&**length, &is_length as _), (&**width, &is_length as _)]);
    }
    match &map.velocity {
        VectorColumns::Derived => {}
        VectorColumns::Components(x, y) => {
            columns.extend([(&**x, &is_speed as _), (&**y, &is_speed as _)]);
        }
        VectorColumns::Magnitude(along) => columns.push((along, &is_speed)),
    }
    columns.extend(map.heading.iter().map(|it| (&*it.column, &is_angle as _)));
    let is_unread = |(header, fits): &(&str, &dyn Fn(ColumnUnit) -> bool)| {
        // A bracket announces a unit, and an unknown one must not be read as
        // metres.
        let has_bracket = header.contains(['[', '(']);
        column(header).unit.map_or(has_bracket, |unit| !fits(unit))
    };
    columns
        .into_iter()
        .find(is_unread)
        .map(|(header, _)| header)
}

impl TimeColumn {
    /// Returns the column of a name, with the unit in it.
    pub fn named(column: &str) -> TimeColumn {
        let unit_s = time_name(column).ok().flatten().map_or(1.0, |it| it.unit_s);
        let column = column.to_owned();
        match unit_s {
            // The units come from a table of literals, so the values are
            // exact.
            1e-3 => TimeColumn::Milliseconds(column),
            1e-6 => TimeColumn::Microseconds(column),
            1e-9 => TimeColumn::Nanoseconds(column),
            _ => TimeColumn::Seconds(column),
        }
    }
}

fn time_column(header: &[String], time: Option<&str>) -> Option<TimeColumn> {
    if let Some(given) = time {
        return header
            .iter()
            .any(|it| it == given)
            .then(|| TimeColumn::named(given));
    }
    // Names of times with an unknown unit are errors there, and no candidates
    // here.
    let is_time = |it: &&String| matches!(time_name(it), Ok(Some(_)));
    let mut found: Vec<&String> = header.iter().filter(is_time).collect();
    found.sort_by_key(|it| brakecheck_stl::sampling::time_rank(it));
    found.first().map(|it| TimeColumn::named(it))
}

fn column(header: &str) -> NamedColumn<'_> {
    let (name, bracket) = match header.split_once(['[', '(']) {
        Some((name, unit)) => (name, unit.trim_end_matches([']', ')'])),
        None => (header, ""),
    };
    let mut words = name_words(name);
    let mut unit = unit_of(bracket);
    if unit.is_none() && words.len() > 1 {
        // Two words such as `km_h` before one such as `mps`.
        for count in [2, 1] {
            let from = words.len().saturating_sub(count);
            let found = (from > 0)
                .then(|| unit_of(&words[from..].concat()))
                .flatten();
            if found.is_some() {
                unit = found;
                words.truncate(from);
                break;
            }
        }
    }
    NamedColumn {
        header,
        name: words.concat(),
        unit,
    }
}

fn unit_of(text: &str) -> Option<ColumnUnit> {
    let text: String = text
        .to_lowercase()
        .chars()
        // `m/s^2`, `m / s` and `km_h` are written with and without these.
        .filter(|it| !" _^".contains(*it))
        .collect();
    Some(match &*text {
        "m" | "meter" | "meters" | "metre" | "metres" => ColumnUnit::Metres,
        "ft" | "feet" | "foot" => ColumnUnit::Feet,
        "m/s" | "mps" | "ms" | "ms-1" => ColumnUnit::Speed(SpeedUnit::MetresPerSecond),
        "km/h" | "kmh" | "kph" | "kmph" => ColumnUnit::Speed(SpeedUnit::KilometresPerHour),
        "mph" | "mi/h" | "miles/h" => ColumnUnit::Speed(SpeedUnit::MilesPerHour),
        "ft/s" | "fps" => ColumnUnit::Speed(SpeedUnit::FeetPerSecond),
        "deg" | "degree" | "degrees" | "°" => ColumnUnit::Degrees,
        "rad" | "radian" | "radians" => ColumnUnit::Radians,
        "mm" | "cm" | "km" => ColumnUnit::Unread,
        _ => return None,
    })
}
