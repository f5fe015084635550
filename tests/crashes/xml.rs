//! XML read back into a tree, to ask files what they say.

use std::collections::BTreeMap;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

#[derive(Debug, Default)]
pub(super) struct Node {
    pub name: String,
    attributes: BTreeMap<String, String>,
    pub children: Vec<Node>,
}

impl Node {
    /// The root of a document.
    pub fn read(text: &str) -> Node {
        let mut reader = Reader::from_str(text);
        let mut open = vec![Node::default()];
        loop {
            match reader.read_event().expect("XML") {
                Event::Start(start) => open.push(Node::of(&start)),
                Event::Empty(start) => open
                    .last_mut()
                    .expect("open")
                    .children
                    .push(Node::of(&start)),
                Event::End(_) => {
                    let closed = open.pop().expect("open");
                    open.last_mut().expect("open").children.push(closed);
                }
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(open.len(), 1, "everything is closed");
        open.remove(0).children.remove(0)
    }

    fn of(start: &BytesStart) -> Node {
        let attributes = start.attributes().map(|attribute| {
            let attribute = attribute.expect("an attribute");
            let value = unescape(&attribute.value).expect("escaped").into_owned();
            (attribute.key.0.to_owned(), value)
        });
        Node {
            name: start.name().0.to_owned(),
            attributes: attributes.collect(),
            children: Vec::new(),
        }
    }

    pub fn text(&self, attribute: &str) -> &str {
        let value = self.attributes.get(attribute);
        value.unwrap_or_else(|| panic!("`{}` has no `{attribute}`", self.name))
    }

    pub fn number(&self, attribute: &str) -> f64 {
        self.text(attribute).parse().expect("a number")
    }

    /// Everything of a name in it, in order.
    pub fn all(&self, name: &str) -> Vec<&Node> {
        let mut found: Vec<&Node> = Vec::new();
        for child in &self.children {
            if child.name == name {
                found.push(child);
            }
            found.extend(child.all(name));
        }
        found
    }

    /// The only one of a name in it.
    pub fn one(&self, name: &str) -> &Node {
        let all = self.all(name);
        assert_eq!(all.len(), 1, "`{name}` in `{}`", self.name);
        all[0]
    }

    /// The one of a name that an attribute names.
    pub fn named(&self, name: &str, attribute: &str, value: &str) -> &Node {
        let all = self.all(name).into_iter();
        let mut named = all.filter(|node| node.text(attribute) == value);
        let first = named.next();
        first.unwrap_or_else(|| panic!("no `{name}` with {attribute} = {value}"))
    }
}
