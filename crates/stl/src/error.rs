//! Errors in formulas, with their place and a suggested correction.

use std::fmt::Write as _;
use std::ops::Range;

/// Error in a formula or an expression.
///
/// The message is complete on its own. [`StlError::span`] is the byte range to
/// underline in the text, [`StlError::label`] the words under it, and
/// [`StlError::help`] a correction, where known.
///
/// ```
/// use brakecheck_stl::Formula;
///
/// let text = "always[0, 2] (x => 1)";
/// let error = text.parse::<Formula>().unwrap_err();
/// assert_eq!(&text[error.span()], "1");
/// assert_eq!(error.help(), Some("`=>` is implication; \"at least\" is `>=`"));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", .0.what)]
pub struct StlError(Box<Parts>);

/// Contents of an error, boxed because results pass through a deep recursion.
#[derive(Clone, Debug, PartialEq)]
struct Parts {
    what: String,
    span: Range<usize>,
    label: String,
    help: Option<String>,
    formula: Option<String>,
}

impl StlError {
    pub(crate) fn new(
        what: impl Into<String>,
        span: Range<usize>,
        label: impl Into<String>,
    ) -> StlError {
        StlError(Box::new(Parts {
            what: what.into(),
            span,
            label: label.into(),
            help: None,
            formula: None,
        }))
    }

    pub(crate) fn with_help(mut self, help: impl Into<String>) -> StlError {
        self.0.help = Some(help.into());
        self
    }

    pub(crate) fn maybe_help(self, help: Option<String>) -> StlError {
        match help {
            Some(help) => self.with_help(help),
            None => self,
        }
    }

    /// Records that the span lies in the text of a named formula.
    pub(crate) fn inside(mut self, formula: &str) -> StlError {
        // The innermost formula is recorded first, and the span lies in its text.
        self.0.formula.get_or_insert_with(|| formula.to_owned());
        self
    }

    /// Returns the byte range of the error in the text.
    pub fn span(&self) -> Range<usize> {
        self.0.span.clone()
    }

    /// Returns a few words to write under the span.
    pub fn label(&self) -> &str {
        &self.0.label
    }

    /// Returns a correction, where known.
    pub fn help(&self) -> Option<&str> {
        self.0.help.as_deref()
    }

    /// Returns the named formula that contains the span, `None` for the text itself.
    pub fn formula(&self) -> Option<&str> {
        self.0.formula.as_deref()
    }

    /// Draws the message with a caret under the span, for plain terminals.
    ///
    /// `text` is the text that contains the span (see [`StlError::formula`]).
    pub fn render(&self, text: &str) -> String {
        // The caller may pass another text, so the span is clamped to its characters.
        let start = floor_boundary(text, self.0.span.start);
        let end = floor_boundary(text, self.0.span.end).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |i| start + i);
        let line_number = text[..start].matches('\n').count() + 1;
        // Windows line ends would move the cursor back over the drawn line.
        let line = text[line_start..line_end].trim_end_matches('\r');
        let column = text[line_start..start].chars().count();
        // An empty span, such as the end of the text, still gets a caret.
        let width = text[start..end.min(line_end)].chars().count().max(1);
        let gutter = line_number.to_string();
        let pad = " ".repeat(gutter.len());
        let mut drawn = format!("error: {}\n", self.0.what);
        if let Some(formula) = &self.0.formula {
            let _ = writeln!(drawn, "{pad}--> in `{formula}`");
        }
        // Tabs are repeated, so that the caret is aligned in any terminal.
        let lead: String = text[line_start..start]
            .chars()
            .map(|c| if c == '\t' { '\t' } else { ' ' })
            .collect();
        debug_assert_eq!(lead.chars().count(), column);
        let _ = writeln!(drawn, "{pad} |");
        let _ = writeln!(drawn, "{gutter} | {line}");
        let _ = writeln!(
            drawn,
            "{pad} | {lead}{} {}",
            "^".repeat(width),
            self.0.label
        );
        if let Some(help) = &self.0.help {
            let _ = writeln!(drawn, "{pad} = help: {help}");
        }
        drawn
    }
}

/// Returns the largest character boundary of `text` that is not beyond `at`.
fn floor_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// Suggests the closest known name, then lists the known names.
pub(crate) fn suggest<'a>(
    name: &str,
    kind: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> Option<String> {
    const SHOWN: usize = 12;
    let close = known
        .clone()
        .map(|k| (closeness(name, k), k))
        .filter(|(score, _)| *score >= 0.75)
        // The first of the closest names.
        .reduce(|a, b| if a.0 < b.0 { b } else { a })
        .map(|(_, k)| format!("did you mean {}?", as_typed(k)));
    let count = known.clone().count();
    let mut list = known
        .take(SHOWN)
        .map(as_typed)
        .collect::<Vec<_>>()
        .join(", ");
    if count > SHOWN {
        let _ = write!(list, " and {} more", count - SHOWN);
    }
    let list = (count != 0).then(|| format!("{kind}: {list}"));
    match (close, list) {
        (Some(close), Some(list)) => Some(format!("{close} {list}")),
        (close, list) => close.or(list),
    }
}

/// Returns a name as written in a formula, in double quotes where required.
fn as_typed(name: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '$' | '.');
    if name.chars().all(is_plain) {
        format!("`{name}`")
    } else {
        format!("`\"{name}\"`")
    }
}

fn closeness(name: &str, known: &str) -> f64 {
    // Case is ignored: `Ego.Speed` is a likely slip.
    let (name, known) = (name.to_lowercase(), known.to_lowercase());
    let last = known.rsplit('.').next().unwrap_or(&known);
    // Jaro-Winkler favours a common prefix, the edit distance slips anywhere.
    let whole = strsim::jaro_winkler(&name, &known)
        .max(strsim::normalized_damerau_levenshtein(&name, &known));
    // `speed` probably means `ego.speed`, but an equal name still ranks higher.
    whole.max(if last == name { 0.95 } else { 0.0 })
}
