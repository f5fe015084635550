//! XML tree with line numbers.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use super::error::{At, ImportError};
use super::files::Files;

/// Greatest size of a file in bytes.
const MAX_BYTES: usize = 16 << 20;
/// Greatest depth of nested elements.
const MAX_DEPTH: usize = 200;
/// Greatest number of elements and attributes of a file, and of attributes of an element.
///
/// An element takes more memory than its text.
const MAX_ITEMS: usize = 1_000_000;
const MAX_ATTRIBUTES: usize = 200;
/// Fix of a text that is no XML.
const NO_XML: &str = "check the file with a tool such as xmllint";

/// Element of a file.
#[derive(Clone, Debug)]
pub struct XmlNode {
    /// Name of the element.
    pub name: String,
    attributes: Vec<(String, String)>,
    /// Elements inside, in order.
    pub children: Vec<XmlNode>,
    /// Line in the file, from 1.
    pub line: usize,
    /// Offset behind its opening tag, which distinguishes elements of one line.
    pub place: usize,
    file: Rc<PathBuf>,
}

impl XmlNode {
    /// Reads the root element of a file.
    ///
    /// # Errors
    ///
    /// Returns an error for an unreadable or too large file, and for invalid
    /// XML.
    pub fn read(path: &Path, standard: &str, files: Files<'_>) -> Result<XmlNode, ImportError> {
        let at = At::file(path);
        let text = files(path).map_err(|error| {
            let help = "check its path, which counts from the file that names it";
            at.error(error.to_string()).helped(help)
        })?;
        if text.len() > MAX_BYTES {
            let what = format!("it is larger than {MAX_BYTES} bytes");
            return Err(at
                .error(what)
                .helped("cut out the roads that the scenario uses"));
        }
        // A byte order mark is no part of the XML.
        let text = text.trim_start_matches('\u{feff}');
        // The words of the XML reader do not help with other kinds of files.
        if !text.trim_start().starts_with('<') {
            let what = format!("it is not an {standard} XML file");
            return Err(at.error(what).helped("name the XML file itself"));
        }
        XmlNode::parse(path, text)
    }

    pub(crate) fn parse(path: &Path, text: &str) -> Result<XmlNode, ImportError> {
        let file = Rc::new(path.to_owned());
        let mut reader = Reader::from_str(text);
        let (mut line, mut counted) = (1, 0);
        let mut open: Vec<XmlNode> = Vec::new();
        let mut root: Option<XmlNode> = None;
        let mut items = 0;
        loop {
            let event = reader.read_event();
            // The position lies behind the event, so the line is that of the
            // end of a tag.
            let upto = (reader.buffer_position() as usize).min(text.len());
            line += text
                .get(counted..upto)
                .map_or(0, |part| part.matches('\n').count());
            counted = upto;
            if items > MAX_ITEMS {
                let what = format!("it has more than {MAX_ITEMS} elements and attributes");
                let at = At::element(path, "here".to_owned(), line);
                return Err(at
                    .error(what)
                    .helped("cut out the roads that the scenario uses"));
            }
            let close =
                |open: &mut Vec<XmlNode>, root: &mut Option<XmlNode>, node: XmlNode| match open
                    .last_mut()
                {
                    Some(parent) => parent.children.push(node),
                    None => *root = Some(node),
                };
            match event {
                Ok(Event::Start(start)) => {
                    let node = XmlNode::of(&file, &start, (line, upto)).map_err(|what| {
                        let at = At::element(path, "here".to_owned(), line);
                        at.error(what).helped(NO_XML)
                    })?;
                    items += 1 + node.attributes.len();
                    open.push(node);
                    // Guards the stack of the recursive functions that read the
                    // tree.
                    if open.len() > MAX_DEPTH {
                        let what = format!("its elements nest more than {MAX_DEPTH} deep");
                        let at = At::element(path, "here".to_owned(), line);
                        return Err(at.error(what).helped(NO_XML));
                    }
                }
                Ok(Event::Empty(start)) => {
                    let node = XmlNode::of(&file, &start, (line, upto)).map_err(|what| {
                        let at = At::element(path, "here".to_owned(), line);
                        at.error(what).helped(NO_XML)
                    })?;
                    items += 1 + node.attributes.len();
                    close(&mut open, &mut root, node);
                }
                Ok(Event::End(_)) => {
                    if let Some(node) = open.pop() {
                        close(&mut open, &mut root, node);
                    }
                }
                Ok(Event::Eof) => break,
                Ok(_) => {}
                Err(error) => {
                    let what = format!("this is no XML: {error}");
                    let at = At::element(path, "here".to_owned(), line);
                    return Err(at.error(what).helped(NO_XML));
                }
            }
        }
        match (root, open.is_empty()) {
            (Some(root), true) => Ok(root),
            _ => {
                let what = "it ends before all its elements do";
                Err(At::file(path).error(what).helped(NO_XML))
            }
        }
    }

    fn of(
        file: &Rc<PathBuf>,
        start: &BytesStart<'_>,
        (line, place): (usize, usize),
    ) -> Result<XmlNode, String> {
        let attributes = start.attributes().enumerate().map(|(count, attribute)| {
            if count > MAX_ATTRIBUTES {
                return Err(format!("it has more than {MAX_ATTRIBUTES} attributes"));
            }
            let attribute = attribute.map_err(|error| error.to_string())?;
            let value = unescape(&attribute.value).map_err(|error| error.to_string())?;
            Ok((attribute.key.0.to_owned(), value.into_owned()))
        });
        Ok(XmlNode {
            name: start.name().0.to_owned(),
            attributes: attributes.collect::<Result<_, String>>()?,
            children: Vec::new(),
            line,
            place,
            file: Rc::clone(file),
        })
    }

    /// Returns an element of a name around it, at its place in the file.
    pub fn within(self, name: &str) -> XmlNode {
        XmlNode {
            name: name.to_owned(),
            attributes: Vec::new(),
            line: self.line,
            place: self.place,
            file: Rc::clone(&self.file),
            children: vec![self],
        }
    }

    /// Returns the number of elements of its tree, with itself.
    pub fn count(&self) -> usize {
        1 + self.children.iter().map(XmlNode::count).sum::<usize>()
    }

    /// Returns the path of its file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Returns its place for errors.
    pub fn at(&self) -> At {
        let name = self.raw("name").or_else(|| self.raw("entityRef"));
        let shown = match name {
            Some(name) => format!("{} `{name}`", self.name),
            None => self.name.clone(),
        };
        At::element(&self.file, shown, self.line)
    }

    /// Returns an error at this element.
    pub fn error(&self, what: impl Into<String>) -> ImportError {
        self.at().error(what)
    }

    /// Returns an error with a help.
    pub fn refused(&self, what: impl Into<String>, help: &str) -> ImportError {
        self.error(what).helped(help)
    }

    /// Returns an attribute as written.
    pub fn raw(&self, name: &str) -> Option<&str> {
        let mut attributes = self.attributes.iter();
        let found = attributes.find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str())
    }

    /// Returns a required attribute as written.
    pub fn need(&self, name: &str) -> Result<&str, ImportError> {
        self.raw(name).ok_or_else(|| {
            let help = format!("add the attribute `{name}`");
            self.refused(format!("it has no `{name}`"), &help)
        })
    }

    /// Returns the children of a name.
    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a XmlNode> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// Returns the first child of a name.
    pub fn child(&self, name: &str) -> Option<&XmlNode> {
        self.children.iter().find(|child| child.name == name)
    }

    /// Returns the first child of a name, or an error.
    pub fn inner(&self, name: &str) -> Result<&XmlNode, ImportError> {
        self.child(name).ok_or_else(|| {
            let help = format!("add a `{name}`");
            self.refused(format!("there is no `{name}` in it"), &help)
        })
    }

    /// Returns the first child, or an error for an empty element.
    ///
    /// It serves elements with exactly one child of several possible kinds.
    pub fn only(&self) -> Result<&XmlNode, ImportError> {
        self.children.first().ok_or_else(|| {
            let help = "write what belongs into it, or leave it out";
            self.refused("there is nothing in it", help)
        })
    }
}
