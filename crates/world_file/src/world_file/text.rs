//! RON text of a world file.

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;

use super::world::WorldFile;

/// Depth of nested values that begin a line: fields, agents, and an agent's fields.
const LINES_DEPTH: usize = 3;

/// Returns the RON text of a world, which reads as an equal value.
///
/// Fields with their defaults are left out. Fields, agents and the fields of agents have
/// lines of their own.
///
/// # Errors
///
/// Values of world files are always written. The error is that of the writer.
pub fn text(world: &WorldFile) -> Result<String, ron::Error> {
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
    let layout = PrettyConfig::new()
        .depth_limit(LINES_DEPTH)
        .compact_arrays(false)
        .new_line("\n")
        .escape_strings(true);
    let mut text = options.to_string_pretty(world, layout)?;
    text.push('\n');
    Ok(text)
}
