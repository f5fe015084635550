//! Errors of XML texts.

/// Problem of an XML text, with the line behind it.
#[derive(Debug, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct XmlError {
    /// Line, from 1.
    pub line: u64,
    /// Statement of the problem.
    pub problem: XmlProblem,
}

/// Problem of an XML text.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XmlProblem {
    /// The text cannot be read.
    #[error("{0}")]
    Unreadable(std::io::Error),
    /// The text violates the grammar.
    #[error("{0}")]
    Syntax(String),
    /// The text has no element.
    #[error("it has no element")]
    Empty,
    /// The text ends inside an element of this name.
    #[error("it ends inside `{0}`")]
    Unclosed(String),
    /// A second element beside the root.
    #[error("`{0}` is a second root element")]
    SecondRoot(String),
    /// Words outside of the root.
    #[error("there is text outside of the root element")]
    OutsideRoot,
    /// Elements nest too deep.
    #[error("its elements nest more than {0} deep")]
    TooDeep(usize),
    /// An element has too many attributes.
    #[error("it has more than {0} attributes")]
    ManyAttributes(usize),
    /// A tag, text or comment is too long.
    #[error("a tag, text or comment is longer than {0} bytes")]
    TooLong(usize),
    /// The text declares entities, which could grow without bound.
    #[error("it declares entities")]
    DeclaresEntities,
    /// A reference to an entity that XML does not define.
    #[error("unknown entity `{0}`")]
    UnknownEntity(String),
}
