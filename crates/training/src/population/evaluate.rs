//! Evaluation of a population: its members, their union, and the cells of their failures.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::error::PopulationError;
use crate::adversary::{Ado, count_solved};
use crate::crashes::CellFinder;
use crate::experiment::{
    EgoUnderTest, EpisodeLoop, TestStarts, Watch, check_repeatability, consent,
};
use crate::run_dir::{CellCount, FailureCell, Row, RunDir};
use crate::search::{Adversary, ExperimentCell, Search};
use crate::stats::{Incidence, KindsEstimate, NewKinds, Outcomes, StartOutcome};

/// Least number of runs for which the number of new cells is predicted.
const NEXT_RUNS: u64 = 1000;

/// Request to evaluate the members of a population.
#[derive(Clone, Copy)]
pub struct PopulationTest<'a> {
    /// Members, which may be runs of any origin against one world.
    pub members: &'a [RunDir],
    /// Ego under test, in its world.
    pub ego: &'a EgoUnderTest,
    /// Number of test starts and their seed.
    pub starts: (usize, u64),
    /// Most switches of action of a search beside the members, for recall.
    pub search: Option<usize>,
}

/// Row of one member, and the cells of its failures.
#[derive(Clone, Debug, Serialize)]
pub struct MemberResult {
    /// Directory of the member.
    pub member: String,
    /// Rates and costs over all starts.
    pub row: Row,
    /// Cells of its failures.
    pub cells: usize,
    /// Cells in which no member before it fails the ego.
    pub new_cells: usize,
    /// Cells per second of processor time.
    pub cells_per_cpu_s: f64,
}

/// Members taken together. A start is solved if any member solves it.
#[derive(Clone, Debug, Serialize)]
pub struct UnionResult {
    /// Number of evaluated starts.
    pub starts: usize,
    /// Starts that any member solves.
    pub successes: usize,
    /// successes / starts.
    pub success_rate: f64,
    /// Wilson's 95 % interval of the rate. `None` if interrupted.
    pub ci95: Option<[f64; 2]>,
    /// Share of the search-solved starts that are solved too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recall: Option<f64>,
    /// Episodes of all members.
    pub runs: u64,
    /// Occupied cells.
    pub cells: usize,
    /// Processor time of all members, in s.
    pub cpu_s: f64,
    /// Cells per second of processor time.
    pub cells_per_cpu_s: f64,
}

/// Row of the search, and the cells of its failures.
#[derive(Clone, Debug, Serialize)]
pub struct SearchCells {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Cells of its failures, one failure per start.
    pub cells: Vec<CellCount>,
    /// Cells in which no member fails the ego.
    pub beyond_members: usize,
}

/// Prediction of the cells in further runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NextRuns {
    /// Further runs, of all members alike.
    pub runs: u64,
    /// Cells that will be new, by further test starts.
    pub new_cells: NewKinds,
}

/// Results of the evaluation of a population.
#[derive(Clone, Debug, Serialize)]
pub struct PopulationResults {
    /// Every member.
    pub members: Vec<MemberResult>,
    /// All members together.
    pub union: UnionResult,
    /// Search of the same starts, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchCells>,
    /// Occupied cells with the number of starts on which a member fails the ego there.
    pub cells: Vec<CellCount>,
    /// Estimated number of cells in which the members can fail the ego.
    pub estimate: KindsEstimate,
    /// New cells in further runs.
    pub next: NextRuns,
}

impl PopulationTest<'_> {
    /// Plays every member on every start, and finds the cell of each failure.
    ///
    /// `None`: stopped.
    ///
    /// # Errors
    /// There is no member, a member cannot be played, or the ego may not be started.
    pub fn run(&self, watch: &Watch<'_>) -> Result<Option<PopulationResults>, PopulationError> {
        let first = self.members.first().ok_or(PopulationError::NoMember)?;
        let world = first.world()?;
        // A program runs only with consent, which is checked before any start is drawn.
        consent(&world, std::slice::from_ref(self.ego))?;
        // Starts are chosen by the nominal ego, so that several egos are comparable.
        let nominal = EgoUnderTest::nominal(&world);
        let dir = Some(first.path());
        let (count, seed) = self.starts;
        let Some(starts) = TestStarts::stored(dir, &nominal, count, seed, watch) else {
            return Ok(None);
        };
        let Some((starts, _)) = starts.for_ego(&world, self.ego, dir, watch) else {
            return Ok(None);
        };
        let mut played = Vec::new();
        for member in self.members {
            let policy = member.policy()?;
            let ado = Ado::Trained(&*policy, member.manifest().seed);
            let cell = ado.play(self.ego, &starts, watch);
            played.extend(cell.map(|mut cell| {
                cell.row.warning = member.warning();
                cell
            }));
        }
        let mut searched = self
            .search
            .and_then(|switches| Search::switches(switches).play(self.ego, &starts, watch));
        // An interrupted evaluation would have the cells of its first members only.
        if watch.interrupted() {
            return Ok(None);
        }
        let rows = played
            .iter_mut()
            .chain(searched.as_mut())
            .map(|cell| &mut cell.row);
        check_repeatability(self.ego, &starts, rows, watch);
        let members = played.len();
        // The search comes last, where `results` splits it off.
        played.extend(searched);
        let Some(cells) = failure_cells(&played, watch) else {
            return Ok(None);
        };
        Ok(Some(self.results(played, &cells, members)))
    }

    /// Summarises `members` played members and the search after them, if any.
    fn results(
        &self,
        mut played: Vec<ExperimentCell>,
        cells: &[Vec<(usize, FailureCell)>],
        members: usize,
    ) -> PopulationResults {
        let search = played.split_off(members).pop().map(|cell| cell.row);
        let mut rows: Vec<Row> = played.into_iter().map(|cell| cell.row).collect();
        let (own, of_search) = cells.split_at(members);
        // The search is left out, because the estimate is about the members alone.
        let incidence = incidence(own);
        let mut union = union_row(&rows);
        if let Some(search) = &search {
            for row in rows.iter_mut().chain(union.as_mut()) {
                row.compare_with_search(&search.solved);
            }
        }
        let cpu_s = rows.iter().fold(0.0, |sum, row| sum + row.cpu_s);
        let starts = union.as_ref().map_or(0, |row| row.starts);
        let runs = (members * starts) as u64;
        let counts: Vec<u64> = incidence.values().map(|starts| *starts as u64).collect();
        let sample = Incidence::new(starts as u64, counts);
        // One further start costs a run of every member.
        let (further, next_runs) = next_starts(members);
        PopulationResults {
            union: UnionResult {
                starts,
                successes: union.as_ref().map_or(0, |row| row.successes),
                success_rate: union.as_ref().map_or(0.0, |row| row.success_rate),
                ci95: union.as_ref().and_then(|row| row.ci95),
                recall: union.as_ref().and_then(|row| row.recall),
                runs,
                cells: incidence.len(),
                cpu_s,
                cells_per_cpu_s: per_second(incidence.len(), cpu_s),
            },
            search: search.map(|row| search_cells(row, of_search, &incidence)),
            estimate: sample.kinds(),
            next: NextRuns {
                runs: next_runs,
                new_cells: sample.predict(further, self.starts.1),
            },
            cells: counted(incidence),
            members: member_results(self.members, rows, own),
        }
    }
}

/// Returns the further starts of the prediction, and the runs of all members on them.
fn next_starts(members: usize) -> (u64, u64) {
    let members = members.max(1) as u64;
    let starts = NEXT_RUNS.div_ceil(members);
    (starts, starts * members)
}

/// Returns the cells of the failures of each played adversary, with their starts.
///
/// `None`: stopped.
fn failure_cells(
    played: &[ExperimentCell],
    watch: &Watch<'_>,
) -> Option<Vec<Vec<(usize, FailureCell)>>> {
    watch.phase("finding the cells of failures");
    let failures: Vec<(usize, usize)> = played
        .iter()
        .enumerate()
        .flat_map(|(at, cell)| cell.solved().into_iter().map(move |n| (at, n)))
        .collect();
    let Some(scenario) = played.first().map(|cell| cell.ego.scenario()) else {
        return Some(Vec::new());
    };
    let all = EpisodeLoop::counted(watch, failures.len());
    let worker = || (scenario.bench(), CellFinder::new(scenario));
    let found = all.each(&failures, worker, |(bench, finder), (at, start), _| {
        let episode = played[*at].replay(bench, *start);
        Some(finder.cell(scenario, &episode))
    });
    let mut cells = vec![Vec::new(); played.len()];
    for ((at, start), cell) in failures.into_iter().zip(found) {
        // A cell is missing only after a stop, and the others would seem
        // rarer than they are.
        cells[at].push((start, cell?));
    }
    Some(cells)
}

/// Counts the starts on which each cell occurs under any member.
fn incidence(members: &[Vec<(usize, FailureCell)>]) -> BTreeMap<FailureCell, usize> {
    let mut starts: BTreeMap<FailureCell, BTreeSet<usize>> = BTreeMap::new();
    for (start, cell) in members.iter().flatten() {
        starts.entry(cell.clone()).or_default().insert(*start);
    }
    starts
        .into_iter()
        .map(|(cell, starts)| (cell, starts.len()))
        .collect()
}

/// Returns a row with the outcomes of all members together. `None` without members.
fn union_row(rows: &[Row]) -> Option<Row> {
    // Only the outcomes, and what follows from them, are read of this row.
    let mut union = rows.first()?.clone();
    let any = |at: usize| {
        rows.iter()
            .any(|row| row.solved.get(at) == Some(&StartOutcome::Solved))
    };
    let solved: Outcomes = union
        .solved
        .iter()
        .enumerate()
        .map(|(at, first)| {
            if any(at) {
                StartOutcome::Solved
            } else {
                *first
            }
        })
        .collect();
    union.solved = solved;
    count_solved(&mut union);
    Some(union)
}

fn member_results(
    members: &[RunDir],
    rows: Vec<Row>,
    cells: &[Vec<(usize, FailureCell)>],
) -> Vec<MemberResult> {
    // The set is shared by all members, so that each cell is new only once.
    let mut known = BTreeSet::new();
    let results = members
        .iter()
        .zip(rows)
        .zip(cells)
        .map(|((member, row), cells)| {
            let own: BTreeSet<&FailureCell> = cells.iter().map(|(_, cell)| cell).collect();
            let new_cells = own.iter().filter(|cell| known.insert(**cell)).count();
            MemberResult {
                member: member.path().display().to_string(),
                cells: own.len(),
                new_cells,
                cells_per_cpu_s: per_second(own.len(), row.cpu_s),
                row,
            }
        });
    results.collect()
}

fn search_cells(
    row: Row,
    cells: &[Vec<(usize, FailureCell)>],
    members: &BTreeMap<FailureCell, usize>,
) -> SearchCells {
    let own = incidence(cells);
    SearchCells {
        row,
        beyond_members: own
            .keys()
            .filter(|cell| !members.contains_key(*cell))
            .count(),
        cells: counted(own),
    }
}

/// Returns the counts, the most frequent cell first and equals in the order of cells.
fn counted(incidence: BTreeMap<FailureCell, usize>) -> Vec<CellCount> {
    let mut counts: Vec<CellCount> = incidence
        .into_iter()
        .map(|(cell, starts)| CellCount {
            cell,
            failures: starts as u64,
        })
        .collect();
    // The sort is stable, which keeps the order of cells among equals.
    counts.sort_by_key(|count| std::cmp::Reverse(count.failures));
    counts
}

fn per_second(cells: usize, cpu_s: f64) -> f64 {
    // Very few starts may take no measurable time.
    cells as f64 / cpu_s.max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::CellFailure;
    use crate::severity::CrashKind;

    fn cell(partner: &str) -> FailureCell {
        FailureCell {
            failure: CellFailure::contact(partner, CrashKind::HeadOn, 1.0),
            necessary: None,
        }
    }

    #[test]
    fn a_prediction_is_for_whole_starts_of_all_members() {
        assert_eq!(next_starts(2), (500, 1000));
        assert_eq!(next_starts(3), (334, 1002));
        assert_eq!(next_starts(0), (1000, 1000));
    }

    #[test]
    fn a_cell_counts_once_per_start_however_many_members_fail_the_ego_there() {
        let one = vec![(0, cell("car")), (1, cell("car")), (2, cell("truck"))];
        let other = vec![(0, cell("car")), (2, cell("bus")), (5, cell("truck"))];
        let counted = counted(incidence(&[one, other]));
        let counts: Vec<u64> = counted.iter().map(|count| count.failures).collect();
        assert_eq!(counts, [2, 2, 1]);
        assert_eq!(counted[2].cell, cell("bus"));
        let known: Vec<&FailureCell> = counted.iter().map(|count| &count.cell).collect();
        assert_eq!(known, [&cell("car"), &cell("truck"), &cell("bus")]);
    }
}
