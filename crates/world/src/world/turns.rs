//! Ado of a world file that gives turns to placed ados.

use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::{Actions, DriveSpec, TurnAction, TurnsAdo};

/// Checks that all turns are those of placed ados.
pub(super) fn check(
    problems: &mut Problems,
    place: &ValuePath,
    turns: &TurnsAdo,
    spec: &DriveSpec,
) {
    let known: Vec<&str> = spec.trained().map(|(name, _)| name).collect();
    let list = place.to("drive").to("actions");
    if known.is_empty() {
        let what = "this world has no placed ado that could have a turn".to_owned();
        let help = "place one: `drive: Trained(run: \"RUN\", rules: Judged)`".to_owned();
        return problems.add(&list, what, "nobody's turn", Some(help));
    }
    let Actions::Turns(all) = &turns.actions else {
        return;
    };
    for (i, action) in all.iter().enumerate() {
        if let TurnAction::Only(name) = action
            && !known.contains(&name.as_str())
        {
            problems.unknown(&list.at(0).at(i), "placed ado", name, &known);
        }
    }
}
