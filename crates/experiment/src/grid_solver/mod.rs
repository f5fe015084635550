//! Exact solutions of grid worlds: best ados, values and bisimulations.

pub mod bisimulation;
pub mod exact;
pub mod game_graph;
pub mod position_policy;
pub mod values;
