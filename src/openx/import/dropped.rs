//! What files say and worlds do not: listed, since nothing is left out silently.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

use super::scope::number;
use super::tree::Node;

/// Elements of one kind that have no effect on the worlds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DroppedElements {
    /// What they are, such as `elevation`.
    pub kind: &'static str,
    /// The file of the first.
    pub file: PathBuf,
    /// Its line there.
    pub line: usize,
    /// Number of them, in all files.
    pub count: usize,
}

/// What is left out by the name of its element; what is below it belongs to it.
const KINDS: [(&str, &str); 28] = [
    ("AppearanceAction", "appearance"),
    ("AssignRouteAction", "routes"),
    ("ActivateControllerAction", "controllers"),
    ("ControllerAction", "controllers"),
    ("ObjectController", "controllers"),
    ("MonitorDeclaration", "monitors"),
    ("TimeOfDay", "time of day"),
    ("TrafficSignalController", "traffic signals"),
    ("Trailer", "trailers"),
    ("TrailerCoupler", "trailers"),
    ("TrailerHitch", "trailers"),
    ("VariableAction", "variables"),
    ("VisibilityAction", "visibility"),
    ("Weather", "weather"),
    ("bridge", "objects"),
    ("controller", "traffic signals"),
    ("crossfall", "lateral profile"),
    ("elevation", "elevation"),
    ("height", "lane heights"),
    ("object", "objects"),
    ("objectReference", "objects"),
    ("railroad", "railroads"),
    ("roadMark", "road marks"),
    ("shape", "lateral profile"),
    ("signal", "traffic signals"),
    ("signalReference", "traffic signals"),
    ("superelevation", "lateral profile"),
    ("tunnel", "objects"),
];
/// What may be written without saying anything.
const CURVES: [&str; 5] = [
    "crossfall",
    "elevation",
    "height",
    "shape",
    "superelevation",
];
/// The terms that then are all 0.
const TERMS: [&str; 6] = ["a", "b", "c", "d", "inner", "outer"];

/// A collector of what is left out, in the order in which it is met.
#[derive(Debug, Default)]
pub(super) struct DropLog(RefCell<DropLists>);

#[derive(Debug, Default)]
struct DropLists {
    kinds: Vec<DroppedElements>,
    /// Where each has been found, so that no element counts twice.
    known: BTreeMap<PathBuf, Vec<usize>>,
}

impl DropLog {
    /// Looks at an element and everything below it.
    pub fn look(&self, node: &Node) {
        let kind = KINDS.iter().find(|(name, _)| *name == node.name);
        match kind {
            Some((_, kind)) => {
                if !says_nothing(node) {
                    self.note(kind, node);
                }
            }
            None if node.name == "StopTrigger" => {
                for group in node.children.iter().filter(|it| lone_time(it).is_none()) {
                    self.note("stop conditions", group);
                }
            }
            None => node.children.iter().for_each(|child| self.look(child)),
        }
    }

    /// Notes an element, once however often it is met.
    pub fn note(&self, kind: &'static str, node: &Node) {
        let mut found = self.0.borrow_mut();
        let places = found.known.entry(node.file().to_owned()).or_default();
        if places.contains(&node.place) {
            return;
        }
        places.push(node.place);
        match found.kinds.iter_mut().find(|it| it.kind == kind) {
            Some(known) => known.count += 1,
            None => found.kinds.push(DroppedElements {
                kind,
                file: node.file().to_owned(),
                line: node.line,
                count: 1,
            }),
        }
    }

    /// All that was found.
    pub fn list(&self) -> Vec<DroppedElements> {
        self.0.borrow().kinds.clone()
    }
}

/// Whether it is a curve or a height of 0.
fn says_nothing(node: &Node) -> bool {
    let is_curve = CURVES.contains(&node.name.as_str());
    let mut terms = TERMS.iter().filter_map(|term| node.raw(term));
    is_curve && terms.all(|term| number(term) == Some(0.0))
}

/// The only condition of a group, if it is a time that comes.
pub(super) fn lone_time(group: &Node) -> Option<(&Node, &Node)> {
    let [condition] = &group.children[..] else {
        return None;
    };
    let time = condition
        .child("ByValueCondition")?
        .child("SimulationTimeCondition")?;
    let comes = matches!(time.raw("rule"), Some("greaterThan" | "greaterOrEqual"));
    (comes && condition.raw("conditionEdge") != Some("falling")).then_some((condition, time))
}
