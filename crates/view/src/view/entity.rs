//! Names of entities, which are their places in a recording.

use re_log_types::EntityPath;

/// Entity path from parts with any characters.
pub(super) fn path<'a>(parts: impl IntoIterator<Item = &'a str>) -> EntityPath {
    EntityPath::from(
        parts
            .into_iter()
            .map(re_log_types::EntityPathPart::new)
            .collect::<Vec<_>>(),
    )
}

/// Entity of an agent's body.
pub(super) fn agent_path(name: &str) -> EntityPath {
    // `/world/road` is reserved, and an agent may have that name.
    match name {
        "road" => path(["world", "road (agent)"]),
        name => path(["world", name]),
    }
}
