//! The few lines around a mistake, as a terminal may show them.

use miette::{LabeledSpan, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

use crate::visible::{visible, visible_line};

/// Most lines of a mistake that are printed.
const MOST_LINES: usize = 30;
/// Characters of a line that are shown.
const MOST_CHARS: usize = 300;
/// Characters before a mistake that is far to the right.
const CHARS_BEFORE: usize = 60;

/// An excerpt of a file: control characters are escaped, long lines are cut.
#[derive(Debug)]
pub(super) struct Excerpt {
    file: String,
    text: String,
    /// Lines of the file before the excerpt.
    lines_before: usize,
    /// Bytes before the mistake in its first line.
    column: usize,
}

impl Excerpt {
    /// The lines of a mistake with one more on both sides, and its place there.
    pub(super) fn of(
        file: &str,
        text: &str,
        span: std::ops::Range<usize>,
        label: &str,
    ) -> (Excerpt, LabeledSpan) {
        // Spans count bytes, and a slice inside a character would panic.
        let start = text.floor_char_boundary(span.start);
        let end = text.ceil_char_boundary(span.end).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |feed| feed + 1);
        // One line of context shows the field that a wrong value belongs to.
        let begins = match line_start {
            0 => 0,
            // A line that begins above 0 is behind a line feed, which the search for the
            // line before must not find again.
            feed => text[..feed - 1].rfind('\n').map_or(0, |feed| feed + 1),
        };
        // Only these lines are copied, because a file can have gigabytes.
        let mut window = ExcerptWindow {
            start,
            end,
            from: None,
            to: 0,
            text: String::new(),
        };
        let mut at = begins;
        let (mut shown, mut behind) = (0, 0);
        for line in text[begins..].split_inclusive('\n') {
            window.line(line, at);
            at += line.len();
            shown += usize::from(line_start < at);
            behind += usize::from(end < at || shown >= MOST_LINES);
            // One line behind the mistake is context, as is the one before it.
            if behind > 1 {
                break;
            }
        }
        let from = window.from.unwrap_or(window.text.len());
        // An empty span, such as at the end of a file, still gets a mark.
        let length = window.to.saturating_sub(from).max(1);
        let label = LabeledSpan::new(Some(visible_line(label).into_owned()), from, length);
        let excerpt = Excerpt {
            file: visible_line(file).into_owned(),
            text: window.text,
            lines_before: text[..begins].matches('\n').count(),
            column: start - line_start,
        };
        (excerpt, label)
    }
}

/// An excerpt that grows line by line, and where the mistake is in it.
struct ExcerptWindow {
    /// The bytes of the file that are wrong.
    start: usize,
    end: usize,
    /// Those of the excerpt.
    from: Option<usize>,
    to: usize,
    text: String,
}

impl ExcerptWindow {
    /// Adds a line of the file, which begins there at the byte `at`.
    fn line(&mut self, line: &str, at: usize) {
        let ended = line.strip_suffix('\n').unwrap_or(line);
        // A carriage return would let a terminal overwrite the line.
        let words = ended.strip_suffix('\r').unwrap_or(ended);
        // The mistake may begin before this line, or behind it.
        let mistake = self.start.clamp(at, at + words.len()) - at;
        let before = words[..mistake].char_indices().rev();
        // A mistake within the shown width needs no cut at the left.
        let first = match before.clone().nth(MOST_CHARS - CHARS_BEFORE) {
            Some(_) => before.take(CHARS_BEFORE).last().map_or(0, |(i, _)| i),
            None => 0,
        };
        if first > 0 {
            self.text.push('…');
        }
        let mut ends = words.len();
        for (count, (i, c)) in words[first..].char_indices().enumerate() {
            let place = at + first + i;
            // The limit counts characters, because bytes are not columns.
            if count == MOST_CHARS {
                self.text.push('…');
                ends = first + i;
                break;
            }
            self.mark(place);
            self.text.push_str(&visible(c.encode_utf8(&mut [0; 4])));
            if self.from.is_some() && place < self.end {
                self.to = self.text.len();
            }
        }
        self.mark(at + ends);
        if words.len() < line.len() {
            // A mistake that goes on over lines ends where the last of them does.
            self.text.push('\n');
        }
    }

    /// Notes the excerpt's place of the mistake once a place of the file is there.
    fn mark(&mut self, place: usize) {
        if self.from.is_none() && self.start <= place {
            self.from = Some(self.text.len());
        }
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.read_span(span, before, after)?;
        let column = match before {
            // The excerpt may begin in the middle of a long line.
            0 => self.column,
            _ => inner.column(),
        };
        Ok(Box::new(MietteSpanContents::new_named(
            self.file.clone(),
            inner.data(),
            *inner.span(),
            self.lines_before + inner.line(),
            column,
            inner.line_count(),
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the excerpt and its marked part.
    fn excerpt(text: &str, wrong: &str) -> (String, String) {
        let at = text.find(wrong).expect("there");
        let (excerpt, label) = Excerpt::of("w.ron", text, at..at + wrong.len(), "here");
        let marked = &excerpt.text[label.offset()..label.offset() + label.len()];
        (excerpt.text.clone(), marked.to_owned())
    }

    #[test]
    fn a_mistake_is_shown_with_the_lines_beside_it() {
        let text = "one\ntwo\nthree wrong\r\nfour\nfive\n";
        let (shown, marked) = excerpt(text, "wrong");
        assert_eq!(shown, "two\nthree wrong\nfour\n");
        assert_eq!(marked, "wrong");
        let (shown, marked) = excerpt(text, "one");
        assert_eq!((shown.as_str(), marked.as_str()), ("one\ntwo\n", "one"));
        let (shown, marked) = excerpt("a wrong", "wrong");
        assert_eq!((shown.as_str(), marked.as_str()), ("a wrong", "wrong"));
    }

    #[test]
    fn control_characters_are_escaped_and_the_mark_stays_where_it_was() {
        let (shown, marked) = excerpt("\u{1b}[2K\r wr\u{202e}ong", "wr\u{202e}ong");
        assert_eq!(shown, r"\u{1b}[2K\u{d} wr\u{202e}ong");
        assert_eq!(marked, r"wr\u{202e}ong");
    }

    #[test]
    fn a_long_line_is_cut_around_the_mistake() {
        let long = format!("{}wrong{}", "x".repeat(1 << 20), "y".repeat(1 << 20));
        let (shown, marked) = excerpt(&long, "wrong");
        assert!(shown.starts_with("…x") && shown.ends_with("y…"), "{shown}");
        // Two more characters are the ellipses at both ends.
        assert!(shown.chars().count() <= MOST_CHARS + 2);
        assert_eq!(marked, "wrong");
        let all = "z".repeat(1 << 20);
        let (shown, marked) = excerpt(&all, &all);
        assert_eq!(shown, format!("{}…", "z".repeat(MOST_CHARS)));
        assert_eq!(marked.len(), MOST_CHARS);
    }

    #[test]
    fn a_mistake_over_many_lines_is_cut_after_some() {
        let text = format!("begin\n{}end", "wrong\n".repeat(100_000));
        let (shown, marked) = excerpt(&text, &"wrong\n".repeat(100_000));
        assert!(shown.lines().count() <= MOST_LINES + 3, "{shown}");
        assert!(marked.starts_with("wrong\nwrong"));
    }

    #[test]
    fn any_place_of_any_text_has_an_excerpt() {
        let text = "ä\r\n\n€x\n\r𝄞";
        for start in 0..=text.len() + 2 {
            for end in start..=text.len() + 2 {
                let (excerpt, label) = Excerpt::of("w.ron", text, start..end, "here");
                let read = excerpt.read_span(label.inner(), 1, 1);
                assert!(read.is_ok(), "{start}..{end}: {excerpt:?} {label:?}");
            }
        }
    }
}
