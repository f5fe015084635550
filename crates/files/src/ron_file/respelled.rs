//! Misspelt names, at which the reader stops, replaced by the names that they resemble.

use std::ops::Range;

use serde::de::DeserializeOwned;

use super::error::Problem;
use super::read::{Stop, parse_until};

/// Most misspelt names that are read past.
const MOST: usize = 20;

/// Text that is read past its misspelt names.
///
/// The reader stops at a misspelt field or variant. With the name that was probably meant it
/// goes on, so that the mistakes after it are found, too.
///
/// ```
/// use brakecheck_files::ron_file::Respelled;
/// use serde::Deserialize;
///
/// #[derive(Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Point { x_m: f64, y_m: f64 }
///
/// let read = Respelled::<Point>::of("(xm: 1.0, yy_m: 2.0)");
/// let point = read.value.expect("both names were guessed");
/// assert_eq!((point.x_m, point.y_m), (1.0, 2.0));
/// let places: Vec<_> = read.problems.iter().map(|it| it.span.clone()).collect();
/// assert_eq!(places, [1..3, 10..14]);
/// ```
pub struct Respelled<T> {
    /// Content of the text, `None` if the reader stopped in spite of it.
    pub value: Option<T>,
    /// Text with the names that were probably meant.
    pub text: String,
    /// Mistakes, with their places in the original text.
    pub problems: Vec<Problem>,
    edits: Vec<Edit>,
}

/// Name that was replaced.
struct Edit {
    start: usize,
    written: usize,
    meant: usize,
}

impl<T: DeserializeOwned> Respelled<T> {
    /// Reads a text.
    pub fn of(text: &str) -> Respelled<T> {
        let mut read = Respelled {
            value: None,
            text: text.to_owned(),
            problems: Vec::new(),
            edits: Vec::new(),
        };
        loop {
            let stop = match parse_until(&read.text) {
                Ok(value) => {
                    read.value = Some(value);
                    return read;
                }
                Err(stop) => stop,
            };
            let Stop {
                problem,
                meant,
                is_repeated,
            } = stop;
            // The guess was wrong if the text has the name already.
            if is_repeated && !read.edits.is_empty() {
                return read;
            }
            let span = problem.span.clone();
            let original = read.original(&span);
            read.problems.push(Problem {
                span: original,
                ..problem
            });
            match meant {
                Some(meant) if read.edits.len() < MOST => read.replace(span, meant),
                _ => return read,
            }
        }
    }

    fn replace(&mut self, span: Range<usize>, meant: &str) {
        self.edits.push(Edit {
            start: span.start,
            written: span.len(),
            meant: meant.len(),
        });
        self.text.replace_range(span, meant);
    }
}

impl<T> Respelled<T> {
    /// Returns the place in the original text of a place in the text.
    pub fn original(&self, span: &Range<usize>) -> Range<usize> {
        let (mut start, mut end) = (span.start, span.end);
        // The last edit first, since each one's places are those of the text
        // before it.
        for edit in self.edits.iter().rev() {
            let after = edit.start + edit.meant;
            // A place within a name is the whole name.
            start = if start >= after {
                start - edit.meant + edit.written
            } else {
                start.min(edit.start)
            };
            end = if end >= after {
                end - edit.meant + edit.written
            } else if end > edit.start {
                edit.start + edit.written
            } else {
                end
            };
        }
        start..end
    }
}
