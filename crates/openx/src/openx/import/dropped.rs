//! List of the elements that have no effect, so that nothing is dropped silently.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use crate::opendrive::error::ImportError;
use crate::opendrive::scope::{ParameterScope, number};
use crate::opendrive::tree::XmlNode;

/// Elements of one kind that have no effect on the worlds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DroppedElements {
    /// Kind of the elements, such as `weather`.
    pub kind: &'static str,
    /// File of the first element.
    pub file: PathBuf,
    /// Line of the first element.
    pub line: usize,
    /// Number of elements in all files.
    pub count: usize,
}

/// Names of dropped elements with their kinds.
///
/// Elements below a dropped element belong to it and are not counted.
const KINDS: [(&str, &str); 23] = [
    ("AppearanceAction", "appearance"),
    ("ActivateControllerAction", "controllers"),
    ("ControllerAction", "controllers"),
    ("ObjectController", "controllers"),
    ("MonitorDeclaration", "monitors"),
    ("TimeOfDay", "time of day"),
    ("Trailer", "trailers"),
    ("TrailerCoupler", "trailers"),
    ("TrailerHitch", "trailers"),
    ("VisibilityAction", "visibility"),
    ("Weather", "weather"),
    ("bridge", "objects"),
    ("crossfall", "lateral profile"),
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
/// Elements that may be written without an effect.
const CURVES: [&str; 4] = ["crossfall", "height", "shape", "superelevation"];
/// Attributes that are all 0 if such an element has no effect.
const TERMS: [&str; 6] = ["a", "b", "c", "d", "inner", "outer"];

/// Collector of dropped elements, in the order of their discovery.
#[derive(Debug, Default)]
pub(super) struct DropLog(RefCell<DropLists>);

#[derive(Debug, Default)]
struct DropLists {
    kinds: Vec<DroppedElements>,
    /// Places of the counted elements by file, so that no element counts twice for a kind.
    known: BTreeMap<PathBuf, BTreeSet<(usize, &'static str)>>,
}

impl DropLog {
    /// Examines an element and all elements below it.
    pub(super) fn look(&self, node: &XmlNode) {
        let kind = KINDS.iter().find(|(name, _)| *name == node.name);
        match kind {
            Some((_, kind)) => {
                // Lights are counted when it is known which of them the ego passes.
                if !is_empty_element(node) && !is_light(node) {
                    self.note(kind, node);
                }
            }
            // A stop time ends the run. Every other stop condition is dropped.
            None if node.name == "StopTrigger" => {
                for group in node.children.iter().filter(|it| times(it).is_none()) {
                    self.note("stop conditions", group);
                }
            }
            None => node.children.iter().for_each(|child| self.look(child)),
        }
    }

    /// Counts an element, once for a kind however often it is found.
    pub(super) fn note(&self, kind: &'static str, node: &XmlNode) {
        let mut found = self.0.borrow_mut();
        let places = found.known.entry(node.file().to_owned()).or_default();
        // Every point reads the same files, and two references may name one
        // catalog entry.
        if !places.insert((node.place, kind)) {
            return;
        }
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

    /// Returns the dropped elements by kind.
    pub(super) fn list(&self) -> Vec<DroppedElements> {
        self.0.borrow().kinds.clone()
    }
}

/// Returns whether a signal may change.
pub(super) fn is_light(signal: &XmlNode) -> bool {
    signal.raw("dynamic") == Some("yes")
}

/// Returns true for a curve or a lane height whose terms are all 0.
fn is_empty_element(node: &XmlNode) -> bool {
    let is_curve = CURVES.contains(&node.name.as_str());
    let mut terms = TERMS.iter().filter_map(|term| node.raw(term));
    is_curve && terms.all(|term| number(term) == Some(0.0))
}

/// Conditions of a group, if all of them are simulation times and one of them comes.
///
/// Returns each condition with its time.
pub(super) fn times(group: &XmlNode) -> Option<Vec<(&XmlNode, &XmlNode)>> {
    // A single other condition makes the group none of times.
    let pairs = group
        .children
        .iter()
        .map(|condition| {
            let by = condition.child("ByValueCondition")?;
            Some((condition, by.child("SimulationTimeCondition")?))
        })
        .collect::<Option<Vec<_>>>()?;
    pairs
        .iter()
        .any(|(condition, time)| comes(condition, time))
        .then_some(pairs)
}

/// Returns whether a condition of time is false at first and true later.
fn comes(condition: &XmlNode, time: &XmlNode) -> bool {
    let is_falling = condition.raw("conditionEdge") == Some("falling");
    match time.raw("rule") {
        Some("greaterThan" | "greaterOrEqual" | "equalTo") => !is_falling,
        // Its end is what falls.
        Some("lessThan" | "lessOrEqual") => is_falling,
        _ => false,
    }
}

/// Time in seconds at which all conditions of a group hold first, or `None` for never.
///
/// # Errors
///
/// Returns an error for a value that is no number.
pub(super) fn time_s(
    pairs: &[(&XmlNode, &XmlNode)],
    scope: &ParameterScope,
) -> Result<Option<f64>, ImportError> {
    // All conditions must hold at one time, so the latest begin must not
    // pass the earliest end.
    let (mut from_s, mut until_s) = (0.0_f64, f64::INFINITY);
    for (condition, time) in pairs {
        let delay_s = scope.number_or_zero(condition, "delay")?;
        let at_s = scope.number(time, "value")? + delay_s;
        if comes(condition, time) {
            from_s = from_s.max(at_s);
        }
        let is_instant = time.raw("rule") == Some("equalTo");
        if is_instant || !comes(condition, time) {
            until_s = until_s.min(at_s);
        }
    }
    Ok((from_s <= until_s).then_some(from_s))
}
