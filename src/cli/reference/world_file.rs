//! Fields of world files, from the shapes that read them.

use serde_json::Value;

use super::egos;
use super::page::{ReferencePage, ReferenceTable};
use super::shapes;
use crate::sim::Body;
use crate::world_file;

/// Shapes that a world file begins with, above the others.
const FIRST: [&str; 2] = ["Scenario", "Grid"];

pub(super) fn page() -> ReferencePage {
    let about = "\
A world file is one RON value, `Scenario(…)` or `Grid(…)`. `brakecheck check WORLD` checks it, \
and `brakecheck check --schema` prints the same fields as JSON schema.

Each table has the fields of a shape, or its variants with theirs. \
The type of a field names another table. `brakecheck reference egos` has those of stock egos.";
    let bodies: Vec<String> = Body::shipped_names().map(|it| format!("`{it}`")).collect();
    let schema = world_file::schema();
    let egos = egos::names(&schema);
    let all = schema.get("$defs").and_then(Value::as_object);
    // Stock egos have a page of their own.
    let others = all.into_iter().flat_map(|all| all.keys()).filter(|name| {
        !FIRST.contains(&name.as_str()) && !egos.iter().any(|(ego, _)| ego == *name)
    });
    let names = FIRST.into_iter().chain(others.map(String::as_str));
    let tables = names.map(|name| {
        let shape = shapes::named(&schema, name);
        let rows = shapes::rows(shape).into_iter().map(Vec::from);
        ReferenceTable::new(
            format!("`{name}`"),
            &["field", "type", "default", "meaning"],
            rows,
        )
        .with_about(shapes::about(shape))
    });
    ReferencePage {
        title: "World files",
        about: format!("{about}\n\nShipped bodies: {}.", bodies.join(", ")),
        tables: tables.collect(),
    }
}
