//! XML as it is read: elements with their attributes and lines.

use std::io::{BufRead, BufReader, Read};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::error::ReadError;
use crate::problem::{FilePlace, FileProblem};

/// Greatest nesting of elements.
const MOST_DEPTH: usize = 256;

/// Reader that counts the lines behind it.
pub(crate) struct LineCounter<R> {
    inner: BufReader<R>,
    pub(crate) line: u64,
}

impl<R: Read> LineCounter<R> {
    pub(crate) fn new(inner: R) -> LineCounter<R> {
        LineCounter {
            inner: BufReader::with_capacity(1 << 18, inner),
            line: 1,
        }
    }
}

impl<R: Read> Read for LineCounter<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let got = self.fill_buf()?.read(into)?;
        self.consume(got);
        Ok(got)
    }
}

impl<R: Read> BufRead for LineCounter<R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        let passed = &self.inner.buffer()[..amount];
        self.line += passed.iter().filter(|byte| **byte == b'\n').count() as u64;
        self.inner.consume(amount);
    }
}

/// Element with its place.
pub(crate) struct PlacedElement<'a> {
    pub(crate) tag: &'a BytesStart<'a>,
    file: &'a str,
    line: u64,
}

impl PlacedElement<'_> {
    pub(crate) fn name(&self) -> &str {
        self.tag.local_name().into_inner()
    }

    pub(crate) fn error(&self, problem: FileProblem) -> ReadError {
        ReadError::Content {
            file: self.file.to_owned(),
            place: FilePlace::Line(self.line),
            problem,
        }
    }

    /// Returns an attribute, `None` without it.
    pub(crate) fn optional(&self, name: &str) -> Result<Option<String>, ReadError> {
        let wrong = |error: String| self.error(FileProblem::Xml(error));
        let found = self.tag.try_get_attribute(name);
        let Some(found) = found.map_err(|error| wrong(error.to_string()))? else {
            return Ok(None);
        };
        let value =
            quick_xml::escape::unescape(&found.value).map_err(|error| wrong(error.to_string()))?;
        Ok(Some(value.into_owned()))
    }

    pub(crate) fn text(&self, name: &str) -> Result<String, ReadError> {
        let missing = || {
            self.error(FileProblem::MissingAttribute {
                element: self.name().to_owned(),
                attribute: name.to_owned(),
            })
        };
        self.optional(name)?.ok_or_else(missing)
    }

    /// Returns a finite number.
    pub(crate) fn number(&self, name: &str) -> Result<f64, ReadError> {
        self.parsed(name, &self.text(name)?)
    }

    /// Returns a finite number, `None` without the attribute.
    pub(crate) fn optional_number(&self, name: &str) -> Result<Option<f64>, ReadError> {
        let text = self.optional(name)?;
        text.map(|text| self.parsed(name, &text)).transpose()
    }

    fn parsed(&self, name: &str, text: &str) -> Result<f64, ReadError> {
        let value = text.trim().parse().ok().filter(|it: &f64| it.is_finite());
        value.ok_or_else(|| {
            self.error(FileProblem::NotFinite {
                owner: self.name().to_owned(),
                name: name.to_owned(),
                text: crate::csv_rows::shown(text.as_bytes()),
            })
        })
    }
}

/// Text inside an element, with its place.
pub(crate) struct PlacedText<'a> {
    /// Names of the elements around it, outermost first.
    pub(crate) path: &'a [String],
    pub(crate) text: &'a str,
    file: &'a str,
    line: u64,
}

impl PlacedText<'_> {
    /// Returns a finite number, which is the `name` of something.
    pub(crate) fn number(&self, name: &str) -> Result<f64, ReadError> {
        let value = self.text.parse().ok().filter(|it: &f64| it.is_finite());
        value.ok_or_else(|| {
            self.error(FileProblem::NotFinite {
                owner: self.path.last().cloned().unwrap_or_default(),
                name: name.to_owned(),
                text: crate::csv_rows::shown(self.text.as_bytes()),
            })
        })
    }

    pub(crate) fn error(&self, problem: FileProblem) -> ReadError {
        ReadError::Content {
            file: self.file.to_owned(),
            place: FilePlace::Line(self.line),
            problem,
        }
    }
}

/// Calls `start` and `end` for all elements of a file.
///
/// # Errors
/// The text is not XML, ends inside an element, or a call fails.
pub(crate) fn read_elements<S>(
    text: impl Read,
    file: &str,
    state: &mut S,
    start: impl FnMut(&mut S, &PlacedElement<'_>) -> Result<(), ReadError>,
    mut end: impl FnMut(&mut S, &str),
) -> Result<(), ReadError> {
    let end = |state: &mut S, name: &str, _| {
        end(state, name);
        Ok(())
    };
    read_elements_and_text(text, file, state, start, |_, _| Ok(()), end)
}

/// Calls `start`, `inside` and `end` for all elements of a file and their texts.
///
/// `end` gets the line at which the element ends.
///
/// # Errors
/// The text is not XML, ends inside an element, or a call fails.
pub(crate) fn read_elements_and_text<S>(
    text: impl Read,
    file: &str,
    state: &mut S,
    mut start: impl FnMut(&mut S, &PlacedElement<'_>) -> Result<(), ReadError>,
    mut inside: impl FnMut(&mut S, &PlacedText<'_>) -> Result<(), ReadError>,
    mut end: impl FnMut(&mut S, &str, FilePlace) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let mut reader = Reader::from_reader(LineCounter::new(text));
    let mut open: Vec<String> = Vec::new();
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        let event = reader.read_event_into(&mut buffer);
        // The reader is behind the event, so the line is that of the end of a tag.
        let line = reader.get_ref().line;
        let error = |problem| ReadError::Content {
            file: file.to_owned(),
            place: FilePlace::Line(line),
            problem,
        };
        match event {
            Ok(Event::Start(tag)) => {
                start(
                    state,
                    &PlacedElement {
                        tag: &tag,
                        file,
                        line,
                    },
                )?;
                open.push(tag.local_name().into_inner().to_owned());
                if open.len() > MOST_DEPTH {
                    let what = format!("more than {MOST_DEPTH} elements inside each other");
                    return Err(error(FileProblem::Xml(what)));
                }
            }
            Ok(Event::Empty(tag)) => {
                start(
                    state,
                    &PlacedElement {
                        tag: &tag,
                        file,
                        line,
                    },
                )?;
                end(state, tag.local_name().into_inner(), FilePlace::Line(line))?;
            }
            Ok(Event::End(tag)) => {
                open.pop();
                end(state, tag.local_name().into_inner(), FilePlace::Line(line))?;
            }
            Ok(Event::Text(text)) => {
                let text = text.trim();
                if !text.is_empty() {
                    inside(
                        state,
                        &PlacedText {
                            path: &open,
                            text,
                            file,
                            line,
                        },
                    )?;
                }
            }
            Ok(Event::Eof) => break,
            Ok(_) => {}
            Err(quick_xml::Error::Io(source)) => {
                return Err(ReadError::File {
                    file: file.to_owned(),
                    source: std::io::Error::new(source.kind(), source.to_string()),
                });
            }
            Err(wrong) => return Err(error(FileProblem::Xml(wrong.to_string()))),
        }
    }
    match open.pop() {
        None => Ok(()),
        Some(name) => Err(ReadError::Content {
            file: file.to_owned(),
            place: FilePlace::Line(reader.get_ref().line),
            problem: FileProblem::Unclosed(name),
        }),
    }
}
