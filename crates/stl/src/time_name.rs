//! Names of time columns, with their units.

/// Names of time columns without their unit, in small letters and without separators.
const NAMES: [&str; 46] = [
    "time",
    "t",
    "timestamp",
    "timestamps",
    "stamp",
    "ts",
    "simtime",
    "simulationtime",
    "timesim",
    "tsim",
    "elapsed",
    "elapsedtime",
    "timeelapsed",
    "seconds",
    "secs",
    "sec",
    "second",
    "epoch",
    "epochtime",
    "unixtime",
    "unixtimestamp",
    "unix",
    "gpstime",
    "rostime",
    "utc",
    "utctime",
    "clock",
    "simclock",
    "wallclock",
    "walltime",
    "systemtime",
    "systime",
    "worldtime",
    "worldclock",
    "relativetime",
    "reltime",
    "timerel",
    "runtime",
    "recordtime",
    "rectime",
    "headerstamp",
    "datetime",
    "absolutetime",
    "abstime",
    "logtime",
    "times",
];

/// Units of times with their seconds.
const UNITS: [(&[&str], f64); 4] = [
    (&["s", "sec", "secs", "second", "seconds"], 1.0),
    (
        &[
            "ms",
            "msec",
            "msecs",
            "millis",
            "millisecond",
            "milliseconds",
        ],
        1e-3,
    ),
    (
        &[
            "us",
            // The micro sign and the Greek letter look alike.
            "µs",
            "μs",
            "usec",
            "usecs",
            "micros",
            "microsecond",
            "microseconds",
        ],
        1e-6,
    ),
    (
        &["ns", "nsec", "nsecs", "nanos", "nanosecond", "nanoseconds"],
        1e-9,
    ),
];

/// Name in a header that names a time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeName {
    /// Name without a unit in brackets.
    pub name: String,
    /// Seconds in its unit.
    pub unit_s: f64,
}

/// Unit of a time that is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownTimeUnit(pub String);

/// Returns the time that a header names, `None` for another column.
///
/// # Errors
/// The column is a time in a unit that is not known, such as `time [h]`.
pub fn time_name(header: &str) -> Result<Option<TimeName>, UnknownTimeUnit> {
    // Both kinds of brackets are common, as in `time [s]` and `Time (ms)`.
    let (name, unit) = match header.split_once(['[', '(']) {
        Some((name, unit)) => (name.trim_end(), unit.trim_end_matches([']', ')']).trim()),
        None => (header, ""),
    };
    let words = name_words(name);
    let bare = words.concat();
    let of = |unit_s: f64| {
        Ok(Some(TimeName {
            name: name.to_owned(),
            unit_s,
        }))
    };
    if NAMES.contains(&&*bare) {
        return match (unit, seconds(unit)) {
            ("", _) => of(1.0),
            (_, Some(unit_s)) => of(unit_s),
            // A wrong unit scales every rate, so an unknown unit is refused and never
            // guessed.
            (_, None) => Err(UnknownTimeUnit(unit.to_owned())),
        };
    }
    // As in `time_ms` and `TimestampNs`.
    let Some((last, before)) = words.split_last() else {
        return Ok(None);
    };
    let unit_s = seconds(last);
    let total = before.concat();
    // `simSeconds` is a time, while `sim` alone may be anything.
    let is_time = NAMES.contains(&&*total) || ["total", "elapsed", "sim"].contains(&&*total);
    match unit_s {
        Some(unit_s) if is_time && unit.is_empty() => of(unit_s),
        _ => Ok(None),
    }
}

/// Returns how usual a name of a time is, the most usual first.
pub fn time_rank(name: &str) -> usize {
    let bare = name_words(name).concat();
    NAMES
        .iter()
        .position(|it| *it == bare)
        .unwrap_or(NAMES.len())
}

/// Returns the seconds in a unit.
fn seconds(unit: &str) -> Option<f64> {
    let unit = unit.to_lowercase();
    let known = UNITS.iter().find(|(names, _)| names.contains(&&*unit));
    known.map(|(_, unit_s)| *unit_s)
}

/// Returns the words of a name in small letters: those of `simTime` and `sim_time`.
pub fn name_words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_small = false;
    for letter in name.chars() {
        // A capital after a capital begins no word, so `TTC` stays whole.
        let is_new = letter.is_uppercase() && was_small;
        if is_new || !letter.is_alphanumeric() {
            words.push(String::new());
        }
        if letter.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(letter.to_lowercase());
        }
        was_small = letter.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_known_by_name_and_unit() {
        for (header, unit_s) in [
            ("time", 1.0),
            ("t", 1.0),
            ("T", 1.0),
            ("Time [s]", 1.0),
            ("timestamp", 1.0),
            ("TimeStamp", 1.0),
            ("time_stamp", 1.0),
            ("sim_time", 1.0),
            ("simTime", 1.0),
            ("Sim Time (s)", 1.0),
            ("time_s", 1.0),
            ("t_sec", 1.0),
            ("seconds", 1.0),
            ("elapsed_s", 1.0),
            ("time [ms]", 1e-3),
            ("time_ms", 1e-3),
            ("timestampNs", 1e-9),
            ("total_nanos", 1e-9),
            ("t(us)", 1e-6),
            ("time [\u{b5}s]", 1e-6),
            ("time [\u{3bc}s]", 1e-6),
            ("header.stamp", 1.0),
        ] {
            let found = time_name(header).expect("a known unit");
            assert_eq!(found.map(|it| it.unit_s), Some(unit_s), "{header}");
        }
        for header in [
            "x",
            "time_gap",
            "ego.speed",
            "ttc",
            "lap_time",
            "s",
            "ms",
            "times_out",
            "ego.time",
        ] {
            assert_eq!(time_name(header), Ok(None), "{header}");
        }
        assert_eq!(time_name("time [h]"), Err(UnknownTimeUnit("h".to_owned())));
    }
}
