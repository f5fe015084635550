//! Egos of other structures in a family: other controllers than the world's own,
//! each with ranges over its own parameters.

use rand::Rng;
use serde::Serialize;

use super::quantity::Quantity;
use crate::ego::{Actuated, ControllerSpec};

/// A controller of another kind, and how far its parameters vary.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Structure {
    /// Its name in the world file.
    pub name: String,
    pub(super) controller: Actuated<ControllerSpec>,
    /// Of its own parameters.
    pub(super) quantities: Vec<Quantity>,
}

impl Structure {
    /// An ego of this structure, every quantity uniform in its range.
    pub(super) fn draw(&self, rng: &mut impl Rng) -> Actuated<ControllerSpec> {
        let mut drawn = self.controller.clone();
        for quantity in &self.quantities {
            let set = drawn.set(quantity.varied.name(), quantity.draw(rng));
            // Invariant: checked at load against this controller.
            debug_assert!(set.is_ok(), "{:?} is a parameter", quantity.varied);
        }
        drawn
    }

    /// Whether a controller is of this kind, with all parameters in their ranges.
    pub(super) fn covers(&self, other: &Actuated<ControllerSpec>) -> bool {
        let own = self.controller.parameters();
        let varies = |name: &str| self.quantities.iter().find(|q| q.varied.name() == name);
        let pairs = other.parameters().into_iter().zip(&own);
        // Programs have no parameters that would tell one from another.
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
