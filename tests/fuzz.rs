//! Whatever is read from outside: a value or a named error, never a panic.
//!
//! Inputs are pure functions of a seed; docs/background/testing.md says how to run the
//! targets for long and how to run one case again.

#[path = "fuzz/answers.rs"]
mod answers;
#[path = "fuzz/corpus.rs"]
mod corpus;
#[path = "fuzz/documents.rs"]
mod documents;
#[path = "fuzz/files.rs"]
mod files;
#[path = "fuzz/formulas.rs"]
mod formulas;
#[path = "fuzz/found.rs"]
mod found;
#[path = "fuzz/harness.rs"]
mod harness;
#[path = "fuzz/kept.rs"]
mod kept;
#[path = "fuzz/mutate.rs"]
mod mutate;
#[path = "fuzz/naive.rs"]
#[allow(dead_code)]
mod naive;
#[path = "fuzz/policies.rs"]
mod policies;
#[path = "fuzz/recordings.rs"]
mod recordings;
#[path = "fuzz/samples.rs"]
mod samples;
#[path = "fuzz/serving.rs"]
mod serving;
#[path = "fuzz/worlds.rs"]
mod worlds;
