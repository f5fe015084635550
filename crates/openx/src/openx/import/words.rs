//! Attributes that are words of the standard, which may be parameters.

use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Names of such attributes.
const WORDS: [&str; 20] = [
    "alongRoute",
    "closed",
    "conditionEdge",
    "continuous",
    "coordinateSystem",
    "direction",
    "displacement",
    "domainAbsoluteRelative",
    "dynamicsDimension",
    "dynamicsShape",
    "followingMode",
    "priority",
    "relativeDistanceType",
    "rule",
    "selectTriggeringEntities",
    "speedTargetValueType",
    "state",
    "storyboardElementType",
    "triggeringEntitiesRule",
    "type",
];

/// Replaces parameters by the words that they are, in an element and in all inside.
///
/// `scope` has those that the element itself declares. Unknown ones stay, and are refused
/// where the word is read.
pub(super) fn write_words(node: &mut XmlNode, scope: &ParameterScope) {
    for name in WORDS {
        // An expression in braces names no parameter here, and stays as it is.
        let word = node.raw(name).and_then(|it| it.strip_prefix('$'));
        if let Some(word) = word.and_then(|it| scope.get(it)).map(str::to_owned) {
            node.write(name, word);
        }
    }
    for inner in &mut node.children {
        let list = inner.child("ParameterDeclarations");
        // Problems of declarations are named where the element is read.
        let own = list.and_then(|_| ParameterScope::declared(list, scope, &[]).ok());
        write_words(inner, own.as_ref().unwrap_or(scope));
    }
}
