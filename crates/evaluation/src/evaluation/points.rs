//! Points of a test protocol: those that an ego passes, and their variations.
//!
//! A point is a start of a world in which the others follow the protocol, as long as the
//! ado adds nothing to their plans. Every point is therefore played once with the neutral
//! action, by the ego under test itself. If the world has an ado, its variations within
//! the rules are searched at every passed point, for the first that makes the ego fail.

mod case;

use std::path::Path;

use indexmap::IndexMap;
use serde::Serialize;

use crate::adversary::Ado;
use crate::crashes::{KeepSettings, KeptFiles, copies, description};
use crate::experiment::{
    EgoUnderTest, EpisodeLoop, TestStarts, Watch, check_repeatability, decided, leaf,
    untried_starts,
};
use crate::report::{Example, PointsPage};
use crate::rulebook::Verdict;
use crate::run_dir::{KeptError, Row, counted};
use crate::search::{Adversary, ExperimentCell, SWITCHES, SWITCHES_OF_PROGRAMS, Search};
use crate::stats::StartOutcome;
use crate::testbench::{Episode, FaultCount, Film, Testbench, film_beyond};
use crate::world::Scenario;

/// What an ego does that is no result at any point.
const VOIDED: &str = "depends on more than the episode";

/// Request to play an ego at the points of its world.
#[derive(Clone, Copy)]
pub struct PointsRequest<'a> {
    /// The ego under test.
    pub ego: &'a EgoUnderTest,
    /// Starts of a world without a table, and the seed of all noise.
    pub starts: (usize, u64),
    /// Most changes of the deviation, by default 2, and 1 for programs.
    pub switches: Option<usize>,
}

/// Outcome of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointOutcome {
    /// The ego satisfied its specification.
    Passed,
    /// It violated it.
    Failed,
    /// An ado broke its rule first, so the point says nothing about the ego.
    NoAnswer,
    /// The ego or the physics failed to run.
    Invalid,
    /// The command was interrupted before its turn.
    NotReached,
}

/// One point and one ego.
#[derive(Clone, Debug, Serialize)]
pub struct PointResult {
    /// Position in the world's table, from 0.
    pub point: usize,
    /// Values of the start, by axis.
    pub start: IndexMap<String, f64>,
    /// Outcome of the point.
    pub outcome: PointOutcome,
    /// ρ(ψ_ego), below 0 if the ego fails.
    ///
    /// `None` if a rule was broken first, or if nothing ran.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robustness: Option<f64>,
    /// Failure of the ego, if it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<PointFailure>,
    /// Result of the search of variations. `None` without a search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub varied: Option<VariedPoint>,
}

impl PointResult {
    /// Makes the point no result, because its ego depends on more than the episode.
    fn void(&mut self) {
        if self.outcome != PointOutcome::NotReached {
            self.outcome = PointOutcome::Invalid;
        }
        (self.robustness, self.failure, self.varied) = (None, None, None);
    }
}

/// Failure of an ego at a point.
#[derive(Clone, Debug, Serialize)]
pub struct PointFailure {
    /// The part of ψ_ego that decides.
    pub leaf: String,
    /// Time of the violation.
    pub violated_s: f64,
    /// The agents that touch, if any do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<(String, String)>,
    /// Closing speed of that contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_mps: Option<f64>,
}

/// Result of the search of variations within the rules, at a passed point.
#[derive(Clone, Debug, Serialize)]
pub struct VariedPoint {
    /// True if a variation makes the ego fail.
    pub fails: bool,
    /// True if the ego or the physics failed to run in the search.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub invalid: bool,
    /// Closing speed of its contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closing_mps: Option<f64>,
    /// True if a human model of UN R157 avoids it, `CC_LATCHED` or `FSM`.
    ///
    /// `None` if the ego does not fail, or if the encounter cannot be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preventable: Option<bool>,
}

/// One ego at the points of one world.
#[derive(Clone, Serialize)]
pub struct PointsTable {
    /// Name of the world.
    pub world: String,
    /// Name of the ego.
    pub ego: String,
    /// Points at which it does not fail.
    pub passed: usize,
    /// Points at which it fails.
    pub failed: usize,
    /// Points at which an ado breaks its rule first.
    pub no_answer: usize,
    /// Points at which it did not run.
    pub invalid: usize,
    /// Passed points at which a variation within the rules makes the ego fail.
    ///
    /// `None` without a search.
    pub strayed: Option<usize>,
    /// Passed points whose variations were not searched, because of an interruption.
    pub unsearched: usize,
    /// Most changes of the deviation in that search.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub switches: Option<usize>,
    /// Every point.
    pub points: Vec<PointResult>,
    /// Rows: every point as it is, then the search.
    #[serde(skip)]
    pub rows: Vec<Row>,
    #[serde(skip)]
    evaluated: EvaluatedEgo,
}

/// Cells of an ego, from which all points are played again.
#[derive(Clone)]
struct EvaluatedEgo {
    neutral: ExperimentCell,
    varied: Option<ExperimentCell>,
}

/// Plays an ego at every point, and searches variations of the passed points.
///
/// Points that were played before `watch` stopped are in the table. `None` if there are
/// none.
pub fn points(request: &PointsRequest<'_>, watch: &Watch<'_>) -> Option<PointsTable> {
    let scenario = request.ego.scenario();
    let (count, seed) = request.starts;
    // A table is played whole. A world without ranges has a single start.
    let most = match (scenario.starts(), scenario.axes().is_empty()) {
        (Some(all), _) => all.len(),
        (None, true) => 1,
        (None, false) => count,
    };
    let starts = untried_starts(scenario, seed, most);
    let neutral = Ado::Neutral.play(request.ego, &starts, watch)?;
    // An interruption before the first point leaves no table.
    if neutral.results.iter().all(Option::is_none) {
        return None;
    }
    let mut rows = vec![neutral.row.clone()];
    let mut evaluated = EvaluatedEgo {
        neutral,
        varied: None,
    };
    // With a single action there is nothing to vary.
    let varies = scenario.world().spaces().actions > 1;
    let switches = (varies && !watch.stopped()).then(|| {
        let default = || default_switches(scenario, &starts);
        request.switches.unwrap_or_else(default)
    });
    if let Some(switches) = switches {
        watch.phase(&format!("variations: {}", request.ego.name()));
        let passed = evaluated.passed();
        evaluated.varied = Search::switches(switches).play(request.ego, &passed, watch);
        rows.extend(evaluated.varied.iter().map(|cell| cell.row.clone()));
    }
    check_repeatability(request.ego, &starts, &mut rows, watch);
    let indices: Vec<usize> = (0..starts.starts.len()).collect();
    let results = EpisodeLoop::uncounted(&watch.quiet()).run(
        &indices,
        || scenario.bench(),
        |bench, index, _| Some(evaluated.result(bench, *index)),
    );
    let reached = indices.iter().zip(results);
    let mut results: Vec<PointResult> = reached
        .map(|(index, result)| result.unwrap_or_else(|| evaluated.blank(*index)))
        .collect();
    let is_void = rows.iter().any(Row::is_unrepeatable);
    if is_void {
        results.iter_mut().for_each(PointResult::void);
    }
    let count = |outcome| results.iter().filter(|it| it.outcome == outcome).count();
    let passed = count(PointOutcome::Passed);
    let varied = results.iter().filter_map(|it| it.varied.as_ref());
    let failing = varied.filter(|varied| varied.fails).count();
    // Only passed points are searched, and in a world with one action none is.
    let is_left = |it: &&PointResult| it.outcome == PointOutcome::Passed && it.varied.is_none();
    let left = results.iter().filter(is_left).count();
    let unsearched = if varies { left } else { 0 };
    // A search that was interrupted before its first point has found nothing out.
    let has_searched = !is_void && (unsearched < passed || unsearched == 0);
    Some(PointsTable {
        world: scenario.name().to_owned(),
        ego: request.ego.name().to_owned(),
        passed,
        failed: count(PointOutcome::Failed),
        no_answer: count(PointOutcome::NoAnswer),
        invalid: count(PointOutcome::Invalid),
        strayed: switches.filter(|_| has_searched).map(|_| failing),
        unsearched,
        switches,
        points: results,
        rows,
        evaluated,
    })
}

/// Returns the most changes of the ado's deviation from a plan.
fn default_switches(scenario: &Scenario, starts: &TestStarts) -> usize {
    // Invariant: `points` returns before this call if there is no start.
    let (start, noise) = &starts.starts[0];
    // A program plays every sequence from the start, which makes more changes too slow.
    if copies(scenario, start, *noise) {
        SWITCHES
    } else {
        SWITCHES_OF_PROGRAMS
    }
}

impl EvaluatedEgo {
    fn scenario(&self) -> &Scenario {
        self.neutral.ego.scenario()
    }

    /// Returns the starts, with all points left out except the passed ones.
    fn passed(&self) -> TestStarts {
        // A trivial start is not searched, so all points except the passed are marked as
        // such. The marks of the row do not tell passed points from broken rules.
        let points = 0..self.neutral.results.len();
        TestStarts {
            trivial: points
                .map(|index| self.outcome(index) != PointOutcome::Passed)
                .collect(),
            ..self.neutral.starts.clone()
        }
    }

    fn verdict(&self, index: usize) -> Option<&Verdict> {
        self.neutral.results[index].as_ref()?.verdict.as_ref()
    }

    fn outcome(&self, index: usize) -> PointOutcome {
        let verdict = self.verdict(index);
        verdict.map_or(PointOutcome::NotReached, outcome_of)
    }

    fn blank(&self, index: usize) -> PointResult {
        let scenario = self.scenario();
        let axes = scenario.axes().into_iter().map(|axis| axis.name);
        let (start, _) = &self.neutral.starts.starts[index];
        PointResult {
            point: index,
            start: axes.zip(start.0.iter().copied()).collect(),
            outcome: self.outcome(index),
            robustness: self.verdict(index).and_then(robustness),
            failure: None,
            varied: self.varied_outcome(index).map(VariedPoint::of),
        }
    }

    /// Returns the outcome of the search of variations of a point, if it was searched.
    fn varied_outcome(&self, index: usize) -> Option<StartOutcome> {
        let result = self.varied.as_ref()?.results[index].as_ref()?;
        Some(result.outcome)
    }

    fn result(&self, bench: &mut Testbench, index: usize) -> PointResult {
        let mut result = self.blank(index);
        if result.outcome == PointOutcome::Failed {
            let episode = self.neutral.replay(bench, index);
            result.failure = Some(failure(self.scenario(), &episode));
        }
        let varied = self.varied.as_ref();
        result.varied = varied.and_then(|cell| self.variation(cell, bench, index));
        result
    }

    fn variation(
        &self,
        cell: &ExperimentCell,
        bench: &mut Testbench,
        index: usize,
    ) -> Option<VariedPoint> {
        let mut varied = VariedPoint::of(self.varied_outcome(index)?);
        if varied.fails {
            let episode = cell.replay(bench, index);
            // A variation may also violate a specification that needs no contact.
            let contact = episode.contact.as_ref();
            varied.closing_mps = contact.map(|contact| contact.closing_speed_mps);
            varied.preventable = self
                .scenario()
                .preventability(&episode)
                .human_model_avoids();
        }
        Some(varied)
    }
}

impl VariedPoint {
    /// Returns the result of a search, without its contact.
    fn of(outcome: StartOutcome) -> VariedPoint {
        VariedPoint {
            fails: outcome == StartOutcome::Solved,
            invalid: outcome == StartOutcome::Invalid,
            closing_mps: None,
            preventable: None,
        }
    }
}

fn outcome_of(verdict: &Verdict) -> PointOutcome {
    match verdict {
        Verdict::Counterexample { .. } => PointOutcome::Failed,
        Verdict::Held { .. } | Verdict::Uncounted { .. } => PointOutcome::Passed,
        Verdict::Foul { .. } => PointOutcome::NoAnswer,
        Verdict::Invalid => PointOutcome::Invalid,
    }
}

fn robustness(verdict: &Verdict) -> Option<f64> {
    match verdict {
        // JSON cannot express an infinite margin.
        Verdict::Held { margin } => Some(*margin).filter(|margin| margin.is_finite()),
        Verdict::Counterexample { by } | Verdict::Uncounted { by } => Some(-by),
        Verdict::Foul { .. } | Verdict::Invalid => None,
    }
}

fn failure(scenario: &Scenario, episode: &Episode) -> PointFailure {
    let contact = episode.contact.as_ref();
    let decided = decided(scenario, episode);
    PointFailure {
        leaf: leaf(scenario, episode),
        // Invariant: an episode in which the ego fails is decided.
        violated_s: decided.map_or(0.0, |it| it.time_s),
        contact: contact.map(|touch| touch.between.clone()),
        closing_mps: contact.map(|touch| touch.closing_speed_mps),
    }
}

impl PointsTable {
    /// Returns whether the ego fails at any point or variation.
    pub fn fails(&self) -> bool {
        // Without variations only the points themselves can fail.
        self.failed + self.strayed.unwrap_or(0) > 0
    }

    /// Returns whether no point has an answer, because an ado breaks its rule first.
    pub fn lacks_answers(&self) -> bool {
        self.no_answer > 0 && self.passed + self.failed == 0
    }

    /// Returns the number of passed points whose variations were searched.
    pub fn searched(&self) -> usize {
        self.passed - self.unsearched
    }

    /// Returns the reason why no point is a result, if the ego is not deterministic.
    pub fn voided_by(&self) -> Option<&FaultCount> {
        let row = self.rows.iter().find(|row| row.is_unrepeatable())?;
        row.faults.first()
    }

    /// The world with the ego.
    pub fn scenario(&self) -> &Scenario {
        self.evaluated.scenario()
    }

    /// Plays failures again and keeps them as files.
    ///
    /// Points come with the neutral actions, then variations with the actions found.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        &self,
        dir: &Path,
        settings: KeepSettings,
        watch: &Watch<'_>,
    ) -> Result<Vec<KeptFiles>, KeptError> {
        let mut all = vec![settings.keep(&self.evaluated.neutral, dir, watch)?];
        if let Some(varied) = &self.evaluated.varied {
            let mut varied = settings.keep(varied, dir, watch)?;
            // The files of the failed points were written just before, and are not older.
            varied.older = varied.older.saturating_sub(all[0].files.len());
            all.push(varied);
        }
        for kept in &all {
            kept.note(&self.ego, dir, watch);
        }
        Ok(all)
    }

    /// The page of these points and its JUnit file, without examples yet.
    pub fn page(&self, commands: Vec<String>) -> PointsPage<'_> {
        let voided_by = self.voided_by();
        PointsPage {
            scenario: self.scenario(),
            ego: self.ego.clone(),
            summary: self.summary(),
            axes: self
                .scenario()
                .axes()
                .into_iter()
                .map(|it| it.name)
                .collect(),
            points: self.points.iter().map(|it| it.case(voided_by)).collect(),
            examples: Vec::new(),
            commands,
        }
    }

    /// Returns the numbers of passed points and variations, in a sentence.
    pub fn summary(&self) -> String {
        if let Some(fault) = self.voided_by() {
            return format!(
                "no result at any of {}: the ego {} ({})",
                counted(self.points.len(), "point"),
                VOIDED,
                fault.kind.word()
            );
        }
        let mut text = format!(
            "{} of {} passed, {} failed, {} did not run",
            self.passed,
            counted(self.points.len(), "point"),
            self.failed,
            self.invalid
        );
        if self.no_answer > 0 {
            text.push_str(&format!(", {} without an answer", self.no_answer));
        }
        if let Some(strayed) = self.strayed {
            let of = if self.unsearched == 0 {
                "passed"
            } else {
                "searched"
            };
            text.push_str(&format!(
                "; a lawful variation makes the ego fail at {strayed} of those {of}"
            ));
        }
        if self.unsearched > 0 {
            text.push_str(&format!(
                "; interrupted before the variations of {} were searched",
                counted(self.unsearched, "passed point")
            ));
        }
        text
    }

    /// Returns failures as examples for a page, at most `most`, the worst first.
    pub fn examples(&self, most: usize, watch: &Watch<'_>) -> Vec<Example> {
        let cells = [
            Some(&self.evaluated.neutral),
            self.evaluated.varied.as_ref(),
        ];
        let solved = cells.map(|cell| cell.map_or(Vec::new(), ExperimentCell::solved));
        let [failed, varied] = solved.map(Vec::into_iter);
        let failed = failed.map(|point| (point, false));
        let varied = varied.map(|point| (point, true));
        let mut chosen: Vec<(usize, bool)> = failed.chain(varied).collect();
        let closing = |(point, is_varied): &(usize, bool)| {
            let result = &self.points[*point];
            let (failure, varied) = (result.failure.as_ref(), result.varied.as_ref());
            let closing = if *is_varied {
                varied.and_then(|varied| varied.closing_mps)
            } else {
                failure.and_then(|failure| failure.closing_mps)
            };
            // Failures without a contact come after all contacts.
            closing.unwrap_or(-1.0)
        };
        // Ties keep the order of the points, so that the page is deterministic.
        chosen.sort_by(|a, b| closing(b).total_cmp(&closing(a)).then(a.cmp(b)));
        chosen.truncate(most);
        let scenario = self.scenario();
        let examples = EpisodeLoop::counted(watch, chosen.len()).run(
            &chosen,
            || scenario.bench(),
            |bench, (point, is_varied), _| {
                let episode = cells[usize::from(*is_varied)]?.replay(bench, *point);
                // A program is not started again for a film, and its recorded commands
                // drive.
                let mut bench = scenario.repeating(&episode).bench();
                let Film { frames, after } = film_beyond(&mut bench, &episode);
                Some(Example {
                    chosen_for: if *is_varied {
                        "A lawful variation".to_owned()
                    } else {
                        "The point as it is".to_owned()
                    },
                    start: Some(*point),
                    frames,
                    after,
                    about: description(scenario, &episode),
                    episode,
                    scenarios: Vec::new(),
                })
            },
        );
        examples.into_iter().flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::experiment::Remark;

    /// Plays eight points, and stops after so many variations on one thread, if any.
    fn stopped_after(variations: Option<u64>) -> PointsTable {
        let text = include_str!("../../../../worlds/acc.ron");
        let text = text.replacen("plant: Rigid", "plant: Kinematic", 1);
        let ego = EgoUnderTest::nominal(&Scenario::parse("acc.ron", &text).expect("sound"));
        let (stop, varies) = (AtomicBool::new(false), AtomicBool::new(false));
        let stop_after = |done: u64| {
            if varies.load(Ordering::Relaxed) && variations.is_some_and(|it| it <= done) {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let remarks = |remark: Remark<'_>| {
            if matches!(remark, Remark::Phase { what, .. } if what.starts_with("variations")) {
                varies.store(true, Ordering::Relaxed);
                stop_after(0);
            }
        };
        let progress = |done: u64, _: u64| stop_after(done);
        let watch = Watch {
            remarks: &remarks,
            ..Watch::new(&progress, &stop)
        };
        let request = PointsRequest {
            ego: &ego,
            starts: (8, 0),
            switches: Some(0),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.expect("a thread");
        pool.install(|| points(&request, &watch)).expect("points")
    }

    #[test]
    fn an_interrupted_search_of_variations_counts_the_points_that_it_leaves_out() {
        let whole = stopped_after(None);
        let passed = whole.passed;
        assert!(passed > 3, "{}", whole.summary());
        assert_eq!((whole.unsearched, whole.searched()), (0, passed));
        for variations in [0, 2] {
            let cut = stopped_after(Some(variations));
            assert_eq!(cut.passed, passed);
            assert!(cut.unsearched > 0, "{}", cut.summary());
            assert_eq!(cut.searched() > 0, variations > 0);
            // What was found before the interruption counts.
            let fails = |it: &PointResult| it.varied.as_ref().map(|varied| varied.fails);
            let pairs = cut.points.iter().zip(&whole.points);
            let searched = pairs.filter(|(cut, _)| cut.varied.is_some());
            let same = searched
                .clone()
                .all(|(cut, whole)| fails(cut) == fails(whole));
            assert!(same, "{}", cut.summary());
            let failing = searched.filter(|(cut, _)| fails(cut) == Some(true)).count();
            let strayed = (variations > 0).then_some(failing);
            assert_eq!(cut.strayed, strayed, "{}", cut.summary());
            let left_out = counted(cut.unsearched, "passed point");
            let words = format!("interrupted before the variations of {left_out} were searched");
            assert!(cut.summary().ends_with(&words), "{}", cut.summary());
        }
    }
}
