//! Baselines and search of a world, before any ado was trained in it.

use super::blocking_rules::{RuleAblation, in_the_way};
use super::composed::{composed, is_composed};
use crate::experiment::{EgoError, EgoUnderTest, Watch, check_repeatability, consent, test_starts};
use crate::run_dir::Row;
use crate::search::{Adversary, BASELINES, Experiment, Search};
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
    seed: u64,
    count: usize,
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
        // Each ego may have other trivial starts.
        let Some((starts, alone)) = starts.for_ego(nominal, ego, None, watch) else {
            break;
        };
        let alone = |row: Row| Row {
            fails_alone: alone,
            ..row
        };
        // Placed ados drive by themselves, so there is nothing to search.
        if is_composed(ego.scenario()) {
            let mut rows = composed(ego, &starts, watch);
            check_repeatability(ego, &starts, &mut rows, watch);
            all.rows.extend(rows.into_iter().map(alone));
            continue;
        }
        let search: &dyn Adversary = &Search::switches(switches);
        let experiment = Experiment {
            ego,
            adversaries: [search].into_iter().chain(BASELINES).collect(),
            starts: &starts,
        };
        let mut rows = experiment.rows(watch);
        // The search plays first and comes last in the table.
        rows.rotate_left(1);
        // The recall of a baseline shows whether the search was needed.
        Row::compare_with_last(&mut rows);
        let found = rows.last();
        // Rules are suspected only after a search without a success.
        if found.is_some_and(|found| found.successes == 0 && found.starts > 0) {
            let blocking = in_the_way(ego, &starts, switches, watch);
            all.in_the_way.extend(blocking);
        }
        check_repeatability(ego, &starts, &mut rows, watch);
        all.rows.extend(rows.into_iter().map(alone));
    }
    Ok(Some(all))
}
