//! Studies that are small enough for every `cargo test`.

mod letter;
mod near;
mod paper;
mod reusing;
mod structures;
mod table1;

use brakecheck::world::Scenario;

/// Returns the ACC world.
fn acc() -> Scenario {
    Scenario::parse("acc.ron", include_str!("../../../../worlds/acc.ron")).expect("a sound world")
}
