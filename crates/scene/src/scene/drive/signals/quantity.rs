//! Definition of a published signal, with the builder that rows of the list use.

use super::super::spec::DriveSpec;
use super::super::state::SceneState;
use crate::stl::Interval;

/// Owner of a quantity. Signal names begin with the names of their owners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    /// The clock, which no agent influences.
    Clock,
    /// The scene as a whole.
    Scene,
    /// A parameter of the start, which no agent influences. It has its own name.
    Parameter,
    /// A single agent.
    Agent,
    /// Two agents, seen from the first.
    Pair,
    /// A traffic light.
    Light,
    /// An agent in front of a light.
    AgentAndLight,
    /// The weather.
    Weather,
    /// The road that an ado lays.
    Road,
}

/// A row of the list of signals.
#[derive(Debug)]
pub struct SignalQuantity {
    pub(crate) of: Of,
    /// The last part of the signal's name.
    pub name: &'static str,
    pub(super) unit: &'static str,
    pub(super) about: &'static str,
    pub(super) value: QuantityReader,
    /// Worlds and owners for which the signal exists.
    pub(super) exists: fn(&DriveSpec, [usize; 2]) -> bool,
    pub(super) bounds: fn(&DriveSpec, [usize; 2]) -> Interval,
    pub(super) usual: Option<(f64, f64)>,
    pub(super) always: bool,
}

/// Function that reads a value from a scene, given the positions of its owners.
#[derive(Debug)]
pub(super) enum QuantityReader {
    Real(fn(&SceneState, [usize; 2]) -> f64),
    Boolean(fn(&SceneState, [usize; 2]) -> bool),
}

/// A signal with owner, name and unit.
pub(super) struct NamedQuantity(Of, &'static str, &'static str);

impl Of {
    pub(super) const fn signal(self, name: &'static str, unit: &'static str) -> NamedQuantity {
        NamedQuantity(self, name, unit)
    }
}

impl NamedQuantity {
    /// A number, unbounded unless `within` is added.
    pub(super) const fn is(self, value: fn(&SceneState, [usize; 2]) -> f64) -> SignalQuantity {
        SignalQuantity {
            of: self.0,
            name: self.1,
            unit: self.2,
            about: "",
            value: QuantityReader::Real(value),
            exists: |_, _| true,
            bounds: |_, _| Interval::ANY,
            usual: None,
            always: false,
        }
    }

    pub(super) const fn holds_if(
        self,
        value: fn(&SceneState, [usize; 2]) -> bool,
    ) -> SignalQuantity {
        SignalQuantity {
            value: QuantityReader::Boolean(value),
            bounds: |_, _| zero_to(1.0),
            ..self.is(|_, _| 0.0)
        }
    }
}

impl SignalQuantity {
    /// Sets the description, in which `{a}` and `{b}` are the owners' names.
    pub(super) const fn about(self, about: &'static str) -> SignalQuantity {
        SignalQuantity { about, ..self }
    }

    /// Sets an interval that contains the value in every run.
    pub(super) const fn within(
        self,
        bounds: fn(&DriveSpec, [usize; 2]) -> Interval,
    ) -> SignalQuantity {
        SignalQuantity { bounds, ..self }
    }

    /// Limits the signal to some worlds and owners.
    pub(super) const fn only_if(
        self,
        exists: fn(&DriveSpec, [usize; 2]) -> bool,
    ) -> SignalQuantity {
        SignalQuantity { exists, ..self }
    }

    /// Sets the range of observation, if it is smaller than the bounds.
    pub(super) const fn seen_in(self, lo: f64, hi: f64) -> SignalQuantity {
        SignalQuantity {
            usual: Some((lo, hi)),
            ..self
        }
    }

    /// Records the signal in every trace, mentioned or not.
    pub(super) const fn always(self) -> SignalQuantity {
        SignalQuantity {
            always: true,
            ..self
        }
    }
}

pub(super) const fn between(lo: f64, hi: f64) -> Interval {
    Interval { lo, hi }
}

pub(super) const fn zero_to(hi: f64) -> Interval {
    between(0.0, hi)
}
