//! Texts that the reader takes and refuses.

use std::fmt::Write;

use brakecheck_xml::xml::{XmlError, XmlParts, XmlTag, XmlText, read_xml};

/// Parts of a text as they arrive, one per word.
#[derive(Default)]
struct Parts(String);

impl XmlParts for Parts {
    type Error = XmlError;

    fn start(&mut self, tag: &XmlTag<'_>) -> Result<(), XmlError> {
        write!(self.0, "<{}", tag.name).expect("memory");
        for (name, value) in &tag.attributes {
            write!(self.0, " {name}={value}").expect("memory");
        }
        write!(self.0, "@{}>", tag.line).expect("memory");
        Ok(())
    }

    fn text(&mut self, text: &XmlText<'_>) -> Result<(), XmlError> {
        write!(self.0, "[{}:{}]", text.path.join("/"), text.text).expect("memory");
        Ok(())
    }

    fn end(&mut self, name: &str, line: u64) -> Result<(), XmlError> {
        write!(self.0, "</{name}@{line}>").expect("memory");
        Ok(())
    }

    fn error(&self, error: XmlError) -> XmlError {
        error
    }
}

fn read(text: &str) -> Result<String, String> {
    let mut parts = Parts::default();
    match read_xml(text.as_bytes(), &mut parts) {
        Ok(()) => Ok(parts.0),
        Err(error) => Err(error.to_string()),
    }
}

fn refusal(text: &str) -> String {
    read(text).expect_err("a refusal")
}

#[test]
fn elements_have_their_attributes_lines_and_whole_texts() {
    let cases = [
        (
            "\u{feff}<?xml version='1.0'?>\n<a x='1&amp;2'/>\n",
            "<a x=1&2@2></a@2>",
        ),
        ("<a\n x='1'\n>\n</a>", "<a x=1@3></a@4>"),
        // Escapes, comments and CDATA do not cut a number in two.
        (
            "<a> 1&#46;<!-- . -->2<![CDATA[5]]> </a>",
            "<a@1>[a:1.25]</a@1>",
        ),
        (
            "<a>one<b>two</b>three</a>",
            "<a@1>[a:one]<b@1>[a/b:two]</b@1>[a:three]</a@1>",
        ),
        ("<!DOCTYPE a SYSTEM 'a.dtd'><a/>", "<a@1></a@1>"),
        // Elements of another vocabulary keep their prefix.
        ("<a><x:road/></a>", "<a@1><x:road@1></x:road@1></a@1>"),
    ];
    for (text, parts) in cases {
        assert_eq!(read(text), Ok(parts.to_owned()), "{text}");
    }
}

#[test]
fn a_text_that_is_not_well_formed_is_refused_with_its_line() {
    let cases = [
        ("", "line 1: it has no element"),
        ("<a>\n<b>", "line 2: it ends inside `b`"),
        ("<a/>\n<b/>", "line 2: `b` is a second root element"),
        (
            "<a/>\nwords",
            "line 2: there is text outside of the root element",
        ),
        ("<a>&b;</a>", "line 1: unknown entity `b`"),
        (
            "<!DOCTYPE a [<!ENTITY b 'c'>]><a/>",
            "line 1: it declares entities",
        ),
    ];
    for (text, message) in cases {
        assert_eq!(refusal(text), message, "{text}");
    }
    // The words of the parser may change.
    for text in [
        "<a x='1' x='2'/>",
        "<a x=1/>",
        "<a x='&b;'/>",
        "<a></b>",
        "<a>&#0;</a>",
    ] {
        let message = refusal(text);
        assert!(message.starts_with("line 1: "), "{message}");
    }
}

#[test]
fn what_a_file_may_allocate_is_bounded() {
    let deep = |depth: usize| "<a>".repeat(depth) + &"</a>".repeat(depth);
    assert!(read(&deep(200)).is_ok());
    let message = "line 1: its elements nest more than 200 deep";
    assert_eq!(refusal(&deep(201)), message);
    let wide = |count: usize| {
        let attributes: String = (0..count).map(|i| format!(" x{i}='1'")).collect();
        format!("<a{attributes}/>")
    };
    assert!(read(&wide(200)).is_ok());
    let message = "line 1: it has more than 200 attributes";
    assert_eq!(refusal(&wide(201)), message);
    let message = "line 1: a tag, text or comment is longer than 16777216 bytes";
    for (before, after) in [("<a>", "</a>"), ("<a x='", "'/>"), ("<a><!--", "--></a>")] {
        let long = |bytes: usize| format!("{before}{}{after}", "x".repeat(bytes));
        assert!(read(&long(16_000_000)).is_ok());
        assert_eq!(refusal(&long(18_000_000)), message);
    }
    // A text in small pieces is as long.
    let pieces = format!("<a>{}</a>", "xxxxxxxx<!---->".repeat(2_200_000));
    assert_eq!(refusal(&pieces), message);
}
