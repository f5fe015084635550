//! Run whose ado `eval`, `gate` and `sweep` test.

use std::path::Path;

use serde_json::{Value, json};

use super::answer::PrintedAnswer;
use super::common::{open_run, placed, print_json};
use super::failure::Failure;
use super::input;
use super::keep::KeepStep;
use super::live::{Live, Streamed};
use super::test_args::{TestArgs, note_program_costs};
use super::{egos_table, progress, table};
use crate::adversary::{AdoWord, GridPolicy};
use crate::evaluation::{Evaluation, EvaluationTable, ado_effects, summarise};
use crate::experiment::{EgoUnderTest, Watch};
use crate::run_dir::{AdversaryId, Row, RunDir};
use crate::world::Scenario;

/// Returns whether the path is a world file or a shipped world, and not a run.
pub(super) fn is_world(path: &Path) -> bool {
    let mut shipped = Scenario::shipped_names().chain(Scenario::protocol_names());
    let mut is_shipped = || shipped.any(|name| path.as_os_str() == name);
    // A directory of the same name as a shipped world is a run.
    path.is_file() || input::is_stdin(path) || (!path.exists() && is_shipped())
}

/// Refuses a world where a verb requires a trained ado.
pub(super) fn refuse_world(path: &Path, verb: &str) -> Result<(), Failure> {
    if is_world(path) {
        let world = path.display();
        return Err(Failure::input(
            format!("`{world}` is a world, and `{verb}` requires the run of a trained ado"),
            format!("train an ado first and give its run: `brakecheck train {world} -o RUN`"),
        ));
    }
    Ok(())
}

/// Result of a verb beside the rows: its key in JSON, and its answer.
pub(super) struct Supplement {
    pub(super) key: &'static str,
    pub(super) value: Value,
    /// Its verdict and table come before those of the rows.
    pub(super) answer: PrintedAnswer,
}

/// Run and its world, on the plant to test on, with the requested ados.
pub(super) struct RunUnderTest<'a> {
    pub(super) nominal: Scenario,
    run: RunDir,
    ados: Vec<AdversaryId>,
    test: &'a TestArgs,
}

impl<'a> RunUnderTest<'a> {
    /// Opens a run, and refuses requests without a possible result.
    pub(super) fn open(path: &Path, test: &'a TestArgs) -> Result<RunUnderTest<'a>, Failure> {
        test.live.admit(test.common.json)?;
        let run = open_run(path, &test.common)?;
        // A run without a trained ado is refused before anything is played.
        run.policy_bundle()?;
        let on_plant = placed(run.scenario()?, test.plant)?;
        let nominal = test.traffic.limited(on_plant)?;
        test.traffic.keep_one(test.keep.dir())?;
        let ados = ados(test, &run, &nominal);
        keeps_something(test, &ados)?;
        can_learn(test, &nominal)?;
        Ok(RunUnderTest {
            ados,
            nominal,
            run,
            test,
        })
    }

    /// Adds the trained ado without each of its ados, unless ados are requested.
    pub(super) fn leaving_out_each(mut self) -> RunUnderTest<'a> {
        if self.test.ado.is_empty() {
            let without = AdoWord::named("without").into_iter();
            self.ados
                .extend(without.flat_map(|group| group.ids(&self.run, &self.nominal)));
        }
        self
    }

    /// Opens the stream of the test, if one is requested.
    pub(super) fn live(&self) -> Result<Live, Failure> {
        let name = format!("test with {}", self.run.path().display());
        self.test.live.open(&name, Streamed::Episodes)
    }

    /// Returns the watch of an evaluation of so many egos.
    pub(super) fn watch<'b>(
        &self,
        bar: &'b progress::Bar,
        live: &'b Live,
        egos: usize,
    ) -> Watch<'b> {
        let watch = bar.watch().first_of(self.test.keep.steps(egos));
        watch.shown_to(live.audience())
    }

    /// Plays every ado against every ego, and returns `None` if stopped before the first.
    ///
    /// Egos that are compared stay in memory, as those whose counterexamples are kept.
    pub(super) fn evaluate<'b>(
        &'b self,
        egos: &'b [EgoUnderTest],
        compares: bool,
        watch: &Watch<'_>,
    ) -> Result<Option<EvaluationTable<'b>>, Failure> {
        let test = self.test;
        let evaluation = Evaluation {
            ados: &self.ados,
            keeps: compares || test.keep.dir().is_some(),
            ..test.evaluation(&self.run, &self.nominal, egos)
        };
        let evaluated = evaluation.run(watch)?;
        note_program_costs(egos, watch);
        Ok(evaluated)
    }

    /// Prints the rows, with the result of the verb before them.
    pub(super) fn show(
        &self,
        evaluated: &EvaluationTable<'_>,
        result: Option<Supplement>,
    ) -> Result<(), Failure> {
        // The run is about its trained ado, so the others are compared with that one.
        let summary = summarise(&evaluated.egos, &AdversaryId::Trained);
        if self.test.common.json {
            let mut object = json!({
                "rows": evaluated.rows(),
                "egos": evaluated.egos,
                "summary": summary,
                "explain": evaluated.reasons,
            });
            // A key appears only if requested, so scripts of other requests see no change.
            if !evaluated.adapted_to.is_empty() {
                object["adapted"] = json!(evaluated.adapted_to);
            }
            let effects = ado_effects(&evaluated.rows());
            if !effects.is_empty() {
                object["ado_effects"] = json!(effects);
            }
            if let Some(result) = result {
                object[result.key] = result.value;
            }
            return print_json(&object);
        }
        let mut answer = egos_table::reuse(&evaluated.egos, &summary);
        table::add_effects(&mut answer, &ado_effects(&evaluated.rows()));
        for adapted in &evaluated.adapted_to {
            answer.details.push_str(&format!("\n{adapted}"));
        }
        for why in &evaluated.reasons {
            answer.details.push_str(&format!(
                "\nwhy `{}` fails from start {}, the first of them: {}",
                why.ego, why.start, why.explanation
            ));
        }
        if let Some(result) = result {
            answer = result.answer.before(answer);
        }
        self.test.live.data(&answer.text(self.test.answer))
    }

    /// Keeps counterexamples if asked to: the step after as many as there are egos.
    pub(super) fn keep(&self, evaluated: &EvaluationTable<'_>, egos: usize) -> Result<(), Failure> {
        let keep = |dir: &Path, settings, watch: &Watch<'_>| evaluated.keep(dir, settings, watch);
        let step = KeepStep {
            egos,
            answer: self.test.answer,
        };
        self.test.keep.last_step(&self.test.common, step, keep)
    }
}

/// Returns all rows, or the error that ended the evaluation at a later ego.
pub(super) fn rows_of(evaluated: EvaluationTable<'_>) -> Result<Vec<Row>, Failure> {
    let rows = evaluated.rows();
    match evaluated.failure {
        Some(failure) => Err(failure.into()),
        None => Ok(rows),
    }
}

/// Returns the ados to play.
///
/// By default, an ado that adapts has the baselines beside it that it must exceed.
fn ados(test: &TestArgs, run: &RunDir, nominal: &Scenario) -> Vec<AdversaryId> {
    use AdversaryId::{BestConstant, BestSwitch, Hold, Trained};
    match (test.ado.is_empty(), test.runs) {
        (false, _) => {
            let groups = test.ado.iter();
            groups.flat_map(|group| group.ids(run, nominal)).collect()
        }
        (true, 0) => vec![Trained],
        (true, _) => {
            let mut beside = vec![Trained, Hold, BestConstant, BestSwitch];
            // Only a training against one ego stores counterexamples.
            if run.manifest().against.is_nominal() {
                let replays = AdoWord::named("replays").into_iter();
                beside.extend(replays.flat_map(|group| group.ids(run, nominal)));
            }
            beside
        }
    }
}

/// Refuses to adapt to egos in worlds without driving.
fn can_learn(test: &TestArgs, nominal: &Scenario) -> Result<(), Failure> {
    if test.runs > 0 && nominal.drive().is_none() {
        return Err(Failure::input(
            "`--runs` learns how an ego drives, and in this world no vehicle drives",
            "leave it out: the ado of a grid plays as it was trained",
        ));
    }
    Ok(())
}

/// Refuses to keep counterexamples of ados whose counterexamples are not kept.
fn keeps_something(test: &TestArgs, ados: &[AdversaryId]) -> Result<(), Failure> {
    // The others are yardsticks, whose counterexamples say nothing new about the trained
    // ado.
    let kept = [AdversaryId::Trained, GridPolicy::Optimal.id()];
    if test.keep.dir().is_some() && !kept.iter().any(|ado| ados.contains(ado)) {
        Err(Failure::input(
            "`--keep` requires the trained ado, whose counterexamples it writes",
            "add `--ado trained`",
        ))
    } else {
        Ok(())
    }
}
