//! A trained ado and its rivals on many egos: the table of reuse (Sec. IV).

use std::path::Path;

use super::ego_evaluation::EgoEvaluation;
use super::error::EvaluationError;
use super::evaluation_plan::{Evaluation, ExplainedCounterexample};
use super::reuse::{Relation, ReusedOn, reused_with_coasting};
use crate::adversary::Baselines;
use crate::crashes::{KeepSettings, KeptFiles, keep_cells};
use crate::experiment::{EgoUnderTest, TestStarts, Watch, check_repeatability, consent};
use crate::rl::Policy;
use crate::run_dir::{FailsAlone, Row};
use crate::search::ExperimentCell;
use crate::surrogate::AdaptedTo;
use crate::theorems::{CarryOver, GridTheorems, TheoremsRequest, carry_over, grid_theorems};
use crate::world::Scenario;

/// Share of starts on which a distance predicted for Theorem 3 may be exceeded.
const ALPHA: f64 = 0.1;

/// The paper's theorems, checked on a run.
#[derive(Clone, Debug, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TheoremsChecked {
    /// Theorems 1 to 3 on a grid.
    Grid(Box<GridTheorems>),
    /// Theorem 3 and Lemma 1, on changed egos.
    CarryOver(CarryOver),
}

impl TheoremsChecked {
    /// Returns whether a theorem is refuted, which is a bug of this program.
    pub fn is_refuted(&self) -> bool {
        // The table has a verdict of its own per theorem, and any of them counts.
        match self {
            TheoremsChecked::Grid(checked) => checked.is_refuted(),
            TheoremsChecked::CarryOver(carried) => carried.rows.iter().any(|row| {
                let sharper = row.sharper.as_ref().map_or(0, |sharper| sharper.misses);
                row.misses + sharper > 0
            }),
        }
    }
}

/// Results of an evaluation, as far as it ran.
pub struct EvaluationTable<'a> {
    /// Every ego that was played.
    pub egos: Vec<ReusedOn>,
    /// First failure of each ego under the trained ado, with its explanation.
    pub reasons: Vec<ExplainedCounterexample>,
    /// Summary of the adaptation to each ego, if requested.
    pub adapted_to: Vec<AdaptedTo>,
    /// Error that ended the evaluation early, if any.
    pub failure: Option<EvaluationError>,
    /// The nominal ego's test starts.
    pub starts: TestStarts,
    pub(crate) evaluation: Evaluation<'a>,
    policy: Box<dyn Policy>,
    /// Cell of each ego whose counterexamples are kept.
    pub found: Vec<ExperimentCell>,
    /// Cell of each of these egos without an adversary, over all starts.
    pub(super) alone: Vec<ExperimentCell>,
}

impl<'a> Evaluation<'a> {
    /// Plays every ado against every ego, and returns `None` if stopped before the first.
    ///
    /// An error at a later ego is in the table, beside all earlier results.
    ///
    /// # Errors
    /// The ado cannot be played, or a baseline cannot be made.
    pub fn run(self, watch: &Watch<'_>) -> Result<Option<EvaluationTable<'a>>, EvaluationError> {
        let world = self.run.world()?;
        consent(&world, self.egos)?;
        // Refused before the first simulation.
        self.can_learn()?;
        self.can_solve()?;
        let policy = self.run.policy()?;
        let Some(starts) = self.starts(&EgoUnderTest::nominal(&world), watch) else {
            return Ok(None);
        };
        let baselines = Baselines::of(self.ados, self.run, self.nominal, watch)?;
        let mut table = EvaluationTable {
            egos: Vec::new(),
            reasons: Vec::new(),
            adapted_to: Vec::new(),
            failure: None,
            starts,
            evaluation: self,
            policy,
            found: Vec::new(),
            alone: Vec::new(),
        };
        for (nth, ego) in self.egos.iter().enumerate() {
            let played = table.evaluate(ego, &baselines, &watch.later(nth));
            // Rows before an error are kept, because they may have cost hours.
            table.failure = played.err();
            if watch.stopped() || table.failure.is_some() {
                break;
            }
        }
        Ok(Some(table))
    }

    fn starts(&self, ego: &EgoUnderTest, watch: &Watch<'_>) -> Option<TestStarts> {
        let (count, seed) = self.starts;
        TestStarts::stored(Some(self.run.path()), ego, count, seed, watch)
    }
}

impl<'a> EvaluationTable<'a> {
    /// All rows, ego by ego.
    pub fn rows(&self) -> Vec<Row> {
        let rows = self.egos.iter().flat_map(|ego| &ego.rows);
        rows.cloned().collect()
    }

    /// Plays all ados against an ego, and keeps the rows before an error.
    fn evaluate(
        &mut self,
        ego: &'a EgoUnderTest,
        baselines: &Baselines,
        watch: &Watch<'_>,
    ) -> Result<(), EvaluationError> {
        let evaluation = self.evaluation;
        let Some((own, left_out)) = self.own_starts(ego, watch) else {
            return Ok(());
        };
        let starts = own.as_ref().unwrap_or(&self.starts);
        let mut of_ego = EgoEvaluation {
            evaluation,
            ego,
            policy: &*self.policy,
            starts,
            baselines,
            watch,
            rows: Vec::new(),
            reason: None,
            adapted_to: None,
            found: None,
        };
        let played = of_ego.play();
        let (mut rows, reason, mut found) = (of_ego.rows, of_ego.reason, of_ego.found);
        self.adapted_to.extend(of_ego.adapted_to);
        // An ego without any played start would be an empty block of the table.
        if watch.interrupted() && rows.iter().all(|row| row.starts + row.invalid == 0) {
            return played;
        }
        check_repeatability(ego, starts, &mut rows, watch);
        let relation = Relation::of(ego, evaluation.run, evaluation.nominal);
        let void = rows.iter().find(|row| row.is_unrepeatable());
        let void = void.and_then(|row| row.faults.first()).cloned();
        let (mut reused, mut alone) = reused_with_coasting(ego, relation, starts, rows, watch);
        for row in &mut reused.rows {
            // On its own plant, the nominal ego fails alone exactly from the trivial
            // starts. Only another plant gives a new number.
            let is_trivial =
                |it: &FailsAlone| ego.is_nominal() && !left_out && it.starts == row.trivial;
            let alone = row.fails_alone.filter(|it| !is_trivial(it));
            row.fails_alone = alone.map(|it| FailsAlone { left_out, ..it });
        }
        for cell in found.iter_mut().chain([&mut alone]) {
            if let Some(found) = &void {
                // In front, since the first fault is that of the whole row.
                cell.row.faults.insert(0, found.clone());
            }
        }
        self.egos.push(reused);
        self.reasons.extend(reason);
        if evaluation.keeps {
            self.found.extend(found);
            self.alone.push(alone);
        }
        played
    }

    /// The starts of an ego where they are not the table's, and whether it is
    /// judged itself which of them are left out. `None`: stopped.
    fn own_starts(
        &self,
        ego: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Option<(Option<TestStarts>, bool)> {
        let evaluation = self.evaluation;
        // On a map of another size the starts are others: drawn, or listed, anew.
        if ego.scenario().axes() != evaluation.nominal.axes() {
            return Some((Some(evaluation.starts(ego, watch)?), true));
        }
        if !self.starts.judges_each_ego(evaluation.nominal) {
            return Some((None, false));
        }
        let dir = Some(evaluation.run.path());
        let (own, _) = self.starts.for_ego(evaluation.nominal, ego, dir, watch)?;
        Some((Some(own), true))
    }

    /// Checks the theorems of the paper that apply to the world.
    ///
    /// These are Theorems 1 to 3 on a grid, and Theorem 3 and Lemma 1 on the road.
    /// Theorem 3 uses the changed egos that were played, or all of the world's if none
    /// was. `None` if stopped.
    ///
    /// # Errors
    /// A theorem does not apply to the world.
    pub fn theorems(&self, watch: &Watch<'_>) -> Result<Option<TheoremsChecked>, EvaluationError> {
        let Evaluation { nominal, egos, .. } = self.evaluation;
        let own = EgoUnderTest::nominal(nominal);
        let policy = &*self.policy;
        let is_nominal = |ego: &EgoUnderTest| ego.name() == own.name();
        // Theorem 3 needs a changed ego to say anything.
        let all = if egos.iter().all(is_nominal) {
            EgoUnderTest::find(nominal, "all")?
        } else {
            egos.to_vec()
        };
        let changed: Vec<(String, Scenario)> = all
            .iter()
            .filter(|ego| !is_nominal(ego))
            .map(|ego| (ego.name().to_owned(), ego.scenario().clone()))
            .collect();
        if let Some(grid) = nominal.grid() {
            let checked = grid_theorems(grid, policy, &changed)?;
            return Ok(Some(TheoremsChecked::Grid(Box::new(checked))));
        }
        let request = TheoremsRequest {
            nominal,
            changed: &changed,
            policy,
            starts: &self.starts,
            alpha: ALPHA,
        };
        Ok(carry_over(&request, watch)?.map(TheoremsChecked::CarryOver))
    }

    /// Plays the counterexamples of every ego again and keeps the selected ones.
    ///
    /// Nothing is kept without [`Evaluation::keeps`].
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        &self,
        dir: &Path,
        settings: KeepSettings,
        watch: &Watch<'_>,
    ) -> Result<Vec<KeptFiles>, EvaluationError> {
        Ok(keep_cells(&self.found, dir, settings, watch)?)
    }
}
