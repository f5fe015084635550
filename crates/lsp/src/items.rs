//! Completions: fields, variants, names and words.

use std::ops::Range;

use crate::language::KnownName;
use crate::shapes::VariantShape;

/// Words of formulas, with their meaning.
pub const FORMULA_WORDS: [(&str, &str); 9] = [
    ("always", "at every sample of `[from, to]`"),
    ("eventually", "at some sample of `[from, to]`"),
    ("until", "the left side, until the right side"),
    ("and", "both"),
    ("or", "one of both"),
    ("implies", "the right side wherever the left side"),
    ("not", "the opposite"),
    ("abs", "absolute value"),
    ("T", "end of the episode"),
];
/// Kind of a completion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ItemKind {
    /// Field of a struct.
    Field,
    /// Variant of an enum.
    Variant,
    /// Name that a world declares.
    Name,
    /// Word of the language.
    Word,
}

/// Completion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Name that the list shows.
    pub label: String,
    /// Kind.
    pub kind: ItemKind,
    /// Type or unit.
    pub detail: String,
    /// Explanation.
    pub about: String,
    /// Text to insert before the cursor.
    pub before: String,
    /// Text to insert behind it.
    pub behind: &'static str,
}

/// Completions, with the bytes that they replace.
#[derive(Debug, PartialEq, Eq)]
pub struct Completions {
    /// Bytes to replace.
    pub span: Range<usize>,
    /// Completions.
    pub items: Vec<Item>,
}

/// Returns the completion of a variant.
pub fn variant_item(variant: &VariantShape<'_>) -> Item {
    let (before, behind) = match variant.content {
        Some(_) => (format!("{}(", variant.name), ")"),
        None => (variant.name.to_owned(), ""),
    };
    Item {
        label: variant.name.to_owned(),
        kind: ItemKind::Variant,
        detail: String::new(),
        about: variant.about.to_owned(),
        before,
        behind,
    }
}

/// Returns the completion of a declared name.
pub fn name_item(name: &KnownName) -> Item {
    Item {
        label: name.name.clone(),
        kind: ItemKind::Name,
        detail: name.unit.clone(),
        about: name.about.clone(),
        before: name.name.clone(),
        behind: "",
    }
}

/// Returns the completion of a word.
pub fn word_item(word: &str, about: &str) -> Item {
    Item {
        label: word.to_owned(),
        kind: ItemKind::Word,
        detail: String::new(),
        about: about.to_owned(),
        before: word.to_owned(),
        behind: "",
    }
}
