//! File of a piece: its question, its rows and its hash.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::row::StartRow;
use crate::content_hash::sha256;
use crate::ron_file::file_bytes;
use crate::run_dir::{RunError, make_dir, write_file};

/// Pieces per directory, which keeps directories small.
const PER_DIR: usize = 1000;
/// Directory of the pieces' files.
pub(super) const PIECES: &str = "pieces";

/// First line of a piece.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Heading {
    /// Number in the plan that made it.
    pub piece: usize,
    /// Hash of the question that it answers.
    pub question: String,
    /// Hash of the policy that was trained, or of the trained policy that played.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy_sha256: Option<String>,
}

/// Piece that was read and verified.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PieceText {
    pub heading: Heading,
    /// Rows, a line each.
    pub rows: String,
}

/// Reason that the file of a piece is not used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Unusable {
    Missing,
    /// The file was changed or truncated.
    Damaged(String),
    /// The file answers another question: of another plan, world or version.
    Foreign,
}

/// Returns the path of a piece in the directory of its plan.
pub(super) fn path_of(dir: &Path, number: usize) -> PathBuf {
    dir.join(name_of(number))
}

/// Returns the relative name of a piece, with `/` as separator.
pub(super) fn name_of(number: usize) -> String {
    // Fixed widths, so that files sort by number in listings and globs.
    format!("{PIECES}/{:03}/{number:06}.jsonl", number / PER_DIR)
}

/// Writes a piece atomically.
pub(super) fn write(dir: &Path, heading: &Heading, rows: &[StartRow]) -> Result<(), RunError> {
    let path = path_of(dir, heading.piece);
    let damaged = |error: serde_json::Error| RunError::Damaged {
        path: path.clone(),
        why: error.to_string(),
    };
    let mut text = serde_json::to_string(heading).map_err(damaged)?;
    text.push('\n');
    for row in rows {
        text.push_str(&serde_json::to_string(row).map_err(damaged)?);
        text.push('\n');
    }
    // The hash comes last, so it also detects a truncated file.
    let hash = sha256(text.as_bytes());
    text.push_str(&format!("{}\n", json!({ "sha256": hash })));
    if let Some(dir) = path.parent() {
        make_dir(dir)?;
    }
    write_file(&path, text.as_bytes())
}

/// Reads a piece by number, if it exists, is complete, and answers `question`.
pub(super) fn read(
    dir: &Path,
    number: usize,
    question: &str,
) -> Result<Result<PieceText, Unusable>, RunError> {
    let path = path_of(dir, number);
    // Only an absent file is a missing piece. A piece that cannot be read must not be
    // made again silently.
    let bytes = match file_bytes(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Err(Unusable::Missing));
        }
        Err(source) => {
            return Err(RunError::Io {
                verb: "reading",
                path,
                source,
            });
        }
        Ok(bytes) => bytes,
    };
    Ok(parsed(bytes).and_then(|piece| {
        if piece.heading.question == question {
            Ok(piece)
        } else {
            Err(Unusable::Foreign)
        }
    }))
}

fn parsed(bytes: Vec<u8>) -> Result<PieceText, Unusable> {
    let damaged = |why: &str| Unusable::Damaged(why.to_owned());
    let mut text = String::from_utf8(bytes).map_err(|_| damaged("it is not UTF-8"))?;
    let cut_off = || damaged("it is cut off");
    // A complete file ends with a line break after its hash.
    let body = text.strip_suffix('\n').ok_or_else(cut_off)?;
    let last = body.rfind('\n').ok_or_else(cut_off)? + 1;
    let hash = sha256(&text.as_bytes()[..last]);
    if text[last..] != format!("{}\n", json!({ "sha256": hash })) {
        return Err(damaged("it is not as it was written: its hash is another"));
    }
    // The hash line is removed, so equal rows compare equal.
    text.truncate(last);
    let first = text.find('\n').ok_or_else(cut_off)? + 1;
    let heading = serde_json::from_str(&text[..first])
        .map_err(|error| Unusable::Damaged(error.to_string()))?;
    text.drain(..first);
    Ok(PieceText {
        heading,
        rows: text,
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn every_flipped_bit_and_every_cut_is_noticed() {
        let dir = tempfile::tempdir().expect("scratch");
        let heading = Heading {
            piece: 1003,
            question: "abc".to_owned(),
            policy_sha256: None,
        };
        write(dir.path(), &heading, &[]).expect("written");
        let path = path_of(dir.path(), 1003);
        assert!(path.ends_with("pieces/001/001003.jsonl"), "{path:?}");
        let read = |question| read(dir.path(), 1003, question).expect("readable");
        assert_eq!(read("abc").map(|piece| piece.heading), Ok(heading));
        assert_eq!(read("abd"), Err(Unusable::Foreign));
        let whole = fs::read(&path).expect("there");
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(parsed(bytes).is_err(), "bit {bit}");
        }
        for length in 0..whole.len() {
            assert!(parsed(whole[..length].to_vec()).is_err(), "{length} bytes");
        }
    }
}
