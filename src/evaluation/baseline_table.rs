//! Baselines and search of a world, before any ado was trained in it.

use super::blocking_rules::{RuleAblation, in_the_way};
use crate::adversary::{Ado, best_constant, eval};
use crate::experiment::{EgoError, EgoUnderTest, Watch, consent, test_starts};
use crate::run_dir::Row;
use crate::search::{SearchRequest, Switches, search};
use crate::world::Scenario;

/// Rows of baselines and search, ego by ego.
#[derive(Clone, Debug, Default)]
pub struct BaselineTable {
    /// The baselines and a search, ego by ego.
    pub rows: Vec<Row>,
    /// Rules that block success, for egos for which the search finds nothing.
    pub in_the_way: Vec<RuleAblation>,
}

/// Plays the baselines and a search with limited switches, ego by ego.
///
/// Egos that are finished when `watch` stops are returned, `None` if none is.
///
/// # Errors
/// A program may not be started.
pub fn untrained(
    nominal: &Scenario,
    egos: &[EgoUnderTest],
    (count, seed): (usize, u64),
    switches: usize,
    watch: &Watch<'_>,
) -> Result<Option<BaselineTable>, EgoError> {
    consent(nominal, egos)?;
    let Some(starts) = test_starts(nominal, seed, count, watch) else {
        return Ok(None);
    };
    let mut all = BaselineTable::default();
    for (nth, ego) in egos.iter().enumerate() {
        if watch.stopped() {
            break;
        }
        let watch = &watch.later(nth);
        let tested = (ego.scenario(), ego.is_nominal());
        // Each ego may have other trivial starts.
        let Some((starts, alone)) = starts.for_ego(nominal, tested, watch) else {
            break;
        };
        let found = search(
            &SearchRequest {
                scenario: ego.scenario(),
                ego: ego.name(),
                method: Switches(switches).into(),
                budget: 0,
                starts: &starts,
            },
            watch,
        );
        let met = |ado| eval(&ego.met_by(ado, &starts), watch).row;
        let constant = best_constant(ego.scenario(), ego.name(), &starts, watch).row;
        for mut row in [met(Ado::Held), met(Ado::Random), constant] {
            // The recall of a baseline shows whether the search was needed.
            row.compare_with_search(&found.row.solved);
            row.fails_alone = alone;
            all.rows.push(row);
        }
        // Rules are suspected only after a search without a success.
        if found.row.successes == 0 && 0 < found.row.starts {
            let met = (ego.scenario(), ego.name());
            all.in_the_way
                .extend(in_the_way(met, &starts, switches, watch));
        }
        all.rows.push(Row {
            fails_alone: alone,
            ..found.row
        });
    }
    Ok(Some(all))
}
