//! Texts that contain their own SHA-256, and SHA-256 of values as canonical JSON.
//!
//! A single flipped bit of such a text is detected.
//!
//! The hash is computed over the text with zeros in the hash's place and then
//! written there. An edit by hand breaks the seal, which is intended.

use serde_json::Value;
use sha2::{Digest, Sha256};

/// Placeholder for the hash.
pub const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Returns the SHA-256 of bytes in hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    in_digits(Sha256::digest(bytes).as_slice())
}

/// Returns the SHA-256 of a value as JSON with sorted keys.
///
/// It identifies run directories and caches. It does not depend on names of types,
/// the order of fields, `Debug` output or fields that are not serialized.
pub fn fingerprint(value: &Value) -> String {
    let mut sorted = value.clone();
    // A dependency may enable maps in the order of insertion.
    sorted.sort_all_objects();
    sha256(sorted.to_string().as_bytes())
}

/// Formats a digest as hexadecimal digits.
pub(crate) fn in_digits(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the text with its hash in place of the first [`BLANK`].
pub fn seal(text: &str) -> String {
    text.replacen(BLANK, &sha256(text.as_bytes()), 1)
}

/// Returns the text with its hash in place of the last [`BLANK`].
///
/// For texts whose contents come before the hash and may have as many zeros.
pub fn seal_last(text: &str) -> String {
    // A text without a place for the hash stays unsealed, and `check` refuses
    // it.
    let Some((before, after)) = text.rsplit_once(BLANK) else {
        return text.to_owned();
    };
    format!("{before}{}{after}", sha256(text.as_bytes()))
}

/// Checks that a sealed text is unchanged. `hash` is the hash it contains.
///
/// # Errors
/// The text was changed, described in words.
pub fn check(text: &str, hash: &str) -> Result<(), String> {
    // An empty hash would match before every character, so nothing is replaced and
    // the comparison fails.
    let blank = text.replacen(hash, BLANK, usize::from(!hash.is_empty()));
    let found = sha256(blank.as_bytes());
    if found == hash {
        Ok(())
    } else if hash.is_empty() {
        Err("its SHA-256 is missing".to_owned())
    } else {
        Err(format!(
            "it was changed since it was written: SHA-256 is {found}, it says {hash}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fingerprint_depends_on_values_and_on_nothing_else() {
        #[derive(serde::Serialize)]
        struct Before {
            share: f64,
            plant: &'static str,
        }
        // Renamed, fields in another order, and one more that is left out.
        #[derive(serde::Serialize)]
        struct After {
            plant: &'static str,
            #[serde(skip_serializing_if = "Option::is_none")]
            newer: Option<u8>,
            share: f64,
        }
        let before = fingerprint(&serde_json::json!(Before {
            share: 0.15,
            plant: "Rigid",
        }));
        let after = |newer, share| {
            let plant = "Rigid";
            fingerprint(&serde_json::json!(After {
                plant,
                newer,
                share
            }))
        };
        assert_eq!(before, after(None, 0.15));
        assert_ne!(before, after(Some(1), 0.15));
        assert_ne!(before, after(None, 0.150_000_000_000_000_02));
        let text = r#"{"plant":"Rigid","share":0.15}"#;
        assert_eq!(before, sha256(text.as_bytes()));
    }

    #[test]
    fn every_flipped_bit_breaks_the_seal() {
        let sealed = seal(&format!("{{ \"sha256\": \"{BLANK}\", \"seed\": 7 }}"));
        let hash = sealed[13..77].to_owned();
        assert_eq!(check(&sealed, &hash), Ok(()));
        let mut bytes = sealed.clone().into_bytes();
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Ok(text) = std::str::from_utf8(&bytes) {
                // The flip may hit the stored hash itself, so it is read again from the text.
                let hash = text.get(13..77).unwrap_or_default();
                assert!(check(text, hash).is_err(), "bit {bit}: {text}");
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let missing = check("no hash at all", "");
        assert_eq!(missing, Err("its SHA-256 is missing".to_owned()));
    }
}
