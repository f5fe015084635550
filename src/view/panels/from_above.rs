//! Scene from above, forward to the right.

use crate::view::camera::{Around, FOLLOW, SPACE, look};
use crate::view::error::ViewError;
use crate::view::layout::{Layout, Views};
use crate::view::panel::{Column, Panel, Shown};
use crate::view::story::Story;

pub(super) static PANEL: Panel = Panel {
    name: "from above",
    column: Column::Space,
    shown: Shown::OnRoads,
    // The entities are those of the scene's panel.
    entities: &[],
    log: |_, _| Ok(()),
    views,
};

fn views(story: &Story<'_>, layout: &mut Layout<'_>) -> Result<Views, ViewError> {
    let view = layout.view("3D", "from above", FOLLOW, &SPACE[..3])?;
    let (eye_m, at_m) = Around::of(story).seen_from_above();
    look(layout, &view, eye_m, at_m, [0.0, 1.0, 0.0])?;
    Ok(vec![(view, 2.0)])
}
