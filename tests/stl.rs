//! The monitors against vectors, laws, a naive reference and hostile texts.

#[path = "stl/vectors.rs"]
mod vectors;
