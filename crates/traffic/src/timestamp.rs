//! ISO 8601 instants.

/// Returns the seconds from 1970 to an ISO 8601 instant, as whole seconds and a rest.
///
/// The rest keeps its nanoseconds, which one f64 for both would lose. Date and time are
/// separated by `T` or a blank. An offset such as `+02:00` or `Z` is optional.
pub(crate) fn parse_iso(text: &str) -> Option<(i64, f64)> {
    let bytes = text.as_bytes();
    let is_at = |at: usize, one_of: &[u8]| bytes.get(at).is_some_and(|byte| one_of.contains(byte));
    if !text.is_ascii() || !is_at(4, b"-") || !is_at(7, b"-") || !is_at(10, b"T ") {
        return None;
    }
    let (year, month, day) = (
        number(text, 0, 4)?,
        number(text, 5, 7)?,
        number(text, 8, 10)?,
    );
    if !is_at(13, b":") || !is_at(16, b":") {
        return None;
    }
    let (hour, minute) = (number(text, 11, 13)?, number(text, 14, 16)?);
    let second = number(text, 17, 19)?;
    // Second 60 is a leap second.
    let is_valid = (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && hour < 24
        && minute < 60
        && second <= 60;
    if !is_valid {
        return None;
    }
    let rest = &text[19..];
    let digits = match rest.strip_prefix(['.', ',']) {
        Some(after) => 1 + after.bytes().take_while(u8::is_ascii_digit).count(),
        None => 0,
    };
    if digits == 1 {
        return None;
    }
    let fraction = match digits {
        0 => 0.0,
        _ => format!("0.{}", &rest[1..digits]).parse().ok()?,
    };
    let offset_s = offset(&rest[digits..])?;
    let whole = days(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second;
    Some((whole - offset_s, fraction))
}

/// Returns the seconds by which a local time is ahead of UTC.
fn offset(text: &str) -> Option<i64> {
    if matches!(text, "" | "Z" | "z") {
        return Some(0);
    }
    let sign = match text.as_bytes()[0] {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let digits: String = text[1..].chars().filter(|it| *it != ':').collect();
    let hours = number(&digits, 0, 2)?;
    let minutes = match digits.len() {
        2 => 0,
        4 => number(&digits, 2, 4)?,
        _ => return None,
    };
    Some(sign * (hours * 3600 + minutes * 60))
}

fn number(text: &str, from: usize, to: usize) -> Option<i64> {
    let digits = text.get(from..to)?;
    let is_number = digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

/// Returns the days from 1970-01-01 in the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // The year begins in March, so that the leap day is its last.
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year - era * 400;
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    era * 146_097 + day_of_era - 719_468
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
