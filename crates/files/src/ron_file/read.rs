//! RON reader whose errors state the place and the fix.

use std::io::Read;
use std::ops::Range;
use std::path::Path as FilePath;

use ron::error::{Error, Position, SpannedError};
use ron::extensions::Extensions;
use serde::de::DeserializeOwned;

use super::error::{LoadError, Problem, ScenarioError, did_you_mean, known_names, nearest};
use super::locate::first_non_finite;
use super::named_file::open_file;

/// Greatest size of a world file, in bytes.
const MAX_BYTES: u64 = 4 << 20;

/// Reads a text file of limited size in UTF-8.
pub fn text(file: &str, path: &FilePath) -> Result<String, LoadError> {
    let io = |source| LoadError::Io {
        file: file.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    let opened = open_file(path).map_err(io)?;
    // One byte more than allowed suffices to notice a larger file.
    let mut limited = opened.take(MAX_BYTES + 1);
    limited.read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_BYTES {
        let what = format!("it is larger than the {MAX_BYTES} bytes a world file may have");
        return Err(io(std::io::Error::other(what)));
    }
    String::from_utf8(bytes).map_err(|error| {
        // The valid part is kept, so that the error can show the place.
        let at = error.utf8_error().valid_up_to();
        let bytes = error.into_bytes();
        let text = String::from_utf8_lossy(&bytes[..at]).into_owned();
        LoadError::Scenario(Box::new(ScenarioError {
            file: file.to_owned(),
            problems: vec![Problem {
                what: format!("byte {at} is not UTF-8"),
                span: text.len().saturating_sub(1)..text.len(),
                label: "after this".to_owned(),
                help: Some("save the file as UTF-8 text".to_owned()),
            }],
            text,
        }))
    })
}

/// Reads a RON file that is not a world.
///
/// Returns its name, its text and its content.
///
/// # Errors
///
/// Returns an error if the file cannot be read, or has other content.
pub fn read_file<T: DeserializeOwned>(path: &FilePath) -> Result<(String, String, T), LoadError> {
    let file = path.display().to_string();
    // Without the mark, so that positions count as in an editor.
    let text = without_mark(&text(&file, path)?).to_owned();
    match parse(&text) {
        Ok(value) => Ok((file, text, value)),
        Err(problem) => Err(LoadError::Scenario(Box::new(ScenarioError {
            file,
            text,
            problems: vec![problem],
        }))),
    }
}

/// Removes the byte order mark that some editors write.
pub fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Mistake at which the reader stops.
pub(super) struct Stop {
    pub(super) problem: Problem,
    /// Name that is probably meant, if the mistake is a name.
    pub(super) meant: Option<&'static str>,
    /// True if a field is given twice.
    pub(super) is_repeated: bool,
}

/// Reads a value from RON with finite numbers only.
pub fn parse<T: DeserializeOwned>(text: &str) -> Result<T, Problem> {
    parse_until(text).map_err(|stop| stop.problem)
}

/// Reads a value from RON, up to the first mistake.
pub(super) fn parse_until<T: DeserializeOwned>(text: &str) -> Result<T, Stop> {
    // Files may omit `Some` and the inner brackets of variants, so that they
    // are shorter.
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
    let value = options.from_str(text).map_err(|error| {
        let problem = problem(text, &error);
        let meant = meant(&error.code).filter(|_| is_name(text, &problem.span, &error.code));
        Stop {
            problem,
            meant,
            is_repeated: matches!(error.code, Error::DuplicateStructField { .. }),
        }
    })?;
    // The reader accepts numbers that are not finite, and worlds must not
    // contain them.
    match first_non_finite(text) {
        Some(span) => Err(Stop {
            problem: Problem {
                what: format!("`{}` is not a finite number", &text[span.clone()]),
                span,
                label: "must be finite".to_owned(),
                help: Some("write an ordinary number, such as 1.0e6".to_owned()),
            },
            meant: None,
            is_repeated: false,
        }),
        None => Ok(value),
    }
}

/// Returns whether a place is that of the whole name of an error.
fn is_name(text: &str, span: &Range<usize>, code: &Error) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let is_whole = !text[..span.start].ends_with(is_part) && !text[span.end..].starts_with(is_part);
    is_whole && culprit(code) == Some(&text[span.clone()])
}

/// Returns the known name that is closest to an unknown one.
fn meant(code: &Error) -> Option<&'static str> {
    match code {
        Error::NoSuchStructField {
            expected, found, ..
        }
        | Error::NoSuchEnumVariant {
            expected, found, ..
        } => nearest(found, expected.iter().copied()),
        _ => None,
    }
}

fn problem(text: &str, error: &SpannedError) -> Problem {
    let start = offset(text, error.span.start);
    // A reversed span would panic in a slice.
    let end = offset(text, error.span.end).max(start);
    let (what, label, help) = explain(&error.code);
    let mut span = match error.code {
        // If a comma or an end is missing, the value before it is marked.
        Error::ExpectedComma | Error::ExpectedMapColon | Error::Eof => token(text, start, start),
        // The reader's span of a wrong text begins behind its first quote.
        Error::InvalidValueForType { .. } if text[..start].ends_with('"') => {
            next_token(text, start - 1)
        }
        _ if shape(&error.code).is_some() => next_token(text, start),
        _ => token(text, start, end),
    };
    // Before the general places, because a name is the most precise one.
    if let Some(found) = culprit(&error.code) {
        // The reader's span is around the name, but not always on it.
        let margin = found.len() + 8;
        // The margins may split a character, which is no valid place for a
        // slice.
        let from = (start.saturating_sub(margin)..=start)
            .find(|&i| text.is_char_boundary(i))
            .unwrap_or(start);
        let to = ((end + margin).min(text.len())..=text.len())
            .find(|&i| text.is_char_boundary(i))
            .unwrap_or(end);
        if let Some(at) = text[from..to].find(found) {
            span = from + at..from + at + found.len();
        }
    }
    let what = match shape(&error.code).zip(field_before(text, span.start)) {
        Some(((shape, _), field)) => format!("`{field}` requires {shape}"),
        None => what,
    };
    Problem {
        what,
        span,
        label,
        help,
    }
}

/// Field whose value begins at an offset, if a field is written right before it.
fn field_before(text: &str, at: usize) -> Option<&str> {
    let before = text.get(..at)?.trim_end().strip_suffix(':')?.trim_end();
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let name = &before[before.trim_end_matches(is_part).len()..];
    (!name.is_empty()).then_some(name)
}

/// Name in the file that an error concerns.
fn culprit(code: &Error) -> Option<&str> {
    match code {
        Error::NoSuchStructField { found, .. } | Error::NoSuchEnumVariant { found, .. } => {
            Some(found)
        }
        Error::DuplicateStructField { field, .. } => Some(field),
        _ => None,
    }
}

/// Expected shape of a value, and its notation.
fn shape(code: &Error) -> Option<(String, String)> {
    let (what, how) = match code {
        Error::ExpectedArray => ("a list", "lists are written `[a, b]`"),
        Error::ExpectedMap => ("a map", "maps are written `{ \"name\": value }`"),
        Error::ExpectedString => ("a text", "texts stand in quotes: `\"ego\"`"),
        Error::ExpectedFloat => ("a number", "numbers are written `3.0`"),
        Error::ExpectedInteger => ("a whole number", "whole numbers are written `3`"),
        Error::ExpectedIdentifier => (
            "a kind",
            "there are several kinds of this, so its name comes first: `At(x_m: 0.0, …)`",
        ),
        Error::ExpectedStructLike => ("`(…)`", "fields stand in brackets: `(name: value, …)`"),
        // The text is that of `NumberOrRange`.
        Error::InvalidValueForType { expected, .. } if expected.starts_with("a number such") => (
            "a number or a range",
            "numbers are written `3.0`, and ranges `(3.0, 5.0)`",
        ),
        Error::ExpectedNamedStructLike(name) if !name.is_empty() => {
            let how = format!("write `{name}(name: value, …)`");
            return Some((format!("`{name}(…)`"), how));
        }
        _ => return None,
    };
    Some((what.to_owned(), how.to_owned()))
}

fn explain(code: &Error) -> (String, String, Option<String>) {
    if let Some((what, how)) = shape(code) {
        return (
            format!("{what} is expected"),
            format!("not {what}"),
            Some(how),
        );
    }
    match code {
        Error::NoSuchStructField {
            expected,
            found,
            outer,
        } => {
            let of = outer
                .as_ref()
                .map_or(String::new(), |o| format!(" in `{o}`"));
            let known = known_names("fields", expected.iter().copied());
            let help = match did_you_mean(found, expected.iter().copied()) {
                Some(guess) => format!("{guess} — {known}"),
                None => known,
            };
            (
                format!("unknown field `{found}`{of}"),
                "not a field here".to_owned(),
                Some(help),
            )
        }
        Error::NoSuchEnumVariant {
            expected, found, ..
        } => {
            let known = known_names("one of", expected.iter().copied());
            let help = match did_you_mean(found, expected.iter().copied()) {
                Some(guess) => format!("{guess} — {known}"),
                None => known,
            };
            (
                format!("`{found}` is not known here"),
                "not known".to_owned(),
                Some(help),
            )
        }
        Error::MissingStructField { field, outer } => {
            let of = outer
                .as_ref()
                .map_or(String::new(), |o| format!(" of `{o}`"));
            (
                format!("the field `{field}`{of} is missing"),
                "the block that ends here lacks it".to_owned(),
                Some(format!("add `{field}: …`")),
            )
        }
        Error::DuplicateStructField { field, .. } => (
            format!("the field `{field}` is given twice"),
            "second time".to_owned(),
            Some("keep one of them".to_owned()),
        ),
        Error::ExpectedComma => (
            "a comma is missing".to_owned(),
            "after this".to_owned(),
            Some("separate values with `,`".to_owned()),
        ),
        Error::ExpectedMapColon => (
            "a colon is missing".to_owned(),
            "after this".to_owned(),
            Some("write `\"name\": value`".to_owned()),
        ),
        Error::Eof => (
            "the file ends too early".to_owned(),
            "it ends here".to_owned(),
            Some("close what is open: `)`, `]`, `}` or `\"`".to_owned()),
        ),
        Error::ExceededRecursionLimit => (
            "the file is nested too deeply".to_owned(),
            "here".to_owned(),
            Some("worlds need fewer than 128 levels".to_owned()),
        ),
        Error::ExpectedStringEnd => (
            "a text does not end".to_owned(),
            "it goes on to the end of the file".to_owned(),
            Some("close it with `\"`".to_owned()),
        ),
        Error::ExpectedDifferentStructName { expected, found } => (
            format!("`{expected}(…)` is expected here, not `{found}(…)`"),
            "another kind of file".to_owned(),
            Some(format!("name a file that begins with `{expected}(`")),
        ),
        other => (first_lower(&other.to_string()), "here".to_owned(), None),
    }
}

fn first_lower(message: &str) -> String {
    let mut chars = message.chars();
    // Acronyms such as `EOF` keep their capitals.
    let second_lower = message.chars().nth(1).is_none_or(|c| !c.is_uppercase());
    match chars.next() {
        Some(first) if second_lower => first.to_lowercase().chain(chars).collect(),
        _ => message.to_owned(),
    }
}

/// Byte offset of a line and column, both counted from 1 in characters.
fn offset(text: &str, position: Position) -> usize {
    let line_start: usize = text
        .split_inclusive('\n')
        .take(position.line.saturating_sub(1))
        .map(str::len)
        .sum();
    let line = &text[line_start.min(text.len())..];
    let column: usize = line
        .chars()
        .take(position.col.saturating_sub(1))
        .map(char::len_utf8)
        .sum();
    (line_start + column).min(text.len())
}

/// Token that begins at or after a position.
fn next_token(text: &str, start: usize) -> std::ops::Range<usize> {
    let blank = |c: char| c.is_whitespace() || c == ',';
    let rest = text[start..].trim_start_matches(blank);
    let from = text.len() - rest.len();
    let is_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '-' | '+');
    let word: usize = rest
        .chars()
        .take_while(|c| is_word(*c))
        .map(char::len_utf8)
        .sum();
    let quoted = rest.strip_prefix('"').and_then(|inner| inner.find('"'));
    match (word, quoted, rest.chars().next()) {
        (0, Some(end), _) => from..from + end + 2,
        (0, None, Some(c)) => from..from + c.len_utf8(),
        (0, None, None) => token(text, start, start),
        (length, ..) => from..from + length,
    }
}

/// Visible piece of text at or before the reader's span.
fn token(text: &str, start: usize, end: usize) -> std::ops::Range<usize> {
    let piece = text[start..end].trim();
    if !piece.is_empty() && !piece.contains('\n') {
        let lead = text[start..end].len() - text[start..end].trim_start().len();
        return start + lead..start + lead + piece.len();
    }
    // Without visible text in the span, the last character before it is marked.
    let before = text[..start].trim_end();
    let from = before.char_indices().next_back().map_or(0, |(i, _)| i);
    if before.is_empty() {
        // An empty text still needs a place to mark.
        0..text.len().min(1)
    } else {
        from..before.len()
    }
}
