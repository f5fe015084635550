//! Cell of an experiment: its row, its result per start, and the records from which its
//! successes are played again.

use super::Searched;
use crate::adversary::{Evaluated, RecordedSuccess};
use crate::experiment::{EgoUnderTest, EpisodeLoop, TestStarts, Watch};
use crate::preventability::PANEL;
use crate::rulebook::Verdict;
use crate::run_dir::{AdversaryId, Row};
use crate::scene::drive::EgoDrive;
use crate::severity::Impact;
use crate::stats::StartOutcome;
use crate::stl::Explanation;
use crate::testbench::{Episode, NoisyStart, Testbench};

/// Most successes of a row to which the reference drivers are applied.
pub(super) const JUDGED: usize = 20;

/// Row of an ego and an adversary, with the results behind it.
#[derive(Clone, Debug)]
pub struct ExperimentCell {
    /// Ego under test, in the world that was played.
    pub ego: EgoUnderTest,
    /// Adversary, as kept counterexamples name it.
    pub adversary: AdversaryId,
    /// Test starts.
    pub starts: TestStarts,
    /// Rates and costs over all starts.
    pub row: Row,
    /// Result per start. `None`: trivial or not reached.
    pub results: Vec<Option<StartResult>>,
}

/// Result of an adversary on one start.
#[derive(Clone, Debug)]
pub struct StartResult {
    /// Outcome. A search without a success gives `Held`, unless every run broke a rule,
    /// the ego or the physics failed, or no run was played.
    pub outcome: StartOutcome,
    /// Verdict of the episode. `None`: a search has no verdict of its own.
    pub verdict: Option<Verdict>,
    /// Closing speed, if the agents touched.
    pub closing_speed_mps: Option<f64>,
    /// Effect of the contact on the ego, if the ego takes part in it.
    pub impact: Option<Impact>,
    /// Number of episodes.
    pub simulations: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    pub(crate) success: Option<RecordedSuccess>,
}

impl ExperimentCell {
    /// Creates the cell of an evaluation.
    pub fn evaluated(
        ego: &EgoUnderTest,
        starts: &TestStarts,
        evaluated: Evaluated,
    ) -> ExperimentCell {
        let Evaluated {
            row,
            outcomes,
            successes,
        } = evaluated;
        let results = outcomes
            .into_iter()
            .zip(successes)
            .map(|(outcome, success)| {
                outcome.map(|outcome| StartResult {
                    outcome: StartOutcome::from(&outcome.verdict),
                    verdict: Some(outcome.verdict),
                    closing_speed_mps: outcome.closing_speed_mps,
                    impact: outcome.impact,
                    simulations: outcome.simulations,
                    physics_steps: outcome.physics_steps,
                    success,
                })
            });
        ExperimentCell::of(ego, starts, row, results.collect())
    }

    /// Creates the cell of a search.
    pub fn searched(ego: &EgoUnderTest, starts: &TestStarts, searched: Searched) -> ExperimentCell {
        let results = searched.found.into_iter().map(|found| {
            found.map(|found| StartResult {
                outcome: match (&found.actions, &found.fault) {
                    (Some(_), _) => StartOutcome::Solved,
                    // A fault may have hidden a failure, so such a start is not called
                    // held.
                    (None, Some(_)) => StartOutcome::Invalid,
                    // A budget of 0 plays nothing.
                    (None, None) if found.simulations == 0 => StartOutcome::NotReached,
                    // Runs that all broke a rule show nothing about the ego.
                    (None, None) if found.violations == found.simulations => {
                        StartOutcome::RuleViolation
                    }
                    (None, None) => StartOutcome::Held,
                },
                verdict: None,
                closing_speed_mps: found.closing_speed_mps,
                impact: found.impact,
                simulations: found.simulations,
                physics_steps: found.physics_steps,
                success: found.actions.map(RecordedSuccess::of_actions),
            })
        });
        ExperimentCell::of(ego, starts, searched.row, results.collect())
    }

    fn of(
        ego: &EgoUnderTest,
        starts: &TestStarts,
        row: Row,
        results: Vec<Option<StartResult>>,
    ) -> ExperimentCell {
        ExperimentCell {
            ego: ego.clone(),
            adversary: row.ado.clone(),
            starts: starts.clone(),
            row,
            results,
        }
    }

    /// Plays a sample of the successes again, with the reference drivers in the ego's place.
    ///
    /// The row then counts the contacts that they avoid. Programs are not started again, so
    /// their searched successes are not in the sample.
    pub fn with_judged_contacts(mut self, watch: &Watch<'_>) -> ExperimentCell {
        // Reference drivers steer a vehicle, and an ego on a grid has none.
        if self.row.success_contacts.is_none() || self.ego.scenario().drive().is_none() {
            return self;
        }
        let is_foreign = self.ego.scenario().ego().is_some_and(EgoDrive::is_foreign);
        let runs_again = |index: &usize| {
            let commands = self.success(*index).map(|success| &success.commands);
            // Recorded commands drive again without the program that gave them.
            !is_foreign || commands.is_some_and(|commands| !commands.is_empty())
        };
        let solved: Vec<usize> = self.solved().into_iter().filter(runs_again).collect();
        // Spread evenly, so that the sample represents all starts.
        let most = solved.len().min(JUDGED);
        let sample: Vec<usize> = (0..most)
            .map(|nth| solved[nth * solved.len() / most])
            .collect();
        let bench = || self.ego.scenario().bench();
        let answers = EpisodeLoop::uncounted(watch).run(&sample, bench, |bench, index, _| {
            // The cell keeps actions and commands, from which the motion is made again.
            let again = self.replay(bench, *index);
            Some(self.ego.scenario().is_avoided_by_any(&again, &PANEL))
        });
        // A start that an interruption left out is in no count.
        let judged: Vec<Option<bool>> = answers.into_iter().flatten().collect();
        let count = |wanted: Option<bool>| judged.iter().filter(|it| **it == wanted).count();
        let (avoided, others) = (count(Some(true)), count(Some(false)));
        let not_judged = count(None);
        if let Some(contacts) = &mut self.row.success_contacts {
            contacts.judged = avoided + others;
            contacts.avoided = avoided;
            contacts.not_judged = not_judged;
        }
        self
    }

    /// Records trivial starts as successes of the neutral action, in a world of points.
    ///
    /// There each point is a question to the ego, which it fails by itself.
    pub fn record_failing_alone(&mut self) {
        let scenario = self.ego.scenario();
        if !scenario.judges_each_ego() {
            return;
        }
        let neutral = scenario.world().spaces().neutral;
        for (result, trivial) in self.results.iter_mut().zip(&self.starts.trivial) {
            // A start that was played after all keeps its own result.
            if *trivial && result.is_none() {
                *result = Some(StartResult {
                    outcome: StartOutcome::Trivial,
                    verdict: None,
                    closing_speed_mps: None,
                    impact: None,
                    simulations: 0,
                    physics_steps: 0,
                    success: Some(RecordedSuccess::of_actions(vec![neutral])),
                });
            }
        }
    }

    /// Returns the outcome of each start.
    ///
    /// Unlike `row.solved`, it tells a broken rule and an uncounted violation from a
    /// specification that held.
    pub fn outcomes(&self) -> Vec<StartOutcome> {
        let marks = self.row.solved.iter().zip(&self.results);
        let outcomes = marks.map(|(mark, result)| match result {
            // Of such an ego no outcome is known, although its crashes are.
            Some(_) if self.row.is_unrepeatable() => StartOutcome::Invalid,
            Some(result) => result.outcome,
            None => *mark,
        });
        outcomes.collect()
    }

    /// Returns the positions of the starts from which a success is recorded.
    pub fn solved(&self) -> Vec<usize> {
        let recorded = |index: &usize| self.success(*index).is_some();
        (0..self.results.len()).filter(recorded).collect()
    }

    fn success(&self, index: usize) -> Option<&RecordedSuccess> {
        self.results.get(index)?.as_ref()?.success.as_ref()
    }

    /// Plays the success of a start again, on a bench of the ego's world.
    ///
    /// A start without a success is played with action 0 throughout.
    pub fn replay(&self, bench: &mut Testbench, index: usize) -> Episode {
        let from = NoisyStart::from(&self.starts.starts[index]);
        let success = self.success(index).cloned().unwrap_or_default();
        success.play(self.ego.scenario(), bench, from)
    }

    /// Explains ρ(ψ_ego) in the first success, with the position of its start.
    pub fn explain_first(&self) -> Option<(usize, Explanation)> {
        let index = *self.solved().first()?;
        let scenario = self.ego.scenario();
        let episode = self.replay(&mut scenario.bench(), index);
        // Samples after the verdict may be worse, but did not decide it.
        let mut judged = episode.trace;
        judged.truncate(episode.judged);
        Some((index, scenario.rulebook().spec.explain(&judged)))
    }
}
