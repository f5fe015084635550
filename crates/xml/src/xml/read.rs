//! XML read part by part: elements with their attributes and lines, and texts.

use std::borrow::Cow;
use std::io::Read;

use quick_xml::Reader;
use quick_xml::errors::Error;
use quick_xml::escape::{resolve_predefined_entity, unescape};
use quick_xml::events::{BytesEnd, BytesRef, BytesStart, Event};

use super::line_counter::{LineCounter, MAX_PART_BYTES};
use super::problem::{XmlError, XmlProblem};

/// Greatest depth of nested elements, which guards the stack of recursive readers.
const MAX_DEPTH: usize = 200;
/// Greatest number of attributes of an element, which are compared with each other.
const MAX_ATTRIBUTES: usize = 200;

/// Receiver of the parts of an XML text, in their order.
pub trait XmlParts {
    /// Error of the receiver.
    type Error;

    /// Returns an error of the text as one of the receiver, which knows its file.
    fn error(&self, error: XmlError) -> Self::Error;

    /// Takes an element at its opening tag.
    ///
    /// # Errors
    /// The receiver refuses the element.
    fn start(&mut self, tag: &XmlTag<'_>) -> Result<(), Self::Error>;

    /// Takes the text before a tag, if it is not blank.
    ///
    /// # Errors
    /// The receiver refuses the text.
    fn text(&mut self, _text: &XmlText<'_>) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Takes the end of an element by its name, and the line of its closing tag.
    ///
    /// # Errors
    /// The receiver refuses what the element lacks.
    fn end(&mut self, _name: &str, _line: u64) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// Opening tag of an element.
pub struct XmlTag<'a> {
    /// Name as written, with its prefix: an element with one belongs to another vocabulary.
    pub name: &'a str,
    /// Attributes in order, each once, without escapes.
    pub attributes: Vec<(&'a str, Cow<'a, str>)>,
    /// Line of the end of the tag, from 1.
    pub line: u64,
    /// Offset in bytes behind the tag, which distinguishes elements of one line.
    pub place: u64,
}

impl XmlTag<'_> {
    /// Returns the value of an attribute, if it is there.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(known, _)| *known == name);
        found.map(|(_, value)| &**value)
    }
}

/// Text inside an element.
pub struct XmlText<'a> {
    /// Names of the elements around it, outermost first.
    pub path: &'a [String],
    /// Text without escapes, and without space around it.
    pub text: &'a str,
    /// Line of its end, from 1.
    pub line: u64,
}

/// Reads an XML text of any length, in a bounded amount of memory.
///
/// It is UTF-8, with one root element. Comments and processing instructions are skipped, and
/// so is a document type without entities.
///
/// # Errors
/// The text cannot be read, is not well-formed, or exceeds a limit, or `parts` refuses a part.
pub fn read_xml<P: XmlParts>(text: impl Read, parts: &mut P) -> Result<(), P::Error> {
    let mut reader = Reader::from_reader(LineCounter::new(text));
    // Receivers then need no second path for elements without content.
    reader.config_mut().expand_empty_elements = true;
    let mut open = OpenElements::default();
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        // Set back for each part, since the whole text may be of any length.
        reader.get_mut().part_bytes = 0;
        let event = reader.read_event_into(&mut buffer);
        // The reader is behind the event, so the line is that of the end of a tag.
        let (line, place) = (reader.get_ref().line, reader.buffer_position());
        // A tag ends the text before it, which comments and entities may have split.
        if let Ok(Event::Start(_) | Event::End(_) | Event::Eof) = event {
            open.tell(parts, line)?;
        }
        let step = event.map_err(problem_of).and_then(|it| open.take(it));
        let refused = |problem| XmlError { line, problem };
        match step.map_err(|it| parts.error(refused(it)))? {
            ReaderStep::Start(start) => {
                let tag = tag_of(&start, line, place);
                parts.start(&tag.map_err(|it| parts.error(refused(it)))?)?;
            }
            ReaderStep::End(end) => parts.end(end.name().0, line)?,
            ReaderStep::Inside => {}
            ReaderStep::Eof => return Ok(()),
        }
    }
}

/// Event after its effect on the open elements.
enum ReaderStep<'a> {
    Start(BytesStart<'a>),
    End(BytesEnd<'a>),
    /// Text, or a part that is skipped.
    Inside,
    Eof,
}

/// Elements that are open at a place, and the text since the last tag.
#[derive(Default)]
struct OpenElements {
    path: Vec<String>,
    text: String,
    has_root: bool,
}

impl OpenElements {
    fn take<'a>(&mut self, event: Event<'a>) -> Result<ReaderStep<'a>, XmlProblem> {
        match event {
            Event::Start(start) => {
                self.push(start.name().0)?;
                return Ok(ReaderStep::Start(start));
            }
            Event::End(end) => {
                self.path.pop();
                return Ok(ReaderStep::End(end));
            }
            Event::Text(text) => self.add(&text.xml10_content())?,
            Event::CData(text) => self.add(&text.xml10_content())?,
            Event::GeneralRef(entity) => self.add(&resolved(&entity)?)?,
            // Nested entities of a few lines stand for gigabytes.
            Event::DocType(text) if text.contains("<!ENTITY") => {
                return Err(XmlProblem::DeclaresEntities);
            }
            Event::Eof => {
                self.close()?;
                return Ok(ReaderStep::Eof);
            }
            // The configuration turns an empty element into a start and an end.
            Event::Empty(_) => {}
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
        }
        Ok(ReaderStep::Inside)
    }

    fn push(&mut self, name: &str) -> Result<(), XmlProblem> {
        if self.path.is_empty() && self.has_root {
            return Err(XmlProblem::SecondRoot(name.to_owned()));
        }
        self.has_root = true;
        self.path.push(name.to_owned());
        if self.path.len() > MAX_DEPTH {
            return Err(XmlProblem::TooDeep(MAX_DEPTH));
        }
        Ok(())
    }

    /// Appends to the text: comments, escapes and CDATA cut one text into pieces.
    fn add(&mut self, piece: &str) -> Result<(), XmlProblem> {
        let is_blank = piece.trim().is_empty();
        // Indentation would otherwise be collected between all elements.
        if self.text.is_empty() && is_blank {
            return Ok(());
        }
        if self.path.is_empty() && !is_blank {
            return Err(XmlProblem::OutsideRoot);
        }
        self.text.push_str(piece);
        if self.text.len() > MAX_PART_BYTES {
            return Err(XmlProblem::TooLong(MAX_PART_BYTES));
        }
        Ok(())
    }

    /// Hands the text over.
    fn tell<P: XmlParts>(&mut self, parts: &mut P, line: u64) -> Result<(), P::Error> {
        let text = self.text.trim();
        if text.is_empty() {
            return Ok(());
        }
        parts.text(&XmlText {
            path: &self.path,
            text,
            line,
        })?;
        self.text.clear();
        Ok(())
    }

    fn close(&mut self) -> Result<(), XmlProblem> {
        match self.path.pop() {
            Some(name) => Err(XmlProblem::Unclosed(name)),
            None if self.has_root => Ok(()),
            None => Err(XmlProblem::Empty),
        }
    }
}

/// Returns a tag, all of whose attributes are well-formed, whether they are read or not.
fn tag_of<'a>(start: &'a BytesStart<'a>, line: u64, place: u64) -> Result<XmlTag<'a>, XmlProblem> {
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        if attributes.len() == MAX_ATTRIBUTES {
            return Err(XmlProblem::ManyAttributes(MAX_ATTRIBUTES));
        }
        let attribute = attribute.map_err(|error| XmlProblem::Syntax(error.to_string()))?;
        let value = match attribute.value {
            Cow::Borrowed(value) => unescape(value),
            Cow::Owned(value) => unescape(&value).map(|it| Cow::Owned(it.into_owned())),
        };
        let value = value.map_err(|error| XmlProblem::Syntax(error.to_string()))?;
        attributes.push((attribute.key.0, value));
    }
    Ok(XmlTag {
        name: start.name().0,
        attributes,
        line,
        place,
    })
}

/// Returns the text of a character reference, or of one of the five entities of XML.
fn resolved(entity: &BytesRef<'_>) -> Result<String, XmlProblem> {
    let character = entity.resolve_char_ref();
    if let Some(character) = character.map_err(|error| XmlProblem::Syntax(error.to_string()))? {
        return Ok(character.to_string());
    }
    let known = resolve_predefined_entity(entity).map(str::to_owned);
    known.ok_or_else(|| XmlProblem::UnknownEntity(entity.to_string()))
}

fn problem_of(error: Error) -> XmlProblem {
    match error {
        Error::Io(source) if source.kind() == std::io::ErrorKind::FileTooLarge => {
            XmlProblem::TooLong(MAX_PART_BYTES)
        }
        Error::Io(source) => {
            // The parser shares its error, and an owned one keeps the kind.
            XmlProblem::Unreadable(std::io::Error::new(source.kind(), source.to_string()))
        }
        error => XmlProblem::Syntax(error.to_string()),
    }
}
