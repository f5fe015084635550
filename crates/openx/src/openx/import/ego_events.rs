//! Events of a file that move the ego, which are left to the user's controller.

use std::cell::RefCell;
use std::path::PathBuf;

use crate::opendrive::tree::XmlNode;

/// Event of a file that moves the ego.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EgoEvent {
    /// Name of the event.
    pub name: String,
    /// File of the event.
    pub file: PathBuf,
    /// Line of the event.
    pub line: usize,
}

/// The ego, and what of its motion the import leaves out.
#[derive(Debug)]
pub(super) struct EgoRequest {
    pub name: String,
    /// True if its motion is left to the user.
    pub is_left: bool,
    events: RefCell<Vec<EgoEvent>>,
}

impl EgoRequest {
    pub(super) fn new(name: &str, is_left: bool) -> EgoRequest {
        EgoRequest {
            name: name.to_owned(),
            is_left,
            events: RefCell::default(),
        }
    }

    /// Records an event that moves the ego, once for all points.
    pub(super) fn leave(&self, event: &XmlNode) {
        let left = EgoEvent {
            // An Init has no events, and its `Private` has no name.
            name: event.raw("name").unwrap_or("Init").to_owned(),
            file: event.file().to_owned(),
            line: event.line,
        };
        let mut events = self.events.borrow_mut();
        if !events.contains(&left) {
            events.push(left);
        }
    }

    /// Returns the events so far, in file order.
    pub(super) fn events(&self) -> Vec<EgoEvent> {
        self.events.borrow().clone()
    }
}
