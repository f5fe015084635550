//! ISO 8601 instants.

use jiff::Timestamp;
use jiff::civil::DateTime;
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

#[cfg(test)]
mod tests {
    use super::*;

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
