//! Numbers of a storyboard that may depend on the start.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Number, or the name of a parameter of the world: `5.0` or `"gap"`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "write a number such as 5.0, or the name of a parameter such as \"gap\""
)]
pub enum StoryNumber {
    /// A number.
    Number(f64),
    /// Name of a parameter of the world.
    Parameter(String),
}

impl From<f64> for StoryNumber {
    fn from(number: f64) -> StoryNumber {
        StoryNumber::Number(number)
    }
}

impl Default for StoryNumber {
    fn default() -> StoryNumber {
        StoryNumber::Number(0.0)
    }
}

/// Returns whether a field may be left out.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
