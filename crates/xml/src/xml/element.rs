//! XML elements to write: a tree in memory.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

use crate::visible::visible_markup;

/// Element with its attributes and children, in the order of insertion.
#[derive(Clone, Debug)]
pub struct XmlElement {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<XmlElement>,
    words: String,
    on_one_line: bool,
}

impl XmlElement {
    /// Returns an element without attributes and children.
    pub fn new(name: &'static str) -> XmlElement {
        XmlElement {
            name,
            attributes: Vec::new(),
            children: Vec::new(),
            words: String::new(),
            on_one_line: false,
        }
    }

    /// Adds a text attribute on one line, with other control characters escaped.
    pub fn text(mut self, name: &'static str, value: impl AsRef<str>) -> XmlElement {
        // A reader takes line feeds and tabs in an attribute as spaces, too.
        let line = value.as_ref().replace(['\n', '\t'], " ");
        // XML 1.0 forbids most control characters, even as references.
        let value = visible_markup(&line).into_owned();
        self.attributes.push((name, value));
        self
    }

    /// Adds a number as an attribute.
    pub fn number(self, name: &'static str, value: f64) -> XmlElement {
        self.text(name, decimal(value))
    }

    /// Appends a child.
    pub fn child(mut self, child: XmlElement) -> XmlElement {
        self.children.push(child);
        self
    }

    /// Appends children.
    pub fn children(mut self, children: impl IntoIterator<Item = XmlElement>) -> XmlElement {
        self.children.extend(children);
        self
    }

    /// Sets the text inside an element without children.
    pub fn words(mut self, words: &str) -> XmlElement {
        self.words = visible_markup(words).into_owned();
        self
    }

    /// Keeps the element and its content on one line.
    pub fn on_one_line(mut self) -> XmlElement {
        self.on_one_line = true;
        self
    }

    /// Returns the document whose root is this element.
    ///
    /// # Errors
    ///
    /// Returns the error of the writer.
    pub fn document(&self) -> io::Result<String> {
        let mut writer = Writer::new(Vec::new());
        writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        self.write(&mut writer, Some(0))?;
        // Tools that read line by line expect an end of the last line.
        writer.write_event(Event::Text(BytesText::new("\n")))?;
        String::from_utf8(writer.into_inner()).map_err(io::Error::other)
    }

    /// Writes the element, indented by `depth`. Without a depth it continues the line.
    fn write(&self, writer: &mut Writer<Vec<u8>>, depth: Option<usize>) -> io::Result<()> {
        begin_line(writer, depth)?;
        let mut start = BytesStart::new(self.name);
        for (name, value) in &self.attributes {
            start.push_attribute((*name, value.as_str()));
        }
        if self.children.is_empty() && self.words.is_empty() {
            return writer.write_event(Event::Empty(start));
        }
        writer.write_event(Event::Start(start))?;
        if self.children.is_empty() {
            // No line begins inside, because a reader takes all space as part of the text.
            writer.write_event(Event::Text(BytesText::new(&self.words)))?;
            return writer.write_event(Event::End(BytesEnd::new(self.name)));
        }
        // Below an element on one line, no descendant starts a line.
        let within = depth.filter(|_| !self.on_one_line);
        for child in &self.children {
            child.write(writer, within.map(|depth| depth + 1))?;
        }
        begin_line(writer, within)?;
        writer.write_event(Event::End(BytesEnd::new(self.name)))
    }
}

fn begin_line(writer: &mut Writer<Vec<u8>>, depth: Option<usize>) -> io::Result<()> {
    let Some(depth) = depth else { return Ok(()) };
    let indent = format!("\n{}", "  ".repeat(depth));
    writer.write_event(Event::Text(BytesText::new(&indent)))
}

/// Shortest decimal that reads back bit for bit, without an exponent or −0.
pub fn decimal(value: f64) -> String {
    // −0 + 0 is 0, which drops the sign.
    (value + 0.0).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_disturb_a_document_is_escaped() {
        let rule = XmlElement::new("Rule").text("name", "a < b & \"c\"\nd\u{202e}");
        let root = XmlElement::new("Root").child(rule);
        let text = root.document().expect("in memory");
        let expected = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Root>\n  \
            <Rule name=\"a &lt; b &amp; &quot;c&quot; d\\u{202e}\"/>\n</Root>\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn numbers_are_short_and_plain() {
        let shown = [-0.0, 5.0, 0.1 + 0.2, -1e-9].map(decimal);
        assert_eq!(shown, ["0", "5", "0.30000000000000004", "-0.000000001"]);
    }

    #[test]
    fn vertices_stand_on_one_line() {
        let position = XmlElement::new("Position").child(XmlElement::new("World").number("x", 1.0));
        let vertex = XmlElement::new("Vertex").child(position).on_one_line();
        let text = XmlElement::new("All")
            .child(vertex)
            .document()
            .expect("in memory");
        assert!(
            text.contains("\n  <Vertex><Position><World x=\"1\"/></Position></Vertex>\n"),
            "{text}"
        );
    }
}
