//! Worlds that the arguments name.

use super::{Failure, ReproduceArgs};
use brakecheck::world::Scenario;

/// A shipped world, or one of that name in the directory that was named.
pub(super) fn world(args: &ReproduceArgs, name: &str) -> Result<Scenario, Failure> {
    // Copies of worlds may differ, and their results are never recorded.
    if let Some(dir) = &args.worlds {
        return Ok(Scenario::load(&dir.join(format!("{name}.ron")))?);
    }
    match Scenario::shipped(name) {
        Some(world) => Ok(world?),
        None => {
            // Test protocols are shipped as well, and are found by the same look-up.
            let known: Vec<&str> = Scenario::shipped_names()
                .chain(Scenario::protocol_names())
                .collect();
            Err(Failure::input(
                format!("no shipped world is called `{name}`"),
                format!("known: {}", known.join(", ")),
            ))
        }
    }
}

/// Requires that each named world exists.
pub(super) fn know_worlds(args: &ReproduceArgs) -> Result<(), Failure> {
    // Most studies skip names that they lack, and would be empty after a mistyped one.
    args.world
        .iter()
        .try_for_each(|name| world(args, name).map(|_| ()))
}
