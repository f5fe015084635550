//! The monitors against vectors, laws, a naive reference and hostile texts.

#[path = "stl/errors.rs"]
mod errors;
#[path = "stl/explain.rs"]
mod explain;
#[path = "stl/hostile.rs"]
mod hostile;
#[path = "stl/language.rs"]
mod language;
#[path = "stl/laws.rs"]
mod laws;
#[path = "stl/naive.rs"]
mod naive;
#[path = "stl/online.rs"]
mod online;
#[path = "stl/vectors.rs"]
mod vectors;
