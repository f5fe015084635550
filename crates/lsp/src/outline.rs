//! Brackets, keys and words around a place of a RON text, which may be unfinished.
//!
//! A reader of RON refuses unfinished text, and an editor asks about little else. So this
//! scanner closes what is open, and takes a name before `:` for a key wherever it is.

use std::ops::Range;

/// Greatest nesting depth, twice that of a world that can be read.
const MAX_DEPTH: usize = 256;

/// Bracketed group, from the text before a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RonGroup {
    /// Its opening bracket: `(`, `[` or `{`.
    pub bracket: char,
    /// Name before the bracket, empty without one.
    pub word: Range<usize>,
    /// Keys in it.
    pub keys: Vec<Range<usize>>,
    /// Key whose value is being written.
    pub key: Option<Range<usize>>,
    /// Number of commas before the place.
    pub index: usize,
    /// True if the current value has begun.
    has_value: bool,
}

/// Token at a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RonToken {
    /// Blank or punctuation.
    Blank,
    /// Name, number or key without quotes.
    Word(Range<usize>),
    /// Text in quotes: its content.
    Quoted(Range<usize>),
    /// Comment.
    Comment,
}

/// Surroundings of a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outline {
    /// Open groups, the outermost first.
    pub groups: Vec<RonGroup>,
    /// Token at the place.
    pub token: RonToken,
}

impl Outline {
    /// Returns the surroundings of a byte of a text. `None` if it is nested too deeply.
    pub fn at(text: &str, at: usize) -> Option<Outline> {
        let mut scanner = Scanner::new(text);
        let token = loop {
            let lexeme = scanner.peek();
            if let Some(token) = token_at(text, &lexeme, at) {
                break token;
            }
            // The lexeme at the place itself is not taken, since it is still
            // being written.
            if lexeme.span.start >= at || lexeme.kind == LexemeKind::End {
                break RonToken::Blank;
            }
            scanner.take(&lexeme)?;
        };
        // A copy, because the search for later keys goes on with the scanner.
        let mut groups = scanner.groups.clone();
        if let Some(group) = groups.last_mut() {
            group.keys.extend(scanner.later_keys());
            // Without the comma before it, a new name would be the value of the last key.
            if group.has_value && matches!(token, RonToken::Word(_)) {
                group.key = None;
            }
        }
        Some(Outline { groups, token })
    }

    /// Returns the innermost open group.
    pub fn inner(&self) -> Option<&RonGroup> {
        self.groups.last()
    }
}

fn token_at(text: &str, lexeme: &Lexeme, at: usize) -> Option<RonToken> {
    let Range { start, end } = lexeme.span;
    match &lexeme.kind {
        // Both ends included: the cursor is behind the last letter while a
        // name is typed.
        LexemeKind::Word if (start..=end).contains(&at) => Some(RonToken::Word(start..end)),
        // Before its first character there is still room for a field.
        LexemeKind::Comment if start < at && at <= end => Some(RonToken::Comment),
        LexemeKind::Quoted(content) if start < at && (at < end || at == content.end) => {
            // A text whose end is missing would reach to the next quote.
            let line = text[at..content.end.max(at)].find('\n');
            let cut = line.map_or(content.end, |feed| at + feed);
            Some(RonToken::Quoted(content.start.min(at)..cut))
        }
        _ => None,
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum LexemeKind {
    Open(char),
    Close(char),
    Comma,
    Colon,
    Word,
    /// Text with its content.
    Quoted(Range<usize>),
    Comment,
    Other,
    End,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Lexeme {
    kind: LexemeKind,
    span: Range<usize>,
}

/// Reader of lexemes with the groups that are open.
pub(crate) struct Scanner<'a> {
    text: &'a str,
    at: usize,
    pub(crate) groups: Vec<RonGroup>,
    /// Name right before the cursor: a key, the name of a group, or a value.
    last_name: Option<Range<usize>>,
}

/// Text in quotes, or key, with the groups around it.
pub(crate) enum Visit {
    /// Text in quotes.
    Quoted(Range<usize>),
    /// Key of the innermost group.
    Key(Range<usize>),
    /// Anything else.
    Other,
}

impl<'a> Scanner<'a> {
    pub(crate) fn new(text: &'a str) -> Scanner<'a> {
        Scanner {
            text,
            at: 0,
            groups: Vec::new(),
            last_name: None,
        }
    }

    /// Takes the next lexeme. `None` at the end, or nested too deeply.
    pub(crate) fn next_visit(&mut self) -> Option<Visit> {
        let lexeme = self.peek();
        let visit = match (&lexeme.kind, &self.last_name) {
            (LexemeKind::End, _) => return None,
            (LexemeKind::Quoted(content), _) => Visit::Quoted(content.clone()),
            (LexemeKind::Colon, Some(name)) => Visit::Key(name.clone()),
            _ => Visit::Other,
        };
        self.take(&lexeme).map(|()| visit)
    }

    /// The next lexeme, without white space.
    fn peek(&self) -> Lexeme {
        let rest = &self.text[self.at..];
        let blank = rest.len() - rest.trim_start().len();
        let start = self.at + blank;
        let (local, length) = lexeme(&self.text[start..]);
        let kind = match local {
            LexemeKind::Quoted(content) => {
                LexemeKind::Quoted(start + content.start..start + content.end)
            }
            kind => kind,
        };
        Lexeme {
            kind,
            span: start..start + length,
        }
    }

    /// Follows a lexeme. `None` if the text is nested too deeply.
    fn take(&mut self, lexeme: &Lexeme) -> Option<()> {
        self.at = lexeme.span.end;
        // A name belongs to the lexeme right behind it, and is forgotten
        // otherwise.
        let name = self.last_name.take();
        match &lexeme.kind {
            LexemeKind::Open(bracket) => {
                // A text of brackets alone would otherwise allocate a group
                // per byte.
                if self.groups.len() == MAX_DEPTH {
                    return None;
                }
                self.begin_value();
                let start = lexeme.span.start;
                self.groups.push(RonGroup {
                    bracket: *bracket,
                    word: name.unwrap_or(start..start),
                    keys: Vec::new(),
                    key: None,
                    index: 0,
                    has_value: false,
                });
            }
            LexemeKind::Close(bracket) => {
                // A bracket that is missing inside is closed, too.
                let mut open = self.groups.iter();
                // From the inside: a bracket closes the nearest group of its
                // kind.
                if let Some(depth) = open.rposition(|group| closing(group.bracket) == *bracket) {
                    self.groups.truncate(depth);
                }
            }
            LexemeKind::Comma => {
                if let Some(group) = self.groups.last_mut() {
                    group.key = None;
                    group.index += 1;
                    group.has_value = false;
                }
            }
            LexemeKind::Colon => {
                // A list has no keys, so its end is missing.
                while self.groups.last().is_some_and(|it| it.bracket == '[') {
                    self.groups.pop();
                }
                if let (Some(group), Some(name)) = (self.groups.last_mut(), name) {
                    group.keys.push(name.clone());
                    group.key = Some(name);
                    group.has_value = false;
                }
            }
            LexemeKind::Word => {
                self.begin_value();
                self.last_name = Some(lexeme.span.clone());
            }
            LexemeKind::Quoted(content) => {
                self.begin_value();
                self.last_name = Some(content.clone());
            }
            // A comment may be between a name and its colon.
            LexemeKind::Comment => self.last_name = name,
            LexemeKind::Other => self.begin_value(),
            LexemeKind::End => {}
        }
        Some(())
    }

    fn begin_value(&mut self) {
        if let Some(group) = self.groups.last_mut() {
            group.has_value = true;
        }
    }

    /// Keys of the innermost group from here to its end.
    fn later_keys(mut self) -> Vec<Range<usize>> {
        let depth = self.groups.len();
        let mut keys = Vec::new();
        // A group that is nested too deeply ends the search.
        while let Some(visit) = self.next_visit() {
            // The group is closed, so further keys are those of other groups.
            if self.groups.len() < depth {
                break;
            }
            if let Visit::Key(key) = visit
                && self.groups.len() == depth
            {
                keys.push(key);
            }
        }
        keys
    }
}

fn closing(bracket: char) -> char {
    match bracket {
        '(' => ')',
        '[' => ']',
        _ => '}',
    }
}

/// The lexeme at the start of a text, and its length.
fn lexeme(text: &str) -> (LexemeKind, usize) {
    let Some(first) = text.chars().next() else {
        return (LexemeKind::End, 0);
    };
    // Before words, because a raw text begins with a letter.
    if let Some((content, length)) = quoted(text) {
        return (LexemeKind::Quoted(content), length);
    }
    let kind = match first {
        '(' | '[' | '{' => LexemeKind::Open(first),
        ')' | ']' | '}' => LexemeKind::Close(first),
        ',' => LexemeKind::Comma,
        ':' => LexemeKind::Colon,
        '\'' => return (LexemeKind::Other, character(text)),
        _ if text.starts_with("//") || text.starts_with("#!") => {
            return (LexemeKind::Comment, text.find('\n').unwrap_or(text.len()));
        }
        _ if text.starts_with("/*") => return (LexemeKind::Comment, block_comment(text)),
        _ if is_word(first) => {
            let end = text.find(|c| !is_word(c)).unwrap_or(text.len());
            return (LexemeKind::Word, end);
        }
        _ => LexemeKind::Other,
    };
    (kind, first.len_utf8())
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '-' | '+')
}

/// Content and length of a text in quotes, to the end of `text` if its quote is missing.
fn quoted(text: &str) -> Option<(Range<usize>, usize)> {
    if let Some(raw) = text.strip_prefix('r') {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        let content = raw[hashes..].strip_prefix('"')?;
        let start = text.len() - content.len();
        // A raw text ends at a quote with as many hashes as at its start.
        let end = format!("\"{}", "#".repeat(hashes));
        let found = content.find(&end);
        return Some(match found {
            Some(length) => (start..start + length, start + length + end.len()),
            None => (start..text.len(), text.len()),
        });
    }
    let content = text.strip_prefix('"')?;
    let mut escaped = false;
    for (i, c) in content.char_indices() {
        match c {
            // First, so that an escaped quote does not end the text.
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return Some((1..1 + i, i + 2)),
            _ => {}
        }
    }
    Some((1..text.len(), text.len()))
}

/// Length of a character in quotes, whose content may be a bracket.
fn character(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    let mut content = chars.next();
    if content.is_some_and(|(_, c)| c == '\\') {
        content = chars.next();
    }
    match (content, chars.next()) {
        (Some(_), Some((i, '\''))) => i + 1,
        // An apostrophe alone quotes nothing.
        _ => 1,
    }
}

/// Length of a comment in which others may be.
fn block_comment(text: &str) -> usize {
    let bytes = text.as_bytes();
    // Comments of RON nest, unlike those of C.
    let (mut depth, mut i) = (0usize, 0);
    while i < bytes.len() {
        if bytes[i..].starts_with(b"/*") {
            depth += 1;
            i += 2;
        } else if bytes[i..].starts_with(b"*/") {
            depth -= 1;
            i += 2;
            if depth == 0 {
                return i;
            }
        } else {
            i += 1;
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The path, the token and the keys at `|`.
    fn shown(marked: &str) -> String {
        let at = marked.find('|').expect("a mark");
        let text = marked.replacen('|', "", 1);
        let outline = Outline::at(&text, at).expect("not deep");
        let words = outline.groups.iter().map(|group| {
            let key = group.key.clone().map_or("", |key| &text[key]);
            let (word, bracket) = (&text[group.word.clone()], group.bracket);
            format!("{word}{bracket}{key}#{}", group.index)
        });
        let path = words.collect::<Vec<_>>().join(" ");
        let token = match &outline.token {
            RonToken::Blank => "blank".to_owned(),
            RonToken::Comment => "comment".to_owned(),
            RonToken::Word(span) => format!("word {}", &text[span.clone()]),
            RonToken::Quoted(span) => format!("text {}", &text[span.clone()]),
        };
        let inner = outline.inner();
        let keys = inner.map_or(Vec::new(), |group| {
            group.keys.iter().map(|key| &text[key.clone()]).collect()
        });
        format!("{path}; {token}; {}", keys.join(" "))
    }

    #[test]
    fn places_have_their_path_token_and_keys() {
        let cases = [
            ("|", "; blank; "),
            ("Scen|ario(", "; word Scenario; "),
            ("Scenario(|", "Scenario(#0; blank; "),
            ("S(a: 1, b|, c: 2)", "S(#1; word b; a c"),
            ("S(a: 1, b: |, c: 2)", "S(b#1; blank; a b c"),
            ("S(a: [V(x: 1), V(|y: 2)])", "S(a#0 [#1 V(#0; word y; y"),
            ("S(a: \"b (|\", c: 1)", "S(a#0; text b (; a c"),
            ("S(a: r#\"b \" (|\"#, c: 1)", "S(a#0; text b \" (; a c"),
            ("S(/* a: ( /* */ | */ b: 1)", "S(#0; comment; b"),
            ("S(// a: (|\n b: 1)", "S(#0; comment; b"),
            ("S(c: '(', b|: 1)", "S(#1; word b; c b"),
            ("S(m: {\"k\": V(|)})", "S(m#0 {k#0 V(#0; blank; "),
            // Unfinished: a comma, a quote and brackets are missing.
            ("S(a: 1\n b|\n c: 2)", "S(#0; word b; a c"),
            ("S(a: \"x|\n b: \"y\")", "S(a#0; text x; a"),
            ("S(a: [V(x: 1, ), b: |", "S(b#0; blank; a b"),
            ("S(a: [1, 2) |", "; blank; "),
        ];
        for (marked, expect) in cases {
            assert_eq!(shown(marked), expect, "{marked}");
        }
    }

    #[test]
    fn every_place_of_every_prefix_has_an_outline() {
        for (name, text) in brakecheck_worlds::WORLDS {
            // Every seventh prefix meets all kinds of ends, in a seventh of the time.
            for end in (0..=text.len()).step_by(7) {
                let Some(prefix) = text.get(..end) else {
                    continue;
                };
                assert!(Outline::at(prefix, end).is_some(), "{name}: {end}");
                assert!(Outline::at(text, end).is_some(), "{name}: {end}");
            }
        }
    }

    #[test]
    fn deep_nesting_has_no_outline() {
        let deep = "(".repeat(1_000_000);
        assert_eq!(Outline::at(&deep, deep.len()), None);
    }
}
