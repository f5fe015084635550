//! Catalogs: named entries with parameters of their own.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::dropped::DropLog;
use super::words::write_words;
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::files::Files;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Names that a help lists at most.
const MOST_NAMES: usize = 20;

/// Catalogs of a scenario file.
///
/// `NAME.xosc` in one of the directories that the file lists is the catalog
/// `NAME`.
#[derive(Debug, Default)]
pub(super) struct Catalogs {
    directories: Vec<PathBuf>,
    /// Log of the elements of catalog entries that have no effect.
    dropped: Rc<DropLog>,
    read: RefCell<BTreeMap<String, Rc<XmlNode>>>,
    /// Problems of the list of directories.
    blockers: Blockers,
}

impl Catalogs {
    pub(super) fn of(root: &XmlNode, beside: &Path, dropped: Rc<DropLog>) -> Catalogs {
        let mut directories = Vec::new();
        let mut blockers = Blockers::default();
        for location in root
            .child("CatalogLocations")
            .into_iter()
            .flat_map(|it| &it.children)
            // An empty one names no place to look at.
            .filter(|it| !it.children.is_empty())
        {
            let path = location.inner("Directory").and_then(|it| it.need("path"));
            let Some(directory) = blockers.keep(path) else {
                continue;
            };
            directories.push(beside.join(directory));
            // Some players begin every path beside the scenario.
            let relative = directory.trim_start_matches('/');
            if relative != directory {
                directories.push(beside.join(relative));
            }
        }
        Catalogs {
            directories,
            dropped,
            read: RefCell::default(),
            blockers,
        }
    }

    /// Returns the problems of the list of directories.
    pub(super) fn sound(&self) -> Result<(), ImportError> {
        self.blockers.clone().none()
    }

    /// Counts an element of any file that has no effect.
    pub(super) fn note(&self, kind: &'static str, node: &XmlNode) {
        self.dropped.note(kind, node);
    }

    /// Returns the entry of a reference, with the parameters that it may use.
    ///
    /// # Errors
    ///
    /// Returns an error for an unknown catalog or entry, and for an invalid
    /// assignment.
    pub(super) fn entry(
        &self,
        reference: &XmlNode,
        scope: &ParameterScope,
        files: Files<'_>,
    ) -> Result<(XmlNode, ParameterScope), ImportError> {
        let catalog = scope.text(reference, "catalogName")?;
        let name = scope.text(reference, "entryName")?;
        let root = self.catalog(reference, &catalog, files)?;
        let list = root.inner("Catalog")?;
        let entry = list
            .children
            .iter()
            .find(|it| it.raw("name") == Some(&name))
            .ok_or_else(|| {
                let entries: Vec<&str> = list
                    .children
                    .iter()
                    .filter_map(|it| it.raw("name"))
                    .take(MOST_NAMES)
                    .collect();
                let help = format!("its entries: {}", entries.join(", "));
                let what = format!("the catalog `{catalog}` has no entry `{name}`");
                reference.refused(what, &help)
            })?;
        let assignments = reference
            .child("ParameterAssignments")
            .into_iter()
            .flat_map(|it| it.all("ParameterAssignment"));
        let set = assignments
            .map(|it| {
                Ok((
                    it.need("parameterRef")?.to_owned(),
                    scope.text(it, "value")?,
                ))
            })
            .collect::<Result<Vec<_>, ImportError>>()?;
        // Only entries in use are reported, since the rest of a catalog does
        // not matter.
        self.dropped.look(entry);
        // Parameters of the entry start from the caller's scope: assigned
        // values may refer to it.
        let own = ParameterScope::declared(entry.child("ParameterDeclarations"), scope, &set)?;
        let mut entry = entry.clone();
        // Words of the entry may be its parameters, whose values are known from here on.
        write_words(&mut entry, &own);
        Ok((entry, own))
    }

    fn catalog(
        &self,
        reference: &XmlNode,
        name: &str,
        files: Files<'_>,
    ) -> Result<Rc<XmlNode>, ImportError> {
        // Catalogs are cached: every entity at every point may refer to the
        // same file.
        if let Some(known) = self.read.borrow().get(name) {
            return Ok(Rc::clone(known));
        }
        let paths = self
            .directories
            .iter()
            .map(|it| it.join(format!("{name}.xosc")));
        let mut found = None;
        // Each directory of the list may lack the catalog.
        for path in paths.filter(|path| files(path).is_ok()) {
            let root = XmlNode::read(&path, "OpenSCENARIO", files)?;
            let catalog = root.child("Catalog");
            // A file of the right name may be another catalog, so the search
            // continues. It counts if no other does.
            let is_named = catalog.is_some_and(|it| it.raw("name") == Some(name));
            if is_named || (found.is_none() && catalog.is_some()) {
                found = Some(root);
            }
            if is_named {
                break;
            }
        }
        let root = Rc::new(found.ok_or_else(|| {
            let what =
                format!("there is no catalog `{name}.xosc` where the file looks for catalogs");
            let help = "put the file in a directory of its `CatalogLocations`";
            reference.refused(what, help)
        })?);
        let mut read = self.read.borrow_mut();
        read.insert(name.to_owned(), Rc::clone(&root));
        Ok(root)
    }
}
