//! Places of a text in which files are included, in the text that a user sees.
//!
//! The content of a file stands in place of its name. Problems in it belong to the name.

use std::ops::Range;

/// Lines after a changed line that must be equal to go on behind it.
const AGREEING_LINES: usize = 3;

/// Two texts, line by line.
pub struct Expansion<'a> {
    own: &'a str,
    /// Lines of the whole text, in order.
    lines: Vec<ExpandedLine>,
}

/// Line of the whole text, with its line of the own text.
#[derive(Clone, Debug)]
struct ExpandedLine {
    span: Range<usize>,
    own: Range<usize>,
    /// Equal bytes at the start of both.
    before: usize,
    /// Equal bytes at the end of both.
    after: usize,
}

impl<'a> Expansion<'a> {
    /// Aligns a text with the text that includes its files.
    pub fn new(own: &'a str, whole: &str) -> Expansion<'a> {
        let (own_lines, whole_lines) = (line_spans(own), line_spans(whole));
        let mut lines = Vec::new();
        let mut next = 0;
        for (i, own_line) in own_lines.iter().enumerate() {
            let rest = &whole_lines[next.min(whole_lines.len())..];
            // Each later line needs one line at least.
            let later = own_lines.len() - i - 1;
            // Lines that are left over belong to the content of a file.
            let spare = rest.len().saturating_sub(later + 1);
            let same = |after: usize| {
                let own = own_lines[i + 1..].iter().map(|it| &own[it.clone()]);
                let whole = rest[after + 1..].iter().map(|it| &whole[it.clone()]);
                own.zip(whole).take(AGREEING_LINES).all(|(a, b)| a == b)
            };
            let is_equal = rest
                .first()
                .is_some_and(|line| whole[line.clone()] == own[own_line.clone()]);
            // An equal line includes nothing, and without spare lines nothing
            // can be content.
            let more = if is_equal || spare == 0 {
                0
            } else {
                // The fewest lines, so that a file takes no lines that are the
                // text's own.
                (0..=spare).find(|after| same(*after)).unwrap_or(0)
            };
            let taken = (more + 1).min(rest.len());
            for span in &rest[..taken] {
                lines.push(aligned(own, own_line, whole, span));
            }
            next += taken;
        }
        Expansion { own, lines }
    }

    /// Returns the bytes of the own text for bytes of the whole text.
    pub fn own_span(&self, span: Range<usize>) -> Range<usize> {
        let start = self.own_place(span.start, false);
        let end = self.own_place(span.end.max(span.start), true);
        start..end.max(start)
    }

    fn own_place(&self, at: usize, is_end: bool) -> usize {
        let behind = self.lines.partition_point(|line| line.span.start <= at);
        let Some(line) = behind.checked_sub(1).and_then(|i| self.lines.get(i)) else {
            return 0;
        };
        let column = at - line.span.start;
        let left = line.span.len().saturating_sub(column);
        // Equal ends on both sides keep their columns. Only the middle is
        // another file's.
        let place = if column <= line.before {
            line.own.start + column
        } else if left <= line.after {
            line.own.end - left
        } else if is_end {
            line.own.end - line.after
        } else {
            line.own.start + line.before
        };
        place.min(self.own.len())
    }
}

/// Lines with their ends.
fn line_spans(text: &str) -> Vec<Range<usize>> {
    let mut start = 0;
    let lines = text.split_inclusive('\n').map(|line| {
        let span = start..start + line.len();
        start = span.end;
        span
    });
    lines.collect()
}

fn aligned(own: &str, own_line: &Range<usize>, whole: &str, span: &Range<usize>) -> ExpandedLine {
    let (a, b) = (
        &own.as_bytes()[own_line.clone()],
        &whole.as_bytes()[span.clone()],
    );
    let before = a.iter().zip(b).take_while(|(x, y)| x == y).count();
    // The equal end must not overlap the equal start, as in `aa` and `aaa`.
    let most = a.len().min(b.len()) - before;
    let ends = a.iter().rev().zip(b.iter().rev()).take(most);
    ExpandedLine {
        span: span.clone(),
        own: own_line.clone(),
        before,
        after: ends.take_while(|(x, y)| x == y).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The own text of `wanted` in the whole text.
    #[track_caller]
    fn own<'a>(own: &'a str, whole: &str, wanted: &str) -> &'a str {
        let start = whole.find(wanted).expect("there");
        let expansion = Expansion::new(own, whole);
        &own[expansion.own_span(start..start + wanted.len())]
    }

    #[test]
    fn places_are_those_of_the_own_text() {
        let text = "S(\n a: [\"f.ron\"], b: 2,\n c: 3,\n)\n";
        let whole = "S(\n a: [Rule(x), Rule(y)], b: 2,\n c: 3,\n)\n";
        assert_eq!(own(text, whole, "b: 2"), "b: 2");
        assert_eq!(own(text, whole, "c: 3"), "c: 3");
        assert_eq!(own(text, whole, "Rule(y)"), "\"f.ron\"");
        assert_eq!(own(text, text, "c: 3"), "c: 3");
    }

    #[test]
    fn content_of_several_lines_belongs_to_its_name() {
        let text = "S(\n a: \"run\",\n c: 3,\n d: 4,\n)\n";
        let whole = "S(\n a: Kept(r#\"S(\n c: 3,\n)\n\"#),\n c: 3,\n d: 4,\n)\n";
        assert_eq!(own(text, whole, "d: 4"), "d: 4");
        assert_eq!(own(text, whole, "Kept"), "\"run\",");
        let last = whole.rfind("c: 3").expect("there");
        let expansion = Expansion::new(text, whole);
        assert_eq!(&text[expansion.own_span(last..last + 4)], "c: 3");
    }

    #[test]
    fn a_value_of_several_lines_keeps_its_lines() {
        let text = "S(\n road: Drive(\n  file: \"x\",\n ),\n c: 3,\n)\n";
        let whole = "S(\n road: Curved(1)\n\n,\n c: 3,\n)\n";
        assert_eq!(own(text, whole, "c: 3"), "c: 3");
        let own_road = own(text, whole, "Curved(1)");
        assert!(own_road.starts_with("Drive("), "{own_road}");
    }

    #[test]
    fn any_places_of_any_texts_are_between_characters_after_rounding() {
        let texts = ["", "é\n", "a\né b\n\n", "\n\n\n", "x é\ny"];
        for a in texts {
            for b in texts {
                let expansion = Expansion::new(a, b);
                for at in 0..b.len() + 2 {
                    let span = expansion.own_span(at..at + 1);
                    assert!(span.start <= span.end && span.end <= a.len());
                }
            }
        }
    }
}
