//! XML elements: the one reader of all formats, and the one writer.

mod element;
mod line_counter;
mod problem;
mod read;

pub use element::{XmlElement, decimal};
pub use problem::{XmlError, XmlProblem};
pub use read::{XmlParts, XmlTag, XmlText, read_xml};
