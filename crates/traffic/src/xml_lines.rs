//! XML of recordings and maps: elements and texts with their file and line.

use std::io::Read;

use brakecheck_xml::xml::{XmlError, XmlParts, XmlProblem, XmlTag, XmlText, read_xml};

use crate::error::ReadError;
use crate::problem::{FilePlace, FileProblem};

/// Receiver of the elements of a file.
pub(crate) trait RecordedElements {
    /// Takes an element at its opening tag.
    fn start(&mut self, element: &PlacedElement<'_>) -> Result<(), ReadError>;

    /// Takes a text inside an element.
    fn inside(&mut self, _text: &PlacedText<'_>) -> Result<(), ReadError> {
        Ok(())
    }

    /// Takes the end of an element, at the place of its closing tag.
    fn end(&mut self, _name: &str, _place: FilePlace) -> Result<(), ReadError> {
        Ok(())
    }
}

/// Element with its place.
pub(crate) struct PlacedElement<'a> {
    tag: &'a XmlTag<'a>,
    file: &'a str,
}

impl PlacedElement<'_> {
    pub(crate) fn name(&self) -> &str {
        self.tag.name
    }

    pub(crate) fn error(&self, problem: FileProblem) -> ReadError {
        at_line(self.file, self.tag.line, problem)
    }

    /// Returns an attribute, `None` without it.
    pub(crate) fn optional(&self, name: &str) -> Option<&str> {
        self.tag.attribute(name)
    }

    pub(crate) fn text(&self, name: &str) -> Result<String, ReadError> {
        let missing = || {
            self.error(FileProblem::MissingAttribute {
                element: self.name().to_owned(),
                attribute: name.to_owned(),
            })
        };
        let found = self.optional(name).map(str::to_owned);
        found.ok_or_else(missing)
    }

    /// Returns a finite number.
    pub(crate) fn number(&self, name: &str) -> Result<f64, ReadError> {
        self.parsed(name, &self.text(name)?)
    }

    /// Returns a finite number, `None` without the attribute.
    pub(crate) fn optional_number(&self, name: &str) -> Result<Option<f64>, ReadError> {
        let text = self.optional(name);
        text.map(|text| self.parsed(name, text)).transpose()
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
            let problem = FileProblem::NotFinite {
                owner: self.path.last().cloned().unwrap_or_default(),
                name: name.to_owned(),
                text: crate::csv_rows::shown(self.text.as_bytes()),
            };
            at_line(self.file, self.line, problem)
        })
    }
}

/// Reads the elements of a file.
///
/// # Errors
/// The text is not XML, ends inside an element, or `elements` refuses a part.
pub(crate) fn read_elements(
    text: impl Read,
    file: &str,
    elements: &mut impl RecordedElements,
) -> Result<(), ReadError> {
    read_xml(text, &mut FileElements { file, elements })
}

/// Elements together with the name of their file, for errors.
struct FileElements<'a, E> {
    file: &'a str,
    elements: &'a mut E,
}

impl<E: RecordedElements> XmlParts for FileElements<'_, E> {
    type Error = ReadError;

    fn start(&mut self, tag: &XmlTag<'_>) -> Result<(), ReadError> {
        let file = self.file;
        self.elements.start(&PlacedElement { tag, file })
    }

    fn text(&mut self, text: &XmlText<'_>) -> Result<(), ReadError> {
        self.elements.inside(&PlacedText {
            path: text.path,
            text: text.text,
            file: self.file,
            line: text.line,
        })
    }

    fn end(&mut self, name: &str, line: u64) -> Result<(), ReadError> {
        self.elements.end(name, FilePlace::Line(line))
    }

    fn error(&self, error: XmlError) -> ReadError {
        let problem = match error.problem {
            XmlProblem::Unreadable(source) => {
                return ReadError::File {
                    file: self.file.to_owned(),
                    source,
                };
            }
            XmlProblem::Unclosed(name) => FileProblem::Unclosed(name),
            problem => FileProblem::Xml(problem.to_string()),
        };
        at_line(self.file, error.line, problem)
    }
}

fn at_line(file: &str, line: u64, problem: FileProblem) -> ReadError {
    ReadError::Content {
        file: file.to_owned(),
        place: FilePlace::Line(line),
        problem,
    }
}
