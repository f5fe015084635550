//! Stock egos with their parameters, from the shapes of world files.

use serde_json::Value;

use super::page::{ReferencePage, ReferenceTable};
use super::shapes;
use crate::world_file;

/// Shape with a variant per stock ego, named as the shape of its parameters.
const CONTROLLERS: &str = "ControllerSpec";

pub(super) fn page() -> ReferencePage {
    let about = "\
A world file names its ego as `drive: Ego(NAME(…))`, with all parameters that have no default. \
The end of a name has the unit of a parameter. Decelerations are positive.";
    let schema = world_file::schema();
    let tables = names(&schema).into_iter().map(|(name, about)| {
        let fields = shapes::rows(shapes::named(&schema, &name));
        // Types are left out, because the end of a name states the unit of a number.
        let rows = fields
            .into_iter()
            .map(|[name, _, default, meaning]| vec![name, default, meaning]);
        ReferenceTable::new(
            format!("`{name}`"),
            &["parameter", "default", "meaning"],
            rows,
        )
        .with_about(about)
    });
    ReferencePage {
        title: "Stock egos",
        about: about.to_owned(),
        tables: tables.collect(),
    }
}

/// Returns the stock egos of a schema, each with its behaviour.
pub(super) fn names(schema: &Value) -> Vec<(String, String)> {
    shapes::variants(shapes::named(schema, CONTROLLERS))
}
