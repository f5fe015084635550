//! An ego with other values of its parameters.

use crate::ego::{Actuated, ControllerSpec, StockController};
use crate::experiment::{EgoError, EgoUnderTest};
use crate::world::Change;

/// Parameters of the car and the connection, which a change of the controller leaves alone.
pub(super) const NOT_OF_THE_LAW: [&str; 2] = ["lag_s", "timeout_s"];

/// Returns an ego with values of some of its parameters.
///
/// # Errors
/// The ego has no such parameter, or not such values.
pub(super) fn with_values(
    base: &EgoUnderTest,
    name: &str,
    set: &[(&str, f64)],
) -> Result<EgoUnderTest, EgoError> {
    let scenario = base.scenario();
    let mut change = base.change().clone();
    for (parameter, value) in set {
        let is_own = !NOT_OF_THE_LAW.contains(parameter);
        // A program declares parameters of its own, to which car and
        // connection do not belong.
        match scenario.controller().filter(|it| is_own && is_program(it)) {
            Some(controller) => set_declared(&mut change, controller, parameter, *value),
            None => {
                change.ego.0.insert((*parameter).to_owned(), *value);
            }
        }
    }
    // The world with the ego has the consent to start it, which a change has not.
    EgoUnderTest::changed(
        scenario,
        name,
        &change,
        "choose values that the ego may have",
    )
}

/// Sets a declared parameter of the program in a change, or of the world's own.
fn set_declared(change: &mut Change, own: Actuated<ControllerSpec>, parameter: &str, value: f64) {
    // The values that the change has already must survive a further one.
    let controller = change.controller.get_or_insert(own);
    if let StockController::Process(program) = &mut controller.controller.0 {
        program.parameters.insert(parameter.to_owned(), value);
    }
}

fn is_program(controller: &Actuated<ControllerSpec>) -> bool {
    controller.controller.program().is_some()
}
