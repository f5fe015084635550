//! Exact solutions of grid worlds: best ados, values and bisimulations.

pub mod bisimulation;
pub mod exact;
pub mod values;
