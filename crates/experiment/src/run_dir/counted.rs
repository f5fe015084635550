//! Numbers with their nouns, for sentences.

use std::fmt::Display;

/// Endings of nouns whose plural has a syllable more.
const HISSING: [&str; 4] = ["s", "x", "ch", "sh"];

/// Returns a number with its noun: `1 start`, `2 starts`, `2 switches`, `2 tries`.
pub fn counted<N: Display + PartialEq + From<u8>>(count: N, noun: &str) -> String {
    if count == N::from(1) {
        return format!("{count} {noun}");
    }
    // A vowel before the `y` keeps it: `days`.
    let stem = noun.strip_suffix('y');
    match stem.filter(|stem| !stem.ends_with(['a', 'e', 'o', 'u'])) {
        Some(stem) => format!("{count} {stem}ies"),
        None if HISSING.iter().any(|it| noun.ends_with(it)) => format!("{count} {noun}es"),
        None => format!("{count} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular_and_any_other_number_plural() {
        assert_eq!(counted(1_usize, "start"), "1 start");
        assert_eq!(counted(0_u64, "start"), "0 starts");
        assert_eq!(counted(2_u32, "kept crash"), "2 kept crashes");
        assert_eq!(counted(11_usize, "switch"), "11 switches");
        assert_eq!(counted(300_usize, "try"), "300 tries");
        assert_eq!(counted(2_usize, "day"), "2 days");
    }
}
