//! A report about a run: the episodes it shows are played here.

use std::path::Path;

use serde::{Deserialize, Deserializer};

use super::break_even::BreakEven;
use super::error::EvaluationError;
use crate::adversary::Ado;
use crate::coverage::{Coverage, tries_of};
use crate::crashes::{description, highlights};
use crate::experiment::{
    Cost, EgoUnderTest, TestStarts, Watch, check_repeatability, consent, worse_first,
};
use crate::report::{CoverageSection, Example, Nominal, Report, Tested, TestingCost, Training};
use crate::rl::Policy;
use crate::ron_file::file_text;
use crate::run_dir::{Row, RunDir, RunError, Swept, counted};
use crate::scene::drive::EgoDrive;
use crate::search::{Adversary, ExperimentCell};
use crate::testbench::{FaultLog, Film, film_beyond};
use crate::world::Scenario;

/// Default number of episodes for changed egos, and bounds on the starts of each.
const REUSE_EPISODES: usize = 1000;
const LEAST_STARTS: usize = 20;
const MOST_STARTS: usize = 100;
/// Most episodes of a page whose rules are evaluated, and lines of its coverage.
const RULED_OF_PAGE: usize = 60;
const LINES_OF_PAGE: usize = 40;
/// A file of rows is no larger than this.
const MAX_ROWS_BYTES: u64 = 50_000_000;

/// Request for a report on a run.
#[derive(Clone, Copy)]
pub struct ReportRequest<'a> {
    /// Run directory whose policy is reported on.
    pub run: &'a RunDir,
    /// World of the run, on the plant to test on.
    pub scenario: &'a Scenario,
    /// Other runs of the same world, to show beside it.
    pub with: &'a [RunDir],
    /// Rows to show. Without rows, changed egos are played.
    pub given: &'a GivenRows,
    /// Test starts to draw, and the seed of their stream.
    pub starts: (usize, u64),
    /// Ego that the page is about. `None`: the world's own ego.
    pub ego: Option<&'a EgoUnderTest>,
    /// Number of starts for every changed ego.
    ///
    /// `None` for as many as 1000 episodes allow, 20 to 100.
    pub reuse_starts: Option<usize>,
}

/// Output of `eval`, `gate`, `sweep` or `search`, as far as a report shows it.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct GivenRows {
    /// Rows of any egos and ados.
    pub rows: Vec<Row>,
    /// Searches of the run.
    #[serde(default)]
    pub break_even: Vec<BreakEven>,
    /// Sweeps over parameters of the ego. A file has one at most.
    #[serde(default, deserialize_with = "one")]
    pub swept: Vec<Swept>,
}

fn one<'de, D: Deserializer<'de>>(file: D) -> Result<Vec<Swept>, D::Error> {
    // A file has a single object, and a report may be given several files.
    Swept::deserialize(file).map(|swept| vec![swept])
}

impl GivenRows {
    /// Adds the output of a verb from a file of this world.
    ///
    /// # Errors
    /// The file cannot be read, has no rows, or has rows of another world.
    pub fn read(&mut self, file: &Path, scenario: &Scenario) -> Result<(), EvaluationError> {
        let wrong = |why: String| EvaluationError::NoRows {
            file: file.into(),
            why,
        };
        // The size is tested before the file is read into memory.
        let size = std::fs::metadata(file).map(|meta| meta.len());
        // A missing file has no size, and is reported by the reading below.
        if size.is_ok_and(|size| size > MAX_ROWS_BYTES) {
            return Err(wrong("it is too large".to_owned()));
        }
        let text = file_text(file).map_err(|source| RunError::Io {
            verb: "reading",
            path: file.into(),
            source,
        })?;
        let printed: GivenRows =
            serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        if let Some(value) = printed.swept.iter().find_map(Swept::contradiction) {
            return Err(wrong(format!(
                "its sweep has more failing starts than starts at {value}"
            )));
        }
        // All rows are tested before any is added, so an error changes nothing.
        match printed.rows.iter().find(|row| row.world != scenario.name) {
            Some(other) => Err(wrong(format!("they are of the world `{}`", other.world))),
            None => {
                self.rows.extend(printed.rows);
                self.break_even.extend(printed.break_even);
                self.swept.extend(printed.swept);
                Ok(())
            }
        }
    }
}

impl<'a> ReportRequest<'a> {
    /// Plays the episodes of the report, and returns `None` if stopped before any.
    ///
    /// An unfinished training gives a report without episodes.
    ///
    /// # Errors
    /// The runs are of different worlds, or a run is damaged.
    pub fn report(&self, watch: &Watch<'_>) -> Result<Option<Report<'a>>, EvaluationError> {
        let run = self.run;
        let mut trainings = vec![training(run)?];
        for other in self.with {
            // Curves of different worlds would look comparable on a page.
            if other.manifest().world_sha256 != run.manifest().world_sha256 {
                return Err(EvaluationError::OtherWorld {
                    run: other.path().into(),
                });
            }
            trainings.push(training(other)?);
        }
        let mut report = Report {
            scenario: self.ego.map_or(self.scenario, EgoUnderTest::scenario),
            ego: self.ego.map(|ego| ego.name().to_owned()),
            manifest: run.manifest(),
            trainings,
            nominal: None,
            tested: Vec::new(),
            about_tested: String::new(),
            sweeps: self.given.swept.clone(),
            costs: Vec::new(),
            coverage: None,
            notes: notes(run),
            faults: Vec::new(),
            commands: Vec::new(),
        };
        if run.manifest().is_finished() {
            // An ego that does not run still gives a page, which shows its faults.
            let whole = self.fill(&mut report, watch)?;
            // Without an interruption the ego failed, and the page reports it.
            if whole.is_none() && watch.interrupted() {
                return Ok(None);
            }
        }
        let complaint = watch
            .faults
            .complaint()
            .map(|it| [it.unrepeatable, it.faults].concat());
        report.faults = complaint.unwrap_or_default();
        Ok(Some(report))
    }

    /// Plays the ego of the page, and other egos if no rows are given.
    fn fill(
        &self,
        report: &mut Report<'_>,
        watch: &Watch<'_>,
    ) -> Result<Option<()>, EvaluationError> {
        let nominal_ego = EgoUnderTest::nominal(self.scenario);
        let own = self.ego.unwrap_or(&nominal_ego);
        // What was measured already is not played again, but for the subject of the page.
        let egos = match self.ego {
            _ if !self.given.rows.is_empty() => vec![own.clone()],
            Some(ego) => vec![nominal_ego.clone(), ego.clone()],
            None => EgoUnderTest::find(self.scenario, "all")?,
        };
        consent(self.scenario, &egos)?;
        let (dir, world) = (self.run.path(), EgoUnderTest::nominal(&self.run.world()?));
        let (count, seed) = self.starts;
        let Some(drawn) = TestStarts::stored(Some(dir), &world, count, seed, watch) else {
            return Ok(None);
        };
        // Another ego may have other trivial starts.
        let of_page = match self.ego {
            Some(ego) => drawn.for_ego(world.scenario(), ego, Some(dir), watch),
            None => Some((drawn.clone(), None)),
        };
        let Some((starts, alone)) = of_page else {
            return Ok(None);
        };
        let policy = self.run.policy()?;
        let ado = Ado::Trained(&*policy, self.run.manifest().seed);
        let mut cell = ado.play(own, &starts, watch);
        if let Some(cell) = &mut cell {
            cell.row.fails_alone = alone;
        }
        report.nominal = cell.as_ref().map(nominal);
        if self.given.rows.is_empty() {
            report.tested.extend(cell.map(tested));
            let changed = self.changed(report, &*policy, &egos, &drawn, watch)?;
            if changed.is_none() {
                return Ok(None);
            }
        } else {
            report.about_tested = "Rows as given with `--rows`.".to_owned();
            let rows = self.given.rows.iter().cloned();
            report.tested = rows
                .map(|row| Tested {
                    row,
                    why: None,
                    outcomes: None,
                })
                .collect();
            // Without the ego of the page, the JUnit file would have no test of it.
            let is_own = |it: &Tested| it.row.ego == self.name() && it.is_adversary();
            if !report.tested.iter().any(is_own) {
                report
                    .about_tested
                    .push_str(" The trained ado was played for this page.");
                report.tested.extend(cell.map(tested));
            }
        }
        report.costs = costs(report, &self.given.break_even, self.name());
        report.coverage = self.coverage(own, &*policy, &starts, watch);
        Ok((!watch.interrupted()).then_some(()))
    }

    /// Returns the name of the ego that the page is about.
    fn name(&self) -> &str {
        self.ego.map_or("nominal", EgoUnderTest::name)
    }

    /// Plays the trained ado again to measure its coverage.
    ///
    /// `None`: stopped, no start, or a program, which would be as slow once more.
    fn coverage(
        &self,
        ego: &EgoUnderTest,
        policy: &dyn Policy,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<CoverageSection> {
        if ego.scenario().ego().is_some_and(EgoDrive::is_foreign) {
            return None;
        }
        // The faults of these tries were noted once.
        let quiet = Watch {
            faults: FaultLog::default(),
            ..watch.quiet()
        };
        let ado = Ado::Trained(policy, self.run.manifest().seed);
        let tries = tries_of(ego, ado, starts, RULED_OF_PAGE, &quiet)?;
        let coverage = Coverage::of(ego.scenario(), &tries);
        (!coverage.is_empty()).then(|| CoverageSection {
            verdict: coverage.verdict(),
            table: coverage.table(LINES_OF_PAGE),
        })
    }

    /// Every ego on the first starts, beside held-random actions. `None`: stopped.
    ///
    /// `drawn` are the starts of the world's own ego.
    fn changed(
        &self,
        report: &mut Report<'_>,
        policy: &dyn Policy,
        egos: &[EgoUnderTest],
        drawn: &TestStarts,
        watch: &Watch<'_>,
    ) -> Result<Option<()>, EvaluationError> {
        let (_, seed) = self.starts;
        let dir = Some(self.run.path());
        let is_judged = drawn.judges_each_ego(self.scenario);
        let count = self.reuse_starts.unwrap_or_else(|| {
            // Two ados play each ego, the trained and the held-random ado.
            (REUSE_EPISODES / (2 * egos.len())).clamp(LEAST_STARTS, MOST_STARTS)
        });
        // The number of changed egos multiplies the cost, so they play few starts.
        let few = first(drawn, count);
        for ego in egos {
            // Starts of a map of another size have other axes, so they are drawn anew.
            let own = if ego.scenario().axes() != self.scenario.axes() {
                let own = TestStarts::stored(dir, ego, count, seed, watch);
                own.map(|own| (own, None))
            } else if is_judged {
                // The ego of the page does not tell from which starts another one fails.
                few.for_ego(self.scenario, ego, dir, watch)
            } else {
                Some((few.clone(), None))
            };
            let Some((own, alone)) = own else {
                return Ok(None);
            };
            let trained = Ado::Trained(policy, self.run.manifest().seed);
            for ado in [trained, Ado::Hold] {
                // The ego of the page was played against the trained ado on all starts
                // already.
                if ego.name() == self.name() && matches!(ado, Ado::Trained(..)) {
                    continue;
                }
                let mut cell = ado.play(ego, &own, watch);
                if let Some(cell) = &mut cell {
                    cell.row.fails_alone = alone;
                }
                report.tested.extend(cell.map(tested));
            }
            let rows = report.tested.iter_mut().map(|tested| &mut tested.row);
            let of_ego = rows.filter(|row| row.ego == ego.name());
            check_repeatability(ego, &own, of_ego, watch);
        }
        report.about_tested = format!(
            "The trained ado and random actions held for five decisions, one simulation per \
             start: on the ego {} the trained ado from {}, all else from the \
             first {} of them. More ados, recall and searches can stand here: give what \
             eval and search print with --json by --rows.",
            self.name(),
            counted(drawn.starts.len(), "start"),
            few.starts.len(),
        );
        Ok(Some(()))
    }
}

/// Returns the row of a cell with the reason of its first failure.
fn tested(cell: ExperimentCell) -> Tested {
    Tested {
        why: cell.explain_first().map(|(_, why)| why.to_string()),
        outcomes: Some(cell.outcomes()),
        row: cell.row,
    }
}

/// Returns the starts of the nominal ego with the best examples.
fn nominal(cell: &ExperimentCell) -> Nominal {
    let scenario = cell.ego.scenario();
    let verdicts = cell.results.iter().map(|it| it.as_ref()?.verdict);
    let all = cell.starts.starts.iter().map(|(start, _)| start.clone());
    let mut chosen = highlights(cell);
    // A reader opens the first example first.
    chosen.sort_by(|a, b| worse_first(&a.episode, &b.episode));
    Nominal {
        row: cell.row.clone(),
        starts: all.zip(verdicts).collect(),
        highlights: chosen
            .into_iter()
            .map(|chosen| {
                let mut bench = scenario.repeating(&chosen.episode).bench();
                let Film { frames, after } = film_beyond(&mut bench, &chosen.episode);
                Example {
                    about: description(scenario, &chosen.episode),
                    frames,
                    after,
                    chosen_for: chosen.chosen_for,
                    start: Some(chosen.start),
                    episode: chosen.episode,
                    scenarios: Vec::new(),
                }
            })
            .collect(),
    }
}

/// The first starts of a list.
fn first(starts: &TestStarts, count: usize) -> TestStarts {
    let count = count.min(starts.starts.len());
    TestStarts {
        seed: starts.seed,
        starts: starts.starts[..count].to_vec(),
        trivial: starts.trivial[..count].to_vec(),
    }
}

/// The trained ado's simulations beside those of every search of the ego.
fn costs(report: &Report<'_>, evens: &[BreakEven], ego: &str) -> Vec<TestingCost> {
    let evens = evens.iter().filter(|even| even.ego == ego);
    // On the starts of the first search: a rate on others is no comparison.
    let trained = evens.clone().next().map(|even| TestingCost {
        name: "trained ado".to_owned(),
        fixed: Cost::of_training(report.manifest).simulations as f64,
        // A trained ado plays each start once, without a search.
        per_start: 1.0,
        solves: even.ado.success_rate,
        // Searches are cut to the success of the ado, which therefore always matches it.
        matched: true,
        anytime: Vec::new(),
    });
    let searches = evens.map(|even| TestingCost {
        fixed: 0.0,
        matched: even.matched,
        per_start: even.search.simulations,
        solves: even.search.success_rate,
        anytime: even
            .curve
            .iter()
            .map(|point| (point.budget as f64, point.success_rate))
            .collect(),
        name: even.method.clone(),
    });
    trained.into_iter().chain(searches).collect()
}

fn training(run: &RunDir) -> Result<Training, EvaluationError> {
    Ok(Training {
        run: shown(run.path()),
        manifest: run.manifest().clone(),
        progress: run.progress()?,
        closing: run.report()?,
    })
}

fn notes(run: &RunDir) -> Vec<String> {
    let manifest = run.manifest();
    let mut notes = Vec::new();
    if !manifest.against.is_nominal() {
        notes.push(format!(
            "This ado was trained against a family of egos ({}).",
            manifest.against
        ));
    }
    if let Some(ego) = &manifest.ego {
        notes.push(format!(
            "This ado was trained against the changed ego `{}`.",
            ego.name
        ));
    }
    if manifest.is_finished() {
        return notes;
    }
    notes.push(format!(
        "This training is not finished: {} of {} decisions are done, and there is no ado to show \
         yet. Go on with `brakecheck train {} -o {} --resume`.",
        manifest.decisions_done,
        manifest.decisions,
        shown(&run.path().join("world.ron")),
        shown(run.path()),
    ));
    notes
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}
