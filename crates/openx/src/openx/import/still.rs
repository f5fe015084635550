//! Actions without an effect on motion.

use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Actions without an effect on motion, such as lights, weather and logs.
const STILL: [&str; 8] = [
    "ControllerAction",
    "ActivateControllerAction",
    "AppearanceAction",
    "EnvironmentAction",
    "InfrastructureAction",
    "ParameterAction",
    "VariableAction",
    "VisibilityAction",
];
/// Attributes that hand the motion of an entity to a controller.
const HANDS_OVER: [&str; 4] = [
    "lateral",
    "longitudinal",
    "activateLateral",
    "activateLongitudinal",
];

/// Returns true for an action without an effect on motion.
///
/// `is_free` is true for the ego, and for entities without a controller.
///
/// # Errors
///
/// Returns an error for a controller that moves an entity other than the ego.
pub(super) fn is_still(
    action: &XmlNode,
    scope: &ParameterScope,
    is_free: bool,
) -> Result<bool, ImportError> {
    fn hands_over(node: &XmlNode, scope: &ParameterScope) -> Result<bool, ImportError> {
        for name in HANDS_OVER {
            if scope.is_true(node, name)? {
                return Ok(true);
            }
        }
        // The attributes may belong to a nested element of the action.
        for child in &node.children {
            if hands_over(child, scope)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
    let name = action.name.as_str();
    let controls = matches!(name, "ControllerAction" | "ActivateControllerAction");
    if controls && !is_free && hands_over(action, scope)? {
        let what = "an agent that a controller moves is not read";
        let help = "only the ego may have a controller: state the others' motion by actions";
        return Err(action.refused(what, help));
    }
    Ok(STILL.contains(&name))
}
