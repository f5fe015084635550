//! Bounds on what a scenario file may ask for.

use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;

/// Greatest numbers of elements of a kind, each far beyond what a world can hold.
const MOST: [(&str, usize); 17] = [
    ("ScenarioObject", 500),
    ("Private", 500),
    ("Story", 1_000),
    ("Act", 1_000),
    ("ManeuverGroup", 1_000),
    ("Maneuver", 1_000),
    ("EntityRef", 5_000),
    ("Event", 1_000),
    ("Action", 5_000),
    ("ConditionGroup", 5_000),
    ("Condition", 5_000),
    ("ParameterDeclaration", 5_000),
    ("Vertex", 20_000),
    ("ClothoidSplineSegment", 2_000),
    ("Waypoint", 2_000),
    ("Phase", 5_000),
    // A controller may refer to another, whose delay is looked up through all of them.
    ("TrafficSignalController", 200),
];

/// Refuses a file with more elements of a kind than are read in reasonable time.
pub(super) fn few(root: &XmlNode) -> Result<(), ImportError> {
    fn count<'a>(node: &'a XmlNode, counts: &mut [usize; MOST.len()]) -> Option<&'a XmlNode> {
        if let Some(kind) = MOST.iter().position(|(name, _)| *name == node.name) {
            counts[kind] += 1;
            if MOST[kind].1 < counts[kind] {
                // The count ends here, so a hostile file costs no more than a large one.
                return Some(node);
            }
        }
        node.children.iter().find_map(|child| count(child, counts))
    }
    let Some(first_too_many) = count(root, &mut [0; MOST.len()]) else {
        return Ok(());
    };
    let most = MOST.iter().find(|(name, _)| *name == first_too_many.name);
    let most = most.map_or(0, |(_, most)| *most);
    let what = format!("more than {most} elements of this kind");
    Err(first_too_many.refused(what, "split the scenario"))
}
