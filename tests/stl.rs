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
#[path = "stl/undefined.rs"]
mod undefined;
#[path = "stl/vectors.rs"]
mod vectors;

/// Fewer cases in builds that are not optimised.
fn cases(cases: u32) -> proptest::prelude::ProptestConfig {
    let cases = if cfg!(debug_assertions) {
        cases / 10
    } else {
        cases
    };
    proptest::prelude::ProptestConfig {
        failure_persistence: None,
        cases,
        ..Default::default()
    }
}
