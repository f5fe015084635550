//! Whatever is read from outside: a value or a named error, never a panic.
//!
//! Inputs are pure functions of a seed; CONTRIBUTING.md says how to run the
//! targets for long and how to run one case again.

mod answers;
mod corpus;
mod documents;
mod files;
mod formulas;
mod found;
mod harness;
mod kept;
mod mutate;
#[allow(dead_code)]
mod naive;
mod policies;
mod recordings;
mod samples;
mod serving;
mod worlds;
