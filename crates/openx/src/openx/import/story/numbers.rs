//! Numbers of a storyboard, as parameters of the world where points may differ in them.

use std::cell::RefCell;

use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::draft::tidy;
use crate::openx::import::seen::named;
use crate::story::values::StoryNumber;

/// Numbers of the storyboard at one point, in the order in which they are read.
#[derive(Debug, Default)]
pub(in super::super) struct StoryNumbers {
    /// True if the file is read at several points.
    varies: bool,
    parameters: RefCell<Vec<(String, f64)>>,
}

/// Element with its parameters, whose numbers are called after an element of the story.
#[derive(Clone, Copy)]
pub(in super::super) struct StatedIn<'a> {
    pub node: &'a XmlNode,
    pub scope: &'a ParameterScope,
    pub owner: &'a str,
}

impl<'a> StatedIn<'a> {
    /// Returns an element inside.
    pub(super) fn at(self, node: &'a XmlNode) -> StatedIn<'a> {
        StatedIn { node, ..self }
    }
}

impl StoryNumbers {
    pub(in super::super) fn new(varies: bool) -> StoryNumbers {
        StoryNumbers {
            varies,
            parameters: RefCell::default(),
        }
    }

    /// Returns the numbers that points may differ in, by the names of parameters.
    pub(in super::super) fn parameters(&self) -> Vec<(String, f64)> {
        self.parameters.borrow().clone()
    }

    /// Returns an attribute as a number, changed by a function.
    ///
    /// # Errors
    ///
    /// Returns an error for a missing attribute, and for one that is no number.
    pub(super) fn of(
        &self,
        at: StatedIn<'_>,
        name: &str,
        change: impl Fn(f64) -> f64,
    ) -> Result<StoryNumber, ImportError> {
        let value = change(at.scope.number(at.node, name)?);
        Ok(self.stated(at, &[name], value))
    }

    /// Returns an attribute as a number, or a number in its place.
    ///
    /// # Errors
    ///
    /// Returns an error for an attribute that is no number.
    pub(super) fn or(
        &self,
        at: StatedIn<'_>,
        name: &str,
        missing: f64,
    ) -> Result<StoryNumber, ImportError> {
        match at.node.raw(name) {
            Some(_) => self.of(at, name, |value| value),
            None => Ok(StoryNumber::Number(missing)),
        }
    }

    /// Returns a value that follows from attributes.
    pub(super) fn stated(&self, at: StatedIn<'_>, names: &[&str], value: f64) -> StoryNumber {
        // Expressions may combine parameters, of which the value is all that a world needs.
        let attributes = names.iter().filter_map(|name| at.node.raw(name));
        let refers = attributes.into_iter().any(|text| text.contains('$'));
        // Places follow from whatever a file says of its entities.
        if self.varies && (refers || names.is_empty()) {
            self.parameter(at.owner, names.first().unwrap_or(&"place"), value)
        } else {
            StoryNumber::Number(tidy(value))
        }
    }

    fn parameter(&self, owner: &str, name: &str, value: f64) -> StoryNumber {
        let mut known = self.parameters.borrow_mut();
        // Readers of a table of starts find the event by this name.
        let first = format!("{}_{}", named(owner), named(name));
        let numbered = (2..).map(|number| format!("{first}_{number}"));
        let mut names = std::iter::once(first.clone()).chain(numbered);
        let free = names.find(|name| known.iter().all(|(other, _)| other != name));
        let parameter = free.unwrap_or(first);
        known.push((parameter.clone(), tidy(value)));
        StoryNumber::Parameter(parameter)
    }
}
