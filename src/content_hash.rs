//! Texts that hold their own SHA-256, so that a single flipped bit shows, and
//! values by the SHA-256 of their canonical JSON.
//!
//! The hash is of the text with zeros in its place: it is taken, then put
//! there. Whoever changes a sealed text by hand breaks the seal; that is meant.

use serde_json::Value;
use sha2::{Digest, Sha256};

/// Stands where the hash will be; the first of a text is the one meant.
pub(crate) const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Of bytes, in hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    in_digits(Sha256::digest(bytes).as_slice())
}

/// SHA-256 of a value as JSON whose keys are sorted.
///
/// Run directories and caches are identified by it. Names of types, the order of
/// fields and `Debug` do not count, and neither does a field that is not written.
pub(crate) fn fingerprint(value: &Value) -> String {
    let mut sorted = value.clone();
    // A dependency may ask for maps that keep the order of insertion.
    sorted.sort_all_objects();
    sha256(sorted.to_string().as_bytes())
}

/// A hash as hexadecimal digits.
pub(crate) fn in_digits(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The text with its hash in the place of the first [`BLANK`].
pub(crate) fn seal(text: &str) -> String {
    text.replacen(BLANK, &sha256(text.as_bytes()), 1)
}

/// Whether a text is as it was when it was sealed; `hash` is what it holds.
///
/// # Errors
/// It is not, in words.
pub(crate) fn check(text: &str, hash: &str) -> Result<(), String> {
    let blank = text.replacen(hash, BLANK, usize::from(!hash.is_empty()));
    let found = sha256(blank.as_bytes());
    match found == hash {
        true => Ok(()),
        false => Err(format!(
            "it was changed since it was written: SHA-256 is {found}, it says {hash}"
        )),
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
                let hash = text.get(13..77).unwrap_or_default();
                assert!(check(text, hash).is_err(), "bit {bit}: {text}");
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(check("no hash at all", "").is_err());
    }
}
