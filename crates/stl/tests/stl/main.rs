//! The monitors against vectors, laws, a naive reference and hostile texts.

mod dense;
mod errors;
mod explain;
mod hostile;
mod language;
mod laws;
mod naive;
mod online;
mod running;
mod stream;
mod undefined;
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
