//! Searches of many egos, beside the trained ado of a run if there is one.

use std::path::Path;

use super::break_even::{BreakEven, break_even};
use super::error::EvaluationError;
use crate::adversary::Ado;
use crate::crashes::{KeepSettings, KeptFiles, file_stem, keep_cells};
use crate::experiment::{Cost, EgoUnderTest, TestStarts, Watch, check_repeatability, consent};
use crate::report::{RowCases, TestSuite};
use crate::rl::Policy;
use crate::run_dir::{Row, RunDir, Stored};
use crate::search::{
    Adversary, ExperimentCell, Method, MethodOption, SearchRequest, Searched, search,
};
use crate::world::Scenario;

/// Request for a search.
#[derive(Clone, Copy)]
pub struct SearchCampaign<'a> {
    /// The world as its file has it, from which test starts are drawn.
    pub world: &'a Scenario,
    /// The egos to be tested, each in its world.
    pub egos: &'a [EgoUnderTest],
    /// The run whose trained ado is played beside the search.
    pub run: Option<&'a RunDir>,
    /// Search method.
    pub method: Method<'a>,
    /// Simulations per start, 0 for methods without a budget.
    pub budget: u64,
    /// Test starts to draw, and the seed of their stream.
    pub starts: (usize, u64),
}

/// Results of a search, as far as it ran.
#[derive(Clone, Debug)]
pub struct SearchTable {
    /// Per ego the trained ado's row, if there is one, and the search's.
    pub rows: Vec<Row>,
    /// From how many starts on the trained ado is cheaper.
    pub break_even: Vec<BreakEven>,
    /// The test starts.
    pub starts: TestStarts,
    /// Search of every ego.
    cells: Vec<ExperimentCell>,
}

impl SearchTable {
    /// Returns a suite with a case per ego and start, named as the file of its crash.
    pub fn suite(&self) -> TestSuite {
        let cases = self.cells.iter().flat_map(|cell| {
            let (scenario, ego) = (cell.ego.scenario(), cell.ego.name());
            let outcomes = cell.outcomes();
            // Searches with several rates of `--natural` have the same egos and starts.
            let natural = cell.row.naturalness.as_ref();
            let limit = match natural.and_then(|it| it.limit_per_1000_km) {
                Some(rate) => format!(".natural {rate}"),
                None => String::new(),
            };
            let row = RowCases {
                row: &cell.row,
                outcomes: Some(&outcomes),
                class: format!("search.{}{limit}", scenario.name()),
                requirement: scenario.requirement.clone(),
            };
            let closing = |start: usize| {
                let result = cell.results[start].as_ref();
                let closing_mps = result.and_then(|it| it.closing_speed_mps);
                closing_mps.map_or(String::new(), |speed| format!("closing at {speed:.1} m/s"))
            };
            // Egos such as `a b` and `a-b` have one stem, and cases of one name hide each other.
            let shares_stem = self.cells.iter().any(|other| {
                let stem_of_other = file_stem(other.ego.scenario(), other.ego.name(), 0, 0);
                other.ego.name() != ego && stem_of_other == file_stem(scenario, ego, 0, 0)
            });
            let name = |start: usize| {
                let stem = file_stem(scenario, ego, cell.starts.seed, start);
                if shares_stem {
                    format!("{stem} of {ego}")
                } else {
                    stem
                }
            };
            row.cases(name, closing)
        });
        TestSuite {
            name: "search".to_owned(),
            time_s: Some(self.cells.iter().fold(0.0, |sum, it| sum + it.row.cpu_s)),
            cases: cases.collect(),
        }
    }

    /// Plays the solutions again and keeps the selected ones as files.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        &self,
        dir: &Path,
        settings: KeepSettings,
        watch: &Watch<'_>,
    ) -> Result<Vec<KeptFiles>, EvaluationError> {
        Ok(keep_cells(&self.cells, dir, settings, watch)?)
    }
}

/// The trained ado of the run that is searched.
struct Trained<'a> {
    policy: Box<dyn Policy>,
    run: &'a RunDir,
}

impl SearchCampaign<'_> {
    /// Searches every ego in turn. `None`: stopped before the first one.
    ///
    /// # Errors
    /// The run's policy is damaged.
    pub fn run(&self, watch: &Watch<'_>) -> Result<Option<SearchTable>, EvaluationError> {
        // Before any draw, because a trivial start is found by starting the programs.
        consent(self.world, self.egos)?;
        let trained = self.trained()?;
        let (own, dir) = (
            EgoUnderTest::nominal(self.world),
            self.run.map(RunDir::path),
        );
        let (count, seed) = self.starts;
        let Some(starts) = TestStarts::stored(dir, &own, count, seed, watch) else {
            return Ok(None);
        };
        let (mut rows, mut evens, mut cells) = (Vec::new(), Vec::new(), Vec::new());
        for (nth, ego) in self.egos.iter().enumerate() {
            let watch = &watch.later(nth);
            // Each ego may have other trivial starts.
            let Some((own, alone)) = starts.for_ego(self.world, ego, dir, watch) else {
                break;
            };
            let request = SearchRequest {
                scenario: ego.scenario(),
                ego: ego.name(),
                method: self.method,
                budget: self.budget,
                starts: &own,
            };
            let mut searched = search(&request, watch);
            searched.row.fails_alone = alone;
            if let Some(trained) = &trained
                && let Some(mut row) = trained.row(ego, &searched, &own, watch)
            {
                row.fails_alone = alone;
                evens.extend(trained.break_even(&request, &searched, &row, watch));
                rows.push(row);
            }
            let mut cell =
                ExperimentCell::searched(ego, &own, searched).with_judged_contacts(watch);
            rows.push(cell.row.clone());
            let of_ego = rows.iter_mut().filter(|row| row.ego == ego.name());
            check_repeatability(ego, &own, of_ego, watch);
            // The row of the search is the last one, and all rows of an
            // ego are void together.
            if let Some(void) = rows.last().filter(|row| row.is_unrepeatable()) {
                // The outcomes of the cell stay, because its crashes can still be kept.
                cell.row.faults.clone_from(&void.faults);
                evens.retain(|even| even.ego != void.ego);
            }
            // Points that the ego fails by itself are kept, too.
            cell.record_failing_alone();
            cells.push(cell);
            if watch.stopped() {
                break;
            }
        }
        Ok(Some(SearchTable {
            rows,
            break_even: evens,
            starts,
            cells,
        }))
    }

    fn trained(&self) -> Result<Option<Trained<'_>>, EvaluationError> {
        // A run that still trains has no ado to compare with.
        let finished = self.run.filter(|run| run.manifest().is_finished());
        let Some(run) = finished else {
            return Ok(None);
        };
        let policy = run.policy()?;
        Ok(Some(Trained { policy, run }))
    }
}

impl Trained<'_> {
    fn row(
        &self,
        ego: &EgoUnderTest,
        searched: &Searched,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Row> {
        let ado = Ado::Trained(&*self.policy, self.run.manifest().seed);
        let mut cell = ado.play(ego, starts, watch)?;
        // Both are on the same starts of the ego, so a recall pairs them one by one.
        cell.row.compare_with_search(&searched.row.solved);
        cell.row.warning = self.run.warning();
        Some(cell.row)
    }

    /// Compares methods with a budget. Other methods measure the reach, not the cost.
    fn break_even(
        &self,
        request: &SearchRequest<'_>,
        searched: &Searched,
        trained: &Row,
        watch: &Watch<'_>,
    ) -> Option<BreakEven> {
        let manifest = self.run.manifest();
        let method = request.method.info();
        // Without a budget there is no smaller one that reaches the success of the ado.
        if watch.interrupted() || !method.takes(MethodOption::Budget) {
            return None;
        }
        let reuses = [MethodOption::Bank, MethodOption::Guided].map(|it| method.takes(it));
        let once = if reuses.contains(&true) {
            // It lives on a training as well: neither is charged for one.
            Cost::default()
        } else {
            Cost::of_training(manifest)
        };
        break_even(searched, request.budget, trained, once)
    }
}

/// The counterexamples of a run's training, to be mutated against some egos.
///
/// # Errors
/// It stored none, or they do not fit the egos' worlds.
pub fn counterexamples_for(run: &RunDir, egos: &[EgoUnderTest]) -> Result<Stored, EvaluationError> {
    let (stored, source) = (run.counterexamples()?, run.scenario()?);
    // Actions are stored by number, which means another one in another set.
    let shape = |scenario: &Scenario| (scenario.axes(), scenario.world().spaces().actions);
    let mut unlike = egos.iter().map(|ego| (ego.name(), ego.scenario()));
    match unlike.find(|(_, scenario)| shape(scenario) != shape(&source)) {
        Some((ego, scenario)) => Err(EvaluationError::OtherActions {
            source_world: source.name.clone(),
            world: scenario.name.clone(),
            ego: ego.to_owned(),
        }),
        None => Ok(stored),
    }
}

/// The trained policy of a run, to propose sequences against some egos.
///
/// # Errors
/// The policy is damaged, or its observations or actions are not those of the egos' worlds.
pub fn policy_for(run: &RunDir, egos: &[EgoUnderTest]) -> Result<Box<dyn Policy>, EvaluationError> {
    let (policy, source) = (run.policy()?, run.scenario()?);
    let shape = |scenario: &Scenario| {
        let spaces = scenario.world().spaces();
        let labels = (0..spaces.actions).map(|action| scenario.action_label(action));
        // With their scales, because another range would give other numbers.
        let signals = scenario
            .drive()
            .map(|driving| driving.spec().observe.clone());
        (spaces.clone(), labels.collect::<Vec<_>>(), signals)
    };
    let mut unlike = egos.iter().map(|ego| (ego.name(), ego.scenario()));
    match unlike.find(|(_, scenario)| shape(scenario) != shape(&source)) {
        Some((ego, scenario)) => Err(EvaluationError::OtherObservations {
            source_world: source.name.clone(),
            world: scenario.name.clone(),
            ego: ego.to_owned(),
        }),
        None => Ok(policy),
    }
}
