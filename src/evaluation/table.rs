//! A trained ado and its rivals on many egos: the table of reuse (Sec. IV).

use std::path::Path;

use super::evaluation_plan::{Evaluation, ExplainedCounterexample};

use super::ego_evaluation::EgoEvaluation;
use super::error::EvaluationError;
use super::evaluation_plan::FoundBy;
use super::reuse::{ReusedOn, reused_on};
use crate::adversary::{Baselines, BestOfNResult, EvalRequest, Evaluated, GridPolicy};
use crate::crashes::{Again, CrashWriter, KeepSettings, KeptFiles};
use crate::experiment::{
    EgoUnderTest, TestStarts, Watch, consent, note_if_unrepeatable, test_starts,
};
use crate::run_dir::FailsAlone;
use crate::run_dir::Row;
use crate::surrogate::AdaptedTo;
use crate::sysid::{ConditionedAdo, IdentifiedAs, conditioned};
use crate::testbench::Testbench;
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
    /// Whether one failed, which is a bug of this program.
    pub fn is_refuted(&self) -> bool {
        match self {
            TheoremsChecked::Grid(checked) => checked.is_refuted(),
            TheoremsChecked::CarryOver(carried) => carried.rows.iter().any(|row| {
                let sharper = row.sharper.as_ref().map_or(0, |sharper| sharper.misses);
                0 < row.misses + sharper
            }),
        }
    }
}

/// What an evaluation came to, as far as it came.
pub struct EvaluationTable<'a> {
    /// Every ego that was met.
    pub egos: Vec<ReusedOn>,
    /// Why each fails, if the trained ado made it.
    pub reasons: Vec<ExplainedCounterexample>,
    /// Who each is to a conditional ado, if that was asked for.
    pub identified: Vec<IdentifiedAs>,
    /// What was learned of each, if that was asked for.
    pub adapted_to: Vec<AdaptedTo>,
    /// Why it ended early, if it did.
    pub failure: Option<EvaluationError>,
    /// The nominal ego's test starts.
    pub starts: TestStarts,
    pub(crate) asked: Evaluation<'a>,
    pub(crate) found: Vec<FoundCounterexamples<'a>>,
}

/// Counterexamples of one ego, to be kept if asked for.
pub(crate) struct FoundCounterexamples<'a> {
    pub(crate) ego: &'a EgoUnderTest,
    pub(crate) by: FoundBy,
    pub(crate) ado: ConditionedAdo,
    /// The ego's own starts, where it has others.
    pub(crate) starts: Option<TestStarts>,
}

impl<'a> Evaluation<'a> {
    /// Lets all ados meet all egos. `None`: stopped before the first one.
    ///
    /// What fails later is in the table, beside all that was computed before.
    ///
    /// # Errors
    /// The ado cannot be played, or a baseline cannot be made.
    pub fn run(self, watch: &Watch<'_>) -> Result<Option<EvaluationTable<'a>>, EvaluationError> {
        let world = self.run.world()?;
        consent(&world, self.egos)?;
        self.can_learn()?;
        let Some(starts) = self.starts(&world, watch) else {
            return Ok(None);
        };
        let baselines = Baselines::of(self.ados, self.run, self.nominal, watch)?;
        let mut table = EvaluationTable {
            egos: Vec::new(),
            reasons: Vec::new(),
            identified: Vec::new(),
            adapted_to: Vec::new(),
            failure: None,
            starts,
            asked: self,
            found: Vec::new(),
        };
        for (nth, ego) in self.egos.iter().enumerate() {
            let met = table.meet(ego, &baselines, &watch.later(nth));
            table.failure = met.err();
            if watch.stopped() || table.failure.is_some() {
                break;
            }
        }
        Ok(Some(table))
    }

    fn starts(&self, scenario: &Scenario, watch: &Watch<'_>) -> Option<TestStarts> {
        let (count, seed) = self.starts;
        test_starts(scenario, seed, count, watch)
    }
}

impl<'a> EvaluationTable<'a> {
    /// All rows, ego by ego.
    pub fn rows(&self) -> Vec<Row> {
        let rows = self.egos.iter().flat_map(|ego| &ego.rows);
        rows.cloned().collect()
    }

    /// Lets all ados meet one ego; what was played before an error is kept.
    fn meet(
        &mut self,
        ego: &'a EgoUnderTest,
        baselines: &Baselines,
        watch: &Watch<'_>,
    ) -> Result<(), EvaluationError> {
        let asked = self.asked;
        let Some((own, left_out)) = self.own_starts(ego, watch) else {
            return Ok(());
        };
        let (_, seed) = asked.starts;
        let ado = conditioned(asked.run, asked.context, ego, seed, watch)?;
        self.identified.extend(ado.identified.clone());
        let starts = own.as_ref().unwrap_or(&self.starts);
        let mut meeting = EgoEvaluation {
            asked,
            ego,
            ado: &ado,
            starts,
            baselines,
            watch,
            rows: Vec::new(),
            reason: None,
            adapted_to: None,
            found: None,
        };
        let played = meeting.play();
        let (rows, reason, found) = (meeting.rows, meeting.reason, meeting.found);
        self.adapted_to.extend(meeting.adapted_to);
        if watch.interrupted() && rows.iter().all(|row| row.starts + row.invalid == 0) {
            return played;
        }
        note_if_unrepeatable(ego, starts, watch);
        let relation = ego.relation(asked.run, asked.nominal);
        let named = (ego.name(), relation);
        let mut reused = reused_on(ego.scenario(), named, starts, rows, watch);
        for row in &mut reused.rows {
            // Of the nominal ego it says nothing that `trivial` does not, unless it
            // is tested on another plant.
            let is_trivial =
                |it: &FailsAlone| ego.is_nominal() && !left_out && it.starts == row.trivial;
            let alone = row.fails_alone.filter(|it| !is_trivial(it));
            row.fails_alone = alone.map(|it| FailsAlone { left_out, ..it });
        }
        self.egos.push(reused);
        self.reasons.extend(reason);
        self.found.extend(
            found
                .filter(|_| asked.keeps)
                .map(|by| FoundCounterexamples {
                    ego,
                    by,
                    ado,
                    starts: own,
                }),
        );
        played
    }

    /// The starts of an ego where they are not the table's, and whether it is
    /// judged itself which of them are left out. `None`: stopped.
    fn own_starts(
        &self,
        ego: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Option<(Option<TestStarts>, bool)> {
        let asked = self.asked;
        // On a map of another size the starts are others: drawn, or listed, anew.
        if ego.scenario().axes() != asked.nominal.axes() {
            return Some((Some(asked.starts(ego.scenario(), watch)?), true));
        }
        if !self.starts.judges_each_ego(asked.nominal) {
            return Some((None, false));
        }
        let (own, _) =
            self.starts
                .for_ego(asked.nominal, (ego.scenario(), ego.is_nominal()), watch)?;
        Some((Some(own), true))
    }

    /// Checks the theorems of the paper that apply: 1 to 3 on a grid, 3 and
    /// Lemma 1 on the road; 3 on the changed egos that were met, or on all of the
    /// world's if none was. `None`: stopped.
    ///
    /// # Errors
    /// A theorem does not apply to the world.
    pub fn theorems(&self, watch: &Watch<'_>) -> Result<Option<TheoremsChecked>, EvaluationError> {
        let Evaluation {
            run,
            nominal,
            egos,
            context,
            starts: (_, seed),
            ..
        } = self.asked;
        // One ado for all egos: a conditional one is told of the nominal ego.
        let own = EgoUnderTest::nominal(nominal);
        let ado = conditioned(run, context, &own, seed, watch)?;
        let policy = &*ado.policy;
        let is_nominal = |ego: &EgoUnderTest| ego.name() == own.name();
        let all = if egos.iter().all(is_nominal) {
            EgoUnderTest::find(nominal, "all")?
        } else {
            egos.to_vec()
        };
        let changed = all.iter().filter(|ego| !is_nominal(ego));
        let changed = changed.map(|ego| (ego.name().to_owned(), ego.scenario().clone()));
        let changed: Vec<(String, Scenario)> = changed.collect();
        if nominal.grid().is_some() {
            let checked = grid_theorems(nominal, policy, &changed)?;
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

    /// Plays the counterexamples of every ego again and writes those asked for
    /// into a directory, saying what each is; none unless [`Evaluation::keeps`].
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        &self,
        dir: &Path,
        settings: KeepSettings,
        watch: &Watch<'_>,
    ) -> Result<Vec<KeptFiles>, EvaluationError> {
        let mut all = Vec::new();
        for found in &self.found {
            let kept = self.keep_those(found, dir, settings, watch)?;
            kept.note(found.ego.name(), dir, watch);
            all.push(kept);
        }
        Ok(all)
    }

    fn keep_those(
        &self,
        found: &FoundCounterexamples<'_>,
        dir: &Path,
        settings: KeepSettings,
        watch: &Watch<'_>,
    ) -> Result<KeptFiles, EvaluationError> {
        let starts = found.starts.as_ref().unwrap_or(&self.starts);
        let trained = self.asked.trained(found.ego, &found.ado, starts);
        let change = found.ego.change();
        let keep = |request: EvalRequest<'_>, evaluated: &Evaluated, play: Again<'_>| {
            let again = |bench: &mut Testbench, index: usize| {
                let mut played = |bench: &mut Testbench, index| play(bench, index);
                evaluated.again(&request, bench, index, &mut played)
            };
            let keeper = CrashWriter::of(&request, change, settings);
            let solved: Vec<usize> = evaluated.solved().collect();
            keeper.keep(&solved, &again, dir, watch)
        };
        Ok(match &found.by {
            FoundBy::Trained(evaluated) => keep(trained, evaluated, &|bench, index| {
                trained.play(bench, index)
            })?,
            FoundBy::Tries(BestOfNResult { evaluated, winners }) => {
                let tries = self.asked.several(trained, &found.ado);
                let winner = |index: usize| winners[index].unwrap_or(0);
                keep(trained, evaluated, &|bench, index| {
                    tries.play(bench, index, winner(index))
                })?
            }
            FoundBy::Adapted(adapted) => keep(trained, &adapted.evaluated, &|bench, index| {
                adapted.play(bench, starts, index)
            })?,
            FoundBy::Optimal(evaluated) => {
                let (whole, policy) = GridPolicy::Optimal.policy(found.ego)?;
                let request = EvalRequest {
                    scenario: &whole,
                    ado: GridPolicy::Optimal.ado(&policy),
                    ..trained
                };
                keep(request, evaluated, &|bench, index| {
                    request.play(bench, index)
                })?
            }
        })
    }
}
