//! Elements of a storyboard that matter for the motion of anybody.

use super::parts::{PartKind, StoryParts};
use super::survey::content;
use crate::opendrive::tree::XmlNode;

/// Returns for each element whether the motion of anybody depends on it.
///
/// `moves` tells whether an action moves anybody by itself. What changes a variable
/// matters where something that matters reads it. The whole of an element matters where
/// something waits for its state.
pub(super) fn relevant(parts: &StoryParts<'_>, moves: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut reader = Relevance {
        parts,
        is_relevant: vec![false; parts.0.len()],
    };
    // From the actions outwards: elements without any of these stay unmarked.
    for action in parts.all(PartKind::Action).filter(|it| moves(*it)) {
        reader.mark(action);
    }
    // An event that moves nobody still stops those beside it.
    while let Some(event) = reader.stopping() {
        reader.mark(event);
    }
    reader.is_relevant
}

/// Returns the variable or the parameter that an action changes.
pub(super) fn changed(action: &XmlNode) -> Option<&str> {
    let (_, node) = content(action).ok()??;
    let name = node.raw("variableRef").or(node.raw("parameterRef"))?;
    let changes = matches!(
        node.name.as_str(),
        "VariableAction" | "ParameterAction" | "VariableSetAction" | "VariableModifyAction"
    );
    changes.then(|| name.trim_start_matches('$'))
}

struct Relevance<'a> {
    parts: &'a StoryParts<'a>,
    is_relevant: Vec<bool>,
}

impl Relevance<'_> {
    /// Marks an element, those around it, and what their triggers refer to.
    fn mark(&mut self, number: usize) {
        let around: Vec<usize> = self.parts.around(number).collect();
        for it in around {
            // Marked before its triggers are read, so elements that wait for each other
            // end the recursion.
            if std::mem::replace(&mut self.is_relevant[it], true) {
                continue;
            }
            let part = &self.parts.0[it];
            let triggers = ["StartTrigger", "StopTrigger"];
            for trigger in triggers.iter().filter_map(|name| part.node.child(name)) {
                self.refer(it, trigger);
            }
        }
    }

    /// Returns an unmarked event that stops the others of a marked maneuver.
    fn stopping(&self) -> Option<usize> {
        self.parts.all(PartKind::Event).find(|event| {
            let part = &self.parts.0[*event];
            let stops = matches!(part.node.raw("priority"), Some("override" | "overwrite"));
            let maneuver = part.parent.is_some_and(|it| self.is_relevant[it]);
            stops && maneuver && !self.is_relevant[*event]
        })
    }

    fn mark_whole(&mut self, number: usize) {
        self.mark(number);
        for inner in self.parts.0[number].parts.clone() {
            self.mark_whole(inner);
        }
    }

    fn refer(&mut self, from: usize, node: &XmlNode) {
        let scope = &self.parts.0[from].scope;
        match node.name.as_str() {
            "StoryboardElementStateCondition" => {
                let kind = node.raw("storyboardElementType").and_then(PartKind::called);
                let name = scope.text(node, "storyboardElementRef").ok();
                let found = kind
                    .zip(name)
                    .map(|(kind, name)| self.parts.named(kind, &name));
                // It ends with the last of its parts, even with one that moves nobody.
                for it in found.into_iter().flatten() {
                    self.mark_whole(it);
                }
            }
            "VariableCondition" | "ParameterCondition" => {
                let stated = node.raw("variableRef").or(node.raw("parameterRef"));
                // Older files write references with the sign of a value.
                let name = stated.map(|it| it.trim_start_matches('$').to_owned());
                let changing: Vec<usize> = self
                    .parts
                    .all(PartKind::Action)
                    .filter(|it| {
                        name.is_some() && changed(self.parts.0[*it].node) == name.as_deref()
                    })
                    .collect();
                changing.into_iter().for_each(|it| self.mark(it));
            }
            _ => node
                .children
                .iter()
                .for_each(|child| self.refer(from, child)),
        }
    }
}
