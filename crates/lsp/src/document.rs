//! Open document: its text, and places in the units of the protocol.
//!
//! The protocol counts lines from 0 and columns in UTF-16 code units. Rust counts bytes.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Place in a document, as the protocol counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct TextPosition {
    /// Line, from 0.
    pub line: u32,
    /// UTF-16 code units before it in its line.
    pub character: u32,
}

/// Range of a document, without its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TextRange {
    /// First place.
    pub start: TextPosition,
    /// Place behind the last.
    pub end: TextPosition,
}

/// Edit of a document: new text in place of a range, or of all.
#[derive(Clone, Debug, Deserialize)]
pub struct TextChange {
    /// Replaced range. Without it, all of the text.
    pub range: Option<TextRange>,
    /// New text.
    pub text: String,
}

/// Text of an open document, with the starts of its lines.
#[derive(Clone, Debug)]
pub struct Document {
    text: String,
    line_starts: Vec<usize>,
}

impl Document {
    /// Returns a document of a text.
    pub fn new(text: String) -> Document {
        let line_starts = line_starts(&text);
        Document { text, line_starts }
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Carries out an edit. A place beyond a line or the text is its end.
    pub fn apply(&mut self, change: TextChange) {
        let Some(range) = change.range else {
            // The line starts belong to the old text.
            *self = Document::new(change.text);
            return;
        };
        let start = self.offset(range.start);
        // A reversed range of a wrong client would panic below.
        let end = self.offset(range.end).max(start);
        let mut text = std::mem::take(&mut self.text);
        text.replace_range(start..end, &change.text);
        *self = Document::new(text);
    }

    /// Returns the byte of a place, which is always between two characters.
    pub fn offset(&self, at: TextPosition) -> usize {
        let line = at.line as usize;
        let Some(&start) = self.line_starts.get(line) else {
            return self.text.len();
        };
        let next = self.line_starts.get(line + 1);
        let end = next.map_or(self.text.len(), |next| *next);
        // A column beyond the line must not reach into the next one.
        let words = self.text[start..end].trim_end_matches(['\r', '\n']);
        let mut units = at.character as usize;
        for (i, c) in words.char_indices() {
            // A place between two surrogates counts as that before the character.
            if units < c.len_utf16() {
                return start + i;
            }
            units -= c.len_utf16();
        }
        start + words.len()
    }

    /// Returns the place of a byte.
    pub fn position(&self, at: usize) -> TextPosition {
        // A span of the checked text may end within a character of this one.
        let byte = self.text.floor_char_boundary(at);
        // Invariant: the first line starts at 0, so one start is at or before the byte.
        let line = self.line_starts.partition_point(|start| *start <= byte) - 1;
        let before = &self.text[self.line_starts[line]..byte];
        TextPosition {
            line: line as u32,
            character: before.encode_utf16().count() as u32,
        }
    }

    /// Returns the range of bytes.
    pub fn span(&self, bytes: Range<usize>) -> TextRange {
        TextRange {
            start: self.position(bytes.start),
            end: self.position(bytes.end.max(bytes.start)),
        }
    }
}

/// Starts of the lines, which end in `\n`, `\r\n` or `\r`.
fn line_starts(text: &str) -> Vec<usize> {
    let bytes = text.as_bytes();
    let ends = |i: &usize| match bytes[*i] {
        b'\n' => true,
        // The pair `\r\n` is one end of a line.
        b'\r' => bytes.get(i + 1) != Some(&b'\n'),
        _ => false,
    };
    let after = (0..bytes.len()).filter(ends).map(|i| i + 1);
    std::iter::once(0).chain(after).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(line: u32, character: u32) -> TextPosition {
        TextPosition { line, character }
    }

    #[test]
    fn columns_are_utf16_code_units() {
        let document = Document::new("aé𝄞b\r\nc\rd\n".to_owned());
        let cases = [
            (at(0, 1), 1),
            (at(0, 2), 3),
            (at(0, 3), 3),
            (at(0, 4), 7),
            (at(0, 99), 8),
            (at(1, 0), 10),
            (at(2, 1), 13),
            (at(3, 0), 14),
            (at(9, 9), 14),
        ];
        for (place, byte) in cases {
            assert_eq!(document.offset(place), byte, "{place:?}");
        }
        assert_eq!(document.position(7), at(0, 4));
        assert_eq!(document.position(5), at(0, 2));
        assert_eq!(document.position(12), at(2, 0));
        assert_eq!(document.position(999), at(3, 0));
    }

    #[test]
    fn edits_replace_a_range_or_all() {
        let mut document = Document::new("one\ntwo 𝄞 three\n".to_owned());
        let range = TextRange {
            start: at(1, 4),
            end: at(1, 6),
        };
        let change = |range, text: &str| TextChange {
            range,
            text: text.to_owned(),
        };
        document.apply(change(Some(range), "and\n"));
        assert_eq!(document.text(), "one\ntwo and\n three\n");
        let backwards = TextRange {
            start: at(9, 9),
            end: at(0, 0),
        };
        document.apply(change(Some(backwards), "end"));
        assert_eq!(document.text(), "one\ntwo and\n three\nend");
        document.apply(change(None, "new"));
        assert_eq!(document.text(), "new");
    }
}
