//! Numbers as people type them: `300k`, `1_000`, `1.5M`.

use std::ops::RangeInclusive;

use clap::builder::TypedValueParser;

use super::defaults::MOST_JOBS;
use crate::search::MOST_SWITCHES;

/// Default number of starts, the same for every verb.
pub(super) const STARTS: usize = 300;

/// Parser of a number of starts, with its limits.
pub fn start_count() -> impl TypedValueParser<Value = usize> {
    // The limit fits into 32 bits, so the cast truncates nowhere.
    count(1..=10_000_000).map(|count| count as usize)
}

/// Parser of a number of switches of action.
pub(super) fn switch_count() -> impl TypedValueParser<Value = usize> {
    count(0..=MOST_SWITCHES as u64).map(|count| count as usize)
}

/// Parser of a number of threads.
pub(super) fn job_count() -> impl TypedValueParser<Value = u16> {
    count(1..=MOST_JOBS.into()).map(|count| count as u16)
}

/// A whole number in a range.
pub(super) fn count(range: RangeInclusive<u64>) -> impl TypedValueParser<Value = u64> {
    move |text: &str| {
        let (least, most) = (range.start(), range.end());
        let value = whole_number(text).ok_or_else(|| {
            let range = format!("a whole number from {least} to {most}");
            match *most {
                // An example with `k` must itself be allowed.
                300_000.. => format!("{range}, such as 300, 1_000, 300k or 1.5M"),
                _ => range,
            }
        })?;
        if range.contains(&value) {
            Ok(value)
        } else if *most == u64::MAX {
            // `u64::MAX` means no upper limit, so the message names none.
            Err(format!("{value} is less than {least}"))
        } else {
            Err(format!("{value} is not in {least}..={most}"))
        }
    }
}

/// Parses a finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a number above 0, such as 0.25".to_owned()),
    }
}

/// Parses a whole number, also in thousands (`k`) or millions (`M`).
pub(super) fn whole_number(text: &str) -> Option<u64> {
    let plain = text.replace('_', "");
    let (digits, zeros) = match plain.strip_suffix(['k', 'K']) {
        Some(digits) => (digits, 3),
        None => plain
            .strip_suffix('M')
            .map_or((&*plain, 0), |digits| (digits, 6)),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    // "2.0" is a whole number, so zeros at the end do not count as decimals.
    let part = part.trim_end_matches('0');
    // `parse` would accept a sign in front of the digits.
    let sound = |digits: &str| digits.bytes().all(|digit| digit.is_ascii_digit());
    if whole.is_empty() || zeros < part.len() || !sound(whole) || !sound(part) {
        return None;
    }
    // Digits are moved as text, because a float would round large counts.
    format!("{whole}{part}{}", "0".repeat(zeros - part.len()))
        .parse()
        .ok()
}

#[cfg(test)]
mod tests {
    use super::{positive, whole_number};

    #[test]
    fn numbers_that_no_result_can_be_compared_with_are_refused() {
        assert_eq!(positive("1.5"), Ok(1.5));
        for text in ["NaN", "inf", "0", "-1", "", "a"] {
            assert!(positive(text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_read_as_people_type_them() {
        let cases = [
            ("300", Some(300)),
            ("300k", Some(300_000)),
            ("1_000", Some(1000)),
            ("1.5M", Some(1_500_000)),
            ("0.25k", Some(250)),
            ("2.0", Some(2)),
            ("0", Some(0)),
            ("1.5", None),
            ("1.2345k", None),
            ("k", None),
            ("", None),
            ("-3", None),
            ("+3", None),
            ("1e3", None),
            ("3kk", None),
            // The number is greater than any `u64`.
            ("99999999999999999999", None),
        ];
        for (text, expect) in cases {
            assert_eq!(whole_number(text), expect, "{text}");
        }
    }
}
