//! Place of a value in a RON text, found by its path.
//!
//! The RON reader reports positions of syntax errors only. Checks after reading
//! name a value by its path, and this module finds its bytes.

use std::fmt;
use std::ops::Range;

/// Step into a RON value.
#[derive(Clone, Debug, PartialEq, Eq)]
enum ValueStep {
    /// Field of a struct, or value under a key of a map.
    Name(String),
    /// Element of a list or tuple.
    Index(usize),
}

/// Path from the top of a file to a value, such as `agents[1].start`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ValuePath(Vec<ValueStep>);

impl ValuePath {
    /// Returns the path of the file's top value.
    pub fn top() -> ValuePath {
        ValuePath::default()
    }

    /// Returns the path of a field, or of the value under a key.
    pub fn to(&self, name: &str) -> ValuePath {
        self.with(ValueStep::Name(name.to_owned()))
    }

    /// Returns the path of an element of a list or tuple.
    pub fn at(&self, index: usize) -> ValuePath {
        self.with(ValueStep::Index(index))
    }

    fn with(&self, step: ValueStep) -> ValuePath {
        let mut steps = self.0.clone();
        steps.push(step);
        ValuePath(steps)
    }

    /// Returns the bytes of the value in `text`, or of its innermost existing parent.
    pub fn find(&self, text: &str) -> Range<usize> {
        // Shorter paths come next: a missing field is shown at the struct that
        // lacks it.
        for depth in (0..=self.0.len()).rev() {
            let mut cursor = RonCursor { text, at: 0 };
            if let Some(range) = cursor.find(&self.0[..depth]) {
                return range;
            }
        }
        0..0
    }
}

impl fmt::Display for ValuePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                ValueStep::Name(name) if i == 0 => write!(f, "{name}")?,
                ValueStep::Name(name) => write!(f, ".{name}")?,
                ValueStep::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// Finds a number in a RON text that is not finite: `NaN`, `inf`, `1e999`.
///
/// The RON reader accepts such numbers, and worlds must not contain them.
pub(crate) fn first_non_finite(text: &str) -> Option<Range<usize>> {
    let mut cursor = RonCursor { text, at: 0 };
    loop {
        cursor.blank();
        let start = cursor.at;
        let first = cursor.peek()?;
        // Text in quotes may contain these words.
        if first == '"' || (first == 'r' && cursor.is_raw_string()) {
            cursor.string();
        } else if is_word(first) || first == '+' {
            cursor.word();
            let token = &text[start..cursor.at];
            // RON allows a sign before words, too.
            let bare = token.trim_start_matches(['+', '-']);
            // RON allows underscores in numbers, which Rust's parser does not.
            let number = token.replace('_', "").parse::<f64>();
            let word = bare == "NaN" || bare == "inf";
            // Only numbers, because Rust also parses words such as `infinity`.
            let digits = bare.starts_with(|c: char| c.is_ascii_digit() || c == '.');
            if word || (digits && number.is_ok_and(|n| !n.is_finite())) {
                return Some(start..cursor.at);
            }
        } else {
            cursor.bump();
        }
    }
}

/// Returns the name before the first bracket of a RON text, if it is plain.
pub fn first_word(text: &str) -> Option<Range<usize>> {
    let mut cursor = RonCursor { text, at: 0 };
    cursor.blank();
    let start = cursor.at;
    if !cursor.peek()?.is_alphabetic() {
        return None;
    }
    cursor.word();
    let end = cursor.at;
    cursor.blank();
    (cursor.peek() == Some('(')).then_some(start..end)
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '-' | '+')
}

struct RonCursor<'a> {
    text: &'a str,
    at: usize,
}

impl RonCursor<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += c.len_utf8();
        Some(c)
    }

    fn eat(&mut self, c: char) -> bool {
        let there = self.peek() == Some(c);
        if there {
            self.at += c.len_utf8();
        }
        there
    }

    /// Skips white space, comments and `#![enable(…)]` lines.
    fn blank(&mut self) {
        loop {
            let rest = self.rest();
            if rest.starts_with("//") || rest.starts_with("#!") {
                self.at += rest.find('\n').unwrap_or(rest.len());
            } else if rest.starts_with("/*") {
                self.at += block_comment(rest);
            } else if rest.starts_with(char::is_whitespace) {
                self.bump();
            } else {
                return;
            }
        }
    }

    fn is_raw_string(&self) -> bool {
        let rest = self.rest()[1..].trim_start_matches('#');
        rest.starts_with('"')
    }

    fn string(&mut self) {
        if self.peek() == Some('r') {
            self.bump();
            // A raw string ends at a quote with as many hashes as at its start.
            let hashes = self.rest().len() - self.rest().trim_start_matches('#').len();
            self.at += hashes + 1;
            let end = format!("\"{}", "#".repeat(hashes));
            let rest = self.rest();
            self.at += rest
                .find(&end)
                .map_or(rest.len(), |found| found + end.len());
            return;
        }
        self.bump();
        while let Some(c) = self.bump() {
            match c {
                '\\' => {
                    // An escaped quote does not end the string.
                    self.bump();
                }
                '"' => return,
                _ => {}
            }
        }
    }

    fn word(&mut self) {
        while self.peek().is_some_and(is_word) {
            self.bump();
        }
    }

    /// Reads a quoted or bare name: a field or a key.
    fn name(&mut self) -> Option<String> {
        let start = self.at;
        if self.peek() == Some('"') {
            self.string();
            let end = self.at.saturating_sub(1).max(start + 1);
            return Some(self.text[start + 1..end].to_owned());
        }
        self.word();
        (start < self.at).then(|| self.text[start..self.at].to_owned())
    }

    /// Returns the bytes of the value under `steps`, with the cursor before a value.
    fn find(&mut self, steps: &[ValueStep]) -> Option<Range<usize>> {
        self.blank();
        let start = self.at;
        match self.peek()? {
            '"' => self.string(),
            'r' if self.is_raw_string() => self.string(),
            '\'' => {
                // A character may be a bracket or a quote, which must not count
                // as such.
                self.bump();
                if self.eat('\\') {
                    self.bump();
                }
                self.bump();
                self.eat('\'');
            }
            '(' | '[' | '{' => {
                if let Some(found) = self.children(steps) {
                    return Some(found);
                }
            }
            c if is_word(c) => {
                self.word();
                let end = self.at;
                self.blank();
                if self.peek() == Some('(') {
                    if let Some(found) = self.children(steps) {
                        return Some(found);
                    }
                } else {
                    // Without brackets the word is the complete value, and
                    // blanks after it are not part of it.
                    self.at = end;
                }
            }
            _ => return None,
        }
        steps.is_empty().then_some(start..self.at)
    }

    /// Searches a bracketed group. Without a match, the cursor is left behind it.
    fn children(&mut self, steps: &[ValueStep]) -> Option<Range<usize>> {
        let close = match self.bump()? {
            '(' => ')',
            '[' => ']',
            _ => '}',
        };
        let mut index = 0;
        loop {
            self.blank();
            if self.eat(close) {
                return None;
            }
            let before = self.at;
            // Elements of lists have no name, and the cursor stays for them.
            let name = self.named();
            let wanted = match (steps.first(), &name) {
                (Some(ValueStep::Name(want)), Some(name)) => want == name,
                (Some(ValueStep::Index(want)), _) => *want == index,
                _ => false,
            };
            // Other children are skipped by a search for nothing.
            let inner: &[ValueStep] = if wanted { &steps[1..] } else { &[] };
            let found = self.find(inner);
            if wanted && found.is_some() {
                return found;
            }
            self.blank();
            self.eat(',');
            index += 1;
            // Text that is no value would not advance the cursor.
            if self.at == before {
                return None;
            }
        }
    }

    /// Reads `name:` if it is there.
    fn named(&mut self) -> Option<String> {
        let start = self.at;
        let name = self.name();
        self.blank();
        if name.is_some() && self.eat(':') {
            return name;
        }
        self.at = start;
        None
    }
}

/// Returns the length of a comment, in which others may be.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    while let Some(found) = text[at..].find(['/', '*']) {
        let here = at + found;
        let rest = &text[here..];
        if rest.starts_with("/*") {
            depth += 1;
            at = here + 2;
        } else if rest.starts_with("*/") {
            depth -= 1;
            at = here + 2;
            if depth == 0 {
                return at;
            }
        } else {
            at = here + 1;
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"// a comment with (brackets
Scenario(
    name: "a (b", /* not: this */ clock: (horizon_s: 15.0),
    agents: [
        Vehicle(name: "ego", drive: Ego(Acc(kp: 0.3))),
        Vehicle(name: "ado", speed: (5, 25)),
    ],
    signals: { "headway": "ado.x - ego.x" },
)"#;

    #[test]
    fn values_are_found_by_their_path() {
        let top = ValuePath::top();
        let agents = top.to("agents");
        let cases = [
            (top.to("clock").to("horizon_s"), "15.0"),
            (top.to("name"), "\"a (b\""),
            (agents.at(0).to("drive").at(0).to("kp"), "0.3"),
            (agents.at(1).to("speed").at(1), "25"),
            (agents.at(1).to("speed"), "(5, 25)"),
            (top.to("signals").to("headway"), "\"ado.x - ego.x\""),
            (top.to("clock").to("missing"), "(horizon_s: 15.0)"),
        ];
        for (path, expect) in cases {
            assert_eq!(&TEXT[path.find(TEXT)], expect, "{path}");
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_found_outside_strings() {
        let cases = [
            ("(a: NaN)", Some("NaN")),
            ("(a: -inf, b: 1)", Some("-inf")),
            ("(a: 1e999)", Some("1e999")),
            ("(a: \"NaN\", info: 1.5e3, b: 300_000)", None),
            ("(a: 0x1F, b: Nan) // inf", None),
        ];
        for (text, expect) in cases {
            assert_eq!(first_non_finite(text).map(|r| &text[r]), expect, "{text}");
        }
    }
}
