//! Short texts of numbers.

/// Number with at most `places` decimals, without trailing zeros.
pub(super) fn n(value: f64, places: usize) -> String {
    let fixed = format!("{value:.places$}");
    let text = if fixed.contains('.') {
        fixed.trim_end_matches('0').trim_end_matches('.')
    } else {
        &fixed
    };
    match text {
        // A small negative number rounds to −0.
        "-0" => "0".to_owned(),
        _ => text.to_owned(),
    }
}

/// List of numbers as JSON.
pub(super) fn list(values: &[f64], places: usize) -> String {
    let values = values.iter().map(|value| n(*value, places));
    format!("[{}]", values.collect::<Vec<_>>().join(","))
}
