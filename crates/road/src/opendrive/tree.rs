//! XML tree with line numbers.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::error::{At, ImportError};
use super::files::Files;
use crate::xml::{XmlError, XmlParts, XmlProblem, XmlTag, XmlText, read_xml};

/// Greatest size of a file in bytes.
const MAX_BYTES: usize = 16 << 20;
/// Greatest number of elements and attributes of a file.
///
/// An element takes more memory than its text.
const MAX_ITEMS: usize = 1_000_000;
/// Fix of a text that is no XML.
const NO_XML: &str = "check the file with a tool such as xmllint";

/// Tree with its open elements, outermost first.
struct GrowingTree {
    file: Rc<PathBuf>,
    open: Vec<XmlNode>,
    root: Option<XmlNode>,
    items: usize,
}

impl XmlParts for GrowingTree {
    type Error = ImportError;

    fn start(&mut self, tag: &XmlTag<'_>) -> Result<(), ImportError> {
        let attributes = tag.attributes.iter();
        let node = XmlNode {
            name: tag.name.to_owned(),
            attributes: attributes
                // The text of the reader is borrowed, and the tree lives
                // longer.
                .map(|(name, value)| ((*name).to_owned(), value.to_string()))
                .collect(),
            children: Vec::new(),
            words: String::new(),
            line: tag.line as usize,
            place: tag.place as usize,
            file: Rc::clone(&self.file),
        };
        // Counted before the element is kept, so that memory is bounded while
        // reading.
        self.items += 1 + node.attributes.len();
        if self.items > MAX_ITEMS {
            let what = format!("it has more than {MAX_ITEMS} elements and attributes");
            return Err(self
                .here(tag.line, what)
                .helped("cut out the roads that the scenario uses"));
        }
        self.open.push(node);
        Ok(())
    }

    fn text(&mut self, text: &XmlText<'_>) -> Result<(), ImportError> {
        if let Some(node) = self.open.last_mut() {
            node.words.push_str(text.text);
        }
        Ok(())
    }

    fn end(&mut self, _: &str, _: u64) -> Result<(), ImportError> {
        let Some(node) = self.open.pop() else {
            return Ok(());
        };
        match self.open.last_mut() {
            Some(parent) => parent.children.push(node),
            None => self.root = Some(node),
        }
        Ok(())
    }

    fn error(&self, error: XmlError) -> ImportError {
        let what = match &error.problem {
            XmlProblem::Syntax(_) => format!("this is no XML: {}", error.problem),
            problem => problem.to_string(),
        };
        self.here(error.line, what).helped(NO_XML)
    }
}

impl GrowingTree {
    fn here(&self, line: u64, what: String) -> ImportError {
        At::element(&self.file, "here".to_owned(), line as usize).error(what)
    }
}

/// Element of a file.
#[derive(Clone, Debug)]
pub struct XmlNode {
    /// Name of the element.
    pub name: String,
    attributes: Vec<(String, String)>,
    /// Elements inside, in order.
    pub children: Vec<XmlNode>,
    /// Text directly inside, without space around it.
    pub words: String,
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
            let help = match error.kind() {
                std::io::ErrorKind::InvalidData => "save it as UTF-8",
                _ => "check its path, which counts from the file that names it",
            };
            at.error(error.to_string()).helped(help)
        })?;
        // A byte order mark is no part of the XML.
        let text = text.trim_start_matches('\u{feff}');
        // The words of the XML reader do not help with other kinds of files.
        if !text.trim_start().starts_with('<') {
            let what = format!("it is not an {standard} XML file");
            return Err(at.error(what).helped("name the XML file itself"));
        }
        XmlNode::parse(path, text)
    }

    /// Reads the root element of a text.
    ///
    /// # Errors
    ///
    /// Returns an error for a too large text, and for invalid XML.
    pub(crate) fn parse(path: &Path, text: &str) -> Result<XmlNode, ImportError> {
        // Every text is bounded here, whoever opened its file.
        if text.len() > MAX_BYTES {
            let what = format!("it is larger than {MAX_BYTES} bytes");
            return Err(At::file(path)
                .error(what)
                .helped("cut out the roads that the scenario uses"));
        }
        let mut tree = GrowingTree {
            file: Rc::new(path.to_owned()),
            open: Vec::new(),
            root: None,
            items: 0,
        };
        read_xml(text.as_bytes(), &mut tree)?;
        // Invariant: the reader refuses a text without an element.
        let none = || At::file(path).error("it has no element").helped(NO_XML);
        tree.root.ok_or_else(none)
    }

    /// Returns an element of a name around others, at the place of this one in the file.
    pub fn around(
        &self,
        name: &str,
        attributes: &[(&str, &str)],
        children: Vec<XmlNode>,
    ) -> XmlNode {
        let attributes = attributes.iter();
        XmlNode {
            name: name.to_owned(),
            attributes: attributes
                .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
                .collect(),
            words: String::new(),
            line: self.line,
            place: self.place,
            file: Rc::clone(&self.file),
            children,
        }
    }

    /// Writes another value of an attribute that it has.
    pub fn write(&mut self, name: &str, value: String) {
        let mut attributes = self.attributes.iter_mut();
        if let Some(known) = attributes.find(|(known, _)| known == name) {
            known.1 = value;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_well_formed_is_refused_at_its_line() {
        let cases = [
            ("<a>\n<b>", "it ends inside `b`"),
            // The reader of recordings once took the first value, and this one the last root.
            ("<a>\n<b id='1' id='2'/></a>", "this is no XML: "),
            ("<a/>\n<b/>", "`b` is a second root element"),
        ];
        for (text, says) in cases {
            let error = XmlNode::parse(Path::new("a.xodr"), text).expect_err(says);
            let begin = format!("`a.xodr`, line 2, here: {says}");
            assert!(error.to_string().starts_with(&begin), "{error}");
            assert_eq!(error.help.as_deref(), Some(NO_XML));
        }
    }

    #[test]
    fn a_text_beyond_the_limit_is_refused_before_it_is_parsed() {
        let text = |size: usize| format!("<OpenDRIVE>{}</OpenDRIVE>", " ".repeat(size));
        let path = Path::new("a.xodr");
        let most = MAX_BYTES - text(0).len();
        assert!(XmlNode::parse(path, &text(most)).is_ok());
        let error = XmlNode::parse(path, &text(most + 1)).expect_err("too large");
        assert!(
            error.to_string().contains("larger than 16777216 bytes"),
            "{error}"
        );
        assert!(error.help.is_some_and(|it| it.contains("cut out")));
    }
}
