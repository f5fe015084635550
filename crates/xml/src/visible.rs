//! Text from outside, shown with its control characters escaped.
//!
//! Names, programs, stderr and file texts are written by anybody. A terminal
//! obeys control characters, so that a name could erase or forge what stands
//! around it. Whatever is printed is escaped as `\u{1b}` first.

use std::borrow::Cow;
use std::fmt::Write;

/// Longest run of a character that a command shows as it is.
const LONGEST_RUN: usize = 16;

/// Whether a terminal would obey a character or hide it.
///
/// These are the control characters (C0, DEL, C1), the marks that turn the
/// direction of writing, line separators, and characters without any width. A
/// line feed and a tab are layout, not control.
fn is_hidden(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        // Soft hyphen, Arabic letter mark, Mongolian separator and byte order mark have
        // no width.
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{feff}' => true,
        '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' => true,
        '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}' => true,
        c => c.is_control(),
    }
}

/// The text with every character escaped that a terminal would obey or hide.
///
/// Line feeds and tabs stay.
pub fn visible(text: &str) -> Cow<'_, str> {
    escaped(text, is_hidden)
}

/// The same for what belongs on one line: line feeds and tabs are escaped, too.
pub fn visible_line(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_hidden(c) || matches!(c, '\n' | '\t'))
}

/// A JSON text whose strings hold no such character, and mean the same.
pub fn visible_json(json: &str) -> Cow<'_, str> {
    if !json.contains(is_hidden) {
        return Cow::Borrowed(json);
    }
    // Most texts have a few such characters at most, so this rarely grows.
    let mut shown = String::with_capacity(json.len() + 16);
    for c in json.chars() {
        if is_hidden(c) {
            // JSON escapes UTF-16 units, so a character beyond the first plane has two of
            // them.
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Invariant: writing to a text does not fail.
                let _ = write!(shown, "\\u{unit:04x}");
            }
        } else {
            shown.push(c)
        }
    }
    Cow::Owned(shown)
}

/// A text as XML and HTML may hold it: what they forbid is escaped, too.
pub fn visible_markup(text: &str) -> Cow<'_, str> {
    escaped(text, |c| {
        // XML 1.0 excludes these two from its characters, even as references.
        is_hidden(c) || matches!(c, '\u{fffe}' | '\u{ffff}')
    })
}

/// Whether a character looks like a space or like nothing, and is no plain space.
///
/// Beside other spaces these are fillers, blank patterns and variation selectors.
fn is_blank(c: char) -> bool {
    match c {
        ' ' => false,
        '\u{34f}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' => true,
        '\u{180b}'..='\u{180f}' | '\u{2800}' | '\u{3164}' | '\u{ffa0}' => true,
        '\u{fe00}'..='\u{fe0f}' | '\u{fff0}'..='\u{fff8}' => true,
        '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}' => true,
        '\u{e0000}'..='\u{e0fff}' => true,
        c => c.is_whitespace(),
    }
}

/// A program and its arguments as a shell would take them, on one line.
///
/// It shows what consent is given to, and what a report repeats.
pub fn command_line(command: &[String]) -> String {
    let words = command.iter().map(|word| shell_word(word));
    words.collect::<Vec<_>>().join(" ")
}

/// A word of a command as a shell would take it, in quotes where it needs them.
///
/// Characters without ink are escaped, and long runs of a character are counted, since they
/// could push the rest out of sight.
pub fn shell_word(word: &str) -> String {
    let plain = |c: char| {
        (c.is_alphanumeric() || "/._-+=:,@%".contains(c)) && !is_hidden(c) && !is_blank(c)
    };
    // Counted before escaping, because an escaped run would be as long again.
    let short = without_runs(word);
    if !word.is_empty() && word.chars().all(plain) {
        return short;
    }
    let shown = escaped(&short, |c| is_hidden(c) || is_blank(c));
    // A shell ends the quotes at an apostrophe, so it is escaped outside of them.
    format!("'{}'", shown.replace('\'', "'\\''"))
}

/// The text with long runs of a character as that character and its number.
fn without_runs(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let mut length = 1;
        while rest.next_if_eq(&c).is_some() {
            length += 1;
        }
        // A name may have a few equal characters in a row, and a screen of them hides
        // what follows.
        if length > LONGEST_RUN {
            shown.push(c);
            shown.push_str(&format!("⟨{length} times⟩"));
        } else {
            shown.extend(std::iter::repeat_n(c, length));
        }
    }
    shown
}

fn escaped(text: &str, hides: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&hides) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if hides(c) {
            shown.extend(c.escape_unicode())
        } else {
            shown.push(c)
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_or_hides_is_escaped_and_all_else_is_left() {
        let plain = "ρ ≥ 0: │ 5 m/s²\n\tüber 日本 🚗";
        assert!(matches!(visible(plain), Cow::Borrowed(_)));
        let cases = [
            ("\u{1b}[2K\rpython3", r"\u{1b}[2K\u{d}python3"),
            ("a\u{7f}\u{9b}1m", r"a\u{7f}\u{9b}1m"),
            ("\u{202e}oge\u{202c}", r"\u{202e}oge\u{202c}"),
            ("a\u{200b}b\u{feff}\u{2028}", r"a\u{200b}b\u{feff}\u{2028}"),
            ("\u{0}\u{7}\u{8}", r"\u{0}\u{7}\u{8}"),
        ];
        for (text, shown) in cases {
            assert_eq!(visible(text), shown);
            assert_eq!(visible_line(text), shown);
        }
        assert_eq!(visible_line("a\nb\tc"), r"a\u{a}b\u{9}c");
    }

    #[test]
    fn json_means_the_same() {
        for c in (0..=0x000e_007f).filter_map(char::from_u32) {
            let value = serde_json::json!({ "name": format!("a{c}b") });
            let text = value.to_string();
            let shown = visible_json(&text);
            assert!(!shown.contains(is_hidden), "{c:?}: {shown}");
            let read: serde_json::Value = serde_json::from_str(&shown).expect("JSON");
            assert_eq!(read, value);
        }
    }

    #[test]
    fn a_program_is_shown_as_a_shell_would_take_it() {
        assert_eq!(shell_word("runs/über@2%,a"), "runs/über@2%,a");
        assert_eq!(shell_word("wet road\u{202e}"), r"'wet road\u{202e}'");
        let command = ["python3", "ego.py", "a b", "", "it's", "\u{1b}[2K"];
        let shown = command_line(&command.map(str::to_owned));
        assert_eq!(shown, r"python3 ego.py 'a b' '' 'it'\''s' '\u{1b}[2K'");
        for blank in "\u{a0}\u{3000}\u{3164}\u{2800}\u{fe0f}\u{ffa0}\u{34f}\n\t\u{2003}".chars() {
            let shown = command_line(&[format!("ego{blank}.py")]);
            assert_eq!(shown, format!("'ego{}.py'", blank.escape_unicode()));
        }
        let pushed = format!("ego{};rm -r x", " ".repeat(5000));
        let shown = command_line(&[pushed, "a".repeat(17), "-".repeat(16)]);
        assert_eq!(
            shown,
            "'ego ⟨5000 times⟩;rm -r x' a⟨17 times⟩ ----------------"
        );
    }
}
