//! Median of numbers.

/// Returns the median, of an even number the greater middle value, `None` without values.
pub(crate) fn median(mut values: impl AsMut<[f64]>) -> Option<f64> {
    let values = values.as_mut();
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
