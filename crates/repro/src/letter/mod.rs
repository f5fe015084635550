//! Steps from the paper's literal learning setup to the defaults.
//!
//! A path begins with a world such as `acc_letter`. Each step edits its text, so that the
//! effects of state, ρ_max, judge, reward, loss, exploration and learner are separated.
//! Every policy is judged by both judges on the same test starts.

mod paths;

use std::path::PathBuf;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use paths::LETTER_PATHS;

use super::case_studies::{CaseStudies, trained_run};
use brakecheck::adversary::Ado;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::{Row, RunDir};
use brakecheck::search::{Adversary, BASELINES, Experiment, Search};
use brakecheck::stats::{Outcomes, seeds_interval};
use brakecheck::training::TrainError;
use brakecheck::world::PlantKind;
use brakecheck::world::{Scenario, ScenarioError};
use brakecheck_report::report::table::TextTable;

/// Both judges, by their names in world files.
pub const JUDGES: [&str; 2] = ["WholeRun", "UntilViolation"];

/// Change of a world's text.
#[derive(Clone, Copy, Debug)]
pub struct LetterChange {
    /// Short description of the change.
    pub what: &'static str,
    /// Pairs of a text that occurs once and its replacement.
    pub edits: &'static [(&'static str, &'static str)],
}

/// Path from the paper's setup to the defaults.
#[derive(Clone, Copy, Debug)]
pub struct LetterPath {
    /// Shipped world at the beginning of the path.
    pub world: &'static str,
    /// Learner under `learners` that is trained. `None`: the world's own.
    pub learner: Option<&'static str>,
    /// Largest number of switches of the search for comparison.
    pub switches: usize,
    /// Changes, each in addition to the previous ones.
    pub changes: &'static [LetterChange],
}

/// Step of a path: a world's text with the changes so far.
#[derive(Clone, Debug)]
pub struct LetterStep {
    /// Description of the last change.
    pub what: &'static str,
    text: String,
    learner: Option<&'static str>,
}

/// Error of a path with an impossible step.
#[derive(Debug, thiserror::Error)]
pub enum LetterError {
    /// A text to be replaced does not occur exactly once.
    #[error("`{change}` edits a text that occurs {times} times in `{world}`")]
    Edit {
        /// Description of the change.
        change: &'static str,
        /// World of the path.
        world: &'static str,
        /// Number of occurrences.
        times: usize,
    },
    /// An edited text is not a valid world.
    #[error(transparent)]
    World(#[from] ScenarioError),
    /// An edited world lacks the learner.
    #[error("`{0}` has no learner of that name")]
    Learner(&'static str),
}

impl LetterPath {
    /// Returns the name of its learner in files and tables.
    pub fn learner_name(&self) -> &'static str {
        // The own learner of each letter world is the DQN of the paper.
        self.learner.unwrap_or("dqn")
    }

    /// Returns the numbers of changes at both ends: the letter itself and the defaults.
    pub fn ends(&self) -> impl Iterator<Item = usize> {
        [0, self.changes.len()].into_iter()
    }

    /// Returns the steps of a path, the unchanged text first.
    ///
    /// # Errors
    /// Returns an error if a change does not fit the text.
    pub fn steps(&self, text: &str) -> Result<Vec<LetterStep>, LetterError> {
        let mut steps = vec![LetterStep {
            what: "the letter",
            text: text.to_owned(),
            learner: self.learner,
        }];
        let mut text = text.to_owned();
        for change in self.changes {
            for (from, to) in change.edits {
                let times = text.matches(from).count();
                // An edit with several matches would change more than its description says.
                if times != 1 {
                    return Err(LetterError::Edit {
                        change: change.what,
                        world: self.world,
                        times,
                    });
                }
                text = text.replace(from, to);
            }
            steps.push(LetterStep {
                what: change.what,
                text: text.clone(),
                learner: self.learner,
            });
        }
        Ok(steps)
    }
}

impl LetterStep {
    /// Returns the world of this step on the kinematic plant.
    ///
    /// # Errors
    /// Returns an error if the text is not a valid world or lacks the learner.
    pub fn scenario(&self) -> Result<Scenario, LetterError> {
        self.read(&self.text)
    }

    /// Returns the same world under a judge of [`JUDGES`].
    ///
    /// # Errors
    /// Returns the errors of [`LetterStep::scenario`].
    pub fn judged_by(&self, judge: &str) -> Result<Scenario, LetterError> {
        // The text holds one of the judges, and replacing both covers either case.
        let text = JUDGES.iter().fold(self.text.clone(), |text, other| {
            text.replace(&format!("judge: {other}"), &format!("judge: {judge}"))
        });
        self.read(&text)
    }

    fn read(&self, text: &str) -> Result<Scenario, LetterError> {
        let step = Scenario::parse("a step from the letter", text)?;
        let scenario = match self.learner {
            None => step,
            Some(name) => step.learning_by(name).ok_or(LetterError::Learner(name))?,
        };
        // The study compares learning setups, so the fast plant is enough.
        Ok(scenario.on(PlantKind::Kinematic))
    }
}

/// Baselines and search under a judge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LetterBaselines {
    /// Name of the judge.
    pub judge: String,
    /// Search, held random, random and the best constant ado.
    pub rows: Vec<Row>,
}

/// Plays all baselines under the scenario's judge. `None`: stopped from outside.
pub fn letter_baselines(
    scenario: &Scenario,
    switches: usize,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<LetterBaselines> {
    // The search comes first, because `letter_row` compares with the first row.
    let search: &dyn Adversary = &Search::switches(switches);
    let experiment = Experiment {
        ego: &EgoUnderTest::nominal(scenario),
        adversaries: [search].into_iter().chain(BASELINES).collect(),
        starts,
    };
    let rows = experiment.rows(watch);
    // The rows name the judge that was used, whatever the text asked for.
    let judge = format!("{:?}", rows.first()?.judge);
    (!watch.stopped()).then_some(LetterBaselines { judge, rows })
}

/// Results of a step's trainings under a judge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Judged {
    /// Number of evaluated starts, without trivial starts.
    pub starts: usize,
    /// Success rate of each training.
    pub rates: Vec<f64>,
    /// Mean of the rates.
    pub success_rate: f64,
    /// Interval of the mean over trainings and starts (docs/background/intervals.md).
    pub ci95: [f64; 2],
    /// Median recall over trainings.
    pub recall: Option<f64>,
    /// Mean share of starts on which a rule was broken.
    pub foul_rate: f64,
}

/// Results of a step under both judges.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LetterRow {
    /// Description of the change.
    pub what: String,
    /// Name of the learner.
    pub learner: String,
    /// Requested number of decisions.
    pub decisions: u64,
    /// Mean processor time of a training, s.
    pub cpu_s: f64,
    /// Results by judge, in the order of [`JUDGES`].
    pub judged: Vec<Judged>,
}

/// Error of a step.
#[derive(Debug, thiserror::Error)]
pub enum LetterStudyError {
    /// The step is impossible.
    #[error(transparent)]
    Step(#[from] LetterError),
    /// A training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// Trains a step with every seed and evaluates every policy under both judges.
///
/// Run directories are stored in `request.runs`, and existing ones are used.
/// `None`: stopped from outside.
///
/// # Errors
/// Returns an error if the step is impossible or a training fails.
pub fn letter_row(
    step: &LetterStep,
    baselines: &[LetterBaselines],
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<LetterRow>, LetterStudyError> {
    let scenario = step.scenario()?;
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    let runs: Vec<(PathBuf, f64)> = seeds
        .par_iter()
        .map(|&seed| trained_run(&scenario, seed, request.runs, watch))
        .collect::<Result<_, _>>()?;
    // A stopped training has no policy to evaluate.
    if watch.stopped() {
        return Ok(None);
    }
    let mut judged = Vec::new();
    for (judge, baselines) in JUDGES.iter().zip(baselines) {
        // The policy is trained once, and only the judge of the evaluation changes.
        let scenario = step.judged_by(judge)?;
        // Trivial starts depend on the judge, so each judge has its own.
        let Some(starts) = test_starts(&scenario, request.seeds.starts, request.starts, watch)
        else {
            return Ok(None);
        };
        let ego = EgoUnderTest::nominal(&scenario);
        let mut rows = Vec::new();
        for (path, _) in &runs {
            let run = RunDir::open(path).map_err(TrainError::from)?;
            let policy = run.policy().map_err(TrainError::from)?;
            let ado = Ado::Trained(&*policy, run.manifest().seed);
            rows.extend(ado.play(&ego, &starts, watch).map(|cell| cell.row));
        }
        // The first row of the baselines is the search.
        if let Some(searched) = baselines.rows.first() {
            rows.iter_mut()
                .for_each(|row| row.compare_with_search(&searched.solved));
        }
        // Invariant: the results have the order of `JUDGES`.
        judged.push(together(&rows));
    }
    let cpu_s = runs.iter().map(|(_, cpu_s)| cpu_s).sum::<f64>() / runs.len().max(1) as f64;
    Ok((!watch.stopped()).then(|| LetterRow {
        what: step.what.to_owned(),
        learner: scenario.learner().name().to_owned(),
        decisions: scenario.learner().decisions(),
        cpu_s,
        judged,
    }))
}

fn together(rows: &[Row]) -> Judged {
    let n = rows.len().max(1) as f64;
    let mean = |of: fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / n;
    let solved: Vec<&Outcomes> = rows.iter().map(|row| &row.solved).collect();
    let mut recalls: Vec<f64> = rows.iter().filter_map(|row| row.recall).collect();
    // A recall is missing if the search solves no start.
    recalls.sort_by(f64::total_cmp);
    Judged {
        starts: rows.first().map_or(0, |row| row.starts),
        rates: rows.iter().map(|row| row.success_rate).collect(),
        success_rate: mean(|row| row.success_rate),
        ci95: seeds_interval(&solved),
        // The upper one of two in the middle, so that it belongs to a training.
        recall: recalls.get(recalls.len() / 2).copied(),
        foul_rate: mean(|row| row.foul_rate),
    }
}

/// Measured path.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LetterStudy {
    /// World at the beginning of the path.
    pub world: String,
    /// Name of its learner. `None`: the world's own.
    pub learner: Option<String>,
    /// Largest number of switches of the search.
    pub switches: usize,
    /// Baselines by judge, in the order of [`JUDGES`].
    pub baselines: Vec<LetterBaselines>,
    /// Results of the steps.
    pub rows: Vec<LetterRow>,
}

/// Letter and defaults of a path on the page, by both judges.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LetterEnds {
    /// World at the beginning of the path.
    pub world: String,
    /// Name of its learner.
    pub learner: String,
    /// Largest number of switches of the search.
    pub switches: usize,
    /// Results to the letter: the first row.
    pub letter: LetterRow,
    /// Results with the defaults: the last row.
    pub defaults: LetterRow,
    /// Search, held random, random and best constant actions, by judge.
    pub baselines: Vec<[f64; 4]>,
}

impl LetterStudy {
    /// Returns the first and the last row, with the rates of the baselines.
    ///
    /// `None`: the study is empty.
    pub fn ends(&self) -> Option<LetterEnds> {
        let of_judge = |judge: &LetterBaselines| {
            let rate = |at: usize| judge.rows.get(at).map_or(0.0, |row| row.success_rate);
            [rate(0), rate(1), rate(2), rate(3)]
        };
        Some(LetterEnds {
            world: self.world.clone(),
            learner: self.learner.clone().unwrap_or_else(|| "dqn".to_owned()),
            switches: self.switches,
            letter: self.rows.first()?.clone(),
            defaults: self.rows.last()?.clone(),
            baselines: self.baselines.iter().map(of_judge).collect(),
        })
    }
}

/// Explanation of the columns, below the tables.
const EXPLAINED: &str = "
- change: what differs from the row above; all earlier changes stay
- whole run, until the violation: the same policies, by each judge; mean success, interval, and least to greatest of the trainings
- recall: of the starts that search solves until the violation, the share solved too; median over trainings
- rule violations: share of starts on which a rule is broken within the whole run
- CPU s: processor time of a training, on average
";

/// Formats the paths as Markdown tables.
pub fn letter_markdown(studies: &[LetterStudy]) -> String {
    let percent = |rate: f64| format!("{:.1} %", 100.0 * rate);
    let mut text = String::new();
    for study in studies {
        let first_rows = study.baselines.iter().filter_map(|one| one.rows.first());
        let starts: Vec<String> = first_rows.map(|row| row.starts.to_string()).collect();
        text.push_str(&format!(
            "{}, {}; starts that are not trivial: {} (whole run), {} (until the violation)\n\n",
            study.world,
            study.learner.as_deref().unwrap_or("dqn"),
            starts.first().map_or("–", String::as_str),
            starts.get(1).map_or("–", String::as_str),
        ));
        let mut lines = Vec::new();
        for row in &study.rows {
            let success = |at: usize| {
                row.judged.get(at).map_or("–".to_owned(), |judged| {
                    let [least, greatest] = ends(&judged.rates);
                    format!(
                        "{} [{:.1}, {:.1}], {:.0} to {:.0}",
                        percent(judged.success_rate),
                        100.0 * judged.ci95[0],
                        100.0 * judged.ci95[1],
                        100.0 * least,
                        100.0 * greatest,
                    )
                })
            };
            // Recall refers to the search until the violation, which is the second judge.
            let recall = row.judged.get(1).and_then(|judged| judged.recall);
            lines.push([
                row.what.clone(),
                format!("{}, {}", row.learner, row.decisions),
                success(0),
                success(1),
                recall.map_or("–".to_owned(), |recall| format!("{recall:.3}")),
                row.judged
                    .first()
                    .map_or("–".to_owned(), |judged| percent(judged.foul_rate)),
                format!("{:.0}", row.cpu_s),
            ]);
        }
        // The order of `letter_baselines`.
        let names = [
            format!("search, ≤ {} switches", study.switches),
            "random, held".to_owned(),
            "random".to_owned(),
            "best constant".to_owned(),
        ];
        for (at, name) in names.iter().enumerate() {
            let rate = |judge: usize| {
                let row = study.baselines.get(judge).and_then(|one| one.rows.get(at));
                row.map_or("–".to_owned(), |row| {
                    // An interrupted row has no interval.
                    let Some([lo, hi]) = row.ci95.map(|ci95| ci95.map(|share| 100.0 * share))
                    else {
                        return "–".to_owned();
                    };
                    format!("{} [{lo:.1}, {hi:.1}]", percent(row.success_rate))
                })
            };
            // As in the rows of the steps, rules are those of the whole run.
            let violations = study.baselines.first().and_then(|one| one.rows.get(at));
            lines.push([
                format!("*{name}*"),
                "–".to_owned(),
                rate(0),
                rate(1),
                "–".to_owned(),
                violations.map_or("–".to_owned(), |row| percent(row.foul_rate)),
                "–".to_owned(),
            ]);
        }
        let columns = [
            "change",
            "learner, decisions",
            "whole run: success [95 %]",
            "until the violation: success [95 %]",
            "recall",
            "rule violations",
            "CPU s",
        ];
        text.push_str(&TextTable::new(columns, lines).to_markdown());
        text.push('\n');
    }
    text + EXPLAINED
}

/// Returns the smallest and the largest rate.
fn ends(rates: &[f64]) -> [f64; 2] {
    let least = rates.iter().copied().fold(f64::INFINITY, f64::min);
    // Rates are shares, of which none is below 0.
    [least, rates.iter().copied().fold(0.0, f64::max)]
}
