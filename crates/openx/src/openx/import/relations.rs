//! Relations between the entities and the elements of a file.

use std::collections::BTreeSet;

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

/// Orders the entities of an Init so that each follows those to which it is relative.
pub(super) fn ordered<'a>(privates: &[&'a XmlNode]) -> Vec<&'a XmlNode> {
    fn name(it: &XmlNode) -> &str {
        it.raw("entityRef").unwrap_or_default()
    }
    fn references<'a>(node: &'a XmlNode, all: &mut BTreeSet<&'a str>) {
        if node.name != "Private" {
            all.extend(node.raw("entityRef"));
        }
        node.children
            .iter()
            .for_each(|child| references(child, all));
    }
    // Searched once: a search for every pair of many entities takes minutes.
    let referring = privates.iter().map(|it| {
        let mut all = BTreeSet::new();
        references(it, &mut all);
        (*it, all)
    });
    let mut left: Vec<(&XmlNode, BTreeSet<&str>)> = referring.collect();
    let mut all = Vec::new();
    while !left.is_empty() {
        let is_free = |(it, to): &(&XmlNode, BTreeSet<&str>)| {
            let mut others = left.iter().filter(|(other, _)| name(other) != name(it));
            !others.any(|(other, _)| to.contains(name(other)))
        };
        // Places that refer to each other in a circle are refused later.
        let next = left.iter().position(is_free).unwrap_or(0);
        all.push(left.remove(next).0);
    }
    all
}

/// Names of the entities that an Init deletes.
pub(super) fn absent(init: &XmlNode) -> Vec<String> {
    let global = init.all("GlobalAction");
    let entities = global.filter_map(|it| it.child("EntityAction"));
    let deletes = entities.filter(|it| it.child("DeleteEntityAction").is_some());
    let names = deletes.filter_map(|it| it.raw("entityRef"));
    names.map(str::to_owned).collect()
}

/// Names of the entities that a controller may move.
pub(super) fn steered(root: &XmlNode, objects: &[&XmlNode]) -> Vec<String> {
    fn assigns(node: &XmlNode) -> bool {
        node.name == "AssignControllerAction" || node.children.iter().any(assigns)
    }
    let may_be_assigned = assigns(root);
    let has_one = |it: &&XmlNode| {
        let mut own = it.all("ObjectController");
        may_be_assigned || own.any(|own| !own.children.is_empty())
    };
    let steered = objects.iter().copied().filter(has_one);
    steered
        .filter_map(|it| it.raw("name").map(str::to_owned))
        .collect()
}

/// Parameters that an action changes during the run.
pub(super) fn changed_parameters(node: &XmlNode) -> Vec<String> {
    let here = (node.name == "ParameterAction")
        .then(|| node.raw("parameterRef"))
        .flatten()
        .map(|name| name.trim_start_matches('$').to_owned());
    let inner = node.children.iter().flat_map(changed_parameters);
    here.into_iter().chain(inner).collect()
}

/// Elements of a storyboard whose kind and name another of its elements has, too.
pub(super) fn ambiguous(board: &XmlNode) -> Vec<StoryElement> {
    const KINDS: [(&str, &str); 6] = [
        ("Story", "story"),
        ("Act", "act"),
        ("ManeuverGroup", "maneuverGroup"),
        ("Maneuver", "maneuver"),
        ("Event", "event"),
        ("Action", "action"),
    ];
    fn elements(node: &XmlNode, all: &mut Vec<StoryElement>) {
        let kind = KINDS.iter().find(|(name, _)| *name == node.name);
        all.extend(kind.and_then(|(_, kind)| StoryElement::of(kind, node)));
        node.children.iter().for_each(|child| elements(child, all));
    }
    let mut all = Vec::new();
    elements(board, &mut all);
    let mut known: BTreeSet<StoryElement> = BTreeSet::new();
    let mut twice = Vec::new();
    for element in all {
        if known.contains(&element) {
            twice.push(element);
        } else {
            known.insert(element);
        }
    }
    twice
}
