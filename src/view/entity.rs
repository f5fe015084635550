//! Names of entities: where in a recording something stands.

use rerun::EntityPath;

/// An entity path from parts that may hold any character.
pub(super) fn path<'a>(parts: impl IntoIterator<Item = &'a str>) -> EntityPath {
    EntityPath::from(
        parts
            .into_iter()
            .map(rerun::EntityPathPart::new)
            .collect::<Vec<_>>(),
    )
}

/// The entity of an agent's body.
pub(super) fn agent_path(name: &str) -> EntityPath {
    // `/world/road` is taken, and an agent may be called that.
    match name {
        "road" => path(["world", "road (agent)"]),
        name => path(["world", name]),
    }
}
