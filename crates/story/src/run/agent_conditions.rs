//! Conditions that are followed for each of their agents.

use crate::check::CheckedStoryboard;
use crate::tree::{CheckedExpression, ElementKind};
use crate::trigger::ConditionRun;

/// Returns the conditions of acts for each of their agents, if triggers choose actors.
pub(super) fn conditions_of_agents(board: &CheckedStoryboard) -> Vec<Vec<ConditionRun>> {
    let mut all = vec![Vec::new(); board.conditions.len()];
    if !board.asks_triggering() {
        return all;
    }
    let elements = board.elements.iter();
    let acts = elements.filter(|it| it.kind == ElementKind::Act);
    for number in acts.flat_map(|act| act.start.iter().flatten()) {
        if let CheckedExpression::Agents { agents, .. } = &board.conditions[*number].is {
            all[*number] = vec![ConditionRun::default(); agents.len()];
        }
    }
    all
}
