//! Splitting of text into tokens.

use std::ops::Range;

use crate::error::StlError;

/// Greatest length of a text, in bytes.
pub(crate) const MAX_TEXT: usize = 64 * 1024;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Token<'a> {
    /// Name, keyword or single-letter operator.
    Word(&'a str),
    /// Name between double quotes or backticks, without them.
    Quoted(&'a str),
    /// Number as written.
    Number(&'a str),
    /// Operator or bracket.
    Symbol(&'static str),
    /// End of the text.
    End,
}

#[derive(Clone, Debug)]
pub(crate) struct Spanned<'a> {
    pub(crate) token: Token<'a>,
    pub(crate) span: Range<usize>,
}

/// Symbols. Longer symbols come before their prefixes.
const SYMBOLS: [&str; 39] = [
    "!==", "===", "<->", "<=>", "&&", "||", "/\\", "\\/", "->", "=>", "<=", ">=", "==", "!=", "<>",
    "[]", "≤", "≥", "≠", "¬", "∧", "∨", "→", "↔", "□", "◇", "+", "-", "*", "/", "<", ">", "!", "~",
    "&", "|", "(", ")", "[",
];
const MORE: [&str; 3] = ["]", ",", ":"];

pub(crate) fn tokenize(text: &str) -> Result<Vec<Spanned<'_>>, StlError> {
    // First, because the memory of every later step grows with the text.
    if text.len() > MAX_TEXT {
        return Err(StlError::new(
            format!(
                "the text is {} bytes long; the limit is {MAX_TEXT}",
                text.len()
            ),
            0..0,
            "too long",
        )
        .with_help("split it into named formulas"));
    }
    let mut tokens = Vec::with_capacity(text.len() / 3 + 1);
    let mut at = 0;
    loop {
        at = skip_blank(text, at)?;
        let rest = &text[at..];
        let Some(first) = rest.chars().next() else {
            tokens.push(Spanned {
                token: Token::End,
                span: at..at,
            });
            return Ok(tokens);
        };
        let (token, len) = if is_name_start(first) {
            let len = name_len(rest);
            (Token::Word(&rest[..len]), len)
        } else if first.is_ascii_digit()
            // A leading point starts a number only if a digit follows.
            || (first == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit()))
        {
            let len = number_len(rest);
            (Token::Number(&rest[..len]), len)
        } else if first == '"' || first == '`' {
            let Some(len) = rest[1..]
                .find(first)
                // A quote that spans lines is far more likely never closed.
                .filter(|len| !rest[1..=*len].contains('\n'))
            else {
                return Err(StlError::new(
                    "this quoted name is never closed",
                    at..at + 1,
                    "opened here",
                ));
            };
            (Token::Quoted(&rest[1..=len]), len + 2)
        } else if let Some(symbol) = SYMBOLS.iter().chain(&MORE).find(|s| rest.starts_with(**s)) {
            (Token::Symbol(symbol), symbol.len())
        } else {
            return Err(unknown_character(first, at));
        };
        tokens.push(Spanned {
            token,
            span: at..at + len,
        });
        at += len;
    }
}

/// Skips white space and the comments `# …`, `// …` and `/* … */`.
fn skip_blank(text: &str, mut at: usize) -> Result<usize, StlError> {
    loop {
        let rest = &text[at..];
        let blank = rest.len()
            - rest
                // Files of some editors begin with a byte order mark.
                .trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}')
                .len();
        if blank != 0 {
            at += blank;
        } else if rest.starts_with('#') || rest.starts_with("//") {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if let Some(comment) = rest.strip_prefix("/*") {
            match comment.find("*/") {
                Some(end) => at += end + 4,
                None => {
                    return Err(StlError::new(
                        "this comment is never closed",
                        at..at + 2,
                        "opened here",
                    )
                    .with_help("close it with `*/`"));
                }
            }
        } else {
            return Ok(at);
        }
    }
}

fn is_name_start(c: char) -> bool {
    c.is_alphabetic() || c == '_' || c == '$'
}

fn is_name_part(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '$'
}

/// Returns the length of a name, which may have dots inside but not at its end.
fn name_len(rest: &str) -> usize {
    let mut len = 0;
    loop {
        let part = &rest[len..];
        len += part.find(|c| !is_name_part(c)).unwrap_or(part.len());
        let mut next = rest[len..].chars();
        if next.next() != Some('.') || !next.next().is_some_and(is_name_part) {
            return len;
        }
        len += 1;
    }
}

fn number_len(rest: &str) -> usize {
    let digits = |from: usize| {
        rest[from..]
            .find(|c: char| !c.is_ascii_digit())
            .map_or(rest.len(), |n| from + n)
    };
    let mut len = digits(0);
    if rest[len..].starts_with('.') {
        len = digits(len + 1);
    }
    // Without digits behind it, `e` is the start of a name.
    if rest[len..].starts_with(['e', 'E']) {
        let sign = usize::from(rest[len + 1..].starts_with(['+', '-']));
        let end = digits(len + 1 + sign);
        if len + 1 + sign < end {
            len = end;
        }
    }
    len
}

/// Returns true if `name` is valid without quotes, keywords aside.
pub(crate) fn is_plain_name(name: &str) -> bool {
    name.starts_with(is_name_start) && name_len(name) == name.len()
}

fn unknown_character(c: char, at: usize) -> StlError {
    let span = at..at + c.len_utf8();
    let error = StlError::new(
        format!("{c:?} has no meaning in a formula"),
        span,
        "unexpected character",
    );
    // Slips from other languages get an answer of their own.
    match c {
        '=' => error.with_help("equality is `==`, implication is `->` or `implies`"),
        '^' => error.with_help("a power is `pow(x, 2)`"),
        '%' | '@' | '?' | '\'' => {
            error.with_help("a name with such characters is written between double quotes")
        }
        '{' | '}' => error.with_help("group with `(` and `)`, bound with `[` and `]`"),
        ';' => error.with_help("one text holds one formula; join several with `and`"),
        _ => error,
    }
}
