//! Application of a `reuse` change to a driving world.

use super::ChangeError;
use super::check::sensor_flaw;
use crate::ego::Process;
use crate::ron_file::{did_you_mean, known_names};
use crate::scene::drive::{Drive, DriveSpec, EnvironmentQuantity};
use crate::sim::Body;
use crate::world_file::Change;

/// Applies a change to a spec.
///
/// # Errors
///
/// Returns an error with the field for a value that does not fit the world.
pub(super) fn apply(spec: &mut DriveSpec, change: &Change) -> Result<(), ChangeError> {
    let fail = |what: String, help: Option<String>, place: &[&str]| ChangeError {
        what,
        help,
        place: place.iter().map(|name| (*name).to_owned()).collect(),
    };
    if change.grid.is_some() {
        let what = "a driving world has no map of cells".to_owned();
        let help =
            "a change of it has: ego, controller, ego_body, friction, plant, sensors".to_owned();
        return Err(fail(what, Some(help), &["grid"]));
    }
    if let Some(friction) = change.friction {
        // The same limits as for the `road` of a world.
        if !(0.01..=2.0).contains(&friction) {
            let what = format!("friction {friction} is outside of 0.01 ..= 2");
            return Err(fail(what, None, &["friction"]));
        }
        spec.road.set_friction(friction);
        // A changed quantity replaces that of the starts.
        spec.fix_environment(|it| it.quantity == EnvironmentQuantity::Friction);
    }
    if let Some(plant) = change.plant {
        spec.plant = plant;
    }
    if let Some(sensors) = change.sensors {
        if let Some((field, what, help)) = sensor_flaw(&sensors, &spec.clock) {
            return Err(fail(what, Some(help), &["sensors", field]));
        }
        spec.sensors = sensors;
        spec.fix_environment(|it| it.quantity.is_of_sensors());
    }
    // The body may come from the world or be a shipped body. Only the ego gets
    // it.
    if let Some(name) = &change.ego_body {
        let body = ego_body(spec, name)?;
        for agent in &mut spec.agents {
            if matches!(agent.drive, Drive::Ego) {
                agent.body = body.clone();
            }
        }
    }
    // The controller is replaced before its parameters are set below.
    if let Some(controller) = &change.controller {
        spec.ego = controller.clone().into();
    }
    // A controller of the user's own has no parameters that a file could set.
    let Some(mut stock) = spec.ego.stock() else {
        return Ok(());
    };
    for (name, value) in &change.ego.0 {
        stock.set(name, *value).map_err(|error| {
            let known = known_names("parameters", error.known.iter().copied());
            let help = match did_you_mean(name, error.known.iter().copied()) {
                Some(guess) => format!("{guess} — {known}"),
                None => known,
            };
            fail(error.to_string(), Some(help), &["ego", name])
        })?;
    }
    if let Some((field, what, help)) = stock.controller.program().and_then(Process::flaw) {
        return Err(fail(what, Some(help.to_owned()), &["controller", field]));
    }
    // This form also rejects NaN, unlike a comparison with the bound.
    if let Some(low) = stock
        .parameters()
        .iter()
        .find(|p| !(p.at_least..).contains(&p.value))
    {
        let what = format!("`{}` is {}, below {}", low.name, low.value, low.at_least);
        return Err(fail(what, None, &["ego", low.name]));
    }
    spec.ego = stock.into();
    Ok(())
}

/// Vehicle of the ego: one of the world's own bodies, or a shipped one.
fn ego_body(spec: &DriveSpec, name: &str) -> Result<Body, ChangeError> {
    let fail = |what: String, help: String| ChangeError {
        what,
        help: Some(help),
        place: vec!["ego_body".to_owned()],
    };
    let mut known: Vec<&str> = Body::shipped_names().collect();
    known.extend(spec.bodies.keys().map(String::as_str));
    let own = spec.bodies.get(name).cloned();
    let shipped = || Body::shipped(name).and_then(Result::ok);
    let Some(body) = own.or_else(shipped) else {
        let list = known_names("known", known.iter().copied());
        let help = match did_you_mean(name, known) {
            Some(guess) => format!("{guess} — {list}"),
            None => list,
        };
        return Err(fail(format!("no body `{name}`"), help));
    };
    if body.vehicle().is_none() {
        Err(fail(
            format!("`{name}` is no vehicle"),
            "controllers drive vehicles".to_owned(),
        ))
    } else {
        Ok(body)
    }
}
