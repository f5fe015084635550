//! Good texts with something wrong in them, where a hand or a tool would err.
//!
//! An edit works on what RON, JSON, CSV and formulas have in common: numbers,
//! words, and items between commas and brackets. Edits that keep the text well
//! formed come far behind the reader; the others exercise it.

use std::fmt;
use std::ops::Range;

use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::corpus::{Corpus, Source};

/// A text and where it comes from.
#[derive(Clone)]
pub struct Mutant {
    origin: String,
    good: String,
    pub text: String,
}

impl Mutant {
    /// Whether it comes from this text.
    pub fn is_of(&self, source: &Source) -> bool {
        self.origin == source.name
    }
}

/// Shown by what differs from the good text.
impl fmt::Debug for Mutant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (good, bad) = (&self.good, &self.text);
        let same = |a: &mut dyn Iterator<Item = char>, b: &mut dyn Iterator<Item = char>| {
            let pairs = a.zip(b).take_while(|(a, b)| a == b);
            pairs.map(|(c, _)| c.len_utf8()).sum::<usize>()
        };
        let from = same(&mut good.chars(), &mut bad.chars());
        let (good, bad) = (&good[from..], &bad[from..]);
        let end = same(&mut good.chars().rev(), &mut bad.chars().rev());
        let (was, is) = (&good[..good.len() - end], &bad[..bad.len() - end]);
        write!(
            f,
            "{} from byte {from} on: {was:?} became {is:?}",
            self.origin
        )
    }
}

/// One change of a text; the places are shares of its length.
#[derive(Clone, Debug)]
enum Edit {
    /// A number becomes this.
    Number(Index, &'static str),
    /// A number becomes larger, smaller, or of the other sign.
    Scale(Index, f64),
    /// An item is left out, given twice, or swapped with another.
    Drop(Index),
    Double(Index),
    Swap(Index, Index),
    /// An item becomes one with its name, or any, of some file.
    Splice(Index, Index, Index),
    /// A word becomes one of some file.
    Word(Index, Index, Index),
    /// An item is wrapped in so many brackets.
    Nest(Index, &'static str, usize),
    /// What stands in a pair of brackets is left out.
    Empty(Index),
    Insert(Index, &'static str),
    Cut(Index, usize),
    Truncate(Index),
}

const NUMBERS: [&str; 25] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "0.5",
    "1e308",
    "-1e308",
    "1e-308",
    "1e999",
    "NaN",
    "inf",
    "-inf",
    "18446744073709551616",
    "18446744073709551615",
    "9223372036854775808",
    "4294967296",
    "2147483648",
    "-2147483649",
    "9007199254740993",
    "100000",
    "100000.0",
    "3",
    "007",
    "0x10",
    "0.1",
];

const FACTORS: [f64; 9] = [0.5, 2.0, -1.0, 0.9, 1.1, 3.0, 10.0, 0.1, 1000.0];

const PIECES: [&str; 25] = [
    "é", "𝛙", "\u{202e}", "\u{feff}", "\0", "\"", "'", "\\", "r#\"", "//", "/*", ",", ":", "(",
    ")", "[", "]", "{", "}", "Some(", "()", "\n", "\r\n", "-", "#",
];

fn edit() -> impl Strategy<Value = Edit> {
    let place = any::<Index>;
    prop_oneof![
        3 => (place(), select(NUMBERS.to_vec())).prop_map(|(at, number)| Edit::Number(at, number)),
        5 => (place(), select(FACTORS.to_vec())).prop_map(|(at, factor)| Edit::Scale(at, factor)),
        2 => place().prop_map(Edit::Drop),
        1 => place().prop_map(Edit::Double),
        1 => (place(), place()).prop_map(|(a, b)| Edit::Swap(a, b)),
        5 => (place(), place(), place()).prop_map(|(at, file, of)| Edit::Splice(at, file, of)),
        2 => (place(), place(), place()).prop_map(|(at, file, of)| Edit::Word(at, file, of)),
        1 => (place(), select(vec!["(", "[", "{", "not ", "Some("]), select(vec![1, 2, 90, 130, 3000]))
            .prop_map(|(at, bracket, levels)| Edit::Nest(at, bracket, levels)),
        1 => place().prop_map(Edit::Empty),
        1 => (place(), select(PIECES.to_vec())).prop_map(|(at, piece)| Edit::Insert(at, piece)),
        1 => (place(), 1..30usize).prop_map(|(at, bytes)| Edit::Cut(at, bytes)),
        1 => place().prop_map(Edit::Truncate),
    ]
}

/// Texts of a corpus with some edits each.
pub fn mutants(corpus: Corpus) -> impl Strategy<Value = Mutant> {
    let edits = prop_oneof![3 => 1..2usize, 2 => 2..4usize, 1 => 4..9usize]
        .prop_flat_map(|count| prop::collection::vec(edit(), 1..=count));
    // Half of the time everything happens in one item, large or small.
    let focus = prop_oneof![Just(None), any::<Index>().prop_map(Some)];
    (any::<Index>(), focus, edits).prop_map(move |(which, focus, edits)| {
        let source = which.get(&corpus);
        let spoil = |text: String, edit: &Edit| edit.of(&text, &corpus);
        let item = focus
            .and_then(|at| pick(&items(&source.text), &at))
            .unwrap_or(0..source.text.len());
        let spoilt = edits
            .iter()
            .fold(source.text[item.clone()].to_owned(), spoil);
        let text = with(&source.text, item, &spoilt);
        Mutant {
            origin: source.name.clone(),
            good: format!("{}{}", source.text, source.tail),
            text: text + &source.tail,
        }
    })
}

impl Edit {
    fn of(&self, text: &str, corpus: &Corpus) -> String {
        match self {
            Edit::Number(at, number) => match pick(&numbers(text), at) {
                Some(span) => with(text, span, number),
                None => text.to_owned(),
            },
            Edit::Scale(at, factor) => match pick(&numbers(text), at) {
                Some(span) => with(text, span.clone(), &scaled(&text[span], *factor)),
                None => text.to_owned(),
            },
            Edit::Drop(at) => match pick(&items(text), at) {
                // With the comma behind it, if there is one.
                Some(Range { start, end }) => {
                    let comma = text[end..].starts_with(',');
                    with(text, start..end + usize::from(comma), "")
                }
                None => text.to_owned(),
            },
            Edit::Double(at) => match pick(&items(text), at) {
                Some(span) => {
                    let twice = format!("{0}, {0}", &text[span.clone()]);
                    with(text, span, &twice)
                }
                None => text.to_owned(),
            },
            Edit::Swap(a, b) => {
                let all = items(text);
                let (Some(a), Some(b)) = (pick(&all, a), pick(&all, b)) else {
                    return text.to_owned();
                };
                let (first, second) = if a.start < b.start { (a, b) } else { (b, a) };
                if second.start < first.end {
                    return text.to_owned();
                }
                let later = with(text, second.clone(), &text[first.clone()]);
                with(&later, first, &text[second])
            }
            Edit::Splice(at, file, of) => {
                let other = &file.get(corpus).text;
                let Some(span) = pick(&items(text), at) else {
                    return text.to_owned();
                };
                let (theirs, key) = (items(other), key(&text[span.clone()]));
                let named: Vec<_> = theirs
                    .iter()
                    .filter(|span| key.is_some() && self::key(&other[(*span).clone()]) == key)
                    .cloned()
                    .collect();
                match pick(if named.is_empty() { &theirs } else { &named }, of) {
                    Some(piece) => with(text, span, &other[piece]),
                    None => text.to_owned(),
                }
            }
            Edit::Word(at, file, of) => {
                let other = &file.get(corpus).text;
                match (pick(&words(text), at), pick(&words(other), of)) {
                    (Some(span), Some(word)) => with(text, span, &other[word]),
                    _ => text.to_owned(),
                }
            }
            Edit::Nest(at, bracket, levels) => match pick(&items(text), at) {
                Some(span) => {
                    let close = match *bracket {
                        "[" => "]",
                        "{" => "}",
                        "not " => "",
                        _ => ")",
                    };
                    let (open, close) = (bracket.repeat(*levels), close.repeat(*levels));
                    let nested = format!("{open}{}{close}", &text[span.clone()]);
                    with(text, span, &nested)
                }
                None => text.to_owned(),
            },
            Edit::Empty(at) => match pick(&brackets(text), at) {
                Some(span) => with(text, span, ""),
                None => text.to_owned(),
            },
            Edit::Insert(at, piece) => {
                let at = boundary(text, at.index(text.len() + 1));
                with(text, at..at, piece)
            }
            Edit::Cut(at, bytes) => {
                let at = boundary(text, at.index(text.len() + 1));
                with(text, at..boundary(text, at + bytes), "")
            }
            Edit::Truncate(at) => text[..boundary(text, at.index(text.len() + 1))].to_owned(),
        }
    }
}

fn with(text: &str, span: Range<usize>, piece: &str) -> String {
    format!("{}{piece}{}", &text[..span.start], &text[span.end..])
}

fn pick(spans: &[Range<usize>], at: &Index) -> Option<Range<usize>> {
    (!spans.is_empty()).then(|| at.get(spans).clone())
}

/// The last place between two characters, up to a byte.
fn boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at)
        .rev()
        .find(|&i| text.is_char_boundary(i))
        .unwrap_or(0)
}

/// A number as it would be written: whole ones stay whole.
fn scaled(number: &str, factor: f64) -> String {
    let plain = number.replace('_', "");
    match (plain.parse::<i64>(), plain.parse::<f64>()) {
        (Ok(whole), _) => ((whole as f64 * factor).round() as i64).to_string(),
        (_, Ok(real)) => format!("{:?}", real * factor),
        _ => number.to_owned(),
    }
}

/// Runs of characters that begin as `first` says and go on as `more` says.
fn runs(text: &str, first: fn(u8) -> bool, more: fn(u8, u8) -> bool) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let mut spans = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        at += 1;
        let inside = start != 0 && is_word(bytes[start - 1]);
        if !first(bytes[start]) || inside {
            continue;
        }
        while at < bytes.len() && more(bytes[at - 1], bytes[at]) {
            at += 1;
        }
        spans.push(start..at);
    }
    spans
}

fn is_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'.'
}

fn numbers(text: &str) -> Vec<Range<usize>> {
    let more = |before: u8, byte: u8| {
        let sign = matches!(byte, b'-' | b'+') && matches!(before, b'e' | b'E');
        sign || byte.is_ascii_digit() || matches!(byte, b'.' | b'_' | b'e' | b'E')
    };
    runs(text, |byte| byte.is_ascii_digit(), more)
}

fn words(text: &str) -> Vec<Range<usize>> {
    let first = |byte: u8| byte.is_ascii_alphabetic() || byte == b'_';
    runs(text, first, |_, byte| is_word(byte))
}

/// What stands between brackets, commas and, outside of all, ends of lines.
fn items(text: &str) -> Vec<Range<usize>> {
    let (bytes, mut spans) = (text.as_bytes(), Vec::new());
    let mut starts = vec![0];
    let mut item = |from: usize, to: usize| {
        let piece = &text[from..to];
        let lead = piece.len() - piece.trim_start().len();
        if !piece.trim().is_empty() {
            spans.push(from + lead..from + lead + piece.trim().len());
        }
    };
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'/' if text[at..].starts_with("//") => {
                at += text[at..].find('\n').unwrap_or(text.len() - at);
                continue;
            }
            b'(' | b'[' | b'{' => starts.push(at + 1),
            b')' | b']' | b'}' if starts.len() > 1 => {
                item(starts.pop().unwrap_or(0), at);
            }
            separator @ (b',' | b'\n') if separator == b',' || starts.len() == 1 => {
                if let Some(start) = starts.last_mut() {
                    item(std::mem::replace(start, at + 1), at);
                }
            }
            _ => {}
        }
        at += 1;
    }
    item(starts[0].min(text.len()), text.len());
    spans
}

/// What stands in pairs of brackets.
fn brackets(text: &str) -> Vec<Range<usize>> {
    let (mut open, mut spans) = (Vec::new(), Vec::new());
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            b'(' | b'[' | b'{' => open.push(at + 1),
            b')' | b']' | b'}' => spans.extend(open.pop().map(|start| start..at)),
            _ => {}
        }
    }
    spans
}

/// All texts that differ from a good one in one number, which is none.
pub fn without_a_number(good: &str) -> Vec<String> {
    let none = ["NaN", "inf", "-inf", "1e999"];
    let spans = numbers(good).into_iter();
    spans
        .flat_map(|span| none.map(|none| with(good, span.clone(), none)))
        .collect()
}

/// A text without remarks, and all texts that differ from it in one number, by
/// a factor, or in one pair of brackets that is empty.
pub fn extremes(good: &str, factors: &[f64]) -> Vec<String> {
    let lines = good
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    let good = lines.collect::<Vec<_>>().join("\n");
    let mut texts = vec![good.clone()];
    for span in numbers(&good) {
        for factor in factors {
            texts.push(with(
                &good,
                span.clone(),
                &scaled(&good[span.clone()], *factor),
            ));
        }
    }
    let emptied = brackets(&good).into_iter().filter(|span| !span.is_empty());
    texts.extend(emptied.map(|span| with(&good, span, "")));
    texts
}

/// A text in which one name of a field is another: the name, and the text.
///
/// Whatever stands before it is any character, in a remark.
pub fn misspelt(corpus: Corpus) -> impl Strategy<Value = (String, String)> {
    let odd = select(vec!['é', '𝛙', '►', 'x', '\u{feff}']);
    (any::<Index>(), any::<Index>(), odd, 0..9usize).prop_map(move |(which, at, odd, blanks)| {
        let text = &which.get(&corpus).text;
        let fields = |span: &Range<usize>| {
            let item = &text[span.clone()];
            key(item).is_some_and(|key| item.starts_with(key) && !key.contains(['"', '.', ' ']))
        };
        let fields: Vec<Range<usize>> = items(text).into_iter().filter(fields).collect();
        let item = pick(&fields, &at).expect("a field");
        let name = key(&text[item.clone()]).expect("its name");
        let wrong = format!("{name}_{}", "x".repeat(blanks));
        let remark = format!(
            "/*{}*/{}{wrong}",
            odd.to_string().repeat(5),
            " ".repeat(blanks)
        );
        let text = with(text, item.start..item.start + name.len(), &remark);
        (wrong, text)
    })
}

/// `name` of `name: value`, quoted or not.
fn key(item: &str) -> Option<&str> {
    let (name, _) = item.split_once(':')?;
    let name = name.lines().next_back()?.trim();
    let plain = |c: char| c.is_alphanumeric() || "_.\" ".contains(c);
    (!name.is_empty() && name.chars().all(plain)).then_some(name)
}
