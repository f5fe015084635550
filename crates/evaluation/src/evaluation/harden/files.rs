//! Files of a hardening: changes as RON, for `--ego` and for worlds.

use std::path::Path;

use ron::extensions::Extensions;
use serde::Serialize;

use super::error::HardenError;
use crate::run_dir::write_file;
use crate::world::Change;

/// Writes a change as a file for `--ego`.
///
/// # Errors
/// The disk refuses.
pub(super) fn write_change(path: &Path, about: &str, change: &Change) -> Result<(), HardenError> {
    let text = format!("// {about}\n{}\n", change_text(change)?);
    Ok(write_file(path, text.as_bytes())?)
}

/// Returns a change of a driving world as RON, without fields that change nothing.
///
/// Grids have no ego to harden, so their fields are left out.
pub(super) fn change_text(change: &Change) -> Result<String, HardenError> {
    let mut fields = Vec::new();
    if !change.ego.0.is_empty() {
        let set = change
            .ego
            .0
            .iter()
            // Debug text always has a decimal point, which RON needs to read a float
            // back.
            .map(|(name, value)| format!("{name}: {value:?}"));
        fields.push(format!("ego: ({})", set.collect::<Vec<_>>().join(", ")));
    }
    if let Some(controller) = &change.controller {
        fields.push(format!("controller: {}", text(controller)?));
    }
    if let Some(body) = &change.ego_body {
        fields.push(format!("ego_body: {}", text(body)?));
    }
    if let Some(friction) = change.friction {
        fields.push(format!("friction: {friction:?}"));
    }
    if let Some(plant) = change.plant {
        fields.push(format!("plant: {}", text(&plant)?));
    }
    if let Some(sensors) = &change.sensors {
        fields.push(format!("sensors: {}", text(sensors)?));
    }
    Ok(format!("Change({})", fields.join(", ")))
}

fn text(value: &impl Serialize) -> Result<String, HardenError> {
    // World files are written in this dialect, so a change can be pasted into them.
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = options.to_string(value);
    text.map_err(|error| HardenError::Unwritable {
        why: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::changed_ego::with_values;
    use super::*;
    use crate::experiment::EgoUnderTest;
    use crate::world::Scenario;

    #[test]
    fn a_written_change_is_read_as_the_same_ego() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let dir = tempfile::tempdir().expect("a directory");
        let file = dir.path().join("hardened.ron");
        let program = ["python3".to_owned(), "my \"ego\".py".to_owned()];
        let mut egos = EgoUnderTest::find(&world, "all").expect("they fit");
        egos.push(EgoUnderTest::program(&world, &program).expect("driven"));
        for ego in egos {
            // Every structure of the list has a lag, and a program has parameters of its own.
            let mut set = vec![("lag_s", 0.25)];
            if ego.scenario().program().is_some() {
                set.push(("gap_s", 1.5));
            }
            let changed = with_values(&ego, "changed", &set).expect("it fits");
            write_change(&file, "test", changed.change()).expect("a disk");
            let (read, _) = world.changed_by(&file).expect("a change");
            assert_eq!(&read, changed.change(), "{}", ego.name());
        }
    }
}
