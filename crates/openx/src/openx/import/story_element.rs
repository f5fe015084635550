//! Elements of a storyboard, as conditions refer to them.

use crate::opendrive::tree::XmlNode;

/// Element of a storyboard, as conditions refer to it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StoryElement {
    /// Kind: `act`, `maneuver`, `event`, `action`, ….
    pub kind: String,
    pub name: String,
}

impl StoryElement {
    /// Returns the element of a node, or `None` without a name.
    pub(super) fn of(kind: &str, node: &XmlNode) -> Option<StoryElement> {
        node.raw("name").map(|name| StoryElement {
            kind: kind.to_owned(),
            name: name.to_owned(),
        })
    }
}
