//! ISO 8601 instants.

use jiff::Timestamp;
use jiff::civil::{Date, DateTime};
use jiff::tz::TimeZone;

/// Returns the seconds from 1970 to an ISO 8601 instant, as whole seconds and a rest.
///
/// The rest keeps its nanoseconds, which one f64 for both would lose. Date and time are
/// separated by `T` or a blank. An offset such as `+02:00` or `Z` is optional.
pub fn parse_iso(text: &str) -> Option<(i64, f64)> {
    // A date alone is no instant.
    if !text.contains(':') {
        return None;
    }
    // Without an offset, an instant counts as one of UTC.
    let in_utc = || {
        let civil: DateTime = text.parse().ok()?;
        Some(civil.to_zoned(TimeZone::UTC).ok()?.timestamp())
    };
    let instant = text.parse::<Timestamp>().ok().or_else(in_utc)?;
    let rest = f64::from(instant.subsec_nanosecond()) / 1e9;
    Some((instant.as_second(), rest))
}

/// Returns the range of the month or the day of a date that does not exist.
///
/// `None`: the date exists, or the text does not begin with one.
pub fn calendar_range(text: &str) -> Option<String> {
    let mut parts = text.trim().get(..10)?.splitn(3, '-');
    let mut number = || parts.next()?.parse::<i16>().ok();
    let (year, month, day) = (number()?, number()?, number()?);
    if !(1..=12).contains(&month) {
        return Some("a year has the months 1 to 12".to_owned());
    }
    let first = Date::new(year, i8::try_from(month).ok()?, 1).ok()?;
    let days = first.days_in_month();
    let exists = (1..=i16::from(days)).contains(&day);
    (!exists).then(|| format!("{year}-{month:02} has the days 1 to {days}"))
}

/// Returns [`calendar_range`] as the end of a message, empty if the date exists.
pub fn because_of_calendar(text: &str) -> String {
    calendar_range(text).map_or(String::new(), |range| format!(": {range}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_date_that_does_not_exist_names_the_days_of_its_month() {
        for (text, range) in [
            ("2024-02-30T00:00:00", Some("2024-02 has the days 1 to 29")),
            ("2023-02-29 00:00:00Z", Some("2023-02 has the days 1 to 28")),
            ("2024-04-00T00:00:00", Some("2024-04 has the days 1 to 30")),
            ("2024-13-01T00:00:00", Some("a year has the months 1 to 12")),
            ("2024-02-29T00:00:00", None),
            ("12345678901234567890", None),
            ("0.1", None),
            ("äöüäöüäöüäöü", None),
        ] {
            assert_eq!(calendar_range(text).as_deref(), range, "{text}");
        }
    }

    #[test]
    fn instants_count_from_1970_in_utc() {
        for (text, seconds, rest) in [
            ("1970-01-01T00:00:00Z", 0, 0.0),
            ("2024-10-07 06:00:00.004659+00:00", 1_728_280_800, 0.004_659),
            ("2024-02-29T23:59:59.5", 1_709_251_199, 0.5),
            ("2000-03-01T00:00:00+01:00", 951_865_200, 0.0),
            ("2000-03-01T00:00:00-0130", 951_874_200, 0.0),
            ("1999-12-31T23:59:59,25Z", 946_684_799, 0.25),
        ] {
            assert_eq!(parse_iso(text), Some((seconds, rest)), "{text}");
        }
    }

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "",
            "12.5",
            "2024-10-07",
            "07.10.2024 06:00:00",
            "2024-13-07T06:00:00",
            "2024-10-07T24:00:00",
            "2024-10-07T06:00:00.",
            "2024-10-07T06:00:00 UTC",
            "2024-10-07T06:00:00+1",
            "2024-1-007T06:00:00",
        ] {
            assert_eq!(parse_iso(text), None, "{text}");
        }
    }
}
