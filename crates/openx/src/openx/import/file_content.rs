//! Content of a scenario's files to which its places and events refer.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::catalog::Catalogs;
use super::ego_events::EgoRequest;
use super::places::{Placed, PositionContext};
use crate::opendrive::files::Files;
use crate::opendrive::roads::RoadMap;
use crate::opendrive::scope::number;
use crate::opendrive::tree::XmlNode;

/// Content of the files, beside the entities that are read one after another.
pub(super) struct FileContent<'a> {
    pub catalogs: &'a Catalogs,
    pub files: Files<'a>,
    pub ego: &'a EgoRequest,
    pub roads: Rc<RoadMap>,
    /// Entities that the Init deletes.
    pub absent: Vec<String>,
    /// Parameters that an action changes during the run.
    pub changed: Vec<String>,
    /// Entities that a controller may move.
    pub steered: Vec<String>,
    /// True if an `Orientation` without a type is relative.
    pub turns_relative: bool,
}

impl FileContent<'_> {
    /// Returns the context of a place, with the entities that have one so far.
    pub(super) fn ground<'a>(
        &'a self,
        placed: &'a BTreeMap<String, Placed>,
        unplaced: &'a [String],
    ) -> PositionContext<'a> {
        PositionContext {
            roads: &self.roads,
            catalogs: self.catalogs,
            files: self.files,
            placed,
            ego: self.ego,
            changed: &self.changed,
            unplaced,
            steered: &self.steered,
            absent: &self.absent,
            turns_relative: self.turns_relative,
            depth: 0,
        }
    }
}

/// Returns whether an `Orientation` without a type is relative.
///
/// Up to OpenSCENARIO 1.2 it is absolute.
pub(super) fn turns_relative(root: &XmlNode) -> bool {
    let header = root.child("FileHeader");
    let minor = header.and_then(|it| it.raw("revMinor"));
    minor.and_then(number).is_some_and(|minor| minor >= 3.0)
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
    /// Collects who may get a controller from actions: any entity, or those with a name.
    fn assigned<'a>(node: &'a XmlNode, who: Option<&'a str>, all: &mut Vec<Option<&'a str>>) {
        let who = match node.name.as_str() {
            // Actions of events name no entity, so any may get the controller.
            "Private" => node.raw("entityRef"),
            "AssignControllerAction" => {
                all.push(who);
                return;
            }
            _ => who,
        };
        node.children.iter().for_each(|it| assigned(it, who, all));
    }
    let mut may_get = Vec::new();
    assigned(root, None, &mut may_get);
    let has_one = |it: &&XmlNode| {
        let mut own = it.all("ObjectController");
        let gets = [None, it.raw("name")].iter().any(|it| may_get.contains(it));
        // An empty `ObjectController` refers to no controller.
        gets || own.any(|own| !own.children.is_empty())
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
        // Older files write references with the sign of a value.
        .map(|name| name.trim_start_matches('$').to_owned());
    let inner = node.children.iter().flat_map(changed_parameters);
    here.into_iter().chain(inner).collect()
}
