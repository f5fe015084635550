//! Exact solutions of grid worlds: best ados, values and bisimulations.

pub(crate) mod bisimulation;
pub(crate) mod exact;
pub(crate) mod values;
