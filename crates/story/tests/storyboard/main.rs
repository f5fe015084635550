//! Storyboards behave as the sentences of OpenSCENARIO 1.3 state.

mod actors;
mod conditions;
mod elements;
mod formulas;
mod instants;
mod mistakes;
mod toy;
