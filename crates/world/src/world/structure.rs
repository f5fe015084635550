//! Other structures in a family: controllers with ranges over their own parameters.

use rand::Rng;
use serde::Serialize;

use super::quantity::Quantity;
use crate::ego::{Actuated, ControllerSpec};

/// Controller of another kind, with the ranges of its parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Structure {
    /// Name in the world file.
    pub name: String,
    pub(super) controller: Actuated<ControllerSpec>,
    /// Ranges of its parameters.
    pub(super) quantities: Vec<Quantity>,
}

impl Structure {
    /// Returns an ego of this structure, every quantity uniform in its range.
    pub(super) fn draw(&self, rng: &mut impl Rng) -> Actuated<ControllerSpec> {
        self.at(self.quantities.iter().map(|quantity| quantity.draw(rng)))
    }

    /// Returns the ego with values of its quantities, in their order.
    pub(super) fn at(&self, values: impl Iterator<Item = f64>) -> Actuated<ControllerSpec> {
        // Parameters without a range keep the value of the file.
        let mut ego = self.controller.clone();
        for (quantity, value) in self.quantities.iter().zip(values) {
            let set = ego.set(quantity.varied.name(), value);
            // Invariant: checked at load against this controller.
            debug_assert!(set.is_ok(), "{:?} is a parameter", quantity.varied);
        }
        ego
    }

    /// Returns true for a controller of this kind with all parameters in their ranges.
    pub(super) fn covers(&self, other: &Actuated<ControllerSpec>) -> bool {
        let own = self.controller.parameters();
        let varies = |name: &str| self.quantities.iter().find(|q| q.varied.name() == name);
        // Pairs are only compared for equal kinds, whose parameters correspond
        // by position.
        let pairs = other.parameters().into_iter().zip(&own);
        // Programs have no parameters that would distinguish them.
        self.controller.controller.program().is_none()
            && self.controller.controller.kind() == other.controller.kind()
            && pairs
                .into_iter()
                .all(|(other, own)| match varies(own.name) {
                    Some(quantity) => quantity.contains(other.value),
                    None => own.value == other.value,
                })
    }
}
