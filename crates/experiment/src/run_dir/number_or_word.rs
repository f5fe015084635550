//! Numbers in JSON, which has no infinities.

use serde_json::Value;

/// Returns a number, or the word "inf" or "-inf" of an infinity.
///
/// NaN is `null`, because an unknown value must not look like a certain failure.
pub fn number_or_word(value: f64) -> Value {
    if value.is_infinite() {
        let word = if value > 0.0 { "inf" } else { "-inf" };
        return word.into();
    }
    value.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_number_is_null_and_an_infinite_one_a_word() {
        let words = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.5].map(number_or_word);
        let expect = serde_json::json!([null, "inf", "-inf", -0.5]);
        assert_eq!(serde_json::json!(words), expect);
    }
}
