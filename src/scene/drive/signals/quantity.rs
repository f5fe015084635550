//! What a published signal is, and the words in which a row of the list is said.

use super::super::spec::DriveSpec;
use super::super::state::SceneState;
use crate::stl::Interval;

/// Whose quantity it is; names begin with theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The clock's, which nobody influences.
    Clock,
    /// The scene's as a whole.
    Scene,
    /// A number of the start, which nobody influences; named by itself.
    Parameter,
    /// One agent's.
    Agent,
    /// Two agents', seen from the first.
    Pair,
    /// One traffic light's.
    Light,
    /// An agent's, before a light.
    AgentAndLight,
}

/// A row of the list.
#[derive(Debug)]
pub struct SignalQuantity {
    pub of: Of,
    /// The last part of the signal's name.
    pub name: &'static str,
    pub(super) former: &'static [&'static str],
    pub(super) unit: &'static str,
    pub(super) about: &'static str,
    pub(super) value: Value,
    /// In which worlds, of whom, there is such a signal.
    pub(super) exists: fn(&DriveSpec, [usize; 2]) -> bool,
    pub(super) bounds: fn(&DriveSpec, [usize; 2]) -> Interval,
    pub(super) usual: Option<(f64, f64)>,
    pub(super) always: bool,
}

/// How a value is read off a moving scene; the positions are of its owners.
#[derive(Debug)]
pub(super) enum Value {
    Real(fn(&SceneState, [usize; 2]) -> f64),
    Boolean(fn(&SceneState, [usize; 2]) -> bool),
}

/// A signal with whose it is, its name and its unit.
pub(super) struct Named(Of, &'static str, &'static str);

impl Of {
    pub(super) const fn signal(self, name: &'static str, unit: &'static str) -> Named {
        Named(self, name, unit)
    }
}

impl Named {
    /// A number that may be anything, unless `within` says otherwise.
    pub(super) const fn is(self, value: fn(&SceneState, [usize; 2]) -> f64) -> SignalQuantity {
        SignalQuantity {
            of: self.0,
            name: self.1,
            former: &[],
            unit: self.2,
            about: "",
            value: Value::Real(value),
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
            value: Value::Boolean(value),
            bounds: |_, _| zero_to(1.0),
            ..self.is(|_, _| 0.0)
        }
    }
}

impl SignalQuantity {
    /// `{a}` and `{b}` stand for the names of whose it is.
    pub(super) const fn about(self, about: &'static str) -> SignalQuantity {
        SignalQuantity { about, ..self }
    }

    /// Between what it stays in any run.
    pub(super) const fn within(
        self,
        bounds: fn(&DriveSpec, [usize; 2]) -> Interval,
    ) -> SignalQuantity {
        SignalQuantity { bounds, ..self }
    }

    /// In which worlds, of whom, there is such a signal; else in all.
    pub(super) const fn only_if(
        self,
        exists: fn(&DriveSpec, [usize; 2]) -> bool,
    ) -> SignalQuantity {
        SignalQuantity { exists, ..self }
    }

    /// By what range it is observed, where that is not all it can be.
    pub(super) const fn seen_in(self, lo: f64, hi: f64) -> SignalQuantity {
        SignalQuantity {
            usual: Some((lo, hi)),
            ..self
        }
    }

    /// What the last part of its name was in earlier versions: worlds and kept
    /// files that say the old one go on working.
    pub(super) const fn formerly(self, former: &'static [&'static str]) -> SignalQuantity {
        SignalQuantity { former, ..self }
    }

    /// Every trace holds it, mentioned or not.
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
