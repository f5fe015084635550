//! Scene from above, forward to the right.

use crate::view::camera::{FOLLOW, SPACE, ViewExtent, look};
use crate::view::error::ViewError;
use crate::view::layout::{BlueprintBuilder, Views};
use crate::view::panel::{Column, Panel, PanelWorlds};
use crate::view::viewed_episode::ViewedEpisode;

pub(super) static PANEL: Panel = Panel {
    name: "from above",
    column: Column::Space,
    shown: PanelWorlds::OnRoads,
    // The entities are those of the scene's panel.
    entities: &[],
    log: |_, _| Ok(()),
    views,
};

fn views(story: &ViewedEpisode<'_>, layout: &mut BlueprintBuilder<'_>) -> Result<Views, ViewError> {
    let view = layout.view("3D", "from above", FOLLOW, &SPACE[..3])?;
    let (eye_m, at_m) = ViewExtent::of(story).seen_from_above();
    look(layout, &view, eye_m, at_m, [0.0, 1.0, 0.0])?;
    Ok(vec![(view, 2.0)])
}
