//! World file of either kind: its value, its JSON schema, and reading its text.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::file::ScenarioFile;
use super::grid_file::GridFile;
use crate::ron_file::{ScenarioError, parse_ron, read};

/// World file of either kind, as its RON text names it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum WorldFile {
    /// Driving world.
    Scenario(Box<ScenarioFile>),
    /// World on a grid.
    Grid(Box<GridFile>),
}

impl WorldFile {
    /// Returns the name of the world.
    pub fn name(&self) -> &str {
        match self {
            WorldFile::Scenario(world) => &world.name,
            WorldFile::Grid(world) => &world.name,
        }
    }
}

/// Reads the RON text of a world as a value, whose names and numbers are unchecked.
///
/// `file` is the name of the world in errors.
///
/// # Errors
///
/// The text is no RON, or has other fields than a world.
pub fn parse(file: &str, text: &str) -> Result<WorldFile, ScenarioError> {
    // A byte order mark is no RON, and places of problems count without it.
    let bare = read::without_mark(text);
    parse_ron(bare).map_err(|problem| ScenarioError {
        file: file.to_owned(),
        text: bare.to_owned(),
        problems: vec![problem],
    })
}

/// Returns the JSON schema (draft 2020-12) of world files.
///
/// It describes the JSON of a [`WorldFile`], which has the structure of the RON text:
///
/// | RON | JSON | schema |
/// | --- | --- | --- |
/// | struct `(a: 1)` | `{"a": 1}` | `properties`, `required`, `additionalProperties: false` |
/// | variant `Rigid` | `"Rigid"` | `const` in a `oneOf`, or `enum` |
/// | variant `Ado(…)` | `{"Ado": …}` | in a `oneOf`, an object whose one property is the variant |
/// | tuple `(1, 2)` | `[1, 2]` | `prefixItems` |
/// | map `{"a": 1}` | `{"a": 1}` | `additionalProperties` with the schema of a value |
/// | short or long form | either | `anyOf` |
///
/// The root is a `oneOf` of `{"Scenario": …}` and `{"Grid": …}`. All named shapes are
/// under `$defs`, and `$ref` refers to them. Each field has a `description`. The
/// descriptions of optional fields of a world end with "Default: …".
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(WorldFile).to_value()
}
