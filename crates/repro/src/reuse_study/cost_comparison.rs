//! Number of starts from which a reused ado is cheaper than a search per start.

use serde::Serialize;

use super::{HELD_BUDGETS, WIDE};
use brakecheck_evaluation::evaluation::reuse::ReusedOn;

/// Cost of a wide ado and of held random search at equal success.
///
/// Costs are counted in simulations. The ado needs a training and one simulation per start.
/// The search needs its simulations until the first success, or its whole budget.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CostComparison {
    /// Name of the ego. `None`: all egos together, which share a training.
    pub ego: Option<String>,
    /// Simulations before the first start: those of the training.
    pub once: f64,
    /// Simulations of the search per start, summed over the egos.
    pub search: f64,
    /// Whether the search reaches the ado's success on every ego.
    ///
    /// If not, its largest budget counts, and the ado is cheaper even before `starts`.
    pub matched: bool,
    /// Starts per ego from which the ado is cheaper. `None`: never.
    pub starts: Option<f64>,
}

/// Compares the costs per ego on which the ado succeeds, and over all these egos.
///
/// `training` is the number of simulations of a training.
pub(super) fn compare_costs(training: f64, egos: &[ReusedOn]) -> Vec<CostComparison> {
    let mut lines: Vec<CostComparison> = egos
        .iter()
        .filter_map(|ego| of_ego(training, ego))
        .collect();
    // A single ego would repeat its own line.
    if lines.len() > 1 {
        let search = lines.iter().map(|line| line.search).sum();
        let all = CostComparison {
            ego: None,
            matched: lines.iter().all(|line| line.matched),
            // All egos share one training.
            starts: cheaper_from(training, search, lines.len()),
            once: training,
            search,
        };
        lines.push(all);
    }
    lines
}

fn of_ego(training: f64, ego: &ReusedOn) -> Option<CostComparison> {
    // Several seeds have a row each, and their mean success must be reached.
    let wide: Vec<f64> = ego
        .rows
        .iter()
        .filter(|row| row.ado == WIDE.into())
        .map(|row| row.success_rate)
        .collect();
    let success = wide.iter().sum::<f64>() / wide.len().max(1) as f64;
    let searched: Vec<_> = HELD_BUDGETS
        .iter()
        .filter_map(|budget| {
            let word = super::held_word(*budget);
            ego.rows.iter().find(|row| row.ado == word.as_str().into())
        })
        .collect();
    // The smallest budget with the ado's success is the fairest comparison.
    let enough = searched.iter().find(|row| success <= row.success_rate);
    // Without a sufficient budget the largest budget counts as a lower bound of the cost.
    let row = enough.or(searched.last())?;
    // An ado that never succeeds needs no search to match it.
    (success > 0.0).then(|| CostComparison {
        ego: Some(ego.ego.clone()),
        once: training,
        search: row.sims_per_start,
        matched: enough.is_some(),
        starts: cheaper_from(training, row.sims_per_start, 1),
    })
}

/// Returns the one-time simulations divided by the saving of each further start.
fn cheaper_from(once: f64, search: f64, egos: usize) -> Option<f64> {
    // The ado itself takes a simulation per start and ego.
    let saved = search - egos as f64;
    // A search that costs no more per start never pays for the training.
    (saved > 0.0).then(|| once / saved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use brakecheck::run_dir::Row;
    use brakecheck_evaluation::evaluation::reuse::Relation;
    use serde_json::json;

    fn row(ado: &str, success_rate: f64, sims_per_start: f64) -> Row {
        let row = json!({
            "world": "w", "plant": "Rigid", "judge": "UntilViolation", "ego": "e", "ado": ado,
            "method": "m", "start_seed": 0, "starts": 10, "trivial": 0, "successes": 0,
            "success_rate": success_rate, "ci95": [0.0, 1.0], "foul_rate": 0.0,
            "contact_rate": 0.0, "invalid": 0, "sims_per_start": sims_per_start,
            "physics_steps": 0, "cpu_s": 0.0, "solved": "",
        });
        serde_json::from_value(row).expect("a row")
    }

    fn ego(name: &str, wide: f64) -> ReusedOn {
        let rows = vec![
            row(WIDE, wide, 1.0),
            row("search, held, 10", 0.2, 9.0),
            row("search, held, 30", 0.5, 21.0),
            row("search, held, 100", 0.7, 41.0),
        ];
        ReusedOn {
            ego: name.to_owned(),
            relation: Relation::Inside,
            fails_without_adversary: Some(0.0),
            reachable: None,
            union: Some(0.0),
            rows,
        }
    }

    #[test]
    fn each_ego_alone_bears_the_training_and_all_egos_share_it() {
        let egos = [ego("matched", 0.4), ego("beyond", 0.9), ego("never", 0.0)];
        let lines = compare_costs(2_000.0, &egos);
        let seen: Vec<_> = lines
            .iter()
            .map(|l| (l.ego.as_deref(), l.once, l.search, l.matched, l.starts))
            .collect();
        // 2000 / (21 − 1), 2000 / (41 − 1), 2000 / (62 − 2).
        assert_eq!(
            seen,
            [
                (Some("matched"), 2_000.0, 21.0, true, Some(100.0)),
                (Some("beyond"), 2_000.0, 41.0, false, Some(50.0)),
                (None, 2_000.0, 62.0, false, Some(2_000.0 / 60.0)),
            ]
        );
    }
}
