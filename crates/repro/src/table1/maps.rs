//! Maps of RQ1 to RQ3 in Table I, with the paper's results.

use brakecheck::world::GridChange;

/// Map of the table: change, question, description, results of the paper.
pub(super) struct Map {
    pub(super) question: &'static str,
    pub(super) words: String,
    pub(super) change: GridChange,
    pub(super) paper: f64,
    pub(super) paper_random: Option<f64>,
}

/// Returns the maps of RQ1 to RQ3 up to a side, in the order of Table I.
pub(super) fn maps(largest: u32) -> Vec<Map> {
    let size = |size, paper, random| Map {
        question: "RQ2",
        words: format!("n = {size}, k = 2"),
        change: GridChange {
            size: Some(size),
            ..GridChange::default()
        },
        paper,
        paper_random: Some(random),
    };
    let step = |step, paper, random| Map {
        question: "RQ3",
        words: format!("n = 4, k = {step}"),
        change: GridChange {
            ego_step: Some(step),
            ..GridChange::default()
        },
        paper,
        paper_random: Some(random),
    };
    // RQ1 is the training map itself. The paper has another random share for it.
    let trained_on = Map {
        question: "RQ1",
        paper_random: Some(0.0983),
        ..size(4, 0.6792, 0.0)
    };
    // Captures in Table I of the paper, of its trained and of its random ados.
    let mut all = vec![
        trained_on,
        size(2, 0.6667, 0.3333),
        size(4, 0.6792, 0.0291),
        size(5, 0.7033, 0.01),
        size(10, 0.0926, 0.0033),
        step(4, 0.725, 0.0292),
        step(3, 0.725, 0.0292),
        step(2, 0.6792, 0.0292),
        step(1, 0.6792, 0.0708),
    ];
    // A study in small leaves the larger maps out.
    all.retain(|map| map.change.size.is_none_or(|size| size <= largest));
    all
}
