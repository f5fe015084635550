//! Small world that `brakecheck new NAME` writes.

use super::Failure;
use crate::world::Scenario;

/// Text of the new world, without its name.
const WORLD: &str = include_str!("new_world.ron");

/// Returns the text of a small world of this name.
///
/// # Errors
/// The name cannot name a world.
pub(super) fn text_named(name: &str) -> Result<String, Failure> {
    let text = WORLD.replace("NAME", name);
    // The checks of the world decide on valid names.
    match Scenario::parse(name, &text) {
        Ok(_) => Ok(text),
        Err(_) => Err(Failure::input(
            format!("`{name}` cannot name a world"),
            "at most 64 letters, digits, _ and -: files are named after it",
        )),
    }
}
