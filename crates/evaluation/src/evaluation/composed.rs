//! Placed ados of a world, together and without each of them.

use crate::adversary::Ado;
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::{AdversaryId, Row};
use crate::search::Adversary;
use crate::world::Scenario;

/// Returns true if the only adversaries of a world are placed ados whose rules are judged.
pub(super) fn is_composed(world: &Scenario) -> bool {
    let acts = world
        .drive()
        .is_some_and(|driving| driving.spec().action_sets().next().is_some());
    !acts && !world.judged_ados().is_empty()
}

/// Plays the placed ados of a world against an ego: all, then without each of them.
pub(super) fn composed(ego: &EgoUnderTest, starts: &TestStarts, watch: &Watch<'_>) -> Vec<Row> {
    let play = |ego: &EgoUnderTest| Ado::Composed.play(ego, starts, watch);
    let mut rows: Vec<Row> = play(ego).map(|cell| cell.row).into_iter().collect();
    // One at a time: all pairs of more than two ados would be too many rows.
    let ados = ego.scenario().judged_ados();
    // A single ado without itself is no adversary.
    for &left_out in ados.iter().filter(|_| ados.len() > 1) {
        let others = ego.in_world(ego.scenario().with_idle_ados(|ado| ado == left_out));
        let method = format!("`{left_out}` plays its neutral action");
        rows.extend(play(&others).map(|cell| Row {
            ado: AdversaryId::without(left_out),
            method,
            ..cell.row
        }));
    }
    rows
}
