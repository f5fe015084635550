//! Elements of a storyboard, with the names, parameters and actors that they have.

use std::collections::BTreeMap;
use std::rc::Rc;

use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::places::PositionContext;

/// Kind of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PartKind {
    Story,
    Act,
    ManeuverGroup,
    Maneuver,
    Event,
    Action,
}

impl PartKind {
    /// Returns the name of its elements in the file.
    fn element(self) -> &'static str {
        match self {
            PartKind::Story => "Story",
            PartKind::Act => "Act",
            PartKind::ManeuverGroup => "ManeuverGroup",
            PartKind::Maneuver => "Maneuver",
            PartKind::Event => "Event",
            PartKind::Action => "Action",
        }
    }

    /// Returns the kind that conditions call by a word.
    pub(super) fn called(word: &str) -> Option<PartKind> {
        // The standard's words for the kinds, which differ from the elements' names.
        Some(match word {
            "story" => PartKind::Story,
            "act" => PartKind::Act,
            "maneuverGroup" => PartKind::ManeuverGroup,
            "maneuver" => PartKind::Maneuver,
            "event" => PartKind::Event,
            "action" => PartKind::Action,
            _ => return None,
        })
    }

    fn inner(self) -> Option<PartKind> {
        match self {
            PartKind::Story => Some(PartKind::Act),
            PartKind::Act => Some(PartKind::ManeuverGroup),
            PartKind::ManeuverGroup => Some(PartKind::Maneuver),
            PartKind::Maneuver => Some(PartKind::Event),
            PartKind::Event => Some(PartKind::Action),
            PartKind::Action => None,
        }
    }
}

/// Element of a storyboard.
pub(super) struct StoryPart<'a> {
    pub kind: PartKind,
    pub node: &'a XmlNode,
    /// Name that no sibling has.
    pub name: String,
    pub scope: Rc<ParameterScope>,
    /// Actors of its group.
    pub actors: Rc<[String]>,
    /// Number of the element that holds it, and of those that it holds.
    pub parent: Option<usize>,
    pub parts: Vec<usize>,
}

/// Maneuvers of catalogs, by the places of the references to them.
pub(in super::super) type CatalogManeuvers = BTreeMap<usize, (XmlNode, ParameterScope)>;

/// Elements of a storyboard, each before those that it holds.
pub(in super::super) struct StoryParts<'a>(pub(super) Vec<StoryPart<'a>>);

/// Reads the maneuvers of catalogs that a storyboard refers to.
pub(in super::super) fn catalog_maneuvers(
    board: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
    blockers: &mut Blockers,
) -> CatalogManeuvers {
    let mut found = CatalogManeuvers::new();
    for story in board.all("Story") {
        let Some(own) = blockers.keep(own_scope(story, scope)) else {
            continue;
        };
        let groups = story.all("Act").flat_map(|act| act.all("ManeuverGroup"));
        for reference in groups.flat_map(|group| group.all("CatalogReference")) {
            let entry = ground.catalogs.entry(reference, &own, ground.files);
            // Keyed by place, because two references may name one entry.
            found.extend(blockers.keep(entry).map(|entry| (reference.place, entry)));
        }
    }
    found
}

fn own_scope(node: &XmlNode, scope: &ParameterScope) -> Result<ParameterScope, ImportError> {
    ParameterScope::declared(node.child("ParameterDeclarations"), scope, &[])
}

impl<'a> StoryParts<'a> {
    /// Returns the elements of a storyboard.
    ///
    /// An element whose parameters are not read is left out.
    pub(in super::super) fn of(
        board: &'a XmlNode,
        scope: &ParameterScope,
        catalogs: &'a CatalogManeuvers,
        blockers: &mut Blockers,
    ) -> StoryParts<'a> {
        let mut reader = PartReader {
            catalogs,
            blockers,
            parts: Vec::new(),
        };
        // Shared, since thousands of events may have one scope.
        let outer = Rc::new(scope.clone());
        let actors: Rc<[String]> = Rc::from(Vec::new());
        let mut names = Vec::new();
        for story in board.all("Story") {
            let part = StoryPart {
                kind: PartKind::Story,
                node: story,
                name: free_name(story, PartKind::Story, &mut names),
                scope: Rc::clone(&outer),
                actors: Rc::clone(&actors),
                parent: None,
                parts: Vec::new(),
            };
            reader.add(part);
        }
        StoryParts(reader.parts)
    }

    /// Returns the elements of a kind with a name, which may have those around it before it.
    pub(super) fn named(&self, kind: PartKind, name: &str) -> Vec<usize> {
        let words: Vec<&str> = name.split("::").collect();
        let is_it = |mut number: usize| {
            let mut words = words.iter().rev();
            // The last word is the name of the element itself, which is compared below.
            words.next();
            // Some of the elements around it may be left out.
            words.all(|word| {
                loop {
                    let Some(parent) = self.0[number].parent else {
                        return false;
                    };
                    number = parent;
                    if self.0[number].node.raw("name") == Some(word) {
                        return true;
                    }
                }
            })
        };
        let last = words.last().copied();
        let all = self.0.iter().enumerate();
        let named = all.filter(|(_, part)| part.kind == kind && part.node.raw("name") == last);
        let found = named.map(|(number, _)| number);
        found.filter(|number| is_it(*number)).collect()
    }

    /// Returns the names of an element, from its story on.
    pub(super) fn path(&self, number: usize) -> String {
        let part = &self.0[number];
        match part.parent {
            Some(parent) => format!("{}::{}", self.path(parent), part.name),
            None => part.name.clone(),
        }
    }

    /// Returns an element and those around it, from the inner one on.
    pub(super) fn around(&self, number: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(number), |it| self.0[*it].parent)
    }

    /// Returns the numbers of all elements of a kind.
    pub(super) fn all(&self, kind: PartKind) -> impl Iterator<Item = usize> {
        let all = self.0.iter().enumerate();
        all.filter(move |(_, part)| part.kind == kind)
            .map(|(number, _)| number)
    }
}

struct PartReader<'a, 'b> {
    catalogs: &'a CatalogManeuvers,
    blockers: &'b mut Blockers,
    parts: Vec<StoryPart<'a>>,
}

impl<'a> PartReader<'a, '_> {
    /// Adds an element, whose scope is that around it, and all that it holds.
    fn add(&mut self, mut part: StoryPart<'a>) -> Option<usize> {
        let (kind, node) = (part.kind, part.node);
        let declares = matches!(kind, PartKind::Story | PartKind::Maneuver);
        // The parameters of an entry of a catalog are those of its reference.
        if declares && node.child("ParameterDeclarations").is_some() && !self.is_entry(node) {
            part.scope = Rc::new(self.blockers.keep(own_scope(node, &part.scope))?);
        }
        if kind == PartKind::ManeuverGroup {
            part.actors = self.actors(&part);
        }
        let (scope, actors) = (Rc::clone(&part.scope), Rc::clone(&part.actors));
        // Before those that it holds, whose numbers are therefore greater.
        let number = self.parts.len();
        self.parts.push(part);
        let mut names = Vec::new();
        for child in &node.children {
            let Some(inner) = kind.inner() else { break };
            let entry = self.catalogs.get(&child.place);
            let (held, own) = match entry.filter(|_| is_reference(kind, child)) {
                Some((entry, own)) => (entry, Rc::new(own.clone())),
                None if child.name == inner.element() => (child, Rc::clone(&scope)),
                None => continue,
            };
            let held = self.add(StoryPart {
                kind: inner,
                node: held,
                name: free_name(held, inner, &mut names),
                scope: own,
                actors: Rc::clone(&actors),
                parent: Some(number),
                parts: Vec::new(),
            });
            self.parts[number].parts.extend(held);
        }
        Some(number)
    }

    fn is_entry(&self, node: &XmlNode) -> bool {
        // By identity: two entries may have the same text.
        let mut entries = self.catalogs.values();
        entries.any(|(entry, _)| std::ptr::eq(entry, node))
    }

    fn actors(&mut self, group: &StoryPart<'_>) -> Rc<[String]> {
        let list = group.node.child("Actors").into_iter();
        let names: Vec<_> = list
            .flat_map(|it| it.all("EntityRef"))
            .map(|it| group.scope.text(it, "entityRef"))
            .filter_map(|name| self.blockers.keep(name))
            .collect();
        Rc::from(names)
    }
}

fn is_reference(kind: PartKind, node: &XmlNode) -> bool {
    kind == PartKind::ManeuverGroup && node.name == "CatalogReference"
}

/// Returns the name of an element, with a number if a sibling has it.
fn free_name(node: &XmlNode, kind: PartKind, taken: &mut Vec<String>) -> String {
    // Files may leave names out, and a world requires them.
    let own = node.raw("name").filter(|name| !name.is_empty());
    // A world joins names by these.
    let stated = own.unwrap_or(kind.element()).replace("::", "_");
    let numbered = (2..).map(|number| format!("{stated} {number}"));
    let mut names = std::iter::once(stated.clone()).chain(numbered);
    let free = names.find(|name| !taken.contains(name)).unwrap_or(stated);
    taken.push(free.clone());
    free
}
